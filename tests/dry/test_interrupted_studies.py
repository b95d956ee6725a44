"""Studies with friction and rigid stops that are killed, stopped, or done by two at once come to the same results."""

from __future__ import annotations

import signal
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import Interrupted
from gapwalk.parallel.workers import local_workers
from tests.dry.dry_jobs import STUDIES, study_of
from tests.studies.killing import killed_after
from tests.studies.same import assert_same_branch, assert_same_result
from tests.tiers import some_of

SAFE = {"response": 6, "settle": 1, "sweep": 1}
"""Lines after which a study is killed."""


@cache
def undisturbed(kind: str) -> gw.Result:
    return gw.run(study_of(kind))


def program(kind: str, path: Path) -> str:
    return f"from tests.dry.dry_jobs import main; main({kind!r}, {str(path)!r})"


@pytest.mark.slow
@pytest.mark.parametrize("kind", some_of(STUDIES, "response"))
def test_a_study_that_is_killed_goes_on_to_the_same_result(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.gapwalk"
    lines = killed_after(SAFE[kind], program(kind, path), longest_wait=0.1)
    if kind != "settle":  # its only line is its last
        assert "complete" not in lines
        assert not gw.open_result(path).complete
    gw.run(study_of(kind), path, resume=path.exists())
    assert_same_result(gw.open_result(path), undisturbed(kind))


def test_ctrl_c_within_a_walk_leaves_the_flow_usable() -> None:
    orbit = undisturbed("response").branches[0].points[0].orbit

    def report(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(Interrupted):
        gw.follow(orbit, "frequency", 0.61, report=report)
    state = gw.find_orbit(orbit.system, start=orbit.state).state
    np.testing.assert_allclose(state, orbit.state, rtol=0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.usefixtures("kept_processes")
def test_two_processes_find_the_same_as_one() -> None:
    up = undisturbed("sweep").finding
    assert up is not None
    options = {"steps": 13, "points": 13, "ways": "up and down", "workers": 1}
    alone = gw.sweep(study_of("sweep").system, "frequency", (0.6, 0.61), **options)
    with local_workers(2) as workers:
        found = gw.sweep(study_of("sweep").system, "frequency", (0.6, 0.61), **{**options, "workers": workers})
    np.testing.assert_array_equal(found.sections, alone.sections)
    np.testing.assert_array_equal(found.sections[0], up.record.sections[0])


def test_two_threads_find_the_same_as_one() -> None:
    orbit = undisturbed("response").branches[0].points[0].orbit

    def walked(_: int) -> gw.Branch:
        return gw.follow(orbit, "frequency", 0.605, walk=gw.WalkOptions(largest_step=0.05))

    alone = walked(0)
    with ThreadPoolExecutor(2) as threads:
        found = list(threads.map(walked, range(2)))
    for branch in found:
        assert_same_branch(branch, alone)
