"""What the parts of a drive train do along a motion: accelerations of its inertias, torques in its shafts and gears.

The coordinates of a train are deflections; its turning as a whole is left out of the equations of motion. But what the
torques make of that is known, so the absolute acceleration of every inertia is: that of ``T x + r psi`` with
``r^T J r psi'' = r^T (torques)`` (see `gapwalk.model.drivetrain.train_assembly`). Figure 8 of the paper shows u3'' of
three inertias. Angles and speeds themselves depend on how the train turned before, and are not known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.structure import Structure
from gapwalk.model.system import System


def train_signals(structure: Structure) -> list[str]:
    """The names: ``box''`` of an inertia, ``clutch.torque`` of a link with springs; none if it is no drive train."""
    assembly = structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return []
    form = assembly.form
    links = [f"{link.name}.torque" for link in form.links if not link.rigid]
    return [*(f"{name}''" for name in form.inertias), *links]


def train_histories(
    system: System,
    theta: NDArray | float,
    q: NDArray,
    v: NDArray,
    a: NDArray,
    forces: NDArray,
) -> NDArray:
    """The values of all signals of a train, shape (samples, signals), real or complex.

    Parameters
    ----------
    system
        The system.
    theta : shape (samples,)
        Angles of the excitation.
    q, v, a : shape (samples, n)
        Deflections with their derivatives over time.
    forces : shape (samples, contacts)
        Contact forces.
    """
    assembly = system.structure.assembly
    assert isinstance(assembly, TrainAssembly)
    leaks = assembly.leaks(system.values)
    rates, a = v + leaks * q, a + leaks * v  # those of the angles of slips
    return np.hstack((_accelerations(assembly, system, theta, a), _torques(assembly, system, q, rates, forces)))


def _accelerations(assembly: TrainAssembly, system: System, theta: NDArray | float, a: NDArray) -> NDArray:
    turning = assembly.turning(system.values)
    whole = [np.ones(np.shape(theta))]
    for torque in assembly.form.torques:
        amplitude, phase = assembly.form.size_and_phase(assembly.consistent(system.values), torque)
        whole.append(amplitude * np.cos(torque.harmonic.order * np.asarray(theta) + phase))
    return a @ assembly.angles(system.values).T + np.stack(whole, axis=-1) @ turning.T


def _torques(assembly: TrainAssembly, system: System, q: NDArray, v: NDArray, forces: NDArray) -> NDArray:
    """What each link with springs carries: its spring and damper that act always, and its contact."""
    stiffness, damping, deflections = assembly.links(system.values)
    torques = stiffness * (q @ deflections.T) + damping * (v @ deflections.T)
    for place, (number, _) in enumerate(assembly.form.contacts):
        torques[..., number] += forces[..., place]
    return torques[..., [number for number, link in enumerate(assembly.form.links) if not link.rigid]]
