"""Machine code of flows that is kept on disk: it is loaded, but not if it is damaged or may be somebody else's."""

import errno
import math
import os
import random
import subprocess
import sys
from pathlib import Path

import heyoka as hy
import numpy as np
import pytest

from gapwalk import System
from gapwalk.flow import flow_cache
from gapwalk.flow.flow import _compile, flow_of
from gapwalk.flow.flow_cache import kept
from gapwalk.model.coefficients import coefficients_of

SYSTEM = System(["x"], [[1.25]], damping=[[1.0]])
END = [-math.exp(-math.pi / 2), math.exp(-math.pi / 2) / 2]  # from (1, -1/2) it is exp(-t/2) cos t


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "gapwalk" / "flows"


def compiles() -> bool:
    """Whether something has to be compiled in what is like a new process; the motion is right in any case."""
    found = []
    keep = flow_cache._keep
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flow_cache, "_keep", lambda *given: (found.append(given), keep(*given)))
        hy.llvm_state.clear_memcache()
        _compile.cache_clear()
        end = flow_of(SYSTEM).integrate(coefficients_of(SYSTEM), np.array([1.0, -0.5]), 0.0, math.pi).state
    hy.llvm_state.clear_memcache()
    _compile.cache_clear()
    assert end == pytest.approx(END, abs=1e-14)
    return bool(found)


def test_the_next_process_loads_what_the_first_one_compiled(folder: Path) -> None:
    before = hy.llvm_state.get_diskcache_path(), hy.llvm_state.get_diskcache_enabled()
    assert compiles()
    (file,) = folder.iterdir()
    content = file.read_bytes()
    assert not compiles()
    assert [each.read_bytes() for each in folder.iterdir()] == [content]
    assert (hy.llvm_state.get_diskcache_path(), hy.llvm_state.get_diskcache_enabled()) == before


@pytest.mark.parametrize("damage", ["cut", "flipped", "checksum", "empty", "nonsense"])
def test_a_damaged_database_is_made_again(folder: Path, damage: str) -> None:
    compiles()
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    content = bytearray(whole)
    content[len(content) // 2] ^= 0x40  # damaged code would end the tests if it were run
    changed = {"cut": content[:9000], "flipped": content, "empty": b"", "nonsense": b"nonsense" * 1000}
    changed["checksum"] = bytes(32) + whole[32:]
    file.write_bytes(changed[damage])
    assert compiles()
    assert not compiles()
    assert len([*folder.iterdir()]) == 1


def test_a_folder_that_others_can_write_to_is_not_trusted(folder: Path) -> None:
    compiles()
    files = sorted(folder.iterdir())
    folder.chmod(0o777)
    text = "anything"
    with kept(text):
        assert not hy.llvm_state.get_diskcache_enabled()
    compiles()
    assert sorted(folder.iterdir()) == files
    folder.chmod(0o700)
    assert not compiles()


def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert not compiles()
    monkeypatch.setattr(flow_cache, "_working_folder", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert not compiles()
    assert not [*(tmp_path / "gapwalk" / "flows").iterdir()]


def test_another_processor_and_another_heyoka_get_code_of_their_own(folder: Path, monkeypatch) -> None:
    compiles()
    monkeypatch.setattr(flow_cache, "processor", lambda: "another one")
    assert compiles()
    monkeypatch.setattr(hy, "__version__", "0")
    assert compiles()
    assert len([*folder.iterdir()]) == 3
    assert not compiles()


def test_an_error_while_compiling_leaves_all_as_it_was(folder: Path) -> None:
    before = hy.llvm_state.get_diskcache_path(), hy.llvm_state.get_diskcache_enabled()
    with pytest.raises(ZeroDivisionError), kept("wrong"):
        raise ZeroDivisionError
    assert (hy.llvm_state.get_diskcache_path(), hy.llvm_state.get_diskcache_enabled()) == before
    assert not [*folder.iterdir()]


def test_what_was_used_longest_ago_goes(folder: Path, monkeypatch) -> None:
    monkeypatch.setattr(flow_cache, "_MOST_BYTES", 300)
    for number in range(4):
        copy = folder.parent / "copy"
        folder.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(random.randbytes(100))
        file = folder / f"flow{number}.db.z"
        flow_cache._keep(file, copy)
        os.utime(file, (number, number))
    assert sorted(file.name for file in folder.iterdir()) == ["flow2.db.z", "flow3.db.z"]


def test_several_processes_may_compile_at_once(folder: Path) -> None:
    code = "from tests.flow.test_flow_cache import compiles; compiles()"
    programs = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(3)]
    assert [program.wait() for program in programs] == [0, 0, 0]
    assert not compiles()
    assert len([*folder.iterdir()]) == 1


def test_what_a_killed_process_left_is_cleared_away(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    left, *used = (tmp_path / f"gapwalk-flow-{owner}" for owner in (f"{ended.pid}-x", f"{os.getpid()}-x", "x"))
    for desk in (left, *used):
        desk.mkdir()
        (desk / "cache.db").write_bytes(b"copy")
    flow_cache._remove_abandoned(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted(used)


def test_where_there_is_no_room_for_a_copy_flows_are_compiled(folder: Path, monkeypatch) -> None:
    compiles()
    write = Path.write_bytes

    def write_half(self: Path, content: bytes) -> int:
        write(self, content[: len(content) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", write_half)
    assert compiles()


def test_what_heyoka_cannot_open_is_not_used(tmp_path: Path) -> None:
    state = hy.llvm_state
    before = state.get_diskcache_path(), state.get_diskcache_enabled()
    (tmp_path / "cache.db").write_bytes(b"half of a database" * 100)
    try:
        assert flow_cache._opened(tmp_path) is None
        assert not state.get_diskcache_enabled()
    finally:
        state.set_diskcache_path(before[0])
        state.set_diskcache_enabled(before[1])
