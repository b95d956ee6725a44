"""A result as plain JSON values, for other programs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram, Origin
from gapwalk.bifurcation.isolated import SearchResult, coverage
from gapwalk.continuation.point_on_branch import point_row
from gapwalk.continuation.walk import End
from gapwalk.flow.motion import signal_names
from gapwalk.results.plain import plain
from gapwalk.results.records import parameters_of
from gapwalk.studies.columns import COVERAGE, coverage_rows, special_rows
from gapwalk.studies.map import map_document
from gapwalk.studies.result import Result


def result_document(result: Result, points: bool = True) -> dict[str, Any]:
    """Return a result: branches, their points (if wanted), ends, and the special points of all branches.

    The finding of a study without branches has a document of its own kind.
    """
    head: dict[str, Any] = {
        "title": result.title,
        "name": result.study.name or None,
        "kind": result.options.kind,
        "complete": result.complete,
        "versions": dict(result.versions),
        "parameters": parameters_of(result.system),
    }
    if (units := result.system.units) is not None:
        head["units"] = {name: unit for name in result.system.structure.names if (unit := units.parameter(name))}
        head["units"] |= {name: units.signal(name)[1] for name in signal_names(result.system)}
    if result.study.reduced is not None:
        head["reduction"] = plain(result.study.reduced)
        head["checks"] = plain(result.checks)
    if result.finding is not None:
        finding = result.finding
        told = {"notes": list(finding.notes), "failures": list(finding.failures)}
        return head | finding.document(points) | told
    document = {
        **head,
        "method": plain(result.walked.method),
        "branches": [branch_document(branch, number, points) for number, branch in enumerate(result.branches, start=1)],
        "special_points": special_documents(result.named, result.diagram),
    }
    for branch, name in zip(document["branches"], result.names, strict=True):
        branch["name"] = name
    if result.verification is not None:
        document["verification"] = result.verification.document()
    if result.map is not None:
        values = [section.value for section in result.map.sections for _ in section.branches]
        for branch, value in zip(document["branches"], values, strict=True):
            branch["section"] = value
        document |= map_document(result.map, points)
    return document if result.diagram is None else document | _tree_document(result.diagram, document["branches"])


def branch_document(branch: Branch, number: int, points: bool = True) -> dict[str, Any]:
    """Return one branch, numbered from 1; a special point refers to it by that number."""
    document: dict[str, Any] = {
        "id": number,
        "period": branch.period,
        "parameter": branch.parameter,
        "ends": [end_document(end) for end in branch.ends],
        "unexplained": [{"first": each.first, "last": each.last, "text": each.text} for each in branch.unexplained],
        "count": len(branch.points),
    }
    if points:
        document["points"] = [plain(point_row(point)) for point in branch.points]
    return document


def _tree_document(diagram: Diagram, branches: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the additional parts of the document of a diagram: connections of branches, cascades, and the search."""
    for member, document in zip(diagram.members, branches, strict=True):
        document["begins"], document["joins"] = _origin(member.begins), _origin(member.joins)
    return {
        "branches": branches,
        "cascades": [
            {"branches": list(cascade.members), "values": list(cascade.values), "ratios": list(cascade.ratios)}
            for cascade in diagram.cascades
        ],
        "search": None if diagram.search is None else search_document(diagram.search),
        "notes": list(diagram.notes),
        "failures": list(diagram.failures),
    }


def search_document(result: SearchResult) -> dict[str, Any]:
    """Return the coverage of a search: numbers for each value of the parameter, and sentences."""
    return {
        "complete": result.complete,
        "values": [dict(zip(COVERAGE, row, strict=True)) for row in coverage_rows(result)],
        "coverage": list(coverage(result)),
    }


def _origin(origin: Origin | None) -> dict[str, Any] | None:
    """Return where a branch begins or ends: the name of another branch, and the index of its special point, from 0."""
    return None if origin is None else {"branch": origin.parent, "special_point": origin.special}


def special_documents(branches: Iterable[tuple[str, Branch]], diagram: Diagram | None = None) -> list[dict[str, Any]]:
    """Return the special points of named branches, in the order of the walks. A value that does not exist is null."""
    return [plain(row) for row in special_rows(branches, diagram)]


def end_document(end: End) -> dict[str, Any]:
    """Return one end of a branch; `reason` is a word for programs, `text` the sentence for people."""
    return {"reason": end.reason.name.lower().replace("_", "-"), "parameter": end.value, "text": str(end)}
