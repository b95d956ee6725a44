"""What the study of a locus is asked to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gapwalk.errors import ModelError
from gapwalk.studies.locus.which import Which
from gapwalk.studies.options import MapStudyOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class LocusStudyOptions(MapStudyOptions):
    """The loci of some special points of one branch: a map of one kind, with one section on which one branch is walked.

    Parameters
    ----------
    parameter, begin, end, measure, period, start, walk, method
        As `BranchOptions`, for the branch on which the special points lie; the range is that of the plane too.
    second
        The second parameter, and its range.
    sections
        One value of the second parameter: where the branch is walked.
    kinds
        One kind of special points.
    near
        Of those, only the one nearest to this value of the first parameter; by default all are followed.
    contact
        Of grazing points, only those of this contact.

    Raises
    ------
    ModelError
        For more sections or kinds than one, or a contact with another kind than grazing.
    """

    kind: ClassVar[str] = "locus"

    near: float | None = None
    contact: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.sections, tuple) or len(self.sections) != 1 or len(self.kinds) != 1:
            raise ModelError("a locus has one section and one kind, as in sections=(0.25,), kinds=(gw.Kind.FOLD,)")
        self.which  # noqa: B018  (raises what is wrong with it)

    @property
    def which(self) -> Which:
        """Which special points are followed."""
        return Which(self.kinds[0], self.near, self.contact)

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        assert isinstance(self.sections, tuple)
        return (
            f"{self.kind} of {self.which.words} over {self._range} and {self.second.words}, picked up at "
            f"{self.second.parameter} = {self.sections[0]:g}, period {self.period}"
        )
