"""Verification passes what is right, and finds each fault that is put into a result, at its place."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import VerificationError
from gapwalk.orbit.harmonic_balance import BalancedOrbit
from gapwalk.results.result_file import reading
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.map_study import MapStudyOptions
from gapwalk.studies.response_study import MOMENT, START, Moment, ResponseOptions
from gapwalk.studies.result import request_file
from gapwalk.verification import Check, Verification
from gapwalk.verification.dop853 import carry
from gapwalk.verification.independent_equations import Equations
from tests.independent import acceleration, integrate
from tests.results.again import again
from tests.sampled_verification import verified
from tests.studies.jobs import result_file
from tests.systems import clutch, linear, viscous_stop

LONG = gw.WalkOptions(largest_step=0.08)
"""Longer steps than by default: what is verified again after each change has fewer points."""


@pytest.fixture(scope="module")
def branch():
    """Of the clutch: a grazing point, flips, a fold and a second sheet."""
    return gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=0.6, walk=LONG)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """Some of it, with a flip, as a study with its file."""
    options = ResponseOptions("frequency", 0.85, 0.77, "half.q1", walk=LONG)
    path = tmp_path_factory.mktemp("verify") / "clutch.gapwalk"
    gw.run(gw.Study(clutch(frequency=0.85), options), path)
    return path


def change(branch, number, **changes):
    """The branch with one other point."""
    points = list(branch.points)
    points[number] = replace(points[number], memo={}, **changes)
    return replace(branch, points=tuple(points))


def with_special(branch, number, special):
    points = list(branch.special_points)
    points[number : number + 1] = [] if special is None else [special]
    return replace(branch, special_points=tuple(points))


def place(branch, kind):
    return next(index for index, each in enumerate(branch.special_points) if each.kind == kind)


def failed(verification):
    return {(each.check.word, each.spot.item) for each in verification.breaches}


def test_what_was_walked_verifies(branch):
    found = gw.verify(branch)
    assert found.ok, found.words
    kinds = {each.kind.value for each in branch.special_points}
    assert {"fold", "flip", "grazing"} <= kinds
    assert found.points == len(branch.points)
    assert found.special_points == len(branch.special_points)
    words = {summary.check.word: summary.count for summary in found.summaries}
    assert words["closure"] == words["multipliers"] == len(branch.points) + len(branch.special_points)
    assert words["gaps"] == words["counts"] == len(branch.points) - 1
    assert words["sides"] == words["location"] == len(branch.special_points)
    assert again(found) == found


def test_follow_verifies_on_request(branch):
    start = gw.find_orbit(clutch(frequency=0.85))
    assert len(gw.follow(start, "frequency", to=0.8, verify=True).points) > 2


def test_follow_raises_where_a_check_fails(monkeypatch):
    monkeypatch.setattr(
        "gapwalk.verification.verify_branch.unexplained", lambda a, b, special, joining: ["something has changed"]
    )
    with pytest.raises(VerificationError, match=r"points 0 to 1.*something has changed") as error:
        gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=0.84, verify=True)
    assert isinstance(error.value.verification, Verification)


@pytest.mark.parametrize("system", [clutch(), viscous_stop(), linear()])
def test_the_second_equations_are_those_of_the_definition(system):
    random = np.random.default_rng(2)
    n, equations = system.size, Equations([system])
    for _ in range(20):
        q, v, theta = random.normal(size=n), random.normal(size=n), random.uniform(0, 6)
        depths = equations.depths(equations.deflections(np.array([theta]), q[None]))
        rates = equations.rates(np.array([theta]), np.array([[*q, *v, 0.0]]), (depths > 0).astype(float))[0]
        expected = acceleration(system, theta / system.frequency, q, v)
        assert rates[:n] * system.frequency == pytest.approx(v)
        assert rates[n : 2 * n] * system.frequency == pytest.approx(expected, abs=1e-12)


def test_the_other_integrator_agrees_with_scipy():
    orbit = gw.find_orbit(clutch(frequency=0.9))
    shifted = replace(orbit, state=orbit.state + np.array([1e-4, 0.0, 0.0, 0.0]))
    (around,) = carry([shifted])
    gap = np.abs(integrate(orbit.system, shifted.state) - shifted.state)
    sizes = np.abs(orbit.motion().q).max(), np.abs(orbit.motion().v).max()
    # its events are those of the orbit beside it, so it is good to the square of the shift
    assert around.closure == pytest.approx((gap / np.repeat(sizes, 2)).max(), rel=2e-3)
    (around,) = carry([orbit])
    assert around.closure < 1e-10
    assert around.extremes == pytest.approx(orbit.extremes[:, :2], abs=1e-9)


def test_volumes_shrink_as_a_quadrature_says():
    orbit = gw.find_orbit(clutch(frequency=0.6))
    (around,) = carry([orbit])
    motion = orbit.motion(4096)
    beta, rigid = 0.05, np.trace(orbit.system.matrix("damping"))
    push = orbit.system.vector("stage2.force") @ orbit.system.vector("stage2.deflection")
    depth = np.maximum(np.abs(motion.deflections[:, 0]) - 1.0, 0.0)
    expected = -np.trapezoid(rigid + push * beta * depth, motion.time)
    assert around.contraction == pytest.approx(expected, rel=1e-6)
    assert around.contraction == pytest.approx(np.log(abs(np.prod(orbit.multipliers))), rel=1e-9)


def test_a_shifted_state_is_found(branch):
    point = branch.points[10]
    shifted = replace(point.orbit, state=point.orbit.state + np.array([1e-6, 0.0, 0.0, 0.0]))
    found = gw.verify(change(branch, 10, orbit=shifted))
    assert {("record", "point 10"), ("closure", "point 10")} <= failed(found)
    assert {item for _, item in failed(found)} == {"point 10"}


def test_a_dropped_special_point_is_found(branch):
    for kind in ("fold", "flip", "grazing"):
        index = place(branch, kind)
        special = branch.special_points[index]
        found = verified(with_special(branch, index, None), 2)
        assert {check for check, _ in failed(found)} == {"counts"}, kind
        (breach,) = found.breaches
        first = int(breach.spot.item.split()[1])
        assert branch.points[first].arclength < special.point.arclength < branch.points[first + 1].arclength


def test_a_special_point_that_was_moved_is_found(branch):
    index = place(branch, "flip")
    special = branch.special_points[index]
    beside = gw.find_orbit(special.orbit.system, 1, special.orbit.state, frequency=special.value + 1e-6)
    x = special.point.x.copy()  # an exact orbit, well recorded, but 1e-6 from the flip
    x[:-1] *= beside.state / special.orbit.state
    x[-1] *= (special.value + 1e-6) / special.value
    moved = replace(special.point, value=special.value + 1e-6, orbit=beside, x=x, memo={})
    found = verified(with_special(branch, index, replace(special, point=moved)), 2)
    assert failed(found) == {("location", f"special point {index} (flip)")}
    assert "1e-06 away" in found.breaches[0].detail


@pytest.mark.slow
def test_what_could_not_be_located_a_second_time_is_told(branch):
    index = place(branch, "flip")
    unknown = replace(branch.special_points[index], uncertainty=math.inf)
    found = gw.verify(with_special(branch, index, unknown))
    assert found.ok
    counts = {summary.check.word: summary.count for summary in found.summaries}
    assert counts["location"] == len(branch.special_points) - 1
    (note,) = found.notes
    assert note.startswith("the location of one special point could not be computed a second time")
    assert f"special point {index} (flip)" in note
    assert gw.verify(branch).notes == ()


def test_the_wrong_kind_is_found(branch):
    index = place(branch, "grazing")
    special = replace(branch.special_points[index], kind=gw.Kind.FLIP, contact="")
    found = verified(with_special(branch, index, special), 2)
    assert ("sides", f"special point {index} (flip)") in failed(found)


def test_a_turned_stability_label_is_found(branch):
    number = next(i for i, point in enumerate(branch.points) if not point.stable and i)
    orbit = branch.points[number].orbit
    found = gw.verify(change(branch, number, orbit=replace(orbit, multipliers=0.5 * orbit.multipliers)))
    assert {("multipliers", f"point {number}"), ("stability", f"point {number}")} <= failed(found)
    assert "0 are stored" in next(each.detail for each in found.breaches if each.check is Check.STABILITY)
    assert any(check == "counts" for check, _ in failed(found))


def test_points_of_two_branches_that_were_swapped_are_found(branch):
    # both sheets of the resonance, at nearly one frequency
    fold = branch.special_points[place(branch, "fold")]
    above = [i for i, point in enumerate(branch.points) if point.arclength > fold.point.arclength + 0.1]
    below = [i for i, point in enumerate(branch.points) if point.arclength < fold.point.arclength - 0.1]
    a, b = min(
        ((a, b) for a in above for b in below),
        key=lambda pair: abs(branch.points[pair[0]].value - branch.points[pair[1]].value),
    )
    points = list(branch.points)
    points[a] = replace(branch.points[b], arclength=branch.points[a].arclength)
    points[b] = replace(branch.points[a], arclength=branch.points[b].arclength)
    found = gw.verify(replace(branch, points=tuple(points)))
    gaps = {item for check, item in failed(found) if check == "gaps"}
    assert {f"points {i} to {i + 1}" for i in (a - 1, a, b - 1, b)} == gaps


def test_a_missing_contact_event_is_found(branch):
    number = next(i for i, point in enumerate(branch.points) if len(point.orbit.events) >= 4)
    orbit = branch.points[number].orbit
    found = gw.verify(change(branch, number, orbit=replace(orbit, events=orbit.events[2:])))
    assert ("stages", f"point {number}") in failed(found)


def test_balanced_branches_verify_with_their_truncation():
    system = clutch(frequency=1.0)
    method = gw.Balance(20)
    found = gw.follow(gw.find_orbit(system, method=method), "frequency", to=0.75, method=method, walk=LONG)
    verification = gw.verify(found)
    assert verification.ok, verification.words
    assert {"lines", "truth", "location"} <= {summary.check.word for summary in verification.summaries}
    orbit = found.points[3].orbit
    assert isinstance(orbit, BalancedOrbit)
    lines = orbit.series.lines.copy()
    lines[0, 2] += 1e-4
    broken = replace(orbit, series=replace(orbit.series, lines=lines))
    assert ("lines", "point 3") in failed(gw.verify(change(found, 3, orbit=broken)))


@pytest.mark.slow
def test_where_branches_are_attached_is_verified():
    tree = gw.diagram(clutch(frequency=0.85), "frequency", (0.64, 0.85), max_period=2, workers=1, walk=LONG)
    found = gw.verify(tree)
    assert found.ok, found.words
    assert found.worst("tree").size < 1e-8
    member = next(member for member in tree.members if member.begins is not None)
    assert member.begins is not None
    other = next(i for i, each in enumerate(tree["P1-1"].branch.special_points) if each.kind == "grazing")
    wrong = replace(member, begins=replace(member.begins, special=other))
    members = tuple(wrong if each is member else each for each in tree.members)
    broken = gw.verify(replace(tree, members=members))
    assert ("tree", "point 0") in failed(broken)
    assert {each.spot.branch for each in broken.breaches} == {member.name}


def test_stated_errors_hold_against_references():
    # W of figure 13 from two other codes, see tests/data/special_points.json
    references = {"flip": (0.7985333253591016, 0.6540474815867466), "fold": (0.6395989875855578, 0.6190975482292904)}
    found = gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=(0.6, 0.85))
    for kind, values in references.items():
        for value in values:
            special = min(found.special(kind), key=lambda each: abs(each.value - value))
            assert abs(special.value - value) <= special.uncertainty < 1e-11


def test_the_stated_error_of_a_balanced_point_is_that_of_its_truncation(branch):
    exact = {each.kind: each.value for each in branch.special_points if each.value > 0.7}
    errors = []
    for harmonics in (8, 16, 32):
        method = gw.Balance(harmonics, error=1e-1)
        found = gw.follow(gw.find_orbit(clutch(frequency=0.85), method=method), "frequency", to=0.75, method=method)
        special = found.special("flip")[0]
        off = abs(special.value - exact[special.kind])
        assert off <= special.uncertainty
        assert special.uncertainty <= 1e3 * off
        errors.append(special.uncertainty)
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


def rewrite(path, branch):
    """Store another branch in place of the one in a result file, as a damaged program might have."""
    study = gw.open_result(path).study
    with reading(path) as parts:
        parts.base = study.system
        start = parts.one(START)
    with request_file(study, path) as file:
        moment = Moment(branch.points, branch.special_points, ends=branch.ends)
        file.write(START.entry(start), MOMENT.entry(moment, 0))


@pytest.mark.slow
def test_the_command_passes_what_is_right(result, capsys):
    assert main(["verify", str(result)]) == 0
    out = capsys.readouterr().out
    assert "checks passed" in out
    assert "closure" in out
    assert main(["verify", str(result), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ok"] is True


def test_the_command_has_an_exit_code_of_its_own_for_faults(result, tmp_path, capsys):
    branch = gw.open_result(result).branches[0]
    path = tmp_path / "broken.gapwalk"
    point = branch.points[7]
    shifted = replace(point.orbit, state=point.orbit.state + np.array([0.0, 1e-6, 0.0, 0.0]))
    shifted.__dict__["extremes"] = point.orbit.extremes
    index = place(branch, "flip")
    faults = {
        "closure: P1-1, point 7,": change(branch, 7, orbit=shifted),
        "counts: P1-1, points": with_special(branch, index, None),
    }
    for (words, broken), options in zip(faults.items(), ([], ["--json"]), strict=True):
        path.write_bytes(result.read_bytes())
        rewrite(path, broken)
        assert main(["verify", str(path), *options]) == 5
        text = capsys.readouterr().out
        if options:
            document = json.loads(text)
            assert document["ok"] is False
            assert document["breaches"]
            assert words.partition(":")[0] in text
        else:
            assert words in text


def test_a_result_without_branches_says_what_can_be_verified(tmp_path, capsys):
    (path := tmp_path / "x.gapwalk").write_bytes(result_file("settle"))
    assert main(["verify", str(path)]) == 2
    assert "responses, diagrams, maps, families, tori, thresholds and self-excited motions" in capsys.readouterr().err


def test_a_study_verifies_itself_and_keeps_what_it_found(tmp_path):
    options = ResponseOptions("frequency", 0.85, 0.83, "half.q1", verify=True)
    path = tmp_path / "clutch.gapwalk"
    found = gw.run(gw.Study(clutch(frequency=0.85), options), path)
    assert found.verification is not None
    assert found.verification.ok
    assert gw.open_result(path).verification == found.verification
    # one that did not ask is verified by a later run that does, without a walk
    path.unlink()
    gw.run(gw.Study(clutch(frequency=0.85), replace(options, verify=False)), path)
    assert gw.open_result(path).verification is None
    assert gw.run(gw.Study(clutch(frequency=0.85), options), path, resume=True).verification == found.verification


def test_loci_are_shot_again():
    flip = gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=0.75).special("flip")[0]
    locus = gw.follow_locus(flip, "frequency", "stage2.clearance", ((0.7, 0.9), (0.9, 1.1)))
    chart = Map("frequency", "stage2.clearance", ((0.7, 0.9), (0.9, 1.1)), (locus,))
    found = gw.verify(chart)
    assert found.ok, found.words
    assert found.worst("condition").size < 1e-7
    points = list(locus.points)
    orbit = points[0].orbit
    points[0] = replace(
        points[0], orbit=gw.find_orbit(orbit.system, 1, orbit.state, frequency=points[0].values[0] + 1e-3)
    )
    broken = gw.verify(replace(chart, loci=(replace(locus, points=tuple(points)),)))
    assert failed(broken) == {("condition", "point 0")}


def test_scipy_needs_no_other_events():
    """A motion that is integrated with events found by SciPy passes its breakpoints where the orbit says."""
    orbit = gw.find_orbit(clutch(frequency=0.9))
    system, n = orbit.system, orbit.system.size

    def rates(t, y):
        return np.concatenate((y[n:], acceleration(system, t, y[:n], y[n:])))

    def passes(t, y):
        return abs(y[0]) - 1.0

    found = solve_ivp(
        rates, (0, 2 * np.pi / 0.9), orbit.state, "DOP853", rtol=1e-10, atol=1e-12, max_step=0.02, events=passes
    )
    assert found.t_events[0] * 0.9 == pytest.approx([event.theta for event in orbit.events], abs=1e-6)


@pytest.mark.slow
def test_a_resumed_map_is_verified_if_the_study_now_wants_it(tmp_path, monkeypatch):
    second = gw.studies.ParameterRange("mean.q1", 0.25, 0.26)
    options = MapStudyOptions(
        "frequency", 0.85, 0.79, "half.q1", second=second, sections=(0.25,), max_period=1, workers=1
    )
    path = tmp_path / "map.gapwalk"
    gw.run(gw.Study(clutch(frequency=0.85), options), path)
    study = gw.Study(clutch(frequency=0.85), replace(options, verify=True))

    def stop(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as stopped:
        stopped.setattr("gapwalk.studies.verify.verify", stop)
        with pytest.raises(KeyboardInterrupt, match="complete, but it is not verified"):
            gw.run(study, path, resume=True)
    assert gw.open_result(path).verification is None
    found = gw.run(study, path, resume=True).verification
    assert found is not None
    assert found == gw.open_result(path).verification
