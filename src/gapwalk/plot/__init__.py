"""Pictures: branches and diagrams over their parameter, maps over two, drawn with matplotlib."""

from gapwalk.plot.branch import plot_branch
from gapwalk.plot.diagram import plot_diagram
from gapwalk.plot.map import plot_map
from gapwalk.plot.picture import save_picture

__all__ = ["plot_branch", "plot_diagram", "plot_map", "save_picture"]
