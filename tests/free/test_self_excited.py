"""Self-excited motions against closed forms, tabulated periods, and integration by SciPy."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import gapwalk as gw
from gapwalk.continuation.walk import EndReason
from gapwalk.errors import ConvergenceError, ModelError
from gapwalk.free.free_shooting import FreeOrbit
from gapwalk.free.self_excitation import SelfExcited, _exact, _shortest
from gapwalk.orbit.orbit import sensitivity
from gapwalk.verification import Ledger
from gapwalk.verification.verify_branch import verify_branches
from tests.tiers import in_campaign, keeps

VAN_DER_POL = 6.6632868593231301896996820305  # its period at mu = 1


def van_der_pol(mu: float) -> gw.System:
    """The oscillator in the scale ``x / sqrt(mu)``, in which motions begin at mu = 0 with amplitude 0."""
    return gw.System(["x"], [1.0], contacts=[gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=mu)])


def belt(damping: float) -> gw.System:
    """A mass on a belt of speed 1: friction falls with the slip rate, and is Coulomb's where it sticks."""
    falling = gw.force("falling", {"x": 1.0}, "k3*(v - V)**3 - k1*(v - V)", k1=0.5, k3=0.1, V=1.0)
    friction = gw.friction("belt", {"x": 1.0}, 0.4, speed=1.0)
    return gw.System(["x"], [1.0], [damping], contacts=[friction, falling])


@pytest.fixture(scope="module")
def found() -> SelfExcited:
    return gw.free.self_excited(van_der_pol(-0.5), "damper.mu", 1.0)


def test_van_der_pol_from_its_hopf_point(found):
    (hopf,), (cycle,) = found.hopf_points, found.cycles
    assert (hopf.value, hopf.frequency) == pytest.approx((0.0, 1.0), abs=1e-12)
    assert cycle.points[-1].value == 1.0
    assert cycle.points[-1].orbit.duration == pytest.approx(VAN_DER_POL, rel=1e-12)
    assert cycle.ends[0].reason is EndReason.BRANCHED
    assert all(point.stable for point in cycle.points[1:])
    # near its beginning the amplitude is 2 sqrt(mu), and the frequency 1 - mu^2 / 16
    second = cycle.points[2]
    assert second.measure("half.x") == pytest.approx(2.0 * np.sqrt(second.value), rel=1e-4)
    assert second.orbit.system.frequency == pytest.approx(1.0 - second.value**2 / 16.0, abs=1e-8)


def test_the_trivial_multiplier_is_one_and_the_other_the_integral_of_the_divergence(found):
    for point in found.cycles[0].points[5::20]:
        orbit, mu = point.orbit, point.value
        trivial, other = sorted(orbit.multipliers.real, key=lambda each: abs(each - 1.0))
        assert trivial == 1.0
        found_by_scipy = solve_ivp(
            lambda t, y, mu=mu: [y[1], -y[0] - (y[0] ** 2 - mu) * y[1], mu - y[0] ** 2],
            (0.0, orbit.duration),
            [*orbit.state, 0.0],
            rtol=1e-12,
            atol=1e-13,
        )
        assert found_by_scipy.y[:2, -1] == pytest.approx(orbit.state, abs=1e-9)
        assert other == pytest.approx(np.exp(found_by_scipy.y[2, -1]), rel=1e-7)


def test_verification_passes_and_finds_a_fault(found):
    assert gw.verify(found).ok
    cycle = found.cycles[0]
    points = list(cycle.points)
    wrong = dataclasses.replace(points[9].orbit, state=1.01 * points[9].orbit.state)
    points[9] = dataclasses.replace(points[9], orbit=wrong, memo={})
    faulty = dataclasses.replace(found, cycles=(dataclasses.replace(cycle, points=tuple(points)),))
    assert not gw.verify(faulty).ok
    rest = found.rests[0]
    moved = dataclasses.replace(rest.points[7], eigenvalues=rest.points[7].eigenvalues + 1e-4)
    moved_rest = dataclasses.replace(rest, points=(*rest.points[:7], moved, *rest.points[8:]))
    assert not gw.verify(moved_rest).ok


