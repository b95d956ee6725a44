"""Panels of one motion: histories, contact loops, contact log, spectrum, section, multipliers, the machine in motion.

They are computed in one thread of the server; of several clicks only the last one is answered. What
friction and rigid stops add to them is in `gapwalk.explorer.friction_panels`.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Settled
from gapwalk.attractors.section import strobe
from gapwalk.attractors.spectrum import spectrum
from gapwalk.ensemble.start import state_at_rest
from gapwalk.errors import GapwalkError
from gapwalk.explorer.friction_panels import (
    axis_words,
    element_curve,
    elements_of,
    energy_table,
    is_element,
    log_of,
    phases_of,
    sampled_with_corners,
)
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion, force_of, integrate, signal_names, train_signals
from gapwalk.flow.signal import contact_to_show
from gapwalk.model.system import System
from gapwalk.model.words import order_words
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.machine.layout import NARROW, WIDE, scene_of
from gapwalk.plot.machine.scene import Mover

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
        "others": {signal: _rounded(sampled.signal(signal))} if signal in train_signals(system.structure) else {},
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
    states = strobe(motion.system, motion.state, orbit.period if orbit else _STROBES)
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
        return motion.motion(_PERIODS, samples=128) if motion.orbit is None else _sampled(motion.orbit, most)
    return sampled_with_corners(motion, max(32, min(motion.samples, most // motion.period)))


def _text(motion: Orbit | Settled) -> str:
    if isinstance(motion, Settled):
        return "; ".join(motion.evidence) if motion.orbit is None else _text(motion.orbit)
    return f"period {motion.period}, {motion.instability.words}, contacts {motion.pattern}"


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
    shown = contact_to_show(system, signal, np.abs(sampled.forces).max(axis=0))
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
