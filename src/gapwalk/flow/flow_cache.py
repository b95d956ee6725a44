"""Cache of the machine code of flows on disk, so that the next process, and each worker, need not compile them again.

heyoka keeps machine code in a database, in which it finds a flow by its equations and by heyoka's own version. It
trusts what it finds: four flipped bits in a database ended the process, another processor may not know the
instructions, and a truncated database was never rebuilt. So each flow has a database of its own, named by the
processor and by its equations, which begins with a checksum. Only a database whose content matches its checksum is
given to heyoka, as a copy. New machine code is stored, compressed to less than a third: beyond the size limit, flows
that are used in turn would each be removed before they are used again. The folder must be the user's own; otherwise
nothing is stored.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import stat
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from threading import RLock

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout

# Positions of the run-time parameters of a compiled flow.


@dataclass(frozen=True, eq=False)
class RunTimeParameters:
    """Run-time parameters of the equations for one coefficient layout and one pattern of non-zero coefficients."""

    layout: CoefficientLayout  #: Positions of the coefficients in an array.
    #: shape (number of coefficients,), bool: True for each coefficient that is included; the others are zero.
    pattern: NDArray[np.bool_]
    #: For each sensitivity, the slots of the coefficients that vary along its direction.
    varying: tuple[NDArray[np.intp], ...] = ()
    #: True if the speed changes with the angle. Then the pattern covers the slots of a ramp (`gapwalk.flow.ramp`).
    ramp: bool = False

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Slots of the coefficients that are included, in the order of their run-time parameters."""
        slots = np.flatnonzero(self.pattern)
        return slots if self.ramp else np.roll(slots, -1)  # of a ramp the square of the speed is the last one

    @cached_property
    def indices(self) -> dict[int, int]:
        """Run-time parameter of each active slot."""
        return {int(slot): self.first_coefficient + i for i, slot in enumerate(self.active)}

    def first_component(self, index: int) -> int:
        """Return the run-time parameter of the first component of a direction."""
        return sum(len(slots) for slots in self.varying[:index])

    @cached_property
    def components(self) -> NDArray[np.intp]:
        """Indices of the components of all directions, in the joined coefficients of all directions."""
        return np.concatenate([index * len(self.pattern) + slots for index, slots in enumerate(self.varying)])

    @cached_property
    def first_switch(self) -> int:
        """Run-time parameter of the first switch."""
        return self.first_component(len(self.varying))

    @cached_property
    def first_weight(self) -> int:
        """Run-time parameter of the first weight of an event function."""
        return self.first_switch + len(self.switches)

    @cached_property
    def first_mode(self) -> int:
        """Run-time parameter of the first mode of a law."""
        return self.first_weight + len(self.switches)

    @cached_property
    def first_waiting(self) -> int:
        """Run-time parameter of the first mode that may wait: 1 while its guard vanishes all the time, otherwise 0."""
        return self.first_mode + len(self.modes)

    @cached_property
    def may_wait(self) -> bool:
        """True if guards may vanish all the time, because contacts are held."""
        return bool(self.layout.structure.reactions)

    @cached_property
    def first_level(self) -> int:
        """Run-time parameter of the first cycle of two levels: 1 at the high one, otherwise 0."""
        return self.first_waiting + len(self.modes) * self.may_wait

    @cached_property
    def first_slip(self) -> int:
        """Run-time parameter of the first slip of friction: 1 or -1 in slip, 0 in stick."""
        return self.first_level + len(self.layout.cycles)

    @cached_property
    def first_stick(self) -> int:
        """Run-time parameter of the first stick of friction: 1 in stick, otherwise 0."""
        return self.first_slip + len(self.dry)

    @cached_property
    def first_held(self) -> int:
        """Run-time parameter of the first switch of a rigid stop: 1 while the stop is held, otherwise 0."""
        return self.first_stick + len(self.dry)

    @cached_property
    def length(self) -> int:
        """Run-time parameter of the unit of length, in units of the model."""
        return self.first_held + len(self.stops)

    @cached_property
    def first_coefficient(self) -> int:
        """Run-time parameter of the first coefficient."""
        return self.length + 1

    @cached_property
    def formulas(self) -> bool:
        """True if any force is a formula, which may have no value somewhere."""
        return any(contact.form.law.is_formula for contact in self.layout.contacts)

    @cached_property
    def dry(self) -> tuple[int, ...]:
        """Numbers of the contacts that are dry friction."""
        return self.layout.structure.friction

    @cached_property
    def stops(self) -> tuple[int, ...]:
        """Numbers of the switches of rigid stops."""
        return tuple(switch for _, switch in self.layout.structure.reactions if switch >= 0)

    @cached_property
    def modes(self) -> tuple[tuple[int, int], ...]:
        """(contact, mode of its law) of every mode."""
        return tuple(
            (index, mode)
            for index, contact in enumerate(self.layout.contacts)
            for mode in range(contact.form.law.mode_count)
        )

    @cached_property
    def switches(self) -> tuple[tuple[int, int], ...]:
        """(contact, stage) of every switch."""
        return tuple(
            (index, stage) for index, contact in enumerate(self.layout.contacts) for stage in range(len(contact.stages))
        )


