"""Friction, hysteresis and rigid stops in drive trains: parts, units, forms, and the message of each mistake."""

import math
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.model.drivetrain import Scales
from gapwalk.model.laws import Coulomb, Hysteretic, Jenkins, Rigid
from gapwalk.model.laws.law import Elastic
from gapwalk.train import Force, Friction, Gear, Inertia, Shaft, Train
from tests.results.again import again

FILE = """
speed = "900 rpm"
reaction = "box"

[[inertia]]
name = "engine"
inertia = "0.1 kg m^2"
[[inertia]]
name = "hub"
inertia = "0.01 kg m^2"
[[inertia]]
name = "box"
inertia = "0.2 kg m^2"

[[shaft]]
name = "clutch"
between = ["engine", "hub"]
{clutch}
[[shaft]]
name = "out"
between = ["hub", "box"]
stiffness = "200 N m/deg"
damping = "0.1 N m s/rad"

{more}
[[harmonic]]
order = 2
amplitude = "100 N m"
acts_on = {{ engine = 1.0 }}

[study]
kind = "response"
parameter = "speed"
from = "900 rpm"
to = "800 rpm"
"""
SPLINE = 'clearance = "3 deg"\nstiffness = "30 N m/deg"\n'
DAMPER = (
    'stiffness = "3 N m/deg"\nhysteresis = "8 N m"\nhysteresis_stiffness = "100 N m/deg"\n'
    '[[shaft.stage]]\nclearance = "1 deg"\nstiffness = "30 N m/deg"\nhysteresis = "10 N m"\n'
    '[[shaft.stage]]\nclearance = "5 deg"\nstiffness = "rigid"\nrestitution = 0.5\n'
)
RUB = '[[friction]]\nname = "rub"\nbetween = ["engine", "hub"]\n'


def write(folder: Path, clutch: str, more: str = "") -> Path:
    path = folder / "train.toml"
    path.write_text(FILE.format(clutch=clutch, more=more), encoding="utf-8")
    return path


def train(*shafts: Shaft, **more) -> Train:
    return Train([Inertia("a", 1.0), Inertia("b", 2.0), Inertia("c", 3.0)], shafts, **more)


def shafts(**first) -> tuple[Shaft, Shaft]:
    return Shaft("s", ("a", "b"), **first), Shaft("t", ("b", "c"), stiffness=5.0, damping=0.1)


def laws_of(system: gw.System) -> dict:
    return {form.name: form.law for form in system.structure.contacts}


def test_a_damper_with_all_of_it(tmp_path) -> None:
    system = gw.read_study(write(tmp_path, DAMPER)).system
    assert laws_of(system) == {
        "clutch": Hysteretic("elastic"),
        "clutch_friction": Jenkins("stages", "clutch"),
        "clutch_stop": Rigid(),
    }
    assert system["clutch_friction.limit"] == 8.0
    assert system["clutch.stage2.hysteresis"] == 10.0
    assert (system["clutch_stop.clearance"], system["clutch_stop.restitution"]) == (5.0, 0.5)
    assert again(system) == system
    python = Train(
        [Inertia("engine", "0.1 kg m^2"), Inertia("hub", "0.01 kg m^2"), Inertia("box", "0.2 kg m^2")],
        [
            Shaft(
                "clutch",
                ("engine", "hub"),
                stiffness="3 N m/deg",
                hysteresis="8 N m",
                hysteresis_stiffness="100 N m/deg",
                stages=[
                    gw.Stage("1 deg", "30 N m/deg", numbers={"hysteresis": "10 N m"}),
                    gw.Stage("5 deg", "rigid", numbers={"restitution": 0.5}),
                ],
            ),
            Shaft("out", ("hub", "box"), stiffness="200 N m/deg", damping="0.1 N m s/rad"),
        ],
        harmonics=[gw.Harmonic("100 N m", {"engine": 1.0}, 2)],
        speed="900 rpm",
        reaction="box",
    ).system()
    assert dict(python.parameters) == dict(system.parameters)
    assert laws_of(python) == laws_of(system)


@pytest.mark.parametrize(
    ("clutch", "laws", "limits"),
    [
        (
            SPLINE + 'hysteresis = "8 N m"',
            {"clutch": Hysteretic(), "clutch_friction": Coulomb("stages", "clutch")},
            (8, 0),
        ),
        ('stiffness = "3 N m/deg"\nhysteresis = "8 N m"', {"clutch_friction": Coulomb()}, (None, 8)),
        ('stiffness = "rigid"\nclearance = "3 deg"\nrestitution = 0.5', {"clutch": Rigid()}, (None, None)),
        ('law = "rigid"\nclearance = "3 deg"\nrestitution = 0.5', {"clutch": Rigid()}, (None, None)),
    ],
)
def test_short_forms(clutch: str, laws: dict, limits: tuple, tmp_path) -> None:
    system = gw.read_study(write(tmp_path, clutch)).system
    assert laws_of(system) == laws
    for name, limit in zip(("clutch.hysteresis", "clutch_friction.limit"), limits, strict=True):
        assert (system.parameters.get(name)) == limit


