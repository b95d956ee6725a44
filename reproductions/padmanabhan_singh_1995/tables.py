"""What the paper's tables demand of each other: its equations leave few of their numbers free."""

from __future__ import annotations

from dataclasses import dataclass

import gapwalk as gw


@dataclass(frozen=True)
class Demand:
    """A relation between printed numbers.

    Attributes
    ----------
    relation
        The relation, in words.
    demanded
        What the equations demand.
    printed
        What the tables have.
    """

    relation: str
    demanded: str
    printed: str


def demands() -> tuple[Demand, ...]:
    """Return the relations between numbers of the tables that the paper's equations 10 and 11 demand.

    K11 = K1/Ia and K21 = K1/I2 bc1/bc3 have the ratio of C11 and C21; K12 = K2/I2 bc3/bc1 and K22 = K2/Ib that of C12
    and C22. With n2/n1 = Ia/(I2 r) and r = bc3/bc1, Tm1/Tm2 = r I3/I1 = (1 - n r)/(r K22/K12 - 1)/n, n = n2/n1, so each
    ratio of the mean loads belongs to one r.
    """
    sets = {name: gw.paper.parameter_set(name) for name in gw.paper.names()}
    stiffness, damping = sets["13"].stiffness, sets["13"].damping
    k12, k22 = stiffness[1], stiffness[3]
    n = sets["13"].n[1] / sets["13"].n[0]
    ratios = sorted({numbers.mean[0] / numbers.mean[1] for numbers in sets.values()}, reverse=True)
    at_one = (1.0 - n) / (k22 / k12 - 1.0) / n
    # the same relation, solved for r
    widths = [(ratio * n + 1.0) / (n + ratio * n * k22 / k12) for ratio in ratios]
    return (
        Demand("C21/C11", f"{stiffness[2] / stiffness[0]:.3g}, as K21/K11", f"{damping[2] / damping[0]:.3g}"),
        Demand("C12/C22", f"{k12 / k22:.3g}, as K12/K22", f"{damping[1] / damping[3]:.3g}"),
        Demand(
            "Tm1/Tm2, from one mean torque",
            f"{at_one:.2g} with bc3 = bc1",
            f"{', '.join(f'{ratio:g}' for ratio in ratios)}, which belong to bc3/bc1 = "
            f"{', '.join(f'{width:.3g}' for width in widths)}: no one system has all rows",
        ),
    )
