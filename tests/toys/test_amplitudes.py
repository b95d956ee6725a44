"""A kind of study that stands in one file goes through all that studies go through."""

import inspect
import json
import math

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError, StoreError
from gapwalk.explorer.opened_file import Entry
from gapwalk.model.model_source import parse_source
from gapwalk.studies.functions import function_of
from gapwalk.studies.study_file import check_study
from tests.interruption import until_ctrl_c
from tests.studies.killing import killed_after
from tests.toys.amplitudes import MODEL, AmplitudeStudy, study


def exact(frequency: float) -> float:
    """The amplitude of x'' + 0.2 x' + x = 0.3 cos(frequency t)."""
    return 0.3 / math.hypot(1.0 - frequency**2, 0.2 * frequency)


def test_it_finds_the_amplitudes_of_the_closed_form() -> None:
    whole = gw.run(study())
    assert [value for value, _ in whole.finding.record.found] == pytest.approx([0.5, 0.7, 0.9, 1.1, 1.3, 1.5])
    assert [a for _, a in whole.finding.record.found] == pytest.approx(
        [exact(w) for w, _ in whole.finding.record.found], rel=1e-8
    )


def test_its_function_is_made_of_its_declaration(tmp_path) -> None:
    amplitudes = function_of(AmplitudeStudy, "amplitudes")
    assert str(inspect.signature(amplitudes)).startswith(
        "(system: 'System', parameter: str, to: tuple[float, float], *, coordinate: str = '', count: int = 5, workers"
    )
    found = amplitudes(study().system, "frequency", (0.5, 1.5), count=6, workers=1, output=tmp_path / "a")
    assert found == gw.open_result(tmp_path / "a") == gw.run(study()).finding.record
    with pytest.raises(TypeError, match="has no keyword 'counts'; did you mean count"):
        amplitudes(study().system, "frequency", (0.5, 1.5), counts=6)
    with pytest.raises(ModelError, match="count is 1; it must be an integer >= 2"):
        amplitudes(study().system, "frequency", (0.5, 1.5), count=1)
    assert "count\n    Number of values." in amplitudes.__doc__


@pytest.mark.slow
def test_ctrl_c_stops_two_processes_and_they_go_on_bit_for_bit(tmp_path) -> None:
    path, paces = tmp_path / "parts", []
    asked = check_study(parse_source(MODEL.replace("workers = 1", "workers = 2")))

    def stop(part, pace) -> None:
        if pace.done == 2:
            raise KeyboardInterrupt

    stopped = until_ctrl_c(gw.run, asked, path, report=stop)
    assert not stopped.complete
    assert stopped.finding.stored == "2 of 6 amplitudes are stored"
    assert not gw.open_result(path).complete
    resumed = gw.run(asked, path, resume=True, report=lambda _, pace: paces.append((pace.done, pace.before)))
    assert paces == [(3, 2), (4, 2), (5, 2), (6, 2)]
    assert resumed.finding.record == gw.run(study()).finding.record == gw.open_result(path).finding.record


@pytest.mark.slow
def test_a_run_that_is_killed_goes_on_to_the_same_result(tmp_path) -> None:
    path = tmp_path / "killed.gapwalk"
    code = f"from tests.toys.amplitudes import main; main({str(path)!r})"
    assert "complete" not in killed_after(2, code)
    assert len(gw.open_result(path).finding.record.found) >= 2
    assert gw.run(study(), path, resume=True).complete
    assert gw.open_result(path).finding == gw.run(study()).finding


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("count = 6", "count = 1", "study.count is 1; it must be >= 2"),
        ("count = 6", "counts = 6", "study.counts is not a key here; did you mean count?"),
        ("count = 6", "count = 6.0", "study.count is 6.0; it must be an integer"),
        ("workers = 1", "workers = 0", "study.workers is 0; it must be >= 1"),
        ("count = 6", 'coordinate = "y"', 'study.coordinate is "y"; they are x'),
        ("to = 1.5\n", "", "study.to is missing"),
        ('"frequency"', '"frequenzy"', "did you mean 'frequency'?"),
        ('"amplitudes"', '"amplitude"', "did you mean amplitudes?"),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_what_to_write(old, new, message) -> None:
    assert old in MODEL
    with pytest.raises(ModelError) as caught:
        check_study(parse_source(MODEL.replace(old, new)))
    assert message in str(caught.value)


def test_the_command_line_runs_shows_and_exports_it(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(MODEL)
    assert main(["run", "m.toml"]) == 0
    assert f"0.5: {exact(0.5):.6g}" in capsys.readouterr().out
    assert (tmp_path / "m.png").stat().st_size > 1000
    rows = (tmp_path / "m-amplitudes.csv").read_text().splitlines()
    assert rows[0] == "frequency,x"
    assert len(rows) == 7
    assert main(["show", "m.gapwalk", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["kind"] == "amplitudes"
    assert len(document["amplitudes"]) == 6
    assert main(["export", "m.gapwalk", "--output", "other.csv"]) == 0
    assert (tmp_path / "other.csv").read_text().splitlines() == rows
    assert main(["export", "m.gapwalk", "--output", "other.svg"]) == 0
    with pytest.raises(StoreError, match="count is 4, and was 6"):
        gw.run(gw.read_study("m.toml", {"study.count": 4}), "m.gapwalk", resume=True)


def test_the_page_lists_it_and_saves_its_table(tmp_path) -> None:
    path = tmp_path / "x.gapwalk"
    entry = Entry("x", "amplitudes", path, result=gw.run(study(), path))
    assert entry.lines() == []
    assert "table" in entry.saves
