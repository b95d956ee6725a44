"""What a run has found, written down: the page in HTML, a summary in Markdown for the documentation, and JSON."""

from __future__ import annotations

import base64
import re
import textwrap
from collections.abc import Mapping, Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.claims import CLAIMS, Claim, Outcome, Trade, Verdict, counts
from reproductions.padmanabhan_singh_1995.figures import Figure
from reproductions.padmanabhan_singh_1995.jobs import CHANGES
from reproductions.padmanabhan_singh_1995.panels import (
    PERIODS,
    ForceLoop,
    History,
    Hysteresis,
    Loops,
    Panel,
    Response,
    Torque,
)
from reproductions.padmanabhan_singh_1995.quantities import LOOPS, counted
from reproductions.padmanabhan_singh_1995.report import Report
from reproductions.padmanabhan_singh_1995.tables import demands
from reproductions.padmanabhan_singh_1995.today import CHECKED, EXPONENTS, FIFTY, exponents

_DEMANDS = (
    "Equations 10 and 11 of the paper make the eight numbers K and C of each row from few: three inertias, two "
    "stiffnesses, two dampers and the ratio of the widths bc; equation 14 makes both mean loads from one torque. So "
    "some ratios are the same in every row, whatever the machine is. The printed rows do not keep them. So no single "
    "machine has the numbers of all rows, and where a figure is met only with numbers of another row, that says "
    "nothing against the method."
)

_MACHINE = (
    "<b>The machine that keeps them.</b> With equal widths bc, I1 = 1.5 I2 and I3 = 1.2 I2 one machine has the "
    "stiffnesses of rows 12 to 22, 27 and 28 exactly; its C21 is 0.024, its C12 0.0327, its Tm2 Tm1/0.8. Built in kg "
    "m² and N m, it has the special points of the non-dimensional equations to four digits. With it "
    "no open statement holds: that the tables contradict each other is not the cause."
)

Checked = Sequence[tuple[Claim, Outcome]]
"""Claims, and what their checks have come to."""

