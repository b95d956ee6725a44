"""The Python script that repeats a result of an exploration, with every result that it goes back to."""

from __future__ import annotations

from pathlib import Path

from gapwalk.errors import ModelError
from gapwalk.explorer.action import Compute, Place, Settle, Switch, Walk
from gapwalk.explorer.board import Board
from gapwalk.explorer.entry import Entry, State
from gapwalk.explorer.plan import method_of, orbit_at
from gapwalk.explorer.workspace import RESULT
from gapwalk.orbit.balance.options import Balance

_MOST = 100  # results that one goes back to


def script_of(board: Board, entry: Entry) -> str:
    """A script that computes the branches of an entry again; it runs in the folder of the file that was opened.

    Raises
    ------
    ModelError
        If what it goes back to is not on the page any more.
    """
    return _Script(board).text(entry)


class _Script:
    """The lines of a script while they are put together."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.lines: list[str] = []
        self.names: dict[str, str] = {}
        self.imports: set[str] = set()

    def text(self, entry: Entry) -> str:
        name = self.repeat(entry)
        head = [
            f'"""{_plain(entry.title)}: computed again, from {_plain(self.board.name)}."""',
            "",
            *sorted(self.imports, reverse=True),  # `import gapwalk` stands after `from`
            "import gapwalk as gw",
            "",
        ]
        last = [f"for branch in {name}:", "    print(branch)"] if entry.settled() is None else [f"print({name})"]
        return "\n".join([*head, *self.lines, *last, ""])

    def repeat(self, entry: Entry) -> str:
        """Add the lines of an entry, and of all that it goes back to; the name of what they make."""
        if entry.key in self.names:
            return self.names[entry.key]
        if len(self.names) >= _MOST:
            raise ModelError(f"this result goes back to more than {_MOST} others; export one of those first")
        action = entry.action
        if isinstance(action, Settle):
            name = self._settle(entry, action)
        elif isinstance(action, Walk):
            name = self._walk(entry, action)
        elif isinstance(action, Switch):
            name = self._switch(entry, action)
        else:
            name = self._compute(entry, action)
        self.names[entry.key] = name
        return name

    def _compute(self, entry: Entry, action: Compute | None) -> str:
        name = _name("branches", entry)
        file = Path(self.board.name).name
        self._comment(entry)
        if action is None:
            self.lines += [f"{name} = gw.load({file!r}).branches", ""]
        elif self.board.file.suffix == RESULT:
            changed = f"replace(study, system=study.system.at({dict(action.values)!r}))" if action.values else "study"
            if action.values:
                self.imports.add("from dataclasses import replace")
            self.lines += [f"study = gw.load({file!r}).study", f"{name} = gw.run({changed}).branches", ""]
        else:
            arguments = [repr(file)]
            if action.values or action.study:
                arguments.append(repr(dict(action.values)))
            if action.study:
                arguments.append(repr(action.study))
            self.lines += [f"study = gw.read_study({', '.join(arguments)})", f"{name} = gw.run(study).branches", ""]
        return name

    def _walk(self, entry: Entry, action: Walk) -> str:
        orbit, name = self._place(action.start), _name("branches", entry)
        self._comment(entry)
        # as a walk begins: Newton's method from the state, which is on the orbit already
        options = self._method(action.start)
        self.lines += [
            f"orbit = {orbit}",
            f"orbit = gw.find_orbit(orbit.system, orbit.period, orbit.state{options})",
            f"{name} = (gw.follow(orbit, {action.parameter!r}, {action.to!r}{options}),)",
            "",
        ]
        return name

    def _switch(self, entry: Entry, action: Switch) -> str:
        parent = self.board.entry(action.start.result)
        line, _ = self.board.special(action.start)
        special, name = self._place(action.start), _name("branches", entry)
        self.imports.add("from gapwalk.bifurcation import walk_out")
        self._comment(entry)
        options, within = self._method(action.start), f"({action.low!r}, {action.high!r})"
        self.lines += [
            f"departures = gw.switch({special}, {line.parameter!r}, {within}{options})",
            f"{name} = (walk_out(departures),)",
            "",
        ]
        assert parent.key in self.names
        return name

    def _settle(self, entry: Entry, action: Settle) -> str:
        name = _name("settled", entry)
        if action.start is None:
            system, start = self._base_system(), "'rest'"
        else:
            motion = self._place(action.start)
            system, start = f"{motion}.system", f"{motion}.state"
        at = f", at={dict(action.values)!r}" if action.values else ""
        self._comment(entry)
        self.lines += [f"{name} = gw.settle({system}, {start}{at})", ""]
        return name

    def _base_system(self) -> str:
        file = Path(self.board.name).name
        read = f"gw.load({file!r})" if self.board.file.suffix == RESULT else f"gw.read_studies({file!r})[0]"
        return f"{read}.system"

    def _place(self, place: Place) -> str:
        """The orbit, or the special point, at a place."""
        entry = self.board.entry(place.result)
        name = self.repeat(entry)
        if entry.settled() is not None:
            return f"{name}.orbit"
        kind, number = ("special_points", place.special) if place.special is not None else ("points", place.point)
        if number is None:
            raise ModelError(f"a place in {entry.title} names no point of a branch")
        text = f"{name}[{place.branch}].{kind}[{number}]"
        return text if place.special is not None and kind == "special_points" else f"{text}.orbit"

    def _method(self, place: Place) -> str:
        """How orbits are posed, if not as by default."""
        if place.special is not None:
            line, special = self.board.special(place)
            del line
            method = method_of(special.orbit, self.board)
        else:
            method = method_of(orbit_at(place, self.board), self.board)
        if method == type(method)() and not isinstance(method, Balance):
            return ""
        return f", method=gw.{method!r}"

    def _comment(self, entry: Entry) -> None:
        self.lines.append(f"# {_plain(entry.title)}")
        if entry.state is State.STOPPED:
            self.lines.append("# (it was stopped; the script goes on to the end)")


def _name(word: str, entry: Entry) -> str:
    number = entry.key.partition("-")[0]
    return f"{word}{number}" if number.isdigit() else word


def _plain(text: str) -> str:
    """A text that ends neither a comment nor a docstring."""
    return "".join(char if char.isprintable() and char not in '"\\' else " " for char in text)
