"""Parts of the source text of a kernel: lines that evaluate contact forces, and the loops around all lines.

The lines for the force of one contact are written from the closed form of its force law. Straight-line code of
thousands of lines in one loop would compile for seconds and spill registers, so it is cut into several loops. The lines
of a step that belong together form an *atom*. Consecutive atoms share a loop over the lanes until it is full. Values
that one loop computes and a later one needs are stored in rows of scratch memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import UnfitError
from gapwalk.flow.forces import Angles
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, CycleSlots, StageSlots, Wave
from gapwalk.model.laws import KINKS, Friction, Host, Stages, StageTerms, closed_form_of
from gapwalk.model.structure import Structure

# Source text by arithmetic: terms with ``+ - * /`` and functions write the lines of a kernel that compute them.


class Sheet:
    """Lines of source text, one for each operation; an operation that occurs twice is written once."""

    def __init__(self, prefix: str = "e") -> None:
        self._prefix = prefix
        self._names: dict[str, str] = {}
        self._needs: dict[str, tuple[str, list[str]]] = {}  # text of each name, and the names in it

    def name(self, text: str) -> Term:
        """Make a term of a name that the kernel knows already."""
        return Term(self, text)

    def write(self, pattern: str, *parts: Any) -> Term:
        """Write an operation: its text with ``{}`` for each part, a term or a number."""
        texts = [each.text if isinstance(each, Term) else _number(each) for each in parts]
        text = pattern.format(*texts)
        if text not in self._names:
            name = f"{self._prefix}{len(self._names)}"
            self._names[text] = name
            self._needs[name] = text, texts
        return Term(self, self._names[text])

    def lines(self, *results: Any) -> list[str]:
        """Return the lines on which some terms depend, in the order in which they were written."""
        needed, open_ = set(), [each.text for each in results if isinstance(each, Term)]
        while open_:
            name = open_.pop()
            if name in self._needs and name not in needed:
                needed.add(name)
                open_ += self._needs[name][1]
        return [f"{name} = {text}" for name, (text, _) in self._needs.items() if name in needed]


class Term:
    """A number that the kernel knows under a name."""

    __slots__ = ("sheet", "text")

    def __init__(self, sheet: Sheet, text: str) -> None:
        self.sheet, self.text = sheet, text

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.sheet.write("{} + {}", self, other)

    def __radd__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.sheet.write("{} + {}", other, self)

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.sheet.write("{} - {}", self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0.0) else self.sheet.write("{} - {}", other, self)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Switch):
            return other * self
        if _is(other, 0.0):
            return 0.0
        return self if _is(other, 1.0) else self.sheet.write("{} * {}", self, other)

    def __rmul__(self, other: Any) -> Any:
        return self * other

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1.0) else self.sheet.write("{} / {}", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.sheet.write("{} / {}", other, self)

    def __neg__(self) -> Any:
        return self.sheet.write("-{}", self)


class Switch(Term):
    """A mode, 1 where a term is positive and otherwise 0; it selects, so what it switches off may be infinite."""

    __slots__ = ("condition", "opposite")

    def __init__(self, sheet: Sheet, condition: str, opposite: str) -> None:
        super().__init__(sheet, sheet.write("1.0 if {} else 0.0", Term(sheet, condition)).text)
        self.condition, self.opposite = condition, opposite

    @classmethod
    def of(cls, guard: Any) -> Any:
        """Make the mode of a guard, a term or a number."""
        if not isinstance(guard, Term):
            return 1.0 if guard > 0.0 else 0.0
        condition = guard.sheet.write("{} > 0.0", guard).text
        return cls(guard.sheet, condition, guard.sheet.write("not {}", Term(guard.sheet, condition)).text)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        if _is(other, 1.0):
            return self
        return self.sheet.write("{} if {} else 0.0", other, Term(self.sheet, self.condition))

    def __rsub__(self, other: Any) -> Any:
        return Switch(self.sheet, self.opposite, self.condition) if _is(other, 1.0) else super().__rsub__(other)


def _is(value: Any, number: float) -> bool:
    return isinstance(value, int | float) and value == number


def _number(value: Any) -> str:
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def least(one: Any, other: Any) -> Any:
    """Return the smaller of a term and a term or a number."""
    return one.sheet.write("min({}, {})", one, other)


def greatest(one: Any, other: Any) -> Any:
    """Return the larger of a term and a term or a number."""
    return one.sheet.write("max({}, {})", one, other)


def size(term: Any) -> Any:
    """Return the absolute value of a term."""
    return term.sheet.write("abs({})", term)


def clipped(term: Any) -> Any:
    """Return a term between 0 and 1."""
    return least(greatest(term, 0.0), 1.0)


def either(condition: Term, one: Any, other: Any) -> Any:
    """Return one of two terms or numbers: the first where a condition holds."""
    return condition.sheet.write("{} if {} else {}", one, condition, other)


def bump(guard: Any, width: Any) -> Any:
    """Write the error of ``max(guard, 0)`` next to its kink, if the guard changes by `width` in a step."""
    away = least(size(guard) / width, 1.0)
    return width * (1.0 / 12.0) * ((1.0 - away) * (1.0 - 3.0 * away))


def floor(term: Any) -> Any:
    """Return the largest whole number below a term."""
    return term.sheet.write("np.floor({})", term)


def _function(name: str) -> Callable[..., Any]:
    def apply(*arguments: Any) -> Any:
        sheet = next((each.sheet for each in arguments if isinstance(each, Term)), None)
        if sheet is None:
            return float(getattr(np, name)(*arguments))
        return sheet.write(f"np.{name}({', '.join('{}' for _ in arguments)})", *arguments)

    return apply


def _power(base: Any, exponent: Any) -> Any:
    """Raise to a power; half of an odd number by a root, for which the processor has an instruction."""
    if isinstance(base, Term) and not isinstance(exponent, Term) and exponent in _HALVES:
        product = FUNCTIONS["sqrt"](base)
        for _ in range(int(exponent)):
            product = product * base
        return product
    return _function("power")(base, exponent)


_HALVES = (0.5, 1.5, 2.5, 3.5)

FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: _function(name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh")},
    "pow": _power,
}
"""The functions of formulas, of terms."""


# Variations over the angle in a kernel: the table of the excitation step by step, and the lines that read it.
#
# If all lanes have the same coefficients, the table holds the loads, the displacements and the variations of numbers
# themselves. Otherwise it holds cosines and sines, which each lane multiplies by its own coefficients.
#
# Method: docs/numerics/notes/ensembles.md

_Key = tuple[Any, ...]


class Excitation:
    """Writer of the terms that read the table ``T``, and the columns of it that they need.

    Shapes: `loaded` (2n,), bool.
    """

    def __init__(
        self,
        layout: CoefficientLayout,
        shared: bool,
        loaded: NDArray[np.bool_],
        name: Callable[[int], str],
        active: Callable[[int], bool],
    ) -> None:
        self._layout, self._shared, self._loaded, self._name, self._active = layout, shared, loaded, name, active
        self._first = int(loaded.sum()) if shared else 1 + 2 * len(layout.orders)
        self._keys: dict[_Key, tuple[int, Any]] = {}

    @property
    def columns(self) -> int:
        """Numbers per step; known when all lines are written."""
        return self._first + len(self._keys)

    def load(self, component: int) -> str:
        """Name the load on a component of the state over a step; for shared coefficients."""
        return f"t{int(self._loaded[:component].sum())}"

    def sway(self, sheet: Sheet, contact: int, argument: int, derivative: int = 0, *, start: bool = False) -> Any:
        """Write the displacement of a deflection, or its rate over time, at the end (or start) of a step; else 0."""
        slots = self._layout.contacts[contact]
        wave = slots.waves.get(slots.form.law.arguments[argument])
        if wave is None:
            return 0.0
        if self._shared:
            return self._column(sheet, ("sway", contact, argument, derivative, start), (slots, argument))
        lines = self._lines(sheet, wave, derivative, start)
        return lines / sheet.name(self._name(0)) if derivative and isinstance(lines, Term) else lines

    def varied(self, sheet: Sheet, slot: int, wave: Wave) -> Term:
        """Write a coefficient that varies, at the end of a step."""
        if self._shared:
            part: Any = self._column(sheet, ("wave", slot), wave)
        else:
            part = self._lines(sheet, wave, 0, False)
            for number, factor in wave.cycles:
                part = part + factor * self._level(sheet, self._layout.cycles[number])
        return sheet.name(self._name(slot)) * (1.0 + part)

    def table(self, coefficients: NDArray[np.float64], loads: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
        """Compute the table over one forcing period, shape (steps, columns)."""
        # Shapes: `loads` (2n, 1 + 2 orders).
        theta = 2.0 * np.pi * np.arange(steps) / steps
        after = 2.0 * np.pi * np.arange(1, steps + 1) / steps
        angles = np.multiply.outer(theta, np.array(self._layout.orders, dtype=float))
        basis = np.ones((steps, 1 + 2 * angles.shape[1]))
        basis[:, 1::2], basis[:, 2::2] = np.cos(angles), np.sin(angles)
        if self._shared:
            basis = basis @ loads[self._loaded].T
        if not self._keys:
            return basis
        levels: list[Any] = [share_at(coefficients, cycle, after, steps) for cycle in self._layout.cycles]
        start, end = (Angles(self._layout, coefficients, each, levels) for each in (theta, after))
        columns = [basis]
        for (kind, *rest), (_, what) in self._keys.items():
            if kind == "sway":
                (slots, argument), (*_, derivative, at_start) = what, rest
                column = (start if at_start else end).sway(slots, argument, derivative)
            elif kind == "wave":
                column = end.wave(what)
            elif kind == "angle":
                column = after
            elif kind == "steps":
                column = np.full(steps, steps / (2.0 * np.pi))
            else:
                column = end.waves[:, what]
            columns.append(np.broadcast_to(column, steps)[:, None])
        return np.hstack(columns)

    def _column(self, sheet: Sheet, key: _Key, what: Any = None) -> Term:
        place, _ = self._keys.setdefault(key, (self._first + len(self._keys), what))
        return sheet.name(f"t{place}")

    def _lines(self, sheet: Sheet, wave: Wave, derivative: int, start: bool) -> Any:
        """Write a sum of cosines and sines of all orders, or its derivative by theta."""
        total, count = 0.0, len(self._layout.orders)
        for place, slot in enumerate(wave.lines.tolist()):
            if not self._active(slot):
                continue
            order, is_sine = place % count, place >= count
            factor = 1.0 if not derivative else float(self._layout.orders[order]) * (1.0 if is_sine else -1.0)
            other = is_sine is not bool(derivative)  # a derivative swaps cosines and sines
            if start:
                column = sheet.name(f"t{1 + 2 * order + other}")
            else:
                column = self._column(sheet, ("line", order, other), order + count * other)
            total = total + factor * (sheet.name(self._name(slot)) * column)
        return total

    def _level(self, sheet: Sheet, cycle: CycleSlots) -> Term:
        theta, scale = self._column(sheet, ("angle",)), self._column(sheet, ("steps",))
        low, high, up, down = (sheet.name(self._name(slot)) for slot in cycle[1:])
        return low + (high - low) * _share(theta, up, down, cycle.order, scale, floor, clipped)


def share_at(
    coefficients: NDArray[np.float64], cycle: CycleSlots, theta: NDArray[np.float64] | float, steps: int
) -> NDArray[np.float64]:
    """Return the share of the higher level in samples at some angles, so that their sums are those of the jumps."""
    # Shapes: `coefficients` (..., number of coefficients).
    up, down = coefficients[..., cycle.up], coefficients[..., cycle.down]
    return _share(theta, up, down, cycle.order, steps / (2.0 * np.pi), np.floor, lambda t: np.clip(t, 0.0, 1.0))


def _share(theta: Any, up: Any, down: Any, order: int, scale: Any, floor: Callable, clip: Callable) -> Any:
    """Return the share of the higher level; `scale` is the number of steps per radian."""
    length, half = 2.0 * np.pi / order, (down - up) * 0.5
    turned = theta - (up + half)  # from the middle of the higher level
    turned = turned - length * floor(turned * (1.0 / length) + 0.5)
    rising, falling, cycle = (turned + half) * scale, (turned - half) * scale, length * scale
    return (
        (smooth_step(rising, clip) - smooth_step(falling, clip))
        + smooth_step(rising - cycle, clip)
        + (1.0 - smooth_step(falling + cycle, clip))
    )


def smooth_step(t: Any, clip: Callable[[Any], Any]) -> Any:
    """Return samples of a jump at 0; `t` is the distance from it in steps."""
    # Their sums with a smooth function are those of its integral from the jump on, up to an error of third order: the
    # derivative of this function reproduces linear functions by its values a step apart, and its second moment is 0. It
    # is the integral ``Q`` of the hat function, less a twelfth of the second difference of ``Q``.
    after, at, before, last = clip(t + 2.0), clip(t + 1.0), clip(t), clip(t - 1.0)
    middle = 0.5 * (at * at) + (before - 0.5 * (before * before))
    sides = 0.5 * (after * after) + (at - 0.5 * (at * at)) + 0.5 * (before * before) + (last - 0.5 * (last * last))
    return middle * (7.0 / 6.0) - sides * (1.0 / 12.0)


_TINY_TEXT = "1e-300"  # keeps the inverse of a vanishing speed finite
_Polynomial = dict[tuple[tuple[str, ...], int], float]
"""Factors by the parameters of the stage and the power of the penetration."""
LANES = 64
"""Trajectories per block: all of them execute the same instructions (SIMD)."""

# S: states, force history (and survey), one row of lanes after the other.  C: numbers of the scheme.  T: the excitation
# step by step.  If the state of a lane exceeds the limit, the period and its last state are recorded; it becomes NaN.
FRAME = """\
def advance(S, C, T, first, periods, steps, every, record, left, last, limit, stop):
{outside}
    for p in range(first, first + periods):
        if stop[0] != 0:
            return False
        for i in range(steps):
{times}
{loops}
        alive = 0
        for l in range({lanes}):
            if left[l] < 0:
                within = True
                for j in range({size}):
                    within = within and abs(S[j * {lanes} + l]) <= limit
                if within:
                    alive += 1
                    for j in range({size}):
                        last[j, l] = S[j * {lanes} + l]
                else:
                    left[l] = p
                    for j in range({size}):
                        S[j * {lanes} + l] = np.nan
        if every > 0 and (p + 1) % every == 0:
            row = (p + 1) // every - 1
            for j in range({size}):
                for l in range({lanes}):
                    record[row, j, l] = S[j * {lanes} + l]
        if alive == 0:
            return True
    return True