_STYLE = """
:root { color-scheme: light dark; --ink: #1b1c1e; --page: #f6f5f1; --soft: #5d5f63; --line: #dcdad2; --card: #ffffff;
  --fact: #8e3b8e; --link: #0b56a4; --c0: #00694a; --c1: #4c8f2f; --c2: #0b62b5; --c3: #6b46b0; --c4: #a23c92;
  --c5: #8a6200; --c6: #b3300c; --c7: #5d5f63; --c8: #6a6d72; }
@media (prefers-color-scheme: dark) { :root { --ink: #e7e6e1; --page: #131416; --soft: #a3a5a8; --line: #34363a;
  --card: #1c1e21; --fact: #dd9be0; --link: #7db9f3; --c0: #3ec296; --c1: #93cf6c; --c2: #74b4f2; --c3: #b9a0f0;
  --c4: #ea97d5; --c5: #dfb74c; --c6: #f58b6a; --c7: #b8babd; --c8: #a3a5a8; }
  img, .legend svg { filter: invert(0.9) hue-rotate(180deg); } }
* { box-sizing: border-box; } html { scroll-behavior: smooth; }
body { margin: 0 auto; max-width: 80rem; padding: 1.6rem 1.5rem 3rem; color: var(--ink); background: var(--page);
  font: 16px/1.5 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 .4rem; letter-spacing: -.01em; }
h2 { font-size: 1.2rem; line-height: 1.3; margin: 0 0 .4rem; } h3 { font-size: 1rem; margin: 1rem 0 .3rem; }
h2 a { color: inherit; text-decoration: none; }
a { color: var(--link); } p { margin: .45rem 0; max-width: 52rem; }
code { font: .86em ui-monospace, Menlo, Consolas, monospace; background: var(--page); border-radius: 4px;
  padding: .1em .35em; overflow-wrap: anywhere; }
.name { color: var(--own); } .lead { font-size: 1.1rem; } .soft { color: var(--soft); font-size: .88rem; }
section, article { background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  padding: 1.1rem 1.3rem; margin: 0 0 1.2rem; } [id] { scroll-margin-top: 4rem; }
article > p { margin-top: 0; }
.c0 { --own: var(--c0); } .c1 { --own: var(--c1); } .c2 { --own: var(--c2); } .c3 { --own: var(--c3); }
.c4 { --own: var(--c4); } .c5 { --own: var(--c5); } .c6 { --own: var(--c6); } .c7 { --own: var(--c7); }
.c8 { --own: var(--c8); }
.bar { display: flex; gap: 2px; margin: 1rem 0 .8rem; border-radius: 7px; overflow: hidden; }
.bar span { background: var(--own); color: var(--card); font-weight: 700; text-align: center; padding: .35rem 0;
  min-width: 1.5rem; flex-basis: 0; }
.classes { display: grid; grid-template-columns: repeat(auto-fill, minmax(17rem, 1fr)); gap: .55rem 1.4rem;
  margin: 0; padding: 0; list-style: none; font-size: .9rem; line-height: 1.4; }
.classes li { border-left: 5px solid var(--own); padding-left: .6rem; } .classes b { color: var(--own); }
.failing { margin: .3rem 0; padding: 0; list-style: none; columns: 2; column-gap: 2rem; font-size: .92rem; }
.failing li { break-inside: avoid; padding: .25rem 0 .35rem; border-top: 1px solid var(--line); line-height: 1.4; }
.failing .numbers { display: block; font-size: .8rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(11.4rem, 1fr)); gap: .8rem;
  margin: 0 0 1.2rem; }
.figures article { margin: 0; padding: .6rem .7rem; } .figures article > details { margin: 0; font-size: 1rem; }
.figures article:has(> details[open]) { grid-column: 1 / -1; padding: 1.1rem 1.3rem; }
.figures article > details > summary { color: var(--ink); font-size: .95rem; font-weight: 600; }
.figures summary img { display: block; width: 100%; height: auto; aspect-ratio: 5 / 4; object-fit: contain;
  background: #fff; border-radius: 4px; margin: .35rem 0; }
.figures details[open] > summary img { display: none; }
.figures article > details[open] > summary { font-size: 1.2rem; position: sticky; top: 0; z-index: 2;
  background: var(--card); padding: .5rem 0; }
.marks { display: flex; gap: 2px; height: 7px; } .marks b { flex: 1; background: var(--own); border-radius: 2px;
  max-width: 1.6rem; } section > details > summary h2 { display: inline; color: var(--ink); }
section > details { font-size: 1rem; margin: 0; }
.card { display: grid; grid-template-columns: minmax(0, 1.75fr) minmax(0, 1fr); gap: 0 1.6rem; align-items: start; }
.card.alone { grid-template-columns: minmax(0, 1fr); }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(18rem, 100%), 1fr)); gap: .8rem 1rem; }
figure { margin: 0; min-width: 0; max-width: 27rem; }
figure img { display: block; width: 100%; height: auto; border-radius: 4px; background: #fff; }
figcaption { font-size: .85rem; line-height: 1.35; margin: 0 0 .25rem; min-height: 2.7em; display: flex; gap: .4rem;
  align-items: flex-end; flex-wrap: wrap; align-content: flex-end; }
figcaption .at { border: 1px solid currentColor; border-radius: 20px; padding: 0 .5rem; font-size: .76rem;
  color: var(--c3); white-space: normal; }
.legend { display: flex; flex-wrap: wrap; gap: .1rem 1rem; font-size: .78rem; color: var(--soft); margin: .6rem 0 0; }
.legend span { display: inline-flex; align-items: center; gap: .35rem; }
.legend svg { width: 30px; height: 10px; flex: none; overflow: visible; fill: none; color: #000; } .open { fill: #fff; }
.fact { color: var(--fact); }
ul.claims { list-style: none; margin: 0; padding: 0; font-size: .92rem; line-height: 1.42; }
ul.claims li { border-left: 4px solid var(--own); padding: 0 0 0 .75rem; margin: 0 0 1rem; }
.chip { display: inline-block; background: var(--own); color: var(--card); border-radius: 20px; padding: .02rem .6rem;
  font-size: .78rem; font-weight: 600; margin: .15rem .3rem .1rem 0; }
.numbers { color: var(--soft); font-size: .86rem; font-variant-numeric: tabular-nums; }
summary { cursor: pointer; color: var(--soft); font-size: .84rem; } details { margin: .15rem 0; font-size: .86rem;
  overflow-wrap: anywhere; } details p { margin: .3rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .87rem; } .wide { overflow-x: auto; }
th, td { text-align: left; vertical-align: top; padding: .35rem .8rem .35rem 0; border-top: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; border-top: 0; } td.number { font-variant-numeric: tabular-nums; }
td::before { display: none; }
@media (max-width: 62rem) { .card { grid-template-columns: minmax(0, 1fr); }
  .card > div + div { order: -1; } }
@media (max-width: 34rem) { body { padding: .9rem .7rem 2rem; } section, article { padding: .9rem .85rem; }
  h1 { font-size: 1.35rem; } .lead { font-size: .95rem; line-height: 1.35; }
  .bar { margin: .6rem 0 .4rem; } .failing { columns: 1; font-size: .88rem; } .failing .numbers { display: inline; }
  .figures { grid-template-columns: repeat(2, 1fr); gap: .5rem; } .figures article { padding: .45rem .5rem; }
  .figures article:has(> details[open]) { padding: .7rem .6rem; }
  .classes { grid-template-columns: 1fr; } figcaption { min-height: 0; }
  tr, td { display: block; } tr:first-child { display: none; }
  tr { border-top: 1px solid var(--line); padding: .4rem 0; }
  td { border: 0; padding: .1rem 0; } td::before { display: block; content: attr(data-label); color: var(--soft);
  font-size: .78rem; } }
@media print { :root { --page: #fff; --card: #fff; } body { max-width: none; padding: 0; font-size: 10.5pt; }
  .go, .figures summary img { display: none; } details::details-content { content-visibility: visible; display: block; }
  .figures { display: block; } section, article { border: 0; border-top: 1px solid #999; border-radius: 0;
  padding: .6rem 0; } figure, ul.claims li, tr { break-inside: avoid; } h2 { break-after: avoid; }
  .card { grid-template-columns: 1fr; } .card > div + div { order: 0; margin-top: .6rem; } ul.claims { columns: 2; }
  .pictures { grid-template-columns: repeat(3, 1fr); }
  .bar span, .chip { print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
"""

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

