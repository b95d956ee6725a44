"""Constraints of friction that sticks rigidly, and of rigid stops that are held.

A contact that is held keeps the rate of its deflection at zero, and its force is a reaction. With ``a`` the
accelerations without the reactions, ``E`` the deflections that are held, and ``W = M^-1 D`` the accelerations by a unit
of their forces,

    (E W) lambda = E a + u''          and the accelerations are          a - W lambda

where ``u`` are displacements that are added to the deflections. ``a`` is a sum of rows of coefficients, so while a
contact is held the motion is that of a system with other coefficients: `constrained` computes them. The reactions are
rows of coefficients too.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout, layout_of
from gapwalk.model.structure import Structure

_DEPENDENT = 1e-9  # share of its own size that is left of a constraint which depends on others
_ROUNDING = 8e-16  # share of two terms within which their difference is rounding


class Constraint:
    """The constraint by some reactions, for given coefficients, real or complex.

    Shapes: `vectors` (independent, n); `impulses` (n, independent).

    Shapes: `impulses` (n, independent).

    Attributes
    ----------
    impulses : shape (n, independent)
        ``W (E W)^-1``: change of the velocities by which the rate of one of them changes by 1.
    independent
        The numbers of the reactions that are independent.
    """

    def __init__(self, layout: CoefficientLayout, coefficients: NDArray, held: Sequence[int]) -> None:
        self._layout, self._coefficients, n = layout, coefficients, layout.structure.size
        contacts = [layout.structure.reactions[number][0] for number in held]
        self._deflections = np.array([layout.contacts[k].deflection for k in contacts], np.intp).reshape(-1, n)
        self._forces = np.array([layout.contacts[k].force for k in contacts], np.intp).reshape(-1, n)
        inner = coefficients[self._deflections] @ coefficients[self._forces].T
        chosen = _independent(np.real(inner).tolist())
        if len(chosen) < len(held):
            self._deflections, self._forces = self._deflections[chosen], self._forces[chosen]
            inner = inner[chosen][:, chosen]
        self.independent = [held[place] for place in chosen]
        self.contacts = [contacts[place] for place in chosen]
        self.vectors, self._pushes = coefficients[self._deflections], coefficients[self._forces].T
        self._inverse = 1.0 / inner if len(chosen) < 2 else np.linalg.inv(inner)
        self.impulses = self._pushes @ self._inverse

    @cached_property
    def stopping(self) -> NDArray:
        """The matrix by which a row of velocities is multiplied for their change where the contacts begin to be held.

        This is for contacts that are held to a base at rest.
        """
        return self.vectors.T @ self.impulses.T

    @cached_property
    def _rows(self) -> NDArray:
        """Rows of coefficients of the accelerations of their deflections, without the reactions."""
        layout, coefficients = self._layout, self._coefficients
        rows = self.vectors @ coefficients[layout.accelerations]
        for row, contact in zip(rows, self.contacts, strict=True):
            if (sway := layout.contacts[contact].sway) is not None:
                row[len(row) - len(sway) :] -= self._squares * coefficients[sway]
        return rows

    @property
    def _squares(self) -> NDArray:
        """Squares of the angular frequencies of all orders, for cosines and sines: second derivatives of waves."""
        orders = np.array(self._layout.orders * 2, dtype=float)
        return (orders / self._coefficients[0]) ** 2

    def coefficients(self) -> NDArray:
        """Return the coefficients of the system while these contacts are held."""
        layout = self._layout
        found = self._coefficients.copy()
        found[layout.reactions] = 0.0
        if not self.independent:
            return found
        table = found[layout.accelerations]
        moved = self.impulses @ self._rows
        difference = table - moved
        sizes = np.abs(np.real(table)) + np.abs(np.real(moved))
        small = np.abs(np.real(difference)) <= _ROUNDING * sizes
        difference[small] -= np.real(difference[small])  # what is 0 must not grow from rounding
        found[layout.accelerations] = difference
        found[layout.reactions[self.independent]] = self.reactions
        return found

    @property
    def reactions(self) -> NDArray:
        """Rows of coefficients of the reactions that are `independent`."""
        return self._inverse @ self._rows

    def changes(self, directions: NDArray) -> NDArray:
        """Return the changes of `coefficients` for changes of the system without constraints, one in each row."""
        layout, found = self._layout, directions.copy()
        found[:, layout.reactions] = 0.0
        if not self.independent:
            return found
        table, moved = self._coefficients[layout.accelerations], directions[:, layout.accelerations]
        vectors, pushes = directions[:, self._deflections], directions[:, self._forces].swapaxes(1, 2)
        rows = vectors @ table + self.vectors @ moved
        for place, contact in enumerate(self.contacts):
            if (sway := layout.contacts[contact].sway) is not None:
                growth = (
                    directions[:, sway]
                    - np.outer(2.0 * directions[:, 0], self._coefficients[sway]) / self._coefficients[0]
                )
                rows[:, place, rows.shape[2] - len(sway) :] -= self._squares * growth
        reactions = self.reactions
        inner = vectors @ self._pushes + self.vectors @ pushes
        changed = self._inverse @ (rows - inner @ reactions)
        found[:, layout.accelerations] = moved - self._pushes @ changed - pushes @ reactions
        found[:, layout.reactions[self.independent]] = changed
        return found


def _independent(left: list[list[float]]) -> list[int]:
    """Return the places of the constraints that do not depend on those before them, by elimination from ``E W``."""
    chosen, sizes = [], [row[place] for place, row in enumerate(left)]
    for place, row in enumerate(left):
        if not abs(row[place]) > _DEPENDENT * abs(sizes[place]):
            continue
        chosen.append(place)
        for other in left[place + 1 :]:
            factor = other[place] / row[place]
            for column in range(place + 1, len(row)):
                other[column] -= factor * row[column]
    return chosen


def reachable(layout: CoefficientLayout, pattern: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the coefficients that are not zero in a system or under any of its constraints."""
    reactions = layout.structure.reactions
    if not reactions:
        return pattern
    found, n = pattern.copy(), layout.structure.size
    table, rows = found[layout.accelerations], found[layout.reactions]
    contacts = [layout.contacts[contact] for contact, _ in reactions]
    count = 2 * len(layout.orders)
    while True:
        before = int(table.sum()) + int(rows.sum())
        for row, slots in zip(rows, contacts, strict=True):
            row |= table[pattern[slots.deflection]].any(axis=0)
            if slots.sway is not None:
                row[len(row) - count :] |= pattern[slots.sway]
        row_of_all = rows.any(axis=0)
        for row, slots in zip(rows, contacts, strict=True):
            # constraints are coupled where one's push moves another's deflection; to take all as coupled is safe
            row |= row_of_all
            table[pattern[slots.force]] |= row
        if int(table.sum()) + int(rows.sum()) == before:
            break
    assert table.shape[0] == n
    found[layout.accelerations], found[layout.reactions] = table, rows
    return found


