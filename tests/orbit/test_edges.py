"""Numbers at the edge of what a system may have: right, beside a closed form or a law of scaling, or refused."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.optimize import brentq

from gapwalk import Contact, Harmonic, Side, Stage, System, find_orbit, follow
from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.flow import flow_of
from gapwalk.model.coefficients import coefficients_of
from gapwalk.orbit import Orbit
from tests.tiers import keeps

ENDS = ((100.0, 0.01), (0.01, 100.0))


def oscillator(
    *, damping=0.1, stiff=5.0, gap=0.5, size=0.5, mean=0.1, frequency=0.7, impact=0.0, order=1, side=Side.BOTH
) -> System:
    """A mass on a spring of stiffness 1 with one stage; linear as long as it does not reach its gap."""
    law = "hunt-crossley" if impact else "elastic"
    return System(
        ("x",),
        [[1.0]],
        [[damping]],
        contacts=[Contact("gap", {"x": 1.0}, (Stage(gap, stiff, side=side),), None, law, {"impact_damping": impact})],
        mean={"x": mean},
        harmonics=[Harmonic(size, {"x": 1.0}, order=order)],
        frequency=frequency,
    )


def linear_error(orbit: Orbit, stiffness: float, damping: float) -> float:
    """Error of state and multipliers against the linear oscillator's, relative to the amplitude."""
    system, frequency = orbit.system, orbit.system.frequency
    response = system["harmonic1.amplitude"] / (stiffness - frequency**2 + 1j * frequency * damping)
    state = [system["mean.x"] / stiffness + response.real, (1j * frequency * response).real]
    roots = np.roots([1.0, damping, stiffness])
    multipliers = np.sort_complex(np.exp(2 * np.pi / frequency * roots))
    return max(
        float(np.abs(orbit.state - state).max() / abs(response)),
        float(np.abs(np.sort_complex(orbit.multipliers) - multipliers).max()),
    )


@pytest.mark.parametrize(
    ("ratio", "frequency", "bound"),
    [
        (1e-6, 0.7, 1e-12),
        (1e-6, 1.0, 1e-9),  # at resonance an error is multiplied by 1 / (2 * 1e-6)
        (1e-6, 1.000001, 1e-9),
        (10.0, 0.7, 1e-12),
        (1e3, 0.7, 1e-9),
    ],
)
def test_very_light_and_very_heavy_damping_beside_the_closed_form(ratio, frequency, bound):
    system = oscillator(damping=2 * ratio, gap=1e12, frequency=frequency)
    assert linear_error(find_orbit(system), 1.0, 2 * ratio) < bound


def test_damping_too_heavy_for_explicit_steps_is_refused():
    with pytest.raises(FlowError, match="too stiff"):
        find_orbit(oscillator(damping=2e4))


@pytest.mark.parametrize("gap", [1e3, 1e6, 1e12, 1e100])
def test_a_gap_that_is_never_used_up_changes_nothing(gap):
    # the distance to a breakpoint once counted as the size of the motion: at 1e12 multipliers were off by 1e-5
    assert linear_error(find_orbit(oscillator(gap=gap)), 1.0, 0.1) < 1e-13


@pytest.mark.parametrize("gap", [np.inf, np.nan, -1e-300])
def test_a_gap_that_is_no_number_is_refused(gap):
    with pytest.raises(ModelError, match="clearance"):
        oscillator(gap=gap)


def test_a_gap_of_no_width_is_a_spring():
    assert linear_error(find_orbit(oscillator(gap=0.0)), 6.0, 0.1) < 1e-12


def test_a_gap_of_hardly_any_width_is_a_spring_and_a_load():
    # between closed stages the force is k (x - b) and k (x + b): off by 5 b
    wide, none = (find_orbit(oscillator(gap=gap)).state for gap in (1e-12, 0.0))
    assert np.abs(wide - none).max() < 1e-10


def test_an_orbit_of_16_periods_is_one_of_1_under_a_load_of_order_16():
    once = find_orbit(oscillator(frequency=0.8))
    power = np.sort_complex(once.multipliers**16)
    for other in (
        find_orbit(oscillator(frequency=0.05, order=16)),
        find_orbit(oscillator(frequency=0.8), 16, start=once.state),
    ):
        assert other.state == pytest.approx(once.state, abs=1e-12)
        assert np.sort_complex(other.multipliers) == pytest.approx(power, abs=1e-12)


def enlarged(factor: float) -> System:
    """All lengths and forces times a factor; the impact damping is one over a velocity."""
    return oscillator(gap=0.5 * factor, size=0.5 * factor, mean=0.1 * factor, impact=0.2 / factor, frequency=0.9)


