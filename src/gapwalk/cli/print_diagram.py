"""A diagram in the terminal: the tree of its branches, period-doubling cascades, and notes."""

from __future__ import annotations

from collections import Counter

from rich.console import Console
from rich.tree import Tree

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.diagram import Diagram, DiagramBranch, Origin
from gapwalk.cli.outcome import printable
from gapwalk.continuation.walk import EndReason
from gapwalk.plot.words import parameter_symbol


def print_diagram(screen: Console, diagram: Diagram) -> None:
    """Print the branches of a diagram as a tree, its cascades, notes and failures."""
    screen.print(diagram_tree(diagram))
    if diagram.cascades:
        screen.print("period-doubling cascades")
    for cascade in diagram.cascades:
        values = ", ".join(f"{value:.10g}" for value in cascade.values)
        ratios = ", ".join(f"{ratio:.4g}" for ratio in cascade.ratios)
        screen.print(f"  {' → '.join(cascade.members)}: {values}; ratios of the steps {ratios}", soft_wrap=True)
    for text in diagram.notes:
        screen.print(f"note: {printable(text)}", soft_wrap=True)
    for text in diagram.failures:
        screen.print(f"failed: {printable(text)}", soft_wrap=True)


def diagram_tree(diagram: Diagram) -> Tree:
    """Build the tree of the branches of a diagram; a branch that connects two others is listed where it begins."""
    tree = Tree(_summary(diagram), guide_style="dim")
    nodes: dict[str, Tree] = {}
    for member in diagram.members:
        parent = tree if member.begins is None else nodes[member.begins.parent]
        nodes[member.name] = parent.add(_describe(diagram, member))
    return tree


def _summary(diagram: Diagram) -> str:
    low, high = diagram.within
    periods = Counter(member.period for member in diagram.members)
    counts = ", ".join(f"{count} of period {period}" for period, count in sorted(periods.items()))
    points = sum(len(branch.points) for branch in diagram.branches)
    special = sum(len(branch.special_points) for branch in diagram.branches)
    units = diagram.branches[0].system.units if diagram.branches else None
    range_ = f"{parameter_symbol(diagram.parameter, units)} from {low:.10g} to {high:.10g}"
    if not diagram.members:
        return f"{range_}: no branches"
    return f"{range_}: {len(diagram.members)} branches, {counts}; {points} points, {special} special points"


def _describe(diagram: Diagram, member: DiagramBranch) -> str:
    branch = member.branch
    values = branch.values
    stable = sum(point.stable for point in branch.points)
    counts = [f"{len(branch.special(kind))} {kind.value}" for kind in Kind.known() if branch.special(kind)]
    return (
        f"{member.name}  {values.min():.8g} to {values.max():.8g}; {len(values)} points, {stable} of them stable; "
        f"{', '.join(counts) or 'no special points'}\n"
        f"{_begin(diagram, member)}; {_end(diagram, member)}"
    )


def _begin(diagram: Diagram, member: DiagramBranch) -> str:
    first = member.branch.ends[0]
    if member.begins is not None:
        return f"begins at {_place(diagram, member.begins)}"
    found = "" if member is diagram.members[0] else "found by the search; "
    if first.reason is EndReason.START:
        return f"{found}begins at {first.value:.10g}"
    return f"{found}ends at {_reason(member, 0)}"


def _end(diagram: Diagram, member: DiagramBranch) -> str:
    return f"ends at {_place(diagram, member.joins) if member.joins is not None else _reason(member, -1)}"


def _place(diagram: Diagram, origin: Origin) -> str:
    special = diagram[origin.parent].branch.special_points[origin.special]
    return f"{special.value:.10g}, a {special.kind.value.replace('-', ' ')} of {origin.parent}"


def _reason(member: DiagramBranch, index: int) -> str:
    end = member.branch.ends[index]
    detail = f" ({printable(end.detail)})" if end.detail else ""
    return f"{end.value:.10g}: {end.reason.value}{detail}"
