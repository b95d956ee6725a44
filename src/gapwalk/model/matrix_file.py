"""A matrix in a file of its own: of a finite-element program, Matrix Market, SciPy, NumPy, or CSV."""

from __future__ import annotations

import io
import os
import re
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.files import array_header, check_npz, open_file
from gapwalk.model.finite_element_files import OF_NASTRAN, read_abaqus
from gapwalk.model.labelled_matrix import LabelledMatrix, UnusableError
from gapwalk.model.problems import given
from gapwalk.model.schema import MAX_COORDINATES

_MAX_BYTES = 200_000_000  # of a file, and of its unpacked content
_MAX_LINE = 100 * MAX_COORDINATES  # characters in a line of CSV: a number takes some 25
_REAL = "fiu"  # kinds of NumPy's numbers that are real


def split_name(name: str) -> tuple[str, str]:
    """Split ``model.pch:KAAX`` into a file that may hold several matrices and the name of one; others have none."""
    file, mark, matrix = name.rpartition(":")
    return (file, matrix) if mark and os.path.splitext(file)[1].lower() in OF_NASTRAN else (name, "")


def read_matrix(path: str) -> NDArray[np.float64]:
    """Read the matrix of a file as an array, shape (n, n) or (n,); see `read_labelled`."""
    return read_labelled(path).matrix


def read_labelled(path: str, name: str = "") -> LabelledMatrix:
    """Read the matrix of a file, shape (n, n), with the names of its rows; an array of NumPy may also be its diagonal.

    Nothing in the file is executed, and no memory is allocated for more than the largest system.
    """
    ending = os.path.splitext(path)[1].lower()
    form, read = _READERS.get(ending, ("", None))
    if ending in OF_NASTRAN:
        form, of_many = OF_NASTRAN[ending]
        read = lambda path, _: of_many(path, name)  # noqa: E731
    if read is None:
        raise ValueError(f"which must be a list of rows, or a file in the form of {_FORMS}")
    try:
        with open_file(path) as file:
            size = os.fstat(file.fileno()).st_size
        if size > _MAX_BYTES:
            raise UnusableError(f"which is larger than {_MAX_BYTES // 1_000_000} MB")
        found = read(path, size)
    except OSError as error:
        raise ValueError(f"which cannot be read: {error.strerror or error}") from None
    except UnusableError:
        raise
    except _NOT_OF_THE_FORM as error:
        raise ValueError(f"which is not {form}: {error}") from None
    found = found if isinstance(found, LabelledMatrix) else LabelledMatrix(found)
    if not np.isfinite(found.matrix).all():
        raise ValueError("which holds numbers that are not finite")
    return found


# What NumPy's and SciPy's readers raise; an OverflowError is an ArithmeticError, a UnicodeDecodeError a ValueError.
_NOT_OF_THE_FORM = (
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    ArithmeticError,
    NotImplementedError,
    EOFError,
    zipfile.BadZipFile,
)


def _market(path: str, size: int) -> NDArray[np.float64] | LabelledMatrix:
    from scipy.io import mminfo, mmread  # only now: few models need them

    with open_file(path) as file:
        if not file.readline(100).lstrip().startswith(b"%%"):
            return read_abaqus(path)
    rows, columns, entries, _, field, _ = mminfo(path)
    _check_shape((rows, columns))
    if 2 * entries > size:  # a digit and a space each, at least
        raise UnusableError(f"which declares {entries:,} entries, but is too short for them")
    if field not in ("real", "integer", "double", "unsigned-integer"):
        raise UnusableError(f"which holds entries that are {field}; they must be real numbers")
    matrix: Any = mmread(path, spmatrix=False)
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=float)


def _harwell(path: str, _: int) -> NDArray[np.float64]:
    """Read a file in Harwell-Boeing format; SciPy reads unsymmetric ones only, so symmetric ones are declared such."""
    from scipy.io import hb_read

    with open_file(path) as file:
        lines = file.read().decode("latin-1").splitlines()
    if len(lines) < 5:
        raise UnusableError("which is too short for a Harwell-Boeing file")
    kind = lines[2][:3].upper()
    if kind not in ("RUA", "RSA"):
        raise UnusableError(f"which is of the type {given(kind)}; only real assembled matrices are read (RSA and RUA)")
    _check_shape(tuple(int(part) for part in lines[2][3:].split()[:2]))
    lines[2] = f"RUA{lines[2][3:]}"
    lines[3] = re.sub(r"(?<=\d)[dD](?=\d)", "E", lines[3])  # formats with D for the exponent, as of Fortran
    body = (re.sub(r"(?<=[\d.])[dD](?=[-+]?\d)", "E", line) for line in lines[4:])
    content = "\n".join([*lines[:4], *body, ""])
    matrix = np.asarray(hb_read(io.StringIO(content), spmatrix=False).toarray(), dtype=float)
    if kind == "RUA":
        return matrix
    if np.triu(matrix, 1).any():
        raise UnusableError("which is symmetric, but has entries above its diagonal")
    return matrix + np.tril(matrix, -1).T