@keeps("1e-09")
@pytest.mark.parametrize("factor", [1e6, 1e-9])
def test_motions_of_any_size_have_the_special_points_of_ordinary_ones(factor):
    ordinary, other = (follow(find_orbit(enlarged(each)), "frequency", to=0.4) for each in (1.0, factor))
    assert len(ordinary.special_points) >= 4
    assert [each.kind for each in other.special_points] == [each.kind for each in ordinary.special_points]
    for one, its in zip(ordinary.special_points, other.special_points, strict=True):
        assert its.value == pytest.approx(one.value, abs=1e-11)
        assert its.orbit.state == pytest.approx(factor * one.orbit.state, rel=1e-7, abs=1e-7 * factor)
        assert its.orbit.extremes == pytest.approx(factor * one.orbit.extremes, rel=1e-7, abs=1e-7 * factor)


@pytest.mark.parametrize("factor", [1e9, 1e-9, 1e-15])
def test_sensitivities_and_events_scale_with_the_motion(factor):
    arcs = []
    for system, state in ((enlarged(1.0), np.array([0.3, 0.9])), (enlarged(factor), factor * np.array([0.3, 0.9]))):
        line = flow_of(system, "gap.clearance", transition=True)
        direction = np.zeros(len(coefficients_of(system)))
        for stage in line.equations.layout.contacts[0].stages:
            direction[stage.clearance] = 1.0
        arcs.append(line.integrate(coefficients_of(system), state, direction=direction))
    one, other = arcs
    assert len(one.contacts) == len(other.contacts) >= 2
    assert other.state == pytest.approx(factor * one.state, rel=1e-10)
    assert other.transition == pytest.approx(one.transition, rel=1e-9, abs=1e-9)
    assert other.sensitivity == pytest.approx(one.sensitivity, rel=1e-9, abs=1e-9)
    speeds = [[event.velocity for event in arc.contacts] for arc in arcs]
    assert speeds[1] == pytest.approx(factor * np.array(speeds[0]), rel=1e-9)


def by_pieces(system: System, state: np.ndarray) -> np.ndarray:
    """The state after one forcing period, by the closed forms between contacts; each is bracketed and bisected."""
    damping, stiff, gap = (system[name] for name in ("damping.x.x", "gap.stiffness", "gap.clearance"))
    size, mean, frequency = system["harmonic1.amplitude"], system["mean.x"], system.frequency
    time, left, (x, v) = 0.0, 2 * np.pi / frequency, state
    inside = x > gap
    while True:
        stiffness = 1.0 + stiff * inside
        rest = (mean + stiff * gap * inside) / stiffness
        forced = size / (stiffness - frequency**2 + 1j * frequency * damping) * np.exp(1j * frequency * time)
        roots = np.roots([1.0, damping, stiffness]).astype(complex)
        free = np.linalg.solve([[1.0, 1.0], roots], [x - rest - forced.real, v - (1j * frequency * forced).real])
        rates, weights = np.append(roots, 1j * frequency), np.append(free, forced)

        def after(times, order=0, rates=rates, weights=weights, rest=rest):
            return (np.exp(np.multiply.outer(times, rates)) @ (weights * rates**order)).real + rest * (order == 0)

        times = np.append(np.arange(1e-6, left, 1e-4), left)
        crossed = np.flatnonzero((after(times) > gap) != inside)
        if not len(crossed):
            return np.array([after(left), after(left, 1)])
        first = crossed[0]
        span = brentq(lambda s, after=after: after(s) - gap, times[first - 1], times[first], xtol=1e-16)
        x, v, time, left, inside = gap, float(after(span, 1)), time + span, left - span, not inside


def test_a_stop_a_million_times_stiffer_beside_closed_forms():
    system, state = oscillator(stiff=1e6, side=Side.POSITIVE, frequency=1.1), np.array([0.2, 1.0])
    arc = flow_of(system).integrate(coefficients_of(system), state)
    assert len(arc.contacts) >= 2
    assert arc.state == pytest.approx(by_pieces(system, state), abs=1e-10)


@pytest.mark.slow
def test_200_contacts_at_once_move_like_each_alone():
    count, gaps = 200, np.linspace(0.2, 0.6, 200)
    names = tuple(f"q{k}" for k in range(count))
    together = System(
        names,
        np.eye(count),
        0.1 * np.eye(count),
        contacts=[
            Contact(f"g{k}", {q: 1.0}, (Stage(gap, 5.0),)) for k, (q, gap) in enumerate(zip(names, gaps, strict=True))
        ],
        harmonics=[Harmonic(0.5, dict.fromkeys(names, 1.0))],
        frequency=0.7,
    )
    rest = np.zeros(2 * count)
    state = flow_of(together).integrate(coefficients_of(together), rest).state
    for k in (0, 57, 199):
        alone = oscillator(gap=gaps[k], mean=0.0)
        expected = flow_of(alone).integrate(coefficients_of(alone), rest[:2]).state
        assert state[[k, count + k]] == pytest.approx(expected, abs=1e-11)


def values_of(branch) -> list[tuple[str, float]]:
    return [(each.kind.value, each.value) for each in branch.special_points]


def agree(one: list[tuple[str, float]], other: list[tuple[str, float]], error: float = 1e-11) -> bool:
    return [kind for kind, _ in one] == [kind for kind, _ in other] and [value for _, value in one] == pytest.approx(
        [value for _, value in other], abs=error
    )


