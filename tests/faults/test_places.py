"""Where results are written: full, read-only, gone, or no place for a file at all; a clear word, and nothing lost."""

import os
import shutil
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError, StoreError
from gapwalk.results.result_file import explained
from gapwalk.studies.export import write_whole
from tests.cli.conftest import MODEL
from tests.studies.same import assert_same_branch, assert_same_result
from tests.studies.studies import long_result, long_study, stop_study
from tests.studies.sweeps import FOLDS, options
from tests.tiers import some_of
from tests.waiting import children, ticks, until

LONG = '[study]\nkind = "{kind}"\nparameter = "frequency"\nfrom = 0.7\nto = 1.9\n'
SMALL_STEPS = "[study.walk]\ninitial_step = 1e-5\nlargest_step = 1e-5\nmax_points = 1000000\n"
ROOT = Path(__file__).resolve().parents[2]
NOBODY = 65534

FULL = """
import resource, sys
import gapwalk as gw
from gapwalk.errors import ModelError, StoreError
from tests.studies.studies import stop_study
reported = 0
def report(*_):
    global reported
    reported += 1
resource.setrlimit(resource.RLIMIT_FSIZE, (80_000, 80_000))
try:
    gw.run(stop_study(0.005), sys.argv[1], report=report)
except StoreError as error:
    print(reported, error)
"""


@pytest.mark.slow
def test_a_walk_whose_disk_is_full_keeps_what_it_reported_and_goes_on(tmp_path) -> None:
    """A file that may not grow is what a full disk is; the next test has a real one."""
    path = tmp_path / "long.gapwalk"
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(path)], capture_output=True, text=True, env=environment, check=True
    )
    reported, _, message = done.stdout.partition(" ")
    assert int(reported) > 10
    assert "long.gapwalk cannot be" in message
    assert "all that was reported is in the file" in message
    assert os.listdir(tmp_path) == [path.name]
    assert len(gw.open_result(path).branches[0].points) >= int(reported)
    resumed = gw.run(stop_study(0.005), path, resume=True)
    assert_same_branch(resumed.branches[0], gw.run(stop_study(0.005)).branches[0])
    assert os.listdir(tmp_path) == [path.name]


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[Path]:
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("no disk can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(filler: Path) -> None:
    """Write until nothing more can be written."""
    with suppress(OSError), open(filler, "wb", buffering=0) as file:
        while True:
            file.write(b"x" * 4096)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("mount") is None or os.geteuid() != 0, reason="only root mounts disks")
def test_a_real_full_disk(tmp_path) -> None:
    study, elsewhere = stop_study(), tmp_path / "elsewhere.gapwalk"
    reported = 0

    def report(*_: object) -> None:
        nonlocal reported
        reported += 1

    with small_disk(tmp_path / "disk", "300k") as disk:
        path, filler = disk / "x.gapwalk", disk / "filler"
        with pytest.raises(StoreError, match=r"disk is full; all that was reported is in the file"):
            gw.run(long_study(), path, report=report)
        assert len(gw.open_result(path).branches[0].points) >= reported > 10
        with pytest.raises(StoreError, match=r"picture.png cannot be written: No space left on device"):
            write_whole(disk / "picture.png", b"x" * 400_000)
        assert not list(disk.glob(".picture*"))
        assert os.listdir(disk) == ["x.gapwalk"]  # without its log it would be damaged
        shutil.move(path, elsewhere)
        assert len(gw.open_result(elsewhere).branches[0].points) >= reported
        fill(filler)
        with pytest.raises(StoreError, match=r"the disk (is|may be) full"):
            gw.run(study, disk / "x.gapwalk")
        with pytest.raises(StoreError, match=r"the disk (is|may be) full"):
            gw.sweep(*FOLDS, **options(), output=disk / "y.sweep")
        filler.unlink()
        gw.sweep(*FOLDS, **options(), output=disk / "y.sweep")
    assert_same_result(gw.run(long_study(), elsewhere, resume=True), long_result())


@pytest.mark.skipif(shutil.which("mount") is None or os.geteuid() != 0, reason="only root mounts disks")
def test_a_disk_that_cannot_be_written(tmp_path) -> None:
    with small_disk(tmp_path / "disk", "1m") as disk:
        path = disk / "x.gapwalk"
        result = gw.run(stop_study(), path)
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        assert_same_result(gw.open_result(path), result)
        with pytest.raises(StoreError, match=r"cannot be|read-only"):
            gw.run(stop_study(end=1.8), path, force=True)
        with pytest.raises(StoreError, match="cannot be opened"):
            gw.run(stop_study(), disk / "y.gapwalk")
        with pytest.raises(StoreError, match="Read-only"):
            write_whole(disk / "x.csv", b"1")


