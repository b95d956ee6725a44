"""A third way to find orbits, written here in one piece, does all that the two of the package do."""

from __future__ import annotations

import csv
from dataclasses import dataclass, fields, replace
from typing import ClassVar

import pytest

import gapwalk as gw
from gapwalk.bifurcation.orbit_on_branch import Curve
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.explorer.request_tasks import method_of
from gapwalk.orbit import Method, Orbit, ShootingEquation, register
from gapwalk.orbit.method import METHODS, chosen
from gapwalk.studies.response_study import ResponseOptions
from tests import models
from tests.sampled_verification import SAMPLED, verified
from tests.systems import clutch

MODEL = models.STOP + models.response(1.9)


@dataclass(frozen=True, slots=True)
class Relay(Method):
    """Shooting in two segments or more, under another name."""

    name: ClassVar[str] = "relay"
    columns: ClassVar[tuple[str, ...]] = ("legs",)

    segments: int = 2
    tolerance: float = 1e-10

    @classmethod
    def resolving(cls, orbit, count):
        return cls(count // len(orbit.state))

    def pose(self, system, parameter=None, period=1):
        return RelayEquation(system, parameter, period, self)

    @staticmethod
    def words(orbits):
        return f"by relay, in {min(orbit.legs for orbit in orbits)} legs"


class RelayOrbit(Orbit):
    """What it finds."""

    found_by: ClassVar[str] = "relay"

    @property
    def legs(self) -> int:
        """Something to tell in tables."""
        return 2


class RelayEquation(ShootingEquation):
    """Its equation."""

    def orbit(self, unknowns, value, evaluation):
        found = super().orbit(unknowns, value, evaluation)
        return RelayOrbit(**{field.name: getattr(found, field.name) for field in fields(found)})


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Known from here on, as by an import of its file, and forgotten again."""
    register(Relay)
    yield
    del METHODS[Relay.name]


@pytest.fixture(scope="module")
def branch():
    orbit = gw.find_orbit(clutch(frequency=0.85), method=Relay())
    return gw.follow(orbit, "frequency", to=0.6, method=Relay())


@pytest.fixture(scope="module")
def shot():
    return gw.follow(gw.find_orbit(clutch(frequency=0.85)), "frequency", to=0.6)


def test_it_finds_the_special_points_of_shooting(branch, shot):
    assert {type(each.orbit) for each in (*branch.points, *branch.special_points)} == {RelayOrbit}
    assert len(branch.points[0].x) == 9  # two states of two degrees of freedom, and the frequency
    assert [each.kind for each in branch.special_points] == [each.kind for each in shot.special_points]
    assert {"fold", "flip", "grazing"} <= {each.kind.value for each in branch.special_points}
    for one, other in zip(branch.special_points, shot.special_points, strict=True):
        assert one.value == pytest.approx(other.value, abs=1e-9)
        assert one.nature == other.nature


@pytest.mark.parametrize("sampled", SAMPLED)
def test_it_verifies(branch, sampled):
    found = verified(branch, sampled)
    assert found.ok, found.words
    assert sampled or found.points == len(branch.points)


def test_a_fault_is_found(branch):
    wrong = replace(branch.points[7].orbit, state=branch.points[7].orbit.state * 1.001)
    points = [*branch.points]
    points[7] = replace(points[7], orbit=wrong, memo={})
    assert not gw.verify(replace(branch, points=tuple(points))).ok


def test_orbits_are_looked_up_on_its_branches(branch, shot):
    curve = Curve(branch)
    assert all(curve.holds(point.orbit) for point in shot.points[::9])
    assert not curve.holds(gw.find_orbit(clutch(frequency=0.5)))
    assert {type(orbit) for orbit in curve.orbits_at(0.7)} == {RelayOrbit}


@pytest.mark.slow
def test_a_doubled_branch_leaves_its_flip(branch):
    flip = branch.special("flip")[0]
    doubled = gw.follow(flip, "frequency", to=(0.6, 0.85), method=Relay())
    assert doubled.period == 2
    assert gw.verify(doubled).ok


def test_a_flip_is_followed_in_two_parameters_only_by_who_has_a_plane(branch):
    flip, plane = branch.special("flip")[0], ("frequency", "stage2.impact_damping")
    with pytest.raises(ModelError, match=r"a locus cannot be followed by the method relay; write Shooting\(\)"):
        gw.follow_locus(flip, *plane, ((0.6, 0.85), (0.04, 0.06)), method=Relay())
    assert len(gw.follow_locus(flip, *plane, ((0.6, 0.85), (0.04, 0.06))).points) > 2


def test_a_model_file_and_the_command_line_know_its_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "stop.toml"
    file.write_text(MODEL.replace("[study]", '[study]\nmethod = "relay"'))
    assert main(["run", "stop.toml"]) == 0
    assert "by relay, in 2 legs" in capsys.readouterr().out
    rows = list(csv.DictReader((tmp_path / "stop-points.csv").read_text().splitlines()))
    assert rows
    assert {row["legs"] for row in rows} == {"2"}
    file.write_text(MODEL.replace("[study]", '[study]\nmethod = "rely"'))
    assert main(["run", "stop.toml"]) == 2
    assert 'it must be one of "shooting", "harmonic-balance", "relay"' in capsys.readouterr().err


def test_an_exploration_goes_on_as_an_orbit_was_found(branch):
    orbit, options = (branch.points[3].orbit, ResponseOptions("frequency", 0.85, 0.6, "half.q1", method=Relay(3)))
    assert method_of(orbit, gw.Study(clutch(), options)) == Relay(3)
    assert method_of(orbit, gw.Study(clutch(), replace(options, method=gw.Balance()))) == Relay()
    assert method_of(gw.find_orbit(clutch(frequency=0.85)), gw.Study(clutch(), options)) == gw.Shooting()


def test_what_is_no_method_is_refused():
    with pytest.raises(ModelError, match=r"method is 'relay'; write method=gw\.Balance"):
        chosen("relay")
    with pytest.raises(ModelError, match="there is no method 'rely'; did you mean relay"):
        Method.named("rely")


def test_the_name_of_another_method_is_refused() -> None:
    class Other(Method):
        name = "shooting"

    with pytest.raises(ModelError, match="there is a method 'shooting' already, Shooting; choose another name"):
        register(Other)
    assert Method.named("shooting") is gw.Shooting
