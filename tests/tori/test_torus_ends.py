"""Ends of families of tori where they shrink, against the Neimark-Sacker points of the branches of their orbits."""

from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.continuation.corrector import check_range
from gapwalk.tori.torus_equation import TorusOptions
from gapwalk.tori.torus_family import TorusEndReason, TorusEventKind
from gapwalk.tori.torus_start import starts_at, torus_at
from gapwalk.tori.torus_tracer import halved, vanished


def neimark_sacker(case, start, to):
    branch = gw.follow(start, "frequency", to)
    return sorted(branch.special(gw.Kind.NEIMARK_SACKER), key=lambda each: each.value)


def test_a_small_torus_shrinks_to_the_point_at_which_it_is_born():
    case = gw.paper.case("13")
    (born,) = neimark_sacker(case, gw.find_orbit(case, 2, frequency=1.23), (1.19, 1.26))
    within = check_range(born.value, (1.1, 1.3)).along("frequency", case)
    (start,) = starts_at(born, "frequency", within, TorusOptions(), gw.WalkOptions(initial_step=2.5e-4), False)
    first = replace(start.first, tangent=-start.first.tangent, memo={})
    last = halved(first, start.corrector)
    assert last is not None
    end = vanished(first, last, "frequency")
    assert end is not None
    assert end.reason is TorusEndReason.SHRINKS
    assert end.value == pytest.approx(born.value, abs=1e-11)
    assert end.rotation == pytest.approx(start.end.rotation, abs=1e-10)
    # the parameter and the rotation number change with the square of the size
    sizes = [torus_at(each).size for each in (first, last)]
    assert sizes[1] == pytest.approx(sizes[0] / 2.0, rel=0.01)
    for value, place in ((end.value, lambda each: each.value), (end.rotation, lambda each: torus_at(each).rotation)):
        assert (place(first) - value) / (place(last) - value) == pytest.approx(4.0, abs=0.05)
    # where a walk fails although its tori grow, they do not shrink
    assert halved(start.first, start.corrector) is None
    # nor do they end at a point to which neither of both changes leads
    moved = replace(first, x=first.x + (last.x - first.x) * 0.9, memo={})
    assert vanished(replace(moved, value=0.1 * first.value + 0.9 * last.value), last, "frequency") is None


@pytest.mark.slow
def test_both_ends_of_the_family_of_figure_13_are_named():
    """At the upper end it turns back 2e-7 beyond its point: a contact grazes along tori down to a size of 3e-5."""
    case = gw.paper.case("13")
    torus = gw.tori.find_torus(gw.settle(case, frequency=0.672))
    family = gw.tori.follow_tori(torus, "frequency", (0.66, 0.68))
    orbit = gw.find_orbit(case, 2, family.points[0].torus.states.mean(axis=0), frequency=family.points[0].value)
    born = neimark_sacker(case, orbit, (0.665, 0.68))
    assert [end.reason for end in family.ends] == [TorusEndReason.SHRINKS] * 2
    assert [end.value for end in family.ends] == pytest.approx([each.value for each in born], abs=1e-10)
    turns = [abs(np.angle(each.multiplier)) / (2.0 * np.pi) for each in born]
    assert [end.rotation for end in family.ends] == pytest.approx(turns, abs=1e-8)
    folds = [each for each in family.events if each.kind is TorusEventKind.FOLD]
    assert born[1].value < folds[-1].value < born[1].value + 3e-7
    assert not family.points[-1].torus.grazes
