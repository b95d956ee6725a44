"""The codec: what the types allow comes back bit for bit; what they do not is refused before memory is taken."""

import json
import math
import tracemalloc
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.results.codec import Packed, column_of, decode, encode, plain
from tests.results.again import again
from tests.studies.same import assert_same_branch
from tests.systems import clutch
from tests.tiers import examples


class Colour(StrEnum):
    RED = "a red one"
    BLUE = "a blue one"


class Reason(Enum):
    FIRST = "a sentence"


class Pair(NamedTuple):
    x: float
    count: int = 3


@dataclass(frozen=True, eq=False)
class Arrays:
    f: NDArray[np.float64]
    z: NDArray[np.complex128]
    i: NDArray[np.intp]
    b: NDArray[np.bool_]


@dataclass(frozen=True)
class Everything:
    flag: bool
    count: int
    size: float
    text: str
    colour: Colour
    reason: Reason
    pair: Pair
    maybe: float | None
    either: Pair | Colour | tuple[float, ...] | int
    fixed: tuple[int, str]
    many: tuple[Pair, ...]
    table: Mapping[Colour, tuple[float, ...]]
    free: tuple[tuple[str, object], ...] = ()
    memo: dict[Any, Any] = field(default_factory=dict, compare=False, metadata={"stored": False})

    def _check_read(self) -> None:
        if self.size == 13.0:
            raise ValueError("thirteen")


FLOATS = st.floats(allow_nan=False)
INTS = st.integers(-(2**80), 2**80)
PAIRS = st.builds(Pair, FLOATS, INTS)
RECORDS = st.builds(
    Everything,
    st.booleans(),
    INTS,
    FLOATS,
    st.text(),
    st.sampled_from(Colour),
    st.sampled_from(Reason),
    PAIRS,
    st.none() | FLOATS,
    PAIRS | st.sampled_from(Colour) | st.lists(FLOATS).map(tuple) | INTS,
    st.tuples(INTS, st.text()),
    st.lists(PAIRS, max_size=20).map(tuple),
    st.dictionaries(st.sampled_from(Colour), st.lists(FLOATS).map(tuple)),
    st.lists(st.tuples(st.text(), st.none() | st.booleans() | INTS | st.lists(st.text()))).map(tuple),
).filter(lambda record: record.size != 13.0)


@given(st.lists(RECORDS, max_size=8).map(tuple))
@settings(max_examples=examples(30), deadline=None, derandomize=True)
def test_whatever_the_types_allow_comes_back(records) -> None:
    found = again(records, tuple[Everything, ...])
    assert found == records
    assert repr(found) == repr(records)  # signs of zeros, types of numbers


@pytest.mark.parametrize("value", [math.nan, -math.nan, math.inf, -math.inf, -0.0, 5e-324])
def test_numbers_that_are_no_json_keep_their_bits(value) -> None:
    for count in (1, 3, 50):
        found = again((value,) * count, tuple[float, ...])
        assert np.array(found).tobytes() == np.array((value,) * count).tobytes()
    assert "NaN" not in encode(value, float).head


def test_arrays_of_equal_and_of_different_shapes() -> None:
    random = np.random.default_rng(3)
    for shapes in ([(2, 3)] * 4, [(2, 3), (0, 3), (7, 1)], [(0,)] * 2, []):
        records = tuple(
            Arrays(
                random.normal(size=shape),
                random.normal(size=shape) * (1 + 2j),
                random.integers(-5, 5, shape),
                random.normal(size=shape) > 0,
            )
            for shape in shapes
        )
        for one, other in zip(again(records, tuple[Arrays, ...]), records, strict=True):
            for name in ("f", "z", "i", "b"):
                a, b = getattr(one, name), getattr(other, name)
                assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
                assert a.flags.writeable


def test_texts_and_numbers_of_one_record_can_be_read_in_the_file() -> None:
    packed = encode(gw.WalkOptions(largest_step=0.25), gw.WalkOptions)
    assert json.loads(packed.head)["largest_step"] == 0.25
    assert packed.arrays == b""


def test_a_branch_takes_few_bytes_and_differences_of_its_systems_only() -> None:
    branch = gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=0.7)
    packed = encode(branch, gw.Branch, branch.system)
    assert_same_branch(decode(packed, gw.Branch, branch.system), branch)
    assert len(packed.head) < 8_000
    assert len(packed.head) + len(packed.arrays) < 900 * (len(branch.points) + len(branch.special_points))
    assert_same_branch(again(branch), branch)  # with a system of its own
    other = branch.system.at(frequency=0.5)
    assert_same_branch(again(branch, base=other), branch)
    with pytest.raises(ValueError, match="a point does not belong to its branch"):
        again(replace(branch, parameter="mean.q1"))


