"""State of the server: the workspace, the open explorations, the jobs, and the pages that listen."""

from __future__ import annotations

import secrets
import threading
from pathlib import Path
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.explorer.action import read_action
from gapwalk.explorer.curve_data import measure_name
from gapwalk.explorer.events import Events
from gapwalk.explorer.exploration import Exploration
from gapwalk.explorer.flows import Flows
from gapwalk.explorer.job_queue import Jobs
from gapwalk.explorer.page_result import Entry
from gapwalk.explorer.workspace import Workspace
from gapwalk.flow.motion import signal_names
from gapwalk.model.system import System
from gapwalk.plot.words import full_measure, measure_words, parameter_words
from gapwalk.studies.file import Study
from gapwalk.studies.options import BranchOptions

_BOARDS = 20  # files that are open at once
_PARAMETERS = 400  # that a page can choose from


class Session:
    """Everything that outlives a page.

    Parameters
    ----------
    root
        The workspace.
    name
        The file to show first; empty for none.
    """

    def __init__(self, root: Path, name: str = "") -> None:
        self.workspace, self.first = Workspace(root), name
        self.mark = secrets.token_hex(4)  # tells pages that another server answers than before
        self._guard, self._opening = threading.Lock(), threading.Lock()
        self._explorations: dict[str, Exploration] = {}
        self.flows = Flows()
        self.events = Events(self.progress)
        self.jobs = Jobs(self.events.changed)

    def exploration(self, name: str) -> Exploration:
        """The exploration of a file, which is opened if it is not open yet.

        Raises
        ------
        ModelError
            If it cannot be opened.
        """
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
        """Forget the file that was opened first of those of which nothing is being computed: all of it is stored."""
        if len(self._explorations) < _BOARDS:
            return
        idle = [name for name, exploration in self._explorations.items() if exploration.is_idle()]
        if not idle:
            raise ModelError(f"{_BOARDS} files are open, and something is computed for each; stop some of it")
        del self._explorations[idle[0]]

    def reopen(self, name: str) -> Exploration:
        """The exploration of a file, which is read again if it has been changed."""
        exploration = self.exploration(name)
        with self._opening:
            exploration.refresh()
        return exploration

    def act(self, name: str, plain: object) -> Entry:
        """Begin what a page asks for; a ModelError if it makes no sense."""
        exploration = self.reopen(name)  # what is computed is what stands in the file
        entry, task = exploration.prepare(read_action(plain))
        self.jobs.add(exploration, entry, task)
        return entry

    def go_on(self, name: str, key: str) -> None:
        """Go on with a job that was stopped; a ModelError if that cannot be."""
        exploration = self.exploration(name)
        entry = exploration.entry(key)
        self.jobs.add(exploration, entry, exploration.resumed(entry))

    def progress(self) -> dict[str, Any]:
        """Which server this is, and for each exploration what its file is and how far its results have come."""
        with self._guard:
            explorations = dict(self._explorations)
        return {
            "server": self.mark,
            "explorations": {
                name: {"stamp": exploration.stamp(), "results": exploration_progress(exploration)}
                for name, exploration in explorations.items()
            },
        }

    def about(self, name: str) -> dict[str, Any]:
        """What a page needs to know of a file to show it; a ModelError if it cannot be opened."""
        exploration = self.reopen(name)
        stamp, study = exploration.stamp(), exploration.described()
        assert study is not None  # a exploration without anything to describe cannot be opened
        system, options = study.system, study.options
        self.flows.warm(system)
        walked = isinstance(options, BranchOptions)
        parameters = _parameters(system)
        measures = [f"{kind}.{q}" for q in system.coordinates[:50] for kind in ("half", "max", "min", "mean", "rms")]
        shown = full_measure(options.measure, system.coordinates) if walked and options.measure else measures[0]
        if shown not in measures:
            measures.insert(0, shown)

        return {
            "file": name,
            "server": self.mark,
            "stamp": stamp,
            "model": exploration.model,
            "problem": exploration.problem,
            "title": study.title or name,
            "coordinates": list(system.coordinates),
            "signals": signal_names(system)[:400],
            "contacts": [contact.name for contact in system.structure.contacts],
            "parameters": parameters,
            "measures": [{"name": measure_name(each, system), "words": measure_words(each)} for each in measures],
            "x": options.parameter if walked else "frequency",
            "y": measure_name(shown, system),
            "range": [options.begin, options.end] if walked else [],
            "values": dict(system.parameters) if len(system.parameters) <= 1000 else {},
            "studies": [_study(each) for each in exploration.studies],
            "results": exploration_progress(exploration),
        }

    def close(self) -> None:
        """Stop everything."""
        self.events.close()
        self.jobs.close()
        self.flows.close()


def _study(study: Study) -> dict[str, Any]:
    """What a page is told of a study of the file; parameters that it walks have no value to be chosen."""
    second = getattr(study.options, "second", None)
    walks = [getattr(study.options, "parameter", None), getattr(second, "parameter", None)]
    return {"name": study.name, "plan": study.options.plan, "walks": [name for name in walks if name]}


def _parameters(system: System) -> list[dict[str, Any]]:
    """The named parameters of the system; of very many, those that are not zero."""
    items = list(system.parameters.items())
    if len(items) > _PARAMETERS:
        items = [(name, value) for name, value in items if value][:_PARAMETERS]
    return [{"name": name, "value": value, "words": parameter_words(name)} for name, value in items]


def exploration_progress(exploration: Exploration) -> list[dict[str, Any]]:
    """How far the results of a exploration have come."""
    with exploration.guard:
        return [_progress(entry) for entry in exploration.entries.values()]


def _progress(entry: Entry) -> dict[str, Any]:
    return {
        "key": entry.key,
        "title": entry.title,
        "state": entry.state.value,
        "message": entry.message,
        "version": entry.version,
        "model": entry.model,
        "kind": entry.action.do if entry.action else "opened",
        "settled": entry.settled() is not None,
        "can_go_on": entry.can_go_on,
        "saves": entry.saves,
        "done": [entry.live.done, entry.live.total],
        "branches": [
            {
                "name": line.name,
                "period": line.period,
                "points": len(line.points),
                "range": line.within,
                "parameter": line.parameter,
                "kind": line.kind,
                "second": line.second,
            }
            for line in entry.lines()
        ],
    }
