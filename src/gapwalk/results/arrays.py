"""Bytes of a stored value: its arrays, one after the other, in the order in which its JSON refers to them."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Node = Any
"""Values that JSON can write."""

_DIMENSIONS = 8  # at most, of an array
_KEYS = {"array", "shape"}


class Writer:
    """Collector of the arrays of a value that is being written; `base` as in `encode`."""

    def __init__(self, base: Any) -> None:
        self.base = base
        self.chunks: list[bytes] = []

    def put(self, array: NDArray[Any], code: str) -> Node:
        """Add an array of numbers; return the node that refers to it."""
        self.chunks.append(np.ascontiguousarray(array, dtype=f"<{code}").tobytes())
        return {"array": code, "shape": list(array.shape)}


class Reader:
    """Source of the arrays of a value that is being read, in the order of writing; `base` as in `encode`.

    Attributes
    ----------
    size
        Bytes of all that is read: each item of a tuple takes at least one.
    """

    def __init__(self, data: bytes, size: int, base: Any) -> None:
        self.size, self.base = size, base
        self._data, self._at = data, 0

    def take(self, node: Node, code: str) -> NDArray[Any]:
        """Return the next array, of numbers of one kind."""
        shape: Any = node.get("shape") if isinstance(node, dict) else None
        if not is_shape(shape) or set(node) != _KEYS or node["array"] != code:
            raise ValueError(f"there is {json.dumps(node):.60} where an array of the kind {code} should be")
        dtype = np.dtype(f"<{code}")
        size = math.prod(shape) * dtype.itemsize
        if size > len(self._data) - self._at:
            raise ValueError(f"an array has the stated shape {shape}, but its bytes are missing")
        found = np.frombuffer(self._data, dtype, math.prod(shape), self._at).astype(dtype.newbyteorder("="))
        self._at += size
        if code == "b1" and found.view(np.uint8).max(initial=0) > 1:
            raise ValueError("an array of truth values holds something else")
        return found.reshape(shape)

    def check_empty(self) -> None:
        """Raise a ValueError unless all bytes were taken."""
        if self._at != len(self._data):
            raise ValueError(f"{len(self._data) - self._at} bytes are left over")


def is_shape(shape: Any) -> bool:
    """Return True if a value that was read can be the shape of an array."""
    return (
        isinstance(shape, list)
        and len(shape) <= _DIMENSIONS
        and all(type(length) is int and 0 <= length < 1 << 62 for length in shape)
    )