@pytest.mark.skipif(os.geteuid() != 0, reason="test_store.py has the same for other users")
def test_a_folder_of_somebody_else(tmp_path) -> None:
    """Rights do not bind root, so a program without them tries."""
    shared = Path("/tmp") / f"gapwalk-faults-{os.getpid()}"  # pytest's own folders can be entered by root only
    shared.mkdir()
    try:
        gw.run(stop_study(), shared / "x.gapwalk")
        os.chmod(shared, 0o755)
        os.chmod(shared / "x.gapwalk", 0o600)
        reader, writer = os.pipe()
        if (child := os.fork()) == 0:
            code = 1
            try:
                os.setgid(NOBODY)
                os.setuid(NOBODY)
                told = []
                for call in (
                    lambda: gw.open_result(shared / "x.gapwalk"),
                    lambda: gw.run(stop_study(), shared / "y.gapwalk"),
                    lambda: write_whole(shared / "x.csv", b"1"),
                ):
                    try:
                        call()
                    except StoreError as error:
                        told.append(str(error))
                os.write(writer, "\n".join(told).encode())
                code = 0
            finally:
                os._exit(code)
        os.close(writer)
        assert os.waitpid(child, 0)[1] == 0
        with os.fdopen(reader) as answer:
            read, run, table = answer.read().split("\n")
        assert "look at its permissions" in read or "cannot be opened" in read
        assert "its folder cannot be written; choose another place for the result" in run
        assert "x.csv cannot be written: Permission denied" in table
    finally:
        shutil.rmtree(shared)


def test_a_folder_that_vanishes_while_a_walk_goes_on(tmp_path) -> None:
    """SQLite goes on with a file that nobody sees any more."""
    folder = tmp_path / "gone"
    folder.mkdir()
    count = 0

    def report(*_: object) -> None:
        nonlocal count
        count += 1
        if count == 20:
            shutil.rmtree(folder)

    with pytest.raises(StoreError, match=f"there is no folder {folder}; make it"):
        gw.run(long_study(), folder / "x.gapwalk", report=report)
    assert count < 1000  # it does not go on to the end for nothing


@pytest.mark.parametrize("code", ["SQLITE_IOERR_SHORT_READ", "SQLITE_IOERR_WRITE", "SQLITE_READONLY_DBMOVED"])
def test_a_file_that_is_gone_is_not_told_as_a_full_disk(tmp_path, code) -> None:
    error = sqlite3.OperationalError("disk I/O error")
    error.sqlite_errorname = code
    with pytest.raises(StoreError, match="has been removed or moved while it was written"), explained(tmp_path / "x"):
        raise error
    (tmp_path / "x").write_bytes(b"")
    with pytest.raises(StoreError, match=r"the disk may be full|look at its permissions"), explained(tmp_path / "x"):
        raise error


@pytest.mark.parametrize("kind", some_of(["response", "diagram"], "response"))
def test_sigterm_keeps_what_was_found_and_says_how_to_go_on(tmp_path, kind) -> None:
    text = MODEL.partition("[study]")[0] + LONG.format(kind=kind) + ("workers = 2\n" if kind == "diagram" else "")
    (tmp_path / "long.toml").write_text(text + SMALL_STEPS)
    path = tmp_path / "long.gapwalk"
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-m", "gapwalk", "run", "long.toml"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
    ) as run:
        if kind == "response":
            until(lambda: points_in(path) > 1, "points are stored")
        else:  # a diagram stores whole branches; but one of its processes has begun to walk
            until(lambda: sum(map(ticks, children(run.pid))) > 400, "its processes work")
        run.terminate()
        _, told = run.communicate()
    assert run.returncode == 143
    assert "interrupted" in told
    assert "semaphore" not in told
    assert "Traceback" not in told
    if kind == "response":
        assert "gapwalk run long.toml --output long.gapwalk --resume" in told
        assert len(gw.open_result(path).branches[0].points) > 1


def points_in(path: Path) -> int:
    with suppress(StoreError):
        return len(gw.open_result(path).branches[0].points)
    return 0


def test_a_file_that_is_removed_while_a_sweep_goes_on(tmp_path) -> None:
    path = tmp_path / "x.sweep"
    with pytest.raises(StoreError, match="has been removed or moved while it was written"):
        gw.sweep(*FOLDS, **options(), output=path, report=lambda *_: path.exists() and path.unlink())


