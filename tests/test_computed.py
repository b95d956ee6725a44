"""A value that several tests need is computed once in a run, and is the same in each of its processes."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests import computed
from tests.computed import once, paper_response

ROOT = Path(__file__).resolve().parents[1]

ASK = """
import sys
from pathlib import Path
from tests import computed
from tests.test_computed import noted
computed.shared = Path(sys.argv[1])
print(noted(sys.argv[2], 0.1))
"""


@once
def noted(name: str, number: float) -> float:
    """Takes a note in a folder each time that it computes."""
    with Path(name, "note").open("a", encoding="utf-8") as note:
        note.write("computed\n")
    return number / 3


def test_several_processes_compute_a_value_once(tmp_path) -> None:
    command = [sys.executable, "-c", ASK, str(tmp_path), str(tmp_path)]
    programs = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) for _ in range(2)]
    assert {program.communicate()[0] for program in programs} == {f"{0.1 / 3}\n"}
    assert (tmp_path / "note").read_text(encoding="utf-8") == "computed\n"


def test_another_run_computes_it_again(tmp_path, monkeypatch) -> None:
    for run in ("first", "second"):
        (tmp_path / run).mkdir()
        monkeypatch.setattr(computed, "shared", tmp_path / run)
        noted.cache_clear()  # type: ignore[attr-defined]
        assert noted(str(tmp_path), 0.25) == 0.25 / 3
    assert (tmp_path / "note").read_text(encoding="utf-8") == "computed\n" * 2


@pytest.mark.slow
def test_a_branch_of_another_process_is_the_same_to_the_last_bit(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(computed, "shared", None)
    paper_response.cache_clear()  # type: ignore[attr-defined]
    own = paper_response("9b")
    monkeypatch.setattr(computed, "shared", tmp_path)
    for _ in range(2):
        paper_response.cache_clear()  # type: ignore[attr-defined]
        other = paper_response("9b")
        assert [p.x.tobytes() for p in other.points] == [p.x.tobytes() for p in own.points]
        assert list(map(repr, other.special_points)) == list(map(repr, own.special_points))


def test_what_does_not_say_in_full_what_is_computed_is_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(computed, "shared", tmp_path)
    with pytest.raises(TypeError, match="do not say in full what is computed"):
        noted(str(tmp_path), (0.1, 0.2))
