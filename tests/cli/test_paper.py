"""``gapwalk paper``: figures as pictures and as JSON, and those that are not drawn."""

import json
from pathlib import Path

import pytest

from gapwalk.cli import main
from gapwalk.paper import frequency_responses


@pytest.fixture(autouse=True)
def in_its_own_folder(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_one_figure_is_one_document(capsys) -> None:
    assert main(["paper", "13", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["figure"] == "13"
    assert document["reading"] == {"slope": "reduced", "damping": "dissipative"}
    (branch,) = document["branches"]
    assert (branch["period"], branch["parameter"]) == (1, "frequency")
    values = [point["parameter"] for point in branch["points"]]
    assert max(values) == pytest.approx(2.0, abs=1e-14)
    assert min(values) == pytest.approx(0.15, abs=1e-14)
    assert set(branch["points"][0]["measures"]) == {
        f"{kind}.{q}" for q in ("q1", "q3") for kind in ("half", "max", "min")
    }
    assert {point["instability"] for point in branch["points"]} == {"stable", "below", "above", "pair"}
    (first_fold, *_) = [special for special in document["special_points"] if special["kind"] == "fold"]
    assert first_fold["parameter"] == pytest.approx(0.6190975482292904, abs=1e-9)
    assert first_fold["measures"]["half.q1"] == pytest.approx(2.514241198075232, abs=1e-8)
    assert (first_fold["branch"], first_fold["period"]) == (branch["id"], 1)
    assert not list(Path().iterdir())


def test_several_figures_are_a_list(capsys) -> None:
    assert main(["paper", "12", "fig. 20(A)", "--json", "--slope", "literal", "--damping", "as-printed"]) == 0
    documents = json.loads(capsys.readouterr().out)
    assert [document["figure"] for document in documents] == ["12", "20a"]
    assert documents[0]["reading"] == {"slope": "literal", "damping": "as-printed"}


def test_a_number_stands_for_all_its_parts(capsys) -> None:
    assert main(["paper", "10", "--json"]) == 0
    assert [document["figure"] for document in json.loads(capsys.readouterr().out)] == ["10a", "10b"]


def test_pictures_go_into_a_folder(capsys) -> None:
    assert main(["paper", "12"]) == 0
    text = capsys.readouterr().out
    assert "figure 12 (slope reduced, damping dissipative)" in text
    assert "4 fold" in text
    assert {path.suffix for path in Path("paper").iterdir()} == {".gapwalk", ".png", ".svg", ".csv"}
    assert main(["paper", "12", "--slope", "literal", "--output", "a/b"]) == 0
    assert Path("a/b/figure-12-literal.png").is_file()


@pytest.mark.parametrize("name", ["3", "5", "6", "7", "8", "17", "18", "19", "27", "28", "29"])
def test_other_figures_get_one_clear_line(name, capsys) -> None:
    assert main(["paper", name]) == 2
    captured = capsys.readouterr()
    assert captured.err == f"gapwalk: figure {name} is no frequency response over W, and is not drawn yet\n"
    assert captured.out == ""


def test_a_figure_that_is_not_drawn_does_not_keep_others_back(capsys) -> None:
    assert main(["paper", "17", "12", "--json"]) == 2
    first, second = json.loads(capsys.readouterr().out)
    assert "error" in first
    assert second["figure"] == "12"


def test_the_list(capsys) -> None:
    assert main(["paper", "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [each["figure"] for each in listed if each["frequency_response"]] == list(frequency_responses())
    assert main(["paper", "--list"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(listed)