_MOST_BYTES = 500_000_000
"""Size limit of all databases together; beyond it those that were used longest ago are removed."""

_NAME = "cache.db"  # the name that heyoka uses
_SUFFIX = ".db.z"  # of what is stored
_CHECKSUM = 32  # bytes of the checksum with which it begins
_PREFIX = "gapwalk-flow-"
_one_at_a_time = RLock()  # the path of heyoka's database is global to the process


@contextmanager
def kept(equations: str, *, folder: Path | None = None) -> Iterator[None]:
    """Context in which a flow is compiled: machine code that exists is loaded, new machine code is stored."""
    state = hy.llvm_state
    with _one_at_a_time:
        before = state.get_diskcache_path(), state.get_diskcache_enabled()
        folder = trusted(folder)
        work = _working_folder() if folder else None
        try:
            if folder is None or work is None:
                state.set_diskcache_enabled(False)
                yield
                return
            stem = hashlib.sha256(f"{processor()} {hy.__version__} {equations}".encode()).hexdigest()[:32]
            file = folder / f"{stem}{_SUFFIX}"
            _copy_unchanged(file, work / _NAME)
            size = _opened(work)
            yield
            is_new = size is not None and state.get_diskcache_size() > size
            state.set_diskcache_path(before[0])  # closes the database, so that all is in one file
            if is_new:
                _keep(file, work / _NAME)
        finally:
            state.set_diskcache_path(before[0])
            state.set_diskcache_enabled(before[1])
            if work is not None:
                shutil.rmtree(work, ignore_errors=True)


def trusted(folder: Path | None, name: str = "flows") -> Path | None:
    """Return a folder, by default one in the cache, created if necessary; None if it is not the user's own."""
    try:
        folder = cache_folder(name) if folder is None else folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if is_private(folder) else None
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        return None


def cache_folder(name: str) -> Path:
    """Return ``gapwalk/NAME`` in ``$XDG_CACHE_HOME`` or ``~/.cache``; raise a RuntimeError if there is no home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "gapwalk" / name


def is_private(folder: Path) -> bool:
    """Return True if a folder is the user's own, and writable for nobody else."""
    about = folder.stat()
    is_mine = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    return is_mine and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _working_folder() -> Path | None:
    """Make a folder for heyoka's copy, in memory if possible: its database waits for the disk at each change."""
    for place in ("/dev/shm", tempfile.gettempdir()):
        with suppress(OSError):
            _remove_abandoned(Path(place))
            return Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-", dir=place))
    return None


def _remove_abandoned(place: Path) -> None:
    """Remove the folders of processes that were killed while they compiled."""
    for work in place.glob(f"{_PREFIX}*"):
        owner = work.name.removeprefix(_PREFIX).partition("-")[0]
        try:
            os.kill(int(owner), 0)
        except ProcessLookupError:
            shutil.rmtree(work, ignore_errors=True)
        except (OSError, OverflowError, ValueError):
            pass  # alive, but another user's; or not a folder of gapwalk


@cache
def processor() -> str:
    """Describe the processor: machine code for one may not run on another."""
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
        first = file.read(20_000).partition("\n\n")[0].splitlines()
        return "\n".join(line for line in first if line.startswith(("model name", "flags", "CPU", "Features", "isa")))
    return f"{platform.machine()} {platform.processor()} {platform.node()}"


def _copy_unchanged(file: Path, copy: Path) -> None:
    """Copy the database of a file if its content is unchanged; remove the file if it is not."""
    try:
        content = file.read_bytes()
        if hashlib.sha256(content[_CHECKSUM:]).digest() == content[:_CHECKSUM]:
            copy.write_bytes(zlib.decompress(content[_CHECKSUM:]))
            os.utime(file)  # it was used
        else:
            file.unlink(missing_ok=True)
    except FileNotFoundError:
        pass  # it has never been compiled, or another process has just removed it
    except OSError:  # no room for the copy: a partial one is worse than none
        copy.unlink(missing_ok=True)


def _opened(work: Path) -> int | None:
    """Open heyoka's copy of the database and return its size; disable it and return None if there is no space."""
    state = hy.llvm_state
    try:
        state.set_diskcache_path(work)
        state.set_diskcache_enabled(True)
        return state.get_diskcache_size()
    except RuntimeError:
        state.set_diskcache_enabled(False)
        return None


def _keep(file: Path, copy: Path) -> None:
    """Store a copy of a database in a file."""
    with suppress(OSError):
        content = zlib.compress(copy.read_bytes(), 1)
        write_whole(file, hashlib.sha256(content).digest() + content)
        known = sorted(((each.stat().st_mtime, each) for each in file.parent.iterdir()), reverse=True)
        total = 0
        for _, each in known:  # beyond the size limit, those that were used longest ago are removed
            total += each.stat().st_size
            if total > _MOST_BYTES:
                each.unlink(missing_ok=True)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file that another process sees whole or not at all."""
    handle, name = tempfile.mkstemp(dir=file.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(name, file)
    except BaseException:
        os.unlink(name)
        raise
