"""A family in the terminal: its members, and its special points with their fate along the family."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from gapwalk.cli.outcome import printable
from gapwalk.plot.words import parameter_symbol
from gapwalk.studies.family.connection import Connection
from gapwalk.studies.family.finding import FamilyFinding
from gapwalk.studies.family.record import Family, SpecialPointPath


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
    if found.point_paths:
        screen.print(_path_table(found))
    for point_path in found.point_paths:
        for text in _ends(point_path):
            screen.print(f"  {point_path.name} {text}", soft_wrap=True)


def _path_table(found: Family) -> Table:
    """Build the table of the special points at their first and their last member."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("special point")
    symbol, name = parameter_symbol(found.parameter), printable(parameter_symbol(found.over.name))
    for heading in ("period", "members", f"from {name}", f"at {symbol}", f"to {name}", f"at {symbol}"):
        table.add_column(heading, justify="right")
    table.add_column("joined")
    table.add_column("contact")
    for point_path in found.point_paths:
        ends = (point_path.places[0], point_path.places[-1])
        numbers = [text for end in ends for text in (f"{found.value(end):.6g}", f"{found.special(end).value:#.10g}")]
        joined = "" if not point_path.connections else "exactly" if point_path.exact else "by nearness"
        row = (
            point_path.name,
            str(point_path.period),
            str(len(point_path.places)),
            *numbers,
            joined,
            printable(point_path.contact),
        )
        table.add_row(*row)
    return table


def _ends(point_path: SpecialPointPath) -> list[str]:
    """Describe, as far as known, what happens to a special point before its first and after its last member."""
    before = [] if point_path.before is None else [f"before: {_text(point_path.before)}"]
    after = [] if point_path.after is None else [f"after: {_text(point_path.after)}"]
    on_the_way = [
        f"passes a {passage.kind} at ({passage.first:.8g}, {passage.value:.8g})"
        for connection in point_path.connections
        for passage in connection.passages
    ]
    return [*before, *on_the_way, *after]


def _text(connection: Connection) -> str:
    return printable(connection.text)
