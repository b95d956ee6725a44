"""The explorer's page as one HTML file: its text, style and modules, Plotly, and what it shows."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from importlib.resources import files
from typing import Any

_PAGE = files("gapwalk.explorer") / "page"
_ENTRY = "kept.js"
_INSTEAD = {"api.js": "shelf.js"}  # nobody is asked: what the server would answer is in the file
_IMPORT = re.compile(r'(\bfrom|\bimport) "\./([\w-]+\.js)"')
_HEAD = re.compile(r"<title>.*?(?=</head>)", re.S)
_ICON = "/static/icon.svg"


def bundle(title: str, shown: Any, numbers: bytes) -> bytes:
    """The whole file.

    Parameters
    ----------
    title
        Of the page.
    shown
        What is shown, as a JSON value; see `gapwalk.explorer.saved.content`.
    numbers
        The arrays that it speaks of.
    """
    plotly = (files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    head = [
        f"<title>{html.escape(title)} – gapwalk</title>",
        f'<link rel="icon" href="{_icon()}">',
        f"<style>\n{_style()}</style>",
        f'<script type="importmap">{json.dumps({"imports": _modules()})}</script>',
        f'<script type="text/plain" id="plotly">{_zipped(plotly)}</script>',
        f'<script type="text/plain" id="shown">{_zipped(json.dumps(shown).encode())}</script>',
        f'<script type="text/plain" id="numbers">{_zipped(numbers)}</script>',
        f'<script type="module">import "gapwalk/{_ENTRY}";</script>\n',
    ]
    page = _HEAD.sub(lambda _: "\n".join(head), _text("index.html"), count=1)
    return page.replace("<body>", '<body class="kept">', 1).encode()


def _modules() -> dict[str, str]:
    """The modules that the page needs, as data; one that lies in data can only name others by bare names."""
    found: dict[str, str] = {}
    left = [_ENTRY]
    while left:
        name = left.pop()
        if f"gapwalk/{name}" in found:
            continue
        text = _text(_INSTEAD.get(name, name))
        left += [other for _, other in _IMPORT.findall(text)]
        found[f"gapwalk/{name}"] = _data("text/javascript", _IMPORT.sub(r'\1 "gapwalk/\2"', text))
    return found


def _style() -> str:
    return _text("style.css").replace(_ICON, _icon())


def _icon() -> str:
    return _data("image/svg+xml", _text("icon.svg"))


def _data(kind: str, text: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(text.encode()).decode()}"


def _zipped(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
