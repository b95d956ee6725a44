"""Machine code of flows, kept on disk: the next process, and each worker, need not compile them again.

heyoka keeps it in a database, and finds it there by the equations and by its own version. It trusts what it finds: four
bits that have changed in it ended the process, another processor might not know its instructions, and a database that
was cut short was never made again. So each flow has a database of its own, named by the processor, by its equations and
by its own content. Only what still has that content is given to heyoka, as a copy; what is new is kept.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import RLock

import heyoka as hy

from gapwalk.flow.cache_folder import cache_folder, is_private, write_whole

_MOST_BYTES = 500_000_000
"""Of all databases together; beyond that those that were used longest ago go."""

_NAME = "cache.db"  # as heyoka calls it
_DESK = "gapwalk-flow-"
_one_at_a_time = RLock()  # where heyoka's database stands is known to the process as a whole


@contextmanager
def kept(equations: str, *, folder: Path | None = None) -> Iterator[None]:
    """Compile the flow of some equations within: what was compiled before is loaded, what is new is kept.

    Parameters
    ----------
    equations
        A text that tells them; flows of one text share a database.
    folder
        Where the databases are; by default ``gapwalk/flows`` in ``$XDG_CACHE_HOME`` or ``~/.cache``. Where no folder
        can be trusted or written to, nothing is kept.
    """
    state = hy.llvm_state
    with _one_at_a_time:
        before = state.get_diskcache_path(), state.get_diskcache_enabled()
        folder = _trusted(folder)
        desk = _desk() if folder else None
        try:
            if folder is None or desk is None:
                state.set_diskcache_enabled(False)
                yield
                return
            stem = hashlib.sha256(f"{processor()} {hy.__version__} {equations}".encode()).hexdigest()[:32]
            _lay_out(folder, stem, desk / _NAME)
            size = _opened(desk)
            yield
            is_new = size is not None and state.get_diskcache_size() > size
            state.set_diskcache_path(before[0])  # closes the database, so that all is in one file
            if is_new:
                _keep(folder, stem, desk / _NAME)
        finally:
            state.set_diskcache_path(before[0])
            state.set_diskcache_enabled(before[1])
            if desk is not None:
                shutil.rmtree(desk, ignore_errors=True)


@cache
def processor() -> str:
    """What tells processors apart: machine code for one may not run on another."""
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
        first = file.read(20_000).partition("\n\n")[0].splitlines()
        return "\n".join(line for line in first if line.startswith(("model name", "flags", "CPU", "Features", "isa")))
    return f"{platform.machine()} {platform.processor()} {platform.node()}"


def _trusted(folder: Path | None) -> Path | None:
    """The folder, made if there is none; None if it is not the user's own."""
    try:
        folder = cache_folder("flows") if folder is None else folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if is_private(folder) else None
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        return None


def _opened(desk: Path) -> int | None:
    """Give heyoka its copy: the size of what is in it; None, and no database, if there is no room for one."""
    state = hy.llvm_state
    try:
        state.set_diskcache_path(desk)
        state.set_diskcache_enabled(True)
        return state.get_diskcache_size()
    except RuntimeError:
        state.set_diskcache_enabled(False)
        return None


def _desk() -> Path | None:
    """A folder for heyoka's copy, in memory where that is to be had: its database waits for the disk at each change."""
    for place in ("/dev/shm", tempfile.gettempdir()):
        with suppress(OSError):
            _clear_away(Path(place))
            return Path(tempfile.mkdtemp(prefix=f"{_DESK}{os.getpid()}-", dir=place))
    return None


def _clear_away(place: Path) -> None:
    """Remove what processes that were killed while they compiled have left."""
    for desk in place.glob(f"{_DESK}*"):
        owner = desk.name.removeprefix(_DESK).partition("-")[0]
        try:
            os.kill(int(owner), 0)
        except ProcessLookupError:
            shutil.rmtree(desk, ignore_errors=True)
        except (OSError, OverflowError, ValueError):  # it lives, and is somebody else's; or the folder is none of ours
            pass


def _lay_out(folder: Path, stem: str, copy: Path) -> None:
    """Copy a database that is as it was written, if there is one; others of its name are removed."""
    try:
        for file in folder.glob(f"{stem}-*.db"):
            content = file.read_bytes()
            if file.name == _name(stem, content):
                copy.write_bytes(content)
                os.utime(file)  # it was used
                return
            file.unlink(missing_ok=True)
    except OSError:  # no room for the copy: half of one is worse than none
        copy.unlink(missing_ok=True)


def _keep(folder: Path, stem: str, copy: Path) -> None:
    """Keep a database in place of those of its name."""
    with suppress(OSError):
        content = copy.read_bytes()
        name = _name(stem, content)
        write_whole(folder / name, content)
        for file in folder.glob(f"{stem}-*.db"):
            if file.name != name:
                file.unlink(missing_ok=True)
        _forget_oldest(folder)


def _name(stem: str, content: bytes) -> str:
    return f"{stem}-{hashlib.sha256(content).hexdigest()[:32]}.db"


def _forget_oldest(folder: Path) -> None:
    known = sorted(((file.stat().st_mtime, file) for file in folder.iterdir()), reverse=True)
    total = 0
    for _, file in known:
        total += file.stat().st_size
        if total > _MOST_BYTES:
            file.unlink(missing_ok=True)
