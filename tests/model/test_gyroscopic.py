"""Modes with gyroscopic terms, and with what friction and stops hold, beside eigenvalues of NumPy and SciPy."""

import numpy as np
import pytest
from scipy.linalg import eigvalsh

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.modes import dissipation_doubts
from tests.gyroscopic import eigenvalues, gyroscopic_system
from tests.results.again import again

ROTOR = [[0.02, 1.0], [-1.0, 0.02]]


def rotor(damping=ROTOR, **more) -> gw.System:
    return gw.System(["x", "y"], np.diag([2.0, 3.0]), damping, **more)


@pytest.mark.parametrize("seed", range(30))
def test_modes_keep_gyroscopic_terms(seed: int) -> None:
    system = gyroscopic_system(np.random.default_rng(seed))
    for at, closed in (("open", 0.0), ("closed", 1.0), (gw.find_equilibria(system).equilibria[0], 0.0)):
        modes = gw.find_modes(system, at)
        np.testing.assert_allclose(modes.frequencies, eigenvalues(system, closed=closed), rtol=1e-11)
    modes, damping = gw.find_modes(system, "open"), system.matrix("damping")
    turning = 0.5 * (damping - damping.T)
    for w, shape in zip(modes.frequencies, modes.shapes.T, strict=True):
        left = (system.matrix("stiffness") - w**2 * system.matrix("mass") + 1j * w * turning) @ shape
        assert np.abs(left).max() < 1e-10
        assert np.abs(shape).max() == pytest.approx(1.0)


def test_ratios_are_those_of_light_damping() -> None:
    system = gyroscopic_system(np.random.default_rng(1))
    n, damping = system.size, system.matrix("damping")
    turning, losses = 0.5 * (damping - damping.T), 1e-5 * (damping + damping.T)
    light = system.at(
        {
            f"damping.{a}.{b}": (turning + losses)[i, k]
            for i, a in enumerate(system.coordinates)
            for k, b in enumerate(system.coordinates)
        }
    )
    rates = np.linalg.solve(system.matrix("mass"), np.hstack((system.matrix("stiffness"), turning + losses)))
    values = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-rates]]))
    values = sorted(values, key=lambda value: value.imag)[n:]
    ratios = [-value.real / abs(value) for value in values]
    assert gw.find_modes(light, "open").damping_ratios == pytest.approx(ratios, rel=1e-6)


def test_equal_coordinates_whirl_both_ways() -> None:
    """An isotropic rotor: W^2 - 1 = +- g W; the losses are equal in all directions."""
    system = gw.System(["x", "y"], np.eye(2), [[0.02, 1.5], [-1.5, 0.02]])
    modes = gw.find_modes(system)
    root = np.sqrt(1.0 + 0.75**2)
    np.testing.assert_allclose(modes.frequencies, [root - 0.75, root + 0.75], rtol=1e-13)
    np.testing.assert_allclose(modes.shapes[1] / modes.shapes[0], [1j, -1j], atol=1e-13)
    # the decay to first order: (c/2) * 2 W / (2 W +- g)
    np.testing.assert_allclose(modes.damping_ratios, 0.01 / root, rtol=1e-12)


def test_gyroscopic_terms_stabilise_a_hilltop_and_leave_free_motions_free() -> None:
    hilltop = gw.System(["x", "y"], -np.eye(2), [[0.0, 3.0], [-3.0, 0.0]])
    np.testing.assert_allclose(
        gw.find_modes(hilltop).frequencies, [1.5 - np.sqrt(1.25), 1.5 + np.sqrt(1.25)], rtol=1e-13
    )
    falls = gw.System(["x", "y"], -np.eye(2), [[0.0, 1.0], [-1.0, 0.0]])
    assert np.isnan(gw.find_modes(falls).frequencies).all()
    free = gw.System(["x", "y"], np.zeros((2, 2)), [[0.0, 3.0], [-3.0, 0.0]])
    np.testing.assert_allclose(gw.find_modes(free).frequencies, [0.0, 3.0], atol=1e-13)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_change_nothing(unit: float) -> None:
    """Of time: rates grow by `unit`; of one coordinate: its rows and columns do."""
    expected = gw.find_modes(rotor()).frequencies
    faster = gw.System(["x", "y"], unit**2 * np.diag([2.0, 3.0]), unit * np.array(ROTOR))
    np.testing.assert_allclose(gw.find_modes(faster).frequencies, unit * expected, rtol=1e-12)
    by = np.diag([1.0, unit])
    other = gw.System(["x", "y"], by @ np.diag([2.0, 3.0]) @ by, by @ ROTOR @ by, by @ by)
    np.testing.assert_allclose(gw.find_modes(other).frequencies, expected, rtol=1e-12)


