"""Python script that computes a result again, with every result from which it starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path

from gapwalk.errors import ModelError
from gapwalk.explorer import page_requests
from gapwalk.explorer import request_tasks as plan
from gapwalk.explorer.opened_file import Entry, Exploration, State
from gapwalk.explorer.workspace_folder import RESULT
from gapwalk.model.model_file import MATRICES
from gapwalk.model.model_source import parse_source
from gapwalk.orbit.method import Method, chosen
from gapwalk.studies.diagram_study import DiagramOptions, DiagramStudyOptions

_MOST = 100  # results from which one may start
_WORDS = {"locus": "loci", "settle": "settled", "runup": "run_ups"}  # names of values that are no branches


def script_of(exploration: Exploration, entry: Entry) -> str:
    """Return a script that computes the branches of an entry again, in the folder of the file that was opened."""
    return _Script(exploration).text(entry)


class _Script:
    """Builder of the lines of a script."""

    def __init__(self, exploration: Exploration) -> None:
        self.exploration = exploration
        self.lines: list[str] = []
        self.names: dict[str, str] = {}
        self.imports: set[str] = set()
        self.models: dict[str, str] = {}

    def text(self, entry: Entry) -> str:
        name = self.repeat(entry)
        head = [
            f'"""{_plain(entry.title)}: computed again, from {_plain(self.exploration.name)}."""',
            "",
            *sorted(self.imports, reverse=True),  # `import gapwalk` comes after `from`
            "import gapwalk as gw",
            "",
            *(line for text, word in self.models.items() for line in (f"{word} = {_literal(text)}", "")),
        ]
        last = [f"for branch in {name}:", "    print(branch)"] if entry.settled() is None else [f"print({name})"]
        return "\n".join([*head, *self.lines, *last, ""])

    def repeat(self, entry: Entry) -> str:
        """Add the lines of an entry, and of all results from which it starts; return the name of their value."""
        if entry.key in self.names:
            return self.names[entry.key]
        if len(self.names) >= _MOST:
            raise ModelError(
                f"this result was computed from another one, that from a third, and so on: more than {_MOST} results; "
                "export an earlier one"
            )
        do = "compute" if entry.action is None else entry.action.do
        number = entry.key.partition("-")[0]
        name = _WORDS.get(do, "branches") + (number if number.isdigit() else "")
        write: Callable[..., list[str]] = getattr(self, f"_{do}")
        lines = write(entry, entry.action, name)  # those of others come before
        self.lines.append(f"# {_plain(entry.title)}")
        if entry.state is State.STOPPED:
            self.lines.append("# (it was stopped; the script computes it to the end)")
        self.lines += [*lines, ""]
        self.names[entry.key] = name
        return name

    def _compute(self, entry: Entry, action: page_requests.Compute | None, name: str) -> list[str]:
        file = Path(self.exploration.name).name
        if action is None:
            return self._lines_of(entry, name, f"gw.open_result({file!r})")
        if self.exploration.file.suffix != RESULT:
            return [f"study = {self._study(entry, action)}", *self._lines_of(entry, name, "gw.run(study)")]
        changed = f"replace(study, system=study.system.at({dict(action.values)!r}))" if action.values else "study"
        if action.values:
            self.imports.add("from dataclasses import replace")
        return [f"study = gw.open_result({file!r}).study", *self._lines_of(entry, name, f"gw.run({changed})")]

    def _study(self, entry: Entry, action: page_requests.Compute) -> str:
        """Return the study of an entry, from the model at the time of its computation."""
        source = self._source(entry)
        if source is None:
            return f"gw.open_result({self._result(entry)!r}).study"
        arguments = [source]
        if action.values or action.study:
            arguments.append(repr(dict(action.values)))
        if action.study:
            arguments.append(repr(action.study))
        return f"gw.read_study({', '.join(arguments)})"

    def _source(self, entry: Entry) -> str | None:
        """Return the model file used for an entry, as an argument; None if its text is not the whole model."""
        study = self.exploration.base() if entry.result is None else entry.result.study
        if entry.result is not None and not _is_whole(study.text):
            return None
        if study.text not in self.models:
            self.models[study.text] = f"MODEL{len(self.models) + 1 if self.models else ''}"
        self.imports.add("import io")
        return f"io.StringIO({self.models[study.text]})"

    def _result(self, entry: Entry) -> str:
        """Return the path of the result file of an entry, from the folder of the file that was opened."""
        return f"{entry.path.parent.name}/{entry.path.name}"

    def _lines_of(self, entry: Entry, name: str, result: str) -> list[str]:
        """Return lines of the script that name the branches of a result and, for a map, its loci after them."""
        if entry.answer is not None:
            return [
                f"record = {result}.finding.record",
                "print(record.summary())",
                f"{name} = {entry.answer.picture.script}",
            ]
        if entry.result is None or entry.result.map is None:
            return [f"{name} = {result}.branches"]
        return [f"chart = {result}.map", f"{name} = (*chart.branches, *chart.loci)"]

    def _walk(self, entry: Entry, action: page_requests.Walk, name: str) -> list[str]:
        # Newton's method from the state, which is on the orbit already, as the walk began
        options = self._method(action.start)
        return [
            f"orbit = {self._motion(action.start)}",
            f"orbit = gw.find_orbit(orbit.system, orbit.period, orbit.state{options})",
            f"{name} = (gw.follow(orbit, {action.parameter!r}, {action.to!r}{options}),)",
        ]

    def _switch(self, entry: Entry, action: page_requests.Switch, name: str) -> list[str]:
        line, _ = self.exploration.special(action.start)
        options, within = self._method(action.start), f"({action.low!r}, {action.high!r})"
        return [f"{name} = (gw.follow({self._place(action.start)}, {line.parameter!r}, {within}{options}),)"]

    def _search(self, entry: Entry, action: page_requests.Search, name: str) -> list[str]:
        system = self._base_system(entry) if action.start is None else f"{self._motion(action.start)}.system"
        study = plan.plan(action, self.exploration)[1].study if entry.result is None else entry.result.study
        options = study.options
        assert isinstance(options, DiagramStudyOptions)
        known = [
            f"{self.repeat(self.exploration.entry(key))}[{n}]"
            for key, n in plan.known_branches(action, self.exploration, study.system)
        ]
        changed = {
            field.name: value
            for field in fields(DiagramOptions)
            if (value := getattr(options.limits, field.name)) != field.default
        }
        limits = ", ".join(f"{word}={_gw(value)}" for word, value in changed.items())
        return [
            f"known = [{', '.join(known)}]",
            f"others = gw.find_others({system}, {action.parameter!r}, {(action.low, action.high)!r}, known=known, "
            f"{limits}, walk={_gw(options.walk)}, method={_gw(options.method)})",
            f"{name} = others.branches",
        ]

    def _locus(self, entry: Entry, action: page_requests.FollowLocus, name: str) -> list[str]:
        line, special = self.exploration.special(action.start)
        low, high = sorted((action.second_low, action.second_high))
        plane = f"{line.parameter!r}, {action.second!r}, {((action.low, action.high), (low, high))!r}"
        options = _option(plan.locus_method(special.orbit, self.exploration.origin(action.start)))
        return [f"{name} = (gw.follow_locus({self._place(action.start)}, {plane}{options}),)"]

    def _settle(self, entry: Entry, action: page_requests.Settle, name: str) -> list[str]:
        if action.start is None:
            system, start = self._base_system(entry), "'rest'"
        else:
            motion = self._motion(action.start)
            system, start = f"{motion}.system", f"{motion}.state"
        at = f", at={dict(action.values)!r}" if action.values else ""
        settled = entry.settled()
        # a motion without period was followed further while its kind was found
        word = "classify" if settled is not None and settled.orbit is None else "settle"
        return [f"{name} = gw.{word}({system}, {start}{at})"]

    def _runup(self, entry: Entry, action: page_requests.RunUp, name: str) -> list[str]:
        if action.start is None:
            system, own = self._base_system(entry), self.exploration.base().system
        else:
            system, own = f"{self._motion(action.start)}.system", self.exploration.motion(action.start).system
        if action.values:
            system += f".at({dict(action.values)!r})"
        asked = plan.run_up_study(action, own.at(dict(action.values)))
        return [
            f"course = gw.ask.SpeedCourse({list(asked.times)!r}, {list(asked.speeds)!r})",
            f"{name} = (gw.ask.run_up({system}, course, samples={asked.samples}),)",
        ]

    def _base_system(self, entry: Entry) -> str:
        """Return the system of the opened file at the time when the entry was computed."""
        if self.exploration.file.suffix == RESULT:
            return f"gw.open_result({Path(self.exploration.name).name!r}).system"
        source = self._source(entry)
        return (
            f"gw.open_result({self._result(entry)!r}).system"
            if source is None
            else f"gw.studies.read_studies({source})[0].system"
        )

    def _motion(self, place: page_requests.Place) -> str:
        """Return the motion at a place: an orbit, or a settled motion."""
        return f"{self._place(place)}.orbit" if place.special is not None else self._place(place)

    def _place(self, place: page_requests.Place) -> str:
        """Return the orbit, or the special point, at a place."""
        entry = self.exploration.entry(place.result)
        name = self.repeat(entry)
        settled = entry.settled()
        if settled is not None:  # a motion without period has no orbit, but a system and a state like one
            return name if settled.orbit is None else f"{name}.orbit"
        line = f"{name}[{place.branch}]"
        if place.special is not None:
            on_locus = entry.lines()[place.branch].kind is not None
            return f"{line}.{'codim2_points' if on_locus else 'special_points'}[{place.special}]"
        if place.point is None:
            raise ModelError(f"a place in {entry.title} names no point of a branch")
        return f"{line}.points[{place.point}].orbit"

    def _method(self, place: page_requests.Place) -> str:
        """Return the method of an orbit as an argument, if it is not the default."""
        return _option(plan.method_of(plan.orbit_at(place, self.exploration), self.exploration.origin(place)))


def _option(method: Method) -> str:
    """Return a method as a further argument; an empty text for the default."""
    return "" if method == chosen(None) else f", method={_gw(method)}"


def _gw(value: object) -> str:
    """Return a value as Python text, with the names of gapwalk."""
    return f"gw.{value!r}" if is_dataclass(value) else repr(value)


def _is_whole(text: str) -> bool:
    """Return True if the text of a model file is the whole model: without matrix files, and not reduced."""
    data = parse_source(text).data
    return "reduction" not in data and not any(isinstance(data.get(name), str) for name in MATRICES)


def _literal(text: str) -> str:
    """Return a text as a Python literal, over several lines if possible."""
    plain = all(char.isprintable() or char == "\n" for char in text) and "\\" not in text and '"""' not in text
    return f'"""\\\n{text}"""' if plain and not text.endswith('"') else repr(text)


def _plain(text: str) -> str:
    """Return a text that is safe in a comment and in a docstring."""
    return "".join(char if char.isprintable() and char not in '"\\' else " " for char in text)
