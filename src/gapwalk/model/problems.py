"""Problems of a model file: one per line, each with the place to correct, and with suggestions of names."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from string import digits
from typing import Any, NamedTuple

from gapwalk.errors import ModelError

# Answers to keys that name a known idea of mechanics: the line to write, or the reason why it cannot be modelled.
#
# An unknown key is often such an idea. The same list, in more words, is the page docs/reference/scope.md.

PAGE = "docs/reference/scope.md"


class Idea(NamedTuple):
    """An idea of mechanics: the words by which keys are recognised, and what to write, or why it cannot be."""

    words: str
    answer: str


IDEAS = (
    Idea(
        "friction|coulomb|slip_?torque|stiction|stick|mu_?[sk]|jenkins|iwan|hysteresis",
        "dry friction is a [[friction]] with its limit, the force in slip; that of a [[contact]], a [[shaft]] or a "
        "stage is its hysteresis",
    ),
    Idea(
        "restitution|bounce|rigid_?(stop|impact)|impulse",
        'a rigid stop is a [[contact]], a [[shaft]] or a stage with stiffness = "rigid", a clearance and a restitution '
        "from 0 to 1",
    ),
    Idea(
        "backlash|gap|play|lash|freeplay|free_?play|deadband|dead_?zone|half_?gap|slack",
        "a gap is the clearance of a [[contact]] (half the backlash), or of a [[gear]] or [[shaft]]: clearance = 0.5",
    ),
    Idea(
        "stop|bumper|wall|barrier|obstacle",
        'a stop on one side is a [[contact]] with side = "positive", a clearance and a stiffness; in a drive train a '
        'stop on both sides is stage = [{ clearance = "5 deg", stiffness = "100 N m/deg" }] of a [[shaft]], and one on '
        'one side a [[force]] with law = "k*max(x - g, 0)"',
    ),
    Idea(
        "torque|moment|force|load",
        'a constant load is mean = { engine = "10 N m" }, by inertia or coordinate, above all tables; one that repeats '
        "is a [[harmonic]]",
    ),
    Idea("preload|pretension|prestress", 'a spring with a preload is a [[contact]] with law = "piecewise" and preload'),
    Idea(
        "hertz|exponent|power_?law|nonlinear\\w*|duffing|quadratic|polynomial|spring_?law|formula|expression|equation",
        'a smooth force is a [[force]] with a formula, as in law = "k*x + a*x**3", and its numbers as further keys',
    ),
    Idea("drag|stribeck|aero\\w*|viscous_?drag", 'a drag is a [[force]], as in law = "c*v*abs(v)" and c = 0.1'),
    Idea(
        "curve|table|lookup|csv|points|characteristic|data",
        'a measured spring is curve = "clutch.csv" in a [[contact]]',
    ),
    Idea(
        "mesh_?(stiffness|variation)|parametric|time_?varying|modulation|contact_?ratio|varying",
        'a stiffness that varies over the angle is a [[harmonic]] with varies = "mesh.stiffness", or a [[rectangle]]',
    ),
    Idea(
        "transmission_?error|runout|base_?(motion|displacement|acceleration)|ground_?motion|kinematic|prescribed",
        'a prescribed displacement is a [[harmonic]] with varies = "mesh.deflection"',
    ),
    Idea(
        "unbalance|imbalance|eccentric\\w*|rotating_?(mass|force)|growth_?(order|power)",
        "the force of an unbalance is a [[harmonic]] with growth = 2: it grows with the square of the frequency",
    ),
    Idea(
        "rotating",
        "a rotating mass makes no torque at a steady speed: add it times the square of the crank radius to the inertia "
        "of the throw",
    ),
    Idea("delay|time_?delay|retard\\w*", "delays cannot be modelled: forces depend on the present state only"),
    Idea(
        "sweep_?rate|run_?up|transient\\w*",
        'loads repeat with the excitation, whose speed may change in a [[study]] of the kind "run-up"',
    ),
    Idea("noise|random|psd|stochastic", "loads repeat with the excitation; noise cannot be modelled"),
    Idea("gyroscopic|coriolis", "gyroscopic terms belong in the matrix damping, which need not be symmetric"),
    Idea(
        "control\\w*|feedback|pid",
        "a feedback of positions and velocities belongs in stiffness and damping, or in a [[force]]",
    ),
    Idea("pressure|fluid|thermal|temperature|magnet\\w*|electric\\w*", "only mechanical coordinates exist"),
)
"""All ideas, the most specific first."""


def idea_of(key: str) -> str:
    """Return the line to write for an idea that a key names, with the page that says more; empty if it names none."""
    word = key.lower().replace("-", "_")
    for idea in IDEAS:
        if re.fullmatch(rf"(\w+_)?({idea.words})s?(_\w+)?", word):
            return f"{idea.answer} (see {PAGE})"
    return ""


Path = tuple[str | int, ...]
"""The path to a value of a TOML document: keys, and places in lists from 0."""

_LISTED = 200  # problems in the text of an error; a matrix of strings has very many
_SHOWN = 60  # characters of a value that is quoted
_NAMED = 40  # names that are listed if none is similar to the unknown one
_BEGINNING = 3  # letters that suffice as the beginning of a name


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem of a model file."""

    #: The given value and the allowed ones. It continues the path in one sentence: ``contact[0].clearance is -1; it
    #: must ...``.
    message: str
    #: Dotted path of the key, for example ``contact[0].clearance``; empty if it concerns the file as a whole.
    path: str = ""
    #: Line of the file, from 1; None if the problem has no line (a missing key at the top, say).
    line: int | None = None
    file: str = ""  #: Name of the file as the user gave it.
    #: The path in readable form, with the names of tables: ``contact "stop".clearance``; by default the path.
    place: str = ""

    def __str__(self) -> str:
        place = self.file
        if self.line:
            place = f"{self.file}:{self.line}" if self.file else f"line {self.line}"
        path = self.place or self.path
        text = f"{path} {self.message}" if path else self.message
        line = f"{place}: {text}" if place else text
        # one line, without characters of a file that would control the terminal
        return "".join(char if char.isprintable() else repr(char)[1:-1] for char in line)


