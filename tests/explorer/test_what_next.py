"""What a point means for the machine: each claim is compared with a transient, or with other code."""

import io
import re

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.attractors.section import strobe
from gapwalk.explorer.diagram_lines import Line, contact_quantities, quantity, quantity_words
from gapwalk.explorer.motion_panels import special_words
from gapwalk.explorer.what_next import Stretch, at_point, at_special
from tests import models
from tests.explorer.conftest import CLUTCH
from tests.tiers import keeps


@pytest.fixture(scope="module")
def hard() -> gw.Branch:
    """The response of a mass with a stop, which leans over between two folds."""
    text = models.STOP + models.response(1.4)
    (branch,) = gw.run(gw.read_study(io.StringIO(text))).branches
    return branch


@pytest.fixture(scope="module")
def clutch() -> gw.Branch:
    (branch,) = gw.run(gw.read_study(CLUTCH)).branches
    return branch


def said(special: gw.SpecialPoint, branch: gw.Branch, measure: str) -> dict:
    return at_special(special, measure, [Stretch(branch.parameter, branch.points)])


@keeps("1")
@pytest.mark.parametrize("number", [0, 1])
def test_at_a_fold_the_machine_jumps_where_the_sentence_says(hard, number) -> None:
    special = [each for each in hard.special_points if each.kind == "fold"][number]
    found = said(special, hard, "half.x")
    before, after = map(float, re.findall(r"amplitude of x ([\d.]+) to ([\d.]+)", found["text"])[0])
    (values,) = [step["values"] for step in found["steps"] if step["do"] == "settle"]
    settled = gw.settle(special.orbit.system, special.orbit.state, at=values)
    assert settled.orbit is not None
    assert special.orbit.measure("half.x") == pytest.approx(before, rel=5e-3)
    assert settled.orbit.measure("half.x") == pytest.approx(after, rel=0.02)
    assert ("jumps up" if after > before else "jumps down") in found["text"]
    falls = values["frequency"] < special.value
    assert f"when Ω {'falls' if falls else 'rises'}" in found["text"]


def test_a_fold_without_a_known_motion_beyond_says_so(hard) -> None:
    special = next(each for each in hard.special_points if each.kind == "fold")
    assert "not among the branches shown" in at_special(special, "half.x")["text"]


def test_a_beat_has_the_length_that_a_transient_has(clutch) -> None:
    special = next(each for each in clutch.special_points if each.kind == "neimark-sacker")
    found = said(special, clutch, "half.q1")
    length = float(re.findall(r"a beat of about ([\d.]+) forcing periods", found["text"])[0])
    # strobes of a transient: once the other modes have decayed, d(n + 1) = 2 cos(phi) d(n) - d(n - 1)
    orbit = special.orbit
    strobes = strobe(orbit.system, orbit.state + 1e-5, 120).signal("q1")[60:] - orbit.state[0]
    cosine = np.dot(strobes[2:] + strobes[:-2], strobes[1:-1]) / np.dot(strobes[1:-1], strobes[1:-1]) / 2.0
    assert length == pytest.approx(2.0 * np.pi / np.arccos(cosine), rel=2e-3)


def test_beyond_a_flip_the_motion_has_twice_the_period(clutch) -> None:
    special = next(each for each in clutch.special_points if each.kind == "flip" and each.nature == "supercritical")
    found = said(special, clutch, "half.q1")
    assert "repeats every 2 forcing periods; the change grows from zero" in found["text"]
    assert [step["do"] for step in found["steps"]] == ["switch", "locus", "settle", "hear", "pin"]
    (values,) = [step["values"] for step in found["steps"] if step["do"] == "settle"]
    assert gw.settle(special.orbit.system, special.orbit.state, at=values).period == 2


def test_a_point_is_said_to_be_left_if_it_is_unstable(hard) -> None:
    words = {point.stable: at_point(point.orbit) for point in hard.points}
    assert words[True]["text"].startswith("Stable")
    assert [step["do"] for step in words[False]["steps"]] == ["settle", "hear", "pin"]


def test_forces_and_impacts_are_those_that_the_rattle_has(hard) -> None:
    orbit = max((point.orbit for point in hard.points), key=lambda each: each.measure("half.x"))
    system = orbit.system
    assert contact_quantities(system) == ["peak.stop", "impacts.stop"]
    rattle = gw.analysis.rattle(orbit)
    assert quantity(orbit, "peak.stop") == pytest.approx(rattle.contacts[0].peak, rel=1e-4)
    many = sum(side.impacts for side in rattle.sides) * system.frequency / (2.0 * np.pi)
    assert quantity(orbit, "impacts.stop") == pytest.approx(many, rel=1e-9)
    assert many > 0.0
    words = [each["words"] for each in quantity_words(contact_quantities(system), system)]
    assert words == ["peak force of stop", "impacts per unit of time on stop"]
    train = gw.read_study(CLUTCH.with_name("drivetrain.toml"), name="speed").system
    assert [each["words"] for each in quantity_words(contact_quantities(train), train)] == [
        "peak torque of clutch [N m]",
        "impacts per second on clutch",
    ]


def test_grazes_at_one_value_have_one_description_and_a_double_fold_has_its_name() -> None:
    names = ["a", "b"]
    system = gw.System(
        names,
        mass=[1.0, 1.0],
        damping=[0.08, 0.08],
        stiffness=np.eye(2).tolist(),
        contacts=[gw.backlash(f"gap{name}", {name: 1.0}, 1.0, 8.0) for name in names],
        harmonics=[gw.Harmonic(0.4, dict.fromkeys(names, 1.0))],
        frequency=0.7,
    )
    branch = gw.follow(gw.find_orbit(system), "frequency", 2.3)
    line = Line("P1-1", "frequency", (0.7, 2.3), 1, branch.points, branch.special_points, None, "", False)
    found = special_words(line)
    shown = [each for each in found if not each["again"]]
    assert len(found) == len(branch.special_points) > len(shown)
    contacts = [sorted(each["lines"][3].split(", ")) for each in shown if each["kind"] == "grazing"]
    assert contacts == [["gapa +", "gapa -", "gapb +", "gapb -"]] * 2
    assert [(each["lines"][4], each["switches"], each["has_locus"]) for each in shown if each["kind"] == "fold"] == [
        ("double fold", True, False)
    ] * 2
