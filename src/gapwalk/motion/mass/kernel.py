"""Kernels: the source text compiled to machine code, once for each form, and kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import Any

import numpy as np

from gapwalk.motion.mass.form import Form
from gapwalk.motion.mass.source import Source

# No assumption that there is no NaN: a motion that ran away must be seen. Otherwise terms may be reordered and fused.
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_SIGNATURE = "boolean(f8[::1], f8[::1], f8[::1], i8, i8, i8, i8, f8[:, :, ::1], i8[::1], f8[:, ::1], f8, i8[::1])"
_compiling = Lock()


@dataclass(frozen=True)
class Kernel:
    """Compiled code that carries a block of lanes over forcing periods; see `Source` for its arrays.

    Attributes
    ----------
    source
        Its text, and the layout of its arrays.
    advance
        ``advance(S, C, T, first, periods, steps, every, record, left, last, limit, stop)``; it holds no interpreter
        lock. False if it was stopped.
    """

    source: Source
    advance: Callable[..., bool]


def kernel_of(form: Form) -> Kernel:
    """The kernel of a form, compiled when it is first asked for (about a second)."""
    with _compiling:
        return _compile(form)


@lru_cache(maxsize=64)
def _compile(form: Form) -> Kernel:
    import numba  # takes longer to load than all the rest

    source = Source(form)
    names: dict[str, Any] = {"np": np}
    exec(compile(source.text, "<mass flow>", "exec"), names)
    # NumPy's rules for division: a check for zero in every lane would forbid SIMD
    compiler = numba.njit(_SIGNATURE, nogil=True, error_model="numpy", fastmath=_FAST)
    return Kernel(source, compiler(names["advance"]))