"""
Atom = Sequence[str]

_FULL = 64  # largest number of products in a loop
_NAME = re.compile(r"\b(?:[zufy]\d+|[hjp]\d+_\d+|c\d+)\b")
_TARGET = re.compile(r"^([zufy]\d+|[hj]\d+_\d+) = ")


@dataclass
class Chunk:
    """Atoms that share a loop over the lanes."""

    lines: list[str] = field(default_factory=list)  #: Lines of the atoms.
    #: Names that the lines use and do not define, in order of appearance.
    needs: dict[str, None] = field(default_factory=dict)
    gives: dict[str, None] = field(default_factory=dict)  #: Names that the lines define.
    keeps: list[str] = field(default_factory=list)  #: Defined names that later chunks need.

    def add(self, atom: Atom) -> None:
        """Append an atom."""
        for line in atom:
            target = _TARGET.match(line)
            for name in _NAME.findall(line[target.end() :] if target else line):
                if name not in self.gives:
                    self.needs[name] = None
            if target:
                self.gives[target[1]] = None
        self.lines += atom

    @property
    def numbers(self) -> list[str]:
        """Names of the scheme's numbers that the lines use."""
        return [name for name in self.needs if name.startswith("c")]

    def loads(self, rows: Mapping[str, int]) -> list[str]:
        """Return source lines that read the variables of earlier chunks from their rows of the storage."""
        return [f"{name} = S[{rows[name] * LANES} + l]" for name in self.needs if not name.startswith("c")]

    def stores(self, rows: Mapping[str, int]) -> list[str]:
        """Return the source lines that store variables for later chunks of the code."""
        return [f"S[{rows[name] * LANES} + l] = {name}" for name in self.keeps]


