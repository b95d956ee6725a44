"""Forces by formula, variations and prescribed displacements in what is computed from motions, beside closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.symmetry import symmetries_of
from gapwalk.model.contact import Contact, Stage, force
from gapwalk.model.loads import Harmonic
from gapwalk.model.loads.load import Rectangle
from gapwalk.orbit.orbit import repeats
from gapwalk.plot.motions import breakpoints
from tests.verification.test_variations import W, drag, gear, orbit_of, stop_depth, stop_rates

PERIOD = 2.0 * math.pi / W


def dragged(*loads, law: str = "c*v*abs(v)", **numbers: float) -> gw.System:
    contact = force("drag", {"x": 1.0}, law, **(numbers or {"c": 0.3}))
    return gw.System(
        ["x"], [[1.0]], [[0.05]], contacts=[contact], harmonics=loads or [Harmonic(1.0, {"x": 1.0})], frequency=W
    )


def gap(*loads) -> gw.System:
    mesh = Contact("mesh", {"x": 1.0}, [Stage(0.4, 3.0)])
    return gw.System(
        ["x"], [[1.0]], [[0.1]], contacts=[mesh], harmonics=[Harmonic(0.6, {"x": 1.0}), *loads], frequency=W
    )


def history(rates, state, n: int):
    """The motion over a period as SciPy continues it, with short steps."""
    found = solve_ivp(rates, (0.0, PERIOD), state, "DOP853", rtol=1e-12, atol=1e-13, max_step=0.002, dense_output=True)
    return found.sol, found.t


def test_the_power_of_drag_is_the_integral_of_its_cube() -> None:
    orbit = gw.find_orbit(dragged(), 1, [1.0, 0.0])
    load = gw.analysis.rattle(orbit).contacts[0]

    def rates(t, y):
        return [y[1], math.cos(W * t) - y[0] - 0.05 * y[1] - 0.3 * y[1] * abs(y[1])]

    motion, knots = history(rates, orbit.state, 1)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    t = (knots[:-1, None] + 0.5 * np.diff(knots)[:, None] * (nodes + 1.0)).ravel()
    speed = np.abs(motion(t)[1])
    share = (0.5 * np.diff(knots)[:, None] * weights).ravel() / PERIOD
    assert load.power == pytest.approx(share @ (0.3 * speed**3), rel=1e-8)
    assert load.rms == pytest.approx(math.sqrt(share @ (0.3 * speed**2) ** 2), rel=1e-8)
    assert load.peak == pytest.approx(0.3 * speed.max() ** 2, rel=1e-5)
    assert math.isnan(load.closed)
    assert not gw.analysis.rattle(orbit).impacts
    # what the load feeds in is dissipated
    feeding = share @ (np.cos(W * t) * motion(t)[1])
    assert feeding == pytest.approx(load.power + share @ (0.05 * speed**2), rel=1e-8)


def test_a_stop_that_moves_dissipates_by_the_rate_of_its_own_deflection() -> None:
    orbit = orbit_of("stop")
    rattle = gw.analysis.rattle(orbit)
    motion, _ = history(stop_rates, orbit.state, 1)
    t = np.linspace(0.0, PERIOD, 400_001)
    y = motion(t)
    depth = np.array([stop_depth(a, b) for a, b in zip(t.tolist(), y.T.tolist(), strict=True)])
    rate = y[1] + 0.2 * W * np.sin(2.0 * W * t + 0.5)
    power = np.trapezoid(np.where(depth > 0.0, 0.1 * rate**2, 0.0), t) / PERIOD
    assert rattle.contacts[0].power == pytest.approx(power, rel=1e-5)
    assert rattle.contacts[0].closed == pytest.approx(np.mean(depth > 0.0), abs=1e-5)
    (impact,) = rattle.impacts
    entry = np.flatnonzero((depth[:-1] <= 0.0) & (depth[1:] > 0.0))[0]
    assert impact.velocity == pytest.approx(abs(rate[entry]), rel=1e-4)
    assert impact.theta == pytest.approx(W * t[entry], abs=1e-4)


def test_loops_of_formulas_have_the_loss_of_the_closed_form() -> None:
    load = Harmonic(1.0, {"x": 1.0})
    for varying in ((), (Harmonic(0.4, varies="drag.c", order=1, name="wave"), Rectangle(0.3, {"drag.c": 1.0}))):
        loop = gw.analysis.hysteresis(dragged(load, *varying), 1.5)  # numbers that vary have their mean value
        assert loop.loss == pytest.approx(8.0 / 3.0 * 0.3 * W**2 * 1.5**3, rel=1e-13)
    law = "k*max(x - gap, 0) + c*max(v, 0)*max(x - gap, 0)"
    loop = gw.analysis.hysteresis(dragged(load, law=law, k=2.0, c=0.5, gap=0.3), 1.5)
    # only while it moves outwards: the integral of c v (x - gap) over x
    expected, _ = quad(lambda x: 0.5 * W * math.sqrt(1.5**2 - x**2) * (x - 0.3), 0.3, 1.5)
    assert loop.loss == pytest.approx(expected, rel=1e-8)
    with pytest.raises(ModelError, match=r"2 deflections \(r, s\)"):
        gw.analysis.hysteresis(drag(), 1.0, "pair")


def test_a_plane_that_would_move_is_refused() -> None:
    with pytest.raises(ModelError, match="prescribed displacement"):
        gw.analysis.impact_plane(gear(), "mesh")
    with pytest.raises(ModelError, match="no stage"):
        gw.analysis.impact_plane(dragged(), "drag")


@pytest.mark.parametrize(
    ("system", "symmetric"),
    [
        (gap(), True),
        (gap(Harmonic(0.1, varies="mesh.deflection", name="sway")), True),
        (gap(Harmonic(0.1, varies="mesh.deflection", order=2)), False),
        (gap(Harmonic(0.1, varies="mesh.stiffness", order=2)), True),
        (gap(Harmonic(0.1, varies="mesh.stiffness", order=3)), False),
        (gap(Rectangle(0.1, {"mesh.stiffness": 1.0}, order=2, share=0.6)), True),
        (gap(Rectangle(0.1, {"mesh.stiffness": 1.0}, order=1, share=0.6)), False),
        (dragged(), True),
        (dragged(law="k*x**3", k=1.0), True),
        (dragged(law="k*x**2", k=1.0), False),
        (dragged(law="k*max(x - gap, 0)", k=1.0, gap=5.0), False),
        (dragged(law="k*max(x - 30, 0)", k=1.0), False),
        (dragged(law="k*max(x - 0.003, 0)", k=1.0), False),
        (dragged(law="k*exp(x)", k=0.1), False),
        (dragged(law="k*max(x - gap, 0) - k*max(-x - gap, 0)", k=1.0, gap=5.0), True),
    ],
)
def test_symmetries_include_variations_and_formulas(system: gw.System, symmetric: bool) -> None:
    found = symmetries_of(system)
    assert [(each.signs, each.shift) for each in found] == ([((-1,), 0.5)] if symmetric else [])


def test_cycles_of_two_levels_count_as_repetitions() -> None:
    varied = {"mesh.stiffness": 1.0}
    mesh = Contact("mesh", {"x": 1.0}, [Stage(0.4, 3.0)])

    def system(*loads) -> gw.System:
        return gw.System(["x"], [[1.0]], contacts=[mesh], harmonics=loads)

    assert repeats(system(Harmonic(0.1, {"x": 1.0}, order=6), Rectangle(0.1, varied, order=3))) == 3
    assert repeats(system(Harmonic(0.1, {"x": 1.0}, order=2), Rectangle(0.1, varied, order=3))) == 1
    assert repeats(system(Rectangle(0.1, varied, order=4))) == 4


def test_breakpoints_of_a_picture_move_with_the_displacement() -> None:
    motion = orbit_of("stop").motion(64)
    (levels,) = breakpoints(motion, "x")
    assert levels == pytest.approx(0.4 + 0.1 * np.cos(2.0 * motion.theta + 0.5), abs=1e-14)
    first, second = breakpoints(orbit_of("gear").motion(64), "x")
    assert sorted([first[0], second[0]]) == pytest.approx([-1.0 - 0.05 * math.cos(0.4), 1.0 - 0.05 * math.cos(0.4)])
    assert breakpoints(orbit_of("drag").motion(64), "x") == []
    for event in motion.events:  # where the curve meets the motion, the contact changes
        x = np.interp(event.theta, motion.theta, motion.q[:, 0])
        assert x == pytest.approx(0.4 + 0.1 * math.cos(2.0 * event.theta + 0.5), abs=1e-2)


def test_a_summary_says_what_varies_and_shows_formulas() -> None:
    lines = str(drag().summary())
    assert "drag (c*v*abs(v))" in lines
    assert "excitation: unbalance of order 1\n" in lines
    assert (
        "varying: pair.k by wave of order 2, hertz.deflection by shift of order 1, pair.r by sway of order 3" in lines
    )
    assert "varying" not in str(dragged().summary())


def test_motions_under_loads_that_jump_are_sampled_as_they_are_integrated() -> None:
    from gapwalk.flow.flow import flow_of
    from gapwalk.model.coefficients import ParameterLine, coefficients_of

    orbit, name = orbit_of("gear"), "rectangle2.share"
    system = orbit.system
    flow, coefficients = flow_of(system, name, transition=True), coefficients_of(system)
    along = ParameterLine(system, name).coefficients(system[name])[1]
    jump = (0.6 * math.pi - 0.3) / 2.0
    for thetas in (np.linspace(0.0, 6.0, 40), np.array([0.0, jump, 13.0]), np.array([jump, jump + 1.0])):
        found = flow.vary(coefficients, orbit.state, thetas, along)
        for k, theta in enumerate(thetas[1:], start=1):
            arc = flow.integrate(coefficients, orbit.state, float(thetas[0]), float(theta), along)
            np.testing.assert_allclose(found.states[k], arc.state, atol=1e-12)
            np.testing.assert_allclose(found.transitions[k], arc.transition, atol=1e-11)
            np.testing.assert_allclose(found.sensitivities[k][:, 0], arc.sensitivity, atol=1e-11)
