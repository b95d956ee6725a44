"""Panels of one motion: histories, contact loops, contact log, spectrum, section, multipliers, the machine in motion.

They are computed in one thread of the server; of several clicks only the last one is answered. What
friction and rigid stops add to them is in `gapwalk.explorer.motion_panels`.
"""

from __future__ import annotations

import asyncio
import base64
import math
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.section import points_of, strobe
from gapwalk.attractors.settle import Settled
from gapwalk.attractors.spectrum import spectrum
from gapwalk.bifurcation.branch import instabilities_along
from gapwalk.bifurcation.loci import Codim2Point, LocusPoint
from gapwalk.bifurcation.loci.gradient import Gradient, gradient, main_movers, moving_names
from gapwalk.bifurcation.special_point import Kind, SpecialPoint, at_once, words_of
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.explorer.diagram_lines import Line, is_at_hand, quantity
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.hysteresis import MODES, StickSlip, stick_slip
from gapwalk.flow.motion import (
    Motion,
    assembled_signals,
    contact_to_show,
    force_of,
    integrate,
    is_dry,
    sample,
    signal_names,
)
from gapwalk.model.contact import ContactForm
from gapwalk.model.system import System
from gapwalk.model.words import order_words, parameter_symbol, parameter_words, signal_words, value_words, with_error
from gapwalk.orbit.energy import Energy, EnergyItem, energy
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.machine.elements import Mover
from gapwalk.plot.machine.layout import NARROW, WIDE, scene_of
from gapwalk.plot.style import CODIM2, locus_style, symbol_style

# Branches and loci as arrays for the page: any quantity over any other, stability, and special points.

_STABILITY = ("stable", "below", "above", "pair", "neutral")


def labels() -> tuple[str, ...]:
    """Return the kinds of stability (see `Instability.label`), then of loci; the page receives their indices."""
    # Their order is that of the lines in ``page/curves.js``, which takes those of loci from `locus_lines`.
    return (*_STABILITY, *Kind.with_locus())


def locus_lines() -> list[dict[str, Any]]:
    """Describe the lines of loci for the page, in the order of `labels`: kind, legend, colour, dashes and width."""
    lines = []
    for kind in Kind.with_locus():
        dashes = kind.symbol.dashes
        lines.append(
            {
                "kind": kind.value,
                "text": locus_style(kind).text,
                "color": kind.symbol.color,
                "dashes": list(dashes[1]) if isinstance(dashes, tuple) else [],
                "width": kind.symbol.width,
            }
        )
    return lines


_PART = 40  # orbits of which a measure is computed at once: a click waits no longer than for these


class Node(NamedTuple):
    """Place on a line: the index of a point, or -1 - that of a special point, and the label of what follows it."""

    number: int
    orbit: Orbit
    label: int


class Quantities:
    """Two quantities of the orbits of a line; where that takes integrations, they are computed in small parts."""

    def __init__(self, line: Line, names: tuple[str, str], first: int = 0) -> None:
        self.line, self.names, self.first = line, names, first
        self._computed: dict[tuple[int, str], float] = {}

    def of(self, orbit: Orbit) -> tuple[float, float]:
        """Return both quantities of one orbit."""
        x, y = (self._computed.get((id(orbit), name)) for name in self.names)
        first, second = self.names
        return quantity(orbit, first) if x is None else x, quantity(orbit, second) if y is None else y

    def parts(self) -> Iterator[Callable[[], None]]:
        """Yield the computations that need integrations, part by part."""
        orbits = [each.orbit for each in (*self.line.points[self.first :], *self.line.special_points)]
        for name in dict.fromkeys(self.names):
            missing = [orbit for orbit in orbits if not is_at_hand(orbit, name)]
            for start in range(0, len(missing), _PART):
                yield lambda part=missing[start : start + _PART], name=name: self._compute(part, name)

    def _compute(self, orbits: Sequence[Orbit], name: str) -> None:
        self._computed.update({(id(orbit), name): quantity(orbit, name) for orbit in orbits})


