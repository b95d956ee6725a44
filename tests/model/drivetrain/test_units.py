"""Drive trains with units: against the same numbers in SI units by hand, in non-dimensional form, and refused."""

import dataclasses
import io
import pickle

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import ParameterLine, coefficients_of
from gapwalk.model.drivetrain import PaperNumbers, Scales
from gapwalk.paper import parameter_set
from gapwalk.studies.machine_templates import machine_text
from tests.model.drivetrain.trains import DEGREE, by_hand, physical

SCALES = Scales(angle=3.0 * DEGREE, frequency=500.0, inertia=0.004)


def test_a_train_with_units_is_the_one_in_si_units() -> None:
    system, other = physical().system(), by_hand().system()
    assert system.structure.names[0] == "speed"
    assert system["speed"] == 1500.0
    assert system.frequency == pytest.approx(100.0 * np.pi, rel=1e-15)
    angles = np.repeat([DEGREE, DEGREE], [2, 2])
    np.testing.assert_allclose(gw.find_modes(system).frequencies, gw.find_modes(other).frequencies, rtol=1e-13)
    orbit, same = gw.find_orbit(system), gw.find_orbit(other)
    np.testing.assert_allclose(orbit.state * angles, same.state, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(np.abs(orbit.multipliers), np.abs(same.multipliers), rtol=1e-9)
    assert orbit.measure("max.clutch''") == pytest.approx(same.measure("max.clutch''"), rel=1e-9)  # rad/s^2
    assert orbit.measure("max.clutch'") * DEGREE == pytest.approx(same.measure("max.clutch'"), rel=1e-9)  # deg/s
    assert orbit.measure("max.clutch") * DEGREE == pytest.approx(same.measure("max.clutch"), rel=1e-10)
    assert orbit.measure("max.clutch.torque") == pytest.approx(same.measure("max.clutch.torque"), rel=1e-9)  # N m


@pytest.mark.parametrize("name", ["speed", "hub.inertia", "clutch.stage2.clearance", "input.stiffness", "mean.box"])
def test_derivatives_by_parameters_are_those_in_their_units(name: str) -> None:
    system = physical().system()
    line, value = ParameterLine(system, name), system[name]
    step = 1e-6 * abs(value)
    ends = [coefficients_of(system.at({name: value + sign * step})) for sign in (1, -1)]
    coefficients, slope = line.coefficients(value)
    np.testing.assert_allclose(coefficients, coefficients_of(system), rtol=1e-13)
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-6, atol=1e-9 * np.abs(slope).max())


def two(**more) -> gw.train.Train:
    """Two inertias with backlash between them."""
    shaft = gw.train.Shaft("clutch", ("flywheel", "hub"), stiffness="2 N m/deg", clearance="1 deg")
    return gw.train.Train(
        [gw.train.Inertia("flywheel", "0.1 kg m^2"), gw.train.Inertia("hub", "0.01 kg m^2")], [shaft], **more
    )


def test_orders_are_counted_per_turn_and_the_period_is_the_shortest() -> None:
    terms = [gw.Harmonic("100 N m", {"flywheel": 1.0}, order) for order in (2, 4, 6)]
    system = two(harmonics=terms, speed="1500 rpm").system()
    assert [form.order for form in system.structure.harmonics] == [1, 2, 3]
    assert system.frequency == pytest.approx(2 * 1500 * np.pi / 30)
    hertz = two(frequency="50 Hz").system()
    assert hertz["frequency"] == 50.0
    assert hertz.frequency == pytest.approx(100 * np.pi)
    with pytest.raises(ModelError, match="has its units already"):
        dataclasses.replace(two(frequency="50 Hz"), frequency=1.0, speed="1500 rpm")


