"""The study of tori: the branches over a range, and the families of tori that begin at their Neimark-Sacker points.

With a second excitation of its own frequency, every motion is a torus: then it is the family of this motion.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field

from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.walk import WalkOptions
from gapwalk.errors import GapwalkError, ModelError, NumericalError
from gapwalk.model.bounds import Counted
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers, do_by_groups
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.diagram_study import STATE, DiagramOptions, DiagramStudyOptions, DiagramWork, empty_diagram
from gapwalk.studies.options import BranchOptions, ParameterRange, is_another
from gapwalk.studies.study_kind import INLINE, AnswerFinding, Found, Work, found_by
from gapwalk.summary import row_of
from gapwalk.tori.second_tone import Tone, two_tones
from gapwalk.tori.tongue import LockedWindow, Tongue, follow_tongue
from gapwalk.tori.torus_equation import TorusOptions, refuse_without_tori
from gapwalk.tori.torus_family import TorusDiagram, TorusFamily
from gapwalk.tori.torus_tracer import follow_tori

Tongues = Annotated[
    ParameterRange,
    Field(description='write the second parameter, as in tongues = { parameter = "mean.q1", from = 0.1, to = 0.5 }'),
    AfterValidator(is_another),
]


@dataclass(frozen=True)
class ToriStudy(BranchOptions):
    """Tori over a range of one parameter: the branches, and the families that begin at their Neimark-Sacker points.

    With a `tone` there are no branches: it is the family of the motion under both excitations, from the first value of
    the range to the second.
    """

    kind: ClassVar[str] = "tori"
    reports: ClassVar[str] = "branches and families"

    max_period: Counted = 2  #: Longest period, in forcing periods, of branches to switch to.
    max_branches: Counted = 200  #: Number of branches after which it stops.
    #: Accuracy of the tori. In a table, its keys are among the others.
    tori: Annotated[TorusOptions, INLINE] = field(default_factory=TorusOptions)
    tone: Tone | None = None  #: A second excitation, whose frequency is no multiple of the first one.
    #: A second parameter and its range, in which both ends of each window in which motions lock are followed.
    tongues: Tongues | None = None
    #: Number of processes; by default one for each local core.
    workers: Counted | None = field(default=None, compare=False)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        if self.tone is not None:
            return f"tori over {self.range_words}, with a second tone of the frequency {self.tone.frequency:g}"
        tongues = "" if self.tongues is None else f"; tongues in {self.tongues.words}"
        return f"tori over {self.range_words}, on branches of period {self.period} to {self.max_period}{tongues}"

    def work(self, system: System) -> ToriWork | TwoToneWork:
        """Return the work on the branches and the families, or on the family of the motion under both excitations."""
        refuse_without_tori(system)
        if self.tongues is not None:
            self._check_tongues(system, self.tongues)
        if self.tone is None:
            return ToriWork(system, self)
        return TwoToneWork(system, self, self.tone)

    def _check_tongues(self, system: System, second: ParameterRange) -> None:
        if self.tone is not None:
            raise ModelError("nothing locks to a second tone, so there are no tongues; leave out tone or tongues")
        low, high = second.ends
        value = system[second.parameter]
        if not low <= value <= high:
            raise ModelError(
                f"tongues are followed in {second.parameter} from {low:g} to {high:g}, and the model has "
                f"{value:g}, outside of it; write a range that contains it"
            )

    def document(self, found: TorusDiagram, points: bool) -> dict[str, Any]:
        """Return the families with their events and ends as JSON values; with all tori if wanted."""
        document: dict[str, Any] = {"families": [self._family(family, points) for family in found.families]}
        return document | ({"tongues": [_tongue(each) for each in found.tongues]} if found.tongues else {})

    def _family(self, family: TorusFamily, points: bool) -> dict[str, Any]:
        document: dict[str, Any] = {
            "parameter": family.parameter,
            "curves": family.curves,
            "events": [plain(row_of(each)) for each in family.events],
            "ends": [
                {"reason": end.reason.name.lower(), "value": end.value, "rotation": end.rotation, "detail": end.detail}
                for end in family.ends
            ],
        }
        if points:
            document["tori"] = [
                {
                    "value": point.value,
                    "rotation": point.torus.rotation,
                    "exponents": plain(point.torus.exponents),
                    "error": point.torus.error,
                    "curve": point.torus.states.tolist(),
                }
                for point in family.points
            ]
        return document


FAMILY = Part("family of tori", TorusFamily, numbered=True)
TORI = Part("tori", tuple[tuple[str, ...], int])
"""Failures, and the number of Neimark-Sacker points that are done."""
TONGUE = Part("tongue", tuple[int, Tongue | None, str], numbered=True)
"""Number of a window, its tongue, and the reason if there is none."""


def _tongue(found: Tongue) -> dict[str, Any]:
    tip = found.tip
    sides = {
        name: {
            "points": side.values.tolist(),
            "ends": [{"reason": end.reason.name.lower(), "values": list(end.values)} for end in side.ends],
        }
        for name, side in zip(("lower", "upper"), found.sides, strict=True)
    }
    place = None if tip is None else {"kind": tip.kind.value, "values": tip.values, "uncertainty": tip.uncertainty}
    return {"ratio": str(found.ratio), "period": found.period, "tip": place, **sides}


class ToriWork(Work):
    """The work on tori: the branches of a diagram, then the families that begin on them."""

    def __init__(self, system: System, asked: ToriStudy) -> None:
        self.asked = asked
        fields = {name: getattr(asked, name) for name in ("parameter", "begin", "end", "measure", "period", "start")}
        options = DiagramOptions(max_period=max(asked.max_period, asked.period), max_branches=asked.max_branches)
        request = DiagramStudyOptions(
            **fields,
            walk=asked.walk,
            method=asked.method,
            max_period=options.max_period,
            max_branches=options.max_branches,
        )
        self._branches: DiagramWork = request.work(system)
        self._families: list[TorusFamily] = []
        self._failures: tuple[str, ...] = ()
        self._tried = 0
        self._tongues: list[tuple[int, Tongue | None, str]] = []

    def take(self, known: Parts) -> None:
        """Read the branches and families of a file; raise a ValueError if they belong to another study."""
        if known.get(STATE) is not None:
            self._branches.take(known)
        self._families = [family for _, family in known.all(FAMILY)]
        self._failures, self._tried = known.get(TORI) or ((), 0)
        self._tongues = [tongue for _, tongue in known.all(TONGUE)]
        if [number for number, _, _ in self._tongues] != [*range(len(self._tongues))]:
            raise ValueError("the tongues do not belong to the study")

    def parts(self, workers: Workers) -> Generator[Found]:
        """Find the branches that are not known, then follow the families that are left."""
        if not self._branches.complete:
            for found in self._branches.parts(workers):
                yield Found(found.entries)
        starts = self.record.starts
        left = starts[self._tried :]
        first = self._tried

        def is_new(index: int) -> bool:
            return not self.record.holds(left[index])

        low, high = self.asked.ends
        follow_one = partial(_follow, self.asked.parameter, (low, high), self.asked.tori)
        periods = [special.orbit.period for special in left]
        for index, family in do_by_groups(follow_one, left, periods, is_new, workers):
            self._tried = first + index + 1
            if isinstance(family, str):
                self._failures = (*self._failures, family)
                continue
            self._families.append(family)
            yield Found((FAMILY.entry(family, len(self._families) - 1), self._state()))
        self._tried = len(starts)
        yield from self._follow_tongues(workers)

    def _follow_tongues(self, workers: Workers) -> Iterator[Found]:
        second = self.asked.tongues
        if second is None:
            return
        windows, first = self.record.windows, len(self._tongues)
        ranges = (self.asked.ends, second.ends)
        follow_one = partial(_follow_tongue, self.asked.parameter, second.parameter, ranges)
        for index, tongue in workers.each(follow_one, windows[first:], lambda _: True):
            number = first + index
            self._tongues.append((number, None, tongue) if isinstance(tongue, str) else (number, tongue, ""))
            yield Found.part(TONGUE, self._tongues[-1], number)

    def last(self, *, finished: bool) -> Iterable[Entry]:
        """Return the branches, families and failures."""
        return self._all(finished)

    def _all(self, finished: bool) -> Iterator[Entry]:
        yield from self._branches.last(finished=self._branches.complete)
        yield from (FAMILY.entry(family, number) for number, family in enumerate(self._families))
        yield self._state()
        yield from (TONGUE.entry(tongue, tongue[0]) for tongue in self._tongues)

    def _state(self) -> Entry:
        return TORI.entry((self._failures, self._tried))

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self._branches.complete and self.record.complete

    @property
    def done(self) -> int:
        """Number of branches, families and tongues."""
        return self._branches.done + len(self._families) + len(self._tongues)

    @property
    def total(self) -> int:
        """Number of branches, families and tongues, as far as it is known."""
        return self.done + max(0, len(self.record.starts) - self._tried) + self.record.unfollowed

    @property
    def record(self) -> TorusDiagram:
        """The tori so far."""
        tongues = tuple(tongue for _, tongue, _ in self._tongues if tongue is not None)
        reasons = tuple(reason for _, _, reason in self._tongues if reason)
        failures = (*self._failures, *reasons, *(each for tongue in tongues for each in tongue.failures))
        found = TorusDiagram(self._branches.record, tuple(self._families), failures, self._tried, tongues)
        if self.asked.tongues is None:
            return found
        return replace(found, unfollowed=len(found.windows) - len(self._tongues))

    def finding(self) -> AnswerFinding:
        """Return the tori so far as the finding of a study."""
        return AnswerFinding(self.asked, self.record, self.done, self.total)


class TwoToneWork(Work):
    """The work on the motion under two excitations: its torus at the first value, followed to the second."""

    def __init__(self, system: System, asked: ToriStudy, tone: Tone) -> None:
        tone.onto(system)  # refuses a tone that does not fit
        self._system, self.asked, self._tone = system, asked, tone
        self._families: tuple[TorusFamily, ...] = ()

    def take(self, known: Parts) -> None:
        """Read the family of a file."""
        self._families = tuple(family for _, family in known.all(FAMILY))

    def parts(self, workers: Workers) -> Generator[Found]:
        """Find the torus at the first value, and follow it."""
        if self.complete:
            return
        asked = self.asked
        first = two_tones(self._system.at({asked.parameter: asked.begin}), self._tone, options=asked.tori)
        walk = None if asked.walk == WalkOptions() else asked.walk  # those of tori have a default of their own
        self._families = (found_by(follow_tori, first, asked.parameter, asked.end, walk=walk, options=asked.tori),)
        yield Found((FAMILY.entry(self._families[0], 0), TORI.entry(((), 0))))

    def last(self, *, finished: bool) -> Iterable[Entry]:
        """Return the family."""
        yield from (FAMILY.entry(family, number) for number, family in enumerate(self._families))
        yield TORI.entry(((), 0))

    @property
    def complete(self) -> bool:
        """True if the family is known."""
        return bool(self._families)

    @property
    def done(self) -> int:
        """Number of families."""
        return len(self._families)

    @property
    def total(self) -> int:
        """One family."""
        return 1

    @property
    def record(self) -> TorusDiagram:
        """The family, without branches."""
        return TorusDiagram(
            replace(empty_diagram(self.asked.parameter, self.asked.ends), complete=self.complete), self._families
        )

    def finding(self) -> AnswerFinding:
        """Return the family as the finding of a study."""
        return AnswerFinding(self.asked, self.record, self.done, self.total)


def _follow(
    parameter: str, within: tuple[float, float], options: TorusOptions, special: SpecialPoint
) -> TorusFamily | str:
    """Follow the family that begins at a Neimark-Sacker point; return the reason, as a sentence, if there is none."""
    try:
        return found_by(follow_tori, special, parameter, within, options=options)
    except NumericalError as error:
        return str(error)


def _follow_tongue(
    first: str, second: str, ranges: tuple[tuple[float, float], tuple[float, float]], window: LockedWindow
) -> Tongue | str:
    """Follow the tongue of a window; return the reason, as a sentence, if there is none."""
    try:
        return found_by(follow_tongue, window, first, second, ranges)
    except GapwalkError as error:
        return f"the tongue of {window.ratio}: {error}"
