"""Friction, hysteresis and rigid stops in model files: how they are read, and the message of each mistake."""

from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.model.laws import Coulomb, Hysteretic, Jenkins, Rigid
from gapwalk.model.laws.law import Elastic
from gapwalk.model.model_file import check_model, checked_model
from gapwalk.model.model_source import read_source
from gapwalk.model.words import parameter_words
from tests.results.again import again

BASE = """
coordinates = ["x", "y"]
stiffness = [[1.0, 0.0], [0.0, 2.0]]
damping = [[0.1, 0.0], [0.0, 0.1]]
frequency = 1.3

[[harmonic]]
amplitude = 1.0
acts_on = { x = 1.0 }
"""
STUDY = '\n[study]\nkind = "response"\nparameter = "frequency"\nfrom = 1.3\nto = 1.2\n'
BRAKE = '[[friction]]\nname = "brake"\ndeflection = { x = 1.0 }\n'
STOP = '[[contact]]\nname = "stop"\ndeflection = { x = 1.0 }\n'
SOFT = STOP + "clearance = 0.5\nstiffness = 3.0\n"
STAGE = "[[contact.stage]]\nclearance = {}\nstiffness = {}\n"


def write(folder: Path, text: str, base: str = BASE) -> Path:
    path = folder / "model.toml"
    path.write_text(base + text + STUDY, encoding="utf-8")
    return path


def system_of(folder: Path, text: str, base: str = BASE) -> gw.System:
    model, problems = check_model(read_source(write(folder, text, base)))
    assert model is not None, problems
    return model.system


def laws_of(system: gw.System) -> dict:
    return {form.name: form.law for form in system.structure.contacts}


def test_friction_by_a_limit(tmp_path) -> None:
    system = system_of(tmp_path, BRAKE + "limit = 0.3\nstatic = 1.2\nspeed = -0.5\n")
    assert laws_of(system) == {"brake": Coulomb()}
    assert (system["brake.limit"], system["brake.static"], system["brake.speed"]) == (0.3, 1.2, -0.5)
    python = gw.System(
        ["x", "y"],
        [1.0, 2.0],
        [0.1, 0.1],
        contacts=[gw.friction("brake", {"x": 1.0}, 0.3, static=1.2, speed=-0.5)],
        harmonics=[gw.Harmonic(1.0, {"x": 1.0})],
        frequency=1.3,
    )
    assert system == python


def test_several_jenkins_elements_make_an_iwan_model(tmp_path) -> None:
    text = "".join(BRAKE.replace("brake", f"j{k}") + f"limit = {0.1 * k}\nstiffness = 5.0\n" for k in (1, 2, 3))
    system = system_of(tmp_path, text)
    assert [*laws_of(system).values()] == [Jenkins()] * 3
    assert system.state_size == 7


def test_friction_by_the_force_of_a_contact(tmp_path) -> None:
    text = SOFT + BRAKE.replace("x =", "y =") + 'coefficient = 0.3\nnormal = "stop"\n'
    assert laws_of(system_of(tmp_path, text))["brake"] == Coulomb("normal", "stop")


@pytest.mark.parametrize("spring", ["", "hysteresis_stiffness = 10.0\n"])
def test_hysteresis_of_a_single_stage_acts_by_that_stage(spring: str, tmp_path) -> None:
    system = system_of(tmp_path, SOFT + "hysteresis = 0.2\n" + spring)
    kind = Jenkins if spring else Coulomb
    assert laws_of(system) == {"stop": Hysteretic("elastic"), "stop_friction": kind("stages", "stop")}
    assert (system["stop.hysteresis"], system["stop_friction.limit"]) == (0.2, 0.0)
    if spring:
        assert system["stop_friction.stiffness"] == 10.0


