"""Walks past grazes at stiff stops, beside closed forms in extended precision."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from gapwalk.attractors import settle
from gapwalk.bifurcation import Kind, follow
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.follow import BranchTracer
from gapwalk.continuation import EndReason, WalkOptions
from gapwalk.model import Contact, Harmonic, Side, Stage, System
from gapwalk.model.contact import rigid_stop
from gapwalk.orbit import find_orbit
from gapwalk.studies.verify import verify
from tests.sampled_verification import SAMPLED, verified
from tests.tiers import in_campaign

DAMPING, FORCE = 0.1, 0.3
LONG = np.longdouble
PI = LONG("3.14159265358979323846264338327950288")


def oscillator(stiffness, side=Side.POSITIVE, law="elastic", damping=0.0, frequency=4.0):
    """A mass on a spring, with a stop on one side or on both."""
    names = {"viscous": "viscous_damping", "hunt-crossley": "impact_damping"}
    more = {"law": law, names[law]: damping} if law in names else {}
    stop = Contact("stop", {"x": 1.0}, (Stage(1.0, stiffness, side=side),), **more)
    harmonic = Harmonic(FORCE, {"x": 1.0})
    return System(["x"], [[1.0]], [[DAMPING]], contacts=[stop], harmonics=[harmonic], frequency=frequency)


def walk(system, to, **options):
    branch = follow(find_orbit(system), "frequency", to, **options)
    assert branch.ends[-1].reason is EndReason.RANGE, str(branch.ends[-1])
    return branch


class Impacting:
    """Motions of one mass that meet the stop once a period, pieced together from closed forms (law none or viscous).

    With stops on both sides they are symmetric, and half a period tells all. They are told by the angle and the
    velocity at which the stop is met: so the family is smooth, however stiff the stop is.
    """

    def __init__(self, stiffness, viscous=0.0, symmetric=False):
        self.symmetric = symmetric
        free = (LONG(DAMPING), LONG(1.0))
        self.phases = (free, (free[0] + LONG(viscous), free[1] + LONG(stiffness)))
        self.viscous = LONG(viscous)

    def carry(self, phase, theta, x, v, time, frequency):
        """State after a time, and its derivative by the state at the start.

        The position x is that past the stop: x'' + c x' + k x = F cos(W t) - 1.
        """
        c, k = self.phases[phase]
        gain = (k - frequency**2) ** 2 + (c * frequency) ** 2
        cosine, sine = LONG(FORCE) * (k - frequency**2) / gain, LONG(FORCE) * c * frequency / gain

        def steady(angle):
            return (
                cosine * np.cos(angle) + sine * np.sin(angle) - 1 / k,
                frequency * (sine * np.cos(angle) - cosine * np.sin(angle)),
            )

        decay, ringing = c / 2, np.sqrt(k - c**2 / 4)
        fall, co, si = np.exp(-decay * time), np.cos(ringing * time), np.sin(ringing * time) / ringing
        transition = fall * np.array([[co + decay * si, si], [-k * si, co - decay * si]])
        before, after = steady(theta), steady(theta + frequency * time)
        return transition @ np.array([x - before[0], v - before[1]]) + np.array(after), transition

    def residual(self, unknowns, sign):
        """What is left of: in contact, then free, the motion repeats, with the product of mu + sign zero."""
        theta, contact, frequency, v = unknowns
        (x, w), inside = self.carry(1, theta, LONG(0), v, contact, frequency)
        time = (1 if self.symmetric else 2) * PI / frequency - contact
        (end, speed), outside = self.carry(0, theta + frequency * contact, x, w, time, frequency)
        enter, leave = (np.array([[1, 0], [jump, 1]]) for jump in (-self.viscous, self.viscous))
        around = outside @ leave @ inside @ enter
        if self.symmetric:  # half a period later all is mirrored, and the other stop is met
            end, speed, around = -end - 2, -speed, -around
        determinant = around[0, 0] * around[1, 1] - around[0, 1] * around[1, 0]
        return np.array([x / v, end, speed - v, 1 + sign * np.trace(around) + determinant])

    def special(self, kind, orbit):
        """Frequency of the fold or flip next to an orbit, by Newton's method."""
        entry = next(event for event in orbit.events if event.enters and event.velocity > 0.0)
        leave = next(event for event in orbit.events if not event.enters and event.velocity < 0.0)
        frequency = orbit.system.frequency
        contact = (leave.theta - entry.theta) % (2 * math.pi) / frequency
        sizes = np.array([1.0, contact, 1.0, entry.velocity], dtype=LONG)
        unknowns = np.array([entry.theta, contact, frequency, entry.velocity], dtype=LONG)
        sign = -1 if kind is Kind.FOLD else 1
        for _ in range(20):
            residual = self.residual(unknowns, sign)
            asides = np.diag(sizes * LONG(1e-7))
            matrix = [(self.residual(unknowns + aside, sign) - residual) / LONG(1e-7) for aside in asides]
            unknowns = unknowns - sizes * np.linalg.solve(np.array(matrix, dtype=float).T, residual.astype(float))
        assert np.abs(self.residual(unknowns, sign)).max() < 1e-10
        return float(unknowns[2])


