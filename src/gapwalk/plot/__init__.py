"""Pictures of branches, diagrams, maps, motions, sweeps, basins, regimes and records, drawn with matplotlib."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gapwalk.plot.alignment import plot_alignment
    from gapwalk.plot.basins import draw_basins, plot_basins
    from gapwalk.plot.branch import plot_branch, plot_branches, plot_overlay
    from gapwalk.plot.comparison import plot_comparison
    from gapwalk.plot.contrast import plot_contrast
    from gapwalk.plot.diagram import plot_diagram
    from gapwalk.plot.family import plot_family
    from gapwalk.plot.history import plot_history, plot_loop
    from gapwalk.plot.hysteresis import plot_hysteresis
    from gapwalk.plot.map import plot_map
    from gapwalk.plot.picture import save_picture
    from gapwalk.plot.regimes import draw_regimes, plot_contact_figures, plot_regimes
    from gapwalk.plot.section import plot_section
    from gapwalk.plot.settled import plot_settled
    from gapwalk.plot.sheet import figure
    from gapwalk.plot.size import sized
    from gapwalk.plot.spectrum import plot_spectrum
    from gapwalk.plot.strobes import plot_strobes
    from gapwalk.plot.sweep import plot_sweep
    from gapwalk.plot.waterfall import plot_waterfall

__all__ = [
    "draw_basins",
    "draw_regimes",
    "figure",
    "plot_alignment",
    "plot_basins",
    "plot_branch",
    "plot_branches",
    "plot_comparison",
    "plot_contact_figures",
    "plot_contrast",
    "plot_diagram",
    "plot_family",
    "plot_history",
    "plot_hysteresis",
    "plot_loop",
    "plot_map",
    "plot_overlay",
    "plot_regimes",
    "plot_section",
    "plot_settled",
    "plot_spectrum",
    "plot_strobes",
    "plot_sweep",
    "plot_waterfall",
    "save_picture",
    "sized",
]

# Imported when first asked for: what draws nothing must not wait for matplotlib, nor a branch for scipy.signal.
_HOMES = {
    "draw_basins": "basins",
    "draw_regimes": "regimes",
    "figure": "sheet",
    "plot_alignment": "alignment",
    "plot_basins": "basins",
    "plot_branch": "branch",
    "plot_branches": "branch",
    "plot_comparison": "comparison",
    "plot_contact_figures": "regimes",
    "plot_contrast": "contrast",
    "plot_diagram": "diagram",
    "plot_family": "family",
    "plot_history": "history",
    "plot_hysteresis": "hysteresis",
    "plot_loop": "history",
    "plot_map": "map",
    "plot_overlay": "branch",
    "plot_regimes": "regimes",
    "plot_section": "section",
    "plot_settled": "settled",
    "plot_spectrum": "spectrum",
    "plot_strobes": "strobes",
    "plot_sweep": "sweep",
    "plot_waterfall": "waterfall",
    "save_picture": "picture",
    "sized": "size",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'gapwalk.plot' has no attribute {name!r}")
    value = getattr(import_module(f"gapwalk.plot.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
