"""The result of a study, as it comes from a run or from a result file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gapwalk.bifurcation.diagram import Diagram
from gapwalk.continuation.branch import Branch
from gapwalk.model.system import System
from gapwalk.study.file import Study
from gapwalk.study.options import StudyOptions


@dataclass(frozen=True)
class Result:
    """What a study has found.

    Attributes
    ----------
    study
        What was asked.
    branches
        The branches that were found.
    complete
        Whether all was done that can be; False after an interruption, from which a run can be resumed.
    versions
        Versions of gapwalk, heyoka, numpy and python that computed it.
    diagram
        The branches as a tree, if the study is of the kind diagram.
    """

    study: Study
    branches: tuple[Branch, ...]
    complete: bool
    versions: Mapping[str, str]
    diagram: Diagram | None = None

    @property
    def title(self) -> str:
        """Title of the study; may be empty."""
        return self.study.title

    @property
    def system(self) -> System:
        """The system at the beginning of the study."""
        return self.study.system

    @property
    def options(self) -> StudyOptions:
        """What was asked of it."""
        return self.study.options

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the branches, such as ``P2-3``."""
        if self.diagram is not None:
            return tuple(limb.name for limb in self.diagram.limbs)
        return tuple(f"P{branch.period}-{number}" for number, branch in enumerate(self.branches, start=1))

    def __repr__(self) -> str:
        state = "complete" if self.complete else "incomplete"
        parts = self.branches if self.diagram is None else [self.diagram]
        return f"Result({self.title!r}, {state}, {', '.join(map(repr, parts))})"
