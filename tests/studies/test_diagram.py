"""The diagram: each branch once, tied to its parents, whatever the number of processes, resumable."""

import numpy as np
import pytest

from gapwalk import diagram
from gapwalk.bifurcation import Kind
from gapwalk.bifurcation.diagram import Cascade, Diagram, Origin
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError
from gapwalk.orbit.orbit import is_same
from gapwalk.paper import case
from gapwalk.studies.diagram_study import DiagramOptions
from tests.bifurcation.test_special_points import symmetric
from tests.interruption import until_ctrl_c

pytestmark = pytest.mark.usefixtures("kept_processes")

RANGE = (0.6, 0.85)


def clutch_diagram(**options):
    return diagram(case("13").at(frequency=0.85), "frequency", RANGE, **{"max_period": 4, "workers": 1, **options})


@pytest.fixture(scope="module")
def tree():
    return clutch_diagram()


def test_the_tree_of_figure_13b(tree):
    assert tree.complete
    assert [member.name for member in tree.members] == ["P1-1", "P2-1", "P4-1"]
    main, loop, quad = tree.members
    flips = [i for i, special in enumerate(main.branch.special_points) if special.kind is Kind.FLIP]
    assert (loop.begins, loop.joins) == (Origin("P1-1", flips[0]), Origin("P1-1", flips[1]))
    assert loop.branch.ends[-1].reason is EndReason.JOINED
    assert loop.branch.ends[-1].value == main.branch.special_points[flips[1]].value
    assert "P1-1, at its flip" in str(loop.branch.ends[-1])
    assert quad.begins.parent == quad.joins.parent == "P2-1"
    assert tree.children("P1-1") == (loop,)
    assert tree["P4-1"] is quad
    assert "1 of period 1, 1 of period 2, 1 of period 4" in repr(tree)


def test_no_orbit_is_on_two_branches(tree):
    for member in tree.members:
        for other in tree.members:
            if member is not other and member.period == other.period:
                assert not is_same(member.branch.points[3].orbit, other.branch.points[3].orbit)


def test_the_result_does_not_depend_on_the_number_of_processes(tree):
    other = clutch_diagram(workers=2)
    assert [(member.name, member.begins, member.joins) for member in other.members] == [
        (member.name, member.begins, member.joins) for member in tree.members
    ]
    for a, b in zip(tree.branches, other.branches, strict=True):
        assert np.array_equal(a.values, b.values)
        assert [special.value for special in a.special_points] == [special.value for special in b.special_points]


def test_a_stopped_diagram_goes_on_to_the_same_result(tree, tmp_path):
    def stop(partial, member):
        if member.name == "P2-1":
            raise KeyboardInterrupt

    path = tmp_path / "tree.gapwalk"
    partial = until_ctrl_c(clutch_diagram, report=stop, output=path)
    assert not partial.complete
    assert [member.name for member in partial.members] == ["P1-1", "P2-1"]
    rest = clutch_diagram(output=path)
    assert rest.complete
    assert [(member.name, member.begins, member.joins) for member in rest.members] == [
        (member.name, member.begins, member.joins) for member in tree.members
    ]
    assert np.array_equal(rest["P4-1"].branch.values, tree["P4-1"].branch.values)


def test_both_halves_of_a_broken_symmetry_are_branches():
    tree = diagram(symmetric(1.2), "frequency", (0.6, 1.2), max_period=1, workers=1)
    assert [member.begins.parent for member in tree.members[1:3]] == ["P1-1", "P1-1"]
    assert tree.members[1].begins == tree.members[2].begins
    means = [member.branch.points[5].measure("mean.x") for member in tree.members[1:3]]
    assert means[0] * means[1] < 0


def test_a_limit_is_kept_and_told(tree):
    few = diagram(
        case("13").at(frequency=0.85),
        "frequency",
        RANGE,
        max_period=4,
        max_branches=2,
        workers=1,
    )
    assert len(few.members) == 2
    assert not few.complete
    assert few.notes == ("stopped at max_branches = 2; there are more",)


def test_ratios_of_a_cascade():
    # intervals that shrink by Feigenbaum's number
    values = np.cumsum([0.0, *(4.669 ** -np.arange(4.0))])
    assert Cascade(("P1-1",), tuple(values)).ratios == pytest.approx([4.669] * 3)
    assert Diagram("frequency", RANGE).cascades == ()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_period": 0}, "max_period is 0; it must be an integer from 1 to 100,000"),
        ({"max_branches": 1.5}, "max_branches is 1.5"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ModelError, match=message):
        DiagramOptions(**options)


def test_a_range_without_the_start_is_refused():
    with pytest.raises(ModelError, match="outside the range"):
        diagram(case("13").at(frequency=1.9), "frequency", RANGE)