def test_hysteresis_above_tables_of_stages_always_acts(tmp_path) -> None:
    stages = STAGE.format(0.5, 3.0) + STAGE.format(1.0, 4.0)
    alone = system_of(tmp_path, STOP + "hysteresis = 0.2\n" + stages)
    with pytest.raises(ModelError, match=r"no parameter 'stop.hysteresis'; did you mean 'stop_friction.limit'"):
        alone["stop.hysteresis"]
    assert laws_of(alone) == {"stop": Elastic(), "stop_friction": Coulomb()}
    assert alone["stop_friction.limit"] == 0.2
    both = system_of(tmp_path, STOP + "hysteresis = 0.2\n" + stages + "hysteresis = 0.5\n")
    assert laws_of(both) == {"stop": Hysteretic("elastic"), "stop_friction": Coulomb("stages", "stop")}
    assert [both[f"stop.stage{k}.hysteresis"] for k in (1, 2)] == [0.0, 0.5]
    assert both["stop_friction.limit"] == 0.2


def test_the_springs_keep_their_law(tmp_path) -> None:
    system = system_of(tmp_path, SOFT + "hysteresis = 0.2\nviscous_damping = 0.1\n")
    assert laws_of(system)["stop"] == Hysteretic("viscous")
    assert system["stop.viscous_damping"] == 0.1


@pytest.mark.parametrize(
    "how", ['stiffness = "rigid"\n', 'law = "rigid"\n', 'law = "rigid"\nstiffness = "rigid"\n', ""]
)
def test_a_rigid_stop_alone_is_one_contact(how: str, tmp_path) -> None:
    system = system_of(tmp_path, STOP + 'clearance = 0.5\nside = "positive"\nrestitution = 0.8\n' + how)
    python = gw.rigid_stop("stop", {"x": 1.0}, 0.5, 0.8)
    assert laws_of(system) == {"stop": Rigid()}
    assert system.structure.contacts == gw.System(["x"], [1.0], contacts=[python]).structure.contacts
    assert (system["stop.clearance"], system["stop.restitution"]) == (0.5, 0.8)


def test_a_gap_with_two_rigid_sides_is_one_contact(tmp_path) -> None:
    rigid = STAGE.format(0.5, '"rigid"') + 'side = "positive"\nrestitution = 0.8\n'
    rigid += STAGE.format(0.9, '"rigid"') + 'side = "negative"\nrestitution = 0.8\n'
    system = system_of(tmp_path, STOP + rigid)
    assert laws_of(system) == {"stop": Rigid()}
    assert (system["stop.stage1.clearance"], system["stop.stage2.clearance"]) == (0.5, 0.9)
    assert [side for _, side, _ in system.breakpoints] == [1, -1]
    whole = system_of(tmp_path, STOP + 'clearance = 0.5\nstiffness = "rigid"\nrestitution = 0.8\n')
    assert [side for _, side, _ in whole.breakpoints] == [1, -1]


def test_a_rigid_stage_beyond_springs_is_a_stop_beside_them(tmp_path) -> None:
    stages = STAGE.format(0.5, 3.0) + "hysteresis = 0.1\n" + STAGE.format(1.0, '"rigid"') + "restitution = 0.7\n"
    system = system_of(tmp_path, STOP.replace("}", "}\nforce = { x = 2.0, y = -1.0 }") + stages)
    assert [*laws_of(system)] == ["stop", "stop_friction", "stop_stop"]
    assert laws_of(system)["stop_stop"] == Rigid()
    assert (system["stop_stop.clearance"], system["stop_stop.restitution"]) == (1.0, 0.7)
    for name in laws_of(system):  # all act along the same vectors
        np.testing.assert_array_equal(system.vector(f"{name}.deflection"), [1.0, 0.0])
        np.testing.assert_array_equal(system.vector(f"{name}.force"), [2.0, -1.0])


def test_a_displacement_of_the_contact_is_one_of_all_beside_it(tmp_path) -> None:
    stages = STAGE.format(0.5, 3.0) + "hysteresis = 0.1\n" + STAGE.format(1.0, '"rigid"') + "restitution = 0.7\n"
    sway = '[[harmonic]]\nname = "sway"\norder = 2\namplitude = 0.1\nvaries = "stop.deflection"\n'
    system = system_of(tmp_path, sway + STOP + stages)
    assert {each.contact for each in system.structure.variations if each.is_deflection} == {0, 1, 2}
    one_side = stages.replace("clearance", 'side = "positive"\nclearance')
    wide = sway.replace("stop.deflection", "stop.clearance")
    system = system_of(tmp_path, wide + STOP + one_side)  # the stop is where it is; friction slips as it did
    assert {each.contact for each in system.structure.variations} == {0, 2}


