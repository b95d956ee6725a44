"""Static equilibria and modes of systems with dry friction and rigid stops."""

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError

SPRING, GAP = 3.0, 0.5


def clutch(load: float = 0.0, stop: bool = True, stiffness: float | None = 5.0) -> gw.System:
    """A mass on a spring of 1 with a spring of 3 beyond 0.5, its friction, and a rigid stop at 1."""
    contacts = [
        gw.Contact("clutch", {"x": 1.0}, [gw.Stage(GAP, SPRING, numbers={"hysteresis": 0.1})]),
        gw.friction("clutch_friction", {"x": 1.0}, stages_of="clutch", stiffness=stiffness),
    ]
    contacts += [gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8, side="both")] * stop
    return gw.System(["x"], [1.0], [0.1], contacts=contacts, mean={"x": load})


@pytest.mark.parametrize("load", [0.0, 0.3, 1.5, -1.5])
def test_friction_is_left_out_and_said(load: float) -> None:
    rest = gw.find_equilibria(clutch(load, stop=False))
    (found,) = rest.equilibria
    expected = load if abs(load) < GAP else np.sign(load) * (abs(load) + SPRING * GAP) / (1.0 + SPRING)
    assert found.position[0] == pytest.approx(expected, rel=1e-14)
    assert [contact.name for contact in found.contacts] == ["clutch"]
    assert rest.notes == (
        "dry friction is left out (clutch_friction): with it all positions about an "
        "equilibrium at which it can hold are equilibria too",
    )
    assert rest.complete


def test_modes_with_the_springs_of_friction_stuck() -> None:
    system = clutch()
    frequencies = [gw.find_modes(system, at).frequencies[0] for at in ("open", "closed", "stuck")]
    np.testing.assert_allclose(np.square(frequencies), [1.0, 1.0 + SPRING, 1.0 + SPRING + 5.0], rtol=1e-14)
    assert len(gw.find_modes(clutch(stiffness=None), "stuck")) == 0
    with pytest.raises(ModelError, match="it must be an equilibrium, or did you mean stuck"):
        gw.find_modes(system, "stick")


def test_a_rest_beyond_a_rigid_stop_is_none() -> None:
    inside, beyond = gw.find_equilibria(clutch(2.0)), gw.find_equilibria(clutch(4.0))
    assert inside.equilibria[0].position[0] == pytest.approx((2.0 + SPRING * GAP) / (1.0 + SPRING))
    assert str(inside.equilibria[0]) == "clutch closed+, wall open"
    assert not beyond.equilibria
    for each in (inside, beyond):
        assert not each.complete  # it may lean on the stop
        assert each.notes[-1] == "rigid stops are open (wall): equilibria against one are not computed"


def test_several_coordinates_and_formulas_beside_friction() -> None:
    system = gw.System(
        ["x", "y"],
        [[3.0, -1.0], [-1.0, 2.0]],
        0.1 * np.eye(2),
        contacts=[
            gw.force("cubic", {"x": 1.0}, "k*x**3", k=0.5),
            gw.friction("brake", {"y": 1.0}, 0.3, stiffness=7.0, force={"y": 1.0, "x": 0.2}),
            gw.friction("rub", {"x": 1.0, "y": -1.0}, 0.2),
            gw.rigid_stop("wall", {"y": 1.0}, 5.0, 0.5),
        ],
        mean={"x": 1.0},
    )
    rest = gw.find_equilibria(system)
    x, y = rest.equilibria[0].position
    assert 3.0 * x - y + 0.5 * x**3 == pytest.approx(1.0)
    assert 2.0 * y == pytest.approx(x)
    assert [contact.name for contact in rest.equilibria[0].contacts] == ["cubic", "wall"]
    stiffness = np.array([[3.0, -1.0], [-1.0, 2.0]]) + np.outer([0.2, 1.0], [0.0, 7.0])
    square = stiffness.sum() / 2.0  # "rub" sticks rigidly: both move as one, of mass 2
    np.testing.assert_allclose(np.square(gw.find_modes(system, "stuck").frequencies), [square], rtol=1e-12)


def test_modes_of_a_train_with_stuck_friction() -> None:
    """In deg and N m: the stiffness of friction that sticks is one of the shaft."""
    inertias = [gw.train.Inertia("a", "1 kg m^2"), gw.train.Inertia("b", "2 kg m^2")]
    with_friction, plain = (
        gw.train.Train(inertias, [gw.train.Shaft("s", ("a", "b"), **each)], frequency="1 Hz").system()
        for each in (
            {"stiffness": "3 N m/deg", "hysteresis": "1 N m", "hysteresis_stiffness": "4 N m/deg"},
            {"stiffness": "7 N m/deg"},
        )
    )
    stuck, expected = gw.find_modes(with_friction, "stuck"), gw.find_modes(plain)
    np.testing.assert_allclose(stuck.frequencies, expected.frequencies, rtol=1e-13)


def test_the_command_says_what_it_leaves_out(tmp_path, capsys) -> None:
    path = tmp_path / "model.toml"
    path.write_text(
        'coordinates = ["x"]\nstiffness = [[1.0]]\ndamping = [[0.1]]\n[[contact]]\nname = "clutch"\n'
        "deflection = { x = 1.0 }\nhysteresis_stiffness = 5.0\n[[contact.stage]]\nclearance = 0.5\nstiffness = 3.0\n"
        'hysteresis = 0.1\n[[contact.stage]]\nclearance = 1.0\nstiffness = "rigid"\nrestitution = 0.5\n'
    )
    assert main(["modes", str(path)]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "dry friction is left out (clutch_friction)" in out
    assert "rigid stops are open (clutch_stop)" in out
    assert "with rigid stops open, and with dry friction that sticks: mode W" in out
    assert "with rigid stops held, and with dry friction that sticks: none, because nothing can move" in out
    assert main(["modes", str(path), "--json"]) == 0
    assert "clutch_stop" in capsys.readouterr().out


@pytest.mark.parametrize("hysteresis", [{}, {"hysteresis": 0.1}])
def test_springs_that_never_pull_have_their_slope_at_the_breakpoint(hysteresis: dict) -> None:
    contacts = [
        gw.Contact("stop", {"x": 1.0}, [gw.Stage(GAP, SPRING, numbers=hysteresis)], law="pushing", viscous_damping=0.2)
    ]
    contacts += [gw.friction("rub", {"x": 1.0}, stages_of="stop")] * bool(hysteresis)
    system = gw.System(["x"], [1.0], [0.1], contacts=contacts)
    modes = gw.find_modes(system)
    assert modes.frequencies[0] ** 2 == pytest.approx(1.0 + SPRING)
    assert modes.damping_ratios[0] == pytest.approx((0.1 + 0.2) / (2.0 * modes.frequencies[0]))
