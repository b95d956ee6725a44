"""Pictures: branches over their parameter, drawn with matplotlib."""

from gapwalk.plot.branch import plot_branch
from gapwalk.plot.response import save_response

__all__ = ["plot_branch", "save_response"]