class ForceSource:
    """Writer of the lines for the force of one contact."""

    def __init__(self, slots: ContactSlots, name: Callable[[int], str], active: Callable[[int], bool]) -> None:
        self._slots, self._name, self._active = slots, name, active

    def lines(self, span: str, result: str) -> list[str]:
        """Write the lines for the force at the deflection ``x`` and its rate ``r``."""
        # A kink of the force between two steps leaves an error of second order in the sum over steps, ``B2(s) / 2``
        # times the jump of the slope (Euler and Maclaurin), where ``s`` is its position in the step. The bump ``(1 -
        # a)(1 - 3a) / 12``, ``a`` the distance from the breakpoint in steps, adds up to that over the steps next to the
        # kink. A force that jumps is averaged over the step.
        lines = [f"w = abs(r) * {span} + {_TINY_TEXT}", "inverse = 1.0 / w", "bump = w * (1.0 / 12.0)"]
        sums: dict[_Factor, list[str]] = {}
        for number, piece in enumerate(self._pieces()):
            lines += self._penetration(piece, f"on{number}")
            written: dict[str, str] = {}
            for factor, polynomial in piece.polynomials.items():
                sign = "-" if max(polynomial.values()) < 0.0 else ""
                text = self._text(polynomial, piece.stage, -1.0 if sign else 1.0, f"on{number}")
                if text not in written:  # damping in proportion to the force has the same text
                    written[text] = f"g{number}_{len(written)}"
                    lines.append(f"{written[text]} = {text}")
                name = sign + written[text]
                # the bump may be negative, so the sign of the deflection is a factor
                sums.setdefault(factor, []).append(f"np.copysign(1.0, x) * {name}" if factor in piece.odd else name)
        terms = []
        for factor, each in sums.items():
            numbers = [self._name(self._slots.numbers[name]) for name in factor.numbers]
            terms.append(" * ".join([*numbers, *["r"] * factor.rate, f"({total(each)})"]))
        return [*lines, f"{result} = {total(terms)}"]

    def _pieces(self) -> Iterator[_Piece]:
        stages, polynomials = iter(self._slots.stages), iter(self._polynomials())
        for form in self._slots.form.stages:
            mine = [(next(stages), next(polynomials)) for _ in form.side.signs]
            (stage, first), (_, second) = mine[0], mine[-1]
            mirrored = {
                factor: {term: -value for term, value in polynomial.items()} for factor, polynomial in first.items()
            }
            even = {factor for factor in first if second.get(factor) == first[factor]}
            odd = frozenset(factor for factor in first if second.get(factor) == mirrored[factor])
            if len(mine) == 2 and self._active(stage.clearance) and {*even, *odd} == {*first, *second}:
                yield _Piece(stage, True, first, odd)
            else:
                yield from (_Piece(each, False, those) for each, those in mine)

    def _polynomials(self) -> list[dict[_Factor, _Polynomial]]:
        """Return the force of each stage on each side as polynomials of its penetration."""
        found: list[dict[_Factor, _Polynomial]] = [{} for _ in self._slots.stages]
        for term in self._slots.form.closed_form("the batch integrator"):
            stage = self._slots.stages[term.stage]
            slots = [*(self._slots.numbers[name] for name in term.numbers), *map(stage.numbers.get, term.stage_numbers)]
            if all(slot is not None and self._active(slot) for slot in slots):
                of_factor = found[term.stage].setdefault(_Factor(term.numbers, term.rate), {})
                of_factor[term.stage_numbers, term.power] = term.factor * stage.sign**term.power
        return found

    def _penetration(self, piece: _Piece, on: str) -> list[str]:
        stage = piece.stage
        x = "abs(x)" if piece.folded else "x" if stage.sign > 0 else "-x"
        clearance = f" - {self._name(stage.clearance)}" if self._active(stage.clearance) else ""
        lines = [f"d = {x}{clearance}", "a = min(abs(d) * inverse, 1.0)", "deep = max(d, 0.0)"]
        if any(power == 0 for polynomial in piece.polynomials.values() for _, power in polynomial):
            lines.append(f"{on} = min(max(d * inverse + 0.5, 0.0), 1.0)")
        return lines

    def _text(self, polynomial: _Polynomial, stage: StageSlots, sign: float, on: str) -> str:
        powers = {0: on, 1: "(deep + bump * ((1.0 - a) * (1.0 - 3.0 * a)))"}
        terms = []
        for (names, power), factor in polynomial.items():
            number = [] if factor * sign == 1.0 else [repr(factor * sign)]
            depth = powers.get(power) or f"({' * '.join(['deep'] * power)})"
            terms.append(" * ".join([*number, *(self._name(stage.numbers[name]) for name in names), depth]))
        return total(terms)


