"""The picture of a result, as files for reports."""

from __future__ import annotations

import os
from dataclasses import replace

from matplotlib.figure import Figure

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import ModelError
from gapwalk.measurement.alignment import Alignment
from gapwalk.plot.branch import plot_branches
from gapwalk.plot.diagram import draw_diagram
from gapwalk.plot.map import draw_map
from gapwalk.plot.sheet import new_sheet, sheet_bytes
from gapwalk.plot.size import SizeName, sized
from gapwalk.plot.style import SIZE, diagram_size, in_style, rc
from gapwalk.study.export import write_whole
from gapwalk.study.map import Map
from gapwalk.study.options import BranchOptions, StudyOptions
from gapwalk.study.result import Result


def save_picture(
    found: Result | Branch | Diagram | Map | Alignment,
    png: str | os.PathLike[str] | None = None,
    svg: str | os.PathLike[str] | None = None,
    *,
    pdf: str | os.PathLike[str] | None = None,
    measure: str | None = None,
    title: str | None = None,
    size: SizeName | None = None,
) -> None:
    """Draw what was found into files.

    Parameters
    ----------
    found
        The result of a study, one branch, a diagram, a map, or a record beside a motion.
    png, svg, pdf
        The files to write; None for none. In the latter two all lines are lines, and text is text.
    measure
        What is drawn, as in `plot_branch`; by default what the study names.
    title
        By default that of the study.
    size
        ``"column"``, ``"page"`` or ``"slide"``; see `sized`. By default that of a screen.

    Raises
    ------
    ModelError
        If there is no such measure or size, or what is drawn is to show a measure and has none.
    StoreError
        If a file cannot be written.
    """
    with sized(size):
        figure = draw_picture(found, measure=measure, title=title)
        for path, form in ((png, "png"), (svg, "svg"), (pdf, "pdf")):
            if path is not None:
                write_whole(path, sheet_bytes(figure, form))


def draw_picture(
    found: Result | Branch | Diagram | Map | Alignment, *, measure: str | None = None, title: str | None = None
) -> Figure:
    """The picture as a matplotlib figure, without pyplot; parameters as `save_picture`."""
    if isinstance(found, Result):
        title = found.title if title is None else title
        if found.finding is not None:
            from gapwalk.plot.findings import draw_finding  # only now: it needs the code of all kinds

            return draw_finding(found.finding, _showing(found.options, measure), title)
        if found.map is not None and measure is not None:
            raise ModelError("the picture of a map shows its loci over two parameters, and no measure; leave it out")
        measure = measure or found.walked.measure
        found = found.diagram or found.map or found.branches[0]
    if isinstance(found, Alignment):
        if measure is not None:
            raise ModelError("the picture of a record shows its own signal, and no measure; leave it out")
        from gapwalk.plot.alignment import draw_alignment

        return draw_alignment(found, title and title.replace("$", r"\$"))
    title, measure = (title or "").replace("$", r"\$"), measure or "half"
    if isinstance(found, Map):
        return draw_map(found, title)
    with in_style():
        if isinstance(found, Diagram):
            figure = draw_diagram(found, measure, lambda panels: _figure(diagram_size(panels), title))
            assert isinstance(figure, Figure)
        else:
            figure = _figure(SIZE)
            ax = figure.add_subplot()
            ax.set_title(title, wrap=True)
            plot_branches([found], measure, ax=ax, closeup=True)
    return figure


def _showing(options: StudyOptions, measure: str | None) -> StudyOptions:
    """The options of a study without branches of its own, with another measure to show."""
    if measure is None:
        return options
    if not isinstance(options, BranchOptions):
        raise ModelError(f"the picture of the kind {options.kind} shows no measure; leave it out")
    return replace(options, measure=measure)


def _figure(size: tuple[float, float], title: str = "") -> Figure:
    figure = new_sheet(size)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=rc()["axes.titlesize"], wrap=True)
    return figure
