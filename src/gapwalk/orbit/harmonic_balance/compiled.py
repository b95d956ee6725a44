"""How the kernels of harmonic balance are compiled, and kept.

At every point harmonic balance computes on a few hundred numbers: in calls of NumPy its loops would cost many times as
much as in themselves. Machine code is kept beside the file of each kernel, or in numba's folder of the user, so that a
process loads it in a fraction of a second; only the first one compiles it, in about 20 seconds.

Three rules. Kernels stand in one file with the parts that they call: numba compiles anew when the file of a kernel
changes, but does not look at other files. And they are written in numbers, not in whole arrays: each expression of
arrays brings in code for shapes, broadcasting and error messages, which takes longer to compile than the kernel.
And parts are inlined: the process that compiles a kernel would call the copies of them that it compiled one by one, a
process that loads it those that were optimised with it, and the two may round differently.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

# No assumption that there is no NaN: a motion that ran away must be seen. Division follows NumPy's rules.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz"},
    "nogil": True,
    "no_cfunc_wrapper": True,
}
_PART: dict[str, Any] = {**_OPTIONS, "no_cpython_wrapper": True, "forceinline": True}


def kernel(signature: str) -> Callable[[Any], Any]:
    """Compile a function for one signature, and keep the machine code where there is a place for it."""

    def compiled(function: Any) -> Any:
        try:
            return numba.njit(signature, cache=True, **_OPTIONS)(function)
        except RuntimeError:  # neither the package nor the user has a folder that can be written
            return numba.njit(signature, **_OPTIONS)(function)

    return compiled


def part(function: Any) -> Any:
    """Compile a function with the kernels that call it."""
    return numba.njit(**_PART)(function)
