"""A cache of compiled kernels on disk, so that the next process, and each worker, need not compile them again.

numba stores the machine code next to a file with the kernel's text; it checks the processor and its own version. The
cache is loaded as code. So only a folder that nobody else can write to is trusted, and only files that are unchanged.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path

from gapwalk.flow.cache_folder import cache_folder, is_private, write_whole

_MOST = 200
"""Largest number of kernels in the cache; above it the oldest ones are removed."""


def kernel_file(text: str, *, folder: Path | None = None) -> Path | None:
    """Return a file with the text of a kernel in the user's cache; None if no folder can be trusted or written to.

    Parameters
    ----------
    text
        The text; its hash is the name of the file.
    folder
        The folder; by default ``gapwalk/kernels`` in ``$XDG_CACHE_HOME`` or ``~/.cache``.
    """
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


def seal(file: Path) -> None:
    """Store the checksum of a kernel's machine code; without it, or after a change, the code is not loaded again."""
    with suppress(OSError):  # then it will be compiled again
        if not _is_sealed(file):
            write_whole(_seal_of(file), _checksum(file).encode())


def forget(file: Path) -> None:
    """Remove a kernel and all its machine code."""
    with suppress(OSError):
        for each in (_seal_of(file), file, *_machine_code(file)):
            each.unlink(missing_ok=True)


def _machine_code(file: Path) -> list[Path]:
    return sorted((file.parent / "__pycache__").glob(f"{file.stem}.*"))


def _seal_of(file: Path) -> Path:
    return file.with_suffix(".sha256")


def _is_sealed(file: Path) -> bool:
    seal = _seal_of(file)
    return seal.exists() and seal.read_text(encoding="ascii") == _checksum(file)


def _checksum(file: Path) -> str:
    """Compute the checksum of all machine code of a kernel, for every processor if several machines share a home."""
    digest = hashlib.sha256()
    for each in _machine_code(file):
        digest.update(each.name.encode() + each.read_bytes())
    return digest.hexdigest()


def _forget_oldest(folder: Path) -> None:
    files = sorted(folder.glob("k*.py"), key=lambda file: file.stat().st_mtime, reverse=True)
    for file in files[_MOST:]:
        forget(file)
