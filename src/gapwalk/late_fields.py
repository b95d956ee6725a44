"""Fields of a record that are computed when they are first asked for, such as what needs a transition matrix."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

T = TypeVar("T")


def late(function: Callable[[], T]) -> T:
    """Return a function in place of the value of a late field."""
    return cast("T", function)


def is_known(record: object, name: str) -> bool:
    """Return True if a field of a record has its value: it is not late, or was asked for."""
    return name not in getattr(record, "_makers", ())


class LateFields:
    """Record whose late fields may be given as functions, each of which is called once, when its field is asked for."""

    _late: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        fields = self.__dict__
        for name in self._late:
            if callable(fields[name]):
                fields.setdefault("_makers", {})[name] = fields.pop(name)

    if not TYPE_CHECKING:  # otherwise no attribute would be missing

        def __getattr__(self, name: str) -> Any:
            # only called for what is not there
            makers = self.__dict__.get("_makers", {})
            if name not in makers:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            value = self.__dict__[name] = makers[name]()
            makers.pop(name, None)
            return value

    def __getstate__(self) -> dict[str, Any]:
        for name in (*self.__dict__.get("_makers", ()),):
            getattr(self, name)
        return {name: value for name, value in self.__dict__.items() if name != "_makers"}
