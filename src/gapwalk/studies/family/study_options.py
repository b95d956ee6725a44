"""What the study of a family is asked to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from gapwalk.bifurcation.branch import Kind
from gapwalk.studies.family.options import FamilyOptions
from gapwalk.studies.family.over import MemberParameter
from gapwalk.studies.options import BranchOptions

_LIMITS = FamilyOptions()


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyStudyOptions(BranchOptions):
    """A family: the branches over one parameter, for several values of another one.

    Parameters
    ----------
    parameter, begin, end, measure, period, start, walk, method
        As `BranchOptions`, for each member.
    over
        What differs from member to member.
    max_period, kinds, exact, workers
        How far they go, and how their special points are joined; as `FamilyOptions`.
    """

    kind: ClassVar[str] = "family"

    over: MemberParameter
    max_period: int | None = _LIMITS.max_period
    kinds: tuple[Kind, ...] = _LIMITS.kinds
    exact: bool = _LIMITS.exact
    workers: int | None = field(default=None, compare=False)  # it changes nothing of the result

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        axis = self.over.axis
        far = "" if self.max_period is None else f", to period {self.max_period}"
        return (
            f"{self.kind} over {self._range} at {len(axis)} values of {self.over.name} from {axis[0]:g} to "
            f"{axis[-1]:g}, period {self.period}{far}, showing {self.measure}"
        )

    @property
    def limits(self) -> FamilyOptions:
        """How far the members go, how their special points are joined, and in how many processes."""
        return FamilyOptions(self.max_period, self.kinds, self.exact, self.workers)
