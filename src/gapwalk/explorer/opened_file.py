"""Files and results on the page, as the server keeps them: the opened file, and the results computed from it."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gapwalk.answers.band_picture import Stretches
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.attractors.settle import Settled
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus, LocusEnd
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.continuation.walk import End
from gapwalk.errors import GapwalkError, ModelError, StoreError
from gapwalk.explorer.answer_view import AnswerView
from gapwalk.explorer.diagram_lines import Line, line_of
from gapwalk.explorer.page_requests import Action, Place, read_action
from gapwalk.explorer.progress_stream import Progress
from gapwalk.explorer.workspace_folder import (
    COLOURS,
    RESULT,
    Look,
    Workspace,
    forget,
    mark_of,
    read_look,
    read_record,
    read_records,
    verdict,
    write_record,
)
from gapwalk.model.model_file import file_paths
from gapwalk.model.model_source import read_source
from gapwalk.model.words import value_words
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.result_file import tidy
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.result import Result, load_result
from gapwalk.studies.settle_study import SettleFinding
from gapwalk.studies.study_file import Study, check_studies

_GROWS, _SPARED = 1.0, 10.0  # seconds between two readings of what grows; and how many times those that one takes
_NOWHERE = (0.0, 0.0)  # range of an unfinished branch, from which no other can start yet


class State(StrEnum):
    """State of a job."""

    QUEUED = "queued"
    RUNNING = "running"
    PAUSED = "paused"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"

    @property
    def is_over(self) -> bool:
        """True if the job has ended."""
        return self in (State.DONE, State.STOPPED, State.FAILED)


@dataclass
class Entry:
    """A result, while it is computed and afterwards."""

    key: str  #: Its name in requests: the name of its file without the ending; empty for the file that was opened.
    title: str  #: Its title on the page.
    path: Path  #: The result file.
    action: Action | None = None  #: The request; None for a result that was opened.
    #: state, message: State of its job, and a remark.
    state: State = State.DONE
    message: str = ""
    result: Result | None = None  #: Content of the file after the end of the job; of an answer, also before it.
    reading: int = 0  #: How often the file has been read.
    live: Progress = field(default_factory=Progress)  #: Progress reported so far.
    #: While an answer grows: number of its parts that are read, and the time of the next reading.
    grown: tuple[int, float] = (0, 0.0)
    version: int = 0  #: Counter of changes.
    model: str = ""  #: The mark of the model file that it was computed from; see `gapwalk.explorer.workspace_folder`.
    look: Look = Look()  #: What a user has chosen for it: a name, a colour, and whether it is shown.
    _viewed: tuple[Result | None, AnswerView | None] = (None, None)
    _answer_lines: list[Line] = field(default_factory=list)

    @property
    def can_resume(self) -> bool:
        """True if the job was stopped before its end, so that it can be resumed."""
        begun = self.action is not None and self.state is State.STOPPED
        return begun and (self.result is None or not self.result.complete)

    def change(self, **values: Any) -> None:
        """Set some of its attributes, and count the change."""
        for name, value in values.items():
            setattr(self, name, value)
        self.version += 1

    def lines(self) -> list[Line]:
        """Return its branches, then its loci, as the page shows them; while it is computed, as they were found."""
        result = self.result
        if result is None:
            return [*(line_of(*each, _NOWHERE) for each in self.live.finished), *_growing(self.live)]
        if self.answer is not None:
            return self._answer_lines
        if result.finding is not None or not isinstance(result.options, BranchOptions):
            return []
        first, last = sorted((result.walked.begin, result.walked.end))
        loci = zip(result.map.names, result.map.loci, strict=True) if result.map is not None else ()
        return [line_of(*each, (first, last)) for each in (*result.named, *loci)]

    @property
    def saves(self) -> list[str]:
        """Formats in which it can be saved after its end; a search that has found nothing has no table."""
        if not self.state.is_over or self.state is State.FAILED:
            return []
        settled, finding = self.settled(), self.result.finding if self.result else None
        has_orbit = bool(self.lines()) or (settled is not None and settled.orbit is not None)
        has_table = has_orbit or (finding is not None and finding.record is not None)
        has_bands = self.result is not None and any(branch.bands for branch in self.result.branches)
        there = {
            "table": has_table,
            "bands": has_bands,
            "script": True,
            "model": has_orbit,
            "result": self.result is not None,
        }
        return [word for word, is_there in there.items() if is_there]

    @property
    def answer(self) -> AnswerView | None:
        """Content of an answer; None for branches, and for a settled motion, which has panels of its own."""
        result, (known, view) = self.result, self._viewed
        bands = result is not None and any(branch.bands for branch in result.branches)
        if result is None or (result.finding is None and not bands) or self.settled() is not None:
            return None
        if known is not result:
            view = AnswerView(result.finding or Stretches(result.branches, shown_measure(result.system, result.walked)))
            self._viewed = result, view
            self._answer_lines = answer_lines(view)
        return view

    @property
    def verdict(self) -> str:
        """What a settled motion is, in a few words; empty for other results."""
        finding = None if self.result is None else self.result.finding
        return verdict(finding.settled, finding) if isinstance(finding, SettleFinding) else ""

    def settled(self) -> Settled | None:
        """Return the settled motion, if the request was for one."""
        record = None if self.result is None or self.result.finding is None else self.result.finding.record
        return record if isinstance(record, Settled) else None


def answer_lines(view: AnswerView) -> list[Line]:
    """Return the curves of an answer as lines of the page."""
    curves = view.picture.curves
    return [line_of(each.name, each.curve, _reach(each.curve))._replace(is_earlier=each.is_earlier) for each in curves]


def _reach(curve: Branch | Locus) -> tuple[float, float]:
    values = curve.values if isinstance(curve, Branch) else curve.values[:, 0]
    return float(values.min()), float(values.max())


def _growing(live: Progress) -> Iterator[Line]:
    """Yield the branch or locus in progress: a line for each of its directions from the start."""
    lengths = [point.arclength for point, _ in live.steps]
    turns = [i for i in range(1, len(lengths)) if lengths[i] < lengths[i - 1]]
    for start, stop in pairwise([0, *turns, len(lengths)]):
        steps = live.steps[start:stop]
        if steps:
            points, special = [point for point, _ in steps], [each for _, found in steps for each in found]
            period = points[0].orbit.period
            name = f"P{period}-1" if live.kind is None else f"{live.kind.value}-1"
            yield Line(name, "", _NOWHERE, period, points, special, live.kind, live.second)


class Exploration:
    """A model file or a result, and the results computed from it."""

    def __init__(self, workspace: Workspace, name: str) -> None:
        self.workspace, self.file = workspace, workspace.path(name)
        self.name = workspace.name(self.file)
        self.guard = threading.RLock()
        self.entries: dict[str, Entry] = {}
        self.studies: tuple[Study, ...] = ()
        self.problem = ""
        self._stamps = {os.fspath(self.file): ""}  # of the file and of matrices beside it, when they were read
        self._read_file()
        self._read_exploration()
        if self.described() is None:
            raise ModelError(self.problem)

    def refresh(self) -> None:
        """Read the file again if it has changed; results stay, and its errors become the `problem`."""
        if self.stamp() != " ".join(self._stamps.values()):
            self._read_file()

    def stamp(self) -> str:
        """Return times and sizes of the file and of its matrix files, to notice changes."""
        return " ".join(map(_stamp, self._stamps))

    @property
    def model(self) -> str:
        """Mark of the model in the file, or of the last valid one; empty if there was none."""
        return mark_of(self.studies[0]) if self.studies else ""

    def described(self) -> Study | None:
        """Return a study of the file; while the file has errors, that of the last result."""
        with self.guard:
            known = [entry.result.study for entry in self.entries.values() if entry.result is not None]
        return next(iter((*self.studies, *reversed(known))), None)

    def is_idle(self) -> bool:
        """Return True if none of its jobs is waiting or running."""
        with self.guard:
            return all(entry.state.is_over for entry in self.entries.values())

    def base(self) -> Study:
        """Return the first study of the file; raise a ModelError while the file has errors."""
        if self.problem:
            raise ModelError(self.problem)
        return self.studies[0]

    def study(self, name: str, values: Mapping[str, float]) -> Study:
        """Return a study of the file with changed values; raise a ModelError if it has no study of that name."""
        if self.file.suffix == RESULT:
            study = self.base()
            return replace(study, system=study.system.at(dict(values)))
        source = read_source(self.file, str(self.workspace.root))
        studies = {study.name: study for study in check_studies(source, dict(values))}
        if name not in studies:
            known = ", ".join(known for known in studies if known)
            raise ModelError(f"{self.name} has no study {name!r}; it has {known or 'one without a name'}")
        return studies[name]

    def entry(self, key: str) -> Entry:
        """Return a result by its key; raise a ModelError if there is none."""
        with self.guard:
            if key not in self.entries:
                raise ModelError(f"there is no result {key[:100]!r} on this page; reload the page")
            return self.entries[key]

    def motion(self, place: Place) -> Orbit | Settled:
        """Return the orbit at a place, or the settled motion; raise a ModelError if there is no such place."""
        with self.guard:
            entry = self.entry(place.result)
            if (settled := entry.settled()) is not None:
                return settled
            for line in entry.lines()[place.branch : place.branch + 1]:
                for number, places in ((place.point, line.points), (place.special, line.special_points)):
                    if number is not None and number < len(places):
                        return places[number].orbit
        raise ModelError(f"the chosen point is not in {entry.title} any more; reload the page")

    def special(self, place: Place) -> tuple[Line, SpecialPoint]:
        """Return the special point at a place, and its branch; raise a ModelError if there is none."""
        with self.guard:
            entry = self.entry(place.result)
            for line in entry.lines()[place.branch : place.branch + 1]:
                if place.special is not None and line.kind is not None:
                    raise ModelError("choose a special point of a branch; this is a point of a locus")
                if place.special is not None and place.special < len(line.special_points):
                    special = line.special_points[place.special]
                    assert isinstance(special, SpecialPoint)  # it is no locus
                    return line, special
        raise ModelError(f"the chosen special point is not in {entry.title} any more; reload the page")

    def origin(self, place: Place) -> Study:
        """Return the study of the result at a place, which may differ from the file after an edit."""
        result = self.entry(place.result).result
        return self.base() if result is None else result.study

    def branches(self, key: str) -> tuple[Branch, ...]:
        """Return the branches of a result, none while it is computed; raise a ModelError if there is no such result."""
        with self.guard:
            entry = self.entry(key)
            if entry.answer is not None:
                return tuple(curve for _, curve in entry.answer.curves() if isinstance(curve, Branch))
            return () if entry.result is None else entry.result.branches

    def read(self, entry: Entry) -> None:
        """Read the result file of an entry after its end, if there is one; errors become its message."""
        if not entry.path.exists():
            return
        try:
            result = load_result(entry.path)
        except GapwalkError as error:
            with self.guard:
                entry.change(message=entry.message or str(error))
            return
        with self.guard:
            entry.change(result=result, reading=entry.reading + 1)
            entry.message = entry.message or "; ".join(result.failures) or _ends(entry)

    def read_growing(self) -> None:
        """Read what is stored of an answer that is being computed, if there is more of it; from time to time only."""
        begun = time.monotonic()
        with self.guard:
            due = (each for each in self.entries.values() if each.state is State.RUNNING and begun >= each.grown[1])
            entry = next((each for each in due if each.live.done > each.grown[0] and not each.live.is_drawn), None)
            if entry is None:
                return
            done, reading = entry.live.done, entry.reading
            entry.grown = done, math.inf  # another page may ask meanwhile
        result = None
        with suppress(GapwalkError):  # it is read again after its end, which tells of it
            result = load_result(entry.path)
        with self.guard:
            finding = None if result is None else result.finding
            if entry.reading == reading and finding is not None and finding.can_be_drawn:
                entry.change(result=result, reading=reading + 1)
                entry.lines()
            entry.grown = done, begun + max(_GROWS, _SPARED * (time.monotonic() - begun))

    def refuse_unfinished(self, action: Action) -> None:
        """Raise a ModelError if an action starts from an unfinished result, whose points may be renumbered."""
        if not all(self.entry(key).state.is_over for key in _starts(action)):
            raise ModelError("this result is still being computed; wait for its end or stop it, then try again")

    def _read_file(self) -> None:
        """Read the studies of the file, or its errors; after an error the last valid studies stay."""
        self._stamps = {path: _stamp(path) for path in self._stamps}
        try:
            self.studies, self.problem = self._open(), ""
        except ModelError as error:
            self.problem = str(error).replace(f"{self.file.parent}{os.sep}", "")

    def _open(self) -> tuple[Study, ...]:
        if self.file.suffix == RESULT:
            result = load_result(self.file)
            entry = Entry("", self.file.name, self.file, result=result, model=mark_of(result.study))
            entry.message = _ends(entry)
            with self.guard:
                self.entries[""] = entry
            return (result.study,)
        source = read_source(self.file, str(self.workspace.root))
        files = {path: _stamp(path) for path in file_paths(source)}
        self._stamps = {os.fspath(self.file): self._stamps[os.fspath(self.file)], **files}
        return check_studies(source)

    def _read_exploration(self) -> None:
        folder = self.workspace.exploration(self.file)
        for path, record in read_records(folder, self.workspace).items():
            try:
                action = read_action(record.get("action"))
            except ModelError:
                continue
            if path.exists():
                entry = Entry(path.stem, str(record.get("title", path.stem))[:200], path, action)
                entry.look = read_look(record.get("look"))
                self.entries[entry.key] = entry
                self.read(entry)
                if entry.result is None:
                    continue
                entry.model = mark_of(entry.result.study)
                if not entry.result.complete:
                    entry.state = State.STOPPED
                else:  # it will not be resumed, so this is the time to tidy up after a kill
                    with suppress(StoreError):
                        tidy(path)


def _stamp(path: str) -> str:
    """Return time and size of a file, to notice changes; zeros if there is no file."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # a ValueError for a NUL in the name
        return "0-0"
    return f"{found.st_mtime_ns}-{found.st_size}"


