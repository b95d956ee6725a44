"""What the paper's tables demand of each other: its equations leave few of their numbers free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gapwalk as gw

_HUB, _NORMALIZING, _GAP = 0.01, 100.0, 0.05  # kg m^2, rad/s, rad: any other choice gives the same numbers
_FLYWHEEL, _REST = 1.5, 1.2  # I1/I2 and I3/I2, as K21/K11 = Ia/I2 = 0.6 and K12/K22 = Ib/I2 = 0.6/1.1 demand


def _quantity(value: float, unit: str) -> Any:
    """Write a number with a unit, which the parts of trains take as well as plain numbers."""
    return f"{value!r} {unit}"


def consistent_machine() -> gw.System:
    """Build the dimensional machine of equations 1 to 3 that has the stiffnesses of rows 12 to 22, 27 and 28 exactly.

    With bc3 = bc1 three inertias, two springs and two dampers leave no choice: C21 and C12 follow from C11 and C22, and
    Tm2 from Tm1. The row is that of figure 13.
    """
    row = gw.paper.parameter_set("13")
    first, last = _HUB * _FLYWHEEL / (1.0 + _FLYWHEEL), _HUB * _REST / (1.0 + _REST)  # Ia, Ib
    (k11, _, _, k22), (c11, _, _, c22) = row.stiffness, row.damping
    w, torque = _NORMALIZING, _FLYWHEEL * _HUB * _GAP * _NORMALIZING**2
    return gw.train.Train(
        inertias=[
            gw.train.Inertia("flywheel", _quantity(_FLYWHEEL * _HUB, "kg m^2")),
            gw.train.Inertia("hub", _quantity(_HUB, "kg m^2")),
            gw.train.Inertia("rest", _quantity(_REST * _HUB, "kg m^2")),
        ],
        shafts=[
            gw.train.Shaft(
                "clutch",
                ("flywheel", "hub"),
                stiffness=_quantity(k11 * first * w**2, "N m/rad"),
                damping=_quantity(c11 * first * w, "N m s/rad"),
                stages=[gw.Stage(_quantity(_GAP, "rad"), _quantity(row.n[0] * first * w**2, "N m/rad"))],
                law="hunt-crossley",
                impact_damping=_quantity(row.beta / (w * _GAP), "s/rad"),
            ),
            gw.train.Shaft(
                "shaft",
                ("hub", "rest"),
                stiffness=_quantity(k22 * last * w**2, "N m/rad"),
                damping=_quantity(c22 * last * w, "N m s/rad"),
            ),
        ],
        mean={"flywheel": _quantity(row.mean[0] * torque, "N m")},
        reaction="rest",
        harmonics=[gw.Harmonic(_quantity(row.excitation * torque, "N m"), acts_on={"flywheel": 1.0})],
        frequency=_quantity(row.frequency * w, "rad/s"),
    ).system()


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
    """Return the relations between numbers of the tables that the paper's equations 10, 11 and 14 demand.

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