def curve_of(wanted: Quantities) -> dict[str, Any]:
    """Return the points and special points of a branch or a locus in the order of the walk."""
    line = wanted.line
    nodes = nodes_of(line.points, line.special_points, wanted.first, line.kind)
    places = [wanted.of(node.orbit) for node in nodes]
    return {
        "count": len(line.points),
        "x": _packed([x for x, _ in places], "<f8"),
        "y": _packed([y for _, y in places], "<f8"),
        "node": _packed([node.number for node in nodes], "<i4"),
        "label": _packed([node.label for node in nodes], "u1"),
        "special": [
            words | dict(zip("xy", map(finite, wanted.of(each.orbit)), strict=True))
            for words, each in zip(special_words(line), line.special_points, strict=True)
        ],
    }


def nodes_of(
    points: Sequence[BranchPoint | LocusPoint],
    special_points: Sequence[SpecialPoint | Codim2Point],
    first: int = 0,
    kind: Kind | None = None,
) -> list[Node]:
    """Return the points and special points of a line in the order of the walk, from the point of index `first` on."""
    # `kind` is the kind of a locus; None for a branch.
    begin = points[first].arclength if first and first < len(points) else -np.inf
    if kind is None:
        along = instabilities_along([point for point in points if isinstance(point, BranchPoint)])
        found = [_STABILITY.index(each.label) for each in along]
    else:
        found = [labels().index(kind.value)] * len(points)
    nodes = [(points[i].arclength, Node(i, points[i].orbit, found[i])) for i in range(first, len(points))]
    if first < len(points):
        nodes += [
            (each.point.arclength, Node(-1 - i, each.orbit, _label(each, kind)))
            for i, each in enumerate(special_points)
            if each.point.arclength >= begin
        ]
    return [node for _, node in sorted(nodes, key=lambda placed: placed[0])]


def _label(each: SpecialPoint | Codim2Point, kind: Kind | None) -> int:
    """Return the label of the line from a special point on: the stability of its motions, or the kind of a locus."""
    if isinstance(each, SpecialPoint):
        return _STABILITY.index(each.after.label)
    assert kind is not None  # these lie on loci
    return labels().index(kind.value)


def special_words(line: Line) -> list[dict[str, Any]]:
    """Describe the special points of a line for the page: symbols, lines of text, and what can begin there."""
    # Points at one place have one description. Those after the first are marked: the page draws only that.
    names, every = (line.parameter, line.second), line.special_points
    if line.kind is not None:
        return [_words_of_codim2(each, names) for each in every if isinstance(each, Codim2Point)]
    groups = at_once([each for each in every if isinstance(each, SpecialPoint)])
    return [_words_of(group) | {"again": each is not group[0]} for group in groups for each in group]


def _words_of_codim2(special: Codim2Point, names: tuple[str, str]) -> dict[str, Any]:
    units, style = special.orbit.system.units, CODIM2[special.kind]
    at = (value_words(value, name, units, 9) for value, name in zip(special.values, names, strict=True))
    lines = [f"at {', '.join(at)}", special.contact]
    return {"kind": f"codim2 {special.kind.value}", "text": style.legend, "label": style.label, "lines": lines}


def _words_of(group: Sequence[SpecialPoint]) -> dict[str, Any]:
    special, words = group[0], words_of(group)
    units, style, kind = special.orbit.system.units, symbol_style(special.kind), special.kind
    unit = units.parameter(special.parameter) if units else ""
    at = f"at {with_error(special.value, special.uncertainty, 10)} {unit}".rstrip()
    many = words["kind"] if special.multiplicity > 1 else ""
    return {
        "kind": kind.value,
        "text": style.text,
        "label": style.label,
        "value": special.value,
        "lines": [at, *(words[name] for name in ("stability", "criticality", "contact")), many],
        "has_locus": not kind.no_locus and special.multiplicity == 1,
        "switches": special.ways > 0,
    }


def finite(value: float) -> float | None:
    """Return a number, or None for one that JSON cannot hold."""
    return value if math.isfinite(value) else None


