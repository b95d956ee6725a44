"""Records written and read again, without a file."""

from typing import Any

import gapwalk.results.codec  # noqa: F401 (it registers how systems and orbits are kept)
from gapwalk.results.codec import decode, encode


def again(value: Any, kind: Any = None, base: Any = None) -> Any:
    """What is read of a value that was written as one of a type, by default its own."""
    kind = type(value) if kind is None else kind
    return decode(encode(value, kind, base), kind, base)
