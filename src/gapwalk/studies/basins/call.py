"""The call of `gapwalk.basins` as its file keeps it, and the parts of its work."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import ClassVar

from gapwalk.attractors.basins import Basins
from gapwalk.attractors.box import Window
from gapwalk.errors import StoreError
from gapwalk.model.system import System
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.basins.job import BasinChunk, chunks_of
from gapwalk.studies.basins.options import BasinOptions
from gapwalk.studies.request import Call

CELLS = Part("cells", BasinChunk, numbered=True)
BASINS = Part("basins", Basins)


@dataclass(frozen=True)
class BasinsCall(Call):
    """What basins are to be found; see `gapwalk.basins`."""

    asks: ClassVar[str] = "basins"

    system: System
    window: Window
    resolution: tuple[int, int]
    options: BasinOptions

    def found(self, parts: Parts) -> Basins:
        """The basins."""
        found = stored_basins(parts, self.window, self.resolution)
        if found is None:
            done, count = len(list(parts.all(CELLS))), chunks_of(self.resolution)
            name = os.fspath(parts.path)
            raise StoreError(
                f"{name} is not complete: {done} of {count} chunks are done; continue it by "
                f"gapwalk.basins(..., output={name!r}) with the same arguments as before"
            )
        return found


def stored_basins(parts: Parts, window: Window, resolution: tuple[int, int]) -> Basins | None:
    """The basins of a file, if they are complete; a ValueError if they are others than these."""
    found = parts.get(BASINS)
    if found is not None and (found.window, found.resolution) != (window, resolution):
        raise ValueError(f"its resolution is {found.resolution}")
    return found
