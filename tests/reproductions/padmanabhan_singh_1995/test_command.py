"""The command: figures as pictures and as JSON, and the page of all of them."""

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995 import __main__ as command
from reproductions.padmanabhan_singh_1995.__main__ import main
from reproductions.padmanabhan_singh_1995.claims import CLAIMS
from reproductions.padmanabhan_singh_1995.figures import FIGURES


@pytest.fixture(autouse=True)
def in_its_own_folder(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def few(monkeypatch) -> None:
    """A paper of three figures, one of which rests on no job, and of a claim about them; nothing of today."""
    kept = tuple(figure for figure in FIGURES if figure.name in ("1", "12", "17"))
    monkeypatch.setattr(command, "FIGURES", kept)
    monkeypatch.setattr(command, "TODAY", ())
    monkeypatch.setattr(command, "CLAIMS", tuple(claim for claim in CLAIMS if claim.name == "12-folds"))


def test_one_motion_is_one_document(capsys, monkeypatch) -> None:
    monkeypatch.setattr(command, "claims_about", lambda number: ())
    assert main(["17", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["figure"], document["claims"]) == ("17", [])
    assert document["results"]["17-start-k11-0"]["attractor"]["label"] == "P3"
    assert document["results"]["17"]["attractor"]["label"] == "P1"
    assert [panel["at"] for panel in document["panels"]] == ["K11 = 0"] * 3 + [None]
    assert not list(Path().iterdir())


@pytest.mark.slow
def test_one_figure_is_one_document(capsys) -> None:
    assert main(["13", "--json", "--slope", "reduced"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["figure"] == "13"
    assert document["kind"] == "frequency response"
    assert document["reading"] == {"slope": "reduced", "damping": "dissipative"}
    assert [panel["letter"] for panel in document["panels"]] == ["a", "b", None]
    assert document["panels"][1]["jobs"] == ["13"]
    assert document["panels"][0]["paper"] == [{"says": "paper: flips 0.62 to 0.85", "from": 0.62, "to": 0.85}]
    result = document["results"]["13"]
    branch = result["branches"][0]
    assert (branch["name"], branch["period"], branch["parameter"]) == ("P1-1", 1, "frequency")
    values = [point["parameter"] for point in branch["points"]]
    assert max(values) == pytest.approx(2.0, abs=1e-14)
    assert min(values) == pytest.approx(0.15, abs=1e-14)
    (first_fold, *_) = [special for special in result["special_points"] if special["kind"] == "fold"]
    assert first_fold["parameter"] == pytest.approx(0.6190975482292904, abs=1e-9)
    assert first_fold["measures"]["half.q1"] == pytest.approx(2.514241198075232, abs=1e-8)
    assert {claim["claim"]: claim["verdict"] for claim in document["claims"]}["13-loop"] == "reproduced"
    assert not list(Path().iterdir())


@pytest.mark.slow
def test_several_figures_are_a_list_in_one_reading(capsys) -> None:
    assert main(["12", "fig. 20(A)", "--json", "--slope", "literal", "--damping", "as-printed"]) == 0
    documents = json.loads(capsys.readouterr().out)
    assert [document["figure"] for document in documents] == ["12", "20a"]
    assert documents[0]["reading"] == {"slope": "literal", "damping": "as-printed"}
    assert set(documents[1]["results"]) == {"20a-literal-as-printed"}
    assert documents[0]["claims"] == []  # claims name their own readings


def test_pictures_go_into_a_folder_and_nothing_is_computed_twice(capsys, monkeypatch) -> None:
    assert main(["12", "--slope", "literal"]) == 0
    text = capsys.readouterr().out
    assert "Figure 12. A heavily loaded clutch" in text
    assert "1 of period 1" in text
    assert "note on the set of figure 12: The scan prints K11 = 0.0" in text
    names = {path.name for path in Path("out/paper").iterdir()}
    assert names == {"figure-12a-literal.png", "figure-12-2-literal.png", "figure-12-literal.html", "results"}
    results = {path.name for path in Path("out/paper/results").iterdir() if not path.name.endswith("-lock")}
    assert results == {"12-literal.gapwalk", "12-literal-points.csv", "12-literal-special-points.csv"}
    monkeypatch.setattr("gapwalk.studies.diagram_study.DiagramWork.parts", None)  # a second computation would fail
    picture = Path("out/paper/figure-12a-literal.png")
    drawn = picture.stat().st_mtime_ns
    assert main(["12", "--slope", "literal"]) == 0
    assert picture.stat().st_mtime_ns == drawn
    text = capsys.readouterr().out
    assert "written: out/paper/figure-12a-literal.png" in text
    assert "the page: out/paper/figure-12-literal.html" in text
    result = Path("out/paper/results/12-literal.gapwalk")
    os.utime(result, ns=(drawn + 1, drawn + 1))  # as if it had been computed again
    assert main(["12", "--slope", "literal"]) == 0
    assert picture.stat().st_mtime_ns > drawn


class Links(HTMLParser):
    """The links and pictures of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.ids: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs) -> None:
        for name, value in attrs:
            if name in ("href", "src"):
                self.targets.append(value)
            if name == "id":
                self.ids.append(value)


@pytest.mark.usefixtures("few")
def test_all_figures_make_a_page_that_opens_offline(capsys) -> None:
    assert main(["--output", "report"]) == 0
    captured = capsys.readouterr()
    assert "1 statements of the paper: 1 to the letter\n" in captured.out
    assert "all of it is on one page: report/index.html" in captured.out
    assert captured.err.splitlines()[0].endswith("studies; Ctrl-C stops, and the same command resumes")
    text = Path("report/index.html").read_text(encoding="utf-8")
    links = Links(text)
    assert {"figure-1", "figure-12", "figure-17", "12-folds"} <= set(links.ids)
    pictures = [target for target in links.targets if not target.startswith("#")]
    assert all(target[1:] in links.ids for target in links.targets if target not in pictures)
    assert all(target.startswith("data:image/png;base64,") for target in pictures)  # one file is enough
    panels = sum(len(figure.panels) for figure in command.FIGURES)
    assert len(pictures) == panels + len(command.FIGURES)  # a small one on each card that is closed
    assert not re.search(r"https?:|<script", text)
    assert "to the letter" in text


@pytest.mark.slow
@pytest.mark.usefixtures("few")
def test_all_as_json(capsys) -> None:
    assert main(["--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [figure["figure"] for figure in document["figures"]] == ["1", "12", "17"]
    assert document["figures"][0]["loops"]["viscous damping"]["loss"] == pytest.approx(0.5037, abs=1e-4)
    assert document["figures"][1]["loops"] == {}
    (claim,) = document["claims"]
    assert (claim["claim"], claim["verdict"]) == ("12-folds", "to the letter")
    assert claim["evidence"][0]["holds"] is True
    assert document["figures"][2]["results"]["17"]["attractor"]["label"] == "P1"


@pytest.mark.slow
@pytest.mark.usefixtures("few")
def test_the_documentation_gets_the_page_its_summary_and_the_counts(monkeypatch) -> None:
    monkeypatch.setattr(command, "_ROOT", Path())
    for name in ("docs/_static", "docs/explanation"):
        Path(name).mkdir(parents=True)
    Path("README.md").write_text("- Of 9 statements of the paper cited below, none;\n")
    Path("docs/explanation/validation.md").write_text("no count\n")
    assert main(["--docs"]) == 0
    assert Path("README.md").read_text() == "- Of 1 statements of the paper cited below, 1 hold to the letter;\n"
    page = Path("docs/_static/padmanabhan_singh_1995.html").read_text(encoding="utf-8")
    assert page == Path("out/paper/index.html").read_text(encoding="utf-8")
    assert "| to the letter | 1 |" in Path("docs/explanation/paper.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("more", [["13"], ["--slope", "literal"], ["--json"]])
def test_the_documentation_has_all_figures_at_the_printed_numbers(more, capsys) -> None:
    assert main(["--docs", *more]) == 2
    assert "write --docs without" in capsys.readouterr().err


@pytest.mark.slow
def test_what_cannot_be_computed_is_said_and_keeps_nothing_back(capsys, monkeypatch) -> None:
    run = gw.run

    def refuse(study, *args, **options):
        if "figure 12 " in study.title:
            raise gw.errors.ConvergenceError("no orbit was found")
        return run(study, *args, **options)

    monkeypatch.setattr(gw, "run", refuse)
    monkeypatch.setattr(command, "claims_about", lambda number: ())
    assert main(["12", "17"]) == 3
    assert "error: 12: no orbit was found\n" in capsys.readouterr().err
    assert Path("out/paper/figure-17a.png").is_file()
    assert not Path("out/paper/figure-12a.png").exists()


def test_ctrl_c_ends_it_with_a_sentence(capsys, monkeypatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "reproduce", interrupt)
    assert main(["1"]) == 130
    assert "resumes" in capsys.readouterr().err


def test_an_unknown_figure_is_refused_before_anything_is_computed(capsys) -> None:
    assert main(["12", "30"]) == 2
    assert "the paper has no figure '30'" in capsys.readouterr().err
    assert not list(Path().iterdir())


def test_a_folder_that_cannot_be_made(capsys) -> None:
    Path("file").write_text("")
    assert main(["1", "--output", "file", "--json"]) == 2
    captured = capsys.readouterr()
    assert json.loads(captured.out)["error"]["type"] == "StoreError"
    assert "the folder file/results cannot be made" in captured.err


def test_it_runs_as_a_module() -> None:
    root = Path(command.__file__).parents[2]
    command_line = [sys.executable, "-m", "reproductions.padmanabhan_singh_1995", "--list"]
    done = subprocess.run(command_line, cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0].startswith("1   force law")


def test_the_list(capsys) -> None:
    assert main(["--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [each["figure"] for each in listed] == [figure.name for figure in FIGURES]
    assert listed[0]["kind"] == "force law"
    assert main(["--list"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(listed)
