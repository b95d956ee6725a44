"""Walks with several friction elements on one deflection do not depend on the step, and say where the path decides."""

from __future__ import annotations

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.walk import EndReason
from tests.dry.several_elements import several_elements

ELEMENTS = {"a": (0.2248, 4.706), "b": (0.2816, 2.589), "c": (0.2948, 2.195)}


@pytest.fixture(scope="module")
def first():
    """Return a motion of an Iwan model in which two of three elements never slip."""
    iwan = gw.System(
        ["x"],
        [[0.9]],
        [[0.05]],
        mean={"x": 0.0559},
        frequency=0.7682,
        contacts=[
            gw.friction(name, {"x": 1.0}, limit, stiffness=stiffness) for name, (limit, stiffness) in ELEMENTS.items()
        ],
        harmonics=[gw.Harmonic(0.4308, {"x": 1.0}), gw.Harmonic(0.2991, {"x": 1.0}, 2, 0.4989)],
    )
    return gw.find_orbit(iwan)


@pytest.mark.parametrize(("end", "step"), [(3.2, None), (1.23, 0.05), (1.0, 0.013)])
def test_a_walk_ends_where_what_several_elements_keep_depends_on_the_path(first, end, step):
    """Right: from there on the largest deflection is off both positions by limit over stiffness."""
    walk = gw.WalkOptions() if step is None else gw.WalkOptions(largest_step=step)
    branch = gw.follow(first, "frequency", end, walk=walk)
    assert branch.ends[-1].reason is EndReason.GIVES_WAY
    assert "what b and c keep from here on depends on the path" in branch.ends[-1].reason_words
    assert [each.kind for each in branch.special_points] == [Kind.SLIP_ONSET]
    assert branch.ends[-1].value == branch.special_points[0].value == pytest.approx(0.830392447, abs=1e-9)
    orbit = branch.points[-1].orbit
    for place, name in enumerate("bc"):
        limit, stiffness = ELEMENTS[name]
        slider = orbit.state[0] - orbit.state[3 + place]
        assert orbit.measure("max.x") - slider == pytest.approx(limit / stiffness, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 108))
def test_walks_of_random_elements_do_not_depend_on_steps_or_signs(seed):
    system = several_elements(np.random.default_rng(seed))
    loads = [name for name in system.parameters if name.startswith("mean.") or name.endswith(".amplitude")]
    mirrored = system.at({name: -system[name] for name in loads})
    walks = [(system, gw.WalkOptions()), (system, gw.WalkOptions(largest_step=0.02)), (mirrored, gw.WalkOptions())]
    branches = [
        gw.follow(gw.find_orbit(each), "frequency", 1.3 * system["frequency"], walk=walk) for each, walk in walks
    ]
    points = [sorted((each.value, str(each.kind), each.uncertainty) for each in one.special_points) for one in branches]
    for branch, own in zip(branches, points, strict=True):
        assert branch.ends[-1].reason is branches[0].ends[-1].reason is not EndReason.STEP
        assert branch.ends[-1].value == pytest.approx(branches[0].ends[-1].value, abs=1e-8)
        assert len(own) == len(points[0])
        for (value, _, error), (expected, _, other) in zip(own, points[0], strict=True):
            assert abs(value - expected) <= error + other