def grazing_frequencies():
    """Where the amplitude of the linear motion is the clearance, 1, in closed form."""
    middle = 1.0 - 0.5 * DAMPING**2
    root = math.sqrt(middle**2 - 1.0 + FORCE**2)
    return math.sqrt(middle - root), math.sqrt(middle + root)


@pytest.mark.parametrize("stiffness", [in_campaign(1e4), 1e6])
@pytest.mark.parametrize(
    ("law", "damping", "side"),
    [
        ("elastic", 0.0, Side.BOTH),
        ("viscous", 10.0, Side.POSITIVE),
        in_campaign("elastic", 0.0, Side.POSITIVE),
        in_campaign("viscous", 10.0, Side.BOTH),
    ],
)
def test_special_points_beyond_grazes_are_those_of_the_closed_form_from_both_sides(stiffness, law, damping, side):
    exact = Impacting(stiffness, damping, symmetric=side is Side.BOTH)
    down, up = (walk(oscillator(stiffness, side, law, damping, start), to) for start, to in ((4.0, 0.3), (0.3, 4.0)))
    unstable = Kind.BRANCH_POINT if side is Side.BOTH else Kind.FLIP  # of the mirrored half period: it is -1 there
    grazes = 1 if side is Side.POSITIVE else 2
    assert [each.kind for each in down.special_points] == (
        [Kind.GRAZING] * grazes + [Kind.FOLD, Kind.FOLD, unstable, unstable] + [Kind.GRAZING] * grazes
    )
    assert [each.kind for each in up.special_points] == [each.kind for each in down.special_points[::-1]]
    for special in (*down.special_points, *up.special_points):
        assert special.uncertainty < 1e-9
        if special.kind is Kind.GRAZING:
            assert min(abs(special.value - value) for value in grazing_frequencies()) < 3e-13
        else:
            assert abs(special.value - exact.special(special.kind, special.orbit)) < special.uncertainty + 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, in_campaign(6)])
def test_stated_errors_hold_however_the_last_digits_are_rounded(count):
    """Rounding moves the fold far beyond the graze by 1e-12, and the difference of two computations by as much."""
    exact, errors, stated = Impacting(1e6, symmetric=True), [], []
    for number in range(count):
        system = oscillator(1e6 * (1.0 + 3e-16 * number), Side.BOTH)
        fold = walk(system, 1.0).special(Kind.FOLD)[-1]
        errors.append(abs(fold.value - exact.special(Kind.FOLD, fold.orbit)))
        stated.append(fold.uncertainty)
    assert all(error < uncertainty for error, uncertainty in zip(errors, stated, strict=True))
    assert 1e-12 < min(stated) < max(stated) < 5e-11


def test_beyond_what_numbers_can_resolve_special_points_stand_at_the_graze():
    """Past a graze at a stop of stiffness 1e8 the branch turns within a depth of 1e-16."""
    branch, exact = walk(oscillator(1e8), 0.3), Impacting(1e8)
    graze, fold, far_fold, far_flip, flip, other = branch.special_points
    kinds = [Kind.GRAZING, Kind.FOLD, Kind.FOLD, Kind.FLIP, Kind.FLIP, Kind.GRAZING]
    assert [each.kind for each in branch.special_points] == kinds
    assert [graze.value, fold.value] == pytest.approx([grazing_frequencies()[1]] * 2, abs=3e-13)
    assert [other.value, flip.value] == pytest.approx([grazing_frequencies()[0]] * 2, abs=3e-13)
    for special in (far_fold, far_flip):
        assert special.value == pytest.approx(exact.special(special.kind, special.orbit), abs=1e-10)


