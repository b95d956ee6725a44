"""Machine code by LLVM: compiled from text, or kept on disk for the next process.

What is kept is named by the processor and by the source, and begins with a checksum; the folder must be the user's own.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from gapwalk.cache_folder import trusted, write_whole

_CHECKSUM = 32  # bytes of the checksum with which a file begins


@cache
def _llvm() -> Any:
    from llvmlite import binding  # only now: a command that compiles nothing need not wait for it

    return binding


@cache
def _target() -> Any:
    llvm = _llvm()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    # the mathematics of the interpreter itself, of which Windows has several
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    for name in ("sin", "cos", "exp", "log", "tanh", "pow", "sqrt"):
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return llvm.Target.from_default_triple()


def _machine(effort: int = 2) -> Any:
    """Return a target machine; an engine owns its own, which ends with it."""
    features = _llvm().get_host_cpu_features().flatten()
    return _target().create_target_machine(cpu=_llvm().get_host_cpu_name(), features=features, opt=effort, jit=True)


def engine_of(text: str) -> Any:
    """Compile a module, and return the engine that has its functions."""
    machine = _machine(1)  # compiles twice as fast as 2; straight-line code on vectors is as fast
    module = _llvm().parse_assembly(f'target triple = "{_target().triple}"\n{text}')
    engine = _llvm().create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine


_engines: list[Any] = []  # functions live as long as their engines


def engine_of_object(content: bytes) -> Any:
    """Load an object file, and return the engine that has its functions."""
    machine = _machine()
    engine = _llvm().create_mcjit_compiler(_llvm().parse_assembly(""), machine)
    engine.add_object_file(_llvm().object_file.ObjectFileRef.from_data(content))
    engine.finalize_object()
    _engines.append(engine)
    return engine


def object_of(text: str) -> bytes:
    """Compile a module to an object file."""
    _target()
    return _machine().emit_object(_llvm().parse_assembly(text))


def kept(
    name: str, source: bytes, compiled: Callable[[], list[tuple[str, bytes]]], folder: Path | None = None
) -> list[tuple[str, bytes]]:
    """Return (function, object file) of some parts, as they are kept for a source; else compile and keep them."""
    about = f"{_llvm().llvm_version_info} {_llvm().get_host_cpu_name()} {_llvm().get_host_cpu_features().flatten()}"
    stem = hashlib.sha256(about.encode() + source).hexdigest()[:24]
    folder = trusted(folder, "kernels")
    file = None if folder is None else folder / f"{name}-{stem}.bin"
    if file is not None and (found := _read(file)) is not None:
        return found
    parts = compiled()
    if file is not None:
        head = json.dumps([(function, len(content)) for function, content in parts]).encode() + b"\n"
        content = head + b"".join(each for _, each in parts)
        with suppress(OSError):
            write_whole(file, hashlib.sha256(content).digest() + content)
    return parts


def _read(file: Path) -> list[tuple[str, bytes]] | None:
    """Return the parts in a file; None if there is none, or it is not as it was written."""
    with suppress(OSError, ValueError):
        whole = file.read_bytes()
        content = whole[_CHECKSUM:]
        if hashlib.sha256(content).digest() == whole[:_CHECKSUM]:
            head, _, rest = content.partition(b"\n")
            parts, at = [], 0
            for function, size in json.loads(head):
                parts.append((function, rest[at : at + size]))
                at += size
            return parts
    return None
