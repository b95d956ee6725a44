"""LAPACK and matrix functions of SciPy, without what its package loads of NumPy and nobody uses here.

The package copies all names of NumPy, and so loads NumPy's tests and its compiler of Fortran, which are loaded by name
when they are used. That is two fifths of the time of its import.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

_UNUSED = ("f2py", "testing")


@contextmanager
def _without_unused_names() -> Iterator[None]:
    """Hide some names of NumPy from those who copy all of them."""
    module: Any = np
    names, list_names = module.__all__, module.__dir__
    shown = [name for name in list_names() if name not in _UNUSED]
    module.__all__, module.__dir__ = [name for name in names if name not in _UNUSED], lambda: shown
    try:
        yield
    finally:
        module.__all__, module.__dir__ = names, list_names


with _without_unused_names():
    import scipy.linalg

eig, expm, lapack = scipy.linalg.eig, scipy.linalg.expm, scipy.linalg.lapack
