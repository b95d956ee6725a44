"""Kernels: source text compiled to machine code once for each form, and cached in this process and on disk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from gapwalk.ensemble.kernel_cache import forget, kernel_file, seal
from gapwalk.ensemble.kernel_form import Form
from gapwalk.ensemble.kernel_source import Source

# NaN must be respected, because it marks a diverged motion. Apart from that, terms may be reordered and fused.
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_SIGNATURE = "boolean(f8[::1], f8[::1], f8[::1], i8, i8, i8, i8, f8[:, :, ::1], i8[::1], f8[:, ::1], f8, i8[::1])"
_compiling = Lock()


@dataclass(frozen=True)
class Kernel:
    """Compiled code that advances a block of lanes over forcing periods; see `Source` for its arrays.

    Attributes
    ----------
    source
        Its source text, and the layout of its arrays.
    advance
        ``advance(S, C, T, first, periods, steps, every, record, left, last, limit, stop)``; it releases the
        interpreter lock. It returns False if it was stopped.
    """

    source: Source
    advance: Callable[..., bool]


def kernel_of(form: Form) -> Kernel:
    """Return the kernel of a form: compiled on first use (about a second), later loaded from the cache."""
    with _compiling:
        return _compile(form)


@lru_cache(maxsize=64)
def _compile(form: Form) -> Kernel:
    source = Source(form)
    file = kernel_file(source.text)
    if file is None:
        return Kernel(source, _machine_code(source.text))
    try:
        code = _machine_code(source.text, file)
        seal(file)
        return Kernel(source, code)
    except Exception:  # damaged files may raise anything; the next request writes them again
        forget(file)
        return Kernel(source, _machine_code(source.text))


def _machine_code(text: str, file: Path | None = None) -> Callable[..., bool]:
    """Compile a kernel, or load its machine code if that is stored next to a file with its text."""
    import numba  # imported late: it takes longer to load than all other packages

    names: dict[str, Any] = {"np": np, "__name__": __name__}
    exec(compile(text, "<batch integrator>" if file is None else str(file), "exec"), names)
    # NumPy's rules for division: a check for zero in every lane would forbid SIMD
    keep = file is not None
    compiler = numba.njit(_SIGNATURE, nogil=True, error_model="numpy", fastmath=_FAST, cache=keep)
    return compiler(names["advance"])
