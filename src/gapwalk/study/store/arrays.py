"""Arrays by name as bytes, and back bit for bit; nothing in them can run."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.files import check_npz

Arrays = Mapping[str, NDArray[Any]]
"""Arrays of numbers or text by name."""


def pack_arrays(arrays: Arrays) -> bytes:
    """The bytes of some arrays."""
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **dict(arrays))
    return content.getvalue()


def unpack_arrays(data: bytes) -> Arrays:
    """The arrays of these bytes; a ValueError if they are none."""
    try:
        check_npz(io.BytesIO(data), len(data))  # they are stored as they are
        with np.load(io.BytesIO(data), allow_pickle=False) as parts:
            return {name: parts[name] for name in parts.files}
    except (LookupError, OSError, EOFError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise ValueError(f"these bytes are no arrays ({error})") from error