def _packed(values: Sequence[float], kind: str) -> str:
    return base64.b64encode(np.array(values, dtype=kind).tobytes()).decode("ascii")


# Panels of dry friction and rigid stops: phases of slip and stick, impacts, and the energy of each element.

_BESIDE = 1e-5  # radians before and after an event, at which a motion is sampled; orbits know their events to 1e-8
_EVENTS = 400  # of a period, beside which it is sampled
_BOOKED = 60  # coordinates of a system whose energy is computed at a click
_NOTHING = 1e-12  # of the work, below which an energy is rounding


def is_element(form: ContactForm) -> bool:
    """Return True for dry friction and for rigid stops."""
    return form.law.is_dry or form.law.rebounds


def sampled_with_corners(orbit: Orbit, count: int) -> Motion:
    """Sample one period, evenly but also at each event, where forces have corners; before and after it if they jump."""
    if not orbit.is_exact:
        return orbit.motion(count)
    even = PERIOD * np.arange(count * orbit.period + 1) / count
    events = sorted({event.theta for event in (*orbit.slips, *orbit.events)})[:_EVENTS]
    restarts = () if is_dry(orbit.system.structure) else orbit.known_states
    return sample(orbit.system, orbit.state, _with_events(orbit.system, even, events), restarts)


def _with_events(system: System, even: NDArray[np.float64], events: Iterable[float]) -> NDArray[np.float64]:
    at = np.array(list(events))
    theta = np.unique(np.concatenate((even, at - _BESIDE, at + _BESIDE) if is_dry(system.structure) else (even, at)))
    return theta[(theta >= even[0]) & (theta <= even[-1])]


def phases_of(sampled: Motion) -> StickSlip | None:
    """Return the phases of dry friction and rigid stops; None if the system has neither."""
    return stick_slip(sampled) if is_dry(sampled.system.structure) else None


def elements_of(found: StickSlip) -> dict[str, Any]:
    """Return phases and impacts for the page."""
    names = list(found.elements)
    return {
        "names": names,
        "phases": [
            [names.index(each.element), each.mode, each.start / PERIOD, each.end / PERIOD] for each in found.phases
        ],
        "strikes": [[names.index(each.element), each.theta / PERIOD, each.velocity] for each in found.strikes],
        "shares": [_shares(found, name) for name in names],
    }


def _shares(found: StickSlip, name: str) -> dict[str, float]:
    shares = {mode: found.share(name, mode) for mode in (*MODES.values(), "held")}
    return {mode: share for mode, share in shares.items() if share}


def element_curve(sampled: Motion, index: int) -> dict[str, NDArray[np.float64]]:
    """Return the curves that the page draws of an element, besides force and deflection."""
    # It is the ``rate`` of the deflection of a rigid stop, whose force is no curve; and, if friction sticks by a
    # spring, the position of its ``slider``: the deflection less the extension of that spring.
    system, form = sampled.system, sampled.system.structure.contacts[index]
    memories = system.structure.memories
    if index in memories:
        return {"slider": sampled.deflections[:, index] - sampled.z[:, memories.index(index)]}
    return {"rate": sampled.deflection_rate(index)} if form.law.rebounds else {}


def energy_table(motion: Orbit | Settled) -> dict[str, Any]:
    """Return work and losses of a motion in one of its periods, or the reason why they are not known."""
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    try:
        if orbit is None:
            raise ModelError("this motion does not repeat itself, so there is no balance of energy over a period")
        book = energy(_of_small(orbit))
    except GapwalkError as error:
        return {"work": [], "losses": [], "unit": "", "imbalance": 0.0, "reason": str(error)}
    return {
        "work": [_item(book, each) for each in book.work],
        "losses": [_item(book, each) for each in book.losses],
        "unit": "" if book.system.units is None else "J",
        "imbalance": book.imbalance,
        "reason": "",
    }


def _of_small(orbit: Orbit) -> Orbit:
    size = orbit.system.size
    if size > _BOOKED:
        raise ModelError(
            f"the page computes the energy of at most {_BOOKED} coordinates, and this model has {size}; in Python: "
            "gw.analysis.energy(orbit)"
        )
    return orbit


