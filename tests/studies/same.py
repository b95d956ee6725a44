"""Whether two results are equal bit for bit, in everything that they hold."""

import json

import numpy as np

from gapwalk import Branch, Orbit, Result
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.isolated import SearchResult
from gapwalk.bifurcation.loci import Locus
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.results.codec import encode
from gapwalk.studies.bifurcation_map import Map


def assert_same_result(one: Result, other: Result) -> None:
    assert one.study == other.study
    assert one.complete == other.complete
    assert len(one.branches) == len(other.branches)
    for a, b in zip(one.branches, other.branches, strict=True):
        assert_same_branch(a, b)
    assert (one.diagram is None) == (other.diagram is None)
    if one.diagram is not None and other.diagram is not None:
        assert_same_tree(one.diagram, other.diagram)
    assert (one.map is None) == (other.map is None)
    if one.map is not None and other.map is not None:
        assert_same_map(one.map, other.map)
    assert (one.finding is None) == (other.finding is None)
    if one.finding is not None and other.finding is not None:
        assert json.dumps(one.finding.document(True)) == json.dumps(other.finding.document(True))


def assert_same_map(one: Map, other: Map) -> None:
    for name in ("first", "second", "within", "complete", "notes", "failures", "tried", "names"):
        assert getattr(one, name) == getattr(other, name)
    for a, b in zip(one.sections, other.sections, strict=True):
        assert a.value == b.value
        for branch, same in zip(a.branches, b.branches, strict=True):
            assert_same_branch(branch, same)
    for a, b in zip(one.loci, other.loci, strict=True):
        assert_same_locus(a, b)


def assert_same_locus(one: Locus, other: Locus) -> None:
    for name in ("kind", "first", "second", "period", "ends", "contact"):
        assert getattr(one, name) == getattr(other, name)
    for a, b in zip(one.codim2_points, other.codim2_points, strict=True):
        assert (a.kind, a.contact) == (b.kind, b.contact)
    points = [[*locus.points, *(codim2.point for codim2 in locus.codim2_points)] for locus in (one, other)]
    for a, b in zip(*points, strict=True):
        for name in ("values", "x", "tangent", "angle", "arclength"):
            assert_same(getattr(a, name), getattr(b, name))
        assert_same_orbit(a.orbit, b.orbit)


def assert_same_tree(one: Diagram, other: Diagram) -> None:
    for name in ("parameter", "within", "complete", "notes", "failures", "cascades"):
        assert getattr(one, name) == getattr(other, name)
    assert (one.search is None) == (other.search is None)
    if one.search is not None and other.search is not None:
        assert encode(one.search, SearchResult) == encode(other.search, SearchResult)
    for a, b in zip(one.members, other.members, strict=True):
        assert (a.name, a.begins, a.joins) == (b.name, b.begins, b.joins)
        assert_same_branch(a.branch, b.branch)


def assert_same_branch(one: Branch, other: Branch) -> None:
    assert (one.parameter, one.period, one.ends) == (other.parameter, other.period, other.ends)
    assert len(one.points) == len(other.points)
    for a, b in zip(one.points, other.points, strict=True):
        assert_same_point(a, b)
    assert len(one.special_points) == len(other.special_points)
    for a, b in zip(one.special_points, other.special_points, strict=True):
        assert (a.kind, a.before, a.after, a.contact, a.nature) == (b.kind, b.before, b.after, b.contact, b.nature)
        assert_same(a.uncertainty, b.uncertainty)
        assert_same(a.judged, b.judged)
        assert_same_point(a.point, b.point)


def assert_same_point(one: BranchPoint, other: BranchPoint) -> None:
    for name in ("value", "x", "tangent", "determinant", "arclength"):
        assert_same(getattr(one, name), getattr(other, name))
    assert_same_orbit(one.orbit, other.orbit)


def assert_same_orbit(one: Orbit, other: Orbit) -> None:
    assert one.system.structure == other.system.structure
    assert_same(one.system.values, other.system.values)
    assert (one.period, one.events, one.steps) == (other.period, other.events, other.steps)
    for name in ("state", "multipliers", "residual", "extremes"):
        assert_same(getattr(one, name), getattr(other, name))
    assert type(one) is type(other)
    if isinstance(one, BalancedOrbit) and isinstance(other, BalancedOrbit):
        assert_same(one.truncation, other.truncation)
        assert_same(one.series.lines, other.series.lines)
        assert_same(one.deflections.lines, other.deflections.lines)
        assert one.series.frequency == other.series.frequency


def assert_same(one, other) -> None:
    assert type(one) is type(other)
    one, other = np.asarray(one), np.asarray(other)
    assert (one.dtype, one.shape) == (other.dtype, other.shape)
    assert one.tobytes() == other.tobytes()
