"""Phases of friction and rigid stops, and their pictures."""

from itertools import pairwise

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.flow.hysteresis import stick_slip
from tests.flow.dry_systems import SYSTEMS, beginning


def moved(name, periods=6.0):
    """Return a sampled motion."""
    return gw.integrate(SYSTEMS[name], beginning(SYSTEMS[name]), periods, 512)


@pytest.mark.parametrize("name", SYSTEMS)
def test_phases_are_the_modes_at_the_samples(name):
    motion = moved(name)
    found = stick_slip(motion)
    structure = motion.system.structure
    dry = [form.name for form in structure.contacts if form.law.is_dry]
    words = {1: "slip +", -1: "slip -", 0: "stick"}
    for element in found.elements:
        own = [each for each in found.phases if each.element == element]
        assert all(one.end <= other.start for one, other in pairwise(own))
        for phase in own:
            inside = (motion.theta > phase.start) & (motion.theta < phase.end)
            if element in dry:
                assert {words[int(each)] for each in motion.slip[inside, dry.index(element)]} <= {phase.mode}
            else:
                assert phase.mode == "held"
                assert np.all(motion.modes.held[inside].any(axis=1))


def test_friction_without_a_host_has_one_mode_at_any_time():
    found = stick_slip(moved("iwan"))
    for element in "fgh":
        assert sum(found.share(element, mode) for mode in ("slip +", "slip -", "stick")) == pytest.approx(
            1.0, abs=1e-13
        )


def test_friction_of_an_open_stage_has_no_mode():
    motion = moved("stages")
    found = stick_slip(motion)
    shares = sum(found.share("cf", mode) for mode in ("slip +", "slip -", "stick"))
    closed = np.mean(np.abs(motion.q[:, 0]) > 0.2)
    assert shares == pytest.approx(closed, abs=2e-3)


def test_strikes_are_the_impacts():
    motion = moved("impact")
    found = stick_slip(motion)
    assert [each.theta for each in found.strikes] == [each.theta for each in motion.impacts]
    for strike, kink in zip(found.strikes, motion.impacts, strict=True):
        assert strike.velocity == pytest.approx(kink.velocities[0][0], rel=1e-12)
        assert kink.velocities[1][0] == pytest.approx(-0.8 * strike.velocity, rel=1e-12)


def test_a_motion_without_friction_and_unknown_names_are_refused():
    smooth = gw.System(("x",), [[1.0]], [[0.1]], harmonics=[gw.Harmonic(1.0, {"x": 1.0})])
    with pytest.raises(ModelError, match="no dry friction"):
        stick_slip(gw.integrate(smooth, [0.0, 0.0]))
    found = stick_slip(moved("iwan"))
    with pytest.raises(ModelError, match="no friction or rigid stop 'brake'"):
        found.share("brake", "stick")
    with pytest.raises(ModelError, match="is no mode"):
        found.share("f", "slips")
    with pytest.raises(ModelError, match="has no loop by itself"):
        gw.analysis.hysteresis(SYSTEMS["stages"], 0.5, "cf")


def test_the_record_describes_and_draws_itself(tmp_path):
    found = stick_slip(moved("stick"))
    assert "share of the time" in str(found.summary())
    rows = list(found.tables()["phases"]())
    assert rows[0] == ["element", "mode", "start", "end"]
    gw.plot.save(found, tmp_path / "phases.png")
    assert {each.name for each in tmp_path.iterdir()} == {"phases.png"}


@pytest.mark.slow
def test_the_strip_and_the_energy_of_friction_are_drawn(tmp_path):
    gw.plot.save(stick_slip(moved("chatter and friction")), tmp_path / "strip.png", loops=())
    orbit = gw.find_orbit(SYSTEMS["jenkins"])
    gw.plot.save(gw.analysis.energy(orbit), tmp_path / "energy.png", power=True)
    gw.plot.save(orbit, tmp_path / "history.png")
    assert {each.name for each in tmp_path.iterdir()} == {"strip.png", "energy.png", "history.png"}
