"""What makes a model file of a large system short: matrices in files beside it, and coordinates by their number."""

from __future__ import annotations

import os
import zipfile
from dataclasses import replace
from typing import Any

import numpy as np

from gapwalk.files import check_npz, open_file
from gapwalk.model.fields import MAX_COORDINATES
from gapwalk.model.problem import Problem, given
from gapwalk.model.source import Source

MATRICES = ("mass", "damping", "stiffness")
_MAX_BYTES = 200_000_000  # of a file, and of what is packed in one
_FORMS = "Matrix Market (.mtx) or SciPy's sparse format (.npz)"


def expand(source: Source) -> tuple[Source, list[Problem]]:
    """Put matrices that stand in files of their own, and the names of counted coordinates, into a source.

    ``stiffness = "stiffness.mtx"`` names a file beside the model file, ``coordinates = 100`` stands for q1 ... q100.

    Returns
    -------
    source : Source
        With all in its place.
    problems : list of Problem
        The files that cannot be used.
    """
    data, problems = dict(source.data), []
    count = data.get("coordinates")
    if isinstance(count, int) and not isinstance(count, bool):
        if 1 <= count <= MAX_COORDINATES:
            data["coordinates"] = [f"q{number}" for number in range(1, count + 1)]
        else:
            problems.append(source.problem(_count_problem(count), ("coordinates",)))
            data["coordinates"] = []
    for key in MATRICES:
        value = data.get(key)
        if isinstance(value, str):
            try:
                data[key] = read_matrix(_place_of(value, source)).tolist()
            except ValueError as error:
                problems.append(source.problem(f"is {given(value)}, {error}", (key,)))
                del data[key]
    return replace(source, data=data), problems


def _place_of(name: str, source: Source) -> str:
    """The file of a matrix; a ValueError if the source may not ask for it."""
    path = os.path.join(os.path.dirname(source.name), name)
    if source.within:
        inside = os.path.realpath(source.within)
        if os.path.commonpath((os.path.realpath(path), inside)) != inside:
            raise ValueError(f"which lies outside of the folder {os.path.basename(inside)}; put the file into it")
    return path


def read_matrix(path: str) -> np.ndarray:
    """The matrix of a file, shape (n, n).

    Nothing in the file is executed, and nothing is made that is larger than a system can be.

    Raises
    ------
    ValueError
        If there is none that can be used; the message follows on the name of the file.
    """
    ending = os.path.splitext(path)[1]
    if ending not in (".mtx", ".npz"):
        raise ValueError(f"which must be a list of rows, or a file in the form of {_FORMS}")
    try:
        with open_file(path) as file:
            size = os.fstat(file.fileno()).st_size
        if size > _MAX_BYTES:
            raise ValueError(f"which is larger than {_MAX_BYTES // 1_000_000} MB")
        matrix = _market(path, size) if ending == ".mtx" else _packed(path)
    except OSError as error:
        raise ValueError(f"which cannot be read: {error.strerror or error}") from None
    if not np.isfinite(matrix).all():
        raise ValueError("which holds numbers that are not finite")
    return matrix


def _market(path: str, size: int) -> np.ndarray:
    from scipy.io import mminfo, mmread  # only now: few models need them

    try:
        rows, columns, entries, _, field, _ = mminfo(path)
        _check_shape((rows, columns))
        if 2 * entries > size:  # a digit and a space each, at least
            raise ValueError(f"which is said to have {entries:,} entries, but they are not there")
        if field not in ("real", "integer", "double", "unsigned-integer"):
            raise ValueError(f"which holds entries that are {field}; they must be real numbers")
        matrix: Any = mmread(path)
    except (TypeError, OverflowError, UnicodeDecodeError) as error:
        raise ValueError(f"which is no Matrix Market file: {error}") from None
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith("which ") else f"which is no Matrix Market file: {text}") from None
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=float)


def _packed(path: str) -> np.ndarray:
    from scipy.sparse import load_npz

    try:
        check_npz(path, _MAX_BYTES)
        matrix: Any = load_npz(path)  # refuses pickled objects
        _check_shape(matrix.shape)
        if matrix.format in ("csr", "csc", "bsr"):
            matrix.check_format(full_check=True)  # an index beyond the matrix would be written to without a look
        elif matrix.format != "coo":  # which looks at its indices when it is made
            raise ValueError(f"which is stored as {matrix.format}; store it as csr, csc, coo or bsr")
        if matrix.dtype.kind not in "fiu":
            raise ValueError(f"which holds numbers of the kind {matrix.dtype}; they must be real")
        return np.asarray(matrix.toarray(), dtype=float)
    except (zipfile.BadZipFile, LookupError, TypeError, AttributeError, NotImplementedError, EOFError) as error:
        raise ValueError(f"which is no sparse matrix of SciPy: {error}") from None
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith("which ") else f"which is no sparse matrix of SciPy: {text}") from None


def _check_shape(shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or shape[0] != shape[1]:
        raise ValueError(
            f"which holds a matrix of {' x '.join(map(str, shape))}; it must have a row and a column per coordinate"
        )
    if shape[0] > MAX_COORDINATES:
        raise ValueError(f"which holds a matrix of {shape[0]} rows; there may be {MAX_COORDINATES} at most")


def _count_problem(count: int) -> str:
    return f"is {given(count)}; it must be a list of names, or their number, from 1 to {MAX_COORDINATES}"