def test_parameters_take_texts_in_any_unit_of_their_kind() -> None:
    system = physical().system()
    assert system.at({"clutch.stage2.clearance": "0.05 rad"})["clutch.stage2.clearance"] == pytest.approx(0.05 / DEGREE)
    assert system.at(speed="25 Hz")["speed"] == pytest.approx(1500.0)
    assert system.at(speed=1400.0)["speed"] == 1400.0
    with pytest.raises(ModelError, match='speed is "3 deg": deg is the unit of an angle; a frequency or speed'):
        system.at(speed="3 deg")
    assert physical().replaced("hub", inertia="60 kg cm^2").system()["hub.inertia"] == pytest.approx(0.006)
    assert pickle.loads(pickle.dumps(system)) == system


def test_all_mistakes_of_units_are_told_at_once() -> None:
    with pytest.raises(ModelError) as error:
        gw.train.Train(
            [gw.train.Inertia("a", "0.1 kg m^2"), gw.train.Inertia("b", 0.2)],
            [gw.train.Shaft("ab", ("a", "b"), stiffness="3 N m", stages=(gw.Stage("1 N m", 2.0),), damping=0.0)],
            mean={"a": "3 J"},
            harmonics=[gw.Harmonic("1 N m", {"a": 1.0}, phase=0.5)],
            speed="900 rpm",
        )
    lines = str(error.value).splitlines()
    assert [line.split(" is ")[0] for line in lines] == [
        "b.inertia",
        "ab.stiffness",
        "ab.stage[0].clearance",
        "ab.stage[0].stiffness",
        "mean.a",
        "harmonic1.phase",
    ]
    assert lines[0] == 'b.inertia is 0.2, a number without a unit; write an inertia such as "0.2 kg m^2"'


def test_a_speed_is_a_quantity_and_stands_alone() -> None:
    for wrong in ({"speed": 900.0}, {"speed": "900 rpm", "frequency": "50 Hz"}):
        with pytest.raises(ModelError, match="write a speed such as"):
            gw.train.Train([gw.train.Inertia("a", "1 kg m^2")], **wrong)


def test_the_non_dimensional_form_is_exact_and_leads_back() -> None:
    system = physical().system()
    form = gw.train.nondimensional(system, SCALES)
    plain, units = form.system, system.units
    assert plain.units is None
    assert units is not None
    # by hand: section 2 of the paper
    torque = 0.004 * 500.0**2 * 3.0 * DEGREE
    assert plain["clutch.stage2.clearance"] == pytest.approx(1.0, rel=1e-15)
    assert plain["hub.inertia"] == pytest.approx(0.005 / 0.004, rel=1e-15)
    assert plain["input.stiffness"] == pytest.approx(1e4 / (0.004 * 500.0**2), rel=1e-14)
    assert plain["clutch.damping"] == pytest.approx(0.3 / (0.004 * 500.0), rel=1e-14)
    assert plain["clutch.impact_damping"] == pytest.approx(0.05 * 3.0 * DEGREE * 500.0, rel=1e-14)
    assert plain["mean.flywheel"] == pytest.approx(20.0 / torque, rel=1e-14)
    assert plain.frequency == pytest.approx(100.0 * np.pi / 500.0, rel=1e-14)
    for name in system.structure.names:
        value = form.value(name, system[name])
        assert value == pytest.approx(plain[form.name(name)], rel=1e-15)
        assert form.physical_value(name, value) == pytest.approx(system[name], rel=1e-15)
    state = np.array([2.0, 0.1, 30.0, -4.0])
    np.testing.assert_allclose(form.state(state)[:2], state[:2] / 3.0, rtol=1e-15)
    np.testing.assert_allclose(form.state(state)[2:], state[2:] / 1500.0, rtol=1e-15)
    np.testing.assert_allclose(form.physical_state(form.state(state)), state, rtol=1e-15)


def test_scales_are_found_that_make_numbers_of_about_one() -> None:
    form = gw.train.nondimensional(physical().system())
    numbers = gw.train.paper_numbers(physical().system())
    assert numbers.K11 + numbers.n1 == pytest.approx(1.0, rel=1e-13)
    assert numbers.b == pytest.approx(1.0, rel=1e-14)
    assert form.scales.inertia == pytest.approx(0.14 * 0.005 / 0.145, rel=1e-13)
    with pytest.raises(ModelError, match="has no units"):
        gw.train.nondimensional(by_hand().system())


