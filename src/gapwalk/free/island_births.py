"""Predictions by a backbone: the load needed to reach each free vibration, and where isolated branches are born.

Along a backbone, the amplitude of a load at which its work balances the losses says how large the load must be for the
response to reach each vibration. Where this amplitude has a minimum, there is no response below it and a closed branch
above it: an isolated branch is born. At a maximum, two branches join.

Method: docs/numerics/notes/tori.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve import numbered
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.flow.forces import accelerations
from gapwalk.free.backbone_curve import Backbone, BackbonePoint, free_equation
from gapwalk.free.free_shooting import shows_energy
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System, check_system
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit_equation import Equation
from gapwalk.summary import Rows, SummaryParts, Table, remarks, row_of, rows_of, summarizes

# Work of losses and of a load over a free vibration: the load at which the two balance.
#
# A lightly damped motion under a small load stays near a free vibration. Over a period the load puts in what the
# losses take: with the load in phase with the rate (phase resonance) the smallest amplitude suffices (Peter and Leine
# 2017, Mech. Syst. Signal Process. 96, 139-158; Hill, Cammarano, Neild and Barton 2016, Proc. R. Soc. A 473, 20160494;
# Cenedese and Haller 2020, Proc. R. Soc. A 476, 20200078, from Melnikov's method). Where the equations do not show
# their energy, its gradient is replaced by the left eigenvector of the monodromy matrix at the multiplier 1, carried
# along.
#
# Method: docs/numerics/notes/tori.md

_WORK_SAMPLES = 512  # of a period
_NONE = 1e-12  # work of a load, as a share of the largest possible, that is rounding


@dataclass(frozen=True, eq=False)
class WorkBalance:
    """Work of the losses of a system and of one of its loads over free vibrations of its backbone."""

    system: System  #: The system with its damping.
    line: Backbone  #: Its backbone.
    load: str  #: Name of a load with one order, such as ``harmonic1``.

    def amplitudes(self, point: BackbonePoint, harmonics: tuple[int, ...]) -> list[float]:
        """Return the amplitude of the load that balances the losses if it drives each of some harmonics."""
        # It is infinite where the free vibration has no such harmonic, or where the load does no work on it.
        lost, done = self._work(point, harmonics)
        return [lost / abs(each) if each else np.inf for each in done]

    def states(self, point: BackbonePoint, harmonic: int, amplitude: float) -> list[NDArray[np.float64]]:
        """Return the states of a free vibration at the two phases at which a load of some amplitude balances losses."""
        # They are those at the angle 0 of the excitation; guesses of the forced motions, shape (2n,) each.
        lost, (done,) = self._work(point, (harmonic,))
        share = lost / (amplitude * abs(done)) if done else np.inf
        if not 0.0 < share <= 1.0:
            return []
        system = self.line.system.at({self.pace: point.value})
        start, best = point.state, float(np.angle(done))
        flow, coefficients = flow_of(system), coefficients_of(system)
        found = []
        for way in (1.0, -1.0):
            angle = ((best + way * np.arccos(share)) / harmonic) % PERIOD
            found.append(flow.integrate(coefficients, start, 0.0, angle).state if angle > 0.0 else start)
        return found

    def _work(self, point: BackbonePoint, harmonics: tuple[int, ...]) -> tuple[float, list[complex]]:
        """Return the mean power of the losses, and for each harmonic the complex one of the load with amplitude 1."""
        # Its real part belongs to the phase at which both begin together.
        theta = PERIOD * np.arange(_WORK_SAMPLES) / _WORK_SAMPLES
        system = self.line.system.at({self.pace: point.value})
        states, weights = self._motion(system, point, theta)
        n = system.size
        q, v = states[:, :n], states[:, n:]
        lossy = self._plain.at({self.pace: point.value, **self._others})
        lost = -float(np.mean(np.sum(weights * (_accelerate(lossy, q, v) - _accelerate(system, q, v)), axis=1)))
        found = list[complex]()
        for harmonic in harmonics:
            push = self._push(point.value * harmonic / self.order)
            done = complex(np.mean((weights @ push) * np.exp(1j * harmonic * theta)))
            most = float(np.mean(np.abs(weights) @ np.abs(push)))
            found.append(done if abs(done) > _NONE * most else 0j)
        return lost, found

    @property
    def pace(self) -> str:
        """Name of the frequency."""
        return self.line.system.structure.pace

    @property
    def order(self) -> int:
        """Order of the load."""
        (order,) = next(each for each in self._plain.structure.harmonics if each.name == self.load).orders
        return order

    @property
    def _plain(self) -> System:
        return self.system.equations

    @property
    def _others(self) -> dict[str, float]:
        """The amplitudes of all loads, which are left out of the losses."""
        names = self._plain.structure.names
        known = (f"{each.name}.amplitude" for each in self._plain.structure.harmonics)
        return {name: 0.0 for name in known if name in names}

    def _push(self, pace: float) -> NDArray[np.complex128]:
        """Return the complex acceleration by the load with the amplitude 1 at a frequency of the excitation."""
        there = {**self._others, self.pace: pace}
        layout, structure = layout_of(self._plain.structure), self._plain.structure
        with_load, without = (
            coefficients_of(self._plain.at({**there, f"{self.load}.amplitude": size}))[layout.accelerations]
            for size in (1.0, 0.0)
        )
        lines = (with_load - without)[:, 2 * structure.size + len(structure.contacts) + 1 :]
        column, count = layout.orders.index(self.order), len(layout.orders)
        return lines[:, column] - 1j * lines[:, column + count]

    def _motion(
        self, system: System, point: BackbonePoint, theta: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the states at some angles, and the vectors whose products with accelerations are the work."""
        start, coefficients = point.state, coefficients_of(system)
        n = system.size
        if shows_energy(system):
            states = flow_of(system).sample(coefficients, start, theta).states
            return states, states[:, n:] @ system.matrix("mass").T
        flow = flow_of(system, transition=True)
        sampled = flow.vary(coefficients, start, theta)
        around = flow.integrate(coefficients, start, 0.0, PERIOD).transition
        assert around is not None
        # the gradient of the energy is at right angles to the motion; in the linear range another vector is not
        unit = system.state_scales()
        along = np.append(start[n:], _accelerate(system, start[:n], start[n:])) / unit
        across = np.linalg.svd(along[None])[2][1:].T
        defect = (around * unit / unit[:, None] - np.eye(2 * n)).T @ across
        left = across @ np.linalg.svd(defect)[2][-1] / unit
        weights = np.linalg.solve(sampled.transitions.transpose(0, 2, 1), left[:, None])[:, n:, 0]
        way = 1.0 if np.sum(weights * sampled.states[:, n:]) >= 0.0 else -1.0
        return sampled.states, way * weights