@pytest.mark.parametrize(("start", "end"), ENDS)
@pytest.mark.parametrize("gap", [1e12, 8.0])
def test_a_range_of_frequencies_of_10000_beside_the_closed_form(start, end, gap):
    # at W = 100 the motion is 100,000 times smaller than at its resonance, by which it has to be measured
    branch = follow(find_orbit(oscillator(gap=gap, frequency=start)), "frequency", to=end)
    assert branch.points[-1].value == end
    assert len(branch.points) < 250
    assert max(linear_error(point.orbit, 1.0, 0.1) for point in branch.points) < 1e-5  # multipliers a step aside
    for point in branch.points[::10]:
        again = find_orbit(point.orbit.system, start=point.orbit.state)
        assert linear_error(again, 1.0, 0.1) < 1e-11
        assert np.abs(point.orbit.state - again.state).max() < 1e-9 * np.ptp(again.extremes[0, :2])
    peak = 0.5 / (0.1 * np.sqrt(1.0 - 0.1**2 / 4.0))
    assert branch.measure("half.x").max() > 0.995 * peak  # it was not stepped over


def test_a_range_of_frequencies_of_10000_with_a_gap_that_only_the_resonance_uses_up():
    down, up = (follow(find_orbit(oscillator(gap=3.0, frequency=a)), "frequency", to=b) for a, b in ENDS)
    assert agree(values_of(down), values_of(up)[::-1])
    assert max(len(branch.points) for branch in (down, up)) < 300  # as many as in narrow ranges, one after the other

    def beyond_the_gap(frequency: float) -> float:
        return 0.1 + 0.5 / abs(1.0 - frequency**2 + 0.1j * frequency) - 3.0

    # the first and the last graze are those of the linear motion
    grazes = [value for kind, value in values_of(up) if kind == "grazing"]
    assert grazes[0] == pytest.approx(brentq(beyond_the_gap, 0.5, 0.99, xtol=1e-15), abs=1e-11)
    assert grazes[-1] == pytest.approx(brentq(beyond_the_gap, 1.0, 2.0, xtol=1e-15), abs=1e-11)


@pytest.mark.slow
def test_a_range_of_frequencies_of_10000_of_a_motion_with_contacts_throughout():
    down, up = (follow(find_orbit(oscillator(frequency=a)), "frequency", to=b) for a, b in ENDS)
    assert agree(values_of(down), values_of(up)[::-1])
    pieces = []  # in ranges that are hardly wider than what happens in them
    for high, low in ((100.0, 2.5), (2.5, 0.8), (0.8, 0.5), (0.5, 0.3), (0.3, 0.1), (0.1, 0.05), (0.05, 0.01)):
        pieces += values_of(follow(find_orbit(oscillator(frequency=high)), "frequency", to=low))
    assert len(pieces) > 40
    assert agree(pieces, values_of(down))


def test_a_load_that_grows_by_a_factor_of_a_thousand_million():
    branch = follow(find_orbit(oscillator(size=1e-6, mean=0.0, gap=1e12)), "harmonic1.amplitude", to=1e3)
    assert len(branch.points) < 250  # no step changes the load by more than an eighth
    assert max(linear_error(point.orbit, 1.0, 0.1) for point in branch.points) < 1e-9


@pytest.mark.slow
def test_walks_go_round_the_corners_at_a_stop_10000_times_stiffer():
    # past a graze the branch turns within a depth of some 1 / stiff^2 of the gap, and there is a fold in that
    ends = ((1.6, 0.8), (0.8, 1.6))
    down, up = (follow(find_orbit(oscillator(stiff=1e4, frequency=a)), "frequency", to=b) for a, b in ends)
    assert (down.points[-1].value, up.points[-1].value) == (0.8, 1.6)
    assert Counter(kind for kind, _ in values_of(down)) == {"flip": 6, "grazing": 4, "fold": 4}
    assert agree(sorted(values_of(down)), sorted(values_of(up)), 1e-10)


def test_a_walk_beside_a_stop_a_million_times_stiffer_beside_closed_forms():
    branch = follow(find_orbit(oscillator(stiff=1e6, side=Side.POSITIVE, frequency=1.6)), "frequency", to=0.8)
    assert branch.points[-1].value == 0.8
    for point in branch.points[::50]:
        assert by_pieces(point.orbit.system, point.orbit.state) == pytest.approx(point.orbit.state, abs=1e-9)


@pytest.mark.slow
def test_a_corner_too_sharp_for_rounding_is_passed_by_the_depth_of_the_touch():
    stiff, rigid = (follow(find_orbit(oscillator(stiff=k, frequency=1.6)), "frequency", to=0.8) for k in (1e5, 1e6))
    for branch in (stiff, rigid):
        assert branch.points[-1].value == 0.8
        assert branch.unexplained == ()
    assert [each.kind for each in stiff.special_points] == [each.kind for each in rigid.special_points]
