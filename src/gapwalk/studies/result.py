"""The result of a study, as it comes from a run or from a result file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.continuation.walk import EndReason
from gapwalk.model.system import System
from gapwalk.notebook.shown import Shown
from gapwalk.studies.file import Study
from gapwalk.studies.finding import Finding
from gapwalk.studies.map.chart import Map
from gapwalk.studies.options import BranchOptions, StudyOptions
from gapwalk.studies.reduced.full_check import FullCheck
from gapwalk.verification import Verification


@dataclass(frozen=True, eq=False)
class Result(Shown):
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
    map
        The loci, if the study is of the kind map; the branches are those of its sections.
    finding
        What was found, if the study is of the kind family, settle, sweep, basins or regimes; its `record` is what the
        Python function of that name returns. Of a settled motion it is a `SettleFinding`, with the attractor too. There
        are no `branches` then: those of a family belong to its members.
    checks
        What the full system says of each branch, if the system is a reduced one (see `Study.reduced`).
    verification
        What a check by other means has found, if the study asks for one.
    """

    study: Study
    branches: tuple[Branch, ...]
    complete: bool
    versions: Mapping[str, str]
    diagram: Diagram | None = None
    map: Map | None = None
    finding: Finding | None = None
    checks: tuple[FullCheck, ...] = ()
    verification: Verification | None = None

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
    def walked(self) -> BranchOptions:
        """What was asked of a study of branches."""
        return self.study.walked

    @property
    def failures(self) -> tuple[str, ...]:
        """What could not be walked or explained, in sentences.

        Whole branches and loci, ends at which the numerics gave up, and steps in which something was missed.
        """
        if self.finding is not None:
            return self.finding.failures
        tree = self.diagram is not None or self.map is not None
        found = [
            f"{name}: {end}" if tree else str(end)
            for name, branch in zip(self.names, self.branches, strict=True)
            for end in branch.ends
            if end.reason.is_failure
        ]
        found += [
            f"{name}: {each}" if tree else str(each)
            for name, branch in zip(self.names, self.branches, strict=True)
            for each in branch.unexplained
        ]
        if self.map is not None:
            loci = zip(self.map.names, self.map.loci, strict=True)
            found += [f"{name}: {end}" for name, locus in loci for end in locus.ends if end.reason.is_failure]
        parts = [part for part in (self.diagram, self.map) if part is not None]
        return (*found, *(text for part in parts for text in part.failures))

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended the work; a run with `resume` goes on with it."""
        if self.finding is not None or self.diagram is not None or self.map is not None:
            return not self.complete
        return any(end.reason is EndReason.INTERRUPTED for branch in self.branches for end in branch.ends)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the branches, such as ``P2-3``; on the sections of a map, such as ``S1-P2-3``."""
        if self.map is not None:
            sections = enumerate(self.map.sections, start=1)
            return tuple(f"S{number}-{name}" for number, section in sections for name, _ in section.named)
        if self.diagram is not None:
            return tuple(member.name for member in self.diagram.members)
        return tuple(f"P{branch.period}-{number}" for number, branch in enumerate(self.branches, start=1))

    def to_dict(self, points: bool = True) -> dict[str, Any]:
        """Return the result as plain JSON values, as the commands print it with ``--json``.

        Parameters
        ----------
        points
            Whether to include each point of each branch, and not only the special points.

        Returns
        -------
        dict
            Title, parameters and versions; branches, their ends and special points; or, of a study without branches,
            what it has found. Values that do not exist are None.
        """
        from gapwalk.studies.document import result_document

        return result_document(self, points)

    def __repr__(self) -> str:
        state = "complete" if self.complete else "incomplete"
        if self.finding is not None:
            found = self.finding.stored if self.finding.record is None else repr(self.finding.record)
            return f"Result({self.title!r}, {state}, {found})"
        parts = [part for part in (self.diagram, self.map) if part is not None] or self.branches
        return f"Result({self.title!r}, {state}, {', '.join(map(repr, parts))})"
