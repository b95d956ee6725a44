"""Which special points of a branch are followed in two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gapwalk.bifurcation.branch import Kind, SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.studies.map.options import KINDS


@dataclass(frozen=True, slots=True)
class Which:
    """Which special points of a branch are followed in two parameters.

    Parameters
    ----------
    kind
        What happens there; a branch point has no locus.
    near
        Of those, only the one nearest to this value of the branch's parameter; by default all.
    contact
        Of grazing points, only those of this contact, or of a stage and side of it, such as ``stage2 -``.

    Raises
    ------
    ModelError
        For a branch point, or a contact with another kind than grazing.
    """

    kind: Kind
    near: float | None = None
    contact: str = ""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ModelError(f"a {self.kind.value} has no locus; choose {', '.join(kind.value for kind in KINDS)}")
        if self.contact and self.kind is not Kind.GRAZING:
            raise ModelError(f"contact is for grazing points; leave it out for those of the kind {self.kind.value}")

    def of(self, specials: Sequence[SpecialPoint]) -> list[SpecialPoint]:
        """Those of some special points, in their order."""
        found = [special for special in specials if special.kind is self.kind and self._touches(special.contact)]
        if self.near is None or not found:
            return found
        near = self.near
        return [min(found, key=lambda special: abs(special.value - near))]

    @property
    def words(self) -> str:
        """The same in words."""
        contact = f" of {self.contact}" if self.contact else ""
        return f"{self.kind.value}{contact}{'' if self.near is None else f' nearest to {self.near:.8g}'}"

    def _touches(self, contact: str) -> bool:
        """Whether a contact with its stage and side, as a special point names them, is meant."""
        return not self.contact or contact == self.contact or contact.startswith(f"{self.contact} ")
