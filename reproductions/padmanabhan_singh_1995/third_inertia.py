"""The acceleration u3'' of the third inertia, which the two degrees of freedom of the paper leave out."""

from __future__ import annotations

from gapwalk.model.system import System
from gapwalk.motion.signal import Signal


def third_inertia(system: System) -> Signal:
    """u3'' about its mean, in units of the shaft's deflection bc3 times w^2, as a signal of the paper's system.

    Parameters
    ----------
    system
        A system of the paper: coordinates q1 and q3, and the contact ``stage2``.

    Notes
    -----
    By equation 3 of the paper, I3 u3'' = K2 q3 + C2 q3' - Tm. The tables hold K2/I2 bc3/bc1 = K12 and K2/I2 + K2/I3 =
    K22, so ``K2/I3 = K22 - K12 / r`` with r = bc3/bc1, which no table prints. It follows from the mean loads: one and
    the same torque Tm is behind Tm1 and Tm2, and with n2/n1 = Ia/(I2 r) that leaves
    ``r = K12 (Tm2 + n Tm1) / (n (Tm1 K22 + Tm2 K12))``, n = n2/n1. (At equal mean loads r = 16/17.) Then the mean of
    K2/I3 q3 is Tm2 for every motion, so that the train keeps its speed, and u3'' is what is left about the mean.
    C2/I3 is taken from the tables as K2/I3 is; they hold no damper that would fit both C12 and C22.
    """
    k12, k22 = -system["stiffness.q1.q3"], system["stiffness.q3.q3"]
    c12, c22 = -system["damping.q1.q3"], system["damping.q3.q3"]
    n = -system["stage2.force.q3"] / system["stage2.force.q1"]
    first, second = system["mean.q1"], system["mean.q3"]
    r = k12 * (second + n * first) / (n * (first * k22 + second * k12))
    return Signal((("q3", k22 - k12 / r), ("q3'", c22 - c12 / r)), "u3''")
