"""Machine code that is kept on disk: it is loaded again, and never if it may be somebody else's or damaged."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from gapwalk.ensemble import BatchOptions, batch_flow_of
from gapwalk.ensemble import kernel_source as kernel
from gapwalk.ensemble.kernel_source import kernel_file
from tests.systems import backlash_oscillator
from tests.tiers import keeps

STATES = np.array([[0.5, 0.1], [-2.0, 0.4]])


def run() -> tuple[np.ndarray, int]:
    """The ends of a run in what is like a new process, and how many kernels were loaded from the disk."""
    kernel._compile.cache_clear()
    made = []
    compiled = kernel._machine_code

    def watched(*arguments):
        made.append(compiled(*arguments))
        return made[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "_machine_code", watched)
        states = batch_flow_of(backlash_oscillator(), BatchOptions(threads=1, steps=64)).run(STATES, 3).states
    kernel._compile.cache_clear()
    return states, sum(sum(code.stats.cache_hits.values()) for code in made)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory) -> tuple[Path, np.ndarray]:
    """A cache into which one process has put its kernel, and the ends of its run."""
    base = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base))
        states, loaded = run()
    assert loaded == 0
    return base, states


@pytest.fixture
def folder(compiled: tuple[Path, np.ndarray], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The kernels of a cache of the test's own, as that process has left them."""
    shutil.copytree(compiled[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "gapwalk" / "kernels"


def test_the_next_process_loads_what_the_first_one_compiled(folder: Path, compiled: tuple[Path, np.ndarray]) -> None:
    again, loaded = run()
    assert loaded == 1
    np.testing.assert_array_equal(again, compiled[1])


@keeps("text", "flipped")
@pytest.mark.parametrize("damage", ["cut", "flipped", "index", "text", "seal"])
def test_damaged_files_are_made_again(folder: Path, compiled: tuple[Path, np.ndarray], damage: str) -> None:
    suffix = {"cut": ".nbc", "flipped": ".nbc", "index": ".nbi", "text": ".py", "seal": ".sha256"}[damage]
    (file,) = folder.rglob(f"k*{suffix}")
    data = bytearray(file.read_bytes())
    if damage == "flipped":
        data[len(data) // 2] ^= 0x40
    file.write_bytes(data if damage == "flipped" else data[:7])
    again, loaded = run()
    assert loaded == 0 or damage == "text"  # the machine code is as it was
    np.testing.assert_array_equal(again, compiled[1])
    assert run()[1] == 1


def test_a_folder_that_others_can_write_to_is_not_trusted(folder: Path) -> None:
    for each in (folder / "__pycache__", folder):
        each.chmod(0o777)
        assert kernel_file("text", folder=folder) is None
        if each is folder:
            assert run()[1] == 0
        each.chmod(0o700)
    assert run()[1] == 1


@pytest.mark.slow
def test_a_folder_that_cannot_be_made_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert kernel_file("text") is None
    assert np.isfinite(run()[0]).all()


def test_only_so_many_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gapwalk.ensemble.kernel_source._MOST", 2)
    files = []
    for number in range(4):
        file = kernel_file(f"text {number}", folder=tmp_path / "kernels")
        assert file is not None
        os.utime(file, (number, number))
        files.append(file)
    assert [file.exists() for file in files] == [False, False, True, True]
