"""Impact damping equivalent to a viscous damper: by one harmonic in closed form, and by computed motions.

The paper's rule (section 4): choose beta such that the impact-damped motion matches the viscously damped one at a
frequency at which one harmonic suffices.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.compare_motions import Contrast, contrast
from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.hysteresis import hysteresis, pick_contact
from gapwalk.flow.motion import Signal
from gapwalk.measurement.fit import fit
from gapwalk.measurement.measured_record import Record
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.contact import Contact
from gapwalk.model.laws.law import HuntCrossley
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit

_SAMPLES = 512  # samples per forcing period at which the motions are matched


@dataclass(frozen=True, eq=False)
class DampingMatch:
    """The impact damping of a contact that is equivalent to viscous dampers, computed in two ways."""

    contact: str  #: Name of the contact.
    #: Coefficient of one damper parallel to the contact that is equivalent to the viscous dampers of the first system.
    viscous_damping: float
    #: Fraction of those dampers that one damper parallel to the contact does not represent: 0 if it is exact.
    astray: float
    #: amplitude, mean: First harmonic and mean of the deflection of the viscously damped motion.
    amplitude: float
    mean: float
    #: Fraction of the variance of the deflection in that harmonic: near 1 if one harmonic suffices.
    one_harmonic_share: float
    #: The impact damping that dissipates the same energy per cycle under that harmonic: the closed formula.
    one_harmonic: float
    #: The impact damping for which the acceleration of the deflection is nearest to that of the viscously damped
    #: motion: from computed motions, with all their harmonics, in the least-squares sense.
    impact_damping: float
    #: Rms difference of the two accelerations with this damping, relative to that of the viscously damped motion.
    difference: float
    #: viscous, impact: The two motions.
    viscous: Orbit
    impact: Orbit

    def contrast(self, signals: tuple[str, ...] = (), **options: Any) -> Contrast:
        """Compare the two motions; see `gapwalk.analysis.contrast`."""
        return contrast(self.viscous, self.impact, signals, names=("viscous damping", "impact damping"), **options)


def find_impact_damping(
    system: System | Contact, viscous_damping: float, amplitude: float, contact: str | None = None, *, mean: float = 0.0
) -> float:
    """Compute the impact damping that dissipates as much as a viscous damper under one harmonic, in closed form.

    Under a deflection ``mean + amplitude * cos(theta)`` with spring force ``g`` it is
    ``pi c / (integral of |g| sin(theta)^2 over a period of theta)``, independent of the frequency.

    Parameters
    ----------
    system
        A system, or a contact alone.
    viscous_damping
        Coefficient c of the damper parallel to the contact.
    amplitude, mean
        Amplitude and mean of the deflection.
    contact
        Name of the contact; may be omitted if there is only one.

    Returns
    -------
    float
        Hunt and Crossley's coefficient, in 1/velocity.

    Raises
    ------
    ModelError
        If the contact does not close under this deflection, or has another damping law.

    Examples
    --------
    >>> round(gw.measure.find_impact_damping(system, viscous_damping=0.5, amplitude=1.5), 6)
    1.123249
    """
    if isinstance(system, Contact):
        unit = replace(system, law=HuntCrossley(), numbers={"impact_damping": 1.0})
    else:
        contact, form, _ = pick_contact(system, contact)
        if form.law != HuntCrossley():
            raise ModelError(
                f"contact {contact!r} has the force law {form.law.name!r}; give it impact damping: law = "
                f'"{HuntCrossley.name}"'
            )
        unit = system.at({f"{contact}.impact_damping": 1.0})
    cost = hysteresis(unit, amplitude, contact, mean=mean).equivalent_damping
    if cost <= 0.0:
        raise ModelError(
            f"the contact does not close under a deflection of {mean:.6g} +- {amplitude:.6g}, so impact damping "
            "dissipates nothing; match at another frequency or load"
        )
    return viscous_damping / cost


def match_impact_damping(viscous: Orbit, impact: System, contact: str | None = None) -> DampingMatch:
    """Find the impact damping that is equivalent to viscous dampers (paper, section 4).

    Parameters
    ----------
    viscous
        A motion of the viscously damped system, at a frequency at which one harmonic describes it;
        `DampingMatch.one_harmonic_share` says how well.
    impact
        The system with impact damping in place of the viscous dampers. The value of its impact damping is ignored, and
        its frequency is set to that of the motion.
    contact
        Name of the contact; may be omitted if there is only one.

    Returns
    -------
    DampingMatch
        The impact damping, by the closed form and from computed motions; and the motions of both systems.

    Raises
    ------
    ModelError
        If the systems differ in coordinates or contacts, the contact has another damping law, or it does not close.
    ConvergenceError
        If the impact-damped system has no such motion near the viscously damped one.

    Examples
    --------
    >>> stages = [gw.Stage(1.0, 20.0, side="positive")]
    >>> damper = gw.Contact("stop", {"x": 1.0}, stages, law="viscous", viscous_damping=0.2)
    >>> load, mean = gw.Harmonic(1.0, {"x": 1.0}), {"x": 2.0}
    >>> viscous = gw.System(["x"], [[1.0]], [[0.1]], contacts=[damper], mean=mean, harmonics=[load], frequency=3.5)
    >>> wall = gw.stop("stop", {"x": 1.0}, 1.0, 20.0, impact_damping=0.1)
    >>> impact = gw.System(["x"], [[1.0]], [[0.1]], contacts=[wall], mean=mean, harmonics=[load])
    >>> found = gw.measure.match_impact_damping(gw.find_orbit(viscous), impact)
    >>> round(found.impact_damping, 4), round(found.one_harmonic, 4)
    (0.1027, 0.1272)
    """
    contact, _, _ = pick_contact(impact, contact)
    place = _shared_place(viscous.system, impact, contact)
    theta = PERIOD * np.arange(_SAMPLES * viscous.period + 1) / _SAMPLES
    motion = viscous.motion(_SAMPLES)
    x = motion.deflections[:-1, place]
    amplitude = 2.0 * abs(complex(np.mean(x * np.exp(-1j * theta[:-1]))))
    damper, astray = _damper(viscous.system, impact, place)
    if viscous.system.structure.contacts[place].law.is_damped:
        damper += hysteresis(viscous.system, amplitude, contact, mean=float(x.mean())).equivalent_damping
    one = find_impact_damping(impact, damper, amplitude, contact, mean=float(x.mean()))
    name = f"{contact}.impact_damping"
    begun = find_orbit(impact.at({name: one}, frequency=viscous.system.frequency), viscous.period, viscous.state)
    vector = viscous.system.values[viscous.system.structure.block(f"{contact}.deflection", viscous.system.size)]
    seen = Signal(
        tuple((f"{q}''", factor) for q, factor in zip(impact.coordinates, vector.tolist(), strict=True) if factor)
    )
    record = Record(motion.time[:-1], seen.of(motion)[:-1], name="the viscously damped motion")
    found = fit(begun, record, [name], seen, phase=0.0)
    return DampingMatch(
        contact,
        damper,
        astray,
        amplitude,
        float(x.mean()),
        0.5 * amplitude**2 / float(x.var()),
        one,
        found[name].value,
        found.after.agreement.relative,
        viscous,
        found.orbit,
    )


def _shared_place(viscous: System, impact: System, contact: str) -> int:
    """Return the index of the contact in both systems; raise a ModelError if they do not have the same parts."""
    ours, theirs = (
        (system.coordinates, [form.name for form in system.structure.contacts]) for system in (viscous, impact)
    )
    if ours != theirs:
        raise ModelError(f"the two systems differ in their coordinates or contacts: {ours} and {theirs}")
    return ours[1].index(contact)


def _damper(viscous: System, impact: System, place: int) -> tuple[float, float]:
    """Fit one damper parallel to the contact to the additional damping; return it and the fraction it misses."""
    layout = layout_of(impact.structure)
    numbers = coefficients_of(impact)
    more = _damping(viscous) - _damping(impact)
    slots = layout.contacts[place]
    unit = np.outer(numbers[slots.force], numbers[slots.deflection])
    damper = float(np.sum(more * unit) / np.sum(unit**2))
    size = float(np.linalg.norm(more))
    return damper, float(np.linalg.norm(more - damper * unit)) / size if size else 0.0


def _damping(system: System) -> NDArray[np.float64]:
    """Return ``M^-1 C``."""
    return np.linalg.solve(system.matrix("mass"), system.matrix("damping")).astype(float, copy=False)
