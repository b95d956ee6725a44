"""The frequency responses of the paper, walked: the branch of period-1 motions that each figure shows."""

from __future__ import annotations

import os
import re
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.paper.cases import (
    DampingReading,
    SlopeReading,
    case,
    describe,
    frequency_responses,
    names,
    parameter_set,
)
from gapwalk.study.document import result_document
from gapwalk.study.file import Study
from gapwalk.study.options import ResponseOptions
from gapwalk.study.result import Result
from gapwalk.study.run import run
from gapwalk.study.store.walk_store import Report

BEGIN, END = 2.0, 0.15
"""The range of W over which the responses are walked, from the first to the second."""


def figure_names(name: str) -> tuple[str, ...]:
    """The figures that a name stands for, as `names` has them: ``20(a)`` is 20a, and 20 is 20a and 20b.

    Raises
    ------
    ModelError
        If the paper has no such figure.
    """
    plain = re.sub(r"^fig(ure|\.)?|[\s()]", "", name.strip().lower())
    parts = tuple(known for known in names() if known == plain or re.match(rf"{plain}\D", known))
    if not plain.isdigit() or not parts:
        parameter_set(name)  # refuses what it does not know, and says what there is
        return (plain,)
    return parts


def walk_figure(
    name: str,
    *,
    slope: SlopeReading | str = SlopeReading.REDUCED,
    damping: DampingReading | str = DampingReading.DISSIPATIVE,
    output: str | os.PathLike[str] | None = None,
    report: Report | None = None,
) -> Result:
    """Walk the period-1 motions of a figure from W = 2 down to 0.15.

    Parameters
    ----------
    name
        One of `frequency_responses`.
    slope, damping
        The readings of the paper, where it can be read in two ways; see `case`.
    output
        A result file to write; one that is there already is written over.
    report
        As in `gapwalk.run`.

    Raises
    ------
    ModelError
        If the figure is not known, or is no frequency response.
    """
    study = figure_study(name, slope=slope, damping=damping)
    return run(study, output, force=output is not None, report=report)


def figure_study(
    name: str,
    *,
    slope: SlopeReading | str = SlopeReading.REDUCED,
    damping: DampingReading | str = DampingReading.DISSIPATIVE,
) -> Study:
    """The study whose result is the figure; parameters and errors as `walk_figure`."""
    system = case(name, slope=slope, damping=damping)
    if name not in frequency_responses():
        raise ModelError(
            f"figure {name} is no frequency response over W, and is not drawn yet; those that are: "
            f"{', '.join(frequency_responses())}"
        )
    # Heavy mean loads hold the stage closed at W = 2: the transient from rest settles there in all cases.
    options = ResponseOptions("frequency", BEGIN, END, "half.q1")
    readings = f"slope {SlopeReading(slope).value}, damping {DampingReading(damping).value}"
    return Study(system.at(frequency=BEGIN), options, f"Padmanabhan and Singh (1995), figure {name} ({readings})")


def figure_document(
    name: str, result: Result, *, slope: SlopeReading | str, damping: DampingReading | str
) -> dict[str, Any]:
    """A figure as plain JSON values: the reading, the branches, and the special points."""
    reading = {"slope": SlopeReading(slope).value, "damping": DampingReading(damping).value}
    return {"figure": name, "reading": reading, "note": describe(name), **result_document(result)}
