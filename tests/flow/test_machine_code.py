"""Machine code that is kept on disk: it is loaded, but not if it is damaged or may be somebody else's."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gapwalk import machine_code
from gapwalk.machine_code import kept

PARTS = [("first", bytes(range(256)) * 40), ("second", b""), ("third", b"\n{}\n")]
SOURCE = b"what the code is made of"


def compiles(folder: Path | None = None, source: bytes = SOURCE) -> bool:
    """True if something has to be compiled; the parts that are returned are right in any case."""
    made = []

    def compiled() -> list[tuple[str, bytes]]:
        made.append(True)
        return PARTS

    assert kept("code", source, compiled, folder) == PARTS
    return bool(made)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "gapwalk" / "kernels"


def test_what_was_compiled_is_loaded_from_then_on(folder: Path) -> None:
    assert compiles()
    (file,) = folder.iterdir()
    content = file.read_bytes()
    assert not compiles()
    assert [each.read_bytes() for each in folder.iterdir()] == [content]


def test_flipped_bits_and_cuts_are_seen(folder: Path) -> None:
    compiles()
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    random = np.random.default_rng(1)
    for place in [0, 31, 32, 40, len(whole) - 1, *random.integers(len(whole), size=40).tolist()]:
        flipped = bytearray(whole)
        flipped[place] ^= 1 << int(random.integers(8))
        for damaged in (bytes(flipped), whole[:place], whole[place + 1 :], whole + whole[:place] + b"x"):
            file.write_bytes(damaged)
            assert compiles()
            assert file.read_bytes() == whole  # made again
    assert not compiles()
    assert len([*folder.iterdir()]) == 1


@pytest.mark.parametrize("nonsense", [b"", b"nonsense" * 1000])
def test_a_file_of_something_else_is_made_again(folder: Path, nonsense: bytes) -> None:
    compiles()
    (file,) = folder.iterdir()
    file.write_bytes(nonsense)
    assert compiles()
    assert not compiles()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such bits: folders of users are their own")
def test_a_folder_that_others_can_write_to_is_not_trusted(folder: Path) -> None:
    compiles()
    (file,) = folder.iterdir()
    for mode in (0o777, 0o720, 0o702):
        folder.chmod(mode)
        before = file.stat()
        assert compiles()
        assert [*folder.iterdir()] == [file]
        assert file.stat().st_mtime_ns == before.st_mtime_ns
    folder.chmod(0o700)
    assert not compiles()


def test_a_folder_of_somebody_else_is_not_trusted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiles()
    monkeypatch.setattr("os.getuid", lambda: 12345, raising=False)
    assert compiles()
    monkeypatch.undo()


def test_without_a_folder_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert compiles()
    assert compiles()

    def no_home(cls=None):
        raise RuntimeError("there is no home")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", no_home)
    assert compiles()
    assert compiles()


def test_another_processor_source_and_compiler_get_code_of_their_own(folder: Path, monkeypatch) -> None:
    compiles()
    assert compiles(source=SOURCE + b" ")
    monkeypatch.setattr(machine_code._llvm(), "get_host_cpu_name", lambda: "another one")
    assert compiles()
    monkeypatch.setattr(machine_code._llvm(), "llvm_version_info", (0, 0, 0))
    assert compiles()
    assert not compiles()
    assert len([*folder.iterdir()]) == 4
    monkeypatch.undo()


def test_an_error_while_compiling_leaves_nothing(folder: Path) -> None:
    def wrong() -> list[tuple[str, bytes]]:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        kept("code", SOURCE, wrong)
    assert not [*folder.iterdir()]


def test_where_nothing_can_be_written_code_is_compiled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(machine_code, "write_whole", full)
    assert compiles()
    assert compiles()
    assert not [*folder.iterdir()]


@pytest.mark.slow
def test_several_processes_may_compile_at_once(folder: Path) -> None:
    code = "from tests.flow.test_machine_code import compiles; compiles()"
    programs = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(3)]
    assert [program.wait() for program in programs] == [0, 0, 0]
    assert not compiles()
    assert len([*folder.iterdir()]) == 1


def test_an_object_file_is_loaded_and_run() -> None:
    import ctypes

    text = "define double @twice(double %x) {\n  %y = fadd double %x, %x\n  ret double %y\n}\n"
    engine = machine_code.engine_of_object(machine_code.object_of(text))
    function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(engine.get_function_address("twice"))
    assert function(1.25) == 2.5
