"""Whether a system takes energy out of its motions: it is told beforehand what feeds energy in, or damps nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gapwalk.model.drivetrain.train_assembly import of_angles
from gapwalk.model.system import System

_NOTHING = 1e-12  # of the largest rate: a rate below is zero but for rounding


def dissipation_doubts(system: System) -> list[str]:
    """What is doubtful about the damping of a system, a sentence each; none where all of it takes energy out.

    The rates at which the damping takes energy out of free motions are the eigenvalues of ``M^-1 C``. With a negative
    one motions grow until a contact holds them, or without end; where all are zero, resonances have no end.

    Examples
    --------
    >>> import gapwalk as gw
    >>> dissipation_doubts(gw.System(["x"], [[1.0]], [[0.1]]))
    []
    """
    return [*_matrix_doubts(system), *_contact_doubts(system)]


def _matrix_doubts(system: System) -> Iterator[str]:
    damping = of_angles(system, system.matrix("stiffness"), system.matrix("damping"))[1]
    rates = np.linalg.eigvals(np.linalg.solve(system.matrix("mass"), damping)).real
    if not damping.any():
        yield (
            "damping is zero: no motion settles, and at a resonance nothing limits it while the gaps are open; give "
            "the system a damping, however small"
        )
    elif rates.min() < -_NOTHING * np.abs(rates).max():
        yield (
            f"damping is negative: it feeds energy in, at the rate {rates.min():.4g} (the lowest eigenvalue of M^-1 C, "
            "per unit of time), so that motions may grow without end; look at the signs of the damping"
        )


def _contact_doubts(system: System) -> Iterator[str]:
    for contact in system.structure.contacts:
        name = f"{contact.name}.{contact.damping_name}"
        if contact.damping_name and system[name] < 0.0:
            yield f"{name} is {system[name]:g}: negative, so that the contact feeds energy in where it touches"