def reachable_changes(
    layout: CoefficientLayout, pattern: NDArray[np.bool_], changed: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return the coefficients that a parameter can change in a system or under any of its constraints."""
    reactions = layout.structure.reactions
    if not reactions:
        return changed
    contacts = [layout.contacts[contact] for contact, _ in reactions]
    concerned = [layout.accelerations.ravel(), *(slots.deflection for slots in contacts)]
    if any(slots.sway is not None for slots in contacts):
        concerned += [np.array([0]), *(slots.sway for slots in contacts if slots.sway is not None)]
    if not changed[np.concatenate(concerned)].any():
        return changed
    found = changed.copy()
    pushed = np.any([pattern[slots.force] for slots in contacts], axis=0)
    for slots in (layout.accelerations[pushed], layout.reactions):
        found[slots] |= pattern[slots]
    return found


@lru_cache(maxsize=256)
def reachable_masks(structure: Structure, masks: tuple[bytes, ...]) -> tuple[bytes, ...]:
    """Return the masks of `reachable` and `reachable_changes`, from those of a system and of each parameter."""
    pattern, *directions = (np.frombuffer(mask, dtype=bool) for mask in masks)
    layout = layout_of(structure)
    pattern = reachable(layout, pattern)
    return pattern.tobytes(), *(reachable_changes(layout, pattern, mask).tobytes() for mask in directions)
