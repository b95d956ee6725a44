"""Pictures of branches, diagrams, maps, motions, sweeps, basins, regimes and records, drawn with matplotlib."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gapwalk.plot.branches import overlay
    from gapwalk.plot.picture import begin, draw, draws, figure, save
    from gapwalk.plot.sheet import new_sheet
    from gapwalk.plot.style import in_style, sized

__all__ = ["begin", "draw", "draws", "figure", "in_style", "new_sheet", "overlay", "save", "sized"]

# Imported when first asked for: what draws nothing must not wait for matplotlib.
_HOMES = {"in_style": "style", "new_sheet": "sheet", "overlay": "branches", "sized": "style"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'gapwalk.plot' has no attribute {name!r}")
    value = getattr(import_module(f"gapwalk.plot.{_HOMES.get(name, 'picture')}"), name)
    globals()[name] = value
    return value
