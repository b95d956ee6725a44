"""The README is short, and what it shows is true: its commands, its output, its links and its figures."""

import doctest
import re
import tomllib

import pytest

from tests.docs.commands import ROOT, commands_in, parse_command
from tests.docs.page import blocks_of

README = ROOT / "README.md"
TEXT = README.read_text(encoding="utf-8")
VALIDATION = (ROOT / "docs" / "explanation" / "validation.md").read_text(encoding="utf-8")
PAPER = (ROOT / "docs" / "explanation" / "paper.md").read_text(encoding="utf-8")
PAGES = [README, *(page for page in sorted((ROOT / "docs").rglob("*.md")) if "generated" not in page.parts)]


def test_it_is_short_and_begins_with_the_set_up() -> None:
    lines = TEXT.splitlines()
    assert len(lines) <= 110
    assert {"make demo", "make explore"} <= {line.strip().partition("  ")[0] for line in lines[:14]}


def test_targets_of_make_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    asked = re.findall(r"\bmake ([a-z]+)", TEXT.replace("and make", ""))
    assert {*asked} <= {*re.findall(r"^([a-z]+):", makefile, re.M)}


def test_its_model_and_its_table_are_those_of_the_tutorial() -> None:
    """The tutorial is run by the tests; here its text is compared, so nothing is computed twice."""
    model = (ROOT / "docs" / "tutorial" / "stop.toml").read_text(encoding="utf-8")
    shown = re.search(r"```toml\n(.*?)```", TEXT, re.S)
    assert shown is not None
    assert tomllib.loads(shown[1]) == tomllib.loads(model)
    here = next(block.text for block in blocks_of(README) if block.kind == "console")
    there = [block.text for block in blocks_of(ROOT / "docs" / "tutorial" / "first-system.md")]
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert any(doctest.OutputChecker().check_output(text, here, flags) for text in there if "run stop.toml\n" in text)


@pytest.mark.parametrize("link", re.findall(r"\]\(([^)#]+)", TEXT))
def test_a_link_leads_somewhere(link: str) -> None:
    assert (ROOT / link).exists()


def test_its_figures_are_those_that_the_tests_measure() -> None:
    rows = dict(re.findall(r"^\| ([a-z ]+) \| (\d+) \|", PAPER, re.M)) | {
        "all": re.findall(r"\*\*(\d+)\*\* \|", PAPER)[0]
    }
    assert sum(int(count) for name, count in rows.items() if name != "all") == int(rows["all"]) > 0
    said = " ".join(TEXT.split())
    assert f"Of {rows['all']} statements of the paper cited below, {rows['to the letter']} hold to the letter" in said
    for name, words in (
        ("in kind", "hold except for some numbers"),
        ("other reading", "with a formula read differently"),
        ("one number changed", "with one printed number changed"),
        ("several numbers changed", "with several changed"),
        ("explained", "fail for a reason that a check shows"),
        ("not found", "fail without an explanation"),
        ("cannot be tested", "cannot be tested"),
    ):
        assert f"{rows[name]} {words}" in said
    for figure in ("2e-12 compared with the closed form", "1e-12 in the parameter", "1,449 special points"):
        assert figure in VALIDATION
        assert figure.split()[0] in TEXT


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_commands_of_a_page_have_options_and_examples_that_exist(page) -> None:
    for words in commands_in(page.read_text(encoding="utf-8")):
        parse_command(words)
