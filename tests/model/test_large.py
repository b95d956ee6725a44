"""Matrices in files beside the model file, and coordinates by their number."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from gapwalk.model import ModelFileError, System
from gapwalk.model.file import read_system

CHAIN = sp.csr_array(2.0 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
TEXT = 'coordinates = 6\nstiffness = "{}"\nfrequency = 1.0\n'


def read(folder: Path, name: str, text: str = TEXT) -> System:
    model = folder / "m.toml"
    model.write_text(text.format(name), encoding="utf-8")
    return read_system(model)


def problem_of(folder: Path, name: str, text: str = TEXT):
    with pytest.raises(ModelFileError) as caught:
        read(folder, name, text)
    (problem,) = caught.value.problems
    assert (problem.line, problem.path) == (2, "stiffness")
    return problem.message


@pytest.mark.parametrize("form", ["csr", "csc", "coo", "bsr"])
def test_a_sparse_matrix_of_scipy_is_read(tmp_path: Path, form: str) -> None:
    sp.save_npz(tmp_path / "k.npz", CHAIN.asformat(form))
    assert read(tmp_path, "k.npz") == System([f"q{k}" for k in range(1, 7)], CHAIN.toarray())


@pytest.mark.parametrize("matrix", [CHAIN, CHAIN.toarray(), CHAIN.astype(int)])
def test_a_matrix_market_file_is_read_from_a_folder_beside(tmp_path: Path, matrix) -> None:
    (tmp_path / "matrices").mkdir()
    scipy.io.mmwrite(tmp_path / "matrices" / "k.mtx", matrix)
    assert read(tmp_path, "matrices/k.mtx").matrix("stiffness") == pytest.approx(CHAIN.toarray())


def test_a_symmetric_file_gives_both_halves(tmp_path: Path) -> None:
    scipy.io.mmwrite(tmp_path / "k.mtx", CHAIN, symmetry="symmetric")
    assert "symmetric" in (tmp_path / "k.mtx").read_text()
    assert read(tmp_path, "k.mtx").matrix("stiffness") == pytest.approx(CHAIN.toarray())


def packed(**arrays) -> bytes:
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.mtx", None, "cannot be read"),
        ("k.txt", b"1 2", "a list of rows, or a file in the form of Matrix Market (.mtx)"),
        ("k.mtx", b"no matrix", "no Matrix Market file"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n6 6 1\n7 1 1.0\n", "no Matrix Market file"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n6 5 1\n1 1 1.0\n", "a matrix of 6 x 5"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n90000 90000 1\n1 1 1.0\n", "there may be 1000"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate complex general\n6 6 1\n1 1 1 1\n", "complex"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n6 6 1\n1 1 nan\n", "not finite"),
        ("k.npz", b"PK no archive", "no sparse matrix of SciPy"),
        ("k.npz", packed(a=np.eye(6)), "no sparse matrix of SciPy"),
        ("k.npz", packed(format=np.array([object()])), "no sparse matrix of SciPy"),  # pickled
    ],
)
def test_a_file_that_cannot_be_used_is_told(tmp_path: Path, name: str, content: bytes | None, words: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert words in problem_of(tmp_path, name)


def test_indices_beyond_the_matrix_are_not_followed(tmp_path: Path) -> None:
    wrong = packed(
        format=np.array(b"csr"), shape=np.array([6, 6]), data=np.ones(1), indices=np.array([10**6]),
        indptr=np.array([0, 1, 1, 1, 1, 1, 1]),
    )  # fmt: skip
    (tmp_path / "k.npz").write_bytes(wrong)
    assert "no sparse matrix of SciPy" in problem_of(tmp_path, "k.npz")


def test_an_archive_that_swells_is_not_unpacked(tmp_path: Path) -> None:
    with (
        zipfile.ZipFile(tmp_path / "k.npz", "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("data.npy", "w") as entry,
    ):
        for _ in range(210):
            entry.write(bytes(1_000_000))
    assert "holds more than 200 MB" in problem_of(tmp_path, "k.npz")


def test_its_size_must_be_that_of_the_coordinates(tmp_path: Path) -> None:
    sp.save_npz(tmp_path / "k.npz", CHAIN)
    text = 'coordinates = ["a", "b"]\nstiffness = "{}"\nfrequency = 1.0\n'
    assert "2 x 2, a row and a column per coordinate" in problem_of(tmp_path, "k.npz", text)


@pytest.mark.parametrize("count", ["0", "-1", "1001"])
def test_a_number_of_coordinates_has_bounds(tmp_path: Path, count: str) -> None:
    with pytest.raises(ModelFileError) as caught:
        read(tmp_path, "", f"coordinates = {count}\nstiffness = [1.0]\nfrequency = 1.0\n")
    (problem,) = caught.value.problems
    assert problem.path == "coordinates"
    assert "or their number, from 1 to 1000" in problem.message
