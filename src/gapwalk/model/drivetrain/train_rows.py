"""Deflections as rows of weights over the angles of inertias, and the speeds at which all joining rows are zero.

A shaft or gear has two ends; a mesh of a planetary set has three or four. So the train is no tree any more: how it
turns as a whole, and which deflections are its coordinates, follow from elimination, in exact fractions. A train
without such links is walked as a tree (`gapwalk.model.drivetrain.train_assembly.tree_of`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.train_parts import GROUND, Friction, Gear, Link

Row: TypeAlias = Mapping[str, Fraction]

_ROUNDED = Fraction(1, 10**12)  # what is left of a row that depends on others, for ratios that are no fractions


@dataclass(frozen=True)
class Solved:
    """The rows of the links that join inertias, solved."""

    basis: tuple[str, ...]  #: The links whose rows do not depend on each other, rigid ones first.
    #: The angles of inertias by those that the rows leave free; all other inertias are free.
    follow: Mapping[str, Row]
    free: tuple[str, ...]  #: The inertias whose angles are free.

    def speeds(self, reference: str) -> dict[str, Fraction]:
        """Return the speeds over that of the reference; empty if nothing can turn, or if two angles are free."""
        if len(self.free) != 1:
            return {}
        found = {self.free[0]: Fraction(1)}
        found |= {name: -row.get(self.free[0], Fraction(0)) for name, row in self.follow.items()}
        scale = found.get(reference, Fraction(0))
        return {name: speed / scale for name, speed in found.items()} if scale else {}


def row_of(link: Link) -> dict[str, Fraction]:
    """Return the weights of the angles in the deflection of a link, exact where they are ratios of small numbers."""
    if link.row:
        return dict(link.row)
    ratio = link.exact_ratio if isinstance(link, Gear) else None
    if ratio is None:
        ratio = Fraction(getattr(link, "ratio", None) or 1.0)
    return {link.between[0]: Fraction(1), link.between[1]: -ratio}


def solved(links: Iterable[Link], inertias: Collection[str], prescribed: Collection[str] = ()) -> Solved:
    """Solve the rows of links that join inertias, rigid ones first; angles that are prescribed are zero."""

    def held(link: Link) -> bool:
        return not link.row and any(end == GROUND or end in prescribed for end in link.between)

    joining = [link for link in links if not (link.is_drag and (isinstance(link, Friction) or held(link)))]
    joining.sort(key=lambda link: (link.only_follows, link.is_drag, held(link), not link.is_rigid))
    moving = {name for name in inertias if name not in prescribed}
    basis: list[str] = []
    follow: dict[str, dict[str, Fraction]] = {}
    for link in joining:
        if link.is_drag and len(moving) - len(follow) <= (0 if prescribed else 1):
            break
        left = {name: weight for name, weight in row_of(link).items() if name in moving}
        size = max(map(abs, left.values()), default=Fraction(0))
        for name in [each for each in left if each in follow]:
            _add(left, follow[name], -left.pop(name), leave=name)
        left = {name: weight for name, weight in left.items() if abs(weight) > _ROUNDED * size}
        if not left:
            continue
        pivot = next(iter(left))
        scale = left[pivot]
        left = {name: weight / scale for name, weight in left.items()}
        for other in follow.values():
            if pivot in other:
                _add(other, left, -other[pivot])
        basis.append(link.name)
        follow[pivot] = left
    return Solved(tuple(basis), follow, tuple(name for name in inertias if name in moving and name not in follow))


def circuits(links: Collection[Link], found: Solved, inertias: Collection[str]) -> set[str]:
    """Return the links on whose ratios it depends that the train can turn: those of rows that depend on each other."""
    own = {link.name: [float(row_of(link).get(name, 0)) for name in inertias] for link in links}
    basis = np.array([own[name] for name in found.basis]).T
    looped: set[str] = set()
    for link in links:
        if link.name not in found.basis and not (link.is_drag or link.only_follows):
            shares = np.linalg.lstsq(basis, np.array(own[link.name]), rcond=None)[0]
            looped |= {link.name, *(name for name, share in zip(found.basis, shares, strict=True) if abs(share) > 1e-9)}
    return looped


def ways_of(rows: NDArray[Any]) -> NDArray[Any]:
    """Return the angles for which all rows are zero, real or complex, shape (angles, ways), as sparse as they are."""
    rows, pivots = rows.copy(), list[int]()
    for number in range(len(rows)):  # Gauss and Jordan
        rows[number] -= rows[number, pivots] @ rows[:number]
        pivots.append(int(np.argmax(np.abs(rows[number]))))
        rows[number] /= rows[number, pivots[-1]]
        rows[:number] -= np.outer(rows[:number, pivots[-1]], rows[number])
    others = [number for number in range(rows.shape[1]) if number not in pivots]
    found = np.zeros((rows.shape[1], len(others)), dtype=rows.dtype)
    found[others, range(len(others))] = 1.0
    found[pivots] = -rows[:, others]
    return found


def _add(row: dict[str, Fraction], other: Row, factor: Fraction, leave: str = "") -> None:
    """Add a multiple of another row to a row."""
    for name, weight in other.items():
        if name != leave:
            row[name] = row.get(name, Fraction(0)) + factor * weight
            if not row[name]:
                del row[name]
