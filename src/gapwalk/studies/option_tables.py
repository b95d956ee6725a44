"""Tables of options inside of a study: the search for isolated branches, and the kinds of special points."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import Ge, Le, MinLen
from pydantic import AfterValidator, Field, PlainValidator, ValidationInfo

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.errors import ModelError
from gapwalk.model.schema import one_of
from gapwalk.studies.derive import key_type
from gapwalk.studies.kinds import INLINE, MAX_VALUES
from gapwalk.studies.tables import Surroundings, check_inside


@dataclass(frozen=True)
class SearchTable:
    """The table of a search: at which values of the parameter, and beside them the options of the search."""

    values: Annotated[
        Annotated[int, Ge(1), Le(MAX_VALUES)] | Annotated[tuple[float, ...], MinLen(1)],
        Field(description="write at how many values of the parameter to search, or a list of them"),
    ]
    options: Annotated[SearchOptions, INLINE] = SearchOptions()


def _suits(search: SearchTable | None, info: ValidationInfo[Surroundings]) -> SearchTable | None:
    """Refuse what does not suit the study: values outside its range, a box of another size than the state."""
    if search is None:
        return None
    ends, system, box = (info.data.get("begin"), info.data.get("end")), info.context.system, search.options.box
    if isinstance(search.values, tuple) and None not in ends:
        check_inside(search.values, "values", ends)
    if box is not None and system and len(box) != 2 * system.size:
        raise ModelError(
            f"box is a list of {len(box)} numbers; it must have {2 * system.size}: half-widths of the box of starts in "
            "the positions, then in the velocities"
        )
    return search


SEARCH_KEYS: Mapping[str, Any] = {
    "search_values": None,
    "search": (Annotated[key_type(SearchTable) | None, AfterValidator(_suits)], None),
}
"""The keys of a search: a table of its own."""


def with_search(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a table, with what its table of the search says."""
    rest = {name: value for name, value in values.items() if name != "search"}
    search: SearchTable | None = values.get("search")
    return rest if search is None else {**rest, "search_values": search.values, "search": search.options}


def search_words(values: int | tuple[float, ...]) -> str:
    """Where a search is to be, for a line that says what is to be done."""
    count = values if isinstance(values, int) else len(values)
    return f", with a search at {count} values" if count else ""


def kinds_key(known: Callable[[], Iterable[Kind]]) -> Any:
    """The type of a key that lists kinds of special points."""
    return Annotated[
        list[Annotated[Kind, PlainValidator(one_of(known))]],
        Field(min_length=1),
        AfterValidator(lambda kinds: tuple(dict.fromkeys(kinds))),
    ]
