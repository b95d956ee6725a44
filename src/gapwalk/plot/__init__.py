"""Pictures: branches and diagrams over their parameter, drawn with matplotlib."""

from gapwalk.plot.branch import plot_branch
from gapwalk.plot.diagram import plot_diagram
from gapwalk.plot.picture import save_picture

__all__ = ["plot_branch", "plot_diagram", "save_picture"]
