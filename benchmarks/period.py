"""One forcing period of figure 13 at Omega = 0.5, on its stable orbit."""

from __future__ import annotations

import numpy as np

from benchmarks.clutch import ScipyClutch
from benchmarks.effort import Effort
from benchmarks.row import Row, Target
from benchmarks.stopwatch import side_by_side
from gapwalk import Orbit, find_orbit, paper
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import ParameterLine

GROUP = "One forcing period of figure 13 at W = 0.5"
_FREQUENCY = 0.5
_AGREE = 1e-6  # by which the two integrators may differ; SciPy's tolerance is 1e-9 a step


def rows(effort: Effort) -> list[Row]:
    """Measure all lines."""
    orbit = find_orbit(paper.case("13"), frequency=_FREQUENCY)
    return [measure_state(orbit, effort), measure_transition(orbit, effort), measure_both(orbit, effort)]


def measure_state(orbit: Orbit, effort: Effort) -> Row:
    """Measure the state alone."""
    flow, clutch = flow_of(orbit.system), ScipyClutch(orbit.system)
    coefficients = _line(orbit).coefficients(_FREQUENCY)[0]

    def ours():
        return flow.integrate(coefficients, orbit.state, 0.0, PERIOD)

    def theirs():
        return clutch.period(orbit.state, _FREQUENCY)

    _check(ours().state, theirs())
    targets = (Target(20e-6), Target(300.0, "ratio"))
    return _row("state", *side_by_side([ours, theirs], effort), targets)


def measure_transition(orbit: Orbit, effort: Effort) -> Row:
    """Measure state and transition matrix."""
    flow, clutch = flow_of(orbit.system, transition=True), ScipyClutch(orbit.system)
    coefficients = _line(orbit).coefficients(_FREQUENCY)[0]

    def ours():
        return flow.integrate(coefficients, orbit.state, 0.0, PERIOD)

    def theirs():
        return clutch.period_with_sensitivities(orbit.state, _FREQUENCY, by_frequency=False)

    _check(ours().transition, theirs().transition)
    return _row("state, transition matrix", *side_by_side([ours, theirs], effort))


def measure_both(orbit: Orbit, effort: Effort) -> Row:
    """Measure state, transition matrix and the sensitivity to the frequency."""
    flow, clutch = flow_of(orbit.system, "frequency", transition=True), ScipyClutch(orbit.system)
    coefficients, direction = _line(orbit).coefficients(_FREQUENCY)

    def ours():
        return flow.integrate(coefficients, orbit.state, 0.0, PERIOD, direction)

    def theirs():
        return clutch.period_with_sensitivities(orbit.state, _FREQUENCY)

    _check(ours().transition, theirs().transition)
    _check(ours().sensitivity, theirs().by_frequency)
    targets = (Target(60e-6), Target(100.0, "ratio"))
    return _row("state, transition matrix, one parameter", *side_by_side([ours, theirs], effort), targets)


def _line(orbit: Orbit) -> ParameterLine:
    return ParameterLine(orbit.system, "frequency")


def _row(what: str, ours: float, theirs: float, targets: tuple[Target, ...] = ()) -> Row:
    return Row(GROUP, what, ours, theirs, "DOP853", targets)


def _check(ours, theirs) -> None:
    """Raise if the two integrators disagree: the time of a wrong result means nothing."""
    difference = float(np.abs(np.asarray(ours) - np.asarray(theirs)).max())
    if not difference < _AGREE:
        raise RuntimeError(f"gapwalk and SciPy differ by {difference:.3g}")