_SAMPLES = {
    "stable": ("stable", '<path d="M0 5H30" stroke="#000" stroke-width="2.2"/>'),
    "flip": (
        "unstable, a multiplier beyond −1 (open triangles on it)",
        '<path d="M0 5H30" stroke="#D55E00" stroke-width="1.6" stroke-dasharray="6 2"/>'
        '<path d="M15 1.5L18.5 8H11.5Z" stroke="#D55E00" class="open"/>',
    ),
    "fold": (
        "unstable, beyond +1 (open squares)",
        '<path d="M0 5H30" stroke="#0072B2" stroke-width="1.8" stroke-dasharray="2 2"/>'
        '<path d="M12 2H18V8H12Z" stroke="#0072B2" class="open"/>',
    ),
    "pair": (
        "unstable, a complex pair, the paper's Hopf (open circles)",
        '<path d="M0 5H30" stroke="#009E73" stroke-width="1.7" stroke-dasharray="8 2 2 2"/>'
        '<circle cx="15" cy="5" r="3.2" stroke="#009E73" class="open"/>',
    ),
    "special": (
        "fold, flip, Hopf (complex pair): where stability changes",
        '<circle cx="4" cy="5" r="3.4" fill="#0072B2"/><path d="M15 1L19 5L15 9L11 5Z" fill="#D55E00"/>'
        '<path d="M26 .5L27.2 3.8H30L27.8 5.8L28.6 9.2L26 7.2L23.4 9.2L24.2 5.8L22 3.8H24.8Z" fill="#009E73"/>',
    ),
    "number": (
        "so many of these points in one place",
        '<circle cx="15" cy="5" r="4.4" stroke="#6f6f6f" class="open"/>'
        '<text x="15" y="7.4" font-size="7" text-anchor="middle" fill="currentColor">3</text>',
    ),
    "tick": ("a contact is just touched", '<path d="M13 9L17 1" stroke="#6f6f6f" stroke-width="1.4"/>'),
    2: ("stable, period 2", f'<path d="M0 5H30" stroke="{PERIODS[2][0]}" stroke-width="2.2"/>'),
    4: ("stable, period 4", f'<path d="M0 5H30" stroke="{PERIODS[4][0]}" stroke-width="2.2"/>'),
    "gap": ("the ends of the gap, q1 = ±1", '<path d="M0 5H30" stroke="#6f6f6f" stroke-dasharray="4 2"/>'),
    "birth": (
        "a longer period begins",
        '<path d="M15 1L19 5L15 9L11 5Z" stroke="currentColor" class="open"/>',
    ),
    "star": (
        "on a longer period, a complex pair leaves the unit circle",
        '<path d="M15 .5L16.2 3.8H19L16.8 5.8L17.6 9.2L15 7.2L12.4 9.2L13.2 5.8L11 3.8H13.8Z" fill="#009E73"/>',
    ),
}
"""Entries of legends: the words, and a sample 30 wide and 10 high."""


def _legend(figure: Figure, known: Mapping[str, gw.Result]) -> str:
    """The lines and symbols that the pictures have, once for each card."""
    panels, kinds = figure.panels, _kinds_of(figure, known)
    longest = max((panel.most for panel in panels if isinstance(panel, Loops)), default=1)
    has_response = any(isinstance(panel, Response) for panel in panels)
    names: list[str | int] = []
    if has_response or longest > 1:
        names = ["stable", *(period for period in PERIODS if period <= longest), *kinds]
    names += ["special", "number", "tick"] if has_response else []
    names += ["birth", "star"] if longest > 1 else []
    names += ["gap"] if any(isinstance(panel, ForceLoop | Torque) or _shows_gap(panel) for panel in panels) else []
    shown = [
        f'<span><svg viewBox="0 0 30 10" aria-hidden="true">{_SAMPLES[name][1]}</svg>{_SAMPLES[name][0]}</span>'
        for name in names
    ]
    if any(panel.facts for panel in panels):
        shown.append('<span class="fact">▬ what the paper says</span>')
    return f'<div class="legend">{"".join(shown)}</div>' if shown else ""


def _shows_gap(panel: Panel) -> bool:
    return isinstance(panel, History) and panel.signal == "q1"


def _kinds_of(figure: Figure, known: Mapping[str, gw.Result]) -> list[str]:
    """The kinds of instability that the pictures of branches have; all of them where results are missing."""
    found = set[str]()
    for panel in (each for each in figure.panels if isinstance(each, Response | Loops)):
        for job in figure.jobs_of(panel):
            if job.key not in known:
                return ["flip", "fold", "pair"]
            longest = panel.most if isinstance(panel, Loops) else 1
            low, high = panel.within or (-np.inf, np.inf)
            found |= {
                kind
                for branch in known[job.key].branches
                if branch.period <= longest
                for point in branch.points
                if low <= point.value <= high
                for kind, count in zip(("flip", "fold", "pair"), _counts_of(point.instability), strict=True)
                if count
            }
    return [kind for kind in ("flip", "fold", "pair") if kind in found]


