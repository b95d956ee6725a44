"""A third way to find orbits that is not exact, written here in one piece: the trapezoidal rule at some angles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import gapwalk as gw
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.flow.forces import accelerations
from gapwalk.model import Contact, Harmonic, Stage, System
from gapwalk.model.coefficients import layout_of
from gapwalk.orbit import Evaluation, Method, Orbit, OrbitEquation, register
from gapwalk.orbit.method import METHODS
from tests.tiers import in_campaign

TINY = 1e-30  # a complex step


@dataclass(frozen=True, slots=True)
class Trapezoids(Method):
    """The trapezoidal rule between some angles of each forcing period."""

    name: ClassVar[str] = "trapezoids"
    columns: ClassVar[tuple[str, ...]] = ("truncation",)

    nodes: int = 128

    @classmethod
    def resolving(cls, orbit, count):
        return cls(count // len(orbit.state) // orbit.period)

    def pose(self, system, parameter=None, period=1):
        return TrapezoidEquation(system, parameter, period, self)


@dataclass(frozen=True, eq=False, repr=False)
class TrapezoidOrbit(Orbit):
    """What it finds: the states at those angles, and what a step neglects."""

    found_by: ClassVar[str] = "trapezoids"
    is_exact: ClassVar[bool] = False

    states: np.ndarray
    truncation: float

    def strobes(self, count, apart=2.0 * np.pi):
        full = 2.0 * np.pi * self.period
        spline = CubicSpline(np.linspace(0.0, full, len(self.states) + 1), [*self.states, self.states[0]])
        return spline(apart * np.arange(count) % full)


@dataclass(frozen=True)
class TrapezoidEquation(OrbitEquation):
    """``x_(j+1) - x_j = h / 2 (f_j + f_(j+1))`` around the period."""

    options: Trapezoids = Trapezoids()
    tolerance = 1e-10

    @property
    def count(self):
        return self.options.nodes * self.period

    @property
    def step(self):
        return 2.0 * np.pi / self.options.nodes

    def rates(self, states, coefficients):
        n = self.system.size
        q, v = states[:, :n], states[:, n:]
        a = accelerations(layout_of(self.system.structure), coefficients, self.step * np.arange(self.count), q, v)
        return coefficients[0] * np.hstack((v, a))

    def evaluate(self, unknowns, value):
        coefficients, slope = self.coefficients(value)
        x = unknowns.reshape(self.count, -1)
        size, half = x.shape[1], 0.5 * self.step
        f = self.rates(x, coefficients)
        tangents = np.stack(
            [self.rates(x + 1j * TINY * unit, coefficients).imag / TINY for unit in np.eye(size)], axis=2
        )
        by_unknowns = np.zeros((x.size, x.size))
        for j in range(self.count):
            k = (j + 1) % self.count
            rows = slice(j * size, (j + 1) * size)
            by_unknowns[rows, rows] -= np.eye(size) + half * tangents[j]
            by_unknowns[rows, k * size : (k + 1) * size] += np.eye(size) - half * tangents[k]
        residual = np.roll(x, -1, axis=0) - x - half * (f + np.roll(f, -1, axis=0))
        by_parameter = None
        if slope is not None:
            g = self.rates(x + 0j, coefficients + 1j * TINY * slope).imag / TINY
            by_parameter = -half * (g + np.roll(g, -1, axis=0)).ravel()
        return Evaluation(residual.ravel(), by_unknowns, by_parameter, (x, f, tangents))

    def orbit(self, unknowns, value, evaluation):
        _, f, tangents = evaluation.evidence
        x = unknowns.reshape(self.count, -1)
        size, half = x.shape[1], 0.5 * self.step
        around = np.eye(size)
        for a, b in zip(tangents, np.roll(tangents, -1, axis=0), strict=True):
            around = np.linalg.solve(np.eye(size) - half * b, (np.eye(size) + half * a) @ around)
        values = np.linalg.eigvals(around).astype(complex)
        bend = np.abs(np.roll(f, 1, axis=0) - 2.0 * f + np.roll(f, -1, axis=0)).sum(axis=0)
        return TrapezoidOrbit(
            self.system_at(value),
            self.period,
            x[0].copy(),
            values[np.argsort(-np.abs(values))],
            (),
            float(np.abs(evaluation.residual).max()),
            self.count,
            x.copy(),
            float((self.step / 12.0 * bend / np.abs(x).max(axis=0)).max()),
        )

    def unknowns(self, orbit):
        return orbit.strobes(self.count, self.step).ravel()

    def start(self, state):
        return np.tile(state, self.count)

    def scales(self, length, frequency=None):
        n = self.system.size
        unit = np.repeat([length, length * (frequency or self.system.frequency)], n)
        return np.tile(unit, self.count) * np.sqrt(n * self.count)

    def otherwise(self):
        return replace(self, options=Trapezoids(3 * self.options.nodes // 2))

    def embed(self, direction, other):
        x = direction.reshape(self.count, -1)
        full = 2.0 * np.pi * self.period
        spline = CubicSpline(np.linspace(0.0, full, self.count + 1), [*x, x[0]])
        return spline(other.step * np.arange(other.count)).ravel()


@pytest.fixture(scope="module", autouse=True)
def registered():
    register(Trapezoids)
    yield
    del METHODS[Trapezoids.name]


def duffing(frequency):
    """A mass on a spring that stiffens: the force of a contact without a gap, and smooth."""
    stage = Stage(0.0, 0.2, cubic=0.5)
    return System(
        ("x",),
        stiffness=[[1.0]],
        damping=[[0.1]],
        contacts=[Contact("spring", {"x": 1.0}, (stage,))],
        harmonics=[Harmonic(0.3, {"x": 1.0})],
        frequency=frequency,
    )


@pytest.fixture(scope="module", params=[0.04, in_campaign(0.01)])
def branch(request):
    orbit, walk = gw.find_orbit(duffing(0.8), method=Trapezoids()), gw.WalkOptions(largest_step=request.param)
    return gw.follow(orbit, "frequency", to=2.0, method=Trapezoids(), walk=walk)


@pytest.mark.slow
def test_special_points_are_those_of_shooting_but_for_the_truncation(branch):
    shot = gw.follow(gw.find_orbit(duffing(0.8)), "frequency", to=2.0)
    assert [each.kind.value for each in branch.special_points] == [each.kind.value for each in shot.special_points]
    assert len(branch.special("fold")) == 2
    for one, other in zip(branch.special_points, shot.special_points, strict=True):
        assert 1e-8 < abs(one.value - other.value) < 10.0 * one.orbit.truncation
        assert one.nature == other.nature


@pytest.mark.slow
def test_it_verifies_beside_exact_motions(branch):
    found = gw.verify(branch)
    assert found.ok, found.words
    words = {summary.check.word: summary.count for summary in found.summaries}
    assert words["truth"] > 10
    assert not words.get("lines")
    assert not words.get("closure")


def test_a_fault_is_found(branch):
    points = list(branch.points)
    points[7] = replace(points[7], orbit=replace(points[7].orbit, states=1.01 * points[7].orbit.states), memo={})
    assert not gw.verify(replace(branch, points=tuple(points))).ok


def test_its_orbits_lie_on_its_branch(branch):
    curve = Curve(branch)
    assert all(curve.holds(point.orbit) for point in branch.points[::9])
    assert {type(orbit) for orbit in curve.orbits_at(1.2)} == {TrapezoidOrbit}
