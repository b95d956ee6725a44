"""The report page and the page of the docs: what a browser would make of them."""

import re
from pathlib import Path

import pytest

from reproductions.padmanabhan_singh_1995.claims import CLAIMS, Claim, Outcome, Trade, Verdict
from reproductions.padmanabhan_singh_1995.claims.second_reading import CANDIDATES
from reproductions.padmanabhan_singh_1995.figures import find_figure
from reproductions.padmanabhan_singh_1995.jobs import LITERAL, USUAL
from reproductions.padmanabhan_singh_1995.page import claims_page, html_page, with_counts
from reproductions.padmanabhan_singh_1995.report import Report
from reproductions.padmanabhan_singh_1995.tables import demands
from tests.reproductions.padmanabhan_singh_1995.expected import EXPECTED

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs" / "explanation" / "paper.md"
COUNTED = ROOT / "README.md", ROOT / "docs" / "explanation" / "validation.md"


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
    assert '<li id="12-x" class="bad">' in twelve
    assert '<span class="verdict">not reproduced</span>' in twelve
    assert "1 not reproduced." in page


def test_the_page_of_the_docs_counts_verdicts_and_keeps_its_columns() -> None:
    page = claims_page([*checked(evidence="a | b"), *checked(False)])
    assert "1 reproduced; 1 not reproduced." in page
    assert "| 12-x | It <jumps> & stays | **reproduced** | a \\| b |" in page
    assert page.count("## Figure 12") == 1


def test_docs_paper_is_up_to_date() -> None:
    """Names, statements and verdicts; the head of the page says which command writes it."""
    text = DOCS.read_text(encoding="utf-8").partition("## Other numbers")[0]
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| ")]
    found = [(row[0].removeprefix("| "), row[1], row[2].strip("*")) for row in rows if row[0] != "| claim"]
    assert found == [(claim.name, claim.says, EXPECTED[claim.name]) for claim in CLAIMS]


def test_the_counts_of_page_docs_and_readme_are_those_of_the_verdicts() -> None:
    verdicts = [Verdict(text.partition(" (")[0]) for text in EXPECTED.values()]
    line = next(line for line in DOCS.read_text(encoding="utf-8").splitlines() if " reproduced;" in line)
    counted = {verdict.value: verdicts.count(verdict) for verdict in Verdict}
    assert line == "; ".join(f"{count} {word}" for word, count in counted.items() if count) + "."
    for path in COUNTED:
        text = path.read_text(encoding="utf-8")
        assert with_counts(text, verdicts) == text  # as the command writes it
        assert with_counts(text, verdicts[1:]) != text
    claims = [(claim, Outcome(verdict, "found 1")) for claim, verdict in zip(CLAIMS, verdicts, strict=True)]
    page = page_of("12", checked=claims)
    assert all(f"<b>{count}</b>{word}" in page for word, count in counted.items() if count)
    assert line in page


def test_the_summary_has_each_claim_in_the_colour_of_its_verdict() -> None:
    claims = [(claim, Outcome(verdict, "1")) for claim, verdict in zip(CLAIMS, Verdict, strict=False)]
    page = page_of("1", checked=claims)
    colours = re.findall(r'<a class="([\w-]+)" href="#([\w-]+)"', page)
    assert [name for _, name in colours] == [claim.name for claim, _ in claims]
    assert [colour for colour, _ in colours] == ["good", "other", "by-number", "why", "bad"]
    assert all(f'id="{name}"' in page for _, name in colours)


def test_other_numbers_stand_with_what_they_cost() -> None:
    trade = Trade(CANDIDATES[0], ("12-beats",), ("12-folds",), ("13-flips",), ())
    page, text = page_of("12", trades=(trade,)), claims_page(checked(), (trade,))
    assert "C11 = C21 = 0.025 (printed: 0.04)" in page
    row = "C11 = C21 = 0.025 (printed: 0.04) | 12, 13, 9a, 20a, 20b, 22, 27, 28 | 12-beats | 13-flips | 12-folds | –"
    assert f"| {row} |" in text


def test_the_tables_contradict_their_own_equations() -> None:
    """The ratios by hand: 0.06/0.1 and 0.6/1.1; (1 - 0.6)/(1.1/0.6 - 1)/0.6 = 0.8 with equal widths."""
    coupling, shaft, mean = demands()
    assert coupling.demanded.startswith("0.6,")
    assert coupling.printed == "1"
    assert shaft.demanded.startswith("0.545,")
    assert shaft.printed == "0.667"
    assert mean.demanded.startswith("0.8 ")
    for ratio, r in ((2.0, 0.786), (1.0, 0.941), (0.5, 1.13)):
        # equation 9 and 10, with I2 = 1: I1 = n r/(1 - n r), I3 = K2/(K22 - K2), K2 = K12/r; n = 0.6
        first, third = 0.6 * r / (1.0 - 0.6 * r), (0.6 / r) / (1.1 - 0.6 / r)
        assert r * third / first == pytest.approx(ratio, rel=5e-3)
        assert f"{r:g}" in mean.printed


@pytest.mark.parametrize("text", ["](/", "file:", "http:"])
def test_docs_paper_has_no_links_of_a_machine(text: str) -> None:
    assert text not in DOCS.read_text(encoding="utf-8")