@pytest.mark.slow
@pytest.mark.parametrize("is_verified", [False, in_campaign(True)])
def test_motions_end_at_the_second_hopf_point(is_verified):
    """Damping ``x^2 - p (1 - p)``: motions of amplitude ``2 sqrt(p (1 - p))`` at first order, between p = 0 and 1."""
    damper = gw.force("damper", {"x": 1.0}, "(x*x - p*(1 - p))*v", p=0.5)
    found = gw.free.self_excited(gw.System(["x"], [1.0], contacts=[damper]), "damper.p", (-0.5, 1.5))
    assert [hopf.value for hopf in found.hopf_points] == pytest.approx([0.0, 1.0], abs=1e-12)
    (cycle,) = found.cycles  # the second Hopf point is its end
    assert cycle.ends[-1].reason is EndReason.AT_REST
    assert cycle.ends[-1].detail == "near damper.p = 1"
    assert not is_verified or gw.verify(found).ok


def test_a_subcritical_hopf_point_and_the_fold():
    """Damping ``x^4 - x^2 - mu``: by averaging ``r^4 / 8 - r^2 / 4 - mu = 0``, with a fold at ``mu = -1/8``, r = 1."""
    damper = gw.force("damper", {"x": 1.0}, "(x**4 - x**2 - mu)*v", mu=-0.5)
    found = gw.free.self_excited(gw.System(["x"], [1.0], contacts=[damper]), "damper.mu", 0.3)
    (fold,) = found.cycles[0].special("fold")
    with pytest.raises(ModelError, match="loci of such motions are not followed"):
        gw.follow_locus(fold, "damper.mu", "stiffness.x.x", ((-0.3, 0.1), (0.8, 1.2)))
    with pytest.raises(ModelError, match="no gradients here"):
        sensitivity(fold.orbit, ["damper.mu"])
    assert fold.value == pytest.approx(-0.125, abs=2e-5)
    assert fold.point.measure("half.x") == pytest.approx(1.0, abs=2e-3)
    assert fold.before.total == 1
    assert fold.after.total == 0
    assert not found.cycles[0].points[1].stable


def test_a_contact_is_first_touched():
    """Until then the motion is that of the oscillator without a stop, whose largest x is the clearance."""
    stop = gw.stop("stop", {"x": 1.0}, 0.5, 10.0)
    damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=-0.5)
    found = gw.free.self_excited(gw.System(["x"], [1.0], contacts=[damper, stop]), "damper.mu", 1.0)
    (touch,) = found.cycles[0].special("grazing")
    free = gw.free.find_self_excited(van_der_pol(touch.value))
    assert free.measure("max.x") == pytest.approx(0.5, abs=1e-10)
    assert touch.contact == "stop +"
    assert gw.verify(found.cycles[0]).ok


def test_a_rotor_whirls_on_a_circle():
    """Cross-coupling k2 and a force ``g r^2 (x, y)``: ``w = k2 / c``, ``r^2 = (w^2 - k) / g``."""
    c, k, k2, g = 0.1, 1.0, 0.15, 0.5
    both = {"x": {"x": 1.0}, "y": {"y": 1.0}}
    springs = [
        gw.force("one", both, "g*(x*x + y*y)*x", g=g, acts_on={"x": 1.0}),
        gw.force("two", both, "g*(x*x + y*y)*y", g=g, acts_on={"y": 1.0}),
    ]
    rotor = gw.System(["x", "y"], [[k, k2], [-k2, k]], [[c, 0.0], [0.0, c]], contacts=springs)
    orbit = gw.free.find_self_excited(rotor)
    w = k2 / c
    assert orbit.system.frequency == pytest.approx(w, rel=1e-10)
    assert orbit.measure("max.x") == pytest.approx(np.sqrt((w**2 - k) / g), rel=1e-9)
    assert orbit.measure("max.y") == pytest.approx(np.sqrt((w**2 - k) / g), rel=1e-9)
    assert orbit.stable
    # along a parameter it stays one: with more damping it slows down to sqrt(k), and shrinks
    branch = gw.free.follow_self_excited(orbit, rotor, "one.g", 0.6)
    assert gw.verify(branch).ok


