"""Picture of one torus: in the stroboscopic section, and as a surface in space."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LightSource
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D

from gapwalk.flow.flow import PERIOD
from gapwalk.model.words import signal_words
from gapwalk.plot.picture import AnyFigure, Inches, draws, write_heading, write_letters
from gapwalk.plot.style import BLACK, BLUE, GREEN, PURPLE, VERMILLION, stroke
from gapwalk.tori.torus import TURN, Torus, at_phases

_PALE = "#7fbce6"
_CURVES = (BLUE, VERMILLION, GREEN, PURPLE, BLACK)
_MOST = 4  # curves that have a panel of their own
_FINE = 400  # points of a curve
_ANGLES = 48  # angles of the excitation in a picture in space, per forcing period


def _torus_size(torus: Torus, *_: object, **__: object) -> Inches:
    return 3.2 * min(torus.curves, _MOST) + 4.4, 4.2


@draws(Torus, panels=True, size=_torus_size)
def draw_torus(torus: Torus, figure: AnyFigure, coordinate: str = "", *, title: str = "") -> None:
    """Draw each curve of a torus in the stroboscopic section, and the torus in space."""
    names, units = torus.system.coordinates, torus.system.units
    coordinate = coordinate or names[0]
    place = names.index(coordinate)
    rate = torus.system.size + place
    count = min(torus.curves, _MOST)
    grid = figure.add_gridspec(1, count + 1, width_ratios=[*[1.0] * count, 1.4])
    write_heading(figure, title)
    panels = [figure.add_subplot(grid[number]) for number in range(count)]
    for number, (panel, curve) in enumerate(zip(panels, torus.sections, strict=False)):
        closed = at_phases(curve, np.linspace(0.0, TURN, _FINE))
        panel.plot(closed[:, place], closed[:, rate], **stroke(_CURVES[number], 1.4, "-"))
        panel.set_xlabel(signal_words(coordinate, units))
        panel.margins(0.08)
        panel.xaxis.set_major_locator(MaxNLocator(4))
        if count > 1:
            panel.set_title(f"forcing period {number + 1} of {torus.curves}", fontsize="small")
    panels[0].set_ylabel(signal_words(f"{coordinate}'", units))
    write_letters(panels)
    space = figure.add_subplot(grid[count], projection="3d")
    assert isinstance(space, Axes3D)
    _draw_surface(space, torus, place, rate)


def _draw_surface(space: Axes3D, torus: Torus, place: int, rate: int) -> None:
    """Draw the torus as a surface: position and velocity turn about an axis with the angle of the excitation."""
    states = torus.surface(_ANGLES)
    angles = np.linspace(0.0, PERIOD, states.shape[0])[:, None]  # one turn for all m forcing periods
    x, y = states[:, :, place], states[:, :, rate] / torus.system.frequency
    middle, size = x.mean(), float(max(np.ptp(x), np.ptp(y)))
    radius = 1.6 * size + x - middle
    light = LightSource(azdeg=315, altdeg=50)
    space.plot_surface(
        radius * np.cos(angles), radius * np.sin(angles), y,
        color=_PALE, lightsource=light, linewidth=0, rcount=states.shape[0], ccount=states.shape[1],
    )  # fmt: skip
    widths = [float(np.ptp(each)) for each in (radius * np.cos(angles), radius * np.sin(angles), y)]
    space.set_box_aspect(widths, zoom=1.35)
    space.set_axis_off()
    space.view_init(elev=38.0, azim=-60.0)
    space.set_title(
        "once round: " + ("one forcing period" if torus.curves == 1 else f"{torus.curves} forcing periods"),
        fontsize="small",
    )
