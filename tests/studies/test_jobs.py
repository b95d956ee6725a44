"""Studies without branches: what is in their results, and what they refuse."""

import json
import shutil
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError, StoreError
from gapwalk.model.model_source import parse_source
from gapwalk.studies.result import check_claim
from gapwalk.studies.study_file import check_study
from tests.studies.jobs import BASINS, HEAD, REGIMES, SETTLE, SMALL, SWEEP, study_of
from tests.studies.killing import killed_after

ARRAYS = {
    "basins": ("labels",),
    "regimes": ("regimes", "periods", "exponents", "peak_force", "impacts", "states"),
}


@pytest.fixture(autouse=True)
def small_parts(monkeypatch) -> None:
    """Chunks of so few cells that each job has some."""
    for module, name, value in SMALL:
        monkeypatch.setattr(module, name, value)


def assert_same_record(kind: str, one, other) -> None:
    for name in ARRAYS[kind]:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.slow
def test_a_run_that_is_killed_comes_to_the_same_result(tmp_path) -> None:
    """Of basins; more kinds are killed more often in tests/faults/test_kills.py."""
    kind = "basins"
    path, whole = tmp_path / "killed.gapwalk", gw.run(study_of(kind))
    code = f"from tests.studies.jobs import main; main({kind!r}, {str(path)!r})"
    assert "complete" not in killed_after(1, code)
    assert not gw.open_result(path).complete
    gw.run(study_of(kind), path, resume=True)
    assert_same_record(kind, gw.open_result(path).finding.record, whole.finding.record)
    assert json.dumps(gw.open_result(path).finding.document(True)) == json.dumps(whole.finding.document(True))


def test_a_settled_motion_has_its_rattle_spectrum_and_section() -> None:
    finding = gw.run(study_of("settle")).finding
    attractor = gw.classify(gw.paper.case("15"), frequency=0.45)
    assert finding.attractor.label == attractor.label == "P3"
    assert repr(finding.rattle) == repr(gw.analysis.rattle(attractor.orbit))
    motion = attractor.orbit.motion(samples=4000)
    force = motion.signal("stage2")[:-1]
    theta = np.linspace(0.0, 6.0 * np.pi, len(force), endpoint=False)
    assert len(finding.lines) > 10
    for line in finding.lines[:10]:  # the Fourier integral by the rectangle rule
        amplitude = 2.0 * abs(np.mean(force * np.exp(-1j * line.order * theta)))
        assert line.amplitude == pytest.approx(amplitude, rel=1e-3, abs=1e-5)
    quarters = [motion.q[1000 + 4000 * period] for period in range(3)]  # a quarter of a period after the strobes
    found = finding.section[:, :2]
    order = [int(np.argmin(np.abs(found - q).max(axis=1))) for q in quarters]
    assert sorted(order) == [0, 1, 2]
    np.testing.assert_allclose(found[order], quarters, atol=1e-9)


def test_nothing_is_kept_of_a_job_that_was_stopped_at_once(tmp_path, monkeypatch) -> None:
    path = tmp_path / "x"

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gapwalk.studies.settle_study.settle", stop)
    monkeypatch.setattr("gapwalk.studies.basin_study.explore", stop)
    for kind in ("settle", "basins"):
        with pytest.raises(KeyboardInterrupt):
            gw.run(study_of(kind), path)
        assert not path.exists()


