"""A campaign: each comparison is made once, however often it is stopped, and a difference fails it."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from gapwalk.errors import ConvergenceError
from tests.bifurcation.campaign import compare_all


@dataclass(frozen=True)
class Found:
    name: str
    agrees: bool = True
    note: str = ""


def test_each_comparison_is_made_once_and_a_difference_fails_whenever_it_was_found(tmp_path: Path, capsys) -> None:
    log, asked = tmp_path / "log.jsonl", []

    def compare(name: str) -> Found:
        asked.append(name)
        if name == "c":
            raise ConvergenceError("no orbit")
        if name == "d" and asked.count("d") == 1:
            raise KeyboardInterrupt
        return Found(name, agrees=name != "b")

    assert compare_all(log, ["a"], compare, Found) == 0
    with pytest.raises(KeyboardInterrupt):
        compare_all(log, ["a", "b", "c", "d"], compare, Found)
    assert compare_all(log, ["a", "b", "c", "d"], compare, Found) == 1
    assert asked == ["a", "b", "c", "d", "d"]
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [line["name"] for line in lines] == ["a", "b", "c", "d"]
    assert lines[2]["note"] == "ConvergenceError: no orbit"
    assert capsys.readouterr().out.endswith("4 compared, 1 differ, b\n")
