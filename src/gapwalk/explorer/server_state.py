"""State of the server: the workspace, the open files, the jobs, and the connected pages."""

from __future__ import annotations

import queue
import secrets
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.explorer.diagram_lines import contact_quantities, inertia_measures, measure_name, quantity_words
from gapwalk.explorer.engine import Engine
from gapwalk.explorer.engine_tasks import Task
from gapwalk.explorer.live_process import LiveAnswers
from gapwalk.explorer.motion_panels import Flows, locus_lines, scenes_of
from gapwalk.explorer.opened_file import Entry, Exploration, State, change_look, deleted, listed, remove_deleted
from gapwalk.explorer.page_requests import read_action
from gapwalk.explorer.progress_stream import Events, Progress
from gapwalk.explorer.request_tasks import prepare, resumed
from gapwalk.explorer.workspace_folder import Workspace, plan_words, walks_of
from gapwalk.flow.motion import signal_names
from gapwalk.flow.ramp import ramp_problems
from gapwalk.model.system import System
from gapwalk.model.words import signal_words
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.study_file import Study

# Jobs: the queue, and the thread that gives them to the process that computes; they continue without a page.

_MOST = 50  # waiting jobs


class Jobs:
    """The queue of jobs, and the thread that gives them to the process."""

    def __init__(self, changed: Callable[[], object], engine: Engine | None = None) -> None:
        self._changed = changed
        self._queue: queue.Queue[tuple[Exploration, Entry, Task] | None] = queue.Queue()
        self._guard = threading.Lock()
        self._current: Entry | None = None
        self._engine = engine or Engine()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="gapwalk-jobs", daemon=True)
        self._thread.start()

    def add(self, exploration: Exploration, entry: Entry, task: Task) -> None:
        """Put a job at the end of the queue."""
        if self._queue.qsize() >= _MOST:
            raise ModelError(f"{_MOST} jobs are waiting already; stop some of them, or wait")
        entry.state = State.QUEUED
        self._queue.put((exploration, entry, task))
        self._changed()

    def stop(self, entry: Entry) -> None:
        """Stop a job: a waiting one does not begin, and the results of a running one are kept."""
        with self._guard:
            if entry is self._current:
                self._engine.stop()
            elif entry.state is State.QUEUED:
                entry.change(state=State.STOPPED, message="it was stopped before it began")
        self._changed()

    def pause(self, entry: Entry) -> None:
        """Pause the running job."""
        self._change(entry, State.RUNNING, State.PAUSED, self._engine.pause)

    def resume(self, entry: Entry) -> None:
        """Resume a paused job."""
        self._change(entry, State.PAUSED, State.RUNNING, self._engine.resume)

    def close(self) -> None:
        """Stop all jobs; results so far are stored."""
        self._closing = True
        self._queue.put(None)
        with self._guard:
            if self._current is not None:
                self._engine.stop()
        self._thread.join(10.0)
        self._engine.close()

    def _change(self, entry: Entry, before: State, after: State, act: Callable[[], None]) -> None:
        with self._guard:
            if entry is not self._current or entry.state is not before:
                raise ModelError(f"{entry.title} is {entry.state}, not {before}")
            act()
            entry.change(state=after)
        self._changed()

    def _work(self) -> None:
        while (item := self._queue.get()) is not None:
            exploration, entry, task = item
            with self._guard:
                if self._closing or entry.state is not State.QUEUED:
                    continue
                self._current = entry
                entry.change(state=State.RUNNING)
            self._changed()

            def hear(news: Progress, exploration: Exploration = exploration, entry: Entry = entry) -> None:
                with exploration.guard:
                    entry.live.add(news)
                    entry.change()
                self._changed()

            message = ""
            try:
                state = State.DONE if self._engine.do(task, hear) else State.STOPPED
            except GapwalkError as error:
                state, message = State.FAILED, str(error)
            with self._guard:
                self._current = None
            entry.message = message
            exploration.read(entry)
            entry.change(state=state)
            self._changed()


_MOST_OPEN = 20  # files open at the same time
_PARAMETERS = 400  # that a page can choose from