def test_it_is_stored_and_changed(tmp_path) -> None:
    stages = STAGE.format(0.5, 3.0) + "hysteresis = 0.1\n" + STAGE.format(1.0, '"rigid"') + "restitution = 0.7\n"
    text = STOP + "hysteresis_stiffness = 9.0\n" + stages
    text += BRAKE.replace("x =", "y =") + 'coefficient = 0.3\nnormal = "stop"\n'
    system = system_of(tmp_path, text)
    assert again(system) == system
    changed = {"stop.stage1.hysteresis": 0.2, "stop_friction.stiffness": 8.0, "stop_stop.restitution": 0.0}
    changed |= {"brake.static": 1.5, "brake.speed": 0.1}
    other = again(system.at(changed))
    assert {name: other[name] for name in changed} == changed
    assert main(["check", str(write(tmp_path, text)), "--set", "stop_stop.restitution=0.2"]) == 0


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("brake.limit", -0.1, "it must be >= 0: friction only takes energy"),
        ("brake.static", 0.9, "it must be >= 1: at rest it is no smaller than in slip"),
        ("stop.stage1.hysteresis", -0.1, "it must be >= 0: friction only takes energy"),
        ("stop_friction.stiffness", 0.0, "it must be > 0"),
        ("stop_stop.restitution", 1.1, "it must lie between 0 and 1"),
        ("stop_stop.restitution", -0.1, "it must lie between 0 and 1"),
    ],
)
def test_a_value_that_feeds_energy_in_is_refused_later_too(name: str, value: float, words: str, tmp_path) -> None:
    stages = STAGE.format(0.5, 3.0) + "hysteresis = 0.1\n" + STAGE.format(1.0, '"rigid"') + "restitution = 0.7\n"
    system = system_of(tmp_path, STOP + "hysteresis_stiffness = 9.0\n" + stages + BRAKE + "limit = 0.3\n")
    with pytest.raises(ModelError, match=words):
        system.at({name: value})