class ModelFileError(ModelError):
    """A model file that cannot be used; it lists all problems of the file."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        super().__init__(tuple(problems))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """All problems, in the order of the file."""
        return self.args[0]

    def __str__(self) -> str:
        lines = [str(problem) for problem in self.problems[:_LISTED]]
        if len(self.problems) > _LISTED:
            lines.append(f"... and {len(self.problems) - _LISTED} more")
        return "\n".join(lines)


def dotted(path: Path) -> str:
    """Write a path in dotted form: ``contact[0].stage[1].clearance``."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            text += ("." if text else "") + (key if re.fullmatch(r"[\w-]+", key) else json.dumps(key))
    return text


def named(path: Path, data: object) -> str:
    """Write a path with the names of those tables in lists that have one: ``contact "stop".clearance``."""
    text = ""
    for place, key in enumerate(path):
        around, data = data, inside(data, key)
        name = inside(data, "name")
        if isinstance(key, int) and isinstance(around, Sequence) and isinstance(name, str) and name.isidentifier():
            twice = sum(inside(other, "name") == name for other in around) > 1
            text += f"[{key}]" if twice else f' "{name}"'
        else:
            text += dotted((key,)) if isinstance(key, int) or not place else f".{dotted((key,))}"
    return text


def inside(data: Any, key: str | int) -> Any:
    """Return the value of a key or of a place in a list; None if there is none."""
    if isinstance(data, Mapping):
        return data.get(key)
    if isinstance(data, list) and isinstance(key, int):
        return data[key] if key < len(data) else None
    return None


def given(value: object) -> str:
    """Write a value as in a TOML file, in at most about 60 characters."""
    text = _toml(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def did_you_mean(word: str, known: Sequence[str], what: str = "they are") -> str:
    """Suggest the names that are spelled nearly as `word`, or list all names if none is."""
    near = near_names(word, known)
    if near:
        return f"did you mean {' or '.join(near)}?"
    more = f", ... ({len(known)} in all)" if len(known) > _NAMED else ""
    return f"{what} {', '.join(known[:_NAMED])}{more}"


WITHIN = (
    "a contact is open where its deflection is 0. For example, for a gap from -0.05 to 0.15 write clearance = 0.1, "
    "half of its width, and centre = 0.05; for one from 0.15 to 0.35 write clearance = 0.1, count the coordinate from "
    "its middle 0.25, and subtract the stiffness matrix times this position from the mean load; for a single stop that "
    "is pressed at rest write clearance = 0, and count the coordinate likewise from where it just touches"
)
"""The way to write a gap that does not contain the zero position."""

HALF = "write half of the free travel (of the backlash), from the middle of the gap to either side"
"""Words for the clearance of a link in a drive train."""


def near_names(word: str, known: Sequence[str]) -> list[str]:
    """Find at most three names that may be meant: misspelt ones, beginnings, and names of which the word is a part.

    Similar words with another meaning are not suggested: friction is not deflection.
    """
    plain = word.casefold()
    found = [(slips, name) for name in known if (slips := _distance(plain, name.casefold())) is not None]
    return [name for _, name in sorted(found, key=lambda each: each[0])[:3]]


def _distance(word: str, name: str) -> int | None:
    """Count the slips from a word to a name, or to its first parts; None if it is another word."""
    short, long = sorted((word, name), key=len)
    if word in re.split("[.-]", name) or (len(short) >= _BEGINNING and long.startswith(short)):
        return 0
    parts, others = word.split("."), name.split(".")
    if len(parts) > len(others):
        return None
    total = 0
    for part, other in zip(parts, others, strict=False):
        if (slips := _slips(part, other)) is None:
            return None
        total += slips
    return total


def _slips(first: str, second: str) -> int | None:
    """Count the letters to change, leave out, insert or swap with their neighbour to make two words equal.

    None if there are more slips than allowed: none in one or two letters, three in a long word. Numbers at the end may
    always differ by one slip: q3 for q2.
    """
    family = first.rstrip(digits)
    allowed = sum(max(len(first), len(second)) > length for length in (2, 4, 9))
    if family and family == second.rstrip(digits):
        allowed = 1
    if abs(len(first) - len(second)) > allowed:
        return None
    before: list[int] = []
    row = list(range(len(second) + 1))
    for i, letter in enumerate(first, start=1):
        older, before, row = before, row, [i]
        for j, other in enumerate(second, start=1):
            cost = min(before[j] + 1, row[-1] + 1, before[j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == second[j - 2] and first[i - 2] == other:
                cost = min(cost, older[j - 2] + 1)
            row.append(cost)
    return row[-1] if row[-1] <= allowed else None


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value[: 2 * _SHOWN], ensure_ascii=False)
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        items = ("[...]" if isinstance(item, list) else _toml(item) for item in value[:_SHOWN])
        return f"[{', '.join(items)}]"
    if isinstance(value, datetime.date | datetime.time):
        return f"the date or time {value.isoformat()}"
    try:
        return str(value)
    except ValueError:  # an integer of more digits than Python writes
        return "an enormous number"