class _Factor(NamedTuple):
    """Factor of a polynomial of the penetration: parameters of the contact, and a power of the rate."""

    numbers: tuple[str, ...]
    rate: int


def total(terms: Sequence[str]) -> str:
    """Write a sum."""
    text = " + ".join(term for term in terms if term != "0.0")
    return text.replace("+ -", "- ") or "0.0"


@dataclass(frozen=True)
class _Piece:
    """A stage on one side; or on both sides, folded into one, where its force is even or odd."""

    stage: StageSlots  #: Positions of its coefficients.
    folded: bool  #: True if it represents both sides.
    polynomials: dict[_Factor, _Polynomial]  #: Polynomials of the penetration, by their factors.
    odd: frozenset[_Factor] = frozenset()  #: Factors of a folded stage that change sign with the deflection.


def chunks_of(atoms: Sequence[Atom]) -> list[Chunk]:
    """Group consecutive atoms in chunks of limited size."""
    chunks, size = [Chunk()], 0
    for atom in atoms:
        cost = sum(line.count("*") for line in atom)
        if chunks[-1].lines and size + cost > _FULL:
            chunks.append(Chunk())
            size = 0
        chunks[-1].add(atom)
        size += cost
    later: set[str] = set()
    for chunk in reversed(chunks):
        chunk.keeps = [name for name in chunk.gives if name in later]
        later |= set(chunk.needs)
    return chunks


