"""Hysteresis loops: their areas against closed integrals, and their shape (paper, figure 1)."""

import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model import Contact, Side, Stage
from tests.systems import clutch


def hunt_crossley(beta: float, side: Side = Side.BOTH) -> Contact:
    return Contact("stop", {"x": 1.0}, (Stage(0.5, 3.0, side=side),), None, "hunt-crossley", {"impact_damping": beta})


def side_integral(amplitude: float, depth: float) -> float:
    """Integral of ``(X cos t - b) sin^2 t`` over the part of a turn in which ``X cos t > b``, by hand."""
    t = math.acos(depth / amplitude)
    return 2.0 * (amplitude * math.sin(t) ** 3 / 3.0 - depth * (t / 2.0 - math.sin(2.0 * t) / 4.0))


@pytest.mark.parametrize(("mean", "amplitude", "frequency"), [(0.0, 1.3, 0.7), (0.4, 1.3, 2.0), (1.0, 0.3, 1.0)])
def test_the_loss_of_impact_damping_is_the_closed_integral(mean, amplitude, frequency) -> None:
    loop = gw.analysis.hysteresis(hunt_crossley(0.2), amplitude, mean=mean, frequency=frequency)
    closed = 0.0
    for depth in (0.5 - mean, 0.5 + mean):
        if depth < -amplitude:
            closed += -depth * math.pi  # it never opens
        elif depth < amplitude:
            closed += side_integral(amplitude, depth)
    assert loop.loss == pytest.approx(0.2 * 3.0 * frequency * amplitude**2 * closed, rel=1e-13)
    assert loop.equivalent_damping == pytest.approx(0.2 * 3.0 * closed / math.pi, rel=1e-13)


def test_the_loss_of_a_viscous_contact_is_the_closed_integral() -> None:
    stop = Contact(
        "stop", {"x": 1.0}, (Stage(0.5, 3.0, side=Side.POSITIVE),), None, "viscous", {"viscous_damping": 0.4}
    )
    loop = gw.analysis.hysteresis(stop, 1.3, frequency=0.7)
    t = math.acos(0.5 / 1.3)  # it touches for |theta| < t
    assert loop.loss == pytest.approx(0.4 * 0.7 * 1.3**2 * (t - math.sin(2 * t) / 2.0), rel=1e-13)


def test_the_loss_of_a_cubic_spring_in_two_stages_is_the_area_of_the_drawn_loop() -> None:
    stages = (Stage(0.2, 1.0, name="soft"), Stage(0.6, 2.0, 0.7, name="hard"))
    contact = Contact("c", {"x": 1.0}, stages, None, "hunt-crossley", {"impact_damping": 0.3})
    loop = gw.analysis.hysteresis(contact, 1.1, mean=-0.1, samples=20_000)
    assert loop.breakpoints == (-0.6, -0.2, 0.2, 0.6)
    assert loop.loss == pytest.approx(float(np.trapezoid(loop.force, loop.deflection)), rel=1e-6)


def test_a_spring_costs_nothing_and_the_printed_law_feeds_energy_in() -> None:
    assert abs(gw.analysis.hysteresis(clutch(**{"stage2.impact_damping": 0.0}), 2.0).loss) < 1e-14
    stage = (Stage(0.5, 3.0, side=Side.NEGATIVE),)
    printed = Contact("stop", {"x": 1.0}, stage, None, "hunt-crossley-as-printed", {"impact_damping": 0.2})
    dissipative = gw.analysis.hysteresis(hunt_crossley(0.2, Side.NEGATIVE), 1.3)
    assert gw.analysis.hysteresis(printed, 1.3).loss == pytest.approx(-dissipative.loss, rel=1e-13)
    assert dissipative.loss > 0.01


def test_only_the_viscous_contact_pulls_while_it_parts() -> None:
    """Figure 1 of the paper: the anomaly of the viscous law, and that Hunt and Crossley's has none."""
    viscous = Contact(
        "stop", {"x": 1.0}, (Stage(0.5, 3.0, side=Side.POSITIVE),), None, "viscous", {"viscous_damping": 0.4}
    )
    loop = gw.analysis.hysteresis(viscous, 1.3)
    jump = 0.4 * 1.3 * math.sin(math.acos(0.5 / 1.3))
    assert loop.force.min() == pytest.approx(-jump, rel=1e-6)
    assert gw.analysis.hysteresis(hunt_crossley(0.2, Side.POSITIVE), 1.3).force.min() == 0.0


def test_what_makes_no_loop_is_refused() -> None:
    with pytest.raises(ModelError, match="amplitude is 0; it must be a number > 0"):
        gw.analysis.hysteresis(clutch(), 0)
    with pytest.raises(ModelError, match="no contact 'stage'; contacts are stage2"):
        gw.analysis.hysteresis(clutch(), 1.0, "stage")
    with pytest.raises(ModelError, match="frequency is nan"):
        gw.analysis.hysteresis(clutch(), 1.0, frequency=float("nan"))
    with pytest.raises(ModelError, match="mean is inf; it must be a finite number"):
        gw.analysis.hysteresis(clutch(), 1.0, mean=float("inf"))