@pytest.mark.slow
def test_a_mass_on_a_belt_grows_until_it_sticks():
    """Hopf point at ``c = k1 - 3 k3 V^2``; stick begins where the mass first reaches the speed of the belt."""
    found = gw.free.self_excited(belt(0.3), "damping.x.x", 0.0)
    (hopf,), (cycle,) = found.hopf_points, found.cycles
    assert hopf.value == pytest.approx(0.5 - 3 * 0.1, abs=1e-12)
    (stick,) = cycle.special("grazing-sliding")
    assert stick.point.measure("max.x'") == pytest.approx(1.0, abs=1e-6)  # sampled
    before = [point for point in cycle.points if point.value > stick.value + 1e-6]
    assert all(point.measure("max.x'") < 1.0 for point in before)
    assert cycle.points[-1].orbit.pattern == "belt 1 stick"
    # slip and stick by SciPy, with the belt force in slip and its end where the spring overcomes it
    sticking = [point for point in cycle.points if 0.02 < point.value < stick.value - 1e-3]
    for point in sticking[::10]:
        assert _duration(point.orbit) == pytest.approx(_stick_slip_period(point.value), rel=1e-8)
    assert gw.verify(cycle).ok


def _duration(orbit: gw.Orbit) -> float:
    assert isinstance(orbit, FreeOrbit)
    return orbit.duration


def _stick_slip_period(c: float) -> float:
    """Return the period of the mass on the belt: one phase of slip, integrated, and one of stick, in closed form."""
    begins = 0.4 - c  # slip begins where spring and damper balance the limit: x + c = 0.4

    def slips(t, y):
        rate = y[1] - 1.0
        return [y[1], -y[0] - c * y[1] + 0.4 - (0.1 * rate**3 - 0.5 * rate)]

    def sticks(t, y):
        return y[1] - 1.0 if t > 0.5 else -1.0

    sticks.terminal, sticks.direction = True, 1.0  # pyright: ignore[reportFunctionMemberAccess]
    slip = solve_ivp(slips, (0.0, 20.0), [begins, 1.0 - 1e-15], rtol=1e-12, atol=1e-13, events=sticks)
    return float(slip.t[-1] + begins - slip.y[0, -1])


def test_a_motion_is_found_from_a_state():
    orbit = gw.free.find_self_excited(van_der_pol(1.0), [0.3, 0.1])
    assert orbit.duration == pytest.approx(VAN_DER_POL, rel=1e-12)
    assert (orbit.coordinate, orbit.stable) == ("x", True)
    back = gw.free.follow_self_excited(orbit, van_der_pol(1.0), "damper.mu", -0.5)
    assert back.ends[-1].reason is EndReason.AT_REST
    # gw.follow knows that its frequency is an unknown
    ahead = gw.follow(orbit, "damper.mu", 2.0)
    assert isinstance(ahead.points[-1].orbit, FreeOrbit)
    assert ahead.points[-1].value == 2.0
    with pytest.raises(ConvergenceError, match="dies away"):
        gw.free.find_self_excited(van_der_pol(-0.5), [0.3, 0.1])
    with pytest.raises(ConvergenceError, match="no equilibrium is unstable"):
        gw.free.find_self_excited(van_der_pol(-0.5))


@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_the_unit_of_length_does_not_matter(unit):
    damper = gw.force("damper", {"x": 1.0}, "(g*x*x - mu)*v", g=unit**-2, mu=-0.5)
    system = gw.System(["x"], [1.0], contacts=[damper], mean={"x": 0.3 * unit})
    found = gw.free.self_excited(system, "damper.mu", 1.0)
    plain = gw.System(["x"], [1.0], contacts=[gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=-0.5)])
    expected = gw.free.self_excited(plain.at({"mean.x": 0.3}), "damper.mu", 1.0)
    one, other = (each.cycles[0].points[-1].orbit for each in (found, expected))
    assert one.measure("max.x") == pytest.approx(unit * other.measure("max.x"), rel=1e-9)
    orbit = gw.free.find_self_excited(system.at({"damper.mu": 1.0}))
    assert orbit.duration == pytest.approx(_duration(other), rel=1e-9)
    with pytest.raises(ConvergenceError, match="dies away"):
        gw.free.find_self_excited(system, [0.5 * unit, 0.0])