# Lines of a kernel for a force that is no polynomial of its depth: a formula, or any other law.
#
# They are written by the law itself, evaluated with terms of source text.

_TINY = 1e-300  # keeps the inverse of a vanishing change finite


class FormulaSource:
    """Writer of the lines for the force of one contact by evaluation of its law.

    Where a guard changes its sign between two steps, ``abs``, ``min`` and ``max`` have a kink. They are corrected by
    the bump of `gapwalk.ensemble.force_source.ForceSource`, with the change of the guard since the last step as the
    distance. So is the depth of a stage; what the force jumps by at its breakpoint is averaged over the step.
    """

    def __init__(self, slots: ContactSlots, number: Callable[[int], Term]) -> None:
        self._slots, self._number = slots, number

    def lines(
        self, sheet: Sheet, moves: Sequence[tuple[str, str]], span: str, past: Sequence[str], result: str
    ) -> tuple[list[str], dict[str, str]]:
        """Write the lines for the force; return them, and the names of those guards whose last values it needs."""
        form, law = self._slots.form, self._slots.form.law
        if law.rebounds:
            form.closed_form("the batch integrator")  # refuses it
        given = [(sheet.name(x), sheet.name(rate)) for x, rate in moves]
        modes: list[Any] = [0.0] * law.mode_count
        kinks: list[Any] = [None] * law.mode_count
        stages = self._stages(sheet, given[0], sheet.name(span))
        deflections = dict(zip(law.arguments, given, strict=True))

        def among(stages: Sequence[StageTerms]) -> Stages:
            return Stages(stages, deflections=deflections, modes=modes, functions=FUNCTIONS)

        terms = among([stage for stage, _ in stages])
        numbers: dict[str, Any] = {name: self._number(slot) for name, slot in self._slots.numbers.items()}
        numbers[KINKS] = kinks
        guards: list[Any] = []
        try:
            for mode in range(law.mode_count):  # a guard may depend on earlier modes
                guards.append(law.guards(given[0][1], terms, numbers)[mode])
                modes[mode] = Switch.of(guards[mode])
                if isinstance(guards[mode], Term):
                    kinks[mode] = bump(guards[mode], size(guards[mode] - sheet.name(past[mode])) + _TINY)
            force = law.force(given[0][1], terms, numbers)
            for place, (_, early) in enumerate(stages):
                just = [
                    among(
                        [
                            replace(stage, closed=mode, depth=0.0) if at == place else stage
                            for at, (stage, _) in enumerate(stages)
                        ]
                    )
                    for mode in (1.0, 0.0)
                ]
                jump, none = (law.force(given[0][1], each, numbers) for each in just)
                force = force - early * (jump - none)
        except TypeError as error:
            raise UnfitError(
                f"the batch integrator cannot include {form.name!r}: the formula of its force law {law.name!r} uses "
                f"more than + - * / and the functions that it is given ({error})"
            ) from error
        lines = sheet.lines(force)
        text = "\n".join(lines)
        kept = {name: guard.text for name, guard in zip(past, guards, strict=True) if re.search(rf"\b{name}\b", text)}
        return [*lines, f"{result} = {force.text if isinstance(force, Term) else repr(float(force))}"], kept

    def _stages(self, sheet: Sheet, move: tuple[Term, Term], span: Term) -> list[tuple[StageTerms, Term]]:
        """Return the stages, each closed from a step before its breakpoint on, with the excess of its mode."""
        found, (x, rate) = [], move
        width = size(rate) * span + _TINY
        for stage in self._slots.stages:
            values = {name: self._number(slot) for name, slot in stage.numbers.items()}
            past = (x if stage.sign > 0 else -x) - values["clearance"]
            depth = greatest(past, 0.0) + bump(past, width)
            closed = Switch.of(past + width)
            mean = clipped(past / width + 0.5)
            terms = StageTerms(stage.sign, depth if stage.sign > 0 else -depth, closed, stage.innermost, values)
            found.append((terms, closed - mean))
        return found