def test_a_speed_is_a_rate_and_not_the_pace(tmp_path) -> None:
    more = RUB + 'limit = "8 N m"\nspeed = "10 rpm"\n'
    system = gw.read_study(write(tmp_path, SPLINE, more)).system
    assert (system.units.parameter("rub.speed"), system.units.parameter("speed")) == ("rpm", "rpm")
    assert system.equations["rub.speed"] == pytest.approx(60.0, rel=1e-15)  # deg/s, whatever the orders count
    assert system.equations["rub.limit"] == 8.0
    faster = system.at({"rub.speed": "1 rad/s", "rub.limit": "2 N m"})
    assert faster.equations["rub.speed"] == pytest.approx(math.degrees(1.0), rel=1e-15)
    with pytest.raises(ModelError, match="N m is the unit of a torque; a rate is expected"):
        system.at({"rub.speed": "3 N m"})


@pytest.mark.parametrize("clutch", [DAMPER, SPLINE + 'hysteresis = "8 N m"\n'])
def test_units_and_plain_numbers_have_the_same_motion(clutch: str, tmp_path) -> None:
    """In SI with rad by hand, and without dimensions."""
    more = (
        RUB.replace('"engine", "hub"', '"hub", "box"') + 'limit = "5 N m"\nstiffness = "300 N m/deg"\nspeed = "2 rpm"\n'
    )
    system = gw.read_study(write(tmp_path, clutch, more)).system
    deg = math.radians(1.0)
    plain = gw.train.nondimensional(system)
    si = gw.train.nondimensional(system, Scales(1.0, 1.0, 1.0))
    assert si.system["rub.speed"] == pytest.approx(2.0 * 2.0 * math.pi / 60.0)
    assert si.system["rub.limit"] == pytest.approx(5.0)
    assert si.system["rub.stiffness"] == pytest.approx(300.0 / deg)
    start = np.zeros(system.state_size)
    start[2] = 50.0  # deg/s
    physical = gw.integrate(system, start, 3.0, 7)
    others = [gw.integrate(each.system, each.state(start), 3.0, 7) for each in (si, plain)]
    for motion, unit in zip(others, (deg, deg / plain.scales.angle), strict=True):
        np.testing.assert_allclose(motion.q / unit, physical.q, rtol=0, atol=1e-8 * np.abs(physical.q).max())
        assert len(motion.slips) == len(physical.slips) > 3


def test_a_transmission_error_displaces_friction_and_stop_too(tmp_path) -> None:
    sway = '[[harmonic]]\nname = "error"\norder = 3\namplitude = "0.1 deg"\nvaries = "clutch.deflection"\n'
    system = gw.read_study(write(tmp_path, DAMPER, sway)).system
    assert {system.structure.contacts[each.contact].name for each in system.structure.variations} == {
        "clutch",
        "clutch_friction",
        "clutch_stop",
    }


