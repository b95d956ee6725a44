"""A function of pieces of work that travels once to each worker, with all that they share: the system above all."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cached_property
from hashlib import sha256
from typing import Any

from gapwalk.errors import WorkError
from gapwalk.pieces import tell

_held: dict[bytes, Callable[[Any], Any]] = {}  # in a worker: the function that came last


class Shared:
    """A function of pieces of work, to be sent apart from them."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function

    @cached_property
    def packed(self) -> bytes:
        """The function as bytes."""
        return pickle.dumps(self.function, pickle.HIGHEST_PROTOCOL)

    @cached_property
    def key(self) -> bytes:
        """Digest of the function, by which a worker knows it."""
        return sha256(self.packed).digest()


def do_shared(key: bytes, packed: bytes | None, piece: Any) -> Any:
    """Do a piece in a worker by the function that came before, or comes now."""
    function = _held.get(key)
    if function is None:
        if packed is None:
            raise WorkError("a worker has lost the function of its pieces of work")
        function = pickle.loads(packed)
        _held.clear()  # one is enough, for pieces of two functions are hardly ever under way at once
        _held[key] = function
    try:
        return function(piece)
    finally:
        tell(0.0)
