"""Many run-ups, at many rates and from many starts: largest forces and where they occur, with their spread."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray

from gapwalk.answers.gap_states import SweepBy
from gapwalk.answers.goals import peaks
from gapwalk.answers.lane_run_up import batch_by_steps, is_by_steps, start_by_steps
from gapwalk.answers.run_up import run_batch, start_at
from gapwalk.answers.speed_course import SpeedCourse
from gapwalk.bifurcation.branch import Branch
from gapwalk.ensemble.batch_flow import BatchOptions
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import sample
from gapwalk.flow.ramp import Ramped
from gapwalk.model.bounds import check
from gapwalk.model.system import System, check_system
from gapwalk.model.words import parameter_symbol, value_words
from gapwalk.notebook import Shown
from gapwalk.picture_parts import Panel, Parts, Picture, Series, pictured
from gapwalk.summary import SummaryParts, Table, summarizes

LEVELS = (0.05, 0.5, 0.95)
"""Levels of the quantiles that are listed and drawn."""
_ROWS = 12  # of the table of rates
_SAME = 1e-9  # relative difference of rates that are one


@dataclass(frozen=True, eq=False, repr=False)
class RunUps(Shown):
    """Extremes, contact forces and impacts of many run-ups, each divided into equal times (bins)."""

    system: System  #: The system; its own speed is not used.
    courses: tuple[SpeedCourse, ...]  #: Speed over time of each run-up.
    phases: NDArray[np.float64]  #: shape (runs,): Angles of the excitation at the starts, in radians.
    #: low, high: shape (runs, bins, n): Smallest and largest value of each coordinate; NaN once a motion has diverged.
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    forces: NDArray[np.float64]  #: shape (runs, bins, contacts): Largest magnitude of each contact force.
    #: shape (runs, bins, contacts, 2): Closures of the innermost stages, on the positive and on the negative side.
    impacts: NDArray[np.float64]
    #: error, worst, trials: Error over a forcing period or a bin, whichever is longer, from comparisons with the exact
    #: flow: the root mean square and the largest of all; see `BatchOptions.error`. By equal steps, of the largest force
    #: of a run-up, from comparisons with half the step.
    error: float
    worst: float
    trials: int
    by_steps: bool = False  #: True if they were made by equal steps.

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        runs, contacts = len(self.courses), len(self.system.structure.contacts)
        if not (
            self.phases.shape == (runs,)
            and self.low.shape == self.high.shape
            and self.low.shape[:2] == self.forces.shape[:2] == self.impacts.shape[:2]
            and len(self.low) == runs
            and self.forces.shape[2] == contacts
        ):
            raise ValueError("the parts of some run-ups do not fit together")

    @property
    def complete(self) -> bool:
        """True: all run-ups are done."""
        return True

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the contacts."""
        return tuple(form.name for form in self.system.structure.contacts)

    @property
    def bins(self) -> int:
        """Number of bins of each run-up."""
        return self.forces.shape[1]

    @cached_property
    def rates(self) -> NDArray[np.float64]:
        """Mean change of the speed by time of each run-up, without sign, shape (runs,)."""
        return np.array([abs(each.speed[-1] - each.speed[0]) / each.duration for each in self.courses])

    @cached_property
    def diverged(self) -> NDArray[np.bool_]:
        """True for each run-up whose motion diverged."""
        return np.asarray(np.isnan(self.low).any(axis=(1, 2)))

    @cached_property
    def speeds(self) -> NDArray[np.float64]:
        """Speed in the middle of each bin, shape (runs, bins)."""
        shares = (np.arange(self.bins) + 0.5) / self.bins
        return np.array([each.at(each.duration * shares)[0] for each in self.courses])

    def peaks(self, contact: str) -> NDArray[np.float64]:
        """Return the largest magnitude of a contact's force in each run-up, shape (runs,); NaN if it diverged."""
        return self.forces[:, :, self._place(contact)].max(axis=1)

    def places(self, contact: str) -> NDArray[np.float64]:
        """Return the speed of the bin with the largest force of a contact in each run-up, shape (runs,)."""
        forces = np.nan_to_num(self.forces[:, :, self._place(contact)])
        return self.speeds[np.arange(len(forces)), forces.argmax(axis=1)]

    def quantiles(self, contact: str, levels: Sequence[float] = LEVELS) -> tuple[NDArray, NDArray]:
        """Return the different rates, and quantiles of the largest force at each, shapes (rates,), (levels, rates)."""
        peaks, rates, group = self.peaks(contact), *self._groups
        return rates, np.array([np.nanquantile(peaks[group == k], levels) for k in range(len(rates))]).T

    @cached_property
    def _groups(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        order = np.argsort(self.rates, kind="stable")
        sorted_rates = self.rates[order]
        new = np.diff(sorted_rates, prepend=-np.inf) > _SAME * sorted_rates
        group = np.empty(len(order), dtype=np.intp)
        group[order] = np.cumsum(new) - 1
        return sorted_rates[new], group

    def _place(self, contact: str) -> int:
        if contact not in self.contacts:
            raise ModelError(f"there is no contact {contact!r}; contacts are {', '.join(self.contacts)}")
        return self.contacts.index(contact)

    @property
    def touching(self) -> tuple[str, ...]:
        """Names of the contacts that touch in any run-up."""
        return tuple(name for name in self.contacts if np.nanmax(self.peaks(name), initial=0.0) > 0.0)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The largest force of each contact but friction with its spread, in sentences."""
        system, found = self.system, []
        unit = " N m" if system.units else ""
        per = f" {system.units.parameter(system.structure.pace)}/s" if system.units else " per unit of time"
        dry = {form.name for form in system.structure.contacts if form.law.is_dry}  # of which the limit is known
        for name in (name for name in self.touching if name not in dry):
            peaks, places = self.peaks(name), self.places(name)
            middle, most = np.nanquantile(peaks, (0.5, 0.95))
            worst = int(np.nanargmax(peaks))
            where = value_words(float(places[worst]), system.structure.pace, system.units, 4)
            found.append(
                f"{name}: peak {middle:.4g}{unit} in half of the run-ups, {most:.4g}{unit} in 95 %; at most "
                f"{peaks[worst]:.4g}{unit}, at {where} of the run-up at {self.rates[worst]:.4g}{per}"
            )
        return tuple(found)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the largest forces with their spread, and a table over the rates."""
        symbol = parameter_symbol(self.system.structure.pace, self.system.units)
        rates, group = self._groups
        per = f" {self.system.units.parameter(self.system.structure.pace)}/s" if self.system.units else ""
        error, worst = f"{100.0 * self.error:.2g} % (root mean square)", f"{100.0 * self.worst:.2g} %"
        said = (
            f"error {error} of the largest motion, {worst} at worst, in {self.trials} comparisons with the exact flow"
        )
        if self.by_steps:
            said = f"with half the step, largest forces of {self.trials} differ by {error}, by {worst} at worst"
        at = f"at {len(rates)} rates from {rates[0]:.4g} to {rates[-1]:.4g}{per}"
        yield f"{len(self.courses)} run-ups over {symbol} {at}: {said}"
        yield from self.sentences
        if np.any(self.diverged):
            yield f"{int(self.diverged.sum())} diverged"
        shown = np.unique(np.linspace(0, len(rates) - 1, _ROWS).round().astype(int))
        for name in self.touching:
            _, values = self.quantiles(name)
            impacts = self.impacts[:, :, self._place(name)].sum(axis=(1, 2))
            yield Table(
                [f"{name}: rate", ">runs", ">5 %", ">half", ">95 %", ">impacts"],
                [
                    (f"{rates[k]:.5g}", f"{(group == k).sum()}", *(f"{each:.5g}" for each in values[:, k]),
                     f"{np.nanmean(impacts[group == k]):.4g}")
                    for k in shown
                ],
            )  # fmt: skip

    def joined(self, other: RunUps) -> RunUps:
        """Return these run-ups with others of the same system; the error is the larger of both."""
        rows = {name: np.concatenate((getattr(self, name), getattr(other, name))) for name in _ARRAYS}
        error, worst = max(self.error, other.error), max(self.worst, other.worst)
        return RunUps(
            self.system, self.courses + other.courses, **rows, error=error, worst=worst,
            trials=self.trials + other.trials, by_steps=self.by_steps,
        )  # fmt: skip

    def __repr__(self) -> str:
        return f"RunUps({len(self.courses)} run-ups in {self.bins} bins, error {self.error:.2g})"


_ARRAYS = ("phases", "low", "high", "forces", "impacts")


def run_ups(
    system: System,
    speeds: Sequence[SpeedCourse],
    *,
    phases: ArrayLike = 0.0,
    states: ArrayLike | None = None,
    bins: int = 100,
    options: BatchOptions | None = None,
    by: SweepBy = SweepBy.CHOSEN,
) -> RunUps:
    """Compute many run-ups at once: largest forces, impacts and extremes over the speed.

    Parameters
    ----------
    system
        The system; its own value of the frequency or speed is not used.
    speeds
        The speed over time of each run-up.
    phases : shape (runs,)
        Angle of the excitation at the start of each run-up, in radians.
    states : shape (runs, state_size)
        Positions, velocities and extensions of friction springs at the start of each run-up; by default those of the
        motion on which the system settles from rest at the first speed, at the angle in `phases`.
    bins
        Number of equal times into which each run-up is divided.
    options
        Error and threads; the steps of ``"curves"`` are chosen so that the error is at most `BatchOptions.error` over
        one forcing period or one bin, whichever is longer. ``"steps"`` uses neither.
    by
        ``"curves"``, ``"steps"`` or ``"chosen"``, as in `gapwalk.ask.run_up`.

    Returns
    -------
    RunUps
        Largest forces, impacts and extremes of each run-up.

    Raises
    ------
    ModelError
        If the system cannot run up, or if a load varies a parameter of a contact, which needs ``by = "steps"``.
    FlowError
        If the error cannot be reached.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"],
    ...     mass=[1.0],
    ...     damping=[0.1],
    ...     stiffness=[1.0],
    ...     contacts=[gw.stop("wall", {"x": 1.0}, 0.5, 20.0)],
    ...     harmonics=[gw.Harmonic(0.1, {"x": 1.0})],
    ...     frequency=1.0,
    ... )
    >>> found = gw.ask.run_ups(mass, [gw.ask.SpeedCourse.ramp(0.5, 1.5, rate) for rate in (0.01, 0.02)])
    >>> found.peaks("wall").shape
    (2,)
    """
    check_system(system, "run_ups")
    courses = tuple(speeds)
    if not courses or not all(isinstance(each, SpeedCourse) for each in courses):
        raise ModelError("speeds must be a list of courses, such as [gw.ask.SpeedCourse.ramp(700, 1100, rate), ...]")
    check("bins", bins, Annotated[int, Ge(2), Le(10_000)])
    ramped, count = Ramped(system), len(courses)
    try:
        angles = np.broadcast_to(np.array(phases, dtype=float), (count,)).copy()
    except (TypeError, ValueError):
        raise ModelError(f"phases must be one angle for each of the {count} run-ups") from None
    if not np.all(np.isfinite(angles)):
        raise ModelError("phases must be finite angles, in radians")
    by_steps = is_by_steps(system, SweepBy(by), many=True)
    if states is None:
        begun = starts_of(system, courses, angles, ramped if by_steps else None)
    else:
        begun = np.array(states, dtype=float)
        if begun.shape != (count, system.state_size) or not np.all(np.isfinite(begun)):
            raise ModelError(
                f"states has shape {begun.shape}; it must be ({count}, {system.state_size}), finite numbers"
            )
    options = options or BatchOptions()
    if by_steps:
        stepped = batch_by_steps(ramped, courses, angles, begun, bins, options.thread_count)
        return RunUps(system, courses, angles, *stepped, by_steps=True)
    found = run_batch(ramped, courses, angles, begun, bins, options)
    return RunUps(
        system, courses, angles, found.low, found.high, found.forces, found.impacts, found.error, found.worst,
        found.trials,
    )  # fmt: skip


def starts_of(
    system: System, courses: Sequence[SpeedCourse], phases: NDArray[np.float64], stepped: Ramped | None = None
) -> NDArray[np.float64]:
    """Return the state of the motion that settles at the first speed of each course, at its phase."""
    found, firsts = np.empty((len(courses), system.state_size)), np.array([float(each.speed[0]) for each in courses])
    for first in np.unique(firsts):
        lanes = np.flatnonzero(firsts == first)
        at_first = system.at({system.structure.pace: float(first)})
        if stepped is not None:
            found[lanes] = start_by_steps(stepped, at_first, phases[lanes])
            continue
        wanted = np.concatenate(([0.0], phases[lanes] % PERIOD))
        angles, places = np.unique(wanted, return_inverse=True)
        state = start_at(at_first, 0.0)
        states = state[None] if len(angles) == 1 else sample(at_first, state, angles).states
        found[lanes] = states[places.reshape(-1)[1:]]
    return found


_COORDINATES = 6  # whose motion is drawn over a diagram
_SPEEDS = 100  # classes of the speed
_DRAWN = (
    (0.5, "middle", "median of the run-ups"),
    (0.95, "most", "95 % are below"),
    (1.0, "largest", "largest of all"),
)


@pictured(RunUps, size=(8.0, 6.6), forms=("panels",))
def run_ups_picture(found: RunUps, contact: str | None = None, *, branch: Branch | None = None) -> Picture:
    """Describe the largest forces over the rate, and quantiles of amplitudes and forces over the speed."""
    system = found.system
    forces = [float(np.nanmax(found.peaks(name), initial=0.0)) for name in found.contacts]
    loads = zip(np.nansum(found.impacts, axis=(0, 1, 3)).tolist(), forces, found.contacts, strict=True)
    contact = contact or max(loads, default=(0.0, 0.0, ""))[2]  # by default that with the most impacts
    return Picture(
        system,
        (system.structure.pace, f"half.{system.coordinates[0]}"),
        parts=partial(_parts_of_picture, found, dict.fromkeys((*found.touching, *[contact] * bool(contact))), branch),
        sentences=found.sentences,
        heading=[each for each in found.sentences if each.startswith(f"{contact}: ")],
        contacts=found.touching,
        of=contact,
        panels=("charts", "below"),
        empty="" if found.contacts else "these run-ups have no contact, so there is no force to draw",
    )


def _parts_of_picture(found: RunUps, contacts: Iterable[str], branch: Branch | None) -> Parts:
    system, pace = found.system, found.system.structure.pace
    layers, below, charts = list[Series](), list[Panel](), list[Panel]()
    for place, name in enumerate(system.coordinates[:_COORDINATES]):
        half = 0.5 * (found.high[:, :, place] - found.low[:, :, place])
        layers += [each._replace(axes=(pace, f"half.{name}")) for each in _levels(found, half)]
    for name in contacts:
        force = f"{'torque' if system.units else 'force'} of {name}" + " [N m]" * bool(system.units)
        levels = _levels(found, found.forces[:, :, found._place(name)])
        slow = [] if branch is None else list(_slow_forces(branch, name))
        below.append(Panel(force, pace, [*levels, *slow], name, margin=0.01))
        charts.append(_over_rate(found, name, f"largest {force}"))
    ends = (float(found.speeds.min()), float(found.speeds.max()))
    return Parts(layers=layers, below=below, charts=charts, within={pace: ends})


def _levels(found: RunUps, values: NDArray[np.float64]) -> list[Series]:
    """Return quantiles over all run-ups of values near each speed."""
    speeds, kept = found.speeds.ravel(), values.ravel()
    speeds, kept = speeds[np.isfinite(kept)], kept[np.isfinite(kept)]
    if not len(kept):
        return []
    edges = np.linspace(found.speeds.min(), found.speeds.max(), min(found.bins, _SPEEDS) + 1)
    place = np.clip(np.digitize(speeds, edges) - 1, 0, len(edges) - 2)
    groups = [(middle, kept[place == k]) for k, middle in enumerate(0.5 * (edges[1:] + edges[:-1]))]
    x, filled = zip(*((middle, group) for middle, group in groups if len(group)), strict=True)
    return [
        Series(x, [np.quantile(each, level) for each in filled], "line", look, text) for level, look, text in _DRAWN
    ]


def _over_rate(found: RunUps, contact: str, title: str) -> Panel:
    pace, units = found.system.structure.pace, found.system.units
    rates, (low, middle, high) = found.quantiles(contact)
    series = [Series(found.rates, found.peaks(contact), "dots", "run", "a run-up")]
    if len(rates) > 1 and len(found.courses) > 2 * len(rates):
        series += [
            Series(rates, np.array((low, high)), "between", "most", "5 % to 95 %"),
            Series(rates, middle, "line", "middle", "median of the run-ups"),
        ]
    across = f"rate of {pace}" + (f" [{units.parameter(pace)}/s]" if units else "")
    return Panel(title, "", series, contact, across=across, margin=0.05)


def _slow_forces(branch: Branch, contact: str) -> Iterator[Series]:
    """Yield the largest force along a response, stable and unstable."""
    signal = f"{contact}.force"  # that of its stages, as along the run-ups
    forces = np.array([max(peaks(point.orbit, signal)) for point in branch.points])
    is_stable = np.array([point.stable for point in branch.points])
    for name, own in (("stable", is_stable), ("unstable", ~is_stable)):
        joined = own.copy()
        joined[1:] |= own[:-1]  # up to the first point of the other kind, so that no gap is left
        if own.any():
            yield Series(branch.values, np.where(joined, forces, np.nan), "line", name, f"{name} response")
