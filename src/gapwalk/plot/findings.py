"""The pictures of what studies without branches find, by the kind of finding."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

from gapwalk.errors import ModelError
from gapwalk.plot.basins import draw_basins
from gapwalk.plot.family import draw_family
from gapwalk.plot.regimes import draw_regimes
from gapwalk.plot.settled import SIZE as SETTLED_SIZE
from gapwalk.plot.settled import plot_settled
from gapwalk.plot.sheet import new_sheet
from gapwalk.plot.style import in_style
from gapwalk.plot.sweep import draw_sweep
from gapwalk.study.basins.finding import BasinFinding
from gapwalk.study.family.finding import FamilyFinding
from gapwalk.study.finding import Finding
from gapwalk.study.options import BranchOptions, StudyOptions
from gapwalk.study.regimes.finding import RegimeFinding
from gapwalk.study.settle.finding import SettleFinding
from gapwalk.study.sweep.finding import SweepFinding
from gapwalk.study.sweep.study_options import SweepStudyOptions


def draw_finding(finding: Finding, options: StudyOptions, title: str) -> Figure:
    """The picture of what a study has found; a ModelError if there is nothing yet."""
    if not finding.can_be_drawn:
        raise ModelError(f"there is nothing to draw: {'; '.join(finding.failures) or finding.stored}")
    return _DRAWERS[type(finding)](finding, options, title)


def _draw_settled(finding: SettleFinding, options: StudyOptions, title: str) -> Figure:
    with in_style():
        figure = new_sheet(SETTLED_SIZE)
    asked = finding.options
    plot_settled(
        finding.attractor, asked.signal, phase=asked.phase, title=title.replace("$", r"\$") or None, figure=figure
    )
    return figure


def _draw_sweep(finding: SweepFinding, options: StudyOptions, title: str) -> Figure:
    assert isinstance(options, SweepStudyOptions)
    return draw_sweep(finding.sweep, options.signal, title)


def _draw_basins(finding: BasinFinding, options: StudyOptions, title: str) -> Figure:
    assert finding.basins is not None
    return draw_basins(finding.basins, title)


def _draw_regimes(finding: RegimeFinding, options: StudyOptions, title: str) -> Figure:
    return draw_regimes(finding.regimes, title)


def _draw_family(finding: FamilyFinding, options: StudyOptions, title: str) -> Figure:
    assert isinstance(options, BranchOptions)
    return draw_family(finding.family, options.measure, title)


_DRAWERS: dict[type[Finding], Callable[[Any, StudyOptions, str], Figure]] = {
    FamilyFinding: _draw_family,
    SettleFinding: _draw_settled,
    SweepFinding: _draw_sweep,
    BasinFinding: _draw_basins,
    RegimeFinding: _draw_regimes,
}