def of_the_paper(figure: str) -> PaperNumbers:
    """The printed numbers of a figure, with C11 and C22 such that three inertias can have them."""
    given = parameter_set(figure)
    k11, k12, k21, k22 = given.stiffness
    _, c12, c21, _ = given.damping
    te2, p, phi = given.second or (0.0, 2, 0.0)
    (n1, n2), (tm1, tm2) = given.n, given.mean
    return PaperNumbers(
        **{"K11": k11, "K12": k12, "K21": k21, "K22": k22},
        **{"C11": c21 * n1 / n2, "C12": c12, "C21": c21, "C22": c12 * k22 / k12},
        **{"n1": n1, "n2": n2, "Tm1": tm1, "Tm2": tm2, "Te1": given.excitation, "Te2": te2, "p": p, "phi": phi},
        beta=given.beta,
        W=given.frequency,
    )


@pytest.mark.parametrize("figure", ["4a", "9a", "9b", "13", "15", "20b", "26b"])
def test_sets_of_the_paper_are_those_of_physical_trains(figure: str) -> None:
    """Orbits of equations 10 to 18, in bc1 and bc3, against those of three inertias in N m, rad and s."""
    numbers = of_the_paper(figure)
    system = numbers.train(SCALES).system()
    back = gw.train.paper_numbers(system, SCALES, numbers.length_ratio())
    for name, value in dataclasses.asdict(numbers).items():
        assert getattr(back, name) == pytest.approx(value, rel=1e-13, abs=1e-15), name
    dampers = {"damping.q1.q1": numbers.C11, "damping.q3.q3": numbers.C22}
    paper = gw.find_orbit(gw.paper.case(figure).at(dampers))
    physical = gw.find_orbit(system)
    angles = SCALES.angle * np.array([1.0, numbers.length_ratio()])
    unit = np.concatenate((angles, angles * SCALES.frequency))
    np.testing.assert_allclose(physical.state / unit, paper.state, rtol=1e-9, atol=1e-10)


def test_printed_dampers_that_no_three_inertias_have_are_refused() -> None:
    """The printed C11, C12, C21, C22 of most figures do not follow from equations 1 to 3."""
    numbers = dataclasses.replace(of_the_paper("13"), C11=0.04, C22=0.06)
    with pytest.raises(ModelError) as error:
        numbers.train(SCALES)
    assert str(error.value).splitlines() == [
        "C11 is 0.04 and C21 is 0.04, but of three inertias C11 / C21 is n1 / n2; write C11 = 0.06666666667",
        "C22 is 0.06 and C12 is 0.04, but of three inertias C22 / C12 is K22 / K12; write C22 = 0.07333333333",
    ]


def test_only_three_inertias_in_line_have_the_numbers_of_the_paper() -> None:
    with pytest.raises(ModelError, match="needs three inertias in line"):
        gw.train.paper_numbers(two(frequency="50 Hz").system())
    with pytest.raises(ModelError, match="torques on the first and the last inertia only"):
        gw.train.paper_numbers(physical().system().at({"mean.hub": 1.0}))


def test_a_square_drag_ends_the_rotation_at_one_rate_in_all_units() -> None:
    """The template in degrees: drags of 1e-3 N m s and, by its slope at the slip W/1.6, 2e-4 * 2 * W/1.6 N m s."""
    system = gw.read_model(io.StringIO(machine_text("neutral-rattle")))
    found = system.structure.assembly.numbers(system.values)
    mean = 30.0 * np.pi
    inertia = 0.15 + 0.004 + 0.002 / 1.6**2
    assert found.decay == pytest.approx((1e-3 + 2.0 * 2e-4 * mean / 1.6**3) / inertia, rel=1e-12)