LIMIT = 'limit = "8 N m"\n'
LIMITED, PRESSED = RUB + LIMIT, RUB + "coefficient = 0.3\n"
MISTAKES = [
    (SPLINE, RUB, '"rub" has no limit'),
    (SPLINE, RUB + 'limit = "8 N"\n', "a torque is expected, as in"),
    (SPLINE, RUB + "limit = 8\n", "a number without a unit; write a torque"),
    (SPLINE, RUB + 'limit = "-8 N m"\n', '"rub".limit is "-8 N m"; it must be >= 0'),
    (SPLINE, LIMITED + 'speed = "3 N m"\n', "N m is the unit of a torque; a rate is expected"),
    (SPLINE, LIMITED + 'stiffness = "3 N m"\n', "a stiffness is expected"),
    (SPLINE, LIMITED + 'stiffness = "0 N m/deg"\n', "stiffness is 0; it must be > 0"),
    (SPLINE, LIMITED + "deflection = { hub = 1.0 }\n", "deflection is not a key here"),
    (SPLINE, LIMITED + "ratio = 2.0\n", "write ratio = 1"),
    (SPLINE, RUB.replace('"hub"', '"hubb"') + LIMIT, "which is no inertia; did you mean hub?"),
    (SPLINE, PRESSED + 'normal = "out"\n', "'out', which is no contact with a clearance; there is clutch"),
    (SPLINE, PRESSED + 'normal = "clatch"\n', "did you mean clutch?"),
    (SPLINE + "viscous_damping = 0.1\n", RUB, "a number without a unit"),
    (SPLINE + 'viscous_damping = "0.1 N m s/rad"\n', PRESSED + 'normal = "clutch"\n', "may pull as the contact opens"),
    (SPLINE + 'hysteresis = "8 N m"\n', RUB + 'limit = "1 N m"\n', "clutch_friction and rub stick on one deflection"),
    (SPLINE + 'hysteresis = "8 N"\n', "", "a torque is expected"),
    (SPLINE + "hysteresis = 8\n", "", "a number without a unit; write a torque"),
    (SPLINE + 'hysteresis = "-8 N m"\n', "", '"clutch".hysteresis is "-8 N m"; it must be >= 0'),
    (SPLINE + 'hysteresis_stiffness = "8 N m/deg"\n', "", "hysteresis_stiffness is given without hysteresis"),
    (SPLINE + 'hysteresis = "8 N m"\nhysteresis_stiffness = "8 N m"\n', "", "a stiffness is expected"),
    (SPLINE + 'friction = "8 N m"\n', "", "write hysteresis = ..., the limit of friction beside these springs"),
    (SPLINE + "restitution = 0.5\n", "", "restitution is 0.5, but a stage has a stiffness"),
    ('damping = "1 N m s/rad"\nhysteresis = "8 N m"\n', "", "has hysteresis, but no spring"),
    ('damping = "1 N m s/rad"\n', LIMITED, "acts across clutch, which slips"),
    ('stiffness = "rigid"\nrestitution = 0.8\n', "", 'has the stiffness "rigid", but no clearance'),
    ('stiffness = "rigid"\nclearance = "2 deg"\n', "", "restitution is missing"),
    ('stiffness = "rigid"\nclearance = "2 deg"\nrestitution = 1.5\n', "", "it must lie between 0 and 1"),
    ('stiffness = "stiff"\nclearance = "2 deg"\nrestitution = 0.5\n', "", 'or "rigid" for a rigid stop'),
    (DAMPER.replace("0.5", "1.5"), "", "restitution is 1.5; it must be <= 1"),
    (DAMPER.replace("10 N m", "-10 N m"), "", 'hysteresis is "-10 N m"; it must be >= 0'),
    (
        DAMPER,
        RUB.replace('"rub"', '"clutch_stop"') + 'limit = "1 N m"\n',
        "makes clutch_stop, but another part has that name",
    ),
]


@pytest.mark.parametrize(("clutch", "more", "words"), MISTAKES)
def test_each_mistake_is_reported_by_check(clutch: str, more: str, words: str, tmp_path, capsys) -> None:
    assert main(["check", str(write(tmp_path, clutch, more))]) != 0
    told = capsys.readouterr()
    lines = (told.out + told.err).splitlines()
    assert any(words in line for line in lines), lines
    assert all("Traceback" not in line for line in lines)


def test_friction_against_the_ground_of_a_train_that_is_held() -> None:
    held = Train(
        [Inertia("a", 1.0)],
        [Shaft("s", ("a", "ground"), stiffness=1.0)],
        frictions=[Friction("f", ("a", "ground"), 0.1)],
    )
    system = held.system()
    assert laws_of(system) == {"f": Coulomb()}
    assert system.equations.vector("f.deflection").tolist() == [1.0]


def test_friction_with_a_ratio_is_that_of_a_mesh() -> None:
    """Friction beside a gear slips as the mesh deflects."""
    parts = [Inertia("a", 1.0), Inertia("b", 2.0)], [], [Gear("mesh", ("a", "b"), 2.0, stiffness=3.0, damping=0.1)]
    system = Train(*parts, frictions=[Friction("f", ("a", "b"), 0.1, ratio=2.0)]).system()
    np.testing.assert_array_equal(system.equations.vector("f.deflection"), [1.0])
    with pytest.raises(ModelError, match=r"f acts beside mesh, but its ratio is 1, .* write ratio = 2"):
        Train(*parts, frictions=[Friction("f", ("a", "b"), 0.1)])


def test_a_part_with_friction_is_replaced() -> None:
    first = train(*shafts(stiffness=1.0, hysteresis=0.3), frictions=[Friction("f", ("b", "c"), 0.1, static=1.2)])
    other = first.replaced("f", limit=0.4).replaced("s", damping=0.2).system()
    assert (other["f.limit"], other["f.static"], other["s.damping"], other["s_friction.limit"]) == (0.4, 1.2, 0.2, 0.3)
    with pytest.raises(ModelError, match="f has limit = True; it must be a finite number"):
        first.replaced("f", limit=True)
    with pytest.raises(ModelError, match="friction 'f' has mu, which is none of its numbers"):
        Friction("f", ("a", "b"), 1.0, mu=0.3)


