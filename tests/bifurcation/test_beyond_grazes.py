"""Motions beyond a graze: the map of a touch against exact matrices, its verdicts against motions that settle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.bifurcation.touch_map import Beyond, beyond, touch_map, windows_beyond
from gapwalk.continuation.walk import EndReason
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.model.coefficients import coefficients_of
from tests.tiers import in_campaign

KINDS = ("rigid", "preloaded", "soft", "pushing")


def contact(kind: str, random: np.random.Generator) -> gw.Contact:
    """A contact of some kind at 1, with random numbers."""
    along = {"x": 1.0}
    if kind == "rigid":
        return gw.rigid_stop("s", along, 1.0, restitution=random.uniform(0.3, 0.95))
    if kind == "soft":
        return gw.stop("s", along, 1.0, 10.0 ** random.uniform(0.3, 2.0))
    numbers = {"preload": random.uniform(0.2, 3.0)} if kind == "preloaded" else {}
    stages = [gw.Stage(1.0, random.uniform(1.0, 10.0), side="positive", numbers=numbers)]
    if kind == "preloaded":
        return gw.Contact("s", along, stages, law="piecewise")
    return gw.Contact("s", along, stages, law=kind, viscous_damping=10.0 ** random.uniform(-1.0, 1.0))


class Grazing:
    """A linear oscillator of one or two coordinates whose motion just touches its contact, in closed form."""

    def __init__(self, kind: str, seed: int) -> None:
        random = np.random.default_rng([seed, KINDS.index(kind) if kind in KINDS else 9])
        size, damping, self.frequency = (
            random.choice([1, 1, 2]),
            10.0 ** random.uniform(-1.3, 0.6),
            random.uniform(0.4, 3),
        )
        coupling = random.uniform(0.3, 2.0)
        self.names, self.mass = ["x", "y"][:size], np.eye(size)
        self.stiffness, self.damping = np.array([[1.0]]), np.array([[damping]])
        if size == 2:
            self.stiffness = np.array([[1.0 + coupling, -coupling], [-coupling, random.uniform(0.2, 1.0) + coupling]])
            self.damping = 0.5 * damping * self.stiffness + 0.05 * np.eye(2)
        self.contact = contact(kind, random)
        dynamic = self.stiffness - self.frequency**2 * self.mass + 1j * self.frequency * self.damping
        self.response = np.linalg.solve(dynamic, np.eye(size)[0])
        self.amplitude = 1.0 / abs(self.response[0])

    def system(self, depth: float) -> gw.System:
        """The system whose motion without the contact would be this deep in it."""
        load = gw.Harmonic(self.amplitude * (1.0 + depth), {"x": 1.0})
        matrices = {"mass": self.mass, "stiffness": self.stiffness, "damping": self.damping}
        return gw.System(self.names, **matrices, contacts=[self.contact], harmonics=[load], frequency=self.frequency)

    def start(self, depth: float) -> np.ndarray:
        """The state of that motion without the contact."""
        moved = self.response * self.amplitude * (1.0 + depth)
        return np.concatenate((moved.real, (1j * self.frequency * moved).real))

    def orbit(self) -> gw.Orbit:
        """The motion that just does not touch."""
        return gw.find_orbit(self.system(-1e-10), start=self.start(-1e-10))

    def settled(self, depth: float) -> tuple[int, float]:
        """The period of what settles from there, 0 if it has none, and the greatest depth of its touches."""
        motion = gw.settle(self.system(depth), start=self.start(depth))
        if motion.orbit is not None:
            return motion.orbit.period, max(motion.orbit.turning_depths[0].values)
        after = gw.integrate(motion.system, motion.state, periods=200, samples=200 * 64)
        speeds = [each.velocity for each in after.contacts if each.closes]
        return 0, 0.5 * (max(speeds, default=0.0) / self.frequency) ** 2


def is_right(grazing: Grazing, found: Beyond) -> bool:
    """Return True if settled motions are as stated."""
    if " or " in found.verdict:
        return any(is_right(grazing, replace(found, verdict=each)) for each in found.verdict.split(" or "))
    if found.verdict == "goes on":
        depth = min(1e-5 if found.order > 1.0 else 1e-7, 0.02 * found.depth)
        (first, there), (second, nearer) = grazing.settled(depth), grazing.settled(0.1 * depth)
        return first == second == 1 and 0.05 < nearer / there < 0.2
    if found.verdict == "jumps" and found.depth < math.inf:  # as deep as stated, wherever it began
        depths = [grazing.settled(share * found.depth)[1] for share in (1e-2, 1e-3)]
        return depths[0] == pytest.approx(depths[1], rel=0.5) and 0.05 < depths[1] / found.depth < 1.5
    if found.verdict == "jumps":
        return grazing.settled(1e-8)[1] > max(1e-7, 0.3 * grazing.settled(1e-7)[1])
    depth = 1e-5 if found.verdict == "doubles" else 1e-6
    period, deepest = grazing.settled(depth)
    if not deepest < 100.0 * depth:
        return False
    if found.verdict == "period adding":
        settled = {
            each: grazing.settled(each)[0] for each in (1e-5, depth, *([depth / found.ratio] * (found.ratio < 30.0)))
        }
        windows = windows_beyond(touch_map(grazing.orbit(), 0), max(settled.values()))
        own = [(each, windows[period - 1]) for each, period in settled.items() if period]
        return len(own) == len(settled) and all(each.begin / 1.1 < d < 1.2 * each.end for d, each in own)
    if found.verdict == "doubles" or found.verdict[-1].isdigit():
        return period == (2 if found.verdict == "doubles" else int(found.verdict.split()[1]))
    return "period adding" in found.verdict or period == 0 or period > 8


def tried(kind: str, seed: int) -> str:
    """The verdict of a random graze, with ``wrong`` before it if motions contradict."""
    grazing = Grazing(kind, seed)
    found = beyond(touch_map(grazing.orbit(), 0))
    right = found.verdict == "unknown" or is_right(grazing, found)
    return found.verdict if right else f"wrong: {found}"


@pytest.mark.parametrize("kind", KINDS)
def test_motions_settle_as_the_touch_foretells(kind):
    verdicts = [tried(kind, seed) for seed in range(3)]
    assert not [each for each in verdicts if "wrong" in each], verdicts
    assert verdicts.count("unknown") < 2, verdicts


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_two_hundred_grazes(kind):
    verdicts = [tried(kind, seed) for seed in range(100, 150)]
    assert not [each for each in verdicts if "wrong" in each], verdicts
    assert verdicts.count("unknown") <= 1, verdicts  # 195 of 200


@pytest.mark.parametrize("kind", [*KINDS, "viscous"])
def test_a_touch_changes_states_and_matrices_by_its_leading_term(kind):
    grazing = Grazing(kind, 3)
    orbit = grazing.orbit()
    touch = touch_map(orbit, 0)
    flow, numbers = flow_of(orbit.system, transition=True), coefficients_of(orbit.system)
    way = touch.covector / (touch.covector @ touch.covector)
    free = flow.integrate(numbers, orbit.state - 1e-9 * way, 0.0, PERIOD)
    off = []
    for depth in (1e-5, 1e-7):
        there = flow.integrate(numbers, orbit.state + depth * way, 0.0, PERIOD)
        moved = there.state - free.state - free.transition @ ((depth + 1e-9) * way)
        changed = touch.order * depth ** (touch.order - 1.0) * np.outer(touch.vector, touch.covector)
        pairs = (moved, touch.vector * depth**touch.order), (there.transition - free.transition, changed)
        off.append(max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs))
    assert off[0] < 0.1
    assert off[1] < max(0.2 * off[0], 5e-3)  # what is neglected is smaller by a root of the depth


def test_one_rigid_stop_in_closed_form():
    c, restitution, w = 0.1, 0.8, 2.3
    amplitude = math.hypot(1.0 - w * w, c * w)
    stop = gw.rigid_stop("s", {"x": 1.0}, 1.0, restitution=restitution)
    load = gw.Harmonic(amplitude * (1.0 - 1e-11), {"x": 1.0})
    system = gw.System(
        ["x"], mass=[[1.0]], stiffness=[[1.0]], damping=[[c]], contacts=[stop], harmonics=[load], frequency=w
    )
    moved = amplitude / (1.0 - w * w + 1j * c * w)
    touch = touch_map(gw.find_orbit(system, start=[moved.real, (1j * w * moved).real]), 0)
    assert touch.order == 0.5
    assert touch.coefficient == pytest.approx(-(1.0 + restitution) * math.sqrt(2.0) * w, rel=1e-9)
    damped, times = math.sqrt(1.0 - c * c / 4.0), 2.0 * math.pi / w * np.arange(1, 6)
    returns = touch.coefficient * np.exp(-0.5 * c * times) * np.sin(damped * times) / damped
    assert touch.sequence(5) == pytest.approx(returns, rel=1e-9)


def strongly_damped() -> tuple[gw.System, float]:
    """An oscillator whose windows of period adding overlap, and the amplitude of its graze."""
    c, w = 2.5, 2.0
    amplitude = abs(1.0 - w * w + 1j * c * w)
    stop = gw.rigid_stop("stop", {"x": 1.0}, 1.0, restitution=0.8, side="positive")
    load, matrices = gw.Harmonic(0.98 * amplitude, {"x": 1.0}, name="f"), {"mass": [[1.0]], "stiffness": [[1.0]]}
    return gw.System(["x"], **matrices, damping=[[c]], contacts=[stop], harmonics=[load], frequency=w), amplitude


@pytest.mark.parametrize(
    ("period", "depth", "low"), [(3, 2e-3, 3e-5), in_campaign(4, 8e-5, -1e-6), in_campaign(5, 4e-6, 7e-8)]
)
def test_motions_of_the_windows_lead_back_to_the_graze(period, depth, low):
    # beyond the end of a window the motion touches twice, ever more softly: multipliers grow to 1e7
    system, amplitude = strongly_damped()
    start = gw.settle(system, **{"f.amplitude": amplitude * (1.0 + depth)}).orbit
    assert start.period == period
    branch = gw.follow(start, "f.amplitude", (amplitude * (1.0 + low), amplitude * (1.0 + 60.0 * depth)))
    for end in branch.ends:
        distance, is_graze = end.value / amplitude - 1.0, end.reason is EndReason.WITHIN_ROUNDING
        assert distance == pytest.approx(0.0 if is_graze else low, abs=1e-11)
        assert is_graze or end.reason in (EndReason.RANGE, EndReason.TURNED_BACK)


def test_windows_of_period_adding_are_named_in_the_table():
    system, amplitude = strongly_damped()
    branch = gw.follow(gw.find_orbit(system), "f.amplitude", (0.97 * amplitude, 1.001 * amplitude))
    graze = branch.special("grazing")[0]
    assert graze.value == pytest.approx(amplitude, abs=1e-10)
    assert graze.beyond.ratio == pytest.approx(math.exp(math.pi), rel=1e-6)
    assert graze.words["criticality"] == "period adding, windows by 23.14"
