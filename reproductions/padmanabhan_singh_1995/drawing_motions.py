"""The figures of the paper that show motions: settled ones, two side by side, and one beside a record."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from matplotlib.figure import Figure as Picture

from gapwalk.attractor.contrast import contrast
from gapwalk.plot.alignment import draw_alignments
from gapwalk.plot.contrast import draw_contrast
from gapwalk.plot.findings import draw_finding
from gapwalk.study.result import Result
from reproductions.padmanabhan_singh_1995.figure import Figure, View
from reproductions.padmanabhan_singh_1995.motion import orbit_of
from reproductions.padmanabhan_singh_1995.record import beside_record

Drawer = Callable[[Figure, Mapping[str, Result], str], Picture]


def _draw_motion(figure: Figure, results: Mapping[str, Result], title: str) -> Picture:
    result = results[figure.key(figure.panels[0].jobs[0])]
    assert result.finding is not None
    return draw_finding(result.finding, result.options, title)


def _draw_contrast(figure: Figure, results: Mapping[str, Result], title: str) -> Picture:
    """A row for each panel; all of them show the same two motions."""
    first = figure.panels[0]
    one, two = (orbit_of(results[figure.key(key)]) for key in first.jobs)
    names = (first.names[0], first.names[1])
    return draw_contrast(contrast(one, two, [panel.signal for panel in figure.panels], names=names), title)


def _draw_record(figure: Figure, results: Mapping[str, Result], title: str) -> Picture:
    """Below each other, each motion over the record."""
    found = [beside_record(*(results[figure.key(key)] for key in panel.jobs)) for panel in figure.panels]
    return draw_alignments(found, [panel.title for panel in figure.panels], title)


WHOLE: dict[View, Drawer] = {
    View.MOTION: _draw_motion,
    View.CONTRAST: _draw_contrast,
    View.RECORD: _draw_record,
}
"""How the views are drawn that take the whole picture."""
