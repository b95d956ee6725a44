"""The study of basins of attraction in a plane of initial states."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, ValidationInfo

from gapwalk.attractors.basins import Basins, in_order
from gapwalk.attractors.box import Window, beside_cells
from gapwalk.model.system import System, check_system
from gapwalk.model.words import coordinate_words
from gapwalk.notebook import shows_progress
from gapwalk.parallel.workers import Workers
from gapwalk.results.result_file import Part
from gapwalk.studies.basin_work import BasinOptions, BasinWork
from gapwalk.studies.cell_work import CellFinding
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.runner import Report, call
from gapwalk.studies.study_kind import StudyKind, values_of
from gapwalk.studies.tables import Resolution, Surroundings, check_resolution
from gapwalk.summary import SummaryParts, Table, summarizes


class BasinFinding(CellFinding):
    """Basins of attraction; None until the attractors are known."""

    map: Basins | None

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the share of cells of each attractor, and how reliable the labels are."""
        found = self.map
        assert found is not None
        (columns, rows), total = found.resolution, found.labels.size
        axes = (coordinate_words(name, found.system.units) for name in (found.window.across, found.window.up))
        yield f"{', '.join(axes)}: {columns} x {rows} cells"
        exponents = [attractor.lyapunov for attractor in found.attractors]
        largest = ["" if each is None else f"{each.exponents[0]:.4g}" for each in exponents]
        counts = [(name, found.cells[name], text) for name, text in zip(found.names, largest, strict=True)]
        counts += [(text, n, "") for text, n in found.others.items() if n]
        cells = [(name, str(count), f"{count / total:.2%}", text) for name, count, text in counts]
        yield Table(["leads to", ">cells", ">share", ">largest exponent"], cells)
        yield found.check.text

    def map_document(self, points: bool) -> dict[str, Any]:
        """Return attractors with their cells, and the reliability of the labels; with each cell's label if wanted."""
        found = self.map
        assert found is not None
        window = found.window
        document: dict[str, Any] = {
            "plane": dict(zip((window.across, window.up), map(list, window.within), strict=True)),
            "resolution": list(found.resolution),
            "attractors": [
                {
                    "name": name,
                    "kind": attractor.kind.value,
                    "period": attractor.period,
                    "cells": found.cells[name],
                    "state": attractor.state.tolist(),
                    "evidence": list(attractor.evidence),
                }
                for name, attractor in zip(found.names, found.attractors, strict=True)
            ],
            "unresolved": found.unresolved,
            "runaway": found.runaway,
            "impossible": found.impossible,
            "check": {**asdict(found.check), "share": found.check.share, "limit": found.check.limit},
            "error": found.error,
        }
        if points:
            document["labels"] = found.labels.tolist()
        return document


_PLANE = 'write two axes, each with its range, as in plane = { q1 = [-4.0, 4.0], "q1\'" = [-4.0, 4.0] }'

Plane = Mapping[str, tuple[float, float]]


def _is_a_plane(plane: Plane, info: ValidationInfo[Surroundings]) -> Plane:
    if len(plane) != 2:
        raise ValueError(f"names {len(plane)} {'axis' if len(plane) == 1 else 'axes'}; {_PLANE}")
    if info.context.system is not None:
        Window.of(info.context.system, plane, {})
    return plane


def _is_fixed(fixed: Mapping[str, float], info: ValidationInfo[Surroundings]) -> Mapping[str, float]:
    system, plane = info.context.system, info.data.get("plane")
    if system is not None and plane is not None:
        Window.of(system, plane, fixed)
    return fixed