@pytest.mark.parametrize("command", ["check", "run", "modes", "explore --no-browser", "measure"])
def test_a_model_or_a_record_that_is_no_file_is_not_waited_for(tmp_path, monkeypatch, capsys, command) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text(MODEL + '\n[measurement]\nsignal = "x"\n')
    os.mkfifo("pipe.toml")
    os.symlink("/dev/zero", "device")
    for name in ("pipe.toml", *(["device"] if "explore" not in command else [])):
        assert main([*command.split(), *(["model.toml"] if command == "measure" else []), name]) == 2
        assert "pipe or a device" in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.parametrize("name", ["k.mtx", "k.npz", "k.npy", "k.csv"])
def test_a_matrix_that_is_no_file_is_not_waited_for(tmp_path, name) -> None:
    os.mkfifo(tmp_path / name)
    (tmp_path / "model.toml").write_text(MODEL.replace("stiffness = [1.0]", f'stiffness = "{name}"'))
    with pytest.raises(ModelError, match=f'stiffness is "{name}", which cannot be read: it is a pipe'):
        gw.read_study(tmp_path / "model.toml")


@pytest.mark.parametrize("suffix", ["-wal", "-journal", "-shm", "-lock"])
def test_a_pipe_beside_a_result_is_not_waited_for(tmp_path, suffix) -> None:
    path = tmp_path / "x.gapwalk"
    os.mkfifo(f"{path}{suffix}")
    for call in (lambda: gw.run(stop_study(), path), lambda: gw.open_result(path)):
        with pytest.raises(StoreError, match=f"x.gapwalk{suffix} is a pipe or a device"):
            call()


@pytest.mark.parametrize("command", ["run", "run --force", "run --resume", "show", "export", "compare"])
def test_what_is_no_file_is_neither_read_nor_written(tmp_path, monkeypatch, capsys, command) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text((ROOT / "examples" / "clutch.toml").read_text())
    os.mkfifo("pipe.gapwalk")
    os.mkdir("folder.gapwalk")
    os.symlink("/dev/zero", "device.gapwalk")
    words = command.split()
    for place, told in (("pipe", "pipe or a device"), ("device", "pipe or a device"), ("folder", "is a folder")):
        name = f"{place}.gapwalk"
        arguments = [*words, "model.toml", "--output", name] if words[0] == "run" else [*words, name]
        assert main([*arguments, name] if words == ["compare"] else arguments) == 2
        assert told in capsys.readouterr().err
    assert sorted(os.listdir()) == ["device.gapwalk", "folder.gapwalk", "model.toml", "pipe.gapwalk"]


def test_a_table_does_not_take_the_place_of_a_pipe_or_a_device(tmp_path) -> None:
    os.mkfifo(tmp_path / "table.csv")
    os.symlink("/dev/null", tmp_path / "null.csv")
    for name in ("table.csv", "null.csv"):
        with pytest.raises(StoreError, match="is a pipe or a device"):
            write_whole(tmp_path / name, b"1,2\n")
    assert (tmp_path / "table.csv").is_fifo()
    assert (tmp_path / "null.csv").is_symlink()


@pytest.mark.slow
def test_a_screen_that_takes_nothing_is_told_and_is_no_bug(tmp_path) -> None:
    path = tmp_path / "x.gapwalk"
    gw.run(stop_study(end=0.72), path)
    for words in (["show", str(path)], ["show", str(path), "--json"]):
        with open("/dev/full", "w") as full:
            done = subprocess.run(
                [sys.executable, "-m", "gapwalk", *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
            )
        assert done.returncode == 2
        assert done.stderr == "gapwalk: the output of the command cannot be written: No space left on device\n"


def test_no_screen_at_all(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["show", str(tmp_path / "nothing.gapwalk")]) == 2
    for stream in (sys.stdout, sys.stderr):
        stream.close()


def test_a_clock_that_jumps_changes_nothing(tmp_path, monkeypatch) -> None:
    """The time of day is for people; what waits for something asks a clock that never goes back."""
    expected = gw.run(stop_study())
    times = iter(range(2_000_000_000, 0, -3600))
    monkeypatch.setattr(time, "time", lambda: next(times))
    monkeypatch.setattr(time, "time_ns", lambda: next(times) * 10**9)
    path = tmp_path / "x.gapwalk"
    assert_same_result(gw.run(stop_study(), path), expected)
    assert_same_result(gw.open_result(path), expected)


def test_a_file_from_tomorrow_is_read_and_gone_on_with(tmp_path) -> None:
    path = tmp_path / "x.gapwalk"
    gw.run(stop_study(), path)
    os.utime(path, (time.time() + 1e6, time.time() + 1e6))
    assert gw.run(stop_study(), path, resume=True).complete


def test_the_time_of_day_decides_nothing() -> None:
    """In the whole package it is asked for nowhere."""
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text()
        assert "time.time(" not in text, path
        assert "datetime.now" not in text, path