@pytest.mark.slow
def test_hysteresis_and_impacts_take_part():
    """A spring that slips takes energy: over a period its work is that of the self-excitation, by quadrature."""
    damper = gw.force("damper", {"x": 1.0}, "(x*x - mu)*v", mu=1.0)
    jenkins = gw.friction("jenkins", {"x": 1.0}, 0.1, stiffness=0.5)
    orbit = gw.free.find_self_excited(gw.System(["x"], [1.0], contacts=[damper, jenkins]), [1.0, 0.0])
    assert orbit.stable
    motion = orbit.motion(4096)
    q, v = motion.q[:-1, 0], motion.v[:-1, 0]
    gained = -np.mean((q * q - 1.0) * v * v) * _duration(orbit)
    swing = np.ptp(q)  # the loop of a spring 0.5 that slips at 0.1: its width is the swing less twice 0.1 / 0.5
    assert gained == pytest.approx(2.0 * 0.1 * (swing - 2.0 * 0.1 / 0.5), rel=1e-5)
    wall = gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8)
    system = gw.System(["x"], [1.0], contacts=[damper, wall])
    rebounding = gw.free.find_self_excited(system, [0.5, 0.0])
    branch = gw.free.follow_self_excited(rebounding, system, "damper.mu", (0.5, 1.5))
    assert {point.orbit.pattern for point in branch.points} == {"1+"}
    assert gw.verify(branch).ok