def _packed(path: str, _: int) -> NDArray[np.float64]:
    from scipy.sparse import load_npz

    check_npz(path, _MAX_BYTES)
    matrix: Any = load_npz(path)  # refuses pickled objects
    _check_shape(matrix.shape)
    if matrix.format in ("csr", "csc", "bsr"):
        matrix.check_format(full_check=True)  # SciPy does not check indices before it writes
    elif matrix.format != "coo":  # whose indices are checked on construction
        raise UnusableError(f"which is stored as {matrix.format}; store it as csr, csc, coo or bsr")
    _check_real(matrix.dtype)
    return np.asarray(matrix.toarray(), dtype=float)


def _array(path: str, size: int) -> NDArray[np.float64]:
    with open_file(path) as file:
        shape, kind = array_header(file, size)
        _check_shape(shape * 2 if len(shape) == 1 else shape)  # a row of numbers is a diagonal, as in a model file
        _check_real(kind)
        file.seek(0)
        matrix = np.load(file, allow_pickle=False)
    with np.errstate(over="ignore"):  # a longer number than a float holds is not finite
        return matrix.astype(float)


def _table(path: str, _: int) -> NDArray[np.float64]:
    rows: list[list[float]] = []
    with open_file(path) as file:
        for number, line in enumerate(iter(lambda: file.readline(_MAX_LINE + 1), b""), start=1):
            if len(line) > _MAX_LINE:
                raise UnusableError(
                    f"which has a line {number} of more than {_MAX_LINE:,} characters; a row is shorter"
                )
            try:
                row = _row(line.decode("utf-8-sig" if number == 1 else "utf-8"))
            except UnicodeDecodeError:
                raise UnusableError("which is not UTF-8 text; save it as CSV in UTF-8") from None
            except ValueError as error:
                raise UnusableError(f"which has {error} in line {number}") from None
            if row and rows and len(row) != len(rows[0]):
                raise UnusableError(
                    f"which has {len(row)} numbers in line {number}, but {len(rows[0])} in the first row; all rows of "
                    "a matrix are of one length"
                )
            rows += [row] if row else []
            if len(rows) > MAX_COORDINATES or len(row) > MAX_COORDINATES:
                _check_shape((max(len(rows), len(row)),) * 2)
    if not rows:
        raise UnusableError("which holds no numbers; write a row of the matrix in each line, as in 2.0,-1.0")
    _check_shape((len(rows), len(rows[0])))
    return np.array(rows)


def _row(line: str) -> list[float]:
    """Read the numbers of a line, separated by semicolons, tabs, commas or blanks; none in a comment."""
    text = line.partition("#")[0].strip()
    mark = next((mark for mark in ";\t," if mark in text), None)
    cells = text.split(mark)
    if len(cells) > MAX_COORDINATES:
        raise ValueError(f"{len(cells):,} numbers, more than the {MAX_COORDINATES:,} coordinates that there may be,")
    return [_number(cell.strip(), decimal_comma=mark != ",") for cell in cells]


def _number(cell: str, *, decimal_comma: bool) -> float:
    try:
        if "_" in cell:  # which Python would read
            raise ValueError
        return float(cell)
    except ValueError:
        hint = "; write decimal points, not commas," if decimal_comma and "," in cell else ""
        raise ValueError(f"{given(cell)}, where only real numbers are allowed{hint}") from None


_READERS: Mapping[str, tuple[str, Callable[[str, int], NDArray[np.float64] | LabelledMatrix]]] = {
    ".mtx": ("a Matrix Market file", _market),
    **dict.fromkeys((".hb", ".rb", ".rsa", ".rua"), ("a Harwell-Boeing file", _harwell)),
    ".npz": ("a sparse matrix of SciPy", _packed),
    ".npy": ("an array of NumPy", _array),
    ".csv": ("a table of numbers", _table),
}
_FORMS = (
    "Matrix Market or Abaqus (.mtx), Harwell-Boeing (.hb, .rsa, .rua), Nastran's OP4 (.op4) or DMIG (.pch, .bdf), "
    "SciPy's sparse format (.npz), NumPy's (.npy), or CSV (.csv)"
)


def _check_real(kind: np.dtype[Any]) -> None:
    if kind.kind not in _REAL:
        raise UnusableError(f"which holds numbers of the kind {kind}; they must be real")


def _check_shape(shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or shape[0] != shape[1]:
        held = f"a matrix of {' x '.join(map(str, shape))}" if shape else "one number"
        raise UnusableError(f"which holds {held}; it must have a row and a column per coordinate")
    if shape[0] > MAX_COORDINATES:
        raise UnusableError(f"which holds a matrix of {shape[0]} rows; there may be {MAX_COORDINATES} at most")