@pytest.mark.parametrize("side", [Side.POSITIVE, Side.BOTH])
def test_the_number_of_unstable_multipliers_is_explained_past_a_graze(side):
    branch = walk(oscillator(1e6, side, "hunt-crossley", 0.1), 0.3)
    count = branch.points[0].instability.total
    for special in branch.special_points:
        assert special.before.total == count
        count = special.after.total
    assert branch.points[-1].instability.total == count


@pytest.mark.slow
def test_a_walk_over_a_graze_can_be_stopped_and_resumed_before_and_after_it():
    orbit, options = find_orbit(oscillator(1e6)), WalkOptions()
    whole = list(BranchTracer(start_branch(orbit, "frequency", 0.3, -1), options))
    passed = next(i for i, (_, special) in enumerate(whole) if special)
    for stop in (passed, passed + 1, passed + 3):
        tracer = BranchTracer(start_branch(orbit, "frequency", 0.3, -1), options)
        steps = list(itertools.islice(tracer, stop))
        steps += list(BranchTracer(start_branch(orbit, "frequency", 0.3, -1), options, tracer.state))
        assert [point.value for point, _ in steps] == [point.value for point, _ in whole]
        assert [each.value for _, found in steps for each in found] == [each.value for _, f in whole for each in f]


def test_a_branch_that_begins_within_rounding_of_a_graze_is_not_said_to_join_its_parent():
    branch = walk(oscillator(1e6, law="hunt-crossley", damping=0.1, frequency=0.3), 0.9)
    child = follow(branch.special(Kind.FLIP)[0], "frequency", (0.8, 0.9))
    assert child.ends[-1].reason is EndReason.STEP
    assert "grazes" in child.ends[-1].detail


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deflection", "last"),
    [({"a": 1.0, "b": -1.0}, 1.5), in_campaign({"a": 1.0, "b": -1.0}, 4.0), in_campaign({"a": 1.0}, 4.0)],
)
def test_two_masses_with_a_stop_of_steel_have_the_same_special_points_from_both_sides(deflection, last):
    stage = Stage(1.0, 1e6, side=Side.POSITIVE)
    stop = Contact("stop", deflection, (stage,), law="hunt-crossley", impact_damping=0.1)
    stiffness, damping, mass = [[2.0, -1.0], [-1.0, 1.7]], np.diag([0.05, 0.05]), np.diag([1.0, 1.3])
    harmonic = Harmonic(0.3, {"b": 1.0})
    system = System(["a", "b"], stiffness, damping, mass=mass, contacts=[stop], harmonics=[harmonic], frequency=last)
    down, up = (
        places(walk(system, 0.3).special_points),
        places(walk(system.at(frequency=0.3), last).special_points[::-1]),
    )
    assert [sorted(each.kind for each in place) for place in down] == [
        sorted(each.kind for each in place) for place in up
    ]
    assert sum(each.kind is Kind.GRAZING for place in down for each in place) >= 4
    for one, other in zip(down, up, strict=True):
        for a, b in zip(one, other, strict=True):
            assert abs(a.value - b.value) <= a.uncertainty + b.uncertainty
        assert (one[0].before.total, one[-1].after.total) == (other[0].after.total, other[-1].before.total)
        natures = [sorted(each.nature for each in place) for place in (one, other)]
        assert natures[0] == natures[1]


def places(points):
    """Return special points in groups, of those that no error tells apart: a graze and a flip 3e-15 beside it."""
    found = [[points[0]]]
    for point in points[1:]:
        if abs(point.value - found[-1][-1].value) <= 1e-14:
            found[-1].append(point)
        else:
            found.append([point])
    return found


