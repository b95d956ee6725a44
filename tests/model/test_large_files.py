"""Matrices in files beside the model file, and coordinates by their number."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from gapwalk.model import ModelFileError, System
from gapwalk.model.matrix_file import read_labelled
from tests.models import read_system

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


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<i2", "<u1", "f2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_an_array_of_numpy_is_read(tmp_path: Path, kind: str, order: Any) -> None:
    matrix = np.arange(36).reshape(6, 6)
    np.save(tmp_path / "k.npy", matrix.astype(kind, order=order))
    assert read(tmp_path, "k.npy") == System([f"q{k}" for k in range(1, 7)], matrix)


def test_a_row_of_numbers_in_an_array_of_numpy_is_a_diagonal_as_in_a_model_file(tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", np.arange(1.0, 7.0))
    text = f'coordinates = 6\nmass = "{{}}"\nstiffness = {CHAIN.toarray().tolist()}\nfrequency = 1.0\n'
    assert read(tmp_path, "m.npy", text).matrix("mass") == pytest.approx(np.diag(np.arange(1.0, 7.0)))


@pytest.mark.parametrize("mark", [",", ";", "\t", " ", " ; ", ", ", "  "])
@pytest.mark.parametrize("begin", ["", "\ufeff", "# a chain of six\n\n"])
def test_rows_of_numbers_are_read(tmp_path: Path, mark: str, begin: str) -> None:
    rows = [mark.join(map(repr, row)) for row in (CHAIN.toarray() / 3.0).tolist()]
    (tmp_path / "k.csv").write_bytes((begin + "\r\n".join(rows)).encode())
    assert np.array_equal(read(tmp_path, "k.csv").matrix("stiffness"), CHAIN.toarray() / 3.0)


@pytest.mark.parametrize("value", ["-0.0", "5e-324", "1.7976931348623157e308", "0.1"])
def test_a_table_is_read_to_the_last_bit(tmp_path: Path, value: str) -> None:
    (tmp_path / "k.csv").write_text(value)
    assert read_labelled(str(tmp_path / "k.csv")).matrix.tobytes() == np.float64(value).tobytes()


def test_a_table_of_numpy_is_read(tmp_path: Path) -> None:
    matrix = np.random.default_rng(5).normal(size=(6, 6))
    np.savetxt(tmp_path / "K.CSV", matrix, delimiter=",", header="stiffness in N/m", fmt="%.17g")
    assert np.array_equal(read(tmp_path, "K.CSV").matrix("stiffness"), matrix)


@pytest.mark.slow
def test_the_largest_table_is_read_and_one_row_more_is_not(tmp_path: Path) -> None:
    row = b",".join([b"-1.2345678901234567e-100"] * 1000) + b"\n"
    (tmp_path / "k.csv").write_bytes(row * 1000)
    assert read_labelled(str(tmp_path / "k.csv")).matrix.shape == (1000, 1000)
    (tmp_path / "k.csv").write_bytes(row * 1001)
    with pytest.raises(ValueError, match="there may be 1000 at most"):
        read_labelled(str(tmp_path / "k.csv"))


def array(value: object, **options: Any) -> bytes:
    content = io.BytesIO()
    np.save(content, np.asarray(value), **options)
    return content.getvalue()


def packed(**arrays) -> bytes:
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.mtx", None, "cannot be read"),
        ("k.txt", b"1 2", "a list of rows, or a file in the form of Matrix Market or Abaqus (.mtx)"),
        ("k.mtx", b"no matrix", "neither Matrix Market"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n6 6 1\n7 1 1.0\n", "not a Matrix Market file"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n6 5 1\n1 1 1.0\n", "a matrix of 6 x 5"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n90000 90000 1\n1 1 1.0\n", "there may be 1000"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate complex general\n6 6 1\n1 1 1 1\n", "complex"),
        ("k.mtx", b"%%MatrixMarket matrix coordinate real general\n6 6 1\n1 1 nan\n", "not finite"),
        ("k.npz", b"PK no archive", "not a sparse matrix of SciPy"),
        ("k.npz", packed(a=np.eye(6)), "not a sparse matrix of SciPy"),
        ("k.npz", packed(format=np.array([object()])), "not a sparse matrix of SciPy"),  # pickled
        ("k.npy", b"no array", "not an array of NumPy"),
        ("k.npy", array([[object()]]), "holds objects"),
        ("k.npy", array(np.eye(6))[:-1], "not an array of NumPy"),
        ("k.npy", array(np.ones((6, 5))), "a matrix of 6 x 5"),
        ("k.npy", array(np.ones((1, 6, 6))), "a matrix of 1 x 6 x 6"),
        ("k.npy", array(2.0), "holds one number"),
        ("k.npy", array(np.eye(1001, dtype="i1")), "there may be 1000"),
        ("k.npy", array(np.ones(1001)), "there may be 1000"),
        ("k.npy", array(np.eye(6) + 0j), "complex128; they must be real"),
        ("k.npy", array([["a"]]), "they must be real"),
        ("k.npy", array(np.full((6, 6), np.inf)), "not finite"),
        ("k.npy", array(np.full((6, 6), 2.0, np.longdouble) ** 5000), "not finite"),
        ("k.csv", b"", "holds no numbers"),
        ("k.csv", b"# only words\n\n", "holds no numbers"),
        ("k.csv", b"q1,q2\n1,0\n0,1\n", '"q1", where only real numbers are allowed in line 1'),
        ("k.csv", b"1,0\n0,1+2j\n", '"1+2j", where only real numbers are allowed in line 2'),
        ("k.csv", b"1,0\n0,1_0\n", '"1_0", where only real numbers are allowed'),
        ("k.csv", b"1,0\n0,\n", '"", where only real numbers are allowed in line 2'),
        ("k.csv", b"1,5;0\n0;1,5\n", "write decimal points, not commas, in line 1"),
        ("k.csv", b"1,0\n0,1,2\n", "has 3 numbers in line 2, but 2 in the first row"),
        ("k.csv", b"1,0\n0,1\n1,1\n", "a matrix of 3 x 2"),
        ("k.csv", b"1,nan\n0,1\n", "not finite"),
        ("k.csv", b"1,1e999\n0,1\n", "not finite"),
        ("k.csv", "1,2\n".encode("utf-16"), "not UTF-8 text"),
        ("k.csv", b"0," * 1000 + b"0", "1,001 numbers"),
        ("k.csv", b" " * 200_000, "more than 100,000 characters"),
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
    assert "not a sparse matrix of SciPy" in problem_of(tmp_path, "k.npz")


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
