"""The picture of a whole response, as files for reports."""

from __future__ import annotations

import io
import os

import matplotlib as mpl
from matplotlib.figure import Figure

from gapwalk.continuation.branch import Branch
from gapwalk.plot.branch import plot_branches
from gapwalk.plot.style import DPI, RC, SIZE
from gapwalk.study.export import write_whole
from gapwalk.study.result import Result


def save_response(
    response: Result | Branch,
    png: str | os.PathLike[str] | None = None,
    svg: str | os.PathLike[str] | None = None,
    *,
    measure: str | None = None,
    title: str | None = None,
) -> None:
    """Draw a response into files.

    Parameters
    ----------
    response
        The result of a study, or one branch.
    png, svg
        The files to write; None for none.
    measure
        What is drawn, as in `plot_branch`; by default what the study names.
    title
        By default that of the study.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    figure = draw_response(response, measure=measure, title=title)
    for path, form in ((png, "png"), (svg, "svg")):
        if path is not None:
            content = io.BytesIO()
            metadata = {"Date": None} if form == "svg" else None
            with mpl.rc_context(RC):
                figure.savefig(content, format=form, dpi=DPI, metadata=metadata)
            write_whole(path, content.getvalue())


def draw_response(response: Result | Branch, *, measure: str | None = None, title: str | None = None) -> Figure:
    """The picture of a response as a matplotlib figure, without pyplot; parameters as `save_response`."""
    is_branch = isinstance(response, Branch)
    branches = [response] if is_branch else response.branches
    measure = measure or ("half" if is_branch else response.options.measure)
    title = ("" if is_branch else response.title) if title is None else title
    with mpl.rc_context(RC):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        ax = figure.add_subplot()
        ax.set_title(title.replace("$", r"\$"), wrap=True)
        plot_branches(branches, measure, ax=ax, closeup=True)
    return figure