WRONG = [
    (int, "1.0"),
    (int, "true"),
    (int, '"1"'),
    (int, "null"),
    (int, "[1, 2]"),
    (float, '"1"'),
    (float, "1e999"),
    (float, "NaN"),
    (float, "true"),
    (bool, "1"),
    (str, "1"),
    (str, "{}"),
    (Colour, '"GREEN"'),
    (Colour, '"a red one"'),
    (Pair, "[1.0, 2]"),
    (Pair, "{}"),
    (Pair, '{"count": 1}'),
    (Pair, '{"x": 1.0, "count": 1, "z": 1}'),
    (Pair | int, '{"is": "float", "float": 1.0}'),
    (Pair | int, '{"is": "none"}'),
    (Pair | int, '{"is": ["int"], "int": 1, "Pair": {}}'),
    (tuple[int, str], '[1, "a", 2]'),
    (tuple[int, str], '{"count": 1}'),
    (tuple[int, ...], '{"count": 2, "items": [1]}'),
    (tuple[int, ...], '{"count": -1, "items": []}'),
    (tuple[int, ...], '{"count": 1000000000000, "items": 1}'),
    (tuple[Pair | None, ...], '{"count": 1000000000000, "items": {"is": "none"}}'),
    (Mapping[str, int], '{"count": 1, "items": ["a", []]}'),
    (NDArray[np.float64], '{"array": "f8", "shape": [1, 1000000000000]}'),
    (NDArray[np.float64], '{"array": "f8", "shape": [1, 4611686018427387905, 4]}'),
    (NDArray[np.float64], '{"array": "f8", "shape": [1, -1]}'),
    (NDArray[np.float64], '{"array": "f8", "shape": [1, 0.5]}'),
    (NDArray[np.float64], '{"array": "f8", "shape": [1, true]}'),
    (NDArray[np.float64], '{"array": "O", "shape": [1, 1]}'),
    (NDArray[np.float64], '{"array": "i8", "shape": [1, 1]}'),
    (NDArray[np.float64], '{"shapes": [[100]], "numbers": {"array": "f8", "shape": [1]}}'),
    (NDArray[np.float64], "[1.0]"),
    (NDArray[np.bool_], '{"array": "b1", "shape": [1, 8]}'),
    (gw.System, '{"base": null, "names": [], "values": {"array": "f8", "shape": [1, 0]}}'),
]


@pytest.mark.parametrize(("kind", "head"), WRONG)
def test_what_the_types_do_not_allow_is_refused_before_memory_is_taken(kind, head) -> None:
    column_of(kind)
    tracemalloc.start()
    try:
        with pytest.raises((ValueError, TypeError, LookupError)):
            decode(Packed(head, b"\x07" * 8), kind)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_records_are_checked_when_they_are_read() -> None:
    with pytest.raises(ValueError, match="thirteen"):
        again(Everything(True, 1, 13.0, "", Colour.RED, Reason.FIRST, Pair(1.0), None, 1, (1, ""), (), {}))


def test_bytes_that_are_left_over_are_refused() -> None:
    with pytest.raises(ValueError, match="1 bytes are left over"):
        decode(Packed("1", b"x"), int)


@pytest.mark.parametrize(
    ("value", "kind"), [("1", int), (1.5, int), (True, float), (None, str), ((1.0,), tuple[int, ...]), ([1], Pair)]
)
def test_what_is_not_of_its_type_is_not_written(value, kind) -> None:
    with pytest.raises(ModelError, match="cannot be kept in a file"):
        encode(value, kind)


def test_types_that_cannot_be_kept_are_refused_at_once() -> None:
    for kind in (set[int], NDArray[np.float32], bytes, complex):
        with pytest.raises(TypeError, match=r"cannot be kept|are not kept"):
            column_of(kind)


def test_a_field_that_a_file_lacks_has_its_default() -> None:
    assert decode(Packed('{"x": 1.0}', b""), Pair) == Pair(1.0, 3)


def test_plain_values_are_those_of_json() -> None:
    record = Everything(True, 1, math.nan, "a", Colour.RED, Reason.FIRST, Pair(1.0), None, 1, (1, ""), (), {})
    document = plain(record)
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert (document["size"], document["colour"], document["pair"]) == (None, "a red one", [1.0, 3])
    assert "memo" not in document
    assert plain(np.array([1 + 2j])) == [[1.0, 2.0]]
    assert plain(gw.Balance(12))["name"] == "harmonic-balance"
    document = json.loads(json.dumps(plain(clutch()), allow_nan=False))
    assert document["parameters"]["stage2.clearance"] == clutch()["stage2.clearance"]
    assert {contact["law"] for contact in document["contacts"]} <= {"elastic", "hunt-crossley"}
    assert {load["kind"] for load in document["harmonics"]} == {"harmonic"}
