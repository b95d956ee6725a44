"""The page of the report folder: pictures, captions, readings, special points and claims, without scripts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape

from gapwalk.bifurcation.branch import Branch, Kind
from gapwalk.paper.claims import Verdict
from gapwalk.paper.document import Checked, notes
from gapwalk.paper.figure import Figure
from gapwalk.paper.reading import Reading
from gapwalk.study.result import Result

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


def report_page(
    figures: Sequence[Figure],
    results: Mapping[str, Result],
    failures: Mapping[str, str],
    pictures: Mapping[str, Sequence[str]],
    checked: Checked,
    reading: Reading,
) -> str:
    """The page, which needs no network: pictures stand beside it.

    Parameters
    ----------
    figures
        The figures in their order.
    results, failures
        Results of jobs, and why a job has none, by their keys.
    pictures
        Names of the picture files of each figure, the first for the page itself.
    checked
        The claims; may be empty.
    reading
        How the paper was read.
    """
    links = " ".join(f'<a href="#figure-{figure.name}">{figure.name}</a>' for figure in figures)
    links += ' <a href="#claims">claims</a>' if checked else ""
    body = [
        "<h1>Padmanabhan and Singh (1995), figure by figure</h1>",
        f'<p class="soft">Journal of Sound and Vibration 184(5), 767–799. Computed with {_versions(results)}. '
        f"Reading: {escape(str(reading))}. Ω is the excitation frequency; everything is non-dimensional.</p>",
        f"<nav>{links}</nav>",
    ]
    for figure in figures:
        about = [each for each in checked if each[0].figure == str(figure.number)]
        body.append(_figure(figure, results, failures, pictures.get(figure.name, ()), about))
    if checked:
        body.append(_claims(checked))
    return _HTML.format(style=_STYLE, body="\n".join(body))


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


def _figure(
    figure: Figure,
    results: Mapping[str, Result],
    failures: Mapping[str, str],
    pictures: Sequence[str],
    about: Checked,
) -> str:
    lines = [f'<section id="figure-{figure.name}">', f"<h2>Figure {figure.name}</h2>"]
    lines.append(f"<p>{escape(figure.caption)}</p>")
    lines += [f'<p class="bad">{escape(key)}: {escape(failures[key])}</p>' for key in figure.jobs if key in failures]
    lines += [f'<p class="soft">Set {escape(name)}: {escape(note)}</p>' for name, note in notes(figure).items()]
    if pictures:
        lines.append(f'<a href="{pictures[0]}"><img src="{pictures[0]}" alt="{escape(figure.caption)}"></a>')
        others = ", ".join(f'<a href="{name}">{name.rpartition(".")[2].upper()}</a>' for name in pictures)
        data = ", ".join(f'<a href="results/{key}.gapwalk">{key}</a>' for key in figure.jobs if key in results)
        lines.append(f'<p class="soft">Picture: {others}.{f" Results: {data}." if data else ""}</p>')
    lines += [_specials(key, results[key]) for key in figure.jobs if key in results and results[key].branches]
    if about:
        lines.append(_table(about))
    return "\n".join([*lines, "</section>"])


def _specials(key: str, result: Result) -> str:
    """The special points of the motions of the shortest periods, folded away."""
    rows = []
    for name, branch in zip(result.names, result.branches, strict=True):
        for kind in Kind:
            found = branch.special(kind)
            if found and kind is not Kind.GRAZING:
                values = ", ".join(f"{special.value:.6f}" for special in found)
                rows.append(f'<tr><td>{name}</td><td>{kind.value}</td><td class="number">{_breaks(values)}</td></tr>')
    count = sum(_count(branch) for branch in result.branches)
    head = f"{escape(key)}: {len(result.branches)} branches, {count} special points"
    return (
        f'<details><summary>{head}</summary><div class="wide"><table><tr><th>branch</th><th>kind</th>'
        f"<th>at</th></tr>{''.join(rows)}</table></div></details>"
    )


def _count(branch: Branch) -> int:
    return sum(special.kind is not Kind.GRAZING for special in branch.special_points)


def _breaks(text: str) -> str:
    """A long list of numbers that may be broken between them."""
    return text.replace(", ", ",<wbr> ")


def _claims(checked: Checked) -> str:
    counts = Counter(outcome.verdict for _, outcome in checked)
    text = "; ".join(f"{counts[verdict]} {verdict.value}" for verdict in Verdict if counts[verdict])
    return f'<section id="claims"><h2>All claims</h2><p>{text}.</p>{_table(checked)}</section>'


def _table(checked: Checked) -> str:
    rows = "".join(
        f"<tr><td>{escape(claim.name)}</td><td>{escape(claim.says)}</td>"
        f'<td class="{_CLASS[outcome.verdict]}">{escape(str(outcome))}</td><td>{escape(outcome.evidence)}</td></tr>'
        for claim, outcome in checked
    )
    head = "<tr><th>claim</th><th>the paper</th><th>verdict</th><th>evidence</th></tr>"
    return f'<div class="wide"><table>{head}{rows}</table></div>'


def _versions(results: Mapping[str, Result]) -> str:
    written_by = {result.versions["gapwalk"] for result in results.values()}
    return f"gapwalk {', '.join(sorted(written_by))}" if written_by else "gapwalk"
