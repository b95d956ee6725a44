"""Write what colours, dashes and markers mean into the page on pictures: ``python -m docs._ext.meanings``."""

from __future__ import annotations

import re
from pathlib import Path

from gapwalk.bifurcation.special_point import Kind
from gapwalk.meanings import AREA_OF_ONE, MEANINGS, REGIMES, TINTS, period_color
from gapwalk.plot.style import CODIM2, symbol_style

PAGE = Path(__file__).parent.parent / "howto" / "pictures.md"
BEGIN, END = "<!-- meanings: made by docs/_ext/meanings.py -->\n", "<!-- end of meanings -->\n"
_DASHES = {"": "solid", "below": "dashed", "above": "dotted", "pair": "dash and dot", "second": "long dashes"}
_DASHES |= {"third": "long dash, dot", "fourth": "long dash, two dots"}
_MARKERS = {"^": "△", "s": "□", "o": "○", "d": "◇", "D": "◆", "*": "★", "P": "✚", "|": "❘", "x": "×", "+": "+"}
_FILLED = {"o": "●", "h": "⬢"}
_MARKERS |= {"1": "Y", "2": "⅄", "h": "⬡", "v": "▽", "X": "✖", "p": "⬠", "8": "⯃"}


def table() -> str:
    """Return the tables in Markdown."""
    lines = [
        "| colour | lines and symbols | line |",
        "|---|---|---|",
        *(f"| {_patch(each.color)} | {each.what} | {_line(each.name, each.marker)} |" for each in MEANINGS),
        f"| {''.join(_patch(period_color(m)) for m in (1, 2, 4, 8))} | periods 1, 2, 4, 8 | stable: solid |",
        f"| {''.join(_patch(period_color(m)) for m in (3, 6, 12))} | periods 3, 6, 12 | unstable: thin, dashed |",
        f"| {''.join(_patch(period_color(m)) for m in (5, 10, 7, 14, 9))} | periods 5, 10; 7, 14; all others | |",
        "",
        "| marker | special point |",
        "|---|---|",
        *(f"| {_marked(symbol_style(kind))} | {symbol_style(kind).legend} |" for kind in Kind.known()),
        *(f"| {_MARKERS.get(marker, marker)} | {text} |" for marker, text in _meetings()),
        "| ◯ | number of special points there |",
        "| ? | a step that is not explained |",
        "",
        "| colour | areas |",
        "|---|---|",
        *(f"| {_patch(each.color)} | {each.what} |" for each in TINTS),
        f"| {_patch(AREA_OF_ONE)} | period 1; other periods as their lines |",
        *(f"| {_patch(color)} | {name} |" for name, color in REGIMES.items()),
    ]
    return "\n".join(lines) + "\n"


def _patch(color: str) -> str:
    return f'<span style="background: {color}; border: 1px solid #999999">&emsp;</span>'


def _line(name: str, marker: str) -> str:
    return ", ".join(filter(None, (_DASHES.get(name, _DASHES[""]), _MARKERS.get(marker, ""))))


def _marked(look) -> str:
    mark = _FILLED.get(look.marker) or _MARKERS.get(look.marker, look.marker)
    return f'<span style="color: {look.color}; background: #ffffff">{mark}</span>'


def _meetings() -> list[tuple[str, str]]:
    """Return marker and legend of the points of codimension two, each once."""
    return list(dict.fromkeys((look.marker, look.legend) for look in CODIM2.values() if look.label))


def whole(text: str) -> str:
    """Return the page with the tables as they are now."""
    return re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: f"{BEGIN}\n{table()}\n{END}", text, flags=re.S)


if __name__ == "__main__":
    PAGE.write_text(whole(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
