"""Hysteresis loops of contacts, one or several over one another (paper, figure 1)."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes

from gapwalk.motion.hysteresis import Hysteresis
from gapwalk.plot.sheet import open_axes
from gapwalk.plot.size import takes_size
from gapwalk.plot.style import BLACK, BLUE, GREEN, GREY, PURPLE, VERMILLION, in_style

_STYLES = ((BLACK, "-"), (VERMILLION, (0, (4, 1.5))), (BLUE, (0, (1.3, 1.3))), (GREEN, "-."), (PURPLE, (0, (6, 2))))


@takes_size
def plot_hysteresis(
    loops: Hysteresis | Sequence[Hysteresis], names: Sequence[str] = (), *, ax: Axes | None = None
) -> Axes:
    """Draw loops of force over deflection: the area is the energy that a cycle costs.

    Parameters
    ----------
    loops
        One loop, or several.
    names
        What they are called; by default their laws.
    ax
        Where to draw; by default a new figure of pyplot.
    """
    loops = [loops] if isinstance(loops, Hysteresis) else list(loops)
    if ax is None:
        ax = open_axes((6.0, 4.4))
    with in_style():
        for place, loop in enumerate(loops):
            color, line = _STYLES[place % len(_STYLES)]
            name = names[place] if place < len(names) else loop.law.value
            label = f"{name}: loss {loop.loss:.4g} a cycle"
            ax.plot(loop.deflection, loop.force, color=color, linestyle=line, linewidth=1.3, label=label)
        ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
        for level in sorted({level for loop in loops for level in loop.breakpoints}):
            if any(loop.deflection.min() < level < loop.deflection.max() for loop in loops):
                ax.axvline(level, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
        ax.set_xlabel("deflection")
        ax.set_ylabel("contact force")
        ax.legend(loc="best", handlelength=3.0)
    return ax