def _item(book: Energy, item: EnergyItem) -> list[str | float]:
    total = max(sum(abs(each.energy) for each in items) for items in (book.work, book.losses))
    is_rounding = abs(item.energy) <= _NOTHING * total
    return [item.element, item.kind, 0.0 if is_rounding else item.energy, 0.0 if is_rounding else item.share]


def log_of(sampled: Motion, found: StickSlip | None, most: int) -> list[dict[str, Any]]:
    """Return the contact log: where stages close and open, stops are struck and held, and friction slips and sticks."""
    entries: list[tuple[float, str, str, float | None]] = []
    rigid = {form.name for form in sampled.system.structure.contacts if form.law.rebounds}
    for event in sampled.contacts:
        name, is_rigid = f"{event.contact}.{event.stage}" if event.stage else event.contact, event.contact in rigid
        if event.closes or not is_rigid:  # a stop is released, which is said below
            what = "is struck" if is_rigid else "closes" if event.closes else "opens"
            entries.append((event.theta, f"{name} {'+' if event.side > 0 else '-'}", what, event.velocity))
    first, last = float(sampled.theta[0]), float(sampled.theta[-1])
    for phase in found.phases if found is not None else ():
        if phase.start > first:
            entries.append((phase.start, phase.element, _BEGINS[phase.mode], None))
        if phase.mode == "held" and phase.end < last:
            entries.append((phase.end, phase.element, "is released", None))
    entries.sort(key=lambda entry: entry[0])
    return [
        {"periods": theta / PERIOD, "contact": name, "what": what, "velocity": velocity}
        for theta, name, what, velocity in entries[:most]
    ]


_BEGINS = {"slip +": "slips +", "slip -": "slips -", "stick": "sticks", "held": "is held"}


def axis_words(system: System, form: ContactForm) -> tuple[str, str]:
    """Return the labels of deflection and force of a contact, with their units."""
    return f"deflection of {signal_words(form.name, system.units)}", "force" + " [N m]" * (system.units is not None)


# Panel of what moves a special point most: each parameter's percent per percent, and the shift that it causes.

_BATCH = 8  # parameters whose derivatives are computed at once: a click waits no longer than for these
_FAINT = 1e-4  # error of a slope, relative to the largest one in percent per percent, above which it is marked
_MOST = 400  # parameters that are listed
_DIRECTION = re.compile(r"\.(deflection|force|acts_on)\.[^.]+$")  # how something is built, which nobody turns


class GradientWork:
    """Gradient of a special point, computed in parts, so that a click need not wait for all of it."""

    def __init__(self, special: SpecialPoint) -> None:
        self.special = special
        self._found: list[Gradient] = []
        self._reason = ""

    def parts(self) -> Iterator[Callable[[], None]]:
        """Yield the computations, part by part; after an error there are no further ones."""
        special = self.special
        moving = moving_names(special.orbit.system, special.parameter) if special.parameter else ()
        names = tuple(name for name in moving if not _DIRECTION.search(name))
        for start in range(0, max(1, len(names)), _BATCH):
            if not self._reason:
                yield lambda chosen=names[start : start + _BATCH]: self._compute(chosen)

    def _compute(self, names: tuple[str, ...]) -> None:
        try:
            self._found.append(gradient(self.special, names))
        except GapwalkError as error:
            self._reason = str(error)

    def content(self) -> dict[str, Any]:
        """Return the gradient for the page, or the reason why there is none; see `gradient_content`."""
        if self._reason:
            return {"reason": self._reason}
        names = tuple(name for each in self._found for name in each.names)
        slopes, errors = (np.concatenate([getattr(each, key) for each in self._found]) for key in ("slopes", "errors"))
        return gradient_content(Gradient(self.special, names, slopes, errors))


def gradient_of(special: SpecialPoint) -> dict[str, Any]:
    """Return the gradient of a special point for the page; see `gradient_content`."""
    work = GradientWork(special)
    for part in work.parts():
        part()
    return work.content()


