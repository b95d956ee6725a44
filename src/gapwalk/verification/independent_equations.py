"""Second, independent implementation of the equations of motion, from the named matrices, for many systems at once.

Nothing here comes from `gapwalk.flow`, because code must not verify its own results. The formulas of the force laws
are those of `gapwalk.model.laws`, the only place where they stand, and are tested against closed forms; which stages
act is decided here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.laws import Stages, StageTerms
from gapwalk.model.system import System

Array = NDArray[np.float64]

_STEP = 1e-150  # of the complex step


class Equations:
    """Equations ``M q'' + C q' + K q + sum d f = mean + sum F cos(h W t + phi)`` of L systems of one structure.

    The active stage of each contact is an argument, so that the right-hand sides are smooth between contact events.

    Parameters
    ----------
    systems
        The systems.
    """

    def __init__(self, systems: Sequence[System]) -> None:
        structure = systems[0].equations.structure
        values = np.array([system.equations.values for system in systems])
        same = values[:, 1:] == values[:1, 1:]
        shared = bool(np.all(same))  # along the frequency all matrices are equal
        if shared:
            values = values[:1]
        n = self.size = structure.size
        self.frequency = np.array([system.frequency for system in systems])

        def vectors(names: list[str]) -> Array:
            found = [values[:, structure.block(name, n)] for name in names]
            return np.stack(found, axis=-1) if found else np.zeros((len(values), n, 0))

        contacts, harmonics = structure.contacts, structure.harmonics
        stiffness, damping, mass = (
            values[:, structure.block(which, n, n)] for which in ("stiffness", "damping", "mass")
        )
        which = ["deflection" if form.reciprocal else "force" for form in contacts]
        push = vectors([f"{form.name}.{each}" for form, each in zip(contacts, which, strict=True)])
        mean, shapes = vectors(["mean"]), vectors([f"{harmonic.name}.acts_on" for harmonic in harmonics])
        solved = np.linalg.solve(mass, np.concatenate((stiffness, damping, push, mean, shapes), axis=2))
        columns = np.cumsum([n, n, len(contacts), 1])
        parts: list[Array] = [np.asarray(part, dtype=float) for part in np.split(solved, columns, axis=2)]
        self._stiffness, self._damping, self._push, mean, self._shapes = parts
        self._mean = mean[:, :, 0]
        self._deflections = vectors([f"{form.name}.deflection" for form in contacts]).transpose(0, 2, 1)
        places = [[structure.place(name) for name in load.parameters] for load in harmonics]
        lines = [load.lines(self.frequency, values[:, where].T) for load, where in zip(harmonics, places, strict=True)]
        self._orders = np.array([line.order for each in lines for line in each], dtype=float)
        self._load_of = np.array([index for index, each in enumerate(lines) for _ in each], dtype=np.intp)
        self._cosines, self._sines = (
            np.stack([np.broadcast_to(part, len(systems)) for part in parts], axis=1) if parts else np.zeros((1, 0))
            for parts in (
                [line.cosine for each in lines for line in each],
                [line.sine for each in lines for line in each],
            )
        )
        stages = [
            (index, sign, form.stage_prefix(stage))
            for index, form in enumerate(contacts)
            for stage in form.stages
            for sign in stage.side.signs
        ]
        self.contact_of = np.array([index for index, _, _ in stages], dtype=np.intp)
        self.signs = np.array([sign for _, sign, _ in stages], dtype=float)
        self._contacts = contacts
        places = [structure.place(f"{prefix}.clearance") for _, _, prefix in stages]
        self._clearance = values[:, np.array(places, dtype=np.intp)]
        self._of_stages = [
            {
                each.name: values[:, structure.place(f"{prefix}.{each.name}")]
                for each in contacts[index].law.stage_parameters
            }
            for index, _, prefix in stages
        ]
        self._own = [
            {each.name: values[:, structure.place(f"{form.name}.{each.name}")] for each in form.law.parameters}
            for form in contacts
        ]
        self._free = -np.trace(self._damping, axis1=1, axis2=2)
        self._drag = np.sum(self._deflections * self._push.transpose(0, 2, 1), axis=2)

    def deflections(self, q: Array, lanes: slice = slice(None)) -> Array:
        """Return the deflections of the contacts, shape (L, contacts), for positions (or rates) of shape (L, n)."""
        return _times(self._of(self._deflections, lanes), q)

    def depths(self, deflections: Array, lanes: slice = slice(None)) -> Array:
        """Return the depths beyond the breakpoints, shape (L, switches)."""
        return self.signs * deflections[:, self.contact_of] - self._of(self._clearance, lanes)

    def rates(self, theta: Array, state: Array, closed: Array, lanes: slice = slice(None)) -> Array:
        """Return the derivatives over theta of positions, velocities, and the logarithm of a volume of states.

        Parameters
        ----------
        theta : shape (L,)
            Angles of the excitation.
        state : shape (L, 2n + 1)
            Positions, velocities, and that logarithm.
        closed : shape (L, switches)
            1 for each stage that acts, otherwise 0.
        lanes
            Indices of the systems.
        """
        n = self.size
        q, v = state[:, :n], state[:, n : 2 * n]
        x, rate = self.deflections(q, lanes), self.deflections(v, lanes)
        force, by_rate = self._contact_forces(x, rate, closed, lanes)
        angles = theta[:, None] * self._orders
        cosines, sines = self._of(self._cosines, lanes), self._of(self._sines, lanes)
        loads = cosines * np.cos(angles) + sines * np.sin(angles)
        acceleration = (
            self._of(self._mean, lanes)
            + _times(self._of(self._shapes, lanes)[:, :, self._load_of], loads)
            - _times(self._of(self._stiffness, lanes), q)
            - _times(self._of(self._damping, lanes), v)
            - _times(self._of(self._push, lanes), force)
        )
        divergence = self._of(self._free, lanes) - (self._of(self._drag, lanes) * by_rate).sum(axis=1)
        return np.column_stack((v, acceleration, divergence)) / self.frequency[lanes, None]

    def _contact_forces(self, x: Array, rate: Array, closed: Array, lanes: slice) -> tuple[Array, Array]:
        """Return the contact forces, and their derivatives by the deflection rates; shape (L, contacts) each."""
        depths, found = self.signs * self.depths(x, lanes), np.zeros(x.shape, dtype=complex)
        for index, form in enumerate(self._contacts):
            switches = np.flatnonzero(self.contact_of == index).tolist()
            stages = [
                StageTerms(
                    shape.sign, depths[:, k], closed[:, k], shape.innermost, self._named(self._of_stages[k], lanes)
                )
                for k, shape in zip(switches, form.shapes, strict=True)
            ]
            own = self._named(self._own[index], lanes)
            found[:, index] = form.law.force(rate[:, index] + 1j * _STEP, Stages(stages), own)
        return np.real(found), np.imag(found) / _STEP

    def _named(self, numbers: Mapping[str, Array], lanes: slice) -> dict[str, Array]:
        return {name: self._of(values, lanes) for name, values in numbers.items()}

    @staticmethod
    def _of(values: Array, lanes: slice) -> Array:
        return values if len(values) == 1 else values[lanes]


def _times(matrices: Array, vectors: Array) -> Array:
    """Return products of matrices (one, or one for each vector) and vectors, shape (L, rows)."""
    if len(matrices) == 1:
        return vectors @ matrices[0].T
    return (matrices @ vectors[:, :, None])[:, :, 0]
