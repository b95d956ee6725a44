"""Bounds that fields declare: every one is checked, in Python and in tables, by the same sentence."""

import dataclasses
import importlib
import math
import pkgutil
from typing import Annotated, Any

import pytest
from annotated_types import Ge, Gt, Le, Lt

import gapwalk
from gapwalk.errors import ModelError
from gapwalk.model.bounds import Bound, Counted, Finite, bound_of, check, check_fields
from gapwalk.model.bounds import _bounds as bounds

GIVEN: dict[str, dict[str, Any]] = {
    "Change": {"parameter": "frequency"},
    "_Plan": {"periods": 9},
    "MeasuredPoint": {"kind": "fold", "value": 1.0, "error": 0.1},
    "MotionClaim": {"motion": "chaotic"},
    "Resonance": {"number": 1, "below": 1.0},
    "Scales": {"angle": 1.0, "frequency": 1.0, "inertia": 1.0},
    "Tone": {"amplitude": 1.0, "acts_on": {"x": 1.0}, "frequency": 1.0},
}
LATER = ("PeakBelow",)  # checked with the system
APART = ("__main__", "cli", "explorer", "parallel", "plot", "results", "studies")


def _checks(record: type) -> bool:
    code = getattr(getattr(record, "__post_init__", None), "__code__", None)
    return code is not None and "check_fields" in code.co_names


def checked_records() -> list[type]:
    """Return the dataclasses below the studies that are checked against the bounds of their fields."""
    found = {}
    for info in pkgutil.walk_packages(gapwalk.__path__, "gapwalk."):
        if info.name.split(".")[1] not in APART:
            for each in vars(importlib.import_module(info.name)).values():
                if isinstance(each, type) and dataclasses.is_dataclass(each) and _checks(each):
                    found[each.__qualname__] = each
    return [*found.values()]


RECORDS = [record for record in checked_records() if record.__name__ not in LATER]
CASES = [(record, name, bound) for record in RECORDS for name, bound in bounds(record)]


def outside(bound: Bound) -> list[Any]:
    """Return values that a bound excludes."""
    step = 1 if bound.kind is int else 1e-9
    found: list[Any] = ["1", True, math.nan, math.inf]
    found += [1.5] if bound.kind is int else []
    found += [bound.least - (0 if bound.above else step)] if bound.least > -math.inf else []
    found += [bound.most + (0 if bound.below else step)] if bound.most < math.inf else []
    return [(value,) for value in found] if bound.several else found


@pytest.mark.parametrize(("record", "name", "bound"), CASES, ids=lambda each: getattr(each, "__name__", str(each)))
def test_what_is_outside_of_a_bound_is_refused(record: type, name: str, bound: Bound) -> None:
    given = GIVEN.get(record.__name__, {})
    for value in outside(bound):
        with pytest.raises(ModelError) as raised:
            record(**{**given, name: value})
        assert str(raised.value).startswith(name)
        assert str(raised.value).endswith(f"is {value!r}; it must be {bound}")
    for end, is_open in ((bound.least, bound.above), (bound.most, bound.below)):
        if math.isfinite(end):
            assert bound.has((end,) if bound.several else end) is not is_open


def test_all_options_are_among_them() -> None:
    names = {record.__name__ for record in RECORDS}
    assert names >= {
        "WalkOptions",
        "Shooting",
        "Balance",
        "SearchOptions",
        "SettleOptions",
        "BatchOptions",
        "TorusOptions",
    }
    assert len(CASES) >= 55


@pytest.mark.parametrize(
    ("hint", "words"),
    [
        (Counted, "an integer >= 1"),
        (Annotated[int, Ge(2), Le(10_000)], "an integer from 2 to 10,000"),
        (Annotated[float, Gt(0)], "a number > 0"),
        (Annotated[float, Gt(0), Le(0.1)], "a number > 0 and <= 0.1"),
        (Annotated[float, Ge(0), Lt(1)], "a number >= 0 and < 1"),
        (Annotated[float, Ge(1e-12), Le(1)], "a number from 1e-12 to 1"),
        (Finite, "a finite number"),
        (Counted | None, "an integer >= 1"),
        (tuple[Counted, ...], "integers, each >= 1"),
        (tuple[Annotated[float, Gt(0)], ...] | None, "numbers, each > 0"),
    ],
)
def test_bounds_in_words(hint: Any, words: str) -> None:
    with pytest.raises(ModelError, match=f"n is 'x'; it must be {words}"):
        check("n", "x", hint)


def test_what_has_no_bound_is_not_checked() -> None:
    for hint in (int, float | None, str, tuple[int, int], Annotated[int, "open"], Counted | tuple[int, ...]):
        assert bound_of(hint) is None

    @dataclasses.dataclass
    class Plain:
        n: int = 0

    check_fields(Plain())