class Session:
    """State of the explorer that is kept when a page is closed or reloaded."""

    def __init__(self, root: Path, name: str = "", engine: Engine | None = None) -> None:
        self.workspace = Workspace(root)
        self.first = self.workspace.name(self.workspace.path(name)) if name else ""
        self.mark = secrets.token_hex(4)  # by which pages notice that the server was restarted
        self._guard, self._opening = threading.Lock(), threading.Lock()
        self._explorations: dict[str, Exploration] = {}
        self.flows = Flows()
        self.events = Events(self.progress)
        self.jobs = Jobs(self.events.changed, engine)
        self.live = LiveAnswers()

    def exploration(self, name: str) -> Exploration:
        """Return the exploration of a file; open the file if it is not open yet."""
        name = self.workspace.name(self.workspace.path(name))  # one file has one exploration, however it is spelt
        found = self._explorations.get(name)
        if found is not None:
            return found
        with self._opening:  # not the guard: reading a long result must not keep others waiting
            found = self._explorations.get(name)
            if found is None:
                found = Exploration(self.workspace, name)
                with self._guard:
                    self._make_room()
                    self._explorations[name] = found
            return found

    def _make_room(self) -> None:
        """Close the file that was opened first, of those without a running job; all of its results are stored."""
        if len(self._explorations) < _MOST_OPEN:
            return
        idle = [name for name, exploration in self._explorations.items() if exploration.is_idle()]
        if not idle:
            raise ModelError(f"{_MOST_OPEN} files are open, and each has a running job; stop some of them")
        del self._explorations[idle[0]]

    def reopen(self, name: str) -> Exploration:
        """Return the exploration of a file; read the file again if it has been changed."""
        exploration = self.exploration(name)
        with self._opening:
            exploration.refresh()
        return exploration

    def act(self, name: str, plain: object) -> Entry:
        """Start a job that a page asks for; raise a ModelError if it is not possible."""
        exploration = self.reopen(name)  # the job uses the file as it is now
        entry, task = prepare(exploration, read_action(plain))
        self.jobs.add(exploration, entry, task)
        return entry

    def resume(self, name: str, key: str) -> None:
        """Continue a job that was stopped; raise a ModelError if that is not possible."""
        exploration = self.exploration(name)
        entry = exploration.entry(key)
        self.jobs.add(exploration, entry, resumed(exploration, entry))

    def change(self, name: str, key: str, changes: dict[str, Any]) -> dict[str, Any]:
        """Change the look of a result (see `change_look`), and tell all pages; return what undoes it."""
        before = change_look(self.exploration(name), key, changes)
        self.events.changed()
        return before

    def clean(self, name: str) -> int:
        """Remove the deleted results of a file for good; return how many were removed."""
        count = remove_deleted(self.exploration(name))
        self.events.changed()
        return count

    def progress(self) -> dict[str, Any]:
        """Return the mark of the server, and for each open file its stamp and the progress of its results."""
        with self._guard:
            explorations = dict(self._explorations)
        return {
            "server": self.mark,
            "explorations": {
                name: {"stamp": exploration.stamp(), "results": listed(exploration), "deleted": deleted(exploration)}
                for name, exploration in explorations.items()
            },
        }

    def about(self, name: str) -> dict[str, Any]:
        """Return the data with which a page shows a file; raise a ModelError if the file cannot be opened."""
        exploration = self.reopen(name)
        stamp, study = exploration.stamp(), exploration.described()
        assert study is not None  # without it the file could not have been opened
        system, options = study.system, study.options
        self.flows.warm(system)
        shown, several = shown_measure(system, options), len(exploration.studies) > 1  # of which another may be chosen
        own = shown.partition(".")[2]
        first = [own] if own in system.coordinates else []  # what the study asks for stands before all others
        coordinates = list(dict.fromkeys((*first, *system.coordinates[:50])))
        measures = [f"{kind}.{q}" for q in coordinates for kind in ("half", "max", "min", "mean", "rms")]
        if shown not in measures:
            measures.insert(0, shown)

        return {
            "file": exploration.name,
            "server": self.mark,
            "stamp": stamp,
            "model": exploration.model,
            "problem": exploration.problem,
            "title": (study.title.removesuffix(f": {study.name}") if several else study.title) or name,
            "coordinates": list(system.coordinates),
            "signals": [[name, signal_words(name, system.units)] for name in signal_names(system)[:400]],
            "signal": coordinates[0],
            "contacts": [contact.name for contact in system.structure.contacts],
            "parameters": _parameters(system),
            "measures": quantity_words(
                [
                    *(measure_name(each, system) for each in measures),
                    *inertia_measures(system),
                    *contact_quantities(system),
                ],
                system,
            ),
            "x": getattr(options, "parameter", system.structure.pace),
            "y": measure_name(shown, system),
            "range": [options.begin, options.end] if isinstance(options, RangeStudy) else [],
            "values": dict(system.parameters) if len(system.parameters) <= 1000 else {},
            "loci": locus_lines(),
            "run_up": next(ramp_problems(system), ""),
            "machine": scenes_of(system),
            "studies": [_study(each) for each in exploration.studies],
            "results": listed(exploration),
            "deleted": deleted(exploration),
        }

    def close(self) -> None:
        """Stop all jobs and threads."""
        self.events.close()
        self.live.close()
        self.jobs.close()
        self.flows.close()


def _study(study: Study) -> dict[str, Any]:
    """Describe a study of the file for the page; a page cannot set the parameters along which it runs."""
    return {"name": study.name, "plan": plan_words(study), "walks": walks_of(study)}


def _parameters(system: System) -> list[dict[str, Any]]:
    """Return the named parameters of the system; if they are very many, those that are not zero."""
    items = list(system.parameters.items())
    if len(items) > _PARAMETERS:
        items = [(name, value) for name, value in items if value][:_PARAMETERS]
    return [{**words, "value": system[words["name"]]} for words in quantity_words([name for name, _ in items], system)]