def _counts_of(instability: Any) -> tuple[int, int, int]:
    return instability.below, instability.above, instability.pairs


_COLOUR = {verdict: f"c{place}" for place, verdict in enumerate(Verdict)}


def html_page(report: Report, folder: Path | None = None) -> str:
    """Return the page: what agrees at a glance, then a card for each figure. It is one file without any script.

    Pictures of the report are read from the folder, and become part of the page.
    """
    of_paper = [figure for figure in report.figures if figure.number]
    whole = len(of_paper) > 1
    shown = {str(figure.number) for figure in of_paper}
    rest = [each for each in report.checked if each[0].figure not in shown]
    versions = {result.versions["gapwalk"] for result in report.results.values()}
    made = " ".join(["gapwalk", ", ".join(sorted(versions))]).strip()
    body = [
        "<h1>Padmanabhan and Singh (1995), figure by figure</h1>",
        _head(report) if report.checked else "",
        _section("tables", "What the tables demand of each other", _tables(report)) if whole else "",
        f'<div class="figures">{"".join(_card(report, figure, folder, whole) for figure in of_paper)}</div>',
        _folded("summary", "The paper's summary", _claims(rest), rest) if rest else "",
        _folded("numbers", "What another number gains and costs", _numbers(report.trades)) if report.trades else "",
        _today(report, folder) if len(of_paper) < len(report.figures) else "",
        _folded("checked", "What it was checked against", _rows(("by", "what", "agreement"), CHECKED)) if whole else "",
        f'<p class="soft">Computed with {made} ({escape(str(report.reading))}). C. Padmanabhan and R. Singh, Journal '
        "of Sound and Vibration 184(5), 767–799, 1995. Ω is the excitation frequency; everything is non-dimensional. "
        "Nothing printed is changed in silence: each picture says at which numbers it is drawn. The page is one file "
        "without scripts, and needs no network.</p>",
    ]
    return _HTML.format(style=_STYLE, body="\n".join(filter(None, body)))


def _section(name: str, title: str, content: str) -> str:
    return f'<section id="{name}"><h2>{title}</h2>{content}</section>'


def _folded(name: str, title: str, content: str, about: Checked = ()) -> str:
    """A section that is opened by a click, with the marks of the statements in it."""
    return (
        f'<section><details><summary><h2>{title}</h2>{_marks(about)}</summary><div id="{name}">{content}</div>'
        "</details></section>"
    )


def _marks(about: Checked) -> str:
    """A mark for each statement in the colour of its class."""
    marks = "".join(
        f'<b class="{_COLOUR[each.verdict]}" title="{claim.name}: {each.verdict}"></b>' for claim, each in about
    )
    return f'<span class="marks">{marks}</span>' if marks else ""


def _head(report: Report) -> str:
    """Give the first screen: counts in a sentence and a bar, failing statements with reasons, and the folded rules."""
    found = counts([outcome for _, outcome in report.checked])
    classes = [(verdict, count) for verdict, count in found.classes.items() if count]
    bar = "".join(
        f'<span class="{_COLOUR[each]}" style="flex-grow: {count}" title="{escape(each.value)}">{count}</span>'
        for each, count in classes
    )
    names = " · ".join(f'<b class="{_COLOUR[each]} name">{count} {escape(each.value)}</b>' for each, count in classes)
    rules = "".join(
        f'<li class="{_COLOUR[each]}"><b>{count} {escape(each.value)}</b><br>{escape(each.rule)}</li>'
        for each, count in classes
    )
    if found.elsewhere:
        words = f"<b>{found.elsewhere} {Verdict.ELSEWHERE}, not counted</b><br>{escape(Verdict.ELSEWHERE.rule)}"
        rules += f'<li class="{_COLOUR[Verdict.ELSEWHERE]}">{words}</li>'
    return (
        f'<section id="summary-of-all"><p class="lead">{_lead(found)}</p><div class="bar">{bar}</div>'
        f'<p class="soft">{names}</p>{_failing(report.checked)}{_agree(report)}'
        f'<details><summary>What the classes mean</summary><ul class="classes">{rules}</ul></details>'
        f"<details><summary>What the words mean</summary>{_WORDS}</details></section>"
    )


_WORDS = "".join(
    f"<p><b>{word}</b> {meaning}</p>"
    for word, meaning in (
        ("P1, P3", "motions that repeat after 1, 3 periods of the excitation."),
        ("torus, 3 × torus", "a quasi-periodic motion: its section is one closed curve, or 3 of them."),
        ("flip, fold, Hopf", "a multiplier leaves the unit circle through −1, through +1, or as a complex pair."),
        ("κ", "stiffness of the clutch's first stage over that of its second, K1/Kb; K11 in the tables."),
        (
            "4+/1−, (+, − side)",
            "counts on the side where q1 &gt; 1, and where q1 &lt; −1, in one period of the motion.",
        ),
        ("slope literal", "the second stage has the slope 1 − κ, as the formula is printed; by default 1."),
        ("damping as printed", "f = g (1 + β q1'), as printed; by default g + β |g| q1'."),
        ("set of figure 9a, row of figure 5", "the numbers of the tables for that figure; figure 14 has those of 9a."),
    )
)