def _end_words(end: End | LocusEnd, values: Mapping[str, float], study: Study) -> str:
    """Return the reason and the place of an end, with units."""
    at = (value_words(value, name, study.system.units) for name, value in values.items())
    return f"{end.reason_words}, at {', '.join(at)}"


def _ends(entry: Entry) -> str:
    """Return the ends of the only branch or locus of a result, or the coverage of a search."""
    result = entry.result
    if result is None:
        return ""
    if result.diagram is not None and result.diagram.search is not None:
        count = len(result.branches)
        found = f"{count} new {'branch' if count == 1 else 'branches'}." if count else "Nothing new was found."
        return " ".join([found, *result.diagram.notes[:2]])
    if result.map is not None and len(result.map.loci) == 1:
        locus = result.map.loci[0]
        places = ((end, dict(zip((locus.first, locus.second), end.values, strict=True))) for end in locus.ends)
        return "; ".join(dict.fromkeys(_end_words(*each, result.study) for each in places))
    if len(result.branches) == 1:
        end = result.branches[0].ends[-1]
        return _end_words(end, {result.branches[0].parameter: end.value}, result.study)
    if entry.answer is not None:
        return "; ".join(entry.answer.sentences())
    settled = entry.settled()
    return "; ".join(settled.evidence[:2]) if settled is not None else ""


