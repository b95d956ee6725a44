"""Basins in files: what is to be done and what was found, as arrays and plain JSON values, and back."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import Any

import numpy as np

from gapwalk.attractor.basins import Basins, Check
from gapwalk.attractor.box import Box, Window
from gapwalk.attractor.plain import attractor_of, plain_attractor
from gapwalk.model.system import System
from gapwalk.study.store.arrays import Arrays
from gapwalk.study.store.cell_store import read_cells, text_array, text_value
from gapwalk.study.store.plain import plain_system, system_of
from gapwalk.study.store.trust import undamaged

KIND = "basins"


def plain_basins(
    system: System, window: Window, resolution: tuple[int, int], options: dict[str, Any], chunks: int
) -> dict[str, Any]:
    """What is to be done, in plain JSON values; the number of workers changes nothing of it."""
    return {
        "kind": KIND,
        "system": plain_system(system),
        "window": asdict(window),
        "resolution": list(resolution),
        "options": {name: value for name, value in options.items() if name != "workers"},
        "chunks": chunks,
    }


def basin_arrays(found: Basins) -> Arrays:
    """What was found."""
    about = {
        "attractors": [plain_attractor(attractor) for attractor in found.attractors],
        "check": asdict(found.check),
        "error": found.error,
        "notes": list(found.notes),
    }
    return {"labels": found.labels, "about": text_array(about)}


def basins_of(system: System, window: Window, arrays: Arrays) -> Basins:
    """The basins; any of LookupError, TypeError and ValueError if there are none in the arrays."""
    about, labels = text_value(arrays["about"]), arrays["labels"]
    attractors = tuple(attractor_of(plain, system) for plain in about["attractors"])
    if labels.ndim != 2 or labels.size == 0 or labels.min() < -2 or labels.max() >= len(attractors):
        raise ValueError(f"its labels are none of {len(attractors)} attractors")
    notes = tuple(str(note) for note in about["notes"])
    check = Check(**{name: int(value) for name, value in about["check"].items()})
    return Basins(system, window, labels.astype(int), attractors, check, float(about["error"]), True, notes)


def load_basins(path: str | os.PathLike[str]) -> Basins:
    """Load basins from the file that `gapwalk.basins` wrote.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    StoreError
        If there is no such file, it is not complete, it holds something else, or it is damaged.
    """
    about, arrays = read_cells(path, KIND)
    with undamaged(path):
        plain = about["window"]
        box = Box(*(tuple(plain["box"][name]) for name in ("names", "low", "high")))
        window = Window(box, str(plain["across"]), str(plain["up"]))
        found = basins_of(system_of(about["system"]), window, arrays)
        if list(found.resolution) != about["resolution"] or not np.isfinite(found.axes[0]).all():
            raise ValueError(f"its resolution is {found.resolution}")
    return found