def gradient_content(found: Gradient) -> dict[str, Any]:
    """Return a gradient for the page."""
    special = found.special
    units, parameter = special.orbit.system.units, special.parameter
    shares, values = found.elasticities, found.values
    doubts = np.abs(found.errors * values / special.value)
    largest = float(np.nanmax(np.abs(shares), initial=0.0))
    places, moves = {name: k for k, name in enumerate(found.names)}, (found.slopes * values).tolist()
    listed = main_movers(special.orbit.system, dict(zip(found.names, moves, strict=True)))[:_MOST]

    def row(name: str, move: float) -> dict[str, Any]:
        k = places.get(name)
        if k is None:  # the orders of one torque together, which nothing turns
            share = _plain(move / special.value if special.value else math.nan)
            return {
                "name": name,
                "words": f"{name}, all its orders",
                "unit": "",
                "value": None,
                "move": move,
                "share": share,
            }
        is_moved = abs(shares[k]) > _NOTHING * largest
        return {
            "name": name,
            "words": parameter_words(name, units),
            "unit": units.parameter(name) if units else "",
            "value": float(values[k]),
            "slope": _plain(found.slopes[k] if is_moved else 0.0),
            "share": _plain(shares[k] if is_moved else 0.0),
            "doubtful": bool(doubts[k] > _FAINT * largest),
        }

    return {
        "parameter": parameter,
        "symbol": parameter_symbol(parameter),
        "unit": units.parameter(parameter) if units else "",
        "at": special.value,
        "rows": [row(name, move) for name, move in listed if not _DIRECTION.search(name)],
    }


def _plain(value: float) -> float | None:
    """Return a number; None for percent of a point at zero."""
    return float(value) if np.isfinite(value) else None


_COORDINATES = 12  # whose histories are sent; a page shows no more
_CONTACTS = 24  # whose deflections are sent: as many as the machine shows
_LOG = 200  # entries of the contact log
_SAMPLES = 4096  # of a motion, at most; at least 32 a period
_PERIODS = 24  # of a motion that does not repeat
_ORDERS = 20.0  # of the spectrum


_STROBES = 400  # of a motion without period


def panels_of(motion: Orbit | Settled, signal: str, most: int = _SAMPLES) -> dict[str, Any]:
    """Return all panels of a motion except its spectrum, its section and its energy (see `details_of`)."""
    system = motion.system
    sampled = _sampled(motion, most)
    found = phases_of(sampled)
    names = list(system.coordinates[:_COORDINATES])
    if (base := signal.rstrip("'")) in system.coordinates and base not in names:
        names.append(base)
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    return {
        "period": orbit.period if orbit else None,
        "text": _text(motion),
        "stable": orbit.stable if orbit else None,
        "parameters": dict(system.parameters) if len(system.parameters) <= 1000 else {"frequency": system.frequency},
        "theta": _rounded(sampled.theta / PERIOD),
        "seconds": 2.0 * np.pi / system.frequency,
        "has_units": system.units is not None,
        "q": {name: _rounded(sampled.signal(name)) for name in names},
        "v": {name: _rounded(sampled.signal(f"{name}'")) for name in names},
        "a": {name: _rounded(sampled.signal(f"{name}''")) for name in names},
        "struck": _struck(sampled, names),
        "others": {signal: _rounded(sampled.signal(signal))} if signal in assembled_signals(system.structure) else {},
        **_contacts(sampled, signal),
        "elements": None if found is None else elements_of(found),
        "log": log_of(sampled, found, _LOG),
        "multipliers": [[z.real, z.imag] for z in orbit.multipliers.tolist()] if orbit else [],
        "machine": _machine(sampled),
    }


def details_of(motion: Orbit | Settled, signal: str) -> dict[str, Any]:
    """Return spectrum, section and energy of a motion."""
    return {**lines_and_section(motion, signal), "energy": energy_table(motion)}


