"""Summaries of records as text: lines, tables and trees on a console, or in a string."""

from __future__ import annotations

from io import StringIO

from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.tree import Tree as RichTree

from gapwalk.summary import SummaryParts, Table, Tree

_WIDTH = 1000  # of text, where tables are not folded


def render(summary: SummaryParts, screen: Console) -> None:
    """Print the parts of a summary on a console."""
    for part in summary:
        if isinstance(part, Table):
            screen.print(_rich_table(part))
        elif isinstance(part, Tree):
            screen.print(_rich_tree(part))
        else:
            screen.print(printable(part), soft_wrap=True)


def text_of(summary: SummaryParts) -> str:
    """Return the parts of a summary as text."""
    stream = StringIO()
    render(summary, Console(file=stream, markup=False, emoji=False, highlight=False, width=_WIDTH, color_system=None))
    return "\n".join(line.rstrip() for line in stream.getvalue().rstrip().split("\n"))


def printable(text: str) -> str:
    """Make a text from a file safe for a terminal."""
    return "".join(char if char.isprintable() or char == "\n" else repr(char)[1:-1] for char in text)


def _rich_table(table: Table) -> RichTable:
    made = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for heading, is_right in table.columns:
        made.add_column(printable(heading), justify="right" if is_right else "left")
    for number, row in enumerate(table.rows):
        made.add_row(*map(printable, row), end_section=number in table.groups)
    return made


def _rich_tree(tree: Tree, above: RichTree | None = None) -> RichTree:
    label = printable(tree.label)
    made = RichTree(label, guide_style="dim") if above is None else above.add(label)
    for child in tree.children:
        _rich_tree(child, made)
    return made
