"""Pictures: branches, diagrams, maps, settled motions, sweeps, basins and regimes, drawn with matplotlib."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gapwalk.plot.branch import plot_branch
from gapwalk.plot.diagram import plot_diagram
from gapwalk.plot.map import plot_map
from gapwalk.plot.picture import save_picture

__all__ = [
    "history",
    "plot_branch",
    "plot_diagram",
    "plot_history",
    "plot_loop",
    "plot_map",
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