def _accelerate(system: System, q: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    return accelerations(layout_of(system.structure), coefficients_of(system), 0.0, q, v)


def check_load(system: System, load: str) -> None:
    """Raise a ModelError unless a system has a load of one order and an amplitude with this name."""
    structure = system.equations.structure
    names = [each.name for each in structure.harmonics]
    if load not in names:
        raise ModelError(
            f"load is {load!r}; it must be one of {', '.join(names) or 'none, for the system has no load'}"
        )
    form = structure.harmonics[names.index(load)]
    if len(form.orders) != 1 or f"{load}.amplitude" not in structure.names or form.varies:
        raise ModelError(f"{load} must be a harmonic that acts on coordinates, with one order and an amplitude")


_ROOM = 1.5  # half-widths of a box of starts, in the motion that is foretold
_SAMPLES = 256  # of that motion
_SHARP = 1e-4  # accuracy of a place between two points of a backbone
_POLE = 3.0  # ratio of a maximum to the points around it beyond which the harmonic vanishes there
_FLAT = 1e-6  # relative change of the amplitude within which a minimum is rounding


@dataclass(frozen=True, eq=False)
class IslandBirth:
    """Place at which an isolated branch is born, or joins another one, as a backbone foretells it."""

    _row: ClassVar = "mode harmonic period what amplitude uncertainty frequency swing=point.amplitude"

    harmonic: int  #: Harmonic of the free vibration that the load drives.
    period: int  #: Forcing periods after which the motion repeats.
    amplitude: float  #: Amplitude of the load.
    frequency: float  #: Frequency of the excitation, in the unit of the model.
    #: Error of the amplitude by the distance of the points of the backbone; that of the method grows with the damping.
    uncertainty: float
    joins: bool  #: True where branches join; False where one is born.
    point: BackbonePoint  #: The free vibration nearest to it.
    mode: int = 0  #: Number of the linear mode at which its backbone begins; 0 if it began at a release.

    @property
    def what(self) -> str:
        """What happens there, in words."""
        return "branches join" if self.joins else "an isolated branch is born"

    def __repr__(self) -> str:
        return (
            f"IslandBirth({self.what}: period {self.period}, amplitude {self.amplitude:.6g} at {self.frequency:.6g}, "
            f"half {self.point.amplitude:.4g})"
        )


@dataclass(frozen=True, eq=False)
class Foretold(Shown):
    """Forecast of a backbone for one load."""

    system: System  #: The system with its damping.
    line: Backbone  #: Its backbone.
    load: str  #: Name of the load.
    harmonics: tuple[int, ...]  #: The harmonics of the free vibration that it may drive.
    #: shape (points, harmonics): Amplitude of the load at which its work balances the losses at each point; infinite
    #: where it does none.
    amplitudes: NDArray[np.float64]
    births: tuple[IslandBirth, ...]  #: Minima and maxima of it along the backbone, in the order of the harmonics.

    def needed(self, frequency: float, harmonic: int) -> tuple[float, ...]:
        """Return the amplitudes of the load at which responses at a frequency reach the backbone."""
        values = self.line.values * harmonic / self._balance.order
        column, found = self.amplitudes[:, self.harmonics.index(harmonic)], []
        for k in range(len(values) - 1):
            first, last = values[k : k + 2]
            if first != last and min(first, last) <= frequency < max(first, last):
                share = (frequency - first) / (last - first)
                found.append(float(column[k] + share * (column[k + 1] - column[k])))
        return tuple(found)

    def starts(self, birth: IslandBirth, amplitude: float) -> tuple[System, list[NDArray[np.float64]]]:
        """Return the system above a birth, and states near two motions of the isolated branch."""
        there = self.system.at({self._balance.pace: birth.frequency, f"{self.load}.amplitude": amplitude})
        return there, self._balance.states(birth.point, birth.harmonic, amplitude)

    def box(self, birth: IslandBirth) -> tuple[float, ...]:
        """Return the half-widths of a box of starts for `gw.search` that holds the motion that is foretold."""
        system = self.line.system.at({self._balance.pace: birth.point.value})
        theta = PERIOD * np.arange(_SAMPLES) / _SAMPLES
        states = flow_of(system).sample(coefficients_of(system), birth.point.state, theta).states
        return tuple((_ROOM * np.abs(states).max(axis=0)).tolist())

    @property
    def _balance(self) -> WorkBalance:
        return WorkBalance(self.system, self.line, self.load)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the births in words."""
        born = sum(not birth.joins for birth in self.births)
        yield f"along {self.line!r}, {born} isolated branches are foretold for the load {self.load}"
        if self.births:
            yield births_table(self.births)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of births, and of the amplitudes along the backbone."""
        return {"births": lambda: rows_of(map(row_of, self.births)), "amplitudes": lambda: rows_of(self._along())}

    def _along(self) -> list[dict[str, Any]]:
        names = [f"amplitude.{harmonic}" for harmonic in self.harmonics]
        return [
            {**row_of(point), **dict(zip(names, row.tolist(), strict=True))}
            for point, row in zip(self.line.points, self.amplitudes, strict=True)
        ]

    def __repr__(self) -> str:
        return f"Foretold({self.load}, harmonics {', '.join(map(str, self.harmonics))}, {len(self.births)} events)"


def births_table(births: Sequence[IslandBirth]) -> Table:
    """Return a table of births, for the terminal."""
    return Table(
        ("what", ">mode", ">period", ">amplitude", ">±", ">frequency", ">half"),
        [
            (
                each.what,
                str(each.mode),
                str(each.period),
                f"{each.amplitude:.6g}",
                f"{each.uncertainty:.0e}",
                f"{each.frequency:.6g}",
                f"{each.point.amplitude:.4g}",
            )
            for each in births
        ],
    )


def foretell(system: System, line: Backbone, load: str = "harmonic1", harmonics: Sequence[int] = (1, 2, 3)) -> Foretold:
    """Foretell from a backbone at which amplitudes of a load isolated branches are born, for the damping of a system.

    The work of the load in phase resonance balances the losses over a free vibration. This holds for light damping and
    a small load; its error falls with the square of the damping. Other loads are left out.

    Parameters
    ----------
    system
        The system with its damping and its load.
    line
        Its backbone, from `backbone`.
    load
        Name of a harmonic load.
    harmonics
        Harmonics of the free vibration that the load may drive: 1 for its main resonance, 3 for a resonance in which
        the load has three times the frequency of the motion.

    Returns
    -------
    Foretold
        The amplitude of the load for each vibration of the backbone, and the births.

    Raises
    ------
    ModelError
        For an unknown load, or one of several orders; or a backbone of another system.

    Notes
    -----
    Energy balance: Hill, Cammarano, Neild and Barton (2016), Proceedings of the Royal Society A 473, 20160494; Cenedese
    and Haller (2020), Proceedings of the Royal Society A 476, 20200078.

    Examples
    --------
    >>> import gapwalk as gw
    >>> duffing = gw.System(
    ...     ["x"],
    ...     [1.0],
    ...     [0.02],
    ...     contacts=[gw.force("spring", {"x": 1.0}, "x*x*x")],
    ...     harmonics=[gw.Harmonic(0.1, {"x": 1.0})],
    ... )
    >>> found = gw.free.foretell(duffing, gw.free.backbone(duffing, 1, (0.5, 3.0)), harmonics=[3])
    >>> round(found.births[0].amplitude, 2)  # the subharmonic resonance of order 1/3
    0.46
    """
    check_system(system, "foretell")
    check_load(system, load)
    if line.system.structure != system.equations.structure:
        raise ModelError("the backbone belongs to another system; follow it with gw.free.backbone(system)")
    if not harmonics or any(isinstance(n, bool) or not isinstance(n, int) or n < 1 for n in harmonics):
        raise ModelError(f"harmonics is {harmonics!r}; it must hold integers from 1 on, such as (1, 2, 3)")
    balance, chosen = WorkBalance(system, line, load), tuple(harmonics)
    amplitudes = np.array([balance.amplitudes(point, chosen) for point in line.points])
    births = [
        birth
        for harmonic, column in zip(chosen, amplitudes.T, strict=True)
        for k in _turns(column)
        if (birth := _refined(balance, harmonic, Fraction(harmonic, balance.order), column, k)) is not None
    ]
    return Foretold(system, line, load, chosen, amplitudes, tuple(births))


def _turns(column: NDArray[np.float64]) -> list[int]:
    """Return the numbers of the points at which the amplitude has a minimum or a maximum along a backbone."""
    found = []
    for k in range(1, len(column) - 1):
        before, here, after = column[k - 1 : k + 2]
        is_known = bool(np.isfinite([before, here, after]).all()) and min(before, here, after) > 0.0
        if is_known and (here - before) * (after - here) < 0.0 and np.ptp(column[k - 1 : k + 2]) > _FLAT * here:
            found.append(k)
    return found


def _refined(
    balance: WorkBalance, harmonic: int, ratio: Fraction, column: NDArray[np.float64], k: int
) -> IslandBirth | None:
    """Return the extreme of the amplitude near a point, among free vibrations corrected onto the backbone."""
    # There is none where the harmonic vanishes: the amplitude is infinite there, whatever the load.
    from scipy.optimize import minimize_scalar  # imported late: it takes long

    joins = bool(column[k] > column[k - 1])
    between, sign = _Between(balance.line, k), -1.0 if joins else 1.0
    best = minimize_scalar(
        lambda place: sign * balance.amplitudes(between.at(float(place)), (harmonic,))[0],
        bounds=(-1.0, 1.0),
        method="bounded",
        options={"xatol": _SHARP},
    )
    point = between.at(float(best.x))
    amplitude = balance.amplitudes(point, (harmonic,))[0]
    if joins and amplitude > _POLE * max(column[k - 1], column[k + 1]):
        return None
    error = _SHARP**2 * abs(amplitude)
    if sign * amplitude > sign * column[k]:  # no vibration was found between the points
        point, amplitude, error = balance.line.points[k], float(column[k]), float(np.ptp(column[k - 1 : k + 2]))
    frequency, period = point.value * float(ratio), ratio.numerator
    return IslandBirth(harmonic, period, amplitude, frequency, error, joins, point, balance.line.mode)


def _at_rest(point: BackbonePoint) -> int:
    """Return the number of a coordinate that is at rest at the start of a free vibration."""
    return int(np.argmin(np.abs(point.rates) / np.maximum(point.half, 1e-9 * point.amplitude)))


class _Between:
    """Free vibrations between a point of a backbone and its two neighbours."""

    def __init__(self, line: Backbone, k: int) -> None:
        self._points = line.points[k - 1 : k + 2]
        equation = free_equation(
            line.system.at({line.system.structure.pace: line.points[k].value}), _at_rest(line.points[k])
        )
        size = max(float(np.abs(point.start).max()) for point in self._points)
        scales = np.append(equation.scales(size), line.points[k].value)
        self._corrector = Corrector(cast(Equation, cast(object, equation)), scales)
        self._x = [np.append(equation.unknowns(point.state), point.value) / scales for point in self._points]

    def at(self, place: float) -> BackbonePoint:
        """Return the vibration at a place, -1 to 1, on the parabola through the three; the nearest if that fails."""
        before, here, after = self._x
        guess = here + 0.5 * place * (after - before) + 0.5 * place**2 * (before - 2.0 * here + after)
        normal = (after - before) / float(np.linalg.norm(after - before))
        found = self._corrector.point_near(guess, normal)
        return self._points[1 + round(place)] if found is None else cast(BackbonePoint, cast(object, found.orbit))


# Record of several backbones of one system, with what they foretell.


@dataclass(frozen=True, eq=False)
class Backbones(Shown):
    """Backbones of one system, one for each linear mode or release."""

    lines: tuple[Backbone, ...]  #: The backbones.
    failures: tuple[str, ...] = ()  #: Modes without a backbone, with the reasons, in sentences.
    complete: bool = True  #: True if all were followed.
    #: What the backbones foretell for a load, if that was asked: where isolated branches are born, or join.
    births: tuple[IslandBirth, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks: none."""
        return ()

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return each backbone in words."""
        for line in self.lines:
            yield from line.summary()
        if self.births:
            yield "foretold for the damping of the system:"
            yield births_table(self.births)
        if notes:
            yield from remarks(self.notes, self.failures)

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of all points and events, with the number of the backbone."""
        return {
            "points": lambda: numbered("backbone", self.lines, lambda line: line.points),
            "events": lambda: numbered("backbone", self.lines, lambda line: line.events),
            "births": lambda: rows_of(map(row_of, self.births)),
        }