def _lead(found: Any) -> str:
    """Say in one sentence what agrees and what does not."""
    number = found.classes
    changed = number[Verdict.OTHER_NUMBER] + number[Verdict.OTHER_NUMBERS]
    return (
        f"Of {found.statements} statements of the paper, <b>{number[Verdict.LETTER]} hold</b> at the printed numbers "
        f"and <b>{number[Verdict.KIND]} partly</b>, {number[Verdict.OTHER_READING]} with a formula as printed, "
        f"<b>{changed}</b> with other numbers in the tables. <b>{number[Verdict.EXPLAINED]}</b> do not hold, and one "
        f"can see why; <b>{number[Verdict.NOT_FOUND]}</b> were not found; {number[Verdict.LOST]} cannot be tested."
    )


def _agree(report: Report) -> str:
    """Name the figures about which everything holds."""
    whole = [
        f'<a href="#figure-{figure.name}">{figure.name}</a>'
        for figure in report.figures
        if (about := report.about(figure)) and all(outcome.verdict in HOLDS for _, outcome in about)
    ]
    if not whole:
        return ""
    alone = [figure for figure in report.figures if figure.number and not report.about(figure)]
    links = ", ".join(f'<a href="#figure-{figure.name}">{figure.name}</a>' for figure in alone)
    return f"<p><b>All statements hold, to the letter or in kind,</b> about figures {', '.join(whole)}." + (
        f" No statement is about figures {links} alone.</p>" if alone else "</p>"
    )


def _failing(checked: Checked) -> str:
    """Say what does not hold as printed, and why, in a few groups."""
    names = {claim.name for claim, outcome in checked if outcome.verdict not in HOLDS}
    items = "".join(
        f'<li>{text} <span class="numbers">{_links(shown)}</span></li>'
        for text, *about in FAILING
        if (shown := [name for name in about if name in names])
    )
    if not items:
        return ""
    return (
        f'<p><b>What does not hold as printed, and why.</b></p><ul class="failing">{items}</ul>'
        "<p>Two formulas are not taken as printed, unless a verdict says so: the slope of the second stage is 1, as "
        "the tables' n has the factor 1 − K1/Kb already; and impact damping takes energy on both sides, where the "
        "printed sign feeds it in on one, so that motions run away.</p>"
    )


SHARED = {"18": ("17-sequence", "17-elsewhere"), "19": ("17-sequence", "17-elsewhere"), "24": ("25-peaks", "25-lower")}
"""Statements on several figures, by the figures whose cards have none of their own."""

HOLDS = (Verdict.LETTER, Verdict.KIND, Verdict.ELSEWHERE)
"""Classes of what holds at the printed numbers, and of what is no statement of the paper."""

FAILING = (
    (
        "<b>Figures 4 and 10:</b> with the printed β = 0.075 the two models differ beyond the first resonance, and "
        "the flips of 10b stay. With β = 0.049, which the paper's own rule gives, figure 4 holds; figure 10 needs 0.1.",
        "4-flips",
        "4-beyond",
        "10-gone",
    ),
    (
        "<b>Figures 5 to 7:</b> at the printed loads the contact never opens at Ω = 0.17. With Te1 = 0.37 in place of "
        "0.25 it does; four impacts and then one occur only about 0.338; no broad band is found.",
        "5-double",
        "5-harmonics",
        "6-single",
        "6-weaker",
        "6-broadband",
        "7-differ",
        "7-spectra",
    ),
    (
        "<b>Figures 17 to 19:</b> at Ω = 0.63, 0.634 and 0.636 there is period 1 only. Without the first stage (K11 = "
        "0) there are period 3 and chaos, but no torus.",
        "17-sequence",
    ),
    (
        "<b>Figure 27, 0.3 ≤ Te1 ≤ 0.45:</b> this range is not empty. A branch of period 1 runs through it, stable "
        "over most of it; Newton's method seldom converges there.",
        "27-nothing",
        "27-aperiodic",
    ),
    (
        "<b>Figures 27 and 28:</b> the quasi-periodic ranges and the overlap of the loops need C11 = C21 = 0.025, "
        "where 0.04 is printed.",
        "27-beats",
        "28-overlap",
    ),
    (
        "<b>Figures 12 and 14:</b> one statement each needs a formula as printed: the damping in 12, the slope in 14.",
        "12-beats",
        "14-jump",
    ),
    (
        "<b>Figures 8 and 11:</b> the measured curve of 8 is not printed as numbers, and K12 of 11 cannot be read in "
        "our copy. With three other numbers in its row three statements about 11 hold, one partly.",
        "8-record",
        "11-spacing",
        "11-second",
        "11-beats",
        "11-stable",
        "11-tori",
    ),
    (
        "<b>Too general:</b> some statements are true only of the start of a motion (figure 3), of what is drawn (13) "
        "or of one phase (23); at high Te1 period 1 is past a Hopf (complex pair), but no torus is found (29); "
        "and figure 4 has flips under a heavy load.",
        "3-impacts",
        "13-once",
        "23-others",
        "29-high",
        "summary-heavy",
    ),
)
"""Groups of statements that do not hold as printed, with the reason; each statement is in one group."""