def lines_and_section(motion: Orbit | Settled, signal: str) -> dict[str, Any]:
    """Return the spectrum of a signal, and the section of its coordinate."""
    orbit = motion if isinstance(motion, Orbit) else motion.orbit
    lines = spectrum(orbit or motion, signal)
    base = signal.rstrip("'")
    base = base if base in motion.system.coordinates else motion.system.coordinates[0]
    points = orbit.period if orbit else min(_STROBES, points_of(motion.system))
    states = strobe(motion.system, motion.state, points)
    shown = lines.orders <= _ORDERS * float(motion.system.turns or 1)
    return {
        "signal": signal,
        "across": order_words(motion.system.units),
        "orders": _rounded(lines.orders[shown]),
        "amplitudes": _rounded(lines.amplitudes[shown]),
        "section": {
            "of": base,
            "q": _rounded(states.signal(base)),
            "v": _rounded(states.signal(f"{base}'")),
            "states": {
                f"{name}{dash}": _rounded(states.signal(f"{name}{dash}"))
                for name in dict.fromkeys((base, *motion.system.coordinates[:_COORDINATES]))
                for dash in ("", "'")
            },
        },
    }


def check_signal(system: System, name: str) -> str:
    """Return a signal of the system, or its first coordinate if the name is unknown."""
    return name if name in signal_names(system) else system.coordinates[0]