@pytest.mark.slow
def test_an_impact_that_passes_the_beginning_of_the_period_leaves_no_trace():
    """Where a viscous force sets in just as the period begins, the state there has a bend, but the motion has none."""
    stage = Stage(1.0, 1e6, side=Side.POSITIVE)
    stop = Contact("stop", {"a": 1.0}, (stage,), law="viscous", viscous_damping=10.0)
    stiffness, damping, mass = [[2.0, -1.0], [-1.0, 1.7]], np.diag([0.05, 0.05]), np.diag([1.0, 1.3])
    found = []
    for phase in (0.0, 1.0):  # radians: with the second the impact is nowhere near the beginning
        harmonic = Harmonic(0.3, {"b": 1.0}, phase=phase)
        system = System(["a", "b"], stiffness, damping, mass=mass, contacts=[stop], harmonics=[harmonic], frequency=0.6)
        branch = walk(system, 0.9)
        found.append(branch.special_points)
    assert [special.kind for special in found[0]] == [special.kind for special in found[1]]
    for one, other in zip(*found, strict=True):
        assert abs(one.value - other.value) < one.uncertainty + other.uncertainty < 1e-10


def symmetric_force(speed, frequency=0.7, damping=0.1, restitution=0.8):
    """Amplitude at which a mass between two rigid walls at -1 and 1 meets each of them once a period, at a speed.

    Over half a period the motion is ``exp(-damping t / 2) (a cos n t + b sin n t) + p cos W t + q sin W t``. It begins
    at a wall, ends at the other one, and is linear in these four numbers.
    """
    n, rows = math.sqrt(1.0 - 0.25 * damping**2), []
    for time in (0.0, math.pi / frequency):
        decay, cosine, sine = math.exp(-0.5 * damping * time), math.cos(n * time), math.sin(n * time)
        c, s = math.cos(frequency * time), math.sin(frequency * time)
        rows.append([decay * cosine, decay * sine, c, s])
        rates = -0.5 * damping * cosine - n * sine, -0.5 * damping * sine + n * cosine
        rows.append([decay * rates[0], decay * rates[1], -frequency * s, frequency * c])
    p, q = np.linalg.solve(rows, [1.0, -restitution * speed, -1.0, -speed])[2:]
    return math.hypot(p, q) * abs(complex(1.0 - frequency**2, damping * frequency))


@pytest.mark.slow
@pytest.mark.parametrize("sampled", SAMPLED)
def test_a_symmetric_motion_begins_to_meet_both_rigid_walls_at_once(sampled):
    walls = rigid_stop("walls", {"x": 1.0}, 1.0, restitution=0.8, side=Side.BOTH)
    load = Harmonic(0.51, {"x": 1.0})
    system = System(["x"], [[1.0]], [[0.1]], contacts=[walls], harmonics=[load], frequency=0.7)
    branch = follow(find_orbit(system), "harmonic1.amplitude", 0.52)
    graze = abs(complex(1.0 - 0.7**2, 0.1 * 0.7))  # where the motion without impacts has the amplitude 1
    assert branch.ends[-1].reason is EndReason.RANGE
    assert [each.kind for each in branch.special_points] == [Kind.GRAZING] * 2
    assert [each.value for each in branch.special_points] == pytest.approx([graze] * 2, abs=1e-12)
    struck = [point for point in branch.points if point.orbit.events]
    assert len(struck) > 5
    for point in struck:
        first, last = (abs(event.velocity) for event in point.orbit.events)
        assert last == pytest.approx(first, abs=1e-7)
        assert point.value == pytest.approx(symmetric_force(first), abs=1e-9)
    assert branch.unexplained == ()
    assert verified(branch, sampled).ok


