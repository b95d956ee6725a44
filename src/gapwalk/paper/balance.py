"""A response of the paper once more by harmonic balance, as its figure 9 compares both."""

from __future__ import annotations

from gapwalk.bifurcation.follow import follow
from gapwalk.continuation.branch import Branch
from gapwalk.orbit.balance import Balance
from gapwalk.orbit.find import find_orbit

HARMONICS = 20
"""What the paper takes for its lighter loads (section 5: 15 to 20)."""


def balanced(branch: Branch) -> Branch:
    """The branch that a walk by shooting has found, by harmonic balance with `HARMONICS` harmonics.

    Parameters
    ----------
    branch
        A branch of period 1 over one parameter. Its values are those that are walked.
    """
    method = Balance(HARMONICS, error=0.01)  # the comparison shows what the truncation does
    values = branch.values
    system = branch.points[0].orbit.system
    orbit = find_orbit(system, 1, branch.points[0].orbit.state, method=method)
    return follow(orbit, branch.parameter, to=float(values[-1]), method=method)
