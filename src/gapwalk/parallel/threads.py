"""Number of threads of linear algebra: one, unless the user has chosen another number.

The matrices are small. Several threads would wait for one another, and be up to twenty times slower on a busy machine.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def work_in_one_thread() -> None:
    """Have linear algebra of this process work in one thread; to be called before NumPy is loaded."""
    os.environ.update(_wanted())


@contextmanager
def children_in_one_thread() -> Iterator[None]:
    """Have linear algebra of processes that are started inside work in one thread: together they fill all cores."""
    changes = _wanted()
    os.environ.update(changes)
    try:
        yield
    finally:
        for name in changes:
            del os.environ[name]


def _wanted() -> dict[str, str]:
    """Return the variables to set: none if the user has set one of them, which may be meant for all."""
    return {} if any(name in os.environ for name in THREAD_VARIABLES) else dict.fromkeys(THREAD_VARIABLES, "1")