# Lines of a kernel for a Jenkins element, a spring in series with a slider: its extension, and its force.
#
# The extension follows the slip displacement and is clipped to the limit over the stiffness: a play operator. Between
# two steps it is also clipped where the displacement turns round, and it starts where a stage of its host closes, both
# by interpolation. The kinks and jumps of the force that this leaves between samples get the corrections of
# `gapwalk.ensemble.force_source.ForceSource`.


def past_of(structure: Structure, contact: int) -> list[str]:
    """Return the names of the numbers at the last step that the lines of a contact need, its modes among them."""
    law = structure.contacts[contact].law
    if law.has_memory:
        return ["deflection", "slip rate", "limit", *(["host"] if law.host else [])]
    return ["held"] if law.rebounds else [f"mode {mode}" for mode in range(law.mode_count)]


class HostTerms(NamedTuple):
    """The contact that hosts friction: its slots and numbers, deflection and rate now, last deflection, force."""

    slots: ContactSlots
    number: Callable[[int], Any]
    move: tuple[Term, Term]
    last: Term
    force: Term


class JenkinsSource:
    """Writer of the lines for the extension and the force of one Jenkins element."""

    def __init__(
        self, slots: ContactSlots, number: Callable[[int], Any], active: Callable[[int], bool], sheet: Sheet, span: Term
    ) -> None:
        law = slots.form.law
        assert isinstance(law, Friction)
        self._law, self._sheet, self._span = law, sheet, span
        self._own = {name: number(slot) if active(slot) else 0.0 for name, slot in slots.numbers.items()}

    def terms(self, move: tuple[Term, Term], extension: Term, past: Sequence[Term], host: HostTerms | None) -> Jenkins:
        """Write the lines for a step."""
        sheet, spring = self._sheet, self._own["stiffness"]
        x, rate = move[0], move[1] - self._own["speed"]
        before, last_rate, last_width, *_ = past
        travel = (x - before) - self._span * self._own["speed"] if self._own["speed"] else x - before
        stages = [] if host is None else self._stages(host)
        width = self._width([stage.terms for stage in stages], host)
        first, held, turned = self._first_part(travel, (last_rate, rate), (last_width, width))
        if host is not None:
            share = stages[0].share
            for stage in stages[1:]:
                share = greatest(share, stage.share)
            closing = sheet.write("{} > 0.0", share)
            first = either(closing, (1.0 - share) * travel, first)
            held = either(closing, last_width, held)
        between = _within(extension + first, held)
        found = _within(between + (travel - first), width)
        free = extension + travel
        sign = sheet.write("np.copysign(1.0, {})", travel)
        force = found - either(turned, 0.0, sign * self._slip_bump(sign, free, extension, width, last_width))
        if self._law.by == "stages":
            assert host is not None
            for place, stage in enumerate(stages):
                within = [
                    self._width(
                        [
                            replace(each.terms, closed=mode) if at == place else each.terms
                            for at, each in enumerate(stages)
                        ],
                        host,
                    )
                    for mode in (1.0, 0.0)
                ]
                force = force + self._switched(stage, travel, sign * free, free, within)
        return Jenkins(
            found,
            spring * force,
            spring * greatest(size(between), size(found)),
            [x, rate, width, *([] if host is None else [host.move[0]])],
        )

    def _width(self, stages: Sequence[StageTerms], host: HostTerms | None) -> Any:
        """Write the largest extension, the limit over the stiffness."""
        terms = Stages([])
        terms.host = None if host is None else Host(Stages(stages), host.force)
        return greatest(self._sheet.write("{}", self._law.limit(terms, self._own)), 0.0) / self._own["stiffness"]

    def _first_part(self, travel: Term, rates: tuple[Term, Term], widths: tuple[Term, Any]) -> tuple[Term, Any, Term]:
        """Write the displacement until it turns round in the step, the width there, and the condition that it does."""
        # It is that of the cubic through the displacements and rates at both ends.
        (last, rate), sheet = rates, self._sheet
        turned = sheet.write("{} < 0.0", last * rate)
        at = last / (last - rate)
        excess = travel - self._span * 0.5 * (last + rate)
        tip = self._span * 0.5 * (last * at) + excess * (at * at) * (3.0 - 2.0 * at)
        there = widths[1] if self._law.by == "limit" else widths[0] + at * (widths[1] - widths[0])
        return either(turned, tip, travel), either(turned, there, widths[1]), turned

    def _slip_bump(self, sign: Term, free: Term, extension: Term, width: Any, last_width: Term) -> Any:
        """Write the correction of the kink where slip begins; it vanishes during slip."""
        guard = sign * free - width
        change = guard - (sign * extension - (width if self._law.by == "stages" else last_width))
        return bump(guard, greatest(change, 0.0) + _TINY)

    def _switched(self, stage: _HostStage, travel: Term, pushed: Term, free: Term, widths: Sequence[Any]) -> Any:
        """Write the corrections where a stage of the host closes, a kink, and where it opens, a jump."""
        sheet, (wide, narrow) = self._sheet, widths
        kink = either(
            sheet.write("{} >= {}", pushed, narrow), travel * (bump(stage.depth, stage.reach) / stage.reach), 0.0
        )
        mean = clipped(stage.depth / stage.reach + 0.5)
        jump = (mean - stage.terms.closed) * (_within(free, wide) - _within(free, narrow))
        return either(sheet.write("{} > 0.0", stage.approach), kink, jump)

    def _stages(self, host: HostTerms) -> list[_HostStage]:
        """Return the stages of the host; one that presses is closed from a step before its breakpoint on."""
        x, rate = host.move
        reach, found = size(rate) * self._span + _TINY, []
        for slots in host.slots.stages:
            values = {name: host.number(slot) for name, slot in slots.numbers.items()}
            outward, before = (each if slots.sign > 0 else -each for each in (x, host.last))
            depth = outward - values["clearance"]
            closed = Switch.of(depth + reach if self._law.by == "normal" else depth)
            began = before - values["clearance"]
            # the part of the step after the breakpoint, if it closed within the step
            share = either(
                self._sheet.write("({} > 0.0) & ({} <= 0.0)", depth, began), depth / (depth - began + _TINY), 0.0
            )
            terms = StageTerms(slots.sign, depth, closed, slots.innermost, values)
            found.append(_HostStage(terms, depth, reach, rate if slots.sign > 0 else -rate, share))
        return found


