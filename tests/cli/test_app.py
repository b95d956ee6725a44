"""The commands that compute nothing, help, errors in words, and exit codes."""

import itertools
import json
import subprocess
import sys
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import file_commands, main
from gapwalk.cli.commands import app
from tests.studies.studies import stop_study

STUDY = 'frequency = 2.0\nstudy = { kind = "response", parameter = "frequency", to = 0.5 }\n'
ROOT = Path(__file__).resolve().parents[2]
LATE = ("scipy.integrate", "scipy.optimize", "scipy.interpolate", "scipy.stats", "scipy.signal", "matplotlib", "numba")
HEAVY = ("llvmlite", "numba", "numpy", "scipy", "matplotlib", "pydantic", "pandas")


@pytest.fixture
def result(tmp_path, monkeypatch) -> str:
    monkeypatch.chdir(tmp_path)
    gw.run(stop_study(), "stop.gapwalk")
    return "stop.gapwalk"


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["--version"], [], ["frobnicate"]])
def test_help_loads_nothing_heavy(words) -> None:
    program = (
        f"import sys; from gapwalk.cli import main; main({words!r}); "
        f"loaded = [name for name in {HEAVY!r} if name in sys.modules]; sys.exit(f'loaded {{loaded}}' if loaded else 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_importing_the_package_loads_nothing_heavy() -> None:
    program = f"import sys, gapwalk; sys.exit(any(name in sys.modules for name in {HEAVY!r}))"
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.slow
def test_the_first_point_of_a_run_needs_little() -> None:
    """Loading modules is most of what a user waits for."""
    program = (
        "import sys, gapwalk, gapwalk.cli.run_command; "
        "study = gapwalk.read_study('examples/clutch.toml'); "
        f"say = lambda *_: sys.exit(str([name for name in {LATE!r} if name in sys.modules])); "
        "gapwalk.run(study, report=say)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.stderr.strip() == "[]"


def test_the_public_names_are_there() -> None:
    for name in gw.__all__:
        assert getattr(gw, name) is not None
        assert name in dir(gw)
    assert gw.paper.case("13").size == 2
    with pytest.raises(AttributeError, match="no attribute 'stroll'"):
        gw.stroll  # noqa: B018


def test_help_names_every_command(capsys) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for name in ("new", "check", "modes", "run", "show", "export", "compare", "measure"):
        assert name in text


def test_the_version(capsys) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == gw.__version__


def test_a_new_model_can_be_checked(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "model.toml"]) == 0
    assert "gapwalk run model.toml" in capsys.readouterr().out
    assert main(["check", "model.toml"]) == 0
    assert "response over frequency from 2 to 0.15" in capsys.readouterr().out
    assert main(["new", "model.toml"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_check_says_what_is_wrong_in_words_and_in_json(model, capsys) -> None:
    assert main(["check", str(model), "--set", "stop.clearance=-1", "--set", "study.to=soon"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "stop.clearance is -1" in captured.err
    assert "study.to" in captured.err
    assert main(["check", str(model), "--set", "clearance=1", "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert "did you mean 'stop.clearance'" in error["problems"][0]["message"]
    assert main(["check", str(model), "--set", "stop.clearance=0.5", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] is True
    assert document["system"]["parameters"]["stop.clearance"] == 0.5


@pytest.mark.parametrize(("damping", "words"), [("-0.1", "damping is negative"), ("0.0", "damping is zero")])
def test_check_warns_of_damping_that_takes_no_energy_out(damping, words, tmp_path, capsys) -> None:
    file = tmp_path / "model.toml"
    file.write_text(f'coordinates = ["x"]\nstiffness = [[1.0]]\ndamping = [[{damping}]]\n{STUDY}')
    assert main(["check", str(file)]) == 0
    assert f"warning: {words}" in capsys.readouterr().out
    assert main(["check", str(file), "--json"]) == 0
    assert words in json.loads(capsys.readouterr().out)["warnings"][0]


def test_a_table_of_the_other_method_is_said_not_to_be_used(model, capsys) -> None:
    words = ["--set", "study.method=harmonic-balance", "--set", "study.shooting.segments=4"]
    told = "not used: [study.shooting], because method is harmonic-balance"
    assert main(["check", str(model), *words]) == 0
    assert told in capsys.readouterr().out
    assert main(["check", str(model), *words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["unused"] == ["study.shooting"]
    assert main(["run", str(model), *words]) == 0
    assert told in capsys.readouterr().out
    assert main(["check", str(model), *words[2:]]) == 0
    assert "not used" not in capsys.readouterr().out


def test_a_bug_is_1_and_says_so(result, monkeypatch, capsys) -> None:
    def fail(*_: object, **__: object) -> int:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(file_commands, "show_result", fail)
    assert main(["show", result]) == 1
    text = capsys.readouterr().err
    assert "this is a bug in gapwalk, please report it: ZeroDivisionError: by nothing" in text
    assert "Traceback" not in text
    assert main(["show", result, "--debug"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_show_tells_what_a_result_is(result, capsys) -> None:
    assert main(["show", result]) == 0
    text = capsys.readouterr().out
    for words in ("A stop", "complete", "llvmlite", "2 fold, 2 grazing", "the end of the range was reached", "stop +"):
        assert words in text
    assert main(["show", result, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [special["kind"] for special in document["special_points"]] == ["grazing", "fold", "fold", "grazing"]


@pytest.mark.slow
def test_export_writes_tables_and_pictures(result, tmp_path, capsys) -> None:
    assert main(["export", result]) == 0
    assert (tmp_path / "stop-points.csv").stat().st_size > 1000
    assert (tmp_path / "stop-special-points.csv").is_file()
    assert main(["export", result, "--output", "high.svg", "--measure", "max.x"]) == 0
    assert b"maximum" in (tmp_path / "high.svg").read_bytes()
    assert main(["export", result, "--format", "png"]) == 0
    assert main(["export", result, "--output", "two.json", "--output", "two.pdf", "--size", "column"]) == 0
    assert [Path(name).stat().st_size > 1000 for name in ("two.json", "two.pdf")] == [True, True]
    assert (tmp_path / "stop.png").is_file()
    capsys.readouterr()
    for words in (["--output", "x.gif"], ["--measure", "max.x"], ["--output", result], ["--output", "nowhere/x.png"]):
        assert main(["export", result, *words]) == 2
        assert capsys.readouterr().err.startswith("gapwalk: ")


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_is_no_error(result, command) -> None:
    program = command("show", result)
    program.stdout.close()
    assert program.stderr.read() == ""
    program.stderr.close()
    assert program.wait() == 0


def test_texts_of_a_file_cannot_command_the_terminal(tmp_path, capsys) -> None:
    study = stop_study(end=0.72)
    path = tmp_path / "evil.gapwalk"
    gw.run(gw.Study(study.system, study.options, "\x1b[2J[bold]title[/bold]"), path)
    assert main(["show", str(path)]) == 0
    text = capsys.readouterr().out
    assert "\x1b" not in text
    assert "[bold]title[/bold]" in text


def test_each_command_explains_each_option(capsys) -> None:
    for name in ("new", "check", "modes", "run", "show", "export", "compare", "measure"):
        assert main([name, "--help"]) == 0
        assert "--debug" in capsys.readouterr().out


def test_a_word_that_is_too_much_is_answered_with_the_option(capsys) -> None:
    assert main(["export", "stop.gapwalk", "html"]) == 2
    assert capsys.readouterr().err == "gapwalk: gapwalk export takes 'html' as an option; write --format html\n"
    assert main(["show", "stop.gapwalk", "more"]) == 2
    assert "does not take 'more' there" in capsys.readouterr().err


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_commands_and_options(shell, capsys) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(word in script for word in ("export", "resume", "full-scale"))


def test_the_manual_page_has_each_command_and_option(capsys) -> None:
    assert main(["manual"]) == 0
    page = capsys.readouterr().out
    for name in (each for each in app if not each.startswith("-")):
        assert f".SS gapwalk {name}\n" in page
        options = [each for each in app[name].assemble_argument_collection() if each.show]
        assert all(each.names[-1].replace("-", r"\-") in page for each in options if each.names)
    assert "\nThe model file; a study in it is ignored.\n" in page  # what the help says of a parameter
    assert not [line for line in page.splitlines() if line.startswith("'")]


def test_every_command_on_files_is_silent_if_asked(result, capsys) -> None:
    for words in (["show", result], ["verify", result], ["export", result, "-o", "a.svg"], ["new", "own.toml"]):
        assert main([*words, "--quiet"]) == 0
        assert capsys.readouterr() == ("", "")
    assert main(["show", "none.gapwalk", "-q"]) == 2
    assert "none.gapwalk" in capsys.readouterr().err
    assert main(["show", result]) == 0  # the next command speaks again
    assert "stop" in capsys.readouterr().out


def test_help_is_broken_by_the_terminal_alone_and_examples_fit_80_columns() -> None:
    for name in ("new", "run", "export", "compare", "measure", "completion", "manual"):
        command = app[name]
        paragraphs = (command.default_command.__doc__ or "").split("\n")
        assert not [
            (one, other)
            for one, other in itertools.pairwise(paragraphs)
            if one.strip("- ")
            and other.strip("- ")
            and len(one) - len(one.lstrip()) == len(other) - len(other.lstrip())
        ], name
        examples = (command.help_epilogue or "").partition("\n\nExit codes")[0].splitlines()
        assert max(map(len, examples)) <= 80, name
