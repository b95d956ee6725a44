"""The way from some values of parameters to others, as one more parameter."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import WAY, ParameterLine, coefficients_of, on_the_way
from tests.systems import clutch

TO = {"stage2.stiffness": 1.4, "mean.q1": 0.1, "stiffness.q1.q3": -0.5}


def test_in_between_the_system_is_what_its_values_say() -> None:
    system = clutch(frequency=0.7)
    way = on_the_way(system, TO)
    for share in (0.0, 0.3, 1.0):
        between = {name: (1.0 - share) * system[name] + share * value for name, value in TO.items()}
        expected = coefficients_of(system.at(between))
        np.testing.assert_allclose(coefficients_of(way.at({WAY: share})), expected, rtol=1e-14, atol=1e-15)
    assert way.frequency == 0.7
    assert way.at({WAY: 1.0, "stage2.clearance": 0.5}).equations["stage2.clearance"] == 0.5
    assert way.at({WAY: 0.5}).equations.matrix("stiffness")[0, 1] == pytest.approx(-0.55)


def test_its_slope_is_the_sum_of_those_of_its_parameters() -> None:
    system = clutch(frequency=0.7)
    _, slope = ParameterLine(on_the_way(system, TO), WAY).coefficients(0.4)
    here = system.at({name: 0.6 * system[name] + 0.4 * value for name, value in TO.items()})
    parts = [
        (value - system[name]) * ParameterLine(here, name).coefficients(here[name])[1] for name, value in TO.items()
    ]
    np.testing.assert_allclose(slope, np.sum(parts, axis=0), rtol=1e-12, atol=1e-14)


def test_a_train_can_be_on_a_way_too() -> None:
    system = gw.train.chain(3, 1.0, 2.0).system()
    name = next(name for name in system.parameters if name.endswith(".inertia"))
    way = on_the_way(system, {name: 3.0})
    expected = coefficients_of(system.at({name: 2.0}))
    np.testing.assert_allclose(coefficients_of(way.at({WAY: 0.5})), expected, rtol=1e-14, atol=1e-15)


def test_an_orbit_is_followed_along_the_way() -> None:
    system = clutch(frequency=1.0)
    branch = gw.follow(gw.find_orbit(on_the_way(system, TO)), WAY, to=1.0)
    orbit = gw.find_orbit(system.at(TO), start=branch.points[-1].orbit.state)
    np.testing.assert_allclose(branch.points[-1].orbit.state, orbit.state, atol=1e-9)


@pytest.mark.parametrize(
    ("to", "message"),
    [
        ({"frequency": 0.3, "mean.q1": 0.2}, "frequency cannot vary together with other parameters"),
        ({"mean.q9": 0.3}, "there is no parameter 'mean.q9'"),
        ({"stage2.clearance": -1.0}, "it must be >= 0"),
    ],
)
def test_an_impossible_way_is_refused(to, message) -> None:
    with pytest.raises(ModelError, match=message):
        on_the_way(clutch(), to)


def test_a_way_does_not_begin_on_another() -> None:
    with pytest.raises(ModelError, match="already has a parameter path"):
        on_the_way(on_the_way(clutch(), TO), TO)


def test_values_on_the_way_are_checked() -> None:
    with pytest.raises(ModelError, match=r"stage2.clearance is -0\.5"):
        on_the_way(clutch(), {"stage2.clearance": 0.5}).at({WAY: 3.0})