PRESSED = BRAKE + 'coefficient = 0.3\nnormal = "stop"\n'
RIGID = STOP + 'clearance = 0.5\nstiffness = "rigid"\n'
HARD, SPRINGY = STAGE.format(0.5, '"rigid"'), STAGE.format(0.5, 3.0)
MISTAKES = [
    (BRAKE, '"brake" has no limit; write limit = ..., the force in slip'),
    (BRAKE + "limit = -1.0\n", '"brake".limit is -1.0; it must be >= 0'),
    (BRAKE + "limit = 1.0\nstatic = 0.5\n", '"brake".static is 0.5; it must be >= 1'),
    (BRAKE + "limit = 1.0\nstatic = 1.5\nstiffness = 3.0\n", "has static together with stiffness"),
    (BRAKE + "limit = 1.0\nstiffness = 0.0\n", "stiffness is 0; it must be > 0. Friction that sticks rigidly has none"),
    (BRAKE + "limit = 1.0\nstiffness = -1.0\n", '"brake".stiffness is -1.0; it must be >= 0'),
    (BRAKE + "coefficient = 0.3\n", "has a coefficient, but no normal; write which contact presses"),
    (BRAKE + 'normal = "stop"\n', "has normal, but no coefficient"),
    (SOFT + BRAKE + 'limit = 0.1\ncoefficient = 0.3\nnormal = "stop"\n', "has limit together with coefficient"),
    (SOFT + BRAKE + 'limit = 0.1\nnormal = "stop"\n', "has normal, but no coefficient"),
    (BRAKE + "limit = 0.1\nmu = 0.3\n", 'the coefficient of friction is coefficient, beside normal = "stop"'),
    (BRAKE + 'limit = 0.1\nlaw = "coulomb"\n', "leave law out"),
    (BRAKE + 'limit = "0.1 N"\n', "it must be a number without a unit"),
    (BRAKE.replace("x =", "z =") + "limit = 0.1\n", "names no coordinate"),
    (BRAKE.replace("deflection = { x = 1.0 }\n", "") + "limit = 0.1\n", "deflection is missing"),
    (BRAKE + "limit = 0.1\nforce = { x = -1.0 }\n", "accelerates its own deflection by -1"),
    (BRAKE + "limit = 0.1\nforce = { y = 1.0 }\n", "accelerates its own deflection by 0"),
    (
        BRAKE + 'coefficient = 0.3\nnormal = "stp"\n' + SOFT,
        "'stp', which is no contact with a clearance; did you mean stop",
    ),
    (BRAKE + 'coefficient = 0.3\nnormal = "brake"\n', "which is friction itself"),
    (PRESSED + SOFT + "viscous_damping = 0.1\n", "may pull as the contact opens"),
    (PRESSED + SOFT + "cubic = -0.1\n", "may pull, for its cubic"),
    (PRESSED + SOFT + 'law = "piecewise"\npreload = -0.1\n', "for its preload"),
    (PRESSED + RIGID + "restitution = 0.5\n", "which is rigid: its force is a reaction"),
    (
        BRAKE + 'coefficient = 0.3\nnormal = "wind"\n[[force]]\nname = "wind"\nlaw = "k*x"\nk = 1.0\n'
        "deflection = { x = 1.0 }\n",
        "which is a formula, without stages",
    ),
    (
        BRAKE + "limit = 0.1\n" + BRAKE.replace("brake", "rub") + "limit = 0.2\n",
        "brake and rub stick on one deflection, and nothing says how they share its force; "
        "write one friction with the sum of their limits, or give one of them a stiffness",
    ),
    (
        "".join(
            BRAKE.replace("brake", n).replace("{ x = 1.0 }", d) + "limit = 0.1\n"
            for n, d in (("a", "{ x = 1.0 }"), ("b", "{ y = 1.0 }"), ("c", "{ x = 1.0, y = 1.0 }"))
        ),
        "a, b and c stick in more ways than the system can move",
    ),
    (SOFT + "hysteresis = -0.3\n", '"stop".hysteresis is -0.3; it must be >= 0'),
    (SOFT + "hysteresis_stiffness = 3.0\n", "hysteresis_stiffness is given without hysteresis"),
    (SOFT + "hysteresis = 0.1\nhysteresis_stiffness = 0.0\n", "stiffness is 0; it must be > 0"),
    (SOFT + "friction = 0.2\n", "write hysteresis = ..., the limit of friction beside these springs"),
    (STOP + 'clearance = 0.5\nlaw = "rigid"\nrestitution = 0.8\nhysteresis = 0.2\n', "leave hysteresis out"),
    (RIGID, "restitution is missing beside the stiffness"),
    (STOP + 'clearance = 0.5\nlaw = "rigid"\n', "restitution is missing"),
    (RIGID + "restitution = 1.2\n", "it must lie between 0 and 1"),
    (RIGID + "restitution = -0.2\n", '"stop".restitution is -0.2; it must be >= 0'),
    (STOP + 'stiffness = "rigid"\nrestitution = 0.2\n', '"stop".clearance is missing'),
    (STOP + 'clearance = 0.5\nstiffness = "stiff"\nrestitution = 0.2\n', 'or "rigid" for a rigid stop'),
    (STOP + 'clearance = 0.0\nstiffness = "rigid"\nrestitution = 0.2\n', "so that stop locks its deflection"),
    (SOFT + "restitution = 0.2\n", 'the contact is rigid; write stiffness = "rigid", or leave those out'),
    (RIGID + "restitution = 0.8\ncubic = 1.0\n", "cubic is 1.0, but the stage is rigid"),
    (RIGID + 'restitution = 0.8\nlaw = "viscous"\nviscous_damping = 0.1\n', 'restitution is 0.8, but law is "viscous"'),
    (RIGID + "restitution = 0.8\nforce = { x = -1.0 }\n", "an impact would feed energy in"),
    (STOP + SPRINGY + "restitution = 0.5\n", "the stage is a spring"),
    (STOP + HARD + STAGE.format(1.0, 3.0), "restitution is missing"),
    (STOP + HARD + "restitution = 1.5\n", "it must be <= 1"),
    (STOP + HARD + "restitution = 0.5\nhysteresis = 0.1\n", "leave it out"),
    (
        STOP + HARD + "restitution = 0.5\n" + STAGE.format(1.0, 3.0),
        "the stage beyond the rigid one on the positive side is never reached",
    ),
    (
        STOP + HARD + 'side = "positive"\nrestitution = 0.5\n' + HARD + 'side = "negative"\nrestitution = 0.6\n',
        "its rigid stages have the restitutions 0.5 and 0.6; write two contacts, one for each side",
    ),
    (STOP + SPRINGY + "hysteresis = 0.1\nhysteresis_stiffness = 0.5\n", "write it above the tables of the stages"),
    (STOP + "restitution = 0.8\n" + SPRINGY, "restitution is 0.8, but a stage has a stiffness"),
    (SOFT + "hysteresis = 0.1\n" + BRAKE.replace("brake", "stop_friction") + "limit = 0.1\n", "is taken already"),
    (BRAKE.replace("brake", "a") + "limit = 0.1\n" + SOFT.replace('"stop"', '"a"') + "\n", "is taken already"),
]


