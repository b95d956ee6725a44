"""A saved page as one HTML file: text, style and modules of the explorer's page, Plotly, and what the page shows."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

_PAGE = files("gapwalk.explorer") / "page"
_ENTRY = "saved.js"
_INSTEAD = {"api.js": "saved_data.js"}  # there is no server: its answers are in the file
_IMPORT = re.compile(r'(\bfrom|\bimport) "\./([\w-]+\.js)"')
_HEAD = re.compile(r"<title>.*?(?=</head>)", re.S)
_ICON = "/static/icon.svg"


def html_file(title: str, shown: Any, numbers: bytes | bytearray) -> bytes:
    """Return the whole file."""
    plotly = (files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    head = [
        f"<title>{html.escape(title)} – gapwalk</title>",
        f'<link rel="icon" href="{_icon()}">',
        f"<style>\n{_text('style.css').replace(_ICON, _icon())}</style>",
        f'<script type="importmap">{json.dumps({"imports": _modules()})}</script>',
        f'<script type="text/plain" id="plotly">{_zipped(plotly)}</script>',
        f'<script type="text/plain" id="shown">{_zipped(json.dumps(shown).encode())}</script>',
        f'<script type="text/plain" id="numbers">{_zipped(numbers)}</script>',
        f'<script type="module">import "gapwalk/{_ENTRY}";</script>\n',
    ]
    page = _HEAD.sub(lambda _: "\n".join(head), _text("index.html"), count=1)
    return page.replace("<body>", '<body class="saved">', 1).encode()


def _modules() -> dict[str, str]:
    """Return the modules of the page as data URLs, in which they can import others only by bare names."""
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


def _icon() -> str:
    return _data("image/svg+xml", _text("icon.svg"))


def _data(kind: str, text: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(text.encode()).decode()}"


def _zipped(content: bytes | bytearray) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


STEPS = 1 << 14
"""Levels between the least and the greatest value of a drawn array: more than a screen has pixels."""

_SHORTEST = 8  # of a list that is packed


class Blob:
    """Collector of arrays in one run of bytes, which ``page/saved_data.js`` reads."""

    def __init__(self) -> None:
        self.content = bytearray()

    def exact(self, values: ArrayLike, kind: str) -> dict[str, Any]:
        """Store an array as it is; `kind` is its little-endian dtype: ``f8``, ``f4``, ``i4``, ``i2`` or ``u1``."""
        array = np.asarray(values, dtype=f"<{kind}")
        return {"kind": kind, "at": self._take(array.tobytes(), array.itemsize), "n": len(array)}

    def drawn(self, values: ArrayLike) -> dict[str, Any]:
        """Store a curve in `STEPS` levels, as fine as a screen: their second differences, low bytes first."""
        array = np.asarray(values, dtype=float)
        low, high = float(array.min()), float(array.max())
        levels = np.rint((array - low) * ((STEPS - 1) / ((high - low) or 1.0))).astype(np.int64)
        steps = np.diff(np.diff(levels, prepend=0), prepend=0).astype(np.uint16)  # modulo 2**16: nothing is lost
        content = (steps & 0xFF).astype(np.uint8).tobytes() + (steps >> 8).astype(np.uint8).tobytes()
        return {"kind": "drawn", "at": self._take(content, 1), "n": len(array), "low": low, "high": high}

    def packed(self, plain: Any) -> Any:
        """Return a JSON value with its long lists of numbers stored as curves."""
        if isinstance(plain, dict):
            return {key: self.packed(value) for key, value in plain.items()}
        if isinstance(plain, list):
            if len(plain) >= _SHORTEST and all(isinstance(each, float) for each in plain):
                return self.drawn(plain)
            return [self.packed(each) for each in plain]
        return plain

    def _take(self, content: bytes, size: int) -> int:
        """Append bytes, and return their place, a multiple of the size of an element."""
        self.content += b"\0" * (-len(self.content) % size)
        at = len(self.content)
        self.content += content
        return at
