"""The result of a study, as it comes from a run or from a result file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.continuation.walk import EndReason
from gapwalk.model.system import System
from gapwalk.model.words import full_measure, parameter_symbol, signal_words
from gapwalk.notebook import Shown
from gapwalk.studies.kind import Finding, StudyKind
from gapwalk.studies.map import Map
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.study_file import Study
from gapwalk.summary import Summary, Table, remarks
from gapwalk.verification import Verification


@dataclass(frozen=True)
class FullCheck:
    """How far a branch is from that of the full system.

    Attributes
    ----------
    branch
        Its name.
    errors
        Estimated error of the parameter value of each special point, in their order; inf where none was found near by
        in the full system.
    motion
        Largest estimated error of a motion, relative to its size.
    harmonics
        Harmonics with which it was checked; 0 if that failed.
    detail
        Why it failed.
    """

    branch: str
    errors: tuple[float, ...]
    motion: float
    harmonics: int
    detail: str = ""

    @property
    def words(self) -> str:
        """The same in words."""
        if self.detail:
            return f"{self.branch} could not be set against the full system: {self.detail}"
        known = [error for error in self.errors if math.isfinite(error)]
        texts = ["it has no special points"]
        if self.errors:
            within = f", and differ by {max(known):.1e} at most" if known else ""
            texts = [f"{len(known)} of its {len(self.errors)} special points are there{within}"]
        texts.append(
            f"motions differ by {self.motion:.1e} of their size at most"
            if math.isfinite(self.motion)
            else "some of its motions are not there: the reduced system has too few modes for them"
        )
        return f"{self.branch} set against the full system, by {self.harmonics} harmonics: {'; '.join(texts)}"


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
    def options(self) -> StudyKind:
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

    def summary(self, points: bool = True) -> Summary:
        """Return the result as the terminal shows it: lines of text, tables, and the tree of a diagram.

        Parameters
        ----------
        points
            Whether to include the special points of a diagram or a map.
        """
        if self.study.reduced is not None:
            yield self.study.reduced.words
        yield from (check.words for check in self.checks)
        if self.verification is not None:
            yield self.verification.words
        if self.finding is not None:
            if not self.finding.complete:
                yield self.finding.stored
            if self.finding.record is not None:
                yield from self.finding.summary()
            yield from remarks(self.finding.notes, self.finding.failures)
            return
        curves = (*self.branches, *(self.map.loci if self.map else ()))
        if words := self.walked.method.words([point.orbit for curve in curves for point in curve.points]):
            yield words
        if self.map is not None:
            yield from self._missed()
            yield from self.map.summary(self.walked.measure if points else None)
            return
        yield from (self.branches[0] if self.diagram is None else self.diagram).summary()
        if self.diagram is None or points:
            yield from self._missed()
            any_special = any(branch.special_points for branch in self.branches)
            yield self.special_points() if any_special else "no special points"

    def _missed(self) -> Iterator[str]:
        """Return the steps of branches in which a special point was missed, in sentences."""
        for name, branch in zip(self.names, self.branches, strict=True):
            symbol = parameter_symbol(branch.parameter, branch.system.units)
            yield from (f"not explained: {name}, {symbol} {each}" for each in branch.unexplained)

    def special_points(self) -> Table:
        """Return the table of the special points of all branches, rounded for reading."""
        coordinates, units, diagram = self.system.coordinates, self.system.units, self.diagram
        named = full_measure(self.walked.measure, coordinates).partition(".")[2]
        coordinate = named if named in coordinates else coordinates[0]
        numbers = (parameter_symbol(self.walked.parameter, units), "±", signal_words(f"half {coordinate}", units))
        headings = ["kind", *(f">{each}" for each in (*numbers, "multiplier"))]
        headings += ["unstable" if diagram else "stability", "criticality or contact"]
        rows, groups = [], []
        for name, branch in zip(self.names, self.branches, strict=True):
            for index, special in enumerate(branch.special_points):
                counts = dict.fromkeys(str(side.total) for side in (special.before, special.after))
                row = [
                    special.kind.value,
                    f"{special.value:#.10g}",
                    f"{special.uncertainty:.0e}" if math.isfinite(special.uncertainty) else "",
                    f"{special.point.measure(f'half.{coordinate}'):#.8g}",
                    special.multiplier_words,
                    " → ".join(counts) if diagram else special.change,  # the table of a diagram is wide enough as it is
                    special.nature_words.removesuffix(" values") or special.contact,
                ]
                if diagram:
                    leads_to = " ".join(member.name for member in diagram.attached(name, index))
                    row = [name if index == 0 else "", *row, leads_to]
                rows.append(row)
            groups.append(len(rows) - 1)
        return Table(["branch", *headings, "leads to"] if diagram else headings, rows, groups)

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