def graze_after_impact(n, excess, damping=2.5, frequency=2.0, restitution=0.8):
    """Load per load of the first touch, less 1, at which a motion of period n with one impact touches once more.

    Between impacts the motion is linear: forced by the load, in phase with it at theta = 0, and two exponentials that
    the impact of speed u begins anew by -(1 + r) u every n periods. One period before it, it must touch the stop.
    Solved by Newton's method, with the load, u, and the angles of the impact and of the touch as unknowns.
    """
    root = math.sqrt(damping**2 / 4.0 - 1.0)
    rates, cycle = (-damping / 2.0 + root, -damping / 2.0 - root), 2.0 * math.pi / frequency

    def motion(excess, speed, begin, time, order):
        wave = (np.cos, lambda angle: -np.sin(angle))[order](frequency * time + begin)
        kicks = (
            sign * rate**order * np.exp(rate * time) / (1.0 - math.exp(rate * n * cycle))
            for sign, rate in zip((1.0, -1.0), rates, strict=True)
        )
        return (1.0 + excess) * frequency**order * wave - (1.0 + restitution) * speed / (2.0 * root) * sum(kicks)

    def equations(unknowns):
        excess, speed, begin, late = unknowns
        touch = (n - 1) * cycle + late
        at_impact, at_touch = (
            [motion(excess, speed, begin, time, order) for order in (0, 1)] for time in (n * cycle, touch)
        )
        return np.array([at_impact[0] - 1.0, at_impact[1] - speed, at_touch[0] - 1.0, at_touch[1]])

    speed = frequency * math.sqrt(2.0 * excess * (1.0 - math.exp(rates[0] * cycle)))
    unknowns = np.array([excess, speed, -speed / frequency, speed / frequency**2])
    for _ in range(30):
        matrix = np.array([np.imag(equations(unknowns + 1e-30j * way)) / 1e-30 for way in np.eye(4)]).T
        unknowns = unknowns - np.linalg.solve(matrix, equations(unknowns))
    assert np.abs(equations(unknowns)).max() < 1e-14
    assert unknowns[1] > 1e-4
    return float(unknowns[0])


def grazing_period(n, spare):
    """A motion of a period in the cascade of period adding beyond a graze, and the load of the graze."""
    stop = rigid_stop("stop", {"x": 1.0}, 1.0, restitution=0.8, side=Side.POSITIVE)
    force = abs(complex(1.0 - 4.0, 2.5 * 2.0))
    system = System(["x"], [[1.0]], [[2.5]], contacts=[stop], harmonics=[Harmonic(force, {"x": 1.0})], frequency=2.0)
    orbit = settle(system, **{"harmonic1.amplitude": force * (1.0 + spare)}).orbit
    assert orbit is not None
    assert orbit.period == n
    return orbit, force


@pytest.mark.slow
def test_a_graze_beyond_which_touches_are_rounding_is_named_where_the_walk_ends():
    """Touches of 1.5e-13 at most follow the graze of period 6, where the branch turns back."""
    orbit, force = grazing_period(6, 1.25e-6)
    branch = follow(orbit, "harmonic1.amplitude", force * (1.0 + 1.5e-6))
    assert branch.ends[-1].reason is EndReason.WITHIN_ROUNDING
    (graze,) = branch.special_points
    assert (graze.kind, graze.contact) == (Kind.GRAZING, "stop +")
    # on which side of the unit circle it then lies is rounding: processors differ
    assert (graze.before.total, graze.after.total, graze.after.pairs) == (0, 1, 0)
    right = force * (1.0 + graze_after_impact(6, 1.37e-6))
    assert right == pytest.approx(5.830959908883, abs=1e-12)
    assert abs(graze.value - right) < max(graze.uncertainty, 1e-11) < 1e-10
    assert branch.ends[-1].value == graze.value
    start, end = branch.ends
    start = replace(start, value=branch.points[-4].value)
    found = verify(replace(branch, points=branch.points[-4:], ends=(start, end)))
    # whether an integrator sees such a touch is rounding, and what follows moves by its square root: 3e-5 with impacts
    assert all(each.check.word == "extremes" and each.size < 1e-4 for each in found.breaches)


@pytest.mark.slow
def test_a_graze_whose_impacts_grow_by_a_million_in_a_segment_is_passed():
    """Beyond the graze of period 5 the branch turns back, and the parameter shows it from the first touch on."""
    orbit, force = grazing_period(5, 2.7e-5)
    branch = follow(orbit, "harmonic1.amplitude", (force * (1.0 + 2.5e-5), force * (1.0 + 3.5e-5)))
    (graze,) = branch.special(Kind.GRAZING)
    assert abs(graze.value - force * (1.0 + graze_after_impact(5, 3.17e-5))) < graze.uncertainty < 1e-9
    beyond = [each for each in branch.points if len(each.orbit.events) == 2]
    assert beyond
    assert branch.ends[-1].reason is EndReason.TURNED_BACK
    assert beyond[-1].orbit.instability.above == 1
