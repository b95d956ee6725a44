"""What is on the page: the file that was opened, and the results of its exploration. It is kept on the server."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from gapwalk.attractors.settled import Settled
from gapwalk.bifurcation.branch import Branch, SpecialPoint
from gapwalk.errors import GapwalkError, ModelError, StoreError
from gapwalk.explorer.action import Action, Compute, Place, plain_action, read_action
from gapwalk.explorer.mark import mark_of
from gapwalk.explorer.news import Progress
from gapwalk.explorer.page_result import Entry, Line, State
from gapwalk.explorer.plan import plan, word_of
from gapwalk.explorer.task import Task
from gapwalk.explorer.workspace import RESULT, Workspace, read_records, write_record
from gapwalk.model.large_files import matrix_paths
from gapwalk.model.model_source import read_source
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.result_file import tidy
from gapwalk.studies.file import Study, check_studies
from gapwalk.studies.load import load_result
from gapwalk.studies.result import Result


class Exploration:
    """A model file or a result, and all that has been computed from it.

    Parameters
    ----------
    workspace
        The folder.
    name
        The file in it.

    Raises
    ------
    ModelError
        If there is no such file, or it is no model and no result.
    """

    def __init__(self, workspace: Workspace, name: str) -> None:
        self.workspace, self.name = workspace, name
        self.file = workspace.path(name)
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
        """Read the file again if it has been changed; results stay, and what is wrong becomes the `problem`."""
        if self.stamp() != " ".join(self._stamps.values()):
            self._read_file()

    def stamp(self) -> str:
        """What tells the file, and the matrices beside it, from what they were before."""
        return " ".join(map(_stamp, self._stamps))

    @property
    def model(self) -> str:
        """The mark of the model as it stands in the file, or of the last good one; empty if there was none."""
        return mark_of(self.studies[0]) if self.studies else ""

    def described(self) -> Study | None:
        """What tells the names of parameters and measures: the file; while it is wrong, what was computed from it."""
        with self.guard:
            known = [entry.result.study for entry in self.entries.values() if entry.result is not None]
        return next(iter((*self.studies, *reversed(known))), None)

    def is_idle(self) -> bool:
        """Whether nothing is being computed for it."""
        with self.guard:
            return all(entry.state.is_over for entry in self.entries.values())

    def base(self) -> Study:
        """The first study of the file that was opened; a ModelError while there is something wrong with it."""
        if self.problem:
            raise ModelError(self.problem)
        return self.studies[0]

    def study(self, name: str, values: Mapping[str, float]) -> Study:
        """A study of the file that was opened, with other values; a ModelError if there is none of that name."""
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
        """A result by its key; a ModelError if there is none."""
        with self.guard:
            if key not in self.entries:
                raise ModelError(f"there is no result {key[:100]!r} on this page; reload it")
            return self.entries[key]

    def motion(self, place: Place) -> Orbit | Settled:
        """The motion at a place; a ModelError if there is none."""
        with self.guard:
            return self.entry(place.result).motion(place)

    def special(self, place: Place) -> tuple[Line, SpecialPoint]:
        """The special point at a place, and its branch; a ModelError if there is none."""
        with self.guard:
            return self.entry(place.result).special(place)

    def origin(self, place: Place) -> Study:
        """The study of the result at a place: the file may have been edited since."""
        result = self.entry(place.result).result
        return self.base() if result is None else result.study

    def branches(self, key: str) -> tuple[Branch, ...]:
        """The branches of a result; none while it is computed. A ModelError if there is no such result."""
        with self.guard:
            result = self.entry(key).result
            return () if result is None else result.branches

    def prepare(self, action: Action) -> tuple[Entry, Task]:
        """A new entry for an action, and the task that fills it; its result file has a name of its own.

        Raises
        ------
        ModelError
            If the action makes no sense, or nothing can be written.
        """
        self._refuse_unfinished(action)
        title, task = plan(action, self)
        output = self.workspace.claim(self.file, word_of(action))
        write_record(output, {"title": title, "action": plain_action(action), "model": mark_of(task.study)})
        entry = Entry(output.stem, title, output, action, State.QUEUED, model=mark_of(task.study))
        with self.guard:
            self.entries[entry.key] = entry
        return entry, replace(task, output=output)

    def read(self, entry: Entry) -> None:
        """Read the result of an entry that is over, if there is one; what is wrong with it becomes its message."""
        if not entry.path.exists():
            return
        try:
            result = load_result(entry.path)
        except GapwalkError as error:
            with self.guard:
                entry.message = entry.message or str(error)
                entry.version += 1
            return
        with self.guard:
            entry.result = result
            entry.message = entry.message or "; ".join(result.failures) or _ends(entry)
            entry.version += 1

    def _refuse_unfinished(self, action: Action) -> None:
        """Points of a branch that is still being walked may have other numbers in the end."""
        start = getattr(action, "start", None)
        needed = [*([] if start is None else [start.result]), *getattr(action, "known", [])]
        if not all(self.entry(key).state.is_over for key in needed):
            raise ModelError("this result is still being computed; wait for its end, or stop it, and ask again")

    def _read_file(self) -> None:
        """Read the studies of the file, or what is wrong with it; the last good ones are kept."""
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
        matrices = {path: _stamp(path) for path in matrix_paths(source)}
        self._stamps = {os.fspath(self.file): self._stamps[os.fspath(self.file)], **matrices}
        return check_studies(source)

    def _read_exploration(self) -> None:
        folder = self.workspace.exploration(self.file)
        for path, record in read_records(folder).items():
            try:
                action = read_action(record.get("action"))
            except ModelError:
                continue
            if path.exists():
                entry = Entry(path.stem, str(record.get("title", path.stem))[:200], path, action)
                self.entries[entry.key] = entry
                self.read(entry)
                if entry.result is not None:
                    entry.model = mark_of(entry.result.study)
                if entry.result is not None and not entry.result.complete:
                    entry.state = State.STOPPED
                elif entry.result is not None:  # nobody goes on with it, so nobody else would tidy up after a kill
                    with suppress(StoreError):
                        tidy(path)

    def resumed(self, entry: Entry) -> Task:
        """The task that goes on with a result that was stopped; one that had found nothing begins again.

        Raises
        ------
        ModelError
            If there is nothing to go on with.
        """
        if entry.action is None or not entry.can_go_on:
            raise ModelError(f"{entry.title} has come to its end; there is nothing to go on with")
        self._refuse_unfinished(entry.action)
        task = _task_of(entry.action, entry.result, self)
        with self.guard:
            # the file may have been changed since; what was begun is what is gone on with
            study = task.study if entry.result is None else entry.result.study
            entry.result, entry.state, entry.message = None, State.QUEUED, ""
            entry.live = Progress()
            entry.version += 1
        return replace(task, study=study, output=Path(entry.path), resume=True)


def _stamp(path: str) -> str:
    """What tells a file from what it was before; zeros if there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # a ValueError is a NUL in the name
        return "0-0"
    return f"{found.st_mtime_ns}-{found.st_size}"


def _task_of(action: Action, result: Result | None, exploration: Exploration) -> Task:
    """The task of an action; of a study that has been begun, whatever the file says now."""
    if isinstance(action, Compute) and result is not None:
        return Task(result.study, Path())
    return plan(action, exploration)[1]


def _ends(entry: Entry) -> str:
    """How the one branch or locus of a result ends, or what a search has covered."""
    result = entry.result
    if result is None:
        return ""
    if result.diagram is not None and result.diagram.search is not None:
        count = len(result.branches)
        found = f"{count} new {'branch' if count == 1 else 'branches'}." if count else "Nothing new was found."
        return " ".join([found, *result.diagram.notes[:2]])
    if result.map is not None and len(result.map.loci) == 1:
        return "; ".join(dict.fromkeys(str(end) for end in result.map.loci[0].ends))
    if len(result.branches) == 1:
        return str(result.branches[0].ends[-1])
    settled = entry.settled()
    return "; ".join(settled.evidence[:2]) if settled is not None else ""
