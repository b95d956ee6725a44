"""The card of a value in a notebook: its name, a table, and a small picture."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable, Sequence
from typing import NamedTuple

from gapwalk.errors import GapwalkError
from gapwalk.plot.sheet import new_sheet
from gapwalk.plot.size import CARD, drawn_at
from gapwalk.plot.style import SIZE, in_style

_CELL = "text-align: left; padding: 1px 12px 1px 0; background: none; vertical-align: top"
_MOST = 12  # rows of a table
_DPI = 110


class Card(NamedTuple):
    """What stands on a card.

    Parameters
    ----------
    title
        What it is.
    facts
        Name and value of what there is to know first.
    head, rows
        A table, if there is one: the names of its columns, and its rows.
    draw
        Draws the picture into the axes `ax`; None for none.
    note
        What else there is to say.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    draw: Callable[..., object] | None = None
    note: str = ""


def card_of(value: object) -> str:
    """The card of a value as HTML: it takes its colours from the page, and fetches nothing."""
    from gapwalk.plot.facts import facts_of  # what it draws with is loaded for the first card only

    card = facts_of(value)
    parts = [f"<b>{html.escape(card.title)}</b>", _table((), card.facts, len(card.facts))]
    if card.rows:
        parts.append(_table(card.head, card.rows, _MOST))
    if card.note:
        parts.append(f"<div>{html.escape(card.note)}</div>")
    left = f'<div style="flex: 0 1 auto">{"".join(parts)}</div>'
    picture = _picture(card.draw) if card.draw else ""
    return f'<div style="display: flex; flex-wrap: wrap; gap: 4px 24px; align-items: flex-start">{left}{picture}</div>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], most: int) -> str:
    lines = [_row(head, "th")] if head else []
    lines += [_row(row, "td") for row in rows[:most]]
    if len(rows) > most:
        lines.append(_row([f"and {len(rows) - most} more"], "td"))
    return f'<table style="margin: 4px 0; border: none">{"".join(lines)}</table>'


def _row(cells: Sequence[str], kind: str) -> str:
    texts = "".join(f'<{kind} style="{_CELL}">{html.escape(cell)}</{kind}>' for cell in cells)
    return f'<tr style="background: none; border: none">{texts}</tr>'


def _picture(draw: Callable[..., object]) -> str:
    """A small picture inside of the page; empty if it cannot be drawn."""
    try:
        with drawn_at(CARD), in_style():
            figure = new_sheet(SIZE)
            draw(ax=figure.add_subplot())
            content = io.BytesIO()
            figure.savefig(content, format="png", dpi=_DPI)
    except GapwalkError:
        return ""
    data = base64.b64encode(content.getvalue()).decode()
    return f'<img alt="" style="max-width: 460px; margin: 0" src="data:image/png;base64,{data}">'
