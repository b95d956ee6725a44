"""Kernels: source text compiled to machine code once for each form, and cached in this process and on disk.

On disk, numba stores the machine code next to a file with the kernel's text; it checks the processor and its own
version. The cache is loaded as code. So only a folder that nobody else can write to is trusted, and only files that are
unchanged.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from gapwalk.ensemble.kernel_source import Form, Source
from gapwalk.flow.flow_cache import cache_folder, is_private, write_whole

_MOST = 200
"""Largest number of kernels in the cache; above it the oldest ones are removed."""
# NaN must be respected, because it marks a diverged motion. Apart from that, terms may be reordered and fused.
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_SIGNATURE = "boolean(f8[::1], f8[::1], f8[::1], i8, i8, i8, i8, f8[:, :, ::1], i8[::1], f8[:, ::1], f8, i8[::1])"
_compiling = Lock()


@dataclass(frozen=True)
class Kernel:
    """Compiled code that advances a block of lanes over forcing periods; see `Source` for its arrays."""

    source: Source  #: Its source text, and the layout of its arrays.
    #: ``advance(S, C, T, first, periods, steps, every, record, left, last, limit, stop)``; it releases the interpreter
    #: lock. It returns False if it was stopped.
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


def kernel_file(text: str, *, folder: Path | None = None) -> Path | None:
    """Return a file with the text of a kernel in the user's cache; None if no folder can be trusted or written to."""
    try:
        folder = cache_folder("kernels") if folder is None else folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not all(is_private(each) for each in (folder, folder / "__pycache__") if each.exists()):
            return None
        file = folder / f"k{hashlib.sha256(text.encode()).hexdigest()[:32]}.py"
        if not file.exists() or file.read_text(encoding="utf-8") != text:  # new, or damaged
            write_whole(file, text.encode())
            _forget_oldest(folder)
        elif not _is_sealed(file):
            forget(file)
            write_whole(file, text.encode())
        return file
    except (OSError, RuntimeError, UnicodeDecodeError):  # RuntimeError: there is no home
        return None


def _forget_oldest(folder: Path) -> None:
    files = sorted(folder.glob("k*.py"), key=lambda file: file.stat().st_mtime, reverse=True)
    for file in files[_MOST:]:
        forget(file)


def forget(file: Path) -> None:
    """Remove a kernel and all its machine code."""
    with suppress(OSError):
        for each in (_seal_of(file), file, *_stored_code(file)):
            each.unlink(missing_ok=True)


def _seal_of(file: Path) -> Path:
    return file.with_suffix(".sha256")


def _stored_code(file: Path) -> list[Path]:
    return sorted((file.parent / "__pycache__").glob(f"{file.stem}.*"))


def _is_sealed(file: Path) -> bool:
    seal = _seal_of(file)
    return seal.exists() and seal.read_text(encoding="ascii") == _checksum(file)


def seal(file: Path) -> None:
    """Store the checksum of a kernel's machine code; without it, or after a change, the code is not loaded again."""
    with suppress(OSError):  # then it will be compiled again
        if not _is_sealed(file):
            write_whole(_seal_of(file), _checksum(file).encode())


def _checksum(file: Path) -> str:
    """Compute the checksum of all machine code of a kernel, for every processor if several machines share a home."""
    digest = hashlib.sha256()
    for each in _stored_code(file):
        digest.update(each.name.encode() + each.read_bytes())
    return digest.hexdigest()


def _machine_code(text: str, file: Path | None = None) -> Callable[..., bool]:
    """Compile a kernel, or load its machine code if that is stored next to a file with its text."""
    import numba  # imported late: it takes longer to load than all other packages

    names: dict[str, Any] = {"np": np, "__name__": __name__}
    exec(compile(text, "<batch integrator>" if file is None else str(file), "exec"), names)
    # NumPy's rules for division: a check for zero in every lane would forbid SIMD
    keep = file is not None
    compiler = numba.njit(_SIGNATURE, nogil=True, error_model="numpy", fastmath=_FAST, cache=keep)
    return compiler(names["advance"])