def change_look(exploration: Exploration, key: str, changes: dict[str, Any]) -> dict[str, Any]:
    """Change the name, the colour, how a result is drawn, or delete and restore it; return what undoes the change."""
    entry = exploration.entry(key)
    if changes.get("deleted") and not entry.state.is_over:
        raise ModelError(f"{entry.title} is {entry.state}; stop it first, then delete it")
    if entry.action is None and {"name", "deleted"} & changes.keys():
        raise ModelError("this is the file that was opened; rename or delete the file itself")
    try:
        look = Look.model_validate({**entry.look.model_dump(), **changes})
    except ValidationError as error:
        wrong = "; ".join(f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors()[:3])
        allowed = f"name (a text), drawn (full, pale, hidden), colour ({', '.join(COLOURS)} or empty), deleted"
        raise ModelError(f"a result cannot be changed in this way: {wrong}. What can be changed: {allowed}") from None
    look = look.model_copy(update={"name": " ".join(look.name.split())})
    before = {name: getattr(entry.look, name) for name in changes}
    if entry.action is not None:
        write_record(entry.path, {**read_record(entry.path), "look": look.model_dump(exclude_defaults=True)})
    with exploration.guard:
        entry.look = look
    return before


def remove_deleted(exploration: Exploration) -> int:
    """Remove the files of deleted results from which no other starts; return how many were removed."""
    count = 0
    while True:
        with exploration.guard:
            needed = {key for entry in exploration.entries.values() for key in _starts(entry.action)}
            gone = [entry for key, entry in exploration.entries.items() if entry.look.deleted and key not in needed]
        if not gone:
            return count
        for entry in gone:
            forget(entry.path)
            with exploration.guard:
                del exploration.entries[entry.key]
            count += 1