class Jenkins(NamedTuple):
    """Extension and force of a Jenkins element at the end of a step, and the numbers that the next step needs.

    The force is corrected for kinks and jumps nearby; `most` is the largest size of the true one at a turn or the end.
    """

    extension: Any
    force: Any
    most: Any
    past: list[Any]


class _HostStage(NamedTuple):
    """A stage of a host: its terms, its depth, what that changes by in a step, its rate, its closed share of a step."""

    terms: StageTerms
    depth: Term
    reach: Term
    approach: Term
    share: Term


def _within(value: Term, width: Any) -> Term:
    return least(greatest(value, -width), width)


def refuse(structure: Structure) -> None:
    """Refuse what a kernel cannot carry."""
    by_name: Mapping[str, Any] = {contact.name: contact.law for contact in structure.contacts}
    for contact in structure.contacts:
        law, cannot = contact.law, f"the batch integrator cannot include {contact.name!r}: "
        if law.is_dry and not law.has_memory:
            raise UnfitError(
                f"{cannot}it sticks rigidly, and the steps are too long for that; give it a stiffness "
                '(stiffness = "..."), which makes it a Jenkins element, or use the exact flow (gapwalk.integrate)'
            )
        if law.is_dry and law.host and by_name[law.host].rebounds:
            raise UnfitError(
                f"{cannot}the rigid stop {law.host!r} presses, and the batch integrator has no force for it; give the "
                "stop a stiffness, or use the exact flow (gapwalk.integrate)"
            )
        if law.rebounds and closed_form_of(law, contact.shapes) != ():
            advice = "leave that force out, or use the exact flow (gapwalk.integrate)"
            raise UnfitError(f"{cannot}its force law {law.name!r} has a force between impacts too; {advice}")
    for variation in structure.variations:
        contact = structure.contacts[variation.contact]
        if not variation.is_deflection and (contact.law.rebounds or (contact.law.is_dry and variation.name == "speed")):
            raise UnfitError(
                f"the batch integrator cannot include {contact.name!r}: its {variation.name} varies over the angle; "
                f'let it move instead (varies = "{contact.name}.deflection"), or use the exact flow (gapwalk.integrate)'
            )


# Lines of a kernel for a rigid stop: impacts within a step, and contacts that are held.
#
# The crossing of the clearance is the zero of the cubic through the deflections and rates at both ends of the step. An
# impulse there changes the state at the end by the exact propagation of the linear part over the rest of the step. If
# the deflection falls back within that rest, the contact is held: at the end of the step, a reaction has brought the
# deflection to the clearance and its rate to zero. It is released where the motion without a reaction leads away.

_ITERATIONS = 3  # of Newton's method, from the zero of a parabola


