"""Names of parameters are computed from what there is, and found again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.registry import NameBlock, ParameterNames
from tests.results.again import again

NAMES = ParameterNames((NameBlock("w"), NameBlock("k", 2), NameBlock("c.e", 1), NameBlock("c.b")), ("x", "y", "z"))
LARGE = ParameterNames((*NAMES.blocks, NameBlock("large", 4), NameBlock("larger", 10)), ("x", "y", "z"))
LISTED = ["w", *(f"k.{a}.{b}" for a in "xyz" for b in "xyz"), "c.e.x", "c.e.y", "c.e.z", "c.b"]


def test_they_come_in_order() -> None:
    assert len(LARGE) > 20_000  # so many are not listed
    assert [*NAMES] == LISTED
    assert [NAMES[place] for place in range(len(NAMES))] == LISTED
    assert NAMES[-1] == "c.b"
    assert [*NAMES[2:4]] == LISTED[2:4]
    with pytest.raises(IndexError):
        NAMES[len(LISTED)]


@given(st.sampled_from(LISTED))
def test_each_is_found_where_it_stands(name: str) -> None:
    assert NAMES.place(name) == LARGE.place(name) == LISTED.index(name)
    assert name in NAMES
    assert name in LARGE


@pytest.mark.parametrize("name", ["", "k", "k.x", "k.x.q", "k.x.y.z", "c.e", "c", "w.x", "c.b.x", 3, None])
def test_nothing_else_is_found(name) -> None:
    assert name not in NAMES
    assert name not in LARGE
    with pytest.raises(ModelError, match="there is no parameter"):
        NAMES.place(name)


def test_a_system_of_a_thousand_coordinates_lists_no_names() -> None:
    n = 1000
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    system = gw.System([f"x{i}" for i in range(n)], stiffness, contacts=[gw.backlash("gap", {"x7": 1.0}, 0.1)])
    assert len(system.parameters) == 1 + 3 * n * n + n + n + 3
    assert system.parameters["stiffness.x7.x8"] == -1.0
    assert system.at({"gap.clearance": 0.2})["gap.clearance"] == 0.2
    with pytest.raises(ModelError, match=r"did you mean 'gap\.clearance'"):
        system.at({"gap.clearence": 0.2})
    assert not {"names", "places"} & {*vars(system.structure.names)}
    kept = sum(len(value) for value in vars(system.structure.names).values() if value)
    assert kept < 10 * n  # the blocks and the coordinates, and how to find them; not the n * n names


def test_of_a_large_system_no_zeros_are_stored() -> None:
    from gapwalk.model.structure import Structure
    from gapwalk.results.codec import WholeSystem, parameters_of, system_of

    n = 100
    system = gw.System([f"x{i}" for i in range(n)], 2 * np.eye(n) - np.eye(n, k=1), mean={"x3": 1.0})
    parameters = parameters_of(system)
    assert len(parameters) == 1 + n + 2 * n - 1 + 1
    assert system_of(WholeSystem(system.structure, parameters)) == system
    assert again(system) == system
    with pytest.raises(ValueError, match="more parameters"):
        system_of(WholeSystem(Structure(tuple(f"x{i}" for i in range(10**5)), (), ()), parameters))
