"""The claims as a page of the docs."""

from __future__ import annotations

from collections import Counter

from reproductions.padmanabhan_singh_1995.claims import Verdict
from reproductions.padmanabhan_singh_1995.document import Checked

_HEAD = """\
# The paper, claim by claim

What C. Padmanabhan and R. Singh say in "Dynamics of a piecewise non-linear system subject to dual harmonic excitation
using parametric continuation" (Journal of Sound and Vibration 184(5), 767-799, 1995), each statement as a check on what
gapwalk computes. This page is written by

    gapwalk paper --claims docs/paper.md

and the tests compare its verdicts with those of the checks. Parameters are those of the tables that the paper prints;
where two readings are possible (slope of the second stage: reduced or literal; impact damping: dissipative or as
printed), the verdict names the reading if it is not the default, reduced and dissipative. Nothing is tuned: where the
printed numbers do not give what is described, the evidence says what they give, and where the nearest motion is that
does it.
"""


def claims_page(checked: Checked) -> str:
    """The page in Markdown: a count of verdicts, then a table for each figure."""
    counts = Counter(outcome.verdict for _, outcome in checked)
    lines = [_HEAD, "; ".join(f"{counts[verdict]} {verdict.value}" for verdict in Verdict if counts[verdict]) + "."]
    figures = dict.fromkeys(claim.figure for claim, _ in checked)
    for figure in figures:
        lines += ["", f"## {figure.capitalize() if figure.isalpha() else f'Figure {figure}'}", ""]
        lines += ["| claim | the paper | verdict | evidence |", "|---|---|---|---|"]
        lines += [
            f"| {claim.name} | {_cell(claim.says)} | **{outcome}** | {_cell(outcome.evidence)} |"
            for claim, outcome in checked
            if claim.figure == figure
        ]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