class Impact(NamedTuple):
    """Impact and hold of a stop in a step, in terms, each times the side of the stop: +1 or -1."""

    impulse: Any  #: Change of the rate of the deflection by the impact; 0 if there is none.
    rest: Any  #: Part of the step after the impact.
    #: depth, rate: Deflection past the clearance, and rate, which a reaction removes at the end of the step; 0 if it is
    #: not held.
    depth: Any
    rate: Any
    held: Any  #: 1 or -1 if it is held from now on, otherwise 0.


class RigidSource:
    """Writer of the lines for one rigid stop."""

    def __init__(self, sheet: Sheet, clearances: Mapping[int, Any], span: Term) -> None:
        self._sheet, self._clearances, self._span = sheet, clearances, span

    def impact(
        self,
        start: tuple[Term, Term],
        end: tuple[Term, Term],
        held: Term,
        rebound: Callable[[Any], Any],
        echo: Callable[[int, Any], Any],
    ) -> Impact:
        """Write the lines for a step."""
        sheet, span = self._sheet, self._span
        side, clearance = self._side(end[0])
        (before, rate), (after, last) = ((_turned(x, side) - clearance, _turned(v, side)) for x, v in (start, end))
        at, speed, top = self._crossing(before, rate, after, last)
        rest = 1.0 - at
        speed = speed / span
        through = sheet.write("({} > 0.0) | ({} > 0.0)", after, top)
        echoes = [echo(which, rest) for which in (0, 1)]
        change = speed - _turned(rebound(_turned(speed, side)), side)
        falls_back = sheet.write("{} - {} * {} > 0.0", after, change, echoes[0])
        meets = sheet.write("{} & ({} == 0.0)", through, held)
        impulse = either(meets, either(falls_back, speed, change), 0.0)
        depth, rate = after - impulse * echoes[0], last - impulse * echoes[1]
        holds = sheet.write("{} > 0.0", depth)
        found = impulse, either(holds, depth, 0.0), either(holds, rate, 0.0), either(holds, 1.0, 0.0)
        impulse, depth, rate, holds = (_turned(each, side) for each in found)
        return Impact(impulse, rest, depth, rate, holds)

    def again(self, end: tuple[Term, Term], removed: tuple[Term, Term], held: Term, struck: Term) -> tuple[Any, ...]:
        """Write what a reaction removes in all, after those of other stops, what of that is new, and if it is held."""
        # A reaction that would pull is left out: Gauss and Seidel's method, projected. Where another stop was `struck`
        # and is not held, the contact is no longer held: it may meet its stop again in the next step.
        sheet, (_, clearance) = self._sheet, self._side(held)
        depth = removed[0] + (end[0] - held * clearance)
        holds, struck = sheet.write("{} * {} > 0.0", depth, held), sheet.write("{} > 0.0", struck)
        depth = either(struck, removed[0], either(holds, depth, 0.0))
        rate = either(struck, removed[1], either(holds, removed[1] + end[1], 0.0))
        free = either(struck, 0.0, either(holds, held, 0.0))
        return depth, rate, depth - removed[0], rate - removed[1], free

    def _side(self, value: Term) -> tuple[Any, Any]:
        """Write the side that a value tells, and the clearance there."""
        sides = [*self._clearances]
        if not sides[1:]:
            return sides[0], self._clearances[sides[0]]
        up, down = self._clearances[1], self._clearances[-1]
        return self._sheet.write("np.copysign(1.0, {})", value), either(self._sheet.write("{} > 0.0", value), up, down)

    def _crossing(self, before: Term, rate: Term, after: Term, last: Term) -> tuple[Term, Term, Term]:
        """Write the place of the zero of a cubic in the step, its slope there over a step, and its value at a turn."""
        sheet, span = self._sheet, self._span
        slope, bend = span * rate, span * (last - rate)
        curve, excess = (after - before) - slope, (after - before) - span * 0.5 * (rate + last)
        root = FUNCTIONS["sqrt"](greatest(slope * slope - 4.0 * (curve * before), 0.0))
        at = either(
            sheet.write("{} > 0.0", slope), before * -2.0 / (slope + root), (root - slope) / (curve * 2.0 + _TINY)
        )

        def value(at: Any) -> Any:
            return before + slope * at + bend * 0.5 * (at * at) + excess * (at * at) * (3.0 - 2.0 * at)

        def tangent(at: Any) -> Any:
            return slope + bend * at + excess * 6.0 * (at * (1.0 - at))

        at = clipped(at)
        for _ in range(_ITERATIONS):
            at = clipped(at - either(sheet.write("{} > 0.0", tangent(at)), value(at) / tangent(at), 0.0))
        turns = sheet.write("({} > 0.0) & ({} < 0.0)", rate, last)  # it may reach the clearance between two steps
        return at, greatest(tangent(at), 0.0), either(turns, value(rate / (rate - last)), -1.0)


def polynomial(names: Sequence[Term], at: Any) -> Any:
    """Write a polynomial with some coefficients, of ascending powers."""
    total: Any = names[-1]
    for name in reversed(names[:-1]):
        total = name + total * at
    return total


def _turned(value: Term, side: Any) -> Any:
    """Multiply by a side."""
    if isinstance(side, Term):
        return side * value
    return value if side > 0 else -value