def test_a_formula_across_a_slip_is_a_damper_beside_it() -> None:
    """Its rate is that of the slip, not that of the leaky integral in place of the angle."""
    both = train(*shafts(damping=1.0), forces=[Force("f", ("a", "b"), "c*v", c=1.0)]).system()
    one = train(*shafts(damping=2.0)).system()
    force = gw.find_orbit(one).measure("mean.s.torque")
    assert 2.0 * gw.find_orbit(both).measure("mean.s.torque") == pytest.approx(force, rel=1e-10)


def test_a_stiffness_that_varies_keeps_its_hysteresis() -> None:
    mesh = gw.Harmonic(0.1, order=2, varies="s.stiffness")
    system = train(*shafts(stiffness=1.0, hysteresis=0.3), harmonics=[mesh]).system()
    assert laws_of(system) == {"s": Elastic(), "s_friction": Coulomb()}
    assert system["s_friction.limit"] == 0.3


def test_a_rigid_stop_beside_a_spring_that_acts_always() -> None:
    stop = gw.Stage(0.2, "rigid", numbers={"restitution": 0.5})  # pyright: ignore[reportArgumentType]
    system = train(*shafts(stiffness=2.0, stages=[stop])).system()
    assert laws_of(system) == {"s_stop": Rigid()}
    assert (system["s.stiffness"], system["s_stop.clearance"], system["s_stop.restitution"]) == (2.0, 0.2, 0.5)


def test_a_prescribed_motion_moves_friction_and_stop() -> None:
    """Against the same mass with the displacements and loads of that motion by hand."""
    size, pace, stiffness, damping = 0.3, 1.3, 2.0, 0.1
    stop = gw.Stage(0.2, "rigid", numbers={"restitution": 0.5})  # pyright: ignore[reportArgumentType]
    driven = Train(
        [Inertia("flywheel"), Inertia("hub", 1.0)],
        [Shaft("s", ("flywheel", "hub"), stiffness=stiffness, damping=damping, stages=[stop])],
        frictions=[Friction("f", ("flywheel", "hub"), 0.4, stiffness=6.0)],
        harmonics=[gw.Harmonic(size, varies="flywheel.angle", name="shake")],
        frequency=pace,
    ).system()
    by_hand = gw.System(
        ["y"],
        [[stiffness]],
        [[damping]],
        contacts=[
            gw.friction("f", {"y": -1.0}, 0.4, stiffness=6.0),
            gw.rigid_stop("wall", {"y": -1.0}, 0.2, 0.5, side="both"),
        ],
        harmonics=[
            gw.Harmonic(1.0, varies={"f.deflection": size, "wall.deflection": size}, name="shake"),
            gw.Harmonic(stiffness * size, {"y": 1.0}, name="spring"),
            gw.Harmonic(damping * pace * size, {"y": 1.0}, 1, np.pi / 2, name="damper"),
        ],
        frequency=pace,
    )
    expected = gw.integrate(by_hand, np.array([size - 0.05, 0.2, 0.0]), 1.0, 16)
    found = gw.integrate(driven, np.array([0.05 - size, -0.2, 0.0]), 1.0, 16)
    np.testing.assert_allclose(found.q, -expected.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.z, expected.z, rtol=0, atol=1e-12)
    assert len(found.slips) == len(expected.slips) > 3
    assert len(found.contacts) == len(expected.contacts) > 0


@pytest.mark.parametrize("number", ["s_friction.limit", "s.stage2.hysteresis", "s_stop.restitution", "f.limit"])
def test_numbers_of_friction_and_stops_vary(number: str) -> None:
    stages = [
        gw.Stage(0.1, 3.0, numbers={"hysteresis": 0.2}),
        gw.Stage(0.2, "rigid", numbers={"restitution": 0.5}),  # pyright: ignore[reportArgumentType]
    ]
    first = {"stiffness": 2.0, "hysteresis": 0.1, "stages": stages}
    load = gw.Harmonic(0.1, order=2, varies=number, name="v")
    friction = Friction("f", ("b", "c"), 0.3, speed=0.2)
    system = train(*shafts(**first), frictions=[friction], harmonics=[load]).system()
    (variation,) = system.structure.variations
    form = system.structure.contacts[variation.contact]
    prefix = form.name if variation.stage < 0 else form.stage_prefix(form.stages[variation.stage])
    assert f"{prefix}.{variation.name}" == number
    with pytest.raises(ModelError, match="there is no shaft or gear 's_fraction'"):
        train(*shafts(**first), harmonics=[gw.Harmonic(0.1, order=2, varies="s_fraction.limit", name="v")])
