"""Classification of the attractor on which a motion settles, with the evidence.

Method: docs/numerics/attractors.md
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind, Settled
from gapwalk.attractors.lyapunov import Lyapunov, LyapunovOptions, lyapunov_run, of_multipliers
from gapwalk.attractors.rotation import Rotation, rotation
from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.attractors.settling_judge import exact_returns
from gapwalk.attractors.trapping_region import nearby_orbit, watch
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit, stroboscopic
from gapwalk.orbit.sticking import kept_words

_STROBES = 4096  # strobes for a rotation number, if the exponents needed fewer
_KEPT = 2048  # strobes stored in an attractor
_RELAXED = 12.0  # a torus counts as reached when its slowest mode has decayed by exp(-12)
_AGAIN = 512  # forcing periods after which a chaotic motion is examined again: its chaos may have been a transient
_LEAD = 1e-3  # largest error of the leading exponent per forcing period with which a torus differs from chaos

Strobes = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ClassifyOptions:
    """Options of the classification of a motion.

    Examples
    --------
    >>> gw.classify(system, options=gw.ClassifyOptions(settle=gw.SettleOptions(max_period=4))).label
    'P1'
    """

    #: settle, lyapunov: Options of the transient and of the average of the exponents.
    settle: SettleOptions = field(default_factory=SettleOptions)
    lyapunov: LyapunovOptions = field(default_factory=LyapunovOptions)
    zero: float = 1e-5  #: Size of an exponent per forcing period below which it may be that of a torus.
    errors: float = 5.0  #: Number of standard errors by which an exponent must differ from zero to count as different.

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

    Returns
    -------
    Attractor
        The attractor, with the evidence for its kind.

    Raises
    ------
    ModelError
        For an invalid start or parameter.
    FlowError
        If the motion diverges.

    Examples
    --------
    >>> gw.classify(system, frequency=0.8).label  # one motion in two forcing periods
    'P2'
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
    settled, exponents, strobes = _measured(settled, options)
    orbit = _late_orbit(settled.system, strobes, options)
    if orbit is not None:
        return _periodic(orbit, (*settled.evidence, "it converged to an orbit while its exponents were averaged"))
    kind, found, words = _judge(settled, exponents, strobes, options)
    curves, evidence = 0 if found is None else found.curves, (*settled.evidence, *words)
    return Attractor(kind, settled.system, curves, strobes[-_KEPT:], None, exponents, found, evidence)


def _periodic(orbit: Orbit, evidence: tuple[str, ...]) -> Attractor:
    exponents = of_multipliers(orbit.system, orbit.free_multipliers, orbit.period)
    evidence = (*evidence, *kept_words(orbit.system.structure, orbit.stuck))
    strobes = stroboscopic(orbit)
    return Attractor(AttractorKind.PERIODIC, orbit.system, orbit.period, strobes, orbit, exponents, None, evidence)


def _measured(settled: Settled, options: ClassifyOptions) -> tuple[Settled, Lyapunov, Strobes]:
    """Compute the exponents, and the strobes over which they are averaged.

    A slowly approached torus is first settled further, until its slowest mode has decayed.
    """
    exponents, strobes = lyapunov_run(settled.system, settled.state, options.lyapunov)
    rates = exponents.per_period
    falling = rates[rates < -np.maximum(options.zero, options.errors * exponents.errors_per_period)]
    if not exponents.regular or not len(falling):
        return settled, exponents, strobes
    decay = -float(falling.max())  # of the slowest mode, per forcing period
    missing = int(np.ceil(_RELAXED / decay)) - settled.periods
    if missing <= 0:
        return settled, exponents, strobes
    state, periods = strobes[-1], settled.periods + len(strobes)
    allowed = min(missing, options.settle.max_periods - periods)
    if allowed > 0:
        state, periods = Strobe(settled.system).run(state, allowed)[-1], periods + allowed
    evidence = (*settled.evidence, f"its slowest mode had decayed by exp(-{decay * periods:.1f})")
    return replace(settled, periods=periods, evidence=evidence), *lyapunov_run(settled.system, state, options.lyapunov)


def _late_orbit(system: System, strobes: Strobes, options: ClassifyOptions) -> Orbit | None:
    """Return the orbit to which the motion has converged meanwhile, if any; its period may be long."""
    last, strobe = strobes[-1], Strobe(system)
    orbit = settle(system, last, replace(options.settle, max_periods=_AGAIN)).orbit
    if orbit is not None:
        return orbit
    for each in exact_returns(system, strobes[-_KEPT:]):
        orbit = nearby_orbit(strobe, last, each.period, 0.0)
        if orbit is not None and watch(strobe, last, orbit, 0.0).converging:
            return orbit
    return None


def _judge(
    settled: Settled, exponents: Lyapunov, strobes: Strobes, options: ClassifyOptions
) -> tuple[AttractorKind, Rotation | None, tuple[str, ...]]:
    """Return the kind of a motion that is not periodic, its rotation number if it has one, and the evidence."""
    lead, error = float(exponents.per_period[0]), float(exponents.errors_per_period[0])
    text = f"its largest exponent is {lead:.3g} +- {error:.1g} per forcing period"
    if lead > options.zero and lead > options.errors * error:
        if exponents.regular:  # a regular motion on an attractor has no positive exponent
            return AttractorKind.UNDECIDED, None, (f"{text}, but regular: it is leaving an unstable motion",)
        return AttractorKind.CHAOTIC, None, (f"{text}: positive",)
    if lead < -options.zero and lead < -options.errors * error:
        return AttractorKind.UNDECIDED, None, (f"{text}: negative, but no orbit was found; raise max_period",)
    for period, away in exact_returns(settled.system, strobes[-_KEPT:])[:1]:
        words = f"it returns to {away:.1e} after {period} forcing periods, but attracts nothing"
        return AttractorKind.UNDECIDED, None, (f"{text}: zero", words)
    if len(strobes) < _STROBES:
        strobes = np.vstack((strobes, Strobe(settled.system).run(strobes[-1], _STROBES - len(strobes))))
    found = rotation(strobes)
    if found is not None and error <= _LEAD:
        how = f"its strobes go round {found.curves} closed curve{'s' * (found.curves > 1)} (roughness"
        words = f"{how} {found.roughness:.3f}), rotation number {found.number:.9g}"
        return AttractorKind.QUASI_PERIODIC, found, (f"{text}: zero", words)
    zeros = int(np.sum(np.abs(exponents.per_period) <= options.zero))
    if zeros > 1 and exponents.regular and settled.converged:
        return AttractorKind.QUASI_PERIODIC, None, (f"{text}: zero, as are {zeros - 1} others",)
    return AttractorKind.UNDECIDED, None, (f"{text}: zero within its error, but its strobes lie on no curve",)
