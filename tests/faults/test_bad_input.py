"""Whatever is wrong with what is given: an exit code of 2 or 3, and sentences with what was given and what to write."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from gapwalk.cli import main
from tests.faults.bad_input import cases, give, lay_out

CASES = cases()
CHECKED = [case for case in CASES if "model" in case]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The files that cases name; no case changes them."""
    folder = tmp_path_factory.mktemp("bad")
    lay_out(folder)
    return folder


@pytest.fixture
def there(folder, monkeypatch) -> Path:
    monkeypatch.chdir(folder)
    return folder


def test_there_are_enough() -> None:
    assert len(CASES) >= 150


@pytest.mark.parametrize(
    "case", CASES, ids=lambda case: str(case.get("words") or case.get("new") or case.get("old"))[:40]
)
@pytest.mark.usefixtures("there")
def test_what_is_wrong_is_told(case: dict[str, Any], capsys) -> None:
    code = give(case)
    captured = capsys.readouterr()
    assert code == case.get("code", 2)
    assert "Traceback" not in captured.err
    assert "bug" not in captured.err
    assert case["says"] in _plain(captured.err)
    if "--json" in case.get("words", ()):
        assert json.loads(captured.out)["error"]["message"]
    else:
        assert captured.out == ""


def test_nothing_was_changed(there) -> None:
    before = {path.name: path.read_bytes() for path in there.iterdir() if path.suffix == ".gapwalk"}
    for case in CASES:
        if case.get("words", [""])[0] in ("run", "export", "show"):
            give(case)
    assert {path.name: path.read_bytes() for path in there.iterdir() if path.suffix == ".gapwalk"} == before


@pytest.mark.usefixtures("there")
def test_one_document_with_json(capsys) -> None:
    """The same problems, each with its line."""
    for case in CHECKED[::10]:
        give(case)
        capsys.readouterr()
        assert main(["check", "model.toml", "--json"]) == 2
        error = json.loads(capsys.readouterr().out)["error"]
        assert case["says"].rpartition(": ")[2] in _plain(error["message"])


def _plain(text: str) -> str:
    """Words without the frame that a terminal gets, and without line ends."""
    return " ".join(re.sub(r"[│╭╮╰╯─]", " ", text).split())
