"""``gapwalk`` with studies without branches: run, show, export, JSON, stopped and resumed, and on a cluster."""

import csv
import json
import os
import re
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import gapwalk as gw
from gapwalk.attractors.settle import Attractor, AttractorKind, identify
from gapwalk.cli import main
from gapwalk.cli.progress import ProgressLine, progress_of
from gapwalk.parallel.workers import Pace
from tests.studies.jobs import MODELS
from tests.tiers import keeps

ENDINGS = {
    "settle": ("section", "lines", "sides", "contacts", "signals", "work", "losses"),
    "sweep": ("points", "regimes"),
    "basins": ("cells", "attractors"),
    "regimes": ("cells",),
}
TOLD = {
    "settle": ("P3: periodic motion", "from a stable orbit of period 3", "lines of stage2", "stage2 -1"),
    "sweep": ("Ω from 0.5 to 0.6: 45 values", "up, start 1: 1 bands", "0.5 to 0.6: period 1, 45 values"),
    "basins": ("q1, q1': 100 x 90 cells", "period 1", "period 3"),
    "regimes": ("Ω, harmonic1.amplitude: 4 x 9 cells", "period 1", "2 cells classified again"),
}
PLANS = {
    "settle": "study: settle from rest, showing stage2",
    "sweep": "study: sweep over frequency from 0.5 to 0.6 at 45 values, up and down, showing q3'",
    "basins": "study: basins over q1 from -4 to 4 and q1' from -3 to 3, 100 x 90 cells",
    "regimes": "study: regimes over frequency from 0.7 to 0.5 and harmonic1.amplitude from 0.4 to 0.5, 4 x 9 cells",
}


@pytest.fixture(params=ENDINGS)
def kind(request, tmp_path, monkeypatch) -> str:
    """The kind of the study in the file x.toml, in the folder in which the test then runs."""
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(MODELS[request.param])
    return request.param


