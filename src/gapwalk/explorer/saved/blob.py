"""Many arrays as one run of bytes that compresses well, and where each of them lies in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

STEPS = 1 << 14
"""Levels between the least and the greatest value of a drawn array: more than a screen has pixels."""

_SHORTEST = 8  # of a list that is packed


class Blob:
    """Takes arrays, and says where they are; ``page/shelf.js`` reads them."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    @property
    def content(self) -> bytes:
        """All bytes."""
        return b"".join(self._parts)

    def exact(self, values: ArrayLike, kind: str) -> dict[str, Any]:
        """Keep an array as it is; `kind` is its little-endian dtype: ``f8``, ``f4``, ``i4`` or ``u1``."""
        array = np.asarray(values, dtype=f"<{kind}")
        return {"kind": kind, "at": self._take(array.tobytes(), array.itemsize), "n": len(array)}

    def drawn(self, values: ArrayLike) -> dict[str, Any]:
        """Keep a curve for the eye: `STEPS` levels, of which second differences are kept, low bytes first."""
        array = np.asarray(values, dtype=float)
        low, high = float(array.min()), float(array.max())
        levels = np.rint((array - low) * ((STEPS - 1) / ((high - low) or 1.0))).astype(np.int64)
        steps = _differences(_differences(levels)).astype(np.uint16)  # modulo 2**16: nothing is lost
        content = (steps & 0xFF).astype(np.uint8).tobytes() + (steps >> 8).astype(np.uint8).tobytes()
        return {"kind": "drawn", "at": self._take(content, 1), "n": len(array), "low": low, "high": high}

    def packed(self, plain: Any) -> Any:
        """The same JSON value, with its long lists of numbers kept as curves."""
        if isinstance(plain, dict):
            return {key: self.packed(value) for key, value in plain.items()}
        if isinstance(plain, list):
            if len(plain) >= _SHORTEST and all(isinstance(each, float) for each in plain):
                return self.drawn(plain)
            return [self.packed(each) for each in plain]
        return plain

    def _take(self, content: bytes, size: int) -> int:
        """Where these bytes will be: at a multiple of the size of an element."""
        pad = -self._size % size
        self._parts += [b"\0" * pad, content]
        at = self._size + pad
        self._size = at + len(content)
        return at


def _differences(values: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.diff(values, prepend=0)
