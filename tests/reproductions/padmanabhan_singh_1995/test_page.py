"""The report page and the page of the docs: what a browser would make of them."""

from pathlib import Path

import pytest

from reproductions.padmanabhan_singh_1995.claims import CLAIMS, Claim
from reproductions.padmanabhan_singh_1995.figures import find_figure
from reproductions.padmanabhan_singh_1995.jobs import LITERAL, USUAL
from reproductions.padmanabhan_singh_1995.page import claims_page, html_page
from reproductions.padmanabhan_singh_1995.report import Report
from tests.reproductions.padmanabhan_singh_1995.expected import EXPECTED

DOCS = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "paper.md"


def checked(holds: bool = True, evidence: str = "found"):
    claim = Claim("12-x", "It <jumps> & stays", (), lambda: (holds, evidence))
    return [(claim, claim.outcome({}, {}))]


def page_of(*figures: str, reading=USUAL, **parts) -> str:
    return html_page(Report(tuple(find_figure(name).at(reading) for name in figures), reading, **parts))


def test_texts_are_no_markup() -> None:
    page = page_of("12", failures={"12": "no <orbit>"}, checked=checked(evidence="a < b"))
    assert "It &lt;jumps&gt; &amp; stays" in page
    assert "a &lt; b" in page
    assert "12: no &lt;orbit&gt;" in page


def test_the_page_names_its_reading() -> None:
    page = page_of("12", reading=LITERAL)
    assert "slope literal, damping dissipative" in page
    assert 'href="#claims"' not in page


def test_the_claims_about_a_figure_are_in_its_section() -> None:
    page = page_of("12", "13", checked=checked(False))
    twelve, thirteen = page.split('id="figure-13"')[0], page.split('id="figure-13"')[1].split('id="claims"')[0]
    assert "12-x" in twelve
    assert "12-x" not in thirteen
    assert 'class="bad">not reproduced' in twelve
    assert "1 not reproduced." in page


def test_the_page_of_the_docs_counts_verdicts_and_keeps_its_columns() -> None:
    page = claims_page([*checked(evidence="a | b"), *checked(False)])
    assert "1 reproduced; 1 not reproduced." in page
    assert "| 12-x | It <jumps> & stays | **reproduced** | a \\| b |" in page
    assert page.count("## Figure 12") == 1


def test_docs_paper_is_up_to_date() -> None:
    """Names, statements and verdicts; the head of the page says which command writes it."""
    rows = [line.split(" | ") for line in DOCS.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    found = [(row[0].removeprefix("| "), row[1], row[2].strip("*")) for row in rows if row[0] != "| claim"]
    assert found == [(claim.name, claim.says, EXPECTED[claim.name]) for claim in CLAIMS]


@pytest.mark.parametrize("text", ["](/", "file:", "http:"])
def test_docs_paper_has_no_links_of_a_machine(text: str) -> None:
    assert text not in DOCS.read_text(encoding="utf-8")
