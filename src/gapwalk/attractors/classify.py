"""Classification of the attractor on which a motion settles, with the evidence.

Method: docs/numerics/attractors.md
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind, Settled
from gapwalk.attractors.convergence import TOLERANCES, Recurrence, recurrences
from gapwalk.attractors.lyapunov import Lyapunov, LyapunovOptions, lyapunov_run, of_multipliers
from gapwalk.attractors.rotation import Rotation, rotation
from gapwalk.attractors.section import Strobe, size_of
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.attractors.trapping_region import nearby_orbit, watch
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit, stroboscopic

_STROBES = 4096  # strobes for a rotation number, if the exponents needed fewer
_KEPT = 2048  # strobes stored in an attractor
_RELAXED = 12.0  # a torus counts as reached when its slowest mode has decayed by exp(-12)
_AGAIN = 512  # forcing periods after which a chaotic motion is examined again: its chaos may have been a transient
_LEAD = 1e-3  # largest error of the leading exponent per forcing period with which a torus differs from chaos


@dataclass(frozen=True, slots=True)
class ClassifyOptions:
    """Options of the classification of a motion.

    Parameters
    ----------
    settle, lyapunov
        Options of the transient and of the average of the exponents.
    zero
        Size of an exponent per forcing period below which it may be that of a torus.
    errors
        Number of standard errors by which an exponent must differ from zero to count as different.
    """

    settle: SettleOptions = field(default_factory=SettleOptions)
    lyapunov: LyapunovOptions = field(default_factory=LyapunovOptions)
    zero: float = 1e-5
    errors: float = 5.0

    def __post_init__(self) -> None:
        if not 0.0 < self.zero <= 0.01:
            raise ModelError(f"zero is {self.zero!r}; it must lie between 0 and 0.01 per forcing period")
        if not self.errors >= 1.0:
            raise ModelError(f"errors is {self.errors!r}; it must be at least 1 standard error")


def classify(
    system: System,
    start: str | Sequence[float] | NDArray[np.float64] = "rest",
    options: ClassifyOptions | None = None,
    *,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Attractor:
    """Find the attractor on which a motion settles, and its kind.

    Parameters
    ----------
    system
        The system.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    options
        Options of the transient and of the classification.
    at, **values
        Parameter values to change first.

    Raises
    ------
    ModelError
        For an invalid start or parameter.
    FlowError
        If the motion diverges.
    """
    options = options or ClassifyOptions()
    return identify(settle(system, start, options.settle, at=at, **values), options)


def identify(settled: Settled, options: ClassifyOptions | None = None) -> Attractor:
    """Classify the attractor of a motion that has settled.

    Periodic: `settle` found a stable orbit. Chaotic: the largest exponent is positive by several errors, and the motion
    has still not converged to an orbit when it is examined again. Quasi-periodic: the largest exponent is zero within
    its error, and the strobes go round closed curves with a rotation number that converges. Otherwise: undecided.
    """
    options = options or ClassifyOptions()
    if settled.orbit is not None:
        return _periodic(settled.orbit, settled.evidence)
    settled, measured = _measured(settled, options)
    orbit = _late_orbit(settled, measured, options)
    if orbit is not None:
        return _periodic(orbit, (*settled.evidence, "it converged to an orbit while its exponents were averaged"))
    verdict = _judge(settled, measured, options)
    strobes = measured.strobes[-_KEPT:]
    curves = 0 if verdict.rotation is None else verdict.rotation.curves
    return Attractor(
        verdict.kind,
        settled.system,
        curves,
        strobes,
        None,
        measured.exponents,
        verdict.rotation,
        (*settled.evidence, *verdict.evidence),
    )


class _Measured(NamedTuple):
    """Exponents of a settled motion, and the strobes over which they were averaged."""

    exponents: Lyapunov
    strobes: NDArray[np.float64]


class _Verdict(NamedTuple):
    kind: AttractorKind
    rotation: Rotation | None
    evidence: tuple[str, ...]


def _periodic(orbit: Orbit, evidence: tuple[str, ...]) -> Attractor:
    exponents = of_multipliers(orbit.system, orbit.multipliers, orbit.period)
    strobes = stroboscopic(orbit)
    return Attractor(AttractorKind.PERIODIC, orbit.system, orbit.period, strobes, orbit, exponents, None, evidence)


def _measured(settled: Settled, options: ClassifyOptions) -> tuple[Settled, _Measured]:
    """Compute the exponents; first settle a slowly approached torus further, until its slowest mode has decayed."""
    measured = _Measured(*lyapunov_run(settled.system, settled.state, options.lyapunov))
    missing = _missing_periods(measured.exponents, settled.periods, options)
    if missing <= 0:
        return settled, measured
    allowed = min(missing, options.settle.max_periods - settled.periods - len(measured.strobes))
    state, periods = measured.strobes[-1], settled.periods + len(measured.strobes)
    if allowed > 0:
        state, periods = Strobe(settled.system).run(state, allowed)[-1], periods + allowed
    note = f"its slowest mode had decayed by exp(-{_decay(measured.exponents, options) * periods:.1f})"
    measured = _Measured(*lyapunov_run(settled.system, state, options.lyapunov))
    return replace(settled, periods=periods, evidence=(*settled.evidence, note)), measured


def _missing_periods(exponents: Lyapunov, periods: int, options: ClassifyOptions) -> int:
    decay = _decay(exponents, options)
    if not exponents.regular or decay <= 0.0:
        return 0
    return int(np.ceil(_RELAXED / decay)) - periods


def _decay(exponents: Lyapunov, options: ClassifyOptions) -> float:
    """Return the decay rate per forcing period of the slowest decaying mode; 0 if no mode decays."""
    rates, errors = exponents.per_period, exponents.errors_per_period
    falling = rates[rates < -np.maximum(options.zero, options.errors * errors)]
    return -float(falling.max()) if len(falling) else 0.0


def _late_orbit(settled: Settled, measured: _Measured, options: ClassifyOptions) -> Orbit | None:
    """Return the orbit to which the motion has converged meanwhile, if any; its period may be long."""
    again = replace(options.settle, max_periods=_AGAIN)
    orbit = settle(settled.system, measured.strobes[-1], again).orbit
    if orbit is not None:
        return orbit
    last, strobe = measured.strobes[-1], Strobe(settled.system)
    for period in [each.period for each in _returns(settled.system, measured.strobes)]:
        orbit = nearby_orbit(strobe, last, period, 0.0)
        if orbit is not None and watch(strobe, last, orbit, 0.0).converging:
            return orbit
    return None


def _returns(system: System, strobes: NDArray[np.float64]) -> list[Recurrence]:
    """Find periods after which the last strobes return more closely than on any torus, however small, or in chaos."""
    tail = strobes[-_KEPT:]
    tail = tail - tail.mean(axis=0)
    return recurrences(tail / size_of(system, tail), len(tail) // 2, TOLERANCES.exact)


def _judge(settled: Settled, measured: _Measured, options: ClassifyOptions) -> _Verdict:
    lead = float(measured.exponents.per_period[0])
    error = float(measured.exponents.errors_per_period[0])
    text = f"its largest exponent is {lead:.3g} +- {error:.1g} per forcing period"
    if lead > options.zero and lead > options.errors * error:
        if measured.exponents.regular:  # a regular motion on an attractor has no positive exponent
            return _Verdict(AttractorKind.UNDECIDED, None, (f"{text}, but regular: it is leaving an unstable motion",))
        return _Verdict(AttractorKind.CHAOTIC, None, (f"{text}: positive",))
    if lead < -options.zero and lead < -options.errors * error:
        return _Verdict(AttractorKind.UNDECIDED, None, (f"{text}: negative, but no orbit was found; raise max_period",))
    returns = _returns(settled.system, measured.strobes)
    if returns:
        words = (
            f"it returns to {returns[0].distance:.1e} after {returns[0].period} forcing periods, but attracts nothing"
        )
        return _Verdict(AttractorKind.UNDECIDED, None, (f"{text}: zero", words))
    found = rotation(_enough(settled, measured))
    if found is not None and error <= _LEAD:
        how = f"its strobes go round {found.curves} closed curve{'s' * (found.curves > 1)} (roughness"
        words = (f"{text}: zero", f"{how} {found.roughness:.3f}), rotation number {found.number:.9g}")
        return _Verdict(AttractorKind.QUASI_PERIODIC, found, words)
    zeros = int(np.sum(np.abs(measured.exponents.per_period) <= options.zero))
    if zeros > 1 and measured.exponents.regular and settled.converged:
        return _Verdict(AttractorKind.QUASI_PERIODIC, None, (f"{text}: zero, as are {zeros - 1} others",))
    return _Verdict(AttractorKind.UNDECIDED, None, (f"{text}: zero within its error, but its strobes lie on no curve",))


def _enough(settled: Settled, measured: _Measured) -> NDArray[np.float64]:
    """Return enough strobes for a rotation number; follow the motion further if necessary."""
    missing = _STROBES - len(measured.strobes)
    if missing <= 0:
        return measured.strobes
    return np.vstack((measured.strobes, Strobe(settled.system).run(measured.strobes[-1], missing)))
