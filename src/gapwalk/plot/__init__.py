"""Pictures: branches, diagrams, maps, settled motions, sweeps, basins and regimes, drawn with matplotlib."""

from gapwalk.plot.branch import plot_branch
from gapwalk.plot.diagram import plot_diagram
from gapwalk.plot.history import plot_history, plot_loop
from gapwalk.plot.map import plot_map
from gapwalk.plot.picture import save_picture
from gapwalk.plot.section import plot_section
from gapwalk.plot.settled import plot_settled
from gapwalk.plot.spectrum import plot_spectrum
from gapwalk.plot.waterfall import plot_waterfall

__all__ = [
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
]