def _sampled(motion: Orbit | Settled, most: int) -> Motion:
    if isinstance(motion, Settled):
        if motion.orbit is not None:
            return _sampled(motion.orbit, most)
        even = motion.motion(_PERIODS, samples=128)
        events = (event.theta for event in even.events)
        return sample(motion.system, motion.state, _with_events(motion.system, even.theta, events))
    return sampled_with_corners(motion, max(32, min(motion.samples, most // motion.period)))


def _text(motion: Orbit | Settled) -> str:
    if isinstance(motion, Settled):
        return "; ".join(motion.evidence) if motion.orbit is None else _text(motion.orbit)
    pattern = motion.pattern
    meaning = " (closings in a period on the + and - side)" if re.search(r"\d[+-]", pattern) else ""
    stability = _STABILITY_WORDS.get(motion.instability.label, motion.instability.label)
    return f"period {motion.period}, {stability}, contacts {pattern}{meaning}"


_STABILITY_WORDS = {
    "above": "unstable (a multiplier beyond +1)",
    "below": "unstable (a multiplier beyond -1)",
    "pair": "unstable (a complex pair of multipliers outside the unit circle)",
}


def _struck(sampled: Motion, names: Iterable[str]) -> dict[str, list[list[float]]]:
    """Return what accelerations leave out where rigid stops strike: instants in periods, and jumps of the velocity."""
    if not sampled.impacts:
        return {}
    found = {}
    for name in names:
        found[name] = _impulses(sampled, f"{name}''")
    return found


def _impulses(sampled: Motion, signal: str) -> list[list[float]]:
    """Return where a signal has impulses, in forcing periods, and their integrals over time."""
    theta, sizes = sampled.impulses(signal)
    return [_rounded(theta / PERIOD), _rounded(sizes / sampled.system.frequency)]


def _contacts(sampled: Motion, signal: str) -> dict[str, Any]:
    """Return the first contacts and the one that is shown by default, with its index."""
    system, forms = sampled.system, sampled.system.structure.contacts
    if not forms:
        return {"contacts": [], "shown": None}
    shown = contact_to_show(system, signal, np.abs(sampled.forces).max(axis=0), sampled.events)
    elements = [place for place, form in enumerate(forms) if is_element(form)]
    places = sorted({*range(len(forms))[:_CONTACTS], *elements[:_COORDINATES], shown})
    found = []
    for place in places:
        form, (across, up) = forms[place], axis_words(system, forms[place])
        stops = sorted(side * clearance for contact, side, clearance in system.breakpoints if contact == place)
        found.append(
            {
                "name": form.name,
                "signal": force_of(form),
                "across": across,
                "up": up,
                "deflection": _rounded(sampled.deflections[:, place]),
                "force": _rounded(sampled.forces[:, place]),
                "stops": stops,
                "is": "friction" if form.law.is_dry else "stop" if form.law.rebounds else "spring",
                **({"struck": _impulses(sampled, force_of(form))} if form.law.rebounds else {}),
                **{name: _rounded(values) for name, values in element_curve(sampled, place).items()},
            }
        )
    return {"contacts": found, "shown": places.index(shown)}


def scenes_of(system: System) -> list[dict[str, Any]]:
    """Return the drawings of the machine of a system for a narrow and a wide panel."""
    return _scenes(_still(system))[1]


def _still(system: System) -> System:
    """Return the system at one pace for all: the drawing does not show it, and points of a branch share a drawing."""
    return system.at({system.structure.pace: 1.0})


@lru_cache(maxsize=64)
def _scenes(system: System) -> tuple[tuple[Mover, ...], list[dict[str, Any]]]:
    """Return the movers and the drawings of a machine; they take longer than the rest of a click."""
    scenes = [scene_of(system, width) for width in (NARROW, WIDE)]
    return scenes[0].movers, [scene.to_dict() for scene in scenes]


def _machine(sampled: Motion) -> dict[str, Any]:
    """Return the drawings of the machine, the displacements of its bodies, and the stops of its gaps by their movers.

    The stops are those of the values of this motion, which a saved page shows on the drawing of other values.
    """
    movers, scenes = _scenes(_still(sampled.system))
    moved = []
    for each in movers:
        if each.kind == "body":
            values = sum((factor * sampled.q[:, place] for place, factor in each.row), np.zeros(len(sampled.q)))
            moved.append(_rounded(values))
    stops = [[each.low, each.high] if each.kind == "gap" else None for each in movers]
    return {"scenes": scenes, "moved": moved, "stops": stops}


def _rounded(values: NDArray[np.float64]) -> list[float]:
    """Round to the seven digits that a screen can show."""
    return [float(f"{value:.7g}") for value in values.tolist()]


T = TypeVar("T")

_TABS = 1000  # whose last clicks are remembered


class SupersededError(Exception):
    """Error: a newer click in the same tab has replaced the request."""


def _warm(system: System) -> None:
    from scipy import signal  # the windows of spectra: a second

    del signal
    with suppress(GapwalkError):
        integrate(system, state_at_rest(system))


class Flows:
    """Thread for work with compiled equations of motion: one call after the other, as parallel calls are not faster."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gapwalk-flows")
        self._last: dict[str, int] = {}
        self._guard = threading.Lock()
        self._behind = asyncio.Lock()

    def warm(self, system: System) -> None:
        """Load and compile in advance the code that the first click on an orbit needs."""
        self._thread.submit(_warm, system)

    async def do(self, call: Callable[[], T]) -> T:
        """Return the value of a call."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, call)

    async def do_behind(self, parts: Iterable[Callable[[], object]]) -> None:
        """Do work of low priority in parts, so that a click waits for one part at most."""
        async with self._behind:
            for part in parts:
                await self.do(part)

    async def do_last(self, tab: str, call: Callable[[], T]) -> T:
        """Return the value of a call, unless the same tab sends a newer request before it begins."""
        return await self.do(self._unless_newer(tab, self._number(tab), call))

    async def do_last_in_parts(self, tab: str, parts: Iterable[Callable[[], object]]) -> None:
        """Do work in parts, so that other clicks wait for one part at most; errors as `do_last`, before each part."""
        number = self._number(tab)
        for part in parts:
            await self.do(self._unless_newer(tab, number, part))

    def _number(self, tab: str) -> int:
        with self._guard:
            number = self._last.get(tab, 0) + 1
            if len(self._last) > _TABS:
                self._last.clear()
            self._last[tab] = number
        return number

    def _unless_newer(self, tab: str, number: int, call: Callable[[], T]) -> Callable[[], T]:
        def unless_old() -> T:
            if self._last.get(tab) != number:
                raise SupersededError("superseded by a newer request")
            return call()

        return unless_old

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(wait=True, cancel_futures=True)
