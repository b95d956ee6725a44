"""Two masses under two harmonics, on which several tests of harmonic balance put contacts, forces and friction."""

from collections.abc import Iterable

import gapwalk as gw


def two_masses(contacts: Iterable[gw.Contact], loads: Iterable[gw.loads.Load] = ()) -> gw.System:
    """Return two masses with contacts, under two harmonics and further loads."""
    return gw.System(
        coordinates=("q1", "q2"),
        stiffness=[[0.5, -0.1], [-0.1, 1.0]],
        damping=[[0.1, -0.02], [-0.02, 0.15]],
        mass=[[1.0, 0.1], [0.1, 1.5]],
        contacts=contacts,
        mean={"q1": 0.2},
        harmonics=(gw.Harmonic(0.8, {"q1": 1.0}), gw.Harmonic(0.2, {"q2": 1.0}, order=2, phase=0.4), *loads),
        frequency=1.1,
    )