def _card(report: Report, figure: Figure, folder: Path | None, fold: bool) -> str:
    """The card of a figure: pictures with what the paper says drawn in, and its statements; opened by a click."""
    failures = {job.key: report.failures[job.key] for job in figure.jobs if job.key in report.failures}
    results = {job.key: report.results[job.key] for job in figure.jobs if job.key in report.results}
    shown = [f'<p class="c6 chip">{escape(key)}: {escape(text)}</p>' for key, text in failures.items()]
    files = report.pictures.get(figure.name, ())
    if files:
        drawn = "".join(_figure(figure, panel, name, folder) for panel, name in zip(figure.panels, files, strict=True))
        shown.append(f'<div class="pictures">{drawn}</div>{_legend(figure, report.results)}')
    shown.append(_more(figure, results))
    about = report.about(figure)
    said, alone = (f"<div>{_claims(about)}</div>", "") if about else ("", " alone")
    if names := SHARED.get(figure.name):
        shown.insert(0, f"<p>What the paper says of it is judged in {_links(names)}.</p>")
    small = f'<img src="{_source(files[0], folder, small=True)}" alt="">' if files and fold and folder else ""
    return (
        f'<article><details{"" if fold else " open"}><summary title="{escape(figure.caption)}">Figure {figure.name}'
        f'{small}{_marks(about)}</summary><div id="figure-{figure.name}"><p>{escape(figure.caption)}</p>'
        f'<div class="card{alone}"><div>{"".join(shown)}</div>{said}</div></div></details></article>'
    )


def _figure(figure: Figure, panel: Panel, name: str, folder: Path | None) -> str:
    letter = f"<b>{panel.letter}</b> " if panel.letter else ""
    at = panel.place if panel.place.startswith("at ") or "=" not in panel.place else f"at {panel.place}"
    place = f'<span class="at">{escape(at)}</span>' if at else ""
    text = f"Figure {figure.number}{panel.letter}: {panel.title}"
    return (
        f"<figure><figcaption><span>{letter}{escape(panel.title)}</span>{place}</figcaption>"
        f'<img src="{_source(name, folder)}" alt="{escape(text)}"></figure>'
    )


def _source(name: str, folder: Path | None, *, small: bool = False) -> str:
    """Return a picture as part of the page, or a small copy of it; without its folder, its name."""
    if folder is None:
        return name
    content = (folder / name).read_bytes()
    if small:
        from PIL import Image  # matplotlib writes its pictures with it

        with Image.open(folder / name) as whole, BytesIO() as file:
            few = whole.convert("RGB")
            few.thumbnail((300, 300))
            few.quantize(16, dither=Image.Dither.NONE).save(file, "png", optimize=True)
            content = file.getvalue()
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"


def _more(figure: Figure, results: dict[str, gw.Result]) -> str:
    """Numbers of the sets, the special points, and how to open the results in the explorer; folded away."""
    branches = {key: result for key, result in results.items() if result.branches}
    parts = [
        f"<p>Set of figure {escape(name)}: {escape(note.replace('GUESS:', 'assumed:'))}</p>"
        for name, note in figure.notes.items()
    ]
    if results:
        lines = "".join(f"<p><code>gapwalk explore out/paper/results/{key}.gapwalk</code></p>" for key in results)
        parts.append(
            f"<p>After <code>make paper FIG={figure.number}</code>, in the browser, motion by motion:</p>{lines}"
        )
    parts += [_special_points(key, result) for key, result in branches.items()]
    summary = "open in the explorer, special points" if results else "notes"
    return f'<details class="go"><summary>{summary}</summary>{"".join(parts)}</details>' if parts else ""


def _claims(checked: Checked) -> str:
    """Statements with the chip of their verdict and one line of numbers; the evidence is folded."""
    return '<ul class="claims">' + "".join(_claim(*each) for each in checked) + "</ul>"


def _claim(claim: Claim, outcome: Outcome) -> str:
    name = escape(claim.name)
    costs = f'<div class="numbers">costs {_links(outcome.costs)}</div>' if outcome.costs else ""
    if outcome.at_odds:
        costs += f'<div class="numbers">another value of this number is needed by {_links(outcome.at_odds)}</div>'
    pairs = (f"{each.what}: {each.paper:g} and {each.found:.4g}, {each.off:.1%} off" for each in outcome.against)
    against = f'<div class="numbers fact">paper and here: {escape("; ".join(pairs))}</div>' if outcome.against else ""
    place = "at other numbers" if claim.apart else claim.place
    tried = "".join(f"<p>{_tried(each, place)}</p>" for each in outcome.evidence)
    known = len(outcome.evidence) == 1 and not outcome.evidence[0].details
    more = "" if known else f"<details><summary>evidence</summary>{tried}</details>"
    return (
        f'<li id="{name}" class="{_COLOUR[outcome.verdict]}">{escape(claim.says)}<br><span class="chip">'
        f'{escape(str(outcome))}</span><span class="soft">{name}</span>'
        f'<div class="numbers">{escape(outcome.line)}</div>{against}{costs}{more}</li>'
    )


