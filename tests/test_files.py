import io
import os
import signal
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from gapwalk.errors import ModelError
from gapwalk.files import array_header, check_npz, open_file, why_no_file
from gapwalk.interrupts import uninterrupted
from tests.models import read_system

MODEL = 'coordinates = ["x"]\nstiffness = "{}"\nfrequency = 1.0\n'


def said(shape: tuple[int, ...], kind: str = "<f8") -> bytes:
    """An array of the NPY format that is said to have a shape, without its numbers."""
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": kind, "fortran_order": False, "shape": shape})
    return content.getvalue()


def archive(**arrays: bytes) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as made:
        for name, array in arrays.items():
            made.writestr(f"{name}.npy", array)
    return content.getvalue()


def test_only_files_are_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_bytes(b"x")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        assert "is a pipe or a device" in why_no_file(path)
        with pytest.raises(OSError, match="a pipe or a device"):
            open_file(path)
    assert "is a folder" in why_no_file(tmp_path)
    assert why_no_file(tmp_path / "file") == why_no_file(tmp_path / "none") == ""
    with open_file(tmp_path / "file") as file:
        assert file.read() == b"x"


def test_an_array_has_the_entries_that_it_is_said_to_have() -> None:
    good = io.BytesIO()
    np.savez(good, a=np.arange(7.0), b=np.array("text"))
    check_npz(good, 10_000)
    for shape in ((1 << 44,), (1 << 22, 1 << 22, 1 << 22)):
        with pytest.raises(ValueError, match=r"a.npy states [0-9,]* entries, but they are missing"):
            check_npz(io.BytesIO(archive(a=said(shape))), 10_000)
    with pytest.raises(ValueError, match="holds objects"):
        check_npz(io.BytesIO(archive(a=said((1,), "|O"))), 10_000)


def test_a_packed_matrix_does_not_ask_for_more_than_it_has(tmp_path: Path) -> None:
    sparse.save_npz(tmp_path / "k.npz", sparse.csr_matrix([[2.0]]))
    (tmp_path / "model.toml").write_text(MODEL.format("k.npz"))
    assert read_system(tmp_path / "model.toml")["stiffness.x.x"] == 2.0
    with zipfile.ZipFile(tmp_path / "k.npz") as good:
        parts = {name.removesuffix(".npy"): good.read(name) for name in good.namelist()}
    (tmp_path / "k.npz").write_bytes(archive(**{**parts, "data": said((1 << 44,))}))
    with pytest.raises(ModelError, match=r"data.npy states 17,592,186,044,416 entries"):
        read_system(tmp_path / "model.toml")


@pytest.mark.parametrize("count", [10**12, 10**30])
def test_a_matrix_in_text_does_not_ask_for_more_than_it_has(tmp_path: Path, count: int) -> None:
    head = "%%MatrixMarket matrix coordinate real general\n"
    (tmp_path / "k.mtx").write_text(f"{head}1 1 {count}\n1 1 5.0\n")
    (tmp_path / "model.toml").write_text(MODEL.format("k.mtx"))
    with pytest.raises(ModelError, match=r'stiffness is "k.mtx", which'):
        read_system(tmp_path / "model.toml")


@pytest.mark.parametrize("head", ["(" * 5000, "-" * 9000 + "1", "'''", "{[]: 1}", "9" * 9000])
def test_the_head_of_an_array_that_is_no_head_is_told(head: str) -> None:
    content = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode()
    with pytest.raises(ValueError, match=r"head|Cannot parse"):
        array_header(io.BytesIO(content), len(content))


@pytest.mark.parametrize("shape", [(1 << 44,), (-5,), (-2, -2), (1000, 1000)])
def test_an_array_in_a_file_has_the_entries_that_it_is_said_to_have(tmp_path: Path, shape: tuple[int, ...]) -> None:
    content = said(shape)
    with pytest.raises(ValueError, match="are missing"):
        array_header(io.BytesIO(content), len(content))
    (tmp_path / "k.npy").write_bytes(content)
    (tmp_path / "model.toml").write_text(MODEL.format("k.npy"))
    with pytest.raises(ModelError, match=r'stiffness is "k.npy", which'):
        read_system(tmp_path / "model.toml")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_waits_for_the_end_of_a_write(number: int) -> None:
    written: list[str] = []
    caught: list[int] = []

    def write() -> None:
        with uninterrupted():
            signal.raise_signal(number)
            written.append("part")

    def end(number: int, frame: object) -> None:
        caught.append(len(written))

    before = signal.signal(number, end)
    try:
        write()
        assert (caught, signal.getsignal(number)) == ([1], end)
        with ThreadPoolExecutor(1) as pool:
            pool.submit(write).result()  # a thread has no signals of its own
        assert signal.getsignal(number) is end
    finally:
        signal.signal(number, before)
