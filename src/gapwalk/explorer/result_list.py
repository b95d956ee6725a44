"""The list of results on the page: their names, colours, how they are drawn, and which are deleted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gapwalk.errors import ModelError
from gapwalk.explorer.workspace import forget, read_record, write_record

if TYPE_CHECKING:
    from gapwalk.explorer.exploration import Entry, Exploration

COLOURS = ("blue", "orange", "green", "purple", "red", "grey")
"""Colours of a result, as the page calls them; without one, a line has the colour of its stability."""


class Look(BaseModel):
    """What a user has chosen for a result."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(max_length=120)] = ""
    drawn: Literal["full", "pale", "hidden"] = "full"
    colour: Literal["", "blue", "orange", "green", "purple", "red", "grey"] = ""
    deleted: bool = False


def read_look(plain: object) -> Look:
    """Read what was chosen for a result from its record; what cannot be read is as if nothing was chosen."""
    try:
        return Look.model_validate(plain or {})
    except ValidationError:
        return Look()


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
        raise ModelError(f"a result cannot be changed so: {wrong}. What can be changed: {allowed}") from None
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
            needed = {key for entry in exploration.entries.values() for key in _starts(entry)}
            gone = [entry for key, entry in exploration.entries.items() if entry.look.deleted and key not in needed]
        if not gone:
            return count
        for entry in gone:
            forget(entry.path)
            with exploration.guard:
                del exploration.entries[entry.key]
            count += 1


def _starts(entry: Entry) -> list[str]:
    """Return the keys of the results from which one starts: its script and its resumption need them."""
    start = getattr(entry.action, "start", None)
    return [*([] if start is None else [start.result]), *getattr(entry.action, "known", [])]


def listed(exploration: Exploration) -> list[dict[str, Any]]:
    """Return the results of an exploration for the page, with their progress; deleted ones are left out."""
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
        "answer": None if entry.answer is None else {"axes": entry.answer.axes},
        "can_resume": entry.can_resume,
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
                "earlier": line.is_earlier,
            }
            for line in entry.lines()
        ],
    }
