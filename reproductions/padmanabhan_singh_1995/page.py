"""What a run has found, written down: a page in HTML, the claims in Markdown, and documents in JSON."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Sequence
from html import escape
from typing import Any

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims import Claim, Outcome, Trade, Verdict
from reproductions.padmanabhan_singh_1995.figures import Figure
from reproductions.padmanabhan_singh_1995.panels import Hysteresis
from reproductions.padmanabhan_singh_1995.quantities import LOOPS
from reproductions.padmanabhan_singh_1995.report import Report
from reproductions.padmanabhan_singh_1995.tables import demands

_DEMANDS = "No one physical system has all rows: equations 10 and 11 of the paper leave these ratios no choice."

Checked = Sequence[tuple[Claim, Outcome]]
"""Claims, and what their checks have come to."""

_STYLE = """
:root { color-scheme: light dark; --ink: #1c1c1c; --paper: #fdfdfb; --soft: #62625e; --line: #deddd6; --card: #ffffff;
  --good: #00734f; --other: #0b56a4; --number: #6a3d9a; --why: #7a5c00; --bad: #b02a00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e5e0; --paper: #161715; --soft: #a5a49d; --line: #383936;
  --card: #1e1f1d; --good: #4fc79b; --other: #7ab8f2; --number: #c3a1e8; --why: #dcb84f; --bad: #f58a6a; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 84rem; padding: 1.5rem; color: var(--ink); background: var(--paper);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.2rem; margin: 0 0 .5rem; }
a { color: var(--other); } p { margin: .4rem 0; } .soft { color: var(--soft); font-size: .9rem; }
nav { display: flex; flex-wrap: wrap; gap: .3rem .7rem; margin: 1rem 0 1.5rem; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 1rem 1.2rem;
  margin: 0 0 1.4rem; }
img { display: block; width: 100%; height: auto; background: #fff; border-radius: 4px; margin: .6rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .88rem; } .wide { overflow-x: auto; }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem .3rem 0; border-top: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; } td:first-child { min-width: 9rem; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
summary { cursor: pointer; color: var(--soft); } details { margin: .3rem 0; overflow-wrap: anywhere; }
.good { --own: var(--good); } .other { --own: var(--other); } .by-number { --own: var(--number); }
.why { --own: var(--why); } .bad { --own: var(--bad); }
.verdict, p.bad { color: var(--own); font-weight: 600; }
.counts { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: .6rem; margin: .8rem 0; }
.counts div { border-left: 5px solid var(--own); padding: .1rem .6rem; }
.counts b { display: block; font-size: 1.7rem; line-height: 1.2; color: var(--own); }
.strip { display: flex; flex-wrap: wrap; gap: .25rem; margin: .7rem 0 .2rem; }
.strip a { border: 1px solid var(--own); color: var(--own); border-radius: 4px; padding: 0 .35rem; font-size: .8rem;
  text-decoration: none; }
.beside { display: grid; grid-template-columns: minmax(0, 1.15fr) minmax(0, 1fr); gap: 0 1.6rem; align-items: start; }
@media (max-width: 60rem) { .beside { grid-template-columns: minmax(0, 1fr); } }
ul.claims { list-style: none; margin: 0; padding: 0; font-size: .92rem; }
ul.claims li { border-left: 5px solid var(--own); padding: .1rem 0 .1rem .7rem; margin: .2rem 0 .9rem; }
"""
_CLASS = {
    Verdict.LETTER: "good",
    Verdict.KIND: "good",
    Verdict.OTHER_READING: "other",
    Verdict.OTHER_NUMBER: "by-number",
    Verdict.OTHER_NUMBERS: "by-number",
    Verdict.EXPLAINED: "why",
    Verdict.OPEN: "bad",
    Verdict.ELSEWHERE: "other",
}

_HTML = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Padmanabhan and Singh (1995), figure by figure</title>
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""


def html_page(report: Report) -> str:
    """Return the page: a summary, then each figure beside what the paper says of it. It needs no network or script."""
    links = " ".join(f'<a href="#figure-{figure.name}">{figure.name}</a>' for figure in report.figures)
    links += ' <a href="#numbers">other numbers</a>' if report.trades else ""
    links += ' <a href="#claims">all claims</a>' if report.checked else ""
    versions = {result.versions["gapwalk"] for result in report.results.values()}
    body = [
        "<h1>Padmanabhan and Singh (1995), figure by figure</h1>",
        '<p class="soft">Journal of Sound and Vibration 184(5), 767–799. Computed with '
        f"{' '.join(['gapwalk', ', '.join(sorted(versions))]).strip()}. Reading: {escape(str(report.reading))}. "
        "Ω is the excitation frequency; everything is non-dimensional.</p>",
        _summary(report.checked) if report.checked else "",
        f"<nav>{links}</nav>",
        *(_section(report, figure) for figure in report.figures),
    ]
    if report.trades:
        body.append(f'<section id="numbers"><h2>Other numbers</h2>{_numbers(report.trades)}</section>')
    if report.checked:
        shown = {str(figure.number) for figure in report.figures}
        rest = [each for each in report.checked if each[0].figure not in shown]
        body.append(
            f'<section id="claims"><h2>All claims</h2><p>{_counts(report.checked)}.</p>{_claims(rest)}'
            f"<details><summary>all of them as a table</summary>{_table(report.checked)}</details></section>"
        )
    return _HTML.format(style=_STYLE, body="\n".join(body))


def _summary(checked: Checked) -> str:
    """How many claims come to each verdict, and each claim in its colour."""
    counts = Counter(outcome.verdict for _, outcome in checked)
    boxes = "".join(
        f'<div class="{_CLASS[verdict]}"><b>{counts[verdict]}</b>{verdict.value}</div>'
        for verdict in Verdict
        if counts[verdict]
    )
    strip = "".join(
        f'<a class="{_CLASS[outcome.verdict]}" href="#{claim.name}" title="{escape(f"{claim.says} {outcome}")}">'
        f"{escape(claim.name)}</a>"
        for claim, outcome in checked
    )
    return (
        f'<section id="summary-of-all"><h2>{len(checked)} statements of the paper</h2><div class="counts">{boxes}</div>'
        '<p class="soft">The printed numbers are the default, and nothing is tuned. Where they do not give what is '
        "described, another reading of them, one other number, or an explanation stands beside them with its evidence."
        f'</p><div class="strip">{strip}</div></section>'
    )


def _section(report: Report, figure: Figure) -> str:
    results = {job.key: report.results[job.key] for job in figure.jobs if job.key in report.results}
    failures = {job.key: report.failures[job.key] for job in figure.jobs if job.key in report.failures}
    pictures = report.pictures.get(figure.name, ())
    shown = [f"<p>{escape(figure.caption)}</p>"]
    shown += [f'<p class="bad">{escape(key)}: {escape(text)}</p>' for key, text in failures.items()]
    if pictures:
        shown.append(f'<a href="{pictures[0]}"><img src="{pictures[0]}" alt="{escape(figure.caption)}"></a>')
        files = ", ".join(f'<a href="{name}">{name.rpartition(".")[2].upper()}</a>' for name in pictures)
        data = ", ".join(f'<a href="results/{key}.gapwalk">{key}</a>' for key in results)
        shown.append(f'<p class="soft">Picture: {files}.{f" Results: {data}." if data else ""}</p>')
    shown += [f'<p class="soft">Set {escape(name)}: {escape(note)}</p>' for name, note in figure.notes.items()]
    shown += [_special_points(key, result) for key, result in results.items() if result.branches]
    about = report.about(figure)
    said = f'<div><p class="soft">What the paper says of it</p>{_claims(about)}</div>' if about else ""
    return (
        f'<section id="figure-{figure.name}"><h2>Figure {figure.name}</h2>'
        f'<div class="beside"><div>{"".join(shown)}</div>{said}</div></section>'
    )


def _claims(checked: Checked) -> str:
    """Claims with their verdicts in colour; the evidence is folded where it is long."""
    return '<ul class="claims">' + "".join(_claim(*each) for each in checked) + "</ul>"


def _claim(claim: Claim, outcome: Outcome) -> str:
    evidence, rest = f"<div>{escape(outcome.line)}</div>", [str(each) for each in outcome.evidence]
    folded = f"<details><summary>evidence</summary>{''.join(f'<p>{escape(each)}</p>' for each in rest)}</details>"
    name = escape(claim.name)
    return (
        f'<li id="{name}" class="{_CLASS[outcome.verdict]}"><span class="soft">{name}</span> {escape(claim.says)} '
        f'<span class="verdict">{escape(str(outcome))}</span>'
        f'<div class="soft">{evidence}{folded if rest else ""}</div></li>'
    )


def _numbers(trades: Sequence[Trade]) -> str:
    """What other numbers gain and cost, and what the tables demand of each other."""
    headings = ("number", "sets", "then also holds", "ceases to hold", "still holds", "neither")
    head = f"<tr>{''.join(f'<th>{each}</th>' for each in headings)}</tr>"
    rows = "".join(
        f"<tr><td>{escape(trade.words)}</td>" + "".join(f"<td>{escape(cell)}</td>" for cell in _cells(trade)) + "</tr>"
        for trade in trades
    )
    relations = "".join(
        f"<tr><td>{escape(each.relation)}</td><td>{escape(each.demanded)}</td><td>{escape(each.printed)}</td></tr>"
        for each in demands()
    )
    return (
        f'<div class="wide"><table>{head}{rows}</table></div><p>{_DEMANDS}</p><div class="wide"><table>'
        f"<tr><th>relation</th><th>demanded</th><th>printed</th></tr>{relations}</table></div>"
    )


def _cells(trade: Trade) -> tuple[str, ...]:
    number = trade.candidate.reading.number
    names = (", ".join(each) or "–" for each in (trade.gained, trade.lost, trade.kept, trade.missed))
    return ", ".join(number.cases) if number else "all", *names


def _special_points(key: str, result: gw.Result) -> str:
    """The special points of all branches but for grazing points, folded away."""
    rows, count = [], 0
    for name, branch in zip(result.names, result.branches, strict=True):
        for kind in gw.Kind.known():
            found = branch.special(kind)
            if found and kind is not gw.Kind.GRAZING:
                values = ",<wbr> ".join(f"{special.value:.6f}" for special in found)
                rows.append(f'<tr><td>{name}</td><td>{kind.value}</td><td class="number">{values}</td></tr>')
                count += len(found)
    summary = f"{escape(key)}: {len(result.branches)} branches, {count} special points"
    table = f'<div class="wide"><table><tr><th>branch</th><th>kind</th><th>at</th></tr>{"".join(rows)}</table></div>'
    return f"<details><summary>{summary}</summary>{table}</details>"


def _table(checked: Checked) -> str:
    rows = "".join(
        f"<tr><td>{escape(claim.name)}</td><td>{escape(claim.says)}</td>"
        f'<td class="{_CLASS[outcome.verdict]} verdict">{escape(str(outcome))}</td>'
        f"<td>{escape(outcome.line)}</td></tr>"
        for claim, outcome in checked
    )
    head = "<tr><th>claim</th><th>the paper</th><th>verdict</th><th>evidence</th></tr>"
    return f'<div class="wide"><table>{head}{rows}</table></div>'


def _counts(checked: Checked) -> str:
    counts = Counter(outcome.verdict for _, outcome in checked)
    return "; ".join(f"{counts[verdict]} {verdict.value}" for verdict in Verdict if counts[verdict])


_HEAD = """\
# The paper, claim by claim

This page compares the statements of C. Padmanabhan and R. Singh, "Dynamics of a piecewise non-linear system subject to
dual harmonic excitation using parametric continuation" (Journal of Sound and Vibration 184(5), 767-799, 1995), with
what gapwalk computes. Each statement is a check. This command writes the page:

    python -m reproductions.padmanabhan_singh_1995 --claims docs/explanation/paper.md \
      --counts README.md docs/explanation/validation.md

The tests compare its verdicts with those of the checks. The parameters are those of the tables in the paper. Some of
them have two readings (slope of the second stage: reduced or literal; impact damping: dissipative or as printed). The
default is reduced and dissipative; the verdict names any other reading. Nothing is tuned. If the printed numbers do not
give what the paper describes, the evidence reports what they give, and where the nearest motion is that agrees with the
paper. *At one other number*: the statement holds if one number of the tables is another, which the verdict names; [the
table](#other-numbers) has what that number costs. *Explained*: the statement does not hold, and the evidence says why
the paper may have come to it. What is *not reproduced* is open.
"""


def claims_page(checked: Checked, trades: Sequence[Trade] = ()) -> str:
    """Return the claims in Markdown, for the documentation: a count of verdicts, then a table for each figure."""
    text = [_HEAD, f"{_counts(checked)}."]
    for figure in dict.fromkeys(claim.figure for claim, _ in checked):
        text += ["", f"## {figure.capitalize() if figure.isalpha() else f'Figure {figure}'}", ""]
        text += ["| claim | the paper | verdict | evidence |", "|---|---|---|---|"]
        for claim, outcome in checked:
            if claim.figure == figure:
                says, evidence = (cell.replace("|", "\\|") for cell in (claim.says, outcome.line))
                text.append(f"| {claim.name} | {says} | **{outcome}** | {evidence} |")
    if trades:
        text += ["", "## Other numbers", ""]
        text += [
            "| number | sets | then also holds | ceases to hold | still holds | neither |",
            "|---|---|---|---|---|---|",
        ]
        text += [f"| {trade.words} | {' | '.join(_cells(trade))} |" for trade in trades]
        text += ["", _DEMANDS, "", "| relation | demanded | printed |", "|---|---|---|"]
        text += [f"| {each.relation} | {each.demanded} | {each.printed} |" for each in demands()]
    return "\n".join(text) + "\n"


_COUNTED = re.compile(r"(- |)Of \d+ statements of the paper( below|),[^;]*;")
_SHORT = {
    Verdict.LETTER: "{} are reproduced to the letter",
    Verdict.KIND: "{} in kind",
    Verdict.OTHER_READING: "{} under another reading",
    Verdict.OTHER_NUMBER: "{} with one number changed",
    Verdict.OTHER_NUMBERS: "{} with several numbers changed",
    Verdict.EXPLAINED: "{} are explained",
    Verdict.OPEN: "{} are open",
}


def with_counts(text: str, verdicts: Sequence[Verdict]) -> str:
    """Return a text, such as the README, with its sentence that counts the verdicts as they are.

    Parameters
    ----------
    text
        A text with a sentence that begins like ``Of 65 statements of the paper, 40 are reproduced`` and ends at a
        semicolon.
    verdicts
        The verdicts on all claims.
    """
    counts = Counter(verdicts)
    counted = sum(counts.values()) - counts[Verdict.ELSEWHERE]
    parts = ", ".join(words.format(counts[verdict]) for verdict, words in _SHORT.items() if counts[verdict])
    return _COUNTED.sub(
        lambda found: textwrap.fill(
            f"{found[1]}Of {counted} statements of the paper{found[2]}, {parts};",
            118,
            subsequent_indent="  " if found[1] else "",
            break_on_hyphens=False,
        ),
        text,
    )


def document(report: Report, *, whole: bool) -> Any:
    """Return plain JSON values: all figures and claims of a whole report, otherwise one figure, or a list of them."""
    figures = [_figure_document(report, figure) for figure in report.figures]
    if whole:
        return {"figures": figures, "claims": [_claim_document(*each) for each in report.checked]}
    return figures[0] if len(figures) == 1 else figures


def _figure_document(report: Report, figure: Figure) -> dict[str, Any]:
    keys = [job.key for job in figure.jobs]
    laws = [panel.law for panel in figure.panels if isinstance(panel, Hysteresis)]
    return {
        "figure": figure.name,
        "kind": figure.kind,
        "caption": figure.caption,
        "reading": {"slope": figure.reading.slope.value, "damping": figure.reading.damping.value},
        "panels": [
            {
                "letter": panel.letter or None,
                "view": panel.view,
                "title": panel.title,
                "jobs": [job.key for job in figure.jobs_of(panel)],
                "within": None if panel.within is None else list(panel.within),
            }
            for panel in figure.panels
        ],
        "notes": figure.notes,
        "loops": {law: _loop_document(LOOPS[law]) for law in laws},
        "results": {key: report.results[key].to_dict() for key in keys if key in report.results},
        "failures": {key: report.failures[key] for key in keys if key in report.failures},
        "claims": [_claim_document(*each) for each in report.about(figure)],
    }


def _loop_document(loop: Any) -> dict[str, Any]:
    return {"loss": loop.loss, "deflection": loop.deflection.tolist(), "force": loop.force.tolist()}


def _claim_document(claim: Claim, outcome: Outcome) -> dict[str, Any]:
    return {
        "claim": claim.name,
        "says": claim.says,
        "verdict": outcome.kind,
        "by": outcome.by or None,
        "line": outcome.line,
        "evidence": [str(each) for each in outcome.evidence],
        "changed": {symbol: list(pair) for symbol, pair in outcome.changed.items()},
        "costs": list(outcome.costs),
    }
