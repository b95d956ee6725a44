"""Results compared: what counts as the same, and how differences are told."""

from dataclasses import replace

import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.studies.compare import comparison_document
from gapwalk.studies.response_study import ResponseOptions
from tests.studies.diagrams import clutch_loop
from tests.studies.maps import resonance
from tests.studies.studies import stop_study


@pytest.fixture(scope="module")
def stop() -> gw.Result:
    return gw.run(stop_study())


@pytest.fixture(scope="module")
def tree() -> gw.Result:
    return clutch_loop()


def test_a_result_agrees_with_itself_and_with_finer_steps(stop) -> None:
    comparison = gw.studies.compare_results(stop, stop)
    assert comparison.largest < 1e-5  # points that are nearer than 1e-4 to the one before are no knots of the spline
    assert comparison.largest_shift == 0.0
    assert comparison.pairs[0].missing == 0.0
    assert comparison.within(1e-5)
    finer = gw.studies.compare_results(stop, gw.run(stop_study(largest_step=0.004)))
    assert finer.within(1e-3)
    assert finer.largest_shift < 1e-9


def test_walked_backwards_it_is_the_same(stop) -> None:
    study = stop_study()
    options = replace(study.options, begin=1.9, end=0.7)
    back = gw.run(replace(study, system=study.system.at(frequency=1.9), options=options))
    assert gw.studies.compare_results(stop, back).within(1e-3)


def test_a_walk_that_ends_early_does_not_agree(stop) -> None:
    """A walk that turned round would look right wherever it has been."""
    comparison = gw.studies.compare_results(stop, gw.run(stop_study(end=1.6)))
    (pair,) = comparison.pairs
    assert pair.missing == pytest.approx(0.3 / 1.2)
    assert pair.covered == ((0.7, 1.9), (0.7, 1.6))
    assert pair.largest < 1e-3
    assert not comparison.within(1e-3)
    assert comparison.within(0.3)
    assert "cover frequency from 0.7 to 1.9 and from 0.7 to 1.6" in str(comparison)


def test_another_clearance_is_another_result(stop) -> None:
    comparison = gw.studies.compare_results(stop, gw.run(stop_study(**{"stop.clearance": 1.01})))
    assert comparison.notes == ("stop.clearance is 1 in the first and 1.01 in the second",)
    assert 1e-3 < comparison.largest_shift < 0.05
    assert not comparison.within(1e-3)
    shift = comparison.pairs[0].shifts[0]
    assert shift.label == "grazing stop +"
    assert shift.share == pytest.approx(abs(shift.differences[0]) / 1.2)


def test_what_one_has_alone_is_named(stop) -> None:
    (branch,) = stop.branches
    fold, *rest = branch.special_points[1:]
    poorer = replace(stop, branches=(replace(branch, special_points=(branch.special_points[0], *rest)),))
    comparison = gw.studies.compare_results(stop, poorer)
    ((alone,), none) = comparison.pairs[0].only
    assert (alone.label, alone.values) == (fold.kind.value, (fold.value,))
    assert none == ()
    assert not comparison.within(1.0)
    assert f"only in the first: {fold.kind.value} at frequency" in str(comparison)


def test_the_branches_of_diagrams_are_paired_by_where_they_run(tree) -> None:
    members = tree.diagram.members
    shuffled = replace(tree.diagram, members=(members[0], members[2], members[1]))
    other = replace(tree, diagram=shuffled, branches=shuffled.branches)
    comparison = gw.studies.compare_results(tree, other)
    assert [pair.names for pair in comparison.pairs] == [("P1-1", "P1-1"), ("P2-1", "P2-1"), ("P4-1", "P4-1")]
    assert comparison.within(1e-4)
    pruned = replace(tree.diagram, members=members[:2])
    comparison = gw.studies.compare_results(tree, replace(tree, diagram=pruned, branches=pruned.branches))
    assert [pair.names for pair in comparison.pairs] == [("P1-1", "P1-1"), ("P2-1", "P2-1")]
    assert comparison.only == (("P4-1",), ())
    assert not comparison.within(1.0)
    assert "only in the first: P4-1" in str(comparison)


def test_maps_are_compared_by_their_loci_and_sections() -> None:
    chart = resonance()
    comparison = gw.studies.compare_results(chart, chart)
    assert comparison.within(1e-4)
    assert comparison.parameters == ("frequency", chart.map.second)
    assert [pair.names for pair in comparison.pairs] == [(n, n) for n in (*chart.map.names, *chart.names)]
    less = replace(chart, map=replace(chart.map, loci=chart.map.loci[1:]))
    assert gw.studies.compare_results(chart, less).only[0] == (chart.map.names[0],)
    moved = chart.map.loci[0]
    points = tuple(replace(p, values=(p.values[0] + 1e-3, p.values[1])) for p in moved.points)
    other = replace(chart, map=replace(chart.map, loci=(replace(moved, points=points), *chart.map.loci[1:])))
    assert 1e-4 < gw.studies.compare_results(chart, other).pairs[0].largest < 1e-3 / comparison.ranges[0] * 1.01


def test_what_cannot_be_compared_is_told(stop, tree) -> None:
    options = ResponseOptions("stop.clearance", 1.0, 0.9, "half.x")
    other = gw.run(gw.Study(stop.system.at(frequency=1.0), options))
    with pytest.raises(ModelError, match=r"the results are over frequency and stop\.clearance"):
        gw.studies.compare_results(stop, other)
    with pytest.raises(ModelError, match="the coordinates of one result are x, those of the other q1, q3"):
        gw.studies.compare_results(stop, tree)
    with pytest.raises(
        ModelError, match="the second result is of the kind response and has neither branches nor a map of cells"
    ):
        gw.studies.compare_results(stop, replace(stop, branches=()))


def test_branches_without_a_common_range_are_no_pair(stop) -> None:
    low = gw.run(stop_study(end=0.75))
    options = replace(stop.options, begin=1.0, end=1.05)
    high = gw.run(gw.Study(stop.system.at(frequency=1.0), options))
    comparison = gw.studies.compare_results(low, high)
    assert (comparison.pairs, comparison.only) == ((), (("P1-1",), ("P1-1",)))
    assert not comparison.within(1.0)


def test_the_document_says_the_same(stop) -> None:
    comparison = gw.studies.compare_results(stop, gw.run(stop_study(end=1.6)))
    document = comparison_document(comparison, 1e-3)
    assert document["agree"] is False
    assert document["methods"] == ["shooting", "shooting"]
    assert document["pairs"][0]["covered"] == [[0.7, 1.9], [0.7, 1.6]]
    assert document["largest_shift"] == comparison.largest_shift
    assert len(document["pairs"][0]["special_points"]) == 4
