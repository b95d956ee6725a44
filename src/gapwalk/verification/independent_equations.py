"""Second, independent implementation of the equations of motion, from the named matrices, for many systems at once.

Nothing here comes from `gapwalk.flow`, because code must not verify its own results.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import DampingLaw
from gapwalk.model.system import System

Array = NDArray[np.float64]


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
        parts: list[Array] = [np.asarray(part, dtype=float) for part in _split(solved, [n, n, len(contacts), 1])]
        self._stiffness, self._damping, self._push, mean, self._shapes = parts
        self._mean = mean[:, :, 0]
        self._deflections = vectors([f"{form.name}.deflection" for form in contacts]).transpose(0, 2, 1)
        self._orders = np.array([harmonic.order for harmonic in harmonics], dtype=float)
        self._amplitudes = self._numbers(values, [f"{harmonic.name}.amplitude" for harmonic in harmonics], structure)
        self._phases = self._numbers(values, [f"{harmonic.name}.phase" for harmonic in harmonics], structure)
        stages = [
            (index, sign, form.stage_prefix(stage))
            for index, form in enumerate(contacts)
            for stage in form.stages
            for sign in stage.side.signs
        ]
        self.contact_of = np.array([index for index, _, _ in stages], dtype=np.intp)
        self.signs = np.array([sign for _, sign, _ in stages], dtype=float)
        self._clearance, self._spring, self._cubic = (
            self._numbers(values, [f"{prefix}.{name}" for _, _, prefix in stages], structure)
            for name in ("clearance", "stiffness", "cubic")
        )
        self._sum = np.zeros((len(stages), len(contacts)))
        self._sum[np.arange(len(stages)), self.contact_of] = 1.0
        self._laws = [form.damping for form in contacts]
        self._dampers = [
            self._numbers(values, [f"{form.name}.{form.damping_name}"], structure)[:, 0] if form.damping_name else None
            for form in contacts
        ]
        self._free = -np.trace(self._damping, axis1=1, axis2=2)
        self._drag = np.sum(self._deflections * self._push.transpose(0, 2, 1), axis=2)

    @staticmethod
    def _numbers(values: Array, names: list[str], structure) -> Array:
        return values[:, [structure.place(name) for name in names]] if names else np.zeros((len(values), 0))

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
        angles = theta[:, None] * self._orders + self._of(self._phases, lanes)
        acceleration = (
            self._of(self._mean, lanes)
            + _times(self._of(self._shapes, lanes), self._of(self._amplitudes, lanes) * np.cos(angles))
            - _times(self._of(self._stiffness, lanes), q)
            - _times(self._of(self._damping, lanes), v)
            - _times(self._of(self._push, lanes), force)
        )
        divergence = self._of(self._free, lanes) - (self._of(self._drag, lanes) * by_rate).sum(axis=1)
        return np.column_stack((v, acceleration, divergence)) / self.frequency[lanes, None]

    def _contact_forces(self, x: Array, rate: Array, closed: Array, lanes: slice) -> tuple[Array, Array]:
        """Return the contact forces, and their derivatives by the deflection rates; shape (L, contacts) each."""
        inside = self.depths(x, lanes)
        spring = self._of(self._spring, lanes) * inside + self._of(self._cubic, lanes) * inside**3
        force = (closed * self.signs * spring) @ self._sum
        by_rate = np.zeros_like(force)
        for index, (law, damper) in enumerate(zip(self._laws, self._dampers, strict=True)):
            if damper is None:
                continue
            elastic, strength = force[:, index], self._of(damper, lanes)
            match law:
                case DampingLaw.VISCOUS:
                    by_rate[:, index] = strength * ((closed @ self._sum)[:, index] > 0.0)
                case DampingLaw.HUNT_CROSSLEY:
                    by_rate[:, index] = strength * np.abs(elastic)
                case DampingLaw.HUNT_CROSSLEY_AS_PRINTED:
                    by_rate[:, index] = strength * elastic
                case DampingLaw.NONE:
                    pass
        return force + by_rate * rate, by_rate

    @staticmethod
    def _of(values: Array, lanes: slice) -> Array:
        return values if len(values) == 1 else values[lanes]


def _split(matrices: Any, widths: list[int]) -> list[Any]:
    """Split matrices that are joined side by side; the last one takes the remaining columns."""
    return np.split(matrices, np.cumsum(widths), axis=2)


def _times(matrices: Array, vectors: Array) -> Array:
    """Return products of matrices (one, or one for each vector) and vectors, shape (L, rows)."""
    if len(matrices) == 1:
        return vectors @ matrices[0].T
    return (matrices @ vectors[:, :, None])[:, :, 0]
