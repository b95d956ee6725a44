"""Derivatives only where they are needed: a transition matrix of a large machine costs as much as many motions."""

import pickle
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

import gapwalk as gw
from gapwalk.flow.flow import Flow
from gapwalk.late_fields import LateFields, is_known, late
from gapwalk.orbit.shooting import ShootingEquation

SIZE = 16  # masses, from which derivatives count as dear


def walk():
    """Walk through two changes of friction and a graze; return the branch and its number of transition matrices."""
    stiffness = 16.0 * (2.0 * np.eye(SIZE) - np.eye(SIZE, k=1) - np.eye(SIZE, k=-1))
    names = [f"x{number}" for number in range(SIZE)]
    stop = gw.stop("stop", {names[-1]: 1.0}, 0.1105, 30.0, impact_damping=0.3)
    contacts = [stop, gw.friction("brake", {names[0]: 1.0}, 0.05)]
    loads = [gw.Harmonic(1.0, {names[-1]: 1.0})]
    system = gw.System(names, stiffness, 0.02 * stiffness, contacts=contacts, harmonics=loads, frequency=1.37)
    orbit = gw.find_orbit(system)
    before = Flow.matrices
    branch = gw.follow(orbit, "frequency", 1.4, walk=gw.WalkOptions(initial_step=0.05, largest_step=0.2))
    return branch, Flow.matrices - before


def test_fewer_matrices_and_equal_results(monkeypatch):
    found, matrices = walk()
    monkeypatch.setattr(ShootingEquation, "is_dear", False)
    plain, more = walk()
    assert matrices <= 38  # 36, of which two for each of 8 points
    assert more >= 1.7 * matrices
    assert len(found.points) == len(plain.points)
    for one, other in zip(found.points, plain.points, strict=True):
        assert np.allclose(one.orbit.state, other.orbit.state, rtol=1e-11, atol=1e-12)
        assert np.allclose(one.orbit.multipliers, other.orbit.multipliers, atol=1e-9)
    assert [str(each.kind) for each in found.special_points] == ["crossing-sliding", "crossing-sliding", "grazing"]
    pairs = [sorted(branch.special_points, key=lambda each: (each.kind, each.contact)) for branch in (found, plain)]
    for one, other in zip(*pairs, strict=True):
        assert abs(one.value - other.value) <= one.uncertainty + other.uncertainty < 1e-9
        assert (one.kind, one.contact, one.before, one.after) == (other.kind, other.contact, other.before, other.after)
        assert np.allclose(abs(one.orbit.multipliers), abs(other.orbit.multipliers), atol=1e-8)
        assert np.allclose(one.point.tangent, other.point.tangent, atol=1e-7)


@dataclass(frozen=True)
class Late(LateFields):
    _late: ClassVar[tuple[str, ...]] = ("square",)
    side: float
    square: float


def test_a_late_field_is_computed_once_and_kept_in_copies():
    asked = []
    record = Late(3.0, late(lambda: asked.append(1) or 9.0))
    assert not is_known(record, "square")
    assert not asked
    assert record.square == record.square == 9.0
    assert is_known(record, "square")
    assert len(asked) == 1
    assert replace(Late(3.0, late(lambda: 9.0)), side=2.0) == Late(2.0, 9.0)
    assert pickle.loads(pickle.dumps(Late(3.0, late(lambda: 9.0)))) == Late(3.0, 9.0)
    assert not hasattr(record, "cube")
