"""``gapwalk compare``: result files and model files side by side, exit codes, JSON, and the picture."""

import json
import shutil
from pathlib import Path

import matplotlib.image
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.studies.set_values import parse_changes
from tests.cli.conftest import MODEL
from tests.tiers import keeps

BALANCED = ("--set", "study.method=harmonic-balance", "--set", "study.balance.error=1e-3")


@pytest.fixture(scope="module")
def computed(tmp_path_factory) -> Path:
    """The folder of the same response by both methods."""
    folder = tmp_path_factory.mktemp("computed")
    (folder / "stop.toml").write_text(MODEL)
    for name, changes in (("a", ()), ("b", BALANCED)):
        gw.run(gw.read_study(folder / "stop.toml", parse_changes(changes[1::2])), folder / f"{name}.gapwalk")
    return folder


@pytest.fixture
def results(model, computed) -> tuple[str, str]:
    """Both results, in the folder in which the test runs."""
    for name in ("a.gapwalk", "b.gapwalk"):
        shutil.copy(computed / name, name)
    return "a.gapwalk", "b.gapwalk"


def test_two_methods_agree(results, capsys) -> None:
    assert main(["compare", *results]) == 0
    out = capsys.readouterr().out
    for words in (
        "first: a.gapwalk, A stop (by shooting)",
        "second: b.gapwalk, A stop (by harmonic-balance)",
        "compared: curves over Ω in the space of mean.x, rms.x; lengths are relative to the ranges (Ω: 1.2)",
        "grazing stop +",
        "they agree within 0.001",
    ):
        assert words in out
    assert out.count("fold") == 2


def test_a_smaller_tolerance_ends_with_another_code(results, capsys) -> None:
    assert main(["compare", *results, "--tolerance", "1e-9"]) == 4
    out = capsys.readouterr().out
    assert "they differ by more than 1e-09" in out
    assert "use smaller steps" in out
    assert main(["compare", results[0], results[0], "--tolerance", "1e-4"]) == 0
    assert "use smaller steps" not in capsys.readouterr().out


def test_json_is_one_document(results, capsys) -> None:
    assert main(["compare", *results, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["agree"] is True
    assert document["files"] == ["a.gapwalk", "b.gapwalk"]
    assert document["methods"] == ["shooting", "harmonic-balance"]
    assert len(document["pairs"][0]["special_points"]) == 4


@keeps("png")
@pytest.mark.parametrize("ending", ["png", "svg"])
def test_both_are_drawn_over_one_another(results, ending, capsys) -> None:
    assert main(["compare", *results, "--output", f"both.{ending}", "--measure", "max.x"]) == 0
    assert f"written: both.{ending}" in capsys.readouterr().out
    if ending == "png":
        assert matplotlib.image.imread("both.png").shape[:2] == (1280, 1600)
    else:
        text = Path("both.svg").read_text()
        assert "<svg" in text


@pytest.mark.slow
def test_model_files_are_run(model, results, capsys) -> None:
    text = model.read_text()
    study = text[text.index("[study]") :].replace("[study]", "")
    two = text[: text.index("[study]")] + "".join(f'[[study]]\nname = "{name}"{study}' for name in ("one", "two"))
    Path("two.toml").write_text(two.replace("to = 1.9", "to = 1.7", 1))
    assert main(["compare", results[0], str(model)]) == 0
    assert main(["compare", results[0], "two.toml:two"]) == 0
    capsys.readouterr()
    assert main(["compare", "two.toml:one", "two.toml:two"]) == 4
    assert "the first covers Ω from 0.7 to 1.7, the second from 0.7 to 1.9: 0.17 is missing" in capsys.readouterr().out
    assert main(["compare", results[0], "two.toml"]) == 2
    assert "has 2 studies, so give the name of one: one, two" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["a.gapwalk", "none.gapwalk"], "there is no file none.gapwalk"),
        (["a.gapwalk", "none.toml"], "none.toml"),
        (["a.gapwalk", "b.gapwalk", "--tolerance", "0"], "tolerance is 0; it must be > 0"),
        (["a.gapwalk", "b.gapwalk", "--output", "a.pdf"], "a.pdf is not a name for a picture; give it the ending .png"),
        (["a.gapwalk", "b.gapwalk", "--output", "a.png", "--measure", "half.y"], "there is no signal 'y'"),
    ],
)
def test_bad_input_is_told(results, words, message, capsys) -> None:
    assert main(["compare", *words]) == 2
    assert message in capsys.readouterr().err


def test_what_one_has_alone_is_drawn_and_listed(model, results, capsys) -> None:
    few = ("--set", "study.balance.harmonics=3", "--set", "study.balance.error=1.0", "--set", "stop.stiffness=200.0")
    assert main(["run", str(model), "--quiet", "--output", "c.gapwalk", *BALANCED[:2], *few]) == 0
    assert main(["compare", results[0], "c.gapwalk", "--output", "both.png"]) == 4
    out = capsys.readouterr().out
    assert "note: stop.stiffness is 20 in the first and 200 in the second" in out
    assert "only in the" in out


def test_too_few_harmonics_keep_what_there_is_and_say_what_to_change(model, capsys) -> None:
    changes = ("--set", "study.method=harmonic-balance", "--set", "study.balance.harmonics=4")
    assert main(["run", str(model), *changes]) == 3
    captured = capsys.readouterr()
    assert "the harmonics beyond H = 4 amount to" in captured.err
    assert "take harmonics = 8 or more, or leave harmonics out for as many as it takes" in captured.err
    assert "by harmonic balance with 4 harmonics" in captured.out
    assert {path.suffix for path in Path().iterdir()} == {".toml", ".gapwalk", ".png", ".svg", ".csv"}
    assert main(["show", "stop.gapwalk"]) == 0
    assert "needs more segments" in capsys.readouterr().out
    assert main(["run", str(model), "--resume", *changes]) == 3  # nothing is left to do with these options
    assert main(["run", str(model), "--resume", *changes[:2], "--set", "study.balance.harmonics=8"]) == 2
    assert "method.harmonics is 8, and was 4" in capsys.readouterr().err