@pytest.mark.parametrize(("text", "words"), MISTAKES)
def test_each_mistake_is_reported_by_check(text: str, words: str, tmp_path, capsys) -> None:
    assert main(["check", str(write(tmp_path, text))]) != 0
    told = capsys.readouterr()
    lines = (told.out + told.err).splitlines()
    assert any(words in line for line in lines), lines
    assert all("Traceback" not in line for line in lines)


def test_check_says_what_acts(tmp_path, capsys) -> None:
    stages = STAGE.format(0.5, 3.0) + "hysteresis = 0.1\n" + STAGE.format(1.0, '"rigid"') + "restitution = 0.7\n"
    text = STOP + "hysteresis_stiffness = 9.0\n" + stages + BRAKE.replace("x =", "y =") + "limit = 0.3\n"
    assert main(["check", str(write(tmp_path, text))]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "stop (elastic with hysteresis)" in out
    assert "stop_friction (a spring in series with dry friction by the stages of stop)" in out
    assert "stop_stop (rigid)" in out
    assert "brake (dry friction that sticks rigidly)" in out


def test_labels_of_its_numbers() -> None:
    assert parameter_words("brake.limit") == "friction limit of brake"
    assert parameter_words("clutch.stage1.hysteresis") == "hysteresis of stage 1 of clutch"
    assert parameter_words("wall.restitution") == "restitution of wall"


def test_a_file_with_another_error_still_has_its_names(tmp_path) -> None:
    """Studies are checked against the names of a system whose file is wrong elsewhere."""
    stages = STAGE.format(0.5, 3.0) + "hysteresis = 0.1\n" + STAGE.format(1.0, '"rigid"') + "restitution = 7\n"
    text = STOP + "hysteresis = 0.1\nhysteresis_stiffness = 9.0\n" + stages + BRAKE + "limit = -0.3\nstatic = 2.0\n"
    model, _, system = checked_model(read_source(write(tmp_path, text)))
    assert model is None
    assert system is not None
    for name in ("brake.limit", "brake.static", "stop_friction.stiffness", "stop_stop.restitution"):
        assert name in system.parameters


def test_python_says_what_is_missing() -> None:
    stage = gw.Stage(0.5, 3.0, numbers={"hysteresis": 0.1})
    contact = gw.Contact("clutch", {"x": 1.0}, [stage])
    assert contact.law == Hysteretic("elastic")
    with pytest.raises(ModelError, match=r'gw\.friction\("clutch_friction", \.\.\., stages_of="clutch"\)'):
        gw.System(["x"], [1.0], contacts=[contact])
    plain = gw.Contact("clutch", {"x": 1.0}, [gw.Stage(0.5, 3.0)])
    with pytest.raises(ModelError, match="whose stages have no hysteresis"):
        gw.System(["x"], [1.0], contacts=[plain, gw.friction("f", {"x": 1.0}, stages_of="clutch")])
    for given in ({}, {"limit": 0.1, "coefficient": 0.3, "normal": "stop"}, {"coefficient": 0.3}, {"normal": "stop"}):
        with pytest.raises(ModelError, match="give a limit; or a coefficient with the contact that presses"):
            gw.friction("f", {"x": 1.0}, **given)
    with pytest.raises(ModelError, match="by rigid_stop"):
        gw.Contact("clutch", {"x": 1.0}, [gw.Stage(0.5, "rigid")])  # pyright: ignore


def test_friction_may_act_off_its_deflection() -> None:
    """It must only push against its own rate: the clutch of the paper in relative coordinates does."""
    clutch = gw.friction("clutch", {"x": 1.0}, 0.02, force={"x": 1.0, "y": -0.6})
    system = gw.System(["x", "y"], [1.0, 2.0], contacts=[clutch])
    assert again(system) == system


def varied(amplitude: float, *contacts: gw.Contact, **varies) -> gw.System:
    load = gw.Harmonic(amplitude, order=2, name="v", **varies)
    return gw.System(["x", "y"], [1.0, 2.0], [0.1, 0.1], contacts=contacts, harmonics=[load])


def test_a_number_that_varies_stays_within_its_bounds() -> None:
    brake = gw.friction("brake", {"x": 1.0}, 0.3)
    assert varied(1.0, brake, varies="brake.limit")["brake.limit"] == 0.3
    with pytest.raises(ModelError, match=r"brake.limit varies from -0.03 to 0.63 over the angle; it must be >= 0"):
        varied(1.1, brake, varies="brake.limit")
    wall = gw.rigid_stop("wall", {"x": 1.0}, 1.0, 0.8)
    assert varied(0.25, wall, varies="wall.restitution").size == 2
    with pytest.raises(ModelError, match=r"wall.restitution varies from 0.56 to 1.04 .* it must be between 0 and 1"):
        varied(0.3, wall, varies="wall.restitution")
    rectangle = gw.loads.Rectangle(1.5, "brake.limit")
    with pytest.raises(ModelError, match="it must be >= 0"):
        gw.System(["x"], [1.0], [0.1], contacts=[brake], harmonics=[rectangle])


def test_a_jenkins_element_follows_its_limit_over_the_angle_but_not_by_jumps() -> None:
    stop = gw.stop("stop", {"x": 1.0}, 0.5, 3.0)
    soft = gw.friction("f", {"y": 1.0}, coefficient=0.3, normal="stop", stiffness=5.0)
    rigid = gw.friction("f", {"y": 1.0}, coefficient=0.3, normal="stop")
    own = gw.friction("f", {"y": 1.0}, 0.3, stiffness=5.0)
    for name in ("stop.stiffness", "stop.deflection"):
        assert varied(0.1, stop, rigid, varies=name).size == 2
        assert varied(0.1, stop, soft, varies=name).size == 2
    assert varied(0.1, own, varies="f.limit").size == 2
    with pytest.raises(ModelError, match=r"f.stiffness varies over the angle; only the limit of friction can"):
        varied(0.1, own, varies="f.stiffness")
    for belt in (rigid, own):
        with pytest.raises(ModelError, match=r'f.speed varies .* varies = "f.deflection" and the amplitude -a'):
            varied(0.1, *((stop,) if belt is rigid else ()), belt, varies="f.speed")
    for parts, name in (((own,), "f.limit"), ((stop, soft), "stop.stiffness")):
        with pytest.raises(ModelError, match="a spring in series cannot follow a jump"):
            gw.System(["x", "y"], np.eye(2), contacts=parts, harmonics=[gw.loads.Rectangle(0.1, name)])
    assert varied(0.1, own, varies="f.deflection").size == 2  # its base moves
