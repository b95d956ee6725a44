"""Random systems with friction and stops: each step ends with a result that verification passes, or with a reason."""

import json
import os
import signal
from dataclasses import asdict, replace
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.errors import Interrupted
from tests.dry.trials.__main__ import apart, table
from tests.dry.trials.random_systems import random_system
from tests.dry.trials.trial import Trial, _differences, attempt
from tests.tiers import keeps, some_of


@pytest.mark.slow
@keeps("52")
@pytest.mark.parametrize("seed", some_of(range(100), 51, 52))
def test_each_ends_with_a_result_or_a_reason(seed: int) -> None:
    trial = attempt(f"random {seed}", random_system(seed), factor=1.02, sampled=2)
    assert trial.faults == []
    assert {"orbit", "motion", "sweep"} <= trial.ends.keys()


@pytest.mark.slow
def test_a_way_back_that_ends_early_is_compared_as_far_as_it_leads() -> None:
    system = random_system(145)
    there = gw.follow(gw.find_orbit(system), "frequency", 1.3 * system["frequency"])
    back = gw.follow(there.points[-1].orbit, "frequency", system["frequency"])
    assert len(there.special_points) == len(back.special_points) == 8
    assert _differences(there, back) == []
    last = next(place for place, each in enumerate(back.points) if each.value < 0.5)  # beyond the first five points
    within = tuple(each for each in back.special_points if each.value > 0.5)
    cut = replace(back, points=back.points[: last + 1], special_points=within)
    assert len(within) == 5
    assert _differences(there, cut) == []
    assert len(_differences(there, replace(cut, special_points=within[1:]))) == 1
    assert len(_differences(replace(there, special_points=there.special_points[:-1]), cut)) == 1


def endless() -> str:
    """Loop for ever; where it is stopped, keep a part as a walk does."""
    try:
        while True:
            pass
    except KeyboardInterrupt as stop:
        raise Interrupted("a part") from stop


def test_a_step_beyond_its_share_of_the_cap_is_slow_and_keeps_what_it_found() -> None:
    trial = Trial("random 0", cap=0.2)
    assert trial.step("walk", endless, str) == "a part"
    assert trial.slow
    assert not trial.faults
    assert trial.step("next", lambda: 1, str) == 1
    assert "too slow" in trial.ends["walk"]
    with pytest.raises(KeyboardInterrupt):
        trial.step("stopped by hand", lambda: signal.raise_signal(signal.SIGINT), str)


def test_a_trial_whose_process_dies_is_named_in_the_table(tmp_path: Path) -> None:
    died = apart("random 7", 1.0, lambda: os.kill(os.getpid(), signal.SIGKILL))
    done = apart("random 8", 1.0, lambda: Trial("random 8", outcome="the end of the range was reached"))
    log = tmp_path / "log"
    log.write_text("".join(json.dumps(asdict(each)) + "\n" for each in (died, done)), encoding="utf-8")
    assert died.faults
    assert not done.faults
    assert table(log).splitlines()[0].split() == ["2", "systems"]
    assert "1 its process was ended: 7" in table(log)
    assert table(log).splitlines()[-1].split() == ["1", "with", "faults:", "7"]