def _tried(each: Any, place: str) -> str:
    """One attempt: where, whether the statement holds there, and the numbers."""
    head = f"<b>{escape(each.where or place)}, {'holds' if each.holds else 'does not hold'}:</b> "
    return head + escape(f"{each.line}; {each.details}" if each.details else each.line)


def _tables(report: Report) -> str:
    """What the tables demand of each other, the machine that keeps it, and the rule of the paper for beta."""
    ratios = [(each.relation, each.demanded, each.printed) for each in demands()]
    numbers = [reading.number for reading in (CHANGES["matched"], CHANGES["matched-light"]) if reading.number]
    (printed, heavy), (other, light) = (number.changed["β"] for number in numbers)
    rule = (
        "<b>β by the paper's own rule.</b> Its section 4 chooses β such that both damping models agree where the "
        f"response has one harmonic. That gives {heavy:.3g} in the rows of figures 3, 4 and 10, where {printed:g} is "
        f"printed, and {light:.3g} in those of figures 5 to 7, where {other:g} is printed."
    )
    trade = next((each for each in report.trades if each.candidate.reading == CHANGES["matched"]), None)
    if trade:
        rule += f" Then also holds: {_links(trade.gained)}; no longer: {_links(trade.lost)}; "
        rule += f"still not: {_links(trade.missed)}."
    table = _rows(("ratio", "demanded", "printed"), ratios)
    return f"<p>{_DEMANDS}</p>{table}<p>{_MACHINE}</p><p>{rule}</p>"


def _links(names: Sequence[str]) -> str:
    return ", ".join(f'<a href="#{escape(name)}">{escape(name)}</a>' for name in names) or "nothing"


def _numbers(trades: Sequence[Trade]) -> str:
    """What other numbers gain and cost."""
    headings = ("number", "rows", "then also holds", "ceases to hold", "still holds", "neither")
    return _rows(headings, [(trade.words, *_cells(trade)) for trade in trades]) + _RUN_AWAY


_RUN_AWAY = (
    '<p class="soft">Only statements that a change may touch are weighed. Damping as printed feeds energy in where the '
    "force is negative: motions with impacts on both sides then run away, whatever else holds.</p>"
)


def _cells(trade: Trade) -> tuple[str, ...]:
    number = trade.candidate.reading.number
    names = (", ".join(each) or "–" for each in (trade.gained, trade.lost, trade.kept, trade.missed))
    reading, known = trade.candidate.reading, [claim for claim in CLAIMS if claim.name in trade.candidate.claims]
    weighed = [job.case for claim in known for job in claim.jobs_in(reading) if job.reading == reading]
    return ", ".join(number.cases if number else dict.fromkeys(weighed)), *names


def _today(report: Report, folder: Path | None) -> str:
    """What can be seen today."""
    parts = []
    for figure in (each for each in report.figures if not each.number):
        files = report.pictures.get(figure.name, ())
        drawn = "".join(_figure(figure, *each, folder) for each in zip(figure.panels, files, strict=False))
        pictures = f'<div class="pictures">{drawn}</div>{_legend(figure, report.results)}' if drawn else ""
        parts.append(f"<h3>{escape(figure.kind)}</h3><p>{escape(figure.caption)}</p>{pictures}")
    cells = [(each.place, each.label, str(each)) for each in exponents(report.results)]
    parts.append(f"<h3>Exponents instead of the look of a section</h3><p>{EXPONENTS}</p>")
    parts.append(_rows(("motion", "kind", "largest exponent per period"), cells))
    parts.append(f"<h3>Fifty inertias</h3><p>{FIFTY}</p>")
    return _folded("today", "What one sees today", "".join(parts))


