"""What a run has found, written down: a page in HTML, the claims in Markdown, and documents in JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from typing import Any

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims import Claim, Outcome, Verdict
from reproductions.padmanabhan_singh_1995.figures import Figure
from reproductions.padmanabhan_singh_1995.panels import Hysteresis
from reproductions.padmanabhan_singh_1995.quantities import LOOPS
from reproductions.padmanabhan_singh_1995.report import Report

Checked = Sequence[tuple[Claim, Outcome]]
"""Claims, and what their checks have come to."""

_STYLE = """
:root { color-scheme: light dark; --ink: #1c1c1c; --paper: #fdfdfb; --soft: #6a6a66; --line: #deddd6; --card: #ffffff;
  --good: #00734f; --other: #0b56a4; --bad: #b04a00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e5e0; --paper: #161715; --soft: #a09f98; --line: #383936;
  --card: #1e1f1d; --good: #4fc79b; --other: #7ab8f2; --bad: #f29a5c; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 72rem; padding: 1.5rem; color: var(--ink); background: var(--paper);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.2rem; margin: 0 0 .5rem; }
a { color: var(--other); } p { margin: .4rem 0; } .soft { color: var(--soft); font-size: .9rem; }
nav { display: flex; flex-wrap: wrap; gap: .3rem .7rem; margin: 1rem 0 1.5rem; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 1rem 1.2rem;
  margin: 0 0 1.4rem; }
img { display: block; width: 100%; height: auto; background: #fff; border-radius: 4px; margin: .6rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .88rem; } .wide { overflow-x: auto; }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem .3rem 0; border-top: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; } td:first-child { white-space: nowrap; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
summary { cursor: pointer; color: var(--soft); margin: .5rem 0; }
.good { color: var(--good); } .other { color: var(--other); } .bad { color: var(--bad); }
.good, .other, .bad { font-weight: 600; white-space: nowrap; }
"""
_CLASS = {Verdict.REPRODUCED: "good", Verdict.OTHER_READING: "other", Verdict.NOT_REPRODUCED: "bad"}

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
    """Return the page: pictures, captions, special points and claims. It needs no network and has no scripts."""
    links = " ".join(f'<a href="#figure-{figure.name}">{figure.name}</a>' for figure in report.figures)
    links += ' <a href="#claims">claims</a>' if report.checked else ""
    versions = {result.versions["gapwalk"] for result in report.results.values()}
    body = [
        "<h1>Padmanabhan and Singh (1995), figure by figure</h1>",
        '<p class="soft">Journal of Sound and Vibration 184(5), 767–799. Computed with '
        f"{' '.join(['gapwalk', ', '.join(sorted(versions))]).strip()}. Reading: {escape(str(report.reading))}. "
        "Ω is the excitation frequency; everything is non-dimensional.</p>",
        f"<nav>{links}</nav>",
        *(_section(report, figure) for figure in report.figures),
    ]
    if report.checked:
        counts = f"<p>{_counts(report.checked)}.</p>"
        body.append(f'<section id="claims"><h2>All claims</h2>{counts}{_table(report.checked)}</section>')
    return _HTML.format(style=_STYLE, body="\n".join(body))


def _section(report: Report, figure: Figure) -> str:
    results = {job.key: report.results[job.key] for job in figure.jobs if job.key in report.results}
    failures = {job.key: report.failures[job.key] for job in figure.jobs if job.key in report.failures}
    pictures = report.pictures.get(figure.name, ())
    body = [
        f'<section id="figure-{figure.name}">',
        f"<h2>Figure {figure.name}</h2>",
        f"<p>{escape(figure.caption)}</p>",
    ]
    body += [f'<p class="bad">{escape(key)}: {escape(text)}</p>' for key, text in failures.items()]
    body += [f'<p class="soft">Set {escape(name)}: {escape(note)}</p>' for name, note in figure.notes.items()]
    if pictures:
        body.append(f'<a href="{pictures[0]}"><img src="{pictures[0]}" alt="{escape(figure.caption)}"></a>')
        files = ", ".join(f'<a href="{name}">{name.rpartition(".")[2].upper()}</a>' for name in pictures)
        data = ", ".join(f'<a href="results/{key}.gapwalk">{key}</a>' for key in results)
        body.append(f'<p class="soft">Picture: {files}.{f" Results: {data}." if data else ""}</p>')
    body += [_special_points(key, result) for key, result in results.items() if result.branches]
    if about := report.about(figure):
        body.append(_table(about))
    return "\n".join([*body, "</section>"])


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
        f'<td class="{_CLASS[outcome.verdict]}">{escape(str(outcome))}</td><td>{escape(outcome.evidence)}</td></tr>'
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

    python -m reproductions.padmanabhan_singh_1995 --claims docs/explanation/paper.md

The tests compare its verdicts with those of the checks. The parameters are those of the tables in the paper. Some of
them have two readings (slope of the second stage: reduced or literal; impact damping: dissipative or as printed). The
default is reduced and dissipative; the verdict names any other reading. Nothing is tuned. If the printed numbers do not
give what the paper describes, the evidence reports what they give, and where the nearest motion is that agrees with the
paper.
"""


def claims_page(checked: Checked) -> str:
    """Return the claims in Markdown, for the documentation: a count of verdicts, then a table for each figure."""
    text = [_HEAD, f"{_counts(checked)}."]
    for figure in dict.fromkeys(claim.figure for claim, _ in checked):
        text += ["", f"## {figure.capitalize() if figure.isalpha() else f'Figure {figure}'}", ""]
        text += ["| claim | the paper | verdict | evidence |", "|---|---|---|---|"]
        for claim, outcome in checked:
            if claim.figure == figure:
                says, evidence = (cell.replace("|", "\\|") for cell in (claim.says, outcome.evidence))
                text.append(f"| {claim.name} | {says} | **{outcome}** | {evidence} |")
    return "\n".join(text) + "\n"


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


def _loop_document(loop: gw.analysis.Hysteresis) -> dict[str, Any]:
    return {"loss": loop.loss, "deflection": loop.deflection.tolist(), "force": loop.force.tolist()}


def _claim_document(claim: Claim, outcome: Outcome) -> dict[str, Any]:
    return {
        "claim": claim.name,
        "says": claim.says,
        "verdict": outcome.verdict.value,
        "reading": outcome.reading or None,
        "evidence": outcome.evidence,
    }