def test_equations_that_were_multiplied_have_the_same_modes_or_are_refused() -> None:
    by = np.array([[1.0, 0.3], [0.2, 0.5]])
    stiffness, damping, mass = by @ np.diag([2.0, 3.0]), by @ ROTOR, by
    known = [
        gw.stop(name, vector, 1.0, 5.0, force=dict(zip("xy", by @ list(vector.values()), strict=True)))
        for name, vector in (("s", {"x": 1.0, "y": 0.4}), ("t", {"x": 0.0, "y": 1.0}))
    ]
    system = gw.System(["x", "y"], stiffness, damping, mass, contacts=known)
    expected = gw.find_modes(rotor(), "open").frequencies
    np.testing.assert_allclose(gw.find_modes(system, "open").frequencies, expected, rtol=1e-12)
    with pytest.raises(ModelError, match="damping matrix has gyroscopic terms, but mass and stiffness"):
        gw.find_modes(gw.System(["x", "y"], stiffness, damping, mass), "open")


def test_gyroscopic_terms_alone_are_no_damping() -> None:
    (doubt,) = dissipation_doubts(rotor([[0.0, 1.0], [-1.0, 0.0]]))
    assert doubt.startswith("damping is zero but for gyroscopic terms: no motion settles")
    assert dissipation_doubts(rotor()) == []


def test_a_resonance_is_where_the_response_peaks() -> None:
    system = rotor(harmonics=[gw.Harmonic(0.01, {"x": 1.0})])
    for number in (1, 2):
        value = gw.ask.Resonance(number, below=9.0).value(system)
        frequencies = value * (1.0 + np.linspace(-0.05, 0.05, 2001))
        dynamic = (
            np.diag([2.0, 3.0]) + 1j * frequencies[:, None, None] * ROTOR - frequencies[:, None, None] ** 2 * np.eye(2)
        )
        response = np.abs(np.linalg.inv(dynamic)[:, 0, 0])
        assert frequencies[np.argmax(response)] == pytest.approx(value, rel=1e-3)


STIFFNESS = np.array([[100.0, 0, 0], [0, 400.0, -400.0], [0, -400.0, 400.0]])
MASS = np.diag([1.0, 0.5, 2.0])


def line(*contacts, damping=None, coupling=STIFFNESS) -> gw.System:
    return gw.System(
        ["a", "b", "c"], coupling, damping, MASS, contacts=list(contacts), harmonics=[gw.Harmonic(1.0, {"c": 1.0})]
    )


def test_a_locked_clutch_holds_what_it_joins() -> None:
    lock = gw.friction("clutch", {"a": 1.0, "b": -1.0}, 50.0)
    both = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    drag = 0.01 * STIFFNESS + 0.1 * MASS
    modes = gw.find_modes(line(lock, damping=drag), "stuck")
    squares = eigvalsh(both.T @ STIFFNESS @ both, both.T @ MASS @ both)
    np.testing.assert_allclose(modes.frequencies**2, squares, rtol=1e-13)
    np.testing.assert_allclose(modes.shapes[0], modes.shapes[1], rtol=1e-13)
    np.testing.assert_allclose(modes.damping_ratios, 0.05 / modes.frequencies + 0.005 * modes.frequencies, rtol=1e-12)
    # a stop between the same parts holds nothing more; the spring of another friction adds to the stiffness
    stop = gw.rigid_stop("stop", {"a": -2.0, "b": 2.0}, 1.0, 0.5)
    more = line(lock, stop, gw.friction("jenkins", {"c": 1.0}, 1.0, stiffness=30.0))
    squares = eigvalsh(both.T @ (STIFFNESS + np.diag([0, 0, 30.0])) @ both, both.T @ MASS @ both)
    for at in ("stuck", "held"):
        np.testing.assert_allclose(gw.find_modes(more, at).frequencies ** 2, squares, rtol=1e-13)
    np.testing.assert_allclose(gw.find_modes(more).frequencies ** 2, eigvalsh(STIFFNESS, MASS), atol=1e-10)


def test_held_stops_hold() -> None:
    system = line(gw.rigid_stop("wall", {"b": 1.0}, 0.1, 0.5), gw.friction("clutch", {"a": 1.0, "b": -1.0}, 50.0))
    assert len(gw.find_modes(system, "stuck")) == 2
    (frequency,) = gw.find_modes(system, "held").frequencies
    assert frequency == pytest.approx(np.sqrt(400.0 / 2.0))
    assert (
        len(gw.find_modes(gw.System(["x"], [1.0], contacts=[gw.rigid_stop("wall", {"x": 1.0}, 0.1, 0.5)]), "held")) == 0
    )


def test_friction_that_acts_along_another_vector_is_held_by_its_own() -> None:
    """Against a stiff spring in place of the friction, of which the mode is the limit."""
    push = {"a": 1.0, "b": -0.5}
    stuck = gw.find_modes(line(gw.friction("clutch", {"a": 1.0, "b": -1.0}, 50.0, force=push)), "stuck")
    stiff = STIFFNESS + 1e10 * np.outer([1.0, -0.5, 0.0], [1.0, -1.0, 0.0])
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(MASS, stiff)).real)[:2]
    np.testing.assert_allclose(stuck.frequencies**2, squares, rtol=1e-6)


