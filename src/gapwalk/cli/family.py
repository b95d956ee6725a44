"""A family in the terminal: its members, and its special points with their fate along the family."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.cli.outcome import printable
from gapwalk.plot.words import parameter_symbol
from gapwalk.study.family.finding import FamilyFinding
from gapwalk.study.family.joint import Joint
from gapwalk.study.family.record import Family, Strand


def print_family(screen: Console, finding: FamilyFinding) -> None:
    """Print the members of a family, then its special points, each followed through the family."""
    found = finding.family
    low, high = found.within
    symbol, name = parameter_symbol(found.parameter), printable(parameter_symbol(found.over.name))
    screen.print(f"{symbol} from {low:.10g} to {high:.10g}, {len(found.over.axis)} values of {name}", soft_wrap=True)
    for member in found.members:
        branches = ", ".join(f"{label} with {len(branch.points)} points" for label, branch in member.named)
        special = sum(len(branch.special_points) for branch in member.branches)
        text = f"{branches}; {special} special points" if member.branches else "no branch"
        screen.print(f"  {name} = {member.value:.8g}: {text}", soft_wrap=True)
    if found.strands:
        screen.print(_strand_table(found))
    for strand in found.strands:
        for text in _ends(strand):
            screen.print(f"  {strand.name} {text}", soft_wrap=True)


def _strand_table(found: Family) -> Table:
    """Build the table of the special points at their first and their last member."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("special point")
    symbol, name = parameter_symbol(found.parameter), printable(parameter_symbol(found.over.name))
    for heading in ("period", "members", f"from {name}", f"at {symbol}", f"to {name}", f"at {symbol}"):
        table.add_column(heading, justify="right")
    table.add_column("joined")
    table.add_column("contact")
    for strand in found.strands:
        ends = (strand.places[0], strand.places[-1])
        numbers = [text for end in ends for text in (f"{found.value(end):.6g}", f"{found.special(end).value:#.10g}")]
        joined = "" if not strand.joints else "exactly" if strand.exact else "by nearness"
        row = (strand.name, str(strand.period), str(len(strand.places)), *numbers, joined, printable(strand.contact))
        table.add_row(*row)
    return table


def _ends(strand: Strand) -> list[str]:
    """Describe, as far as known, what happens to a special point before its first and after its last member."""
    before = [] if strand.before is None else [f"before: {_text(strand.before)}"]
    after = [] if strand.after is None else [f"after: {_text(strand.after)}"]
    on_the_way = [
        f"passes a {passage.kind} at ({passage.first:.8g}, {passage.value:.8g})"
        for joint in strand.joints
        for passage in joint.passages
    ]
    return [*before, *on_the_way, *after]


def _text(joint: Joint) -> str:
    return printable(joint.text)
