"""Records describe themselves: their words, their tables and their plain values need no code of their own."""

import json
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

import gapwalk as gw
from gapwalk.notebook import Shown
from gapwalk.studies.export import table_of
from gapwalk.summary import SummaryText, rows_of
from tests.computed import paper_response
from tests.systems import clutch


@dataclass(frozen=True)
class Mark:
    _row: ClassVar = "name place size=name.__len__.__name__"

    name: str
    place: complex


@dataclass(frozen=True, eq=False)
class Ramp(Shown):
    title: str
    time: NDArray[np.float64]
    height: NDArray[np.float64]
    far_marks: tuple[Mark, ...]
    steps: NDArray[np.int64]


MARKS = (Mark("a", 1 + 2j), Mark("", complex("nan")))
RAMP = Ramp("up", np.array([0.0, 1.0]), np.array([2.0, np.inf]), MARKS, np.array([7]))


def test_a_summary_in_a_notebook_is_one_text(monkeypatch) -> None:
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    assert str(SummaryText(("one", "two"))) == "one\ntwo"


def test_tables_follow_the_fields() -> None:
    tables = RAMP.tables()
    assert list(tables) == ["far-marks", "time", "steps"]
    assert list(tables["steps"]()) == list(tables["steps"]()) == [["steps"], [7]]  # a table can be read again
    assert table_of(RAMP, "time") == "time,height\n0.0,2.0\n1.0,inf\n"
    assert table_of(RAMP, "far-marks") == "name,re.place,im.place,size\na,1.0,2.0,__len__\n,,,__len__\n"
    assert list(rows_of([], ["a", "b"])) == [["a", "b"]]


def test_plain_values_follow_the_fields() -> None:
    marks = [{"name": "a", "place": [1.0, 2.0]}, {"name": "", "place": None}]
    plain = {"title": "up", "time": [0.0, 1.0], "height": [2.0, None], "far_marks": marks, "steps": [7]}
    assert RAMP.to_dict() == plain


def test_records_of_gapwalk_can_be_saved(tmp_path) -> None:
    orbit = gw.find_orbit(clutch().at({"frequency": 1.0}))
    assert json.loads(json.dumps(orbit.to_dict(), allow_nan=False))["period"] == 1
    modes = gw.find_modes(clutch())
    assert [path.name for path in gw.save_tables(modes, tmp_path / "clutch")] == ["clutch-frequencies.csv"]
    assert list(modes.summary()) == [repr(modes)]


def test_a_summary_is_printed_as_the_terminal_shows_it() -> None:
    system = gw.paper.case("13")
    assert str(system.summary()) == "\n".join(system.summary())
    lines = str(gw.find_modes(system).summary()).splitlines()
    assert lines == list(gw.find_modes(system).summary())
    branch = paper_response("9b")
    text = str(branch.summary())
    assert "kind" in text.splitlines()[3]
    assert len(text.splitlines()) > 4 + len(branch.special_points)
    assert text == repr(branch.summary())


def test_a_branch_has_measures_states_and_multipliers_in_its_tables() -> None:
    system = gw.System(["x"], [[1.0]], [[0.1]], harmonics=[gw.Harmonic(0.5, {"x": 1.0})], frequency=0.5)
    branch = gw.follow(gw.find_orbit(system), "frequency", 0.6)
    headings, first, *_ = branch.tables()["points"]()
    assert {"parameter", "stable", "max.x", "half.x", "x(0)", "x'(0)", "modulus.multiplier1"} <= set(headings)
    row = dict(zip(headings, first, strict=True))
    assert row["half.x"] == branch.measure("half.x")[0]
    assert [row["x(0)"], row["x'(0)"]] == branch.points[0].orbit.state.tolist()