def test_what_turns_and_is_held_keeps_its_gyroscopic_terms() -> None:
    turning = np.array([[0.0, 2.0, 1.0], [-2.0, 0.0, 0.5], [-1.0, -0.5, 0.0]])
    stuck = gw.find_modes(line(gw.friction("brake", {"a": 1.0}, 50.0), damping=turning), "stuck")
    rest = gw.System(["b", "c"], STIFFNESS[1:, 1:], turning[1:, 1:], MASS[1:, 1:])
    np.testing.assert_allclose(stuck.frequencies, eigenvalues(rest), atol=1e-6)
    assert np.abs(stuck.shapes[0]).max() == 0.0


DISC = {"mass": np.diag([0.2, 0.2]), "gyroscopic": [[0.0, 0.12], [-0.12, 0.0]]}


@pytest.mark.parametrize("pace", [0.3, 1.0, 4.0])
def test_whirls_of_a_disc_that_tilts_are_those_of_the_closed_form(pace: float) -> None:
    """I phi'' - i W Ip phi' + k phi = 0 with phi = x + i y: forward and backward whirl, at each speed."""
    system = gw.System(["x", "y"], np.diag([1.5, 1.5]), frequency=pace, **DISC)
    root = np.sqrt((0.12 * pace) ** 2 + 4.0 * 0.2 * 1.5)
    expected = sorted((root + sign * 0.12 * pace) / 0.4 for sign in (-1.0, 1.0))
    np.testing.assert_allclose(gw.find_modes(system, "open").frequencies, expected, rtol=1e-12)


def test_unbalance_is_largest_at_the_critical_speed_of_the_closed_form() -> None:
    """Forward whirl meets the speed where W**2 (I - Ip) = k; backward whirl is not excited by unbalance."""
    around = [gw.Harmonic(0.01, {"x": 1.0}, name="h"), gw.Harmonic(0.01, {"y": 1.0}, phase=-np.pi / 2, name="v")]
    damping = np.diag([0.002, 0.002])
    system = gw.System(["x", "y"], np.diag([1.5, 1.5]), damping, harmonics=around, frequency=4.0, **DISC)
    branch = gw.follow(gw.find_orbit(system), "frequency", to=5.0)
    curve = {point.orbit.system.frequency: point.orbit.extremes[0, 0] for point in branch.points}
    paces = np.array([*curve])
    expected = 0.01 / np.abs(1.5 - paces**2 * (0.2 - 0.12) + 0.002j * paces)  # of the forward whirl alone
    np.testing.assert_allclose([*curve.values()], expected, rtol=1e-9)
    assert paces[np.argmax([*curve.values()])] == pytest.approx(np.sqrt(1.5 / 0.08), rel=2e-3)


def test_what_grows_with_the_frequency_is_stored_continued_and_differentiated() -> None:
    """The same equations by matrices and by formulas of W; each number and the frequency have exact slopes."""
    loads = [gw.Harmonic(0.3, {"x": 1.0})]
    matrices = {"centrifugal": np.diag([0.2, 0.0]), **DISC}
    made = gw.System(["x", "y"], np.diag([1.5, 1.8]), np.diag([0.1, 0.1]), harmonics=loads, **matrices)
    forces = [
        gw.force("gx", {"y": 1.0}, "g*W*v", acts_on={"x": 1.0}, g=0.12),
        gw.force("gy", {"x": 1.0}, "-g*W*v", acts_on={"y": 1.0}, g=0.12),
        gw.force("c", {"x": 1.0}, "h*W**2*x", h=0.2),
    ]
    formulas = gw.System(
        ["x", "y"], np.diag([1.5, 1.8]), np.diag([0.1, 0.1]), DISC["mass"], forces, harmonics=loads,
        over_speed={"c.h": "1 + W - W"},
    )  # fmt: skip
    for pace in (0.7, 2.0):
        first, second = (gw.find_orbit(each.at(frequency=pace)).state for each in (made, formulas))
        np.testing.assert_allclose(first, second, atol=1e-12)
    assert again(made) == made
    assert again(formulas) == formulas
    assert forces[0].law.title == "g*W*v"
    for system in (made, formulas):
        for name in ("frequency", "stiffness.x.x", "gyroscopic.x.y" if system is made else "c.h"):
            line, value = ParameterLine(system, name), system[name]
            slopes = [line.coefficients(value + step)[0] for step in (1e-6, -1e-6)]
            np.testing.assert_allclose(line.coefficients(value)[1], (slopes[0] - slopes[1]) / 2e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gyroscopic": [[0.0]]}, "gyroscopic"),
        ({"over_speed": {"stiffness.x.z": "W"}}, "there is no parameter 'stiffness.x.z'"),
        ({"over_speed": {"stiffness.x.x": "1 + a*W"}}, "a is unknown in it; its names are W"),
        ({"over_speed": {"stiffness.x.x": "abs(W - 1)"}}, "which has a kink"),
    ],
)
def test_a_mistake_of_what_grows_is_told(changes, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        gw.System(["x", "y"], np.eye(2), **changes)
