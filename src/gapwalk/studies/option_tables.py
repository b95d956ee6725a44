"""Tables of options in a model file: the methods that find orbits, and the search for isolated branches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, ValidationInfo, model_validator

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.isolated import SearchOptions
from gapwalk.errors import ModelError
from gapwalk.model.schema import Count, Number, Part, Positive, by_shape, one_of, tagged
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.balance import Balance
from gapwalk.orbit.method import Method
from gapwalk.orbit.shooting import Shooting


def method_name(value: object) -> str:
    """The name of a method; a ValueError for what is none."""
    return one_of(method.name for method in Method.known())(value)


class Stability(StrEnum):
    """How harmonic balance tells stability, as a model file calls it."""

    VARIATIONAL = "variational"
    HILL = "hill"


class MethodPart(Part):
    """Numerical options of orbits that are found by one method."""

    method: ClassVar[type[Method]]

    @model_validator(mode="after")
    def _makes_options(self) -> MethodPart:
        self.options()
        return self

    def options(self) -> Any:
        """The options; what the table does not give has the default of the method."""
        return self.method(**self.model_dump(exclude_unset=True, mode="json"))


class ShootingPart(MethodPart):
    """Numerical options of orbits that are found by shooting: ``[study.shooting]``."""

    method: ClassVar[type[Method]] = Shooting

    segments: Count | None = None
    tolerance: Positive | None = None


class BalancePart(MethodPart):
    """Numerical options of orbits that are found by harmonic balance: ``[study.balance]``."""

    method: ClassVar[type[Method]] = Balance

    harmonics: Count | None = None
    error: Positive | None = None
    stability: Annotated[Stability, BeforeValidator(one_of(Stability))] | None = None
    tolerance: Positive | None = None


Whole = Annotated[int, Field(strict=True, ge=0)]
"""0, 1, 2, ..."""


MAX_VALUES = 100_000
"""Of a parameter, at which something is to be done."""


def count_shape(value: object) -> str:
    """Whether a value is a count, or a list of values."""
    return "values" if isinstance(value, list) else "count"


CountOrValues = Annotated[
    Annotated[Annotated[Count, Field(le=MAX_VALUES)], tagged("count")]
    | Annotated[Annotated[list[Number], Field(min_length=1)], tagged("values")],
    by_shape(count_shape),
]
"""How many values, spread evenly over a range; or the values themselves."""


def check_inside(values: list[float], key: str, ends: tuple[Any, ...]) -> None:
    """A ModelError that begins with a key if one of its values lies outside a range."""
    low, high = sorted(ends)
    for value in values:
        if not low <= value <= high:
            raise ModelError(f"{key} has {value:g}, outside the range from {low:g} to {high:g}")


def with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same values with tuples in place of lists, as frozen options have them."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}


class SearchPart(Part):
    """Where and how thoroughly to search; but for the values, the keys are those of `SearchOptions`."""

    values: CountOrValues = Field(description="write at how many values of the parameter to search, or a list of them")
    starts: Count | None = None
    periods: Count | None = None
    newton_starts: Whole | None = None
    newton_periods: list[Count] | None = None
    patience: Annotated[int, Field(strict=True, ge=16)] | None = None
    box: list[Positive] | None = None
    spread: Positive | None = None
    seed: Whole | None = None
    block: Count | None = None

    @model_validator(mode="after")
    def _makes_options(self) -> SearchPart:
        self.options()
        return self

    def check(self, study: Mapping[str, Any], system: System | None) -> None:
        """Refuse what does not suit the study: values outside its range, a box of another size than the state.

        Raises
        ------
        ModelError
            Its message begins with the key that is wrong.
        """
        ends = (study.get("begin"), study.get("end"))
        if isinstance(self.values, list) and None not in ends:
            check_inside(self.values, "values", ends)
        if self.box is not None and system and len(self.box) != 2 * system.size:
            raise ModelError(
                f"box is a list of {len(self.box)} numbers; it must have {2 * system.size}: half-widths of the box of "
                "starts in the positions, then in the velocities"
            )

    def options(self) -> dict[str, Any]:
        """The options `search_values` and `search`; what is not given has the default of `SearchOptions`."""
        found = with_tuples(self.model_dump(exclude_none=True))
        return {"search_values": found.pop("values"), "search": SearchOptions(**found)}


def _suits(search: SearchPart | None, info: ValidationInfo[Any]) -> SearchPart | None:
    if search is not None:
        search.check(info.data, info.context.system)
    return search


SEARCH_KEYS: Mapping[str, Any] = {
    "search_values": None,
    "search": (Annotated[SearchPart | None, AfterValidator(_suits)], None),
}
"""The keys of a search: a table of its own."""


def with_search(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a table, with what its table of the search says."""
    search = values.get("search")
    rest = {name: value for name, value in values.items() if name != "search"}
    return rest if search is None else rest | search.options()


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
