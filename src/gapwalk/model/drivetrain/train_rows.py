"""Links of a train as rows of weights over the angles of inertias, and what follows from the rows that join them.

A shaft or gear has two ends; a mesh of a planetary set has three or four. How the train turns as a whole, which of its
deflections are independent, and which links are on a loop, follow from elimination, in exact fractions.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.contact import ContactForm
from gapwalk.model.drivetrain.train_parts import GROUND, Friction, Gear, Link
from gapwalk.model.laws import Expression

Row: TypeAlias = Mapping[str, Fraction]

_ROUNDED = Fraction(1, 10**12)  # share of a weight that is left where ratios that are no fractions cancel
_SHARE = 1e-9  # of the row of a link in another row from which that contains it


@dataclass(frozen=True, slots=True)
class LinkForm:
    """A shaft or gear without its numbers."""

    name: str  #: Its name.
    ends: tuple[int, int]  #: Its ends by number; the ground follows the last inertia.
    geared: bool  #: True if it has a ratio.
    fixed: float | None  #: The ratio where it is no parameter: on a closed loop it follows from the others.
    rigid: bool  #: True if it has no springs.
    always: bool  #: True if it has a spring that acts always.
    #: Its contacts: springs with clearances, the friction beside them, a rigid stop; or its formula, or its friction.
    parts: tuple[ContactForm, ...]
    #: Names of its numbers beside those of its contacts, if it is a drag written as such.
    own: tuple[str, ...] | None = None
    #: True if its ends turn at different mean speeds, and it slips on all the time.
    turns: bool = False
    way: int = 0  #: The sign of its mean slip, 0 without any: that of its constant torque.
    rest: float = 0.0  #: The mean speed of its end at the ground over that of the reference: 0 unless it is prescribed.
    speeds: tuple[int, ...] = ()  #: The inertias whose absolute speeds its formula has beside its own slip.
    group: str = ""  #: The name of the group of drags by whose number its torque is multiplied.
    row: tuple[tuple[int, float], ...] = ()  #: Inertias and the weights of their angles, if it has more than two ends.

    @property
    def contact(self) -> ContactForm | None:
        """Its springs with clearances or its rigid stop, or its formula, or its friction; None if it acts always."""
        return next((each for each in self.parts[:1] if each.name == self.name), None)

    @property
    def beside(self) -> tuple[ContactForm, ...]:
        """The contacts beside that one."""
        return self.parts[1:] if self.contact else self.parts

    @property
    def drag(self) -> bool:
        """True for a damper without any spring."""
        return not (self.rigid or self.always or self.contact)

    @property
    def by_formula(self) -> bool:
        """True if its torque is a formula or friction, so that it has no damper."""
        return self.own is None and self.contact is not None and not self.contact.law.stage_parameters

    @property
    def dry(self) -> bool:
        """True for friction alone: it joins nothing."""
        return self.contact is not None and self.contact.law.is_dry

    @property
    def loose(self) -> bool:
        """True for friction, and a formula that does not depend on its deflection."""
        law = self.contact.law if self.contact else None
        return self.dry or (isinstance(law, Expression) and "x" not in law.formula.variables)

    @property
    def slides(self) -> bool:
        """True for what may join two parts that slip on each other all the time: a damper, or a formula of the slip."""
        return self.drag or (self.loose and not self.dry)

    @property
    def own_numbers(self) -> tuple[str, ...]:
        """Names of its numbers, without those of its contact."""
        if self.own is not None:
            return self.own
        has = {"ratio": self.geared and self.fixed is None, "stiffness": self.always}
        has["damping"] = not self.rigid and not self.by_formula
        return tuple(what for what, value in has.items() if value)


@dataclass(frozen=True)
class Solved:
    """The rows of the links that join inertias, solved."""

    basis: Mapping[str, Row]  #: The links whose rows do not depend on each other, rigid ones first, with their rows.
    #: The angles of inertias by those that the rows leave free, and by that of the ground; all other inertias are free.
    follow: Mapping[str, Row]
    free: tuple[str, ...]  #: The inertias whose angles are free.
    is_held: bool  #: True if a spring or a rigid link joins an inertia to the ground.

    def speeds(self, reference: str) -> dict[str, Fraction]:
        """Return the speeds over that of the reference, of what turns as it does; empty if it does not turn alone."""
        found: dict[str, dict[str, Fraction]] = {name: {name: Fraction(1)} for name in self.free}
        for name, row in self.follow.items():
            found[name] = {free: -weight for free, weight in row.items() if free not in (name, GROUND)}
        if len(found.get(reference, ())) != 1:
            return {}
        ((root, scale),) = found[reference].items()
        return {name: row.get(root, Fraction(0)) / scale for name, row in found.items() if row.keys() <= {root}}

    @cached_property
    def _inverse(self) -> NDArray[Any]:
        return np.linalg.inv([self._floats(row) for row in (*self.basis.values(), *({name: 1} for name in self.free))])

    def _floats(self, row: Mapping[str, Any]) -> list[float]:
        return [float(row.get(name, 0)) for name in (*self.follow, *self.free)]

    def made_of(self, row: Row) -> set[str]:
        """Return the links of the basis whose rows make up a row that depends on them."""
        shares = np.array(self._floats(row)) @ self._inverse
        return {name for name, share in zip(self.basis, shares, strict=False) if abs(share) > _SHARE}


def row_of(link: Link) -> dict[str, Fraction]:
    """Return the weights of the angles in the deflection of a link, exact where they are ratios of small numbers."""
    if link.row:
        return dict(link.row)
    ratio = link.exact_ratio if isinstance(link, Gear) else None
    if ratio is None:
        ratio = Fraction(getattr(link, "ratio", None) or 1.0)
    return {link.between[0]: Fraction(1), link.between[1]: -ratio}


def solved(links: Collection[Link], inertias: Collection[str], prescribed: Collection[str] = ()) -> Solved:
    """Solve the rows of links that join inertias, rigid ones first; what is prescribed belongs to the ground."""
    fixed, branched = {*prescribed, GROUND}, any(link.row for link in links)

    def held(link: Link) -> bool:
        return not link.row and any(end in fixed for end in link.between)

    is_held = any(held(link) and not link.is_drag for link in links)
    at_rest = [link for link in links if link.is_drag and held(link) and (branched or not is_held)]
    joining = [link for link in links if link not in at_rest and not isinstance(link, Friction)]
    joining.sort(key=lambda link: (link.only_follows, link.is_drag, held(link), not link.is_rigid))
    basis: dict[str, Row] = {}
    follow: dict[str, dict[str, Fraction]] = {}
    for link in joining:
        row = {GROUND if end in fixed else end: weight for end, weight in row_of(link).items()}
        if link.row:
            row.pop(GROUND, None)
        left = reduced(row, follow)
        moving = [name for name in left if name != GROUND]
        alone = link.row or (branched and not link.is_drag)  # it may stop what turns; a drag may not
        if len(left if prescribed or not branched else moving) > 1 or (moving and alone):
            pivot = min(moving, key=lambda name: sum(name in row for row in follow.values()))
            scale = left[pivot]
            left = {name: weight / scale for name, weight in left.items()}
            for other in follow.values():
                if pivot in other:
                    _add(other, left, -other[pivot])
            basis[link.name], follow[pivot] = row, left
    free = tuple(name for name in inertias if name not in fixed and name not in follow)
    return Solved(basis, follow, free, is_held)


def reduced(row: Row, follow: Mapping[str, Row]) -> dict[str, Fraction]:
    """Return a row in the angles that are free."""
    left = dict(row)
    for name in [each for each in left if each in follow]:
        _add(left, follow[name], -left[name])
    return left


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


def _add(row: dict[str, Fraction], other: Row, factor: Fraction) -> None:
    """Add a multiple of another row to a row."""
    for name, weight in other.items():
        more = factor * weight
        row[name] = row.get(name, 0) + more
        if abs(row[name]) <= _ROUNDED * abs(more):
            del row[name]
