"""The search: what it must find without being told where, that it repeats itself, what it says it may have missed."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gapwalk.bifurcation import follow
from gapwalk.bifurcation.isolated import SearchOptions, coverage, next_is_new, search, unseen_share
from gapwalk.bifurcation.isolated.search_starts import (
    Catalogue,
    Deflation,
    Settler,
    exact_orbit,
    newton_aside,
    search_chunk,
    spread_starts,
    state_box,
)
from gapwalk.bifurcation.orbit_on_branch import Curve, lies_on
from gapwalk.bifurcation.special_point import Kind
from gapwalk.continuation import EndReason
from gapwalk.errors import ModelError
from gapwalk.flow.flow import Flow
from gapwalk.model import System
from gapwalk.orbit import ShootingEquation, find_orbit
from gapwalk.orbit.orbit import stroboscopic
from gapwalk.paper import case
from gapwalk.parallel.workers import local_workers
from tests.computed import paper_response
from tests.interruption import until_ctrl_c
from tests.systems import backlash_oscillator, clutch, linear, viscous_stop
from tests.tiers import in_campaign, some_of

AMPLITUDE = "harmonic1.amplitude"
ALL, FEW = (-1.0, *np.linspace(-1.0, 1.0, 11).tolist()), (0.4, 0.5, 0.58)
"""The least amplitude of the main branch of figure 27, and amplitudes at which isolated ones are searched."""
QUICK = SearchOptions(starts=32, newton_starts=16, newton_periods=(1, 2, 3))


def isolated(found, parameter, to, known=()):
    """The branches through orbits of a search that lie on no known branch, each followed once."""
    curves, branches = [Curve(branch) for branch in known if branch.parameter == parameter], []
    for each in sorted(found, key=lambda f: (not f.orbit.stable, -f.hits_settled, f.orbit.period)):
        if not any(curve.holds(each.orbit) for curve in curves):
            branches.append(follow(each.orbit, parameter, to))
            curves.append(Curve(branches[-1]))
    return branches


def span(branch) -> list[float]:
    return [float(branch.values.min()), float(branch.values.max())]


def main_branch(figure: str, parameter: str, low: float, high: float):
    return follow(find_orbit(case(figure), at={parameter: high}), parameter, to=(low, high))


# What must be found


@cache
def searched(low: float, *values: float):
    """Branches of period 1 of figure 27 from an amplitude up to 1, with the search at values that led to them."""
    before = Flow.calls
    main = main_branch("27", AMPLITUDE, low, 1.0)
    result = search(case("27"), AMPLITUDE, values, known=[main])
    new = [found for found in result.new if found.orbit.period == 1]
    islands = isolated(new, AMPLITUDE, (low, 1.0), known=[main])
    return main, result, islands, Flow.calls - before


@pytest.fixture
def figure_27():
    return searched(*FEW)


@pytest.mark.slow
@pytest.mark.parametrize(("values", "most"), [(FEW, 7_000), in_campaign(ALL, 15_000)])
def test_the_work_for_figure_27_does_not_grow(values, most):
    """With the default options, from nothing but the model: some seconds, counted in flow calls and not by a clock."""
    main, _, islands, calls = searched(*values)
    special = [each for branch in (main, *islands) for each in branch.special_points]
    grazes = sum(each.kind is Kind.GRAZING for each in special)
    # the rounding of each special point takes 6 calls, at a graze 6 more
    assert calls < most + 6 * len(special) + 6 * grazes


@pytest.mark.parametrize("values", [FEW, in_campaign(ALL)])
def test_both_isolated_loops_of_figure_27(values):
    """And the mirror image of the smaller: a negative amplitude is a phase of 180 degrees, half a period later."""
    main, _, islands, _ = searched(*values)
    assert span(main) == [values[0], 1.0]
    assert all(branch.closed for branch in islands)
    expected = [(-0.6023, -0.4840), (-0.2614, 0.2614), (0.4840, 0.6023)][-1 if values == FEW else 0 :]
    assert sorted(span(branch) for branch in islands) == [pytest.approx(ends, abs=2e-4) for ends in expected]
    patterns = {point.orbit.pattern for branch in islands for point in branch.points}
    assert ("2+/2-" if values == ALL else "2+/1-") in patterns


@pytest.mark.slow
def test_what_lies_on_a_known_branch_is_not_new(figure_27):
    main, result, islands, _ = figure_27
    known = Curve(main)
    for found in result.found:
        assert found.is_new is not known.holds(found.orbit)
        assert found.branch in (None, 0)
    assert all(found.orbit.period == 1 for found in result.found if not found.is_new)
    # with the islands known too, nothing is new at a value between those searched
    everything = [find_branch_along_another_parameter(), main, *islands]
    again = search(case("27"), AMPLITUDE, [0.54], known=everything, options=QUICK)
    assert len(again.found) >= 2
    assert again.new == ()
    assert Counter(found.branch for found in again.found)[1] == 1
    assert isolated(again.found, AMPLITUDE, (-1.0, 1.0), known=everything) == []


def find_branch_along_another_parameter():
    return follow(find_orbit(clutch(frequency=1.8)), "frequency", to=1.7)


def test_every_orbit_found_is_one_with_its_true_period(figure_27):
    _, result, *_ = figure_27
    for found in result.found:
        states = stroboscopic(found.orbit)
        distances = np.abs(states[1:] - states[0]).max(axis=1)
        assert found.orbit.residual < 1e-9
        assert np.all(distances > 1e-6)
        assert found.orbit.system[AMPLITUDE] == found.value
        assert found.hits_settled == 0 or found.orbit.stable
    for value in result.values:
        at = result.at(value)
        for number, found in enumerate(at):
            assert not any(
                np.abs(stroboscopic(found.orbit) - o.orbit.state).max(axis=1).min() < 1e-6 for o in at[:number]
            )


@pytest.mark.slow
def test_the_islands_of_figure_28_have_grown():
    main = main_branch("28", AMPLITUDE, -1.0, 1.0)
    result = search(case("28"), AMPLITUDE, [0.2, 0.6], known=[main], options=replace(QUICK, starts=48, patience=100))
    new = [found for found in result.new if found.orbit.period == 1]
    islands = isolated(new, AMPLITUDE, (-1.0, 1.0), known=[main])
    large, small = sorted((span(branch) for branch in islands), key=lambda ends: ends[0])
    assert large == pytest.approx([-0.3725, 0.3725], abs=2e-4)
    assert small == pytest.approx([0.4278, 0.6201], abs=2e-4)


@pytest.fixture(scope="module")
def figure_15():
    return search(case("15"), "frequency", [0.45, 0.8], options=QUICK)


@pytest.mark.slow
def test_the_motions_of_period_3_of_figure_15(figure_15):
    result = figure_15
    threes = [found for found in result.found if found.orbit.period == 3]
    assert {(found.value, found.orbit.stable) for found in threes} >= {(0.45, True), (0.45, False), (0.8, True)}
    islands = isolated(threes, "frequency", (0.15, 1.9))
    assert all(branch.ends[-1].reason is EndReason.CLOSED for branch in islands)
    lower = next(branch for branch in islands if span(branch)[0] < 0.45 < span(branch)[1])
    upper = next(branch for branch in islands if span(branch)[0] < 0.8 < span(branch)[1])
    assert span(lower)[0] < 0.44
    assert span(lower)[1] > 0.46
    assert span(upper) == pytest.approx([0.7724, 0.9042], abs=2e-4)


@pytest.mark.slow
def test_settling_agrees_with_a_basin_that_another_code_has_drawn():
    """1,500 periods of a hand-written fixed-step integrator: 123 cells of 32 x 32 lead to period 1, the rest to 3."""
    system = case("15").at(frequency=0.45)
    settler = Settler(system, Catalogue(state_box(system)), periods=8, patience=400)
    grid = np.linspace(-4.0, 4.0, 32)
    entries = [settler.settle(np.array([q1, 0.0, v1, 0.0])).entry for q1 in grid for v1 in grid]
    assert Counter(entry and entry.orbit.period for entry in entries) == {1: 123, 3: 901}


# Settling


def test_a_transient_that_dies_away_slowly_is_waited_for():
    system = linear(damping=0.01)
    settler = Settler(system, Catalogue(state_box(system)), periods=4, patience=100)
    settling = settler.settle(0.9 * state_box(system))
    assert settling.entry is not None
    assert len(settling.path) > 300
    exact = find_orbit(system, start="rest")
    assert settling.entry.orbit.state == pytest.approx(exact.state, abs=1e-8)


def test_the_least_patience_goes_with_the_longest_periods():
    options = SearchOptions(starts=3, newton_starts=0, patience=16, periods=16)
    (found,) = search(clutch(), "frequency", [1.8], options=options).found
    assert found.orbit.stable


def test_motions_that_never_become_periodic_are_counted_and_kept():
    """At W = 0.85 every start of the figure-15 system leads to a torus."""
    options = SearchOptions(starts=12, newton_starts=6, patience=100)
    result = search(case("15"), "frequency", [0.85], options=options)
    tally = result.tallies[0]
    assert (tally.starts, tally.settled, tally.ran_away) == (12, 0, 0)
    assert tally.unsettled.shape == (12, 4)
    assert np.all(np.abs(tally.unsettled) < tally.box)
    assert result.found
    assert not any(found.orbit.stable for found in result.found)
    text = " ".join(coverage(result))
    assert "12 motions did not become periodic" in text
    assert "nothing can be said" in text


@pytest.mark.parametrize("system", [linear(), viscous_stop(1.6), clutch(frequency=1.8)])
def test_where_there_is_one_motion_every_start_leads_to_it(system):
    result = search(system, "frequency", [system.frequency], options=SearchOptions(starts=16, newton_starts=4))
    (found,) = result.found
    assert found.hits_settled == 16
    assert lies_on(follow(find_orbit(system), "frequency", to=0.95 * system.frequency), found.orbit)


def test_families_of_motions_without_damping_do_not_keep_it_going_for_ever():
    options = SearchOptions(starts=4, newton_starts=2, patience=32, newton_periods=(1, 2))
    result = search(backlash_oscillator(), "frequency", [1.0], options=options)
    assert result.tallies[0].settled == 0


def test_the_search_does_not_depend_on_units():
    """The clutch in units of 1/1000 of the length finds the same, start by start."""
    system = clutch(frequency=0.62)
    small = system.at({name: 1e-3 * system[name] for name in system.parameters if name.startswith("mean.")})
    small = small.at({AMPLITUDE: 1e-3 * system[AMPLITUDE], "stage2.clearance": 1e-3})
    small = small.at({"stage2.impact_damping": 1e3 * system["stage2.impact_damping"]})
    options = SearchOptions(starts=16, newton_starts=8)
    one, other = (search(each, "frequency", [0.62], options=options) for each in (system, small))
    assert [(found.orbit.period, found.hits_settled) for found in one.found] == [
        (found.orbit.period, found.hits_settled) for found in other.found
    ]
    assert other.tallies[0].box == pytest.approx(1e-3 * one.tallies[0].box, rel=1e-9)


# Starts


@pytest.mark.parametrize("figure", some_of(["12", "13", "15", "25"], "13", "15"))
def test_the_box_holds_the_motions_of_the_paper(figure):
    for point in [point for point in paper_response(figure).points if point.value >= 0.5][::20]:
        motion = point.orbit.motion(64)
        assert np.all(np.abs(np.hstack((motion.q, motion.v))).max(axis=0) < state_box(point.orbit.system))


def test_the_box_holds_known_orbits_and_leaves_out_stops_that_are_never_met():
    system = clutch(frequency=0.62)
    orbit = find_orbit(system)
    tiny = system.at({AMPLITUDE: 0.0})
    assert np.all(state_box(tiny, [orbit], spread=1.0) >= np.abs(orbit.state))
    far = viscous_stop().at({"stop.clearance": 1e6})
    assert state_box(far).max() < 100.0


def test_starts_are_spread_evenly_and_belong_to_their_value():
    box, system = np.array([1.0, 2.0, 3.0, 4.0]), clutch(frequency=0.62)
    starts = spread_starts([system], box, 64, seed=1, value=0.3)
    assert starts.shape == (64, 4)
    assert np.all(np.abs(starts) <= box)
    # a scrambled Sobol sequence has as many points on either side of zero, in every coordinate
    assert np.all((starts > 0.0).sum(axis=0) == 32)
    assert np.array_equal(starts, spread_starts([system], box, 64, seed=1, value=0.3))
    assert not np.array_equal(starts, spread_starts([system], box, 64, seed=2, value=0.3))
    assert not np.array_equal(starts, spread_starts([system], box, 64, seed=1, value=0.4))
    assert spread_starts([system], box, 1, seed=0, value=0.0).shape == (1, 4)
    assert spread_starts([system], box, 5, seed=0, value=0.0).shape == (5, 4)


# Newton's method aside


def test_the_deflated_step_is_that_of_the_deflated_equation():
    """Against the Jacobian of M(x) G(x) by differences: one full step from the same point."""
    system = clutch(frequency=0.62)
    equation, box = ShootingEquation(system), state_box(clutch(frequency=0.62))
    known = np.array([find_orbit(system).state])
    options = Deflation(iterations=1, halvings=0, reach=0.3, longest=1e9, farthest=1e9)
    x = known[0] + 0.05 * box * np.array([1.0, -0.5, 0.3, 0.2])

    def deflated(x):
        distance = np.linalg.norm((x - known[0]) / (box * options.reach))
        return (distance**-options.power + options.shift) * equation.evaluate(x, 0.0).residual

    jacobian = np.column_stack([(deflated(x + h) - deflated(x - h)) / 2e-6 for h in 1e-6 * np.eye(4)])
    expected = -np.linalg.solve(jacobian, deflated(x))

    taken = []

    class Watched:
        period, tolerance = 1, equation.tolerance

        def __init__(self):
            self.system = system

        def evaluate(self, unknowns, value):
            taken.append(unknowns)
            return equation.evaluate(unknowns, value)

    newton_aside(Watched(), x, box, known, options)
    assert taken[1] - x == pytest.approx(expected, rel=1e-4)


def test_beside_a_known_orbit_its_partner_is_found_and_not_the_orbit_again():
    system = case("15").at(frequency=0.8)
    box, equation = state_box(system), ShootingEquation(system, None, 3)
    settling = Settler(system, Catalogue(box), 8, 400).settle(np.zeros(4))
    assert settling.entry is not None
    known = np.vstack((settling.entry.states, exact_orbit(system, 1, find_orbit(system).state).state))
    plain, aside = [], []
    for kick in 0.1 * box * (2.0 * np.random.default_rng(0).random((30, 4)) - 1.0):
        plain.append(newton_aside(equation, known[0] + kick, box))
        aside.append(newton_aside(equation, known[0] + kick, box, known))
    apart = [np.abs((known - x) / box).max(axis=1).min() for x in aside if x is not None]
    assert apart
    assert min(apart) > 1e-3
    assert any(x is not None and np.abs((known - x) / box).max(axis=1).min() < 1e-6 for x in plain)


# Work: repeated, shared, stopped


def fingerprint(result):
    return [
        (each.value, each.orbit.period, each.orbit.state.tobytes(), each.hits_settled, each.hits_newton)
        for each in result.found
    ]


class Backwards:
    """PieceRunner that do the last piece first."""

    def run(self, function, pieces, accept, is_needed):
        for number in reversed(range(len(pieces))):
            if is_needed(number):
                accept(number, function(pieces[number]))


@pytest.mark.slow
def test_the_result_depends_neither_on_the_order_of_work_nor_on_who_does_it():
    options = SearchOptions(starts=16, newton_starts=4, block=8, newton_periods=(1, 2))
    arguments = (case("27"), AMPLITUDE, [0.0, 0.6])
    once = search(*arguments, options=options)
    assert fingerprint(search(*arguments, options=options)) == fingerprint(once)
    assert fingerprint(search(*arguments, options=options, workers=Backwards())) == fingerprint(once)
    with local_workers(2) as workers:
        assert fingerprint(search(*arguments, options=options, workers=workers)) == fingerprint(once)
    # and a value's own result not on the other values
    assert fingerprint(search(case("27"), AMPLITUDE, [0.6], options=options)) == fingerprint(once)[-len(once.at(0.6)) :]
    assert fingerprint(search(*arguments, options=replace(options, seed=1))) != fingerprint(once)


def test_what_was_found_before_an_interruption_is_kept():
    options = SearchOptions(starts=8, newton_starts=0, block=4)
    seen = []

    def interrupt(progress):
        seen.append(progress)
        if len(seen) == 3:
            raise KeyboardInterrupt

    result = until_ctrl_c(search, linear(), "frequency", [0.5, 0.6, 0.7], options=options, report=interrupt)
    assert [(each.done, each.total) for each in seen] == [(1, 6), (2, 6), (3, 6)]
    assert not result.complete
    assert result.values == (0.5, 0.6)
    assert [tally.settled for tally in result.tallies] == [8, 4]
    assert "stopped before its end" in coverage(result)[0]
    stopped = search(linear(), "frequency", [0.5, 0.6, 0.7], options=options, stop=lambda: True)
    assert (stopped.complete, stopped.found, stopped.tallies) == (False, (), ())
    assert coverage(stopped) == ("The search was stopped before its first start.",)
    finished = search(linear(), "frequency", [0.5], options=options)
    assert finished.complete


def test_a_chunk_is_a_pure_function():
    chunks = []

    class Collector:
        def run(self, function, pieces, accept, is_needed):
            chunks.extend(pieces)

    assert not search(case("27"), AMPLITUDE, [0.0], options=QUICK, workers=Collector()).complete
    first, second = search_chunk(chunks[0]), search_chunk(chunks[0])
    assert [(orbit.state.tobytes(), *hits) for orbit, *hits in first.orbits] == [
        (orbit.state.tobytes(), *hits) for orbit, *hits in second.orbits
    ]
    assert first.newton_starts == second.newton_starts > 0


def test_a_system_is_needed_only_as_a_value():
    """The search leaves the system that it is given alone."""
    system = clutch()
    before = System.from_values(system.structure, system.values.copy())
    search(system, "frequency", [1.7], options=SearchOptions(starts=2, newton_starts=0))
    assert system == before


def test_newton_starts_need_a_period():
    with pytest.raises(ModelError, match="newton_periods is empty; name at least one period, or"):
        SearchOptions(newton_periods=())


def test_requests_that_make_no_sense_are_refused():
    with pytest.raises(ModelError, match="values is empty"):
        search(linear(), "frequency", [])
    with pytest.raises(ModelError, match="no parameter 'frequncy'; did you mean 'frequency'"):
        search(linear(), "frequncy", [1.0])
    with pytest.raises(ModelError, match=r"frequency is -1\.0; it must be > 0"):
        search(linear(), "frequency", [1.0, -1.0])
    with pytest.raises(ModelError, match=r"box is \(1.0, 2.0\); it must be 4 numbers > 0"):
        search(linear(), "frequency", [1.0], options=SearchOptions(box=(1.0, 2.0)))


# What may have been missed


def test_bounds_on_what_was_missed():
    assert unseen_share(59) == pytest.approx(0.05, rel=0.01)  # the rule of three: 3 / 59
    assert (1.0 - unseen_share(200)) ** 200 == pytest.approx(0.05)
    assert unseen_share(0) == 1.0
    assert unseen_share(100, confidence=0.99) > unseen_share(100)


def test_coverage_in_sentences(figure_15):
    result = figure_15
    sentences = coverage(result)
    text = " ".join(sentences)
    settled = sum(tally.settled for tally in result.tallies)
    hits = sorted(found.hits_settled for found in result.found if found.hits_settled)
    assert sum(hits) == settled
    assert sentences[0].startswith(f"64 starts at 2 values of frequency, 0.45 to 0.8: {settled} settled on ")
    assert "An isolated branch narrower than 0.35 in frequency may lie between two values." in text
    assert f"reached from {hits[0]} to {hits[-1]} starts (median {hits[(len(hits) - 1) // 2]})." in text
    assert "with 95 % confidence, less than 8.9 % of the box of starts at any of these values" in text
    once = sum(found.hits_settled == 1 for found in result.found)
    assert next_is_new(result) == once / settled
    assert f"{once} motion" in text
    assert "for unstable orbits no bound can be given" in sentences[-1]


def test_a_bound_for_each_value_where_they_differ():
    result = search(case("15"), "frequency", [0.45, 0.85], options=SearchOptions(starts=8, newton_starts=0))
    text = " ".join(coverage(result))
    assert "at the value with most settled starts; at 0.85, nothing can be said" in text


def test_good_turing_counts_motions_met_once():
    bare = search(linear(), "frequency", [0.5], options=SearchOptions(starts=1, newton_starts=0))
    assert next_is_new(bare) == 1.0
    assert next_is_new(search(linear(), "frequency", [0.5], options=SearchOptions(starts=4, newton_starts=0))) == 0.0


# The whole campaign


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("figure", "spans"),
    [
        ("27", [(-0.6023, -0.4840), (-0.2614, 0.2614), (0.4840, 0.6023)]),
        ("28", [(-0.6201, -0.4278), (-0.3725, 0.3725), (0.4278, 0.6201)]),
    ],
)
def test_the_islands_are_found_whatever_the_seed(figure, spans, seed):
    main = main_branch(figure, AMPLITUDE, -1.0, 1.0)
    options = SearchOptions(seed=seed)
    result = search(case(figure), AMPLITUDE, np.linspace(-1.0, 1.0, 11), known=[main], options=options)
    new = [found for found in result.new if found.orbit.period == 1]
    islands = isolated(new, AMPLITUDE, (-1.0, 1.0), known=[main])
    assert sorted(span(branch) for branch in islands) == [pytest.approx(ends, abs=2e-4) for ends in spans]
