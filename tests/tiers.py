"""The three tiers of the tests: ``make quick``, ``make test``, and ``make campaign``, whose tests are marked as slow.

Quick is what stands in these files and is not slow: rules, records and formulas that need no branch to be walked. A
file joins them that takes less than about three seconds of processor time.
"""

import os
from collections.abc import Iterable
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parent

QUICK = (
    "attractors/test_average.py",
    "attractors/test_box.py",
    "attractors/test_convergence.py",
    "attractors/test_rotation.py",
    "attractors/test_section.py",
    "attractors/test_spectrum.py",
    "attractors/test_many_motions.py",
    "bifurcation/test_approach.py",
    "bifurcation/test_campaign.py",
    "bifurcation/test_events.py",
    "bifurcation/test_grazing.py",
    "cli/test_explore.py",
    "cli/test_modes_command.py",
    "continuation/test_corrector.py",
    "continuation/test_step_length.py",
    "faults/test_first_steps.py",
    "model/test_[!lt]*.py",
    "model/drivetrain/test_[!s]*.py",
    "model/measured/*.py",
    "model/units/*.py",
    "flow/test_hysteresis.py",
    "flow/test_motion.py",
    "flow/test_si*.py",
    "flow/test_sy*.py",
    "plot/test_colors.py",
    "plot/test_alignment.py",
    "release/test_names.py",
    "reproductions/*/test_figures.py",
    "reproductions/*/test_page.py",
    "test_[!ri]*.py",
)
"""Patterns of files below the folder of the tests."""


@cache
def is_quick(file: Path) -> bool:
    """Whether the tests of a file are quick."""
    name = file.relative_to(TESTS).as_posix() if file.is_relative_to(TESTS) else ""
    return any(fnmatch(name, pattern) for pattern in QUICK)


def examples(count: int) -> int:
    """The number of random examples of a test: some in `make test`, and as many as ``make fuzz`` says."""
    return int(os.environ.get("GAPWALK_FUZZ", "0")) or count


def in_campaign(*values: Any) -> Any:
    """A case of a broad test that `make test` leaves to `make campaign`."""
    return pytest.param(*values, marks=pytest.mark.slow)


def some_of(cases: Iterable[str | float], *kept: str | float) -> list[Any]:
    """The cases of a broad test, of which `make test` keeps some and `make campaign` runs the others."""
    cases = list(cases)
    assert set(kept) <= set(cases)
    return [pytest.param(case, marks=() if case in kept else pytest.mark.slow) for case in cases]


def keeps(*cases: str) -> pytest.MarkDecorator:
    """The cases of a broad test, by the names that pytest prints, that `make test` keeps; `make campaign` runs all."""
    return pytest.mark.keeps(*cases)


@cache
def twins() -> frozenset[str]:
    """The tests and cases of ``twins.txt``, by the names that pytest prints, without the folder of the tests."""
    lines = Path(__file__).with_name("twins.txt").read_text(encoding="utf-8").splitlines()
    return frozenset(line for line in lines if line and not line.startswith("#"))


def leave_to_campaign(items: list[pytest.Item], *, whole: bool) -> None:
    """Mark what `keeps` and `twins` leave out; where tests are collected `whole`, refuse names of no case."""
    found: dict[tuple[Path, str], set[str]] = {}
    listed = dict[str, set[str]]()
    for file, _, twin in (each.partition("::") for each in twins()):
        listed.setdefault(str(TESTS / file), set()).add(twin)
    for item in items:
        test, _, name = item.name.partition("[")
        name = name[:-1]
        for mark in item.iter_markers("keeps"):
            found.setdefault((item.path, test), set(mark.args)).discard(name)
            if name not in mark.args:
                item.add_marker(pytest.mark.slow)
        if names := listed.get(str(item.path)):
            found.setdefault((item.path, ""), set(names)).difference_update({test, item.name})
            if names & {test, item.name}:
                item.add_marker(pytest.mark.slow)
    if whole and (strange := {f"{path.name}::{test}": names for (path, test), names in found.items() if names}):
        raise pytest.UsageError(f"keeps or twins.txt name cases that are not there: {strange}")
