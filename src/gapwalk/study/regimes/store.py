"""Regime maps in files: what is to be done and what was found, as arrays and plain JSON values, and back."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import Any

from gapwalk.attractor.judge import Verdicts
from gapwalk.attractor.regimes import RegimeCheck, Regimes
from gapwalk.model.system import System
from gapwalk.study.regimes.job import Plan
from gapwalk.study.store.arrays import Arrays
from gapwalk.study.store.cell_store import read_cells, text_array, text_value
from gapwalk.study.store.plain import plain_system, system_of
from gapwalk.study.store.trust import undamaged

KIND = "regimes"


def plain_regimes(plan: Plan, options: dict[str, Any], chunks: int) -> dict[str, Any]:
    """What is to be done, in plain JSON values; the number of workers changes nothing of it."""
    return {
        "kind": KIND,
        "system": plain_system(plan.system),
        "names": list(plan.names),
        "within": [list(ends) for ends in plan.within],
        "resolution": list(plan.resolution),
        "start": plan.start.tolist(),
        "options": {name: value for name, value in options.items() if name != "workers"},
        "chunks": chunks,
    }


def regime_arrays(found: Regimes) -> Arrays:
    """What was found."""
    about = {"check": asdict(found.check), "error": found.error, "notes": list(found.notes)}
    verdicts = Verdicts(
        found.regimes, found.periods, found.exponents, found.peak_force, found.impacts, found.states
    )  # fmt: skip
    return {**verdicts._asdict(), "about": text_array(about)}


def regimes_of(
    system: System, names: tuple[str, str], within: tuple[tuple[float, float], tuple[float, float]], arrays: Arrays
) -> Regimes:
    """The map; any of LookupError, TypeError and ValueError if there is none in the arrays."""
    about = text_value(arrays["about"])
    verdicts = [arrays[name] for name in Verdicts._fields]
    shape = verdicts[0].shape
    if len(shape) != 2 or any(part.shape[:2] != shape for part in verdicts):
        raise ValueError(f"its parts have the shapes {', '.join(str(part.shape) for part in verdicts)}")
    check = RegimeCheck(int(about["check"]["checked"]), tuple(str(text) for text in about["check"]["different"]))
    notes = tuple(str(note) for note in about["notes"])
    return Regimes(system, *names, within, *Verdicts(*verdicts), check, float(about["error"]), True, notes)


def load_regimes(path: str | os.PathLike[str]) -> Regimes:
    """Load a regime map from the file that `gapwalk.regimes` wrote.

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
        first, second = (str(name) for name in about["names"])
        across, up = ((float(low), float(high)) for low, high in about["within"])
        found = regimes_of(system_of(about["system"]), (first, second), (across, up), arrays)
        if list(found.resolution) != about["resolution"]:
            raise ValueError(f"its resolution is {found.resolution}")
    return found