@pytest.mark.slow
def test_a_doubled_motion_leaves_a_flip():
    """Two masses of which one excites itself and the other meets a stop: a motion of twice the period branches off."""
    damper = gw.force("damper", {"a": 1.0}, "(x*x - mu)*v", mu=0.2)
    stop = gw.stop("stop", {"b": 1.0}, 1.0, 20.0)
    pair = gw.System(["a", "b"], [[1.5, -0.5], [-0.5, 1.8]], [[0.0, 0.0], [0.0, 0.1]], contacts=[damper, stop])
    orbit = gw.free.find_self_excited(pair)
    cycle = gw.free.follow_self_excited(orbit, pair, "damper.mu", 0.7)
    (flip,) = cycle.special("flip")
    doubled = gw.free.follow_self_excited(flip, pair, "damper.mu", (0.2, 0.7))
    assert doubled.period == 2
    assert gw.verify(doubled).ok
    # the doubled motion is one by SciPy too: it closes after two turns and not after one
    orbit = doubled.points[len(doubled.points) // 2].orbit
    mu, k = orbit.system["damper.mu"], 20.0

    def rates(t, y):
        a, b = y[:2]
        pull = k * max(b - 1.0, 0.0)
        return [y[2], y[3], -1.5 * a + 0.5 * b - (a * a - mu) * y[2], 0.5 * a - 1.8 * b - 0.1 * y[3] - pull]

    half = _duration(orbit) / 2.0
    found = solve_ivp(rates, (0.0, 2.0 * half), orbit.state, rtol=1e-11, atol=1e-12, t_eval=[half, 2.0 * half])
    assert np.abs(found.y[:, 1] - orbit.state).max() < 1e-7
    assert np.abs(found.y[:, 0] - orbit.state).max() > 1e-3


def test_what_is_no_free_motion_is_refused():
    loaded = gw.System(["x"], [1.0], [0.1], harmonics=[gw.Harmonic(0.1, {"x": 1.0})])
    with pytest.raises(ModelError, match="a free motion has no excitation, and harmonic1 acts"):
        gw.find_orbit(loaded, method=gw.free.FreeShooting())
    with pytest.raises(ModelError, match="unknown of free motions"):
        gw.free.FreeShooting().pose(van_der_pol(1.0), "frequency")
    with pytest.raises(ModelError, match="must be one of x"):
        gw.free.find_self_excited(van_der_pol(1.0), [1.0, 0.0], "y")
    with pytest.raises(ModelError, match="a free motion is needed"):
        gw.free.follow_self_excited(cast(Any, gw.find_orbit(loaded)), van_der_pol(1.0), "damper.mu", 2.0)
    rests = gw.free.follow_rest(van_der_pol(-0.5), "damper.mu", 0.5)
    with pytest.raises(ModelError, match="write a range, such as"):
        gw.free.follow_self_excited(rests.hopf_points[0], van_der_pol(1.0), "damper.mu", 2.0)
    assert gw.free.without_excitation(loaded)["harmonic1.amplitude"] == 0.0


@pytest.mark.parametrize("turns", [2, 3, 4, 6])
def test_a_motion_that_was_found_over_several_periods_has_the_shortest(turns: int) -> None:
    """Where a motion settles by turns, a multiple of its period repeats first; van der Pol's is 6.663286859."""
    oscillator = van_der_pol(1.0)
    orbit = gw.free.find_self_excited(oscillator)
    several = _exact(orbit.system, orbit.state, float(turns), 0)
    assert several.duration == pytest.approx(turns * orbit.duration, rel=1e-9)
    found = _shortest(several, turns, 0)
    assert found.duration == pytest.approx(6.663286859, rel=1e-9)
    assert found.state == pytest.approx(orbit.state, abs=1e-8)
    assert _shortest(orbit, turns, 0) is orbit


def test_two_blocks_on_a_belt_repeat_after_half_of_what_was_given() -> None:
    """Its multiplier is near -1, so that they settle by turns: 29.6298 was given, with the square of it."""
    stiffness, speed, falls = 0.5707991778636574, 0.16214163824978198, 0.21179737789356254
    contacts = [gw.friction(f"belt{name}", {name: 1.0}, 1.0, speed=speed) for name in "ab"]
    contacts += [gw.force(f"falls{name}", {name: 1.0}, "-d*(v - V)", d=falls, V=speed) for name in "ab"]
    mass, coupling = [1.0, 1.5059366220404455], [[1.0 + stiffness, -stiffness], [-stiffness, 1.0 + 1.1 * stiffness]]
    orbit = gw.free.find_self_excited(
        gw.System(["a", "b"], coupling, mass=mass, contacts=contacts), [0.0, 0.1, 0.0, 0.0]
    )
    assert orbit.duration == pytest.approx(29.629752614 / 2.0, rel=1e-8)
    multiplier = min(orbit.free_multipliers, key=lambda each: each.real)
    assert multiplier == pytest.approx(-np.sqrt(0.895006974), rel=1e-6)
    once, twice = orbit.strobes(3)[1:]
    assert once == pytest.approx(orbit.state, abs=1e-9)
    assert twice == pytest.approx(orbit.state, abs=1e-9)


def _leaving(cubic: float) -> float:
    """Return the amplitude at which ``(x*x - 1)*v`` does no work over a period of ``x'' = -x - cubic*x**3``."""

    def work(amplitude: float) -> float:
        height = lambda x: 0.5 * x**2 + 0.25 * cubic * x**4  # noqa: E731
        speed = lambda x: np.sqrt(2.0 * max(height(amplitude) - height(x), 0.0))  # noqa: E731
        return quad(lambda x: (x**2 - 1.0) * speed(x), 0.0, amplitude, epsabs=1e-13, limit=200)[0]

    return float(brentq(work, 0.5, 4.0, xtol=1e-13))


@pytest.mark.slow
@keeps("0.0-1.0")
@pytest.mark.parametrize(("cubic", "unit"), [(0.0, 1.0), in_campaign(1.0, 1.0), (0.3, 1e3), in_campaign(0.0, 1e-6)])
def test_motions_leave_a_centre_where_small_damping_does_no_work(cubic: float, unit: float) -> None:
    law = "mu*((x/u)**2 - 1)*v + c*(x/u)**2*x"
    damper = gw.force("damper", {"x": 1.0}, law, mu=-0.5, c=cubic, u=unit)
    system = gw.System(["x"], [1.0], contacts=[damper])
    found = gw.free.self_excited(system, "damper.mu", 1.0)
    centre, cycle = found.cycles
    assert centre.ends[-1].reason is EndReason.CENTRE
    assert len(centre.points) == 201
    (point,) = centre.special("branch-point")
    amplitude = _leaving(cubic) * unit
    assert point.orbit.measure("half.x") == pytest.approx(amplitude, rel=1e-8)
    assert point.value == pytest.approx(0.0, abs=1e-12)
    assert [end.reason for end in cycle.ends] == [EndReason.RANGE, EndReason.RANGE]
    near = min(cycle.points, key=lambda each: abs(each.value - 1e-2))
    assert near.measure("half.x") == pytest.approx(amplitude, rel=max(1e-6, near.value**2))
    assert cycle.points[0 if cycle.points[0].value == 1.0 else -1].value == 1.0
    if cubic == 0.0:
        assert _duration(cycle.points[0].orbit) == pytest.approx(VAN_DER_POL, rel=1e-12)
    ledger = Ledger()
    verify_branches(ledger, [("centre", centre), ("cycle", cycle)])
    assert not ledger.verification.breaches