def test_a_damaged_part_is_refused_and_another_study_is_not_gone_on_with(tmp_path) -> None:
    path, other = tmp_path / "x", tmp_path / "y"
    study = study_of("settle")
    gw.run(study, path)
    with pytest.raises(StoreError, match=r"phase is 0\.0, and was 1\.57"):
        check_claim(path, replace(study, options=replace(study.options, phase=0.0)), resume=True, force=False)
    with pytest.raises(StoreError, match="its kind is sweep, and was settle"):
        check_claim(path, study_of("sweep"), resume=True, force=False)
    for change in (
        "UPDATE part SET arrays = x'00' WHERE name = 'settled'",
        "UPDATE part SET checksum = '' WHERE name = 'settled'",
        "DELETE FROM part WHERE name = 'settled'",
        "UPDATE part SET name = 'sunken' WHERE name = 'settled'",
    ):
        shutil.copy(path, other)
        with sqlite3.connect(other) as connection:
            connection.execute(change)
        connection.close()
        with pytest.raises(StoreError, match="is damaged"):
            gw.open_result(other)


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (SETTLE, '"stage2"\nphase', '"stage3"\nphase', "there is no signal 'stage3'; did you mean stage2.force?"),
        (SETTLE, '"90 deg"', "7.0", "study.phase is 7.0 radians; it must be at least 0 and less than a whole turn"),
        (SETTLE, 'kind = "settle"', 'kind = "settle"\nstart = "settle"', 'study.start is "settle"; it must be one of'),
        (
            SETTLE,
            'kind = "settle"',
            'kind = "settle"\nstart = [1.0]',
            "study.start is a list of 1 numbers; it must have 4",
        ),
        (SETTLE, 'kind = "settle"', 'kind = "settle"\nmeasure = "half.q1"', "study.measure is not a key here"),
        (SETTLE, "frequency = 0.45", "", "frequency is missing; the study walks nothing: write it at the top"),
        (BASINS, "frequency = 0.45", "", "frequency is missing; the study walks nothing: write it at the top"),
        (SWEEP, '"q3\'"', '"q4"', 'study.signal is "q4"; did you mean q1 or q3?'),
        (SWEEP, "points = 13", "points = 12", "study.points is 12; it must be more than max_period, 12"),
        (SWEEP, "points = 13", 'ways = "sideways"', "study.ways is 'sideways'; write \"up and down\""),
        (SWEEP, "points = 13", "longest = 3", "study.longest is 3; it must be at least 48"),
        (SWEEP, "points = 13", "starts = [[0.0, 1.0]]", "is a list of 2 numbers; it must have 4"),
        (SWEEP, "to = 0.6\n", "", "study.to is missing"),
        (BASINS, "q1 = [-4.0, 4.0], ", "", "study.plane names 1 axis; write two axes, each with its range"),
        (BASINS, "q1 = [-4.0, 4.0]", "q2 = [-4.0, 4.0]", "there is no coordinate or velocity 'q2'"),
        (BASINS, "q1 = [-4.0, 4.0]", "q1 = [4.0, -4.0]", "the range of q1 is from 4 to -4: it is empty"),
        (BASINS, "{ q3 = 0.5 }", "{ q1 = 0.5 }", "q1 is both an axis of the plane and fixed"),
        (BASINS, "[100, 90]", "[100, 90, 3]", "study.resolution is"),
        (BASINS, 'plane = { q1 = [-4.0, 4.0], "q1\'" = [-3.0, 3.0] }\n', "", "study.plane is missing; write two axes"),
        (REGIMES, '"up"', '"sideways"', 'study.carry is "sideways"; it must be one of "no", "up", "down"'),
        (REGIMES, '"harmonic1.amplitude"', '"frequency"', "which is the first one; choose another"),
        (REGIMES, "resolution", "resolutions", "study.resolutions is not a key here; did you mean resolution"),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_what_to_write(text, old, new, message) -> None:
    assert old in text
    with pytest.raises(ModelError) as caught:
        check_study(parse_source(text.replace(old, new)))
    assert message in str(caught.value)


def test_a_start_that_is_a_state_is_where_the_motion_begins() -> None:
    on_the_other = "[3.76461296, 1.98135023, -0.05626160, 0.31401034]"  # next to the motion of period 1
    text = HEAD + f'kind = "settle"\nstart = {on_the_other}\n'
    assert gw.run(check_study(parse_source(text))).finding.attractor.label == "P1"