def _rows(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of texts."""
    lines = [_row(headings, [escape(cell) for cell in row]) for row in rows]
    head = f"<tr>{''.join(f'<th>{each}</th>' for each in headings)}</tr>"
    return f'<div class="wide"><table>{head}{"".join(lines)}</table></div>'


def _row(headings: Sequence[str], cells: Sequence[str]) -> str:
    """Return a row of a table; on a narrow screen each cell stands below the heading of its column."""
    pairs = zip(headings, cells, strict=True)
    return "<tr>" + "".join(f'<td data-label="{head}">{cell}</td>' for head, cell in pairs) + "</tr>"


_KINDS = {gw.Kind.NEIMARK_SACKER: "Hopf (Neimark-Sacker)"}


def _special_points(key: str, result: gw.Result) -> str:
    """The special points of all branches but for grazing points, folded away."""
    rows, count = [], 0
    for name, branch in zip(result.names, result.branches, strict=True):
        for kind in gw.Kind.known():
            found = branch.special(kind)
            if found and kind is not gw.Kind.GRAZING:
                values = ",<wbr> ".join(f"{special.value:.6f}" for special in found)
                rows.append(_row(("branch", "kind", "at"), (name, _KINDS.get(kind, kind.value), values)))
                count += len(found)
    summary = f"{escape(key)}: {counted(len(result.branches), 'branch')}, {counted(count, 'special point')}"
    table = f'<div class="wide"><table><tr><th>branch</th><th>kind</th><th>at</th></tr>{"".join(rows)}</table></div>'
    return f"<details><summary>{summary}</summary>{table}</details>"


_SUMMARY = """\
# The paper, figure by figure

This page compares C. Padmanabhan and R. Singh, "Dynamics of a piecewise non-linear system subject to dual harmonic
excitation using parametric continuation" (Journal of Sound and Vibration 184(5), 767-799, 1995), with what gapwalk
computes: all figures again, and each statement about them checked.

<a href="../_static/padmanabhan_singh_1995.html"><strong>The page with all figures and statements</strong></a> is one
file that opens offline. Its first screen says what agrees, what does not, and why; below is a small picture of each
figure, with a mark for each statement in the colour of its class. A click opens the figure: our pictures with what the
paper says drawn in, each statement with its verdict and one line of numbers, and the evidence folded.

| class | statements | rule |
|---|---|---|
{classes}

Motions that are found, but not where the paper has them ({apart}), are listed apart and never counted. The parameters
are those of the tables. Each change of a printed number is stated: pictures and verdicts say at which numbers they
hold, and a table says which statements another number gains and loses.

In brackets below are the names of the statements on that page (figure and keyword), each with its class.

## What does not hold as printed, and why

{failing}

{demands_text}

`make paper` makes the page again, into `out/paper/index.html`, and says how long that takes; `make paper FIG=13` makes
one figure. [How it was reproduced](../numerics/reproduction.md) has the readings, the search for other numbers, and the
times.
"""


def claims_page(checked: Checked) -> str:
    """Return the guide to the page for the documentation, in Markdown: the counts, and what does not hold."""
    found = counts([outcome for _, outcome in checked])
    classes = [f"| {each.value} | {count} | {each.rule} |" for each, count in found.classes.items()]
    outcomes = {claim.name: outcome for claim, outcome in checked}
    groups = []
    for text, *about in FAILING:
        verdicts = [f"{name}: {outcomes[name]}" for name in about if name in outcomes]
        words = re.sub(r"</?b>", "**", text) + f" ({'; '.join(verdicts)})"
        groups.append(textwrap.fill(f"- {words}", 118, subsequent_indent="  ", break_on_hyphens=False))
    return _SUMMARY.format(
        classes="\n".join([*classes, f"| **all** | **{found.statements}** | |"]),
        apart=found.elsewhere,
        failing="\n".join(groups),
        demands_text=textwrap.fill(_DEMANDS, 118),
    )


_COUNTED = re.compile(r"(- |)Of \d+ statements of the paper( cited below| about its figures|),[^;]*;")
_SHORT = {
    "": {Verdict.LETTER: "{} hold to the letter", Verdict.KIND: "{} hold except for some numbers"},
    "Others hold with a change: ": {
        Verdict.OTHER_READING: "{} with a formula read differently",
        Verdict.OTHER_NUMBER: "{} with one printed number changed",
        Verdict.OTHER_NUMBERS: "{} with several changed",
    },
    "Of the rest, ": {
        Verdict.EXPLAINED: "{} fail for a reason that a check shows",
        Verdict.NOT_FOUND: "{} fail without an explanation",
        Verdict.LOST: "{} cannot be tested",
    },
}


def with_counts(text: str, outcomes: Sequence[Outcome]) -> str:
    """Return a text, such as the README, with its sentence that counts the verdicts as they are.

    It begins like ``Of 79 statements of the paper,`` and ends at a semicolon.
    """
    found = counts(outcomes)
    groups = {
        head: [words.format(found.classes[each]) for each, words in group.items() if found.classes[each]]
        for head, group in _SHORT.items()
    }
    parts = ". ".join(head + ", ".join(group) for head, group in groups.items() if group)
    return _COUNTED.sub(
        lambda match: textwrap.fill(
            f"{match[1]}Of {found.statements} statements of the paper{match[2]}, {parts};",
            118,
            subsequent_indent="  " if match[1] else "",
            break_on_hyphens=False,
        ),
        text,
    )


def document(report: Report, *, whole: bool) -> Any:
    """Return plain JSON values: all figures and claims of a whole report, otherwise one figure, or a list of them."""
    figures = [_figure_document(report, figure) for figure in report.figures if figure.number]
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
                "at": panel.place or None,
                "paper": [{"says": fact.text, "from": fact.low, "to": fact.high} for fact in panel.facts],
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
        "verdict": outcome.verdict.value,
        "by": outcome.by or None,
        "numbers": outcome.line,
        "changed": {name: {"printed": a, "other": b} for name, (a, b) in outcome.changed.items()},
        "costs": list(outcome.costs),
        "at_odds": list(outcome.at_odds),
        "evidence": [
            {"where": each.where or None, "holds": each.holds, "numbers": each.line, "details": each.details or None}
            for each in outcome.evidence
        ],
    }