def _starts(action: Action | None) -> list[str]:
    """Return the keys of the results from which one starts: its script and its resumption need them."""
    start = getattr(action, "start", None)
    return [*([] if start is None else [start.result]), *getattr(action, "known", [])]


def listed(exploration: Exploration) -> list[dict[str, Any]]:
    """Return the results of an exploration for the page, with their progress; deleted ones are left out."""
    exploration.read_growing()
    with exploration.guard:
        return [_plain(entry) for entry in exploration.entries.values() if not entry.look.deleted]


def deleted(exploration: Exploration) -> list[dict[str, str]]:
    """Return keys and titles of the deleted results."""
    with exploration.guard:
        entries = [entry for entry in exploration.entries.values() if entry.look.deleted]
        return [{"key": entry.key, "title": entry.look.name or entry.title} for entry in entries]


def _plain(entry: Entry) -> dict[str, Any]:
    return {
        "key": entry.key,
        "title": entry.look.name or entry.title,
        "automatic": entry.title,
        "verdict": entry.verdict,
        "drawn": entry.look.drawn,
        "colour": entry.look.colour,
        "state": entry.state.value,
        "message": entry.message,
        "version": entry.version,
        "model": entry.model,
        "kind": entry.action.do if entry.action else "opened",
        "settled": entry.settled() is not None,
        "answer": None if entry.answer is None else {"axes": entry.answer.axes, "reading": entry.reading},
        "can_resume": entry.can_resume,
        "saves": entry.saves,
        "done": [entry.live.done, entry.live.total],
        "share": entry.live.share,
        "doing": entry.live.words,
        "branches": [
            {
                "name": line.name,
                "period": line.period,
                "points": len(line.points),
                "range": line.within,
                "parameter": line.parameter,
                "kind": line.kind,
                "second": line.second,
                "earlier": line.is_earlier,
            }
            for line in entry.lines()
        ],
    }
