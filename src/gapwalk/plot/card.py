"""Cards of records in a notebook: the lines, tables and trees of their summary, and a small picture."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator, Sequence

from gapwalk.errors import GapwalkError
from gapwalk.notebook import Shown
from gapwalk.plot.picture import drawing_of, unpacked
from gapwalk.plot.sheet import new_sheet, png_bytes
from gapwalk.plot.style import CARD, in_style, sized
from gapwalk.summary import Table, Tree

_CELL = "text-align: {}; padding: 1px 12px 1px 0; background: none; vertical-align: top"
_MOST = 12  # most rows of a table, lines of a tree, and lines outside of both
_LONGEST = 300  # most letters of a line
_DPI = 110


def card_of(record: Shown) -> str:
    """Write the card of a record as HTML, with the colours of the page and without external files."""
    title = getattr(record, "title", "") or type(record).__name__
    parts, lines = [f"<b>{html.escape(title)}</b>"], []
    for part in record.summary():
        if isinstance(part, Table):
            headings, is_right = zip(*part.columns, strict=True)
            rows = [_row(headings, is_right, "th"), *(_row(row, is_right, "td") for row in part.rows)]
            parts.append(f'<table style="margin: 4px 0; border: none">{"".join(_first(rows, "<tr><td>{}</td></tr>"))}')
            parts.append("</table>")
        elif isinstance(part, Tree):
            parts += _first(list(_branches(part, 0)), "<div>{}</div>")
        else:
            lines.append(f"<div>{_text(part)}</div>")
    parts[1:1] = _first(lines, "<div>{}</div>")
    left = f'<div style="flex: 0 1 auto">{"".join(parts)}</div>'
    picture = _picture(record)
    return f'<div style="display: flex; flex-wrap: wrap; gap: 4px 24px; align-items: flex-start">{left}{picture}</div>'


def _row(cells: Sequence[str], is_right: Sequence[bool], kind: str) -> str:
    sides = ("right" if each else "left" for each in is_right)
    texts = (
        f'<{kind} style="{_CELL.format(side)}">{_text(cell)}</{kind}>' for side, cell in zip(sides, cells, strict=True)
    )
    return f'<tr style="background: none; border: none">{"".join(texts)}</tr>'


def _branches(tree: Tree, depth: int) -> Iterator[str]:
    yield f'<div style="margin-left: {1.5 * depth}em">{_text(tree.label)}</div>'
    for child in tree.children:
        yield from _branches(child, depth + 1)


def _first(lines: list[str], last: str) -> list[str]:
    """Return the first lines, and a line with the number of further ones."""
    return lines if len(lines) <= _MOST else [*lines[:_MOST], last.format(f"and {len(lines) - _MOST} more")]


def _text(text: str) -> str:
    return html.escape(text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ...").replace("\n", "<br>")


def _picture(record: Shown) -> str:
    """Draw a small picture embedded in the page; return an empty text if there is none."""
    try:
        record, _, _ = unpacked(record, {}, None, in_axes=True)
        drawing, _ = drawing_of(record, in_axes=True)
        plain = {name: False for name in ("labels", "legend") if name in drawing.options}
        with sized(CARD), in_style():
            figure = new_sheet()
            if finish := drawing.draw(record, figure.add_subplot(), **plain):
                finish()
            data = base64.b64encode(png_bytes(figure, _DPI)).decode()
    except GapwalkError:
        return ""
    return f'<img alt="" style="max-width: 460px; margin: 0" src="data:image/png;base64,{data}">'