@dataclass(frozen=True)
class BasinStudy(BasinOptions, StudyKind):
    """Basins of attraction in a plane of initial states.

    Parameters
    ----------
    longest, max_period, tries, exact_borders, check, seed, workers
        Options for the computation; as `gapwalk.BasinOptions`.

    Examples
    --------
    >>> asked = gw.studies.BasinStudy(plane={"x": (-1.0, 1.0), "x'": (-1.0, 1.0)}, resolution=(4, 4))
    >>> asked.plan
    "basins over x from -1 to 1 and x' from -1 to 1, 4 x 4 cells"
    """

    kind: ClassVar[str] = "basins"
    table_types: ClassVar[Mapping[str, Any]] = {"resolution": key_type(Resolution)}

    #: The two axes and their ranges, the horizontal one first.
    plane: Annotated[Plane, Field(description=_PLANE), AfterValidator(_is_a_plane)] = field(kw_only=True)
    #: The other components of the state at theta = 0; those that are not named are 0.
    fixed: Annotated[Mapping[str, float], AfterValidator(_is_fixed)] = field(default_factory=dict)
    resolution: tuple[int, int] = (128, 128)  #: Columns and rows of cells.

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        columns, rows = self.resolution
        ranges = [f"{name} from {low:g} to {high:g}" for name, (low, high) in self.plane.items()]
        return f"basins over {' and '.join(ranges)}, {columns} x {rows} cells"

    def work(self, system: System) -> PlaneBasins:
        """Return the work on the basins."""
        return PlaneBasins(system, self)


class PlaneBasins(BasinWork):
    """The basins of the cells of a plane."""

    whole_part = Part("basins", Basins)
    found_as = BasinFinding

    def __init__(self, system: System, asked: BasinStudy) -> None:
        (columns, rows), self.window = asked.resolution, Window.of(system, asked.plane, asked.fixed)
        states = self.window.states(asked.resolution)
        super().__init__(system, states, beside_cells(rows, columns), asked.resolution, asked)

    def found(self, *, complete: bool) -> Basins | None:
        """Return the basins; None before the attractors are known, because the labels of chunks refer to them."""
        if not (complete or self.is_begun):
            return None
        attractors, labels = in_order(self.catalogue.attractors, self.all_labels)
        how = (self.checked, self.error, complete, self.notes(complete))
        return Basins(self.system, self.window, labels.reshape(self.resolution[::-1]), attractors, *how)


@shows_progress(lambda count, part, pace: str(pace))
def basins(
    system: System,
    plane: Mapping[str, Sequence[float]],
    resolution: int | tuple[int, int] = 128,
    *,
    fixed: Mapping[str, float] | None = None,
    options: BasinOptions | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Basins:
    """Compute basins of attraction in a plane of initial states.

    Each cell is judged by the state at its centre; those beyond a rigid stop are left out. The batch integrator follows
    it until it is in the trapping region of a known attractor (see `gapwalk.attractors.trapping_region`); the
    attractors themselves are exact. Cells at borders between basins, and samples of the others, are followed again by
    the exact flow, which corrects labels and counts the wrong ones. A system that the batch integrator cannot include,
    as one with friction that sticks rigidly, is followed by the exact flow alone, a hundred times slower.

    Parameters
    ----------
    system
        The system.
    plane
        The two axes and their ranges, the horizontal one first: ``{"q1": (-4, 4), "q1'": (-4, 4)}``.
    resolution
        Cells along each axis, or (columns, rows).
    fixed
        The other components of the state at theta = 0; those that are not named are 0.
    options
        Options for the computation of basins.
    workers
        Number of local processes, or workers that were started before (`gapwalk.parallel`); by default as the options
        say. The result does not depend on them.
    report
        Called with each chunk of cells once it is done and written to the file.
    output
        A file to write while the work is done; `gapwalk.load` reads it. If it holds a part of the same job, that is
        continued to the same result.

    Returns
    -------
    Basins
        The label of each cell, and the attractors.

    Raises
    ------
    ModelError
        If the plane is invalid.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is the result so far, with ``complete`` False.

    Examples
    --------
    >>> found = gw.basins(system.at(frequency=1.3), {"x": (-2, 1), "x'": (-2, 2)}, resolution=8)
    >>> found.cells  # two motions are stable
    {'period 1a': 52, 'period 1b': 12}
    """
    check_system(system, "basins")
    options = options or BasinOptions()
    window = Window.of(system, plane, fixed or {})
    box = window.box
    asked = BasinStudy(
        **values_of(options),
        plane=dict(zip((window.across, window.up), window.within, strict=True)),
        fixed={name: low for name, low in zip(box.names, box.low, strict=True) if name not in plane},
        resolution=check_resolution(resolution),
    )
    return call(asked, asked.work(system), system, workers=workers, report=report, output=output).record
