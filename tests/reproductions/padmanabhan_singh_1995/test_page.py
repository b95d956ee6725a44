"""The page, and its summary in the docs: what a browser would make of them."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims import CLAIMS, Claim, Finding, Outcome, Trade, Verdict, counts
from reproductions.padmanabhan_singh_1995.claims.second_reading import CANDIDATES
from reproductions.padmanabhan_singh_1995.figures import FIGURES, find_figure
from reproductions.padmanabhan_singh_1995.jobs import AS_PRINTED, JOBS, LITERAL, USUAL
from reproductions.padmanabhan_singh_1995.page import FAILING, HOLDS, SHARED, html_page, with_counts
from reproductions.padmanabhan_singh_1995.report import Report
from reproductions.padmanabhan_singh_1995.tables import demands
from tests.reproductions.padmanabhan_singh_1995.expected import EXPECTED, verdict_of

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs" / "explanation" / "paper.md"
PAGE = ROOT / "docs" / "_static" / "padmanabhan_singh_1995.html"
COUNTED = ROOT / "README.md", ROOT / "docs" / "explanation" / "validation.md"


def checked(holds: bool = True, line: str = "found", details: str = ""):
    claim = Claim("12-x", "It <jumps> & stays", (), lambda: Finding(holds, line, details))
    return [(claim, claim.outcome({}, {}))]


def page_of(*figures: str, reading=USUAL, **parts) -> str:
    return html_page(Report(tuple(find_figure(name).at(reading) for name in figures), reading, **parts))


def expected() -> list[tuple[Claim, Outcome]]:
    """Each claim with an outcome of its class."""
    verdicts = [verdict_of(EXPECTED[claim.name]) for claim in CLAIMS]
    return [(claim, Outcome(verdict, "found 1")) for claim, verdict in zip(CLAIMS, verdicts, strict=True)]


def test_texts_are_no_markup() -> None:
    page = page_of("12", failures={"12": "no <orbit>"}, checked=checked(line="a < b", details="c < d"))
    for text in ("It &lt;jumps&gt; &amp; stays", "a &lt; b", "c &lt; d", "12: no &lt;orbit&gt;"):
        assert text in page


def test_the_page_names_its_reading() -> None:
    assert "slope literal, damping dissipative" in page_of("12", reading=LITERAL)


def test_a_card_has_the_statements_about_its_figure() -> None:
    page = page_of("12", "13", checked=checked(False))
    head, twelve, thirteen = re.split("<article>", page)
    assert "<b>0 hold</b>" in head
    assert 'id="figure-12"' in twelve
    assert '<li id="12-x" class="c6">' in twelve
    assert '<span class="chip">not found</span>' in twelve
    assert "12-x" not in thirteen


def test_evidence_is_folded_where_there_is_more_than_a_line() -> None:
    assert "<summary>evidence</summary>" not in page_of("12", checked=checked())
    folded = page_of("12", checked=checked(details="more")).partition("<summary>evidence</summary>")[2]
    assert "printed numbers, holds" in folded
    assert "more" in folded


def test_the_head_counts_each_class_and_says_its_rule() -> None:
    claims = expected()
    found = counts([outcome for _, outcome in claims])
    page = page_of("12", "13", checked=claims)
    bar = re.search(r'<div class="bar">(.*?)</div>', page)
    assert bar
    widths = [int(each) for each in re.findall(r"flex-grow: (\d+)", bar[1])]
    assert widths == [count for count in found.classes.values() if count]
    assert sum(widths) == found.statements  # what is elsewhere is not in the bar
    for verdict, count in found.classes.items():
        assert (f"<b>{count} {verdict}</b><br>{verdict.rule}" in unescape(page)) == bool(count)
    assert f"{found.elsewhere} elsewhere, not counted" in page


def test_each_statement_has_a_mark_of_its_class_and_a_place() -> None:
    claims = expected()
    page = page_of(*(figure.name for figure in FIGURES), checked=claims)
    for claim, outcome in claims:
        colour = f"c{list(Verdict).index(outcome.verdict)}"
        assert f'<li id="{claim.name}" class="{colour}">' in page
    marks = re.search(r'Figure 4<span class="marks">(.*?)</span>', page)
    assert marks
    assert marks[1].count("<b") == sum(claim.figure == "4" for claim, _ in claims)


def test_what_does_not_hold_is_said_once_on_the_first_screen() -> None:
    """Each statement that fails at the printed numbers is in one group with its reason, and no other one is."""
    failing = [name for _, *names in FAILING for name in names]
    assert sorted(failing) == sorted(claim.name for claim, outcome in expected() if outcome.verdict not in HOLDS)
    head = page_of("12", "13", checked=expected()).partition("<article>")[0]
    assert all(f'href="#{name}"' in head for name in failing)


def test_figures_of_which_all_holds_are_named() -> None:
    page = page_of(*(figure.name for figure in FIGURES), checked=expected())
    said = re.search(r"to the letter or in kind,</b> about figures (.*?)\.</p>", page)
    assert said
    named = re.findall(r">(\d+)</a>", said[1])
    assert {"9", "16", "20"} <= set(named)
    assert not {claim.figure for claim, outcome in expected() if outcome.verdict not in HOLDS} & set(named)


def test_cells_of_tables_name_their_columns_on_a_narrow_screen() -> None:
    trade = Trade(CANDIDATES[0], ("12-beats",), (), (), ())
    assert '<td data-label="then also holds">12-beats</td>' in page_of("12", "13", trades=(trade,))


def test_the_legend_names_all_that_the_pictures_of_branches_have() -> None:
    figure = find_figure("13")
    page = page_of("13", pictures={"13": tuple(figure.file_name(panel) for panel in figure.panels)})
    legend = page.partition('<div class="legend">')[2].partition("</div>")[0]
    for words in ("open triangles", "open squares", "open circles", "so many of these points", "period 2", "touched"):
        assert words in legend
    assert "period 4" not in legend  # figure 13 shows periods 1 and 2


def test_the_legend_leaves_out_instabilities_that_no_picture_has(tmp_path) -> None:
    """Figure 12 has folds only; without its results all kinds are named."""
    figure = find_figure("12")
    part = replace(figure, panels=figure.panels[:1])
    files = {"12": tuple(part.file_name(panel) for panel in part.panels)}
    result = gw.run(JOBS["12"].study, tmp_path / "12.gapwalk")
    legends = [
        html_page(Report((part,), USUAL, pictures=files, results=known)).partition('<div class="legend">')[2]
        for known in ({}, {"12": result})
    ]
    assert all("open triangles" in legend or known for legend, known in zip(legends, (False, True), strict=True))
    assert "open squares" in legends[1]
    assert "open triangles" not in legends[1]
    assert "open circles" not in legends[1]


def test_statements_on_several_figures_are_linked_where_a_card_has_none() -> None:
    figures = {figure.name for figure in FIGURES if figure.name != "2"} - {claim.figure for claim in CLAIMS}
    assert figures == set(SHARED)
    assert {name for names in SHARED.values() for name in names} <= {claim.name for claim in CLAIMS}


def test_a_reading_is_weighed_in_the_rows_of_its_statements() -> None:
    """Damping as printed: figures 12 and 13, not all rows."""
    candidate = next(each for each in CANDIDATES if each.reading == AS_PRINTED)
    assert '<td data-label="rows">12, 13</td>' in page_of("12", "13", trades=(Trade(candidate, (), (), (), ()),))


def test_each_picture_says_at_which_numbers_it_is_drawn() -> None:
    figure = find_figure("10")
    names = tuple(figure.file_name(panel) for panel in figure.panels)
    page = page_of("10", pictures={"10": names})
    assert re.findall(r'src="(.*?)"', page) == list(names)
    badges = re.findall(r"<figcaption>.*?</figcaption>", page)
    assert ['class="at"' in badge for badge in badges] == [bool(panel.place) for panel in figure.panels]


def test_other_numbers_stand_with_what_they_cost() -> None:
    trade = Trade(CANDIDATES[0], ("12-beats",), ("12-folds",), ("13-flips",), ())
    row = re.search(
        r"<tr><td[^>]*>([^<]*)</td><td[^>]*>[^<]*</td><td[^>]*>12-beats</td><td[^>]*>13-flips</td>"
        r"<td[^>]*>12-folds</td><td[^>]*>–</td></tr>",
        page_of("12", "13", trades=(trade,)),
    )
    assert row
    assert row[1] == trade.words


def test_the_summary_of_the_docs_is_that_of_the_verdicts() -> None:
    text = DOCS.read_text(encoding="utf-8")
    found = counts([outcome for _, outcome in expected()])
    for verdict, count in found.classes.items():
        assert f"| {verdict} | {count} | {verdict.rule} |" in text
    flat = " ".join(text.split())
    for claim, outcome in expected():
        assert (f"{claim.name}: {EXPECTED[claim.name]}" in flat) == (outcome.verdict not in HOLDS)


def test_the_page_of_the_docs_has_each_statement_with_its_verdict() -> None:
    text = PAGE.read_text(encoding="utf-8")
    items = re.findall(r'<li id="([\w-]+)" class="c\d">(.*?)<br><span class="chip">(.*?)</span>', text)
    assert sorted((name, unescape(says), unescape(verdict)) for name, says, verdict in items) == sorted(
        (claim.name, claim.says, EXPECTED[claim.name]) for claim in CLAIMS
    )
    small, today = text.count('alt=""'), text.partition('id="today"')[2].count("<img")
    assert small == len(FIGURES)
    assert text.count("<img") == sum(len(figure.panels) for figure in FIGURES) + small + today
    assert not re.search(r'src="(?!data:)|<script|href="(?!#)', text)  # one file, which loads nothing


def test_the_counts_in_the_readme_are_those_of_the_verdicts() -> None:
    outcomes = [outcome for _, outcome in expected()]
    for path in COUNTED:
        text = path.read_text(encoding="utf-8")
        assert with_counts(text, outcomes) == text  # as the command writes it
        assert with_counts(text, outcomes[1:]) != text


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
