"""The length in which motions of a system without excitation are measured."""

from __future__ import annotations

from gapwalk.model.spring import springs_of
from gapwalk.model.static_search import balance_of
from gapwalk.model.system import System


def length_at_rest(system: System, frequency: float) -> float:
    """Return a length of a system: its largest clearance, or the smallest at which a formula bends, or 1.

    Parameters
    ----------
    system
        The system.
    frequency
        A frequency, by which the rates at which formulas bend become lengths.
    """
    gaps = [slope.clearance for spring in springs_of(system) for slope in spring.slopes if slope.clearance > 0.0]
    if gaps:
        return max(gaps)
    balance = balance_of(system)
    bends = [*balance.lengths[balance.lengths > 0.0].tolist()]
    bends += (balance.speeds[balance.speeds > 0.0] / frequency).tolist()
    return min(bends, default=1.0)
