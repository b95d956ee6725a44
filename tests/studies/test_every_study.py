"""Every kind of study goes through the same: file, run, result file, Ctrl-C and resume, tables, picture."""

import json
import signal
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import Interrupted, StoreError
from gapwalk.flow import Flow
from gapwalk.model.model_source import parse_source
from gapwalk.studies import runner
from gapwalk.studies.regime_study import Carry
from gapwalk.studies.study_file import check_study
from gapwalk.studies.study_kind import StudyKind, kinds
from tests import models
from tests.interruption import until_ctrl_c
from tests.results.again import again
from tests.studies import families, jobs
from tests.studies.same import assert_same_result
from tests.studies.test_locus_study import STUDY, SYSTEM
from tests.tiers import in_campaign
from tests.toys import amplitudes

TREE = models.CLUTCH + '[study]\nparameter = "frequency"\nmeasure = "half.q1"\nworkers = 1\n'
TEXTS = {
    "response": models.STOP + models.response(1.9),
    "diagram": TREE + 'kind = "diagram"\nfrom = 0.85\nto = 0.6\nmax_period = 4\n',
    "map": TREE + 'kind = "map"\nfrom = 1.4\nto = 1.1\nsections = 2\nmax_period = 1\n'
    'second = { parameter = "mean.q1", from = 0.2, to = 0.3 }\n',
    "locus": SYSTEM + STUDY.replace("2.0\nto = 0.6", "1.5\nto = 1.0").replace("0.09, to = 0.6", "0.25, to = 0.35"),
    "family": families.MODEL,
    **jobs.MODELS,
    "amplitudes": amplitudes.MODEL,
}
"""A model file for each kind of study."""


@pytest.fixture
def small_parts(monkeypatch) -> None:
    """Chunks of so few cells that each job has some."""
    for module, name, value in jobs.SMALL:
        monkeypatch.setattr(module, name, value)


def kept_arrays(*names: str) -> Callable[[Any], list[bytes]]:
    return lambda record: [getattr(record, name).tobytes() for name in names]


PLANE, CLUTCH = {"q1": (-4.0, 4.0), "q1'": (-3.0, 3.0)}, gw.paper.case("15").at(frequency=0.45)
FUNCTIONS: dict[str, tuple[Callable[[], Any], Callable[[Any], Any]]] = {
    "settle": (lambda: gw.settle(CLUTCH), lambda record: record.orbit.state.tolist()),
    "sweep": (
        lambda: gw.sweep(CLUTCH, "frequency", (0.5, 0.6), steps=45, points=13, workers=1),
        kept_arrays("sections", "transients", "settled", "regimes"),
    ),
    "basins": (
        lambda: gw.basins(
            CLUTCH,
            PLANE,
            (100, 90),
            fixed={"q3": 0.5},
            exact_borders=False,
            check=8,
            workers=1,
        ),
        kept_arrays("labels"),
    ),
    "regimes": (
        lambda: gw.regimes(
            CLUTCH,
            {"frequency": (0.5, 0.7), "harmonic1.amplitude": (0.4, 0.5)},
            (4, 9),
            carry=Carry.UP,
            longest=400,
            check=2,
            workers=1,
        ),
        kept_arrays("regimes", "periods", "exponents", "peak_force", "impacts", "states"),
    ),
}
"""The function of the same name with the same numbers, written out once more; and what of its record is compared."""


def test_there_is_a_file_of_each_kind() -> None:
    assert set(TEXTS) == set(kinds())


def pressed_at(number: int) -> Callable[..., None]:
    """A report that presses Ctrl-C when it is called for that time."""
    calls = count(1)
    return lambda *_: signal.raise_signal(signal.SIGINT) if next(calls) == number else None


CASES = [*TEXTS.items(), in_campaign("scan", jobs.SCAN)]


@pytest.mark.parametrize(("kind", "text"), CASES, ids=[*TEXTS, "whole scan"])
@pytest.mark.usefixtures("small_parts")
def test_every_study(kind, text, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    study, path = check_study(parse_source(text)), Path("x.gapwalk")
    assert (study.options.kind, again(study.options, StudyKind)) == (kind, study.options)

    function, said = FUNCTIONS.get(kind, (lambda: gw.run(study), None))
    expected = function()

    if kind not in ("settle", "campbell"):  # which have one part
        stopped = until_ctrl_c(gw.run, study, path, report=pressed_at(1))
        assert not stopped.complete
        assert_same_result(stopped, gw.open_result(path))
        assert [each.name for each in tmp_path.iterdir()] == [path.name]
        with pytest.raises(StoreError, match="exists already"):
            gw.run(study, path)
        with suppress(Interrupted, KeyboardInterrupt):  # a study of fewer parts is complete before
            gw.run(study, path, resume=True, report=pressed_at(3))
    result = gw.run(study, path, resume=True)
    assert result.complete
    assert result.failures == ()
    if said is None:
        assert_same_result(result, expected)
    else:
        assert result.finding is not None
        assert said(result.finding.record) == said(expected)

    loaded, content, calls = gw.open_result(path), path.read_bytes(), Flow.calls
    assert loaded.study == study
    assert_same_result(loaded, result)
    assert_same_result(gw.run(study, path, resume=True), result)
    assert (Flow.calls, path.read_bytes()) == (calls, content)

    assert main(["show", "x.gapwalk"]) == 0
    assert "x.gapwalk: complete" in capsys.readouterr().out
    assert main(["show", "x.gapwalk", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["kind"], document["complete"]) == (kind, True)
    assert main(["export", "x.gapwalk", "--output", "x.csv"]) == 0
    header, *rows = Path("x.csv").read_text(encoding="utf-8").splitlines()
    assert "," in header
    assert rows
    assert main(["export", "x.gapwalk", "--output", "x.png"]) == 0
    assert Path("x.png").stat().st_size > 1000


def test_ctrl_c_while_what_is_stored_is_read_gives_no_part_of_a_curve(tmp_path, monkeypatch) -> None:
    study, path = check_study(parse_source(TEXTS["run-up"])), tmp_path / "x.gapwalk"
    gw.run(study, path)

    def follow(*_: object) -> None:
        raise Interrupted("points of a curve")

    monkeypatch.setattr(runner, "_take", follow)
    with pytest.raises(KeyboardInterrupt) as stopped:
        gw.run(study, path, resume=True)
    assert not isinstance(stopped.value, Interrupted)
