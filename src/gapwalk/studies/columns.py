"""Columns that several tables share: measures of a motion, parameters, the coverage of a search."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.isolated import SearchResult, unseen_share
from gapwalk.bifurcation.loci import LocusPoint
from gapwalk.continuation.curve_points import BranchPoint, point_row
from gapwalk.model.system import System
from gapwalk.orbit.orbit import measure_names, parameter_headings
from gapwalk.studies.options import BranchOptions
from gapwalk.summary import Rows, rows_of


def measure_values(point: BranchPoint | LocusPoint) -> list[float]:
    """Return the measures of a point, in the order of `measure_names`."""
    return [point.measure(name) for name in measure_names(point.orbit.system.coordinates)]


def method_names(options: BranchOptions) -> list[str]:
    """Return the headings of method-specific columns: for harmonic balance, harmonics and truncation error."""
    return list(options.method.columns)


def special_rows(branches: Iterable[tuple[str, Branch]], diagram: Diagram | None = None) -> Iterator[dict[str, Any]]:
    """Yield the rows of the special points of some named branches, in the order of the walks.

    The rows of a diagram name the branches that begin or end at each point.
    """
    for number, (name, branch) in enumerate(branches, start=1):
        for index, special in enumerate(branch.special_points):
            leads = {} if diagram is None else {"leads_to": tuple(m.name for m in diagram.attached(name, index))}
            yield {"branch": number, "name": name, "period": branch.period, **point_row(special), **leads}


def table_rows(rows: Iterable[Mapping[str, Any]], *parameters: str, system: System) -> Rows:
    """Yield the headings and the rows of a table of points; headings of parameters are their names."""
    names = parameter_headings(parameters, system.coordinates)
    known = {"leads_to": "leads.to", **dict(zip(("parameter", "second"), names, strict=False))}
    return rows_of(({known.get(name, name): value for name, value in row.items()} for row in rows), _EMPTY)


_EMPTY = ("branch", "name", "period", "kind")  # headings of a table without any special point


COVERAGE = ("value", "starts", "settled", "not_periodic", "ran_away", "newton_starts", "orbits", "new", "unseen_share")
"""The headings of `coverage_rows`."""


def coverage_rows(result: SearchResult) -> list[list[float]]:
    """Return the coverage of a search at each value of the parameter: starts, orbits found, and what may be missing.

    `orbits` counts the orbits found, `new` those that are not on a branch known before. With 95 % confidence, a
    periodic attractor that was never found attracts no more than `unseen_share` of the box of starts.
    """
    return [
        [
            tally.value,
            tally.starts,
            tally.settled,
            len(tally.unsettled),
            tally.ran_away,
            tally.newton_starts,
            len(result.at(tally.value)),
            sum(found.is_new for found in result.at(tally.value)),
            unseen_share(tally.settled),
        ]
        for tally in result.tallies
    ]