@keeps("regimes")
def test_a_study_is_checked_run_shown_and_exported(kind, capsys) -> None:
    assert main(["check", "x.toml"]) == 0
    assert PLANS[kind] in capsys.readouterr().out
    assert main(["run", "x.toml", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["kind"], document["complete"], document["failures"]) == (kind, True, [])
    tables = [f"x-{name}.csv" for name in ENDINGS[kind]]
    assert document["files"] == ["x.gapwalk", "x.png", "x.svg", *tables]
    assert set(os.listdir()) == {"x.toml", *document["files"]}
    assert main(["show", "x.gapwalk"]) == 0
    text = capsys.readouterr().out
    for told in ("x.gapwalk: complete", *TOLD[kind]):
        assert told in text
    assert main(["show", "x.gapwalk", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert len(json.dumps(shown)) < len(json.dumps(document))  # without what there is point by point
    assert set(shown) <= set(document)
    before = {name: Path(name).read_bytes() for name in tables}
    assert main(["export", "x.gapwalk"]) == 0
    assert before == {name: Path(name).read_bytes() for name in tables}
    assert main(["export", "x.gapwalk", "--output", "mine.csv"]) == 0
    assert Path("mine.csv").read_bytes() == before[tables[0]]
    assert main(["export", "x.gapwalk", "--output", "mine.svg"]) == 0
    assert "Clutch" in Path("mine.svg").read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(["export", "x.gapwalk", "--output", "mine.svg", "--measure", "half.q1"]) == 2
    assert "shows no measure; leave it out" in capsys.readouterr().err
    rows = list(csv.DictReader(Path(tables[0]).read_text(encoding="utf-8").splitlines()))
    assert len(rows) == {"settle": 3, "sweep": 2 * 45 * 13, "basins": 9000, "regimes": 36}[kind]
    record = gw.open_result("x.gapwalk").finding.record
    if kind == "basins":
        last = rows[-1]
        assert (float(last["q1"]), float(last["q1'"])) == (record.axes[0][-1], record.axes[1][-1])
        assert last["leads.to"] == record.names[record.labels[-1, -1]]
    if kind == "regimes":
        values = [(row["regime"], float(row["peak.force.stage2"])) for row in rows]
        assert values[5] == (record.at(*(axis[1] for axis in record.axes)), record.peak_force[1, 1, 0])
    if kind == "sweep":
        assert float(rows[13]["q3'"]) == record.sections[0, 1, 0, 3]


def test_ctrl_c_says_what_is_stored_and_how_to_go_on(kind, monkeypatch, capsys) -> None:
    if kind == "settle":
        pytest.skip("has one part")
    with monkeypatch.context() as patch:
        if kind == "regimes":
            patch.setattr("gapwalk.studies.regime_study.ROWS", 3)

        def stop(*_: object) -> None:
            raise KeyboardInterrupt

        patch.setattr(ProgressLine, "__call__", stop)
        assert main(["run", "x.toml"]) == 130
        captured = capsys.readouterr()
        assert re.search(r"interrupted; \d+ of \d+ (values|chunks of cells) are stored", captured.err)
        assert "gapwalk run x.toml --output x.gapwalk --resume" in captured.err
        assert set(os.listdir()) == {"x.toml", "x.gapwalk"}
        assert main(["show", "x.gapwalk"]) == 0
        assert "not complete: `gapwalk run` with --resume continues it" in capsys.readouterr().out
        assert main(["show", "x.gapwalk", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["complete"] is False
        if kind == "basins":  # of the others there is a picture at any time
            assert main(["export", "x.gapwalk"]) == 2
            assert "x.gapwalk is not complete" in capsys.readouterr().err
        patch.undo()
        if kind == "regimes":
            patch.setattr("gapwalk.studies.regime_study.ROWS", 3)
        assert main(["run", "x.toml", "--resume", "--quiet"]) == 0
    assert Path("x.png").exists()


def test_motions_that_run_away_are_told_and_are_3(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["--set", "damping.q1.q1=-0.4", "--set", "damping.q3.q3=-0.4"]
    for kind in ("sweep", "settle"):
        Path(f"{kind}.toml").write_text(MODELS[kind])
    assert main(["run", "sweep.toml", *words]) == 3
    captured = capsys.readouterr()
    assert captured.err.count("the motion could not be followed and ends there") == 2
    assert "up, start 1: 1 band" in captured.out
    assert not Path("sweep.png").exists()  # there is no point to draw
    assert main(["run", "sweep.toml", *words, "--resume", "--quiet"]) == 3
    assert main(["export", "sweep.gapwalk", "--format", "png"]) == 2
    assert "there is nothing to draw: start 1, up: the motion could not be followed" in capsys.readouterr().err
    assert main(["show", "sweep.gapwalk"]) == 0
    assert capsys.readouterr().out.count("failed: start 1, ") == 2
    assert main(["run", "settle.toml", *words]) == 3
    assert "diverges" in capsys.readouterr().err
    assert not Path("settle.gapwalk").exists()


@pytest.mark.slow
def test_a_motion_that_cannot_be_told_is_3(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(MODELS["settle"])

    def doubt(settled, options) -> Attractor:
        return replace(identify(settled, options), kind=AttractorKind.UNDECIDED, evidence=("nobody knows",))

    monkeypatch.setattr("gapwalk.studies.settle_study.identify", doubt)
    assert main(["run", "x.toml"]) == 3
    captured = capsys.readouterr()
    assert "gapwalk: nobody knows" in captured.err
    assert "?: undecided motion" in captured.out
    assert gw.open_result("x.gapwalk").failures == ("nobody knows",)


def test_progress_tells_how_much_is_done(tmp_path, monkeypatch) -> None:
    path = tmp_path / "x.toml"
    path.write_text(MODELS["sweep"])
    study, shown = gw.read_study(path), []
    progress = progress_of(study.options, "mine", show=False)
    monkeypatch.setattr(progress, "update", lambda *words: shown.append(tuple(map(str, words))))
    gw.run(study, report=progress)
    assert shown[0] == ("mine", study.options.plan)
    assert [text.split("  ")[:2] for _, text in shown[1:]] == [
        [f"{done} of 6", f"{100 * done / 6:.0f} %"] for done in range(1, 7)
    ]


def test_progress_says_what_is_done_before_the_first_part(tmp_path, monkeypatch, capsys) -> None:
    """A scan whose first variation takes long says from the first second what it is about."""
    monkeypatch.setattr("gapwalk.cli.progress._FIRST", 0.0)
    (path := tmp_path / "x.toml").write_text(MODELS["scan"])
    study = gw.read_study(path)
    with progress_of(study.options, "mine"):
        time.sleep(0.2)
    assert f"mine  {study.options.plan}" in capsys.readouterr().err


def test_a_time_left_that_has_passed_is_not_told_any_more(monkeypatch) -> None:
    """If all workers have gone, "about 2 s left" would stand there for ever."""
    from gapwalk.cli import progress as module

    now = [100.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    reached = module._Reached(SimpleNamespace(complete=lambda share: None), "nine parts")
    reached.begin(Pace(done=0, total=9), float)
    assert str(reached) == "nine parts  0 %"
    reached.note(Pace(done=3, total=9, seconds=1.0))
    assert str(reached) == "3 of 9  33 %  about 2 s left"
    now[0] += 1.0
    assert str(reached) == "3 of 9  33 %  about 1 s left"
    now[0] += 1.5
    assert str(reached) == "3 of 9  33 %"


def test_a_walk_tells_its_share_and_the_time_left(monkeypatch) -> None:
    now = [0.0]
    monkeypatch.setattr("gapwalk.cli.progress.time", SimpleNamespace(monotonic=lambda: now[0]))
    line = progress_of(SimpleNamespace(reports="points", parameter="frequency", begin=2.0, end=1.0), show=False)
    line.begin(Pace(0, 1), float)
    now[0] = 3.0
    for value in (1.75, 1.9):
        _, reached = line._words(SimpleNamespace(value=value), [])
    assert str(reached) == "Ω = 1.9  0 special  25 %  about 9 s left"


@pytest.mark.slow
def test_a_cluster_does_the_work(tmp_path, monkeypatch, capsys) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra gapwalk[cluster]")
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(MODELS["sweep"])
    assert main(["run", "x.toml", "--quiet"]) == 0
    options = {"threads_per_worker": 1, "processes": True, "dashboard_address": ":0", "silence_logs": 50}
    with distributed.LocalCluster(n_workers=1, **options) as cluster:
        words = ["run", "x.toml", "--output", "y.gapwalk", "--quiet", "--scheduler", cluster.scheduler_address]
        assert main(words) == 0
        pids = set()
        with distributed.Client(cluster) as client:
            pids = {*client.run(os.getpid).values()}
            done = client.run(lambda dask_worker: dask_worker.state.executed_count)
        assert pids
        assert os.getpid() not in pids
        assert sum(done.values()) >= 6  # the stretches
    one, other = (gw.open_result(f"{name}.gapwalk").finding.record for name in "xy")
    assert one.sections.tobytes() == other.sections.tobytes()
    assert main(["run", "x.toml", "--output", "z.gapwalk", "--scheduler", "none.json"]) == 2
    assert "none.json" in capsys.readouterr().err
    assert not Path("z.gapwalk").exists()
