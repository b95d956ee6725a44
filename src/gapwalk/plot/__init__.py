"""Pictures: branches, diagrams, maps, settled motions, sweeps, basins and regimes, drawn with matplotlib."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gapwalk.plot.basins import draw_basins, plot_basins
from gapwalk.plot.branch import plot_branch
from gapwalk.plot.diagram import plot_diagram
from gapwalk.plot.map import plot_map
from gapwalk.plot.picture import save_picture
from gapwalk.plot.regimes import draw_regimes, plot_contact_figures, plot_regimes
from gapwalk.plot.section import plot_section
from gapwalk.plot.settled import plot_settled
from gapwalk.plot.spectrum import plot_spectrum
from gapwalk.plot.waterfall import plot_waterfall

__all__ = [
    "draw_basins",
    "draw_regimes",
    "history",
    "plot_basins",
    "plot_branch",
    "plot_contact_figures",
    "plot_diagram",
    "plot_history",
    "plot_loop",
    "plot_map",
    "plot_regimes",
    "plot_section",
    "plot_settled",
    "plot_spectrum",
    "plot_waterfall",
    "save_picture",
    "section",
    "settled",
    "spectrum",
    "waterfall",
]
