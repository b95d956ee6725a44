"""A matrix in a file of its own: of a finite-element program, Matrix Market, SciPy, NumPy, or CSV."""

from __future__ import annotations

import io
import os
import re
import zipfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.files import array_header, check_npz, open_file
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import MAX_COORDINATES

# Matrices whose rows have names: degrees of freedom of nodes, from finite-element programs.

FIXED = 1e35
"""A diagonal entry of a stiffness matrix from which on its coordinate is fixed: Abaqus writes 1e36 there."""

_DIRECTIONS = {0: "", 1: "_x", 2: "_y", 3: "_z", 4: "_rx", 5: "_ry", 6: "_rz"}


class UnusableError(ValueError):
    """A matrix that cannot be used, although its file is of the right form."""


@dataclass(frozen=True, eq=False)
class LabelledMatrix:
    """A square matrix, with the names of its rows if its file has some."""

    matrix: NDArray[np.float64]  #: shape (n, n): The matrix; or its diagonal, shape (n,).
    names: tuple[str, ...] = ()  #: Names such as ``n12_z``, one for each row; empty if the file has none.

    def tobytes(self) -> bytes:
        """Return the content as bytes, for digests."""
        return self.matrix.tobytes() + " ".join(self.names).encode()


Label = tuple[int, int]
"""Number of a node and of a degree of freedom: 1 to 3 along x, y, z; 4 to 6 about them; 0 of a scalar point."""


def name_of(label: Label) -> str:
    """Return the name of a coordinate, such as ``n12_z``; ``n12_d8`` of a degree of freedom beyond the sixth."""
    node, direction = label
    return f"n{node}{_DIRECTIONS.get(direction, f'_d{direction}')}"


def assembled(entries: Mapping[tuple[Any, Any], float], *, symmetric: bool | None) -> LabelledMatrix:
    """Make the matrix of its entries."""
    if not entries:
        raise UnusableError("which holds no entries")
    labels: list[Any] = sorted({label for pair in entries for label in pair})
    is_indexed = isinstance(labels[0], int)
    count = labels[-1] if is_indexed else len(labels)
    if count > MAX_COORDINATES:
        raise UnusableError(
            f"which holds a matrix of {count:,} rows; there may be {MAX_COORDINATES:,}: condense the model to fewer "
            "degrees of freedom (a substructure, superelement or Guyan reduction) before it is written"
        )
    if is_indexed:
        labels = list(range(1, count + 1))
    if symmetric is None:
        symmetric = not any(row != column and (column, row) in entries for row, column in entries)
    places = {label: place for place, label in enumerate(labels)}
    matrix = np.zeros((len(labels), len(labels)))
    for (row, column), value in entries.items():
        matrix[places[row], places[column]] = value
        if symmetric and row != column:
            other = entries.get((column, row), value)
            if other != value:
                at = " and ".join(str(each) if is_indexed else name_of(each) for each in (row, column))
                raise UnusableError(f"which is said to be symmetric, but has {value:g} and {other:g} between {at}")
            matrix[places[column], places[row]] = value
    return LabelledMatrix(matrix, () if is_indexed else tuple(map(name_of, labels)))


def arranged(matrices: Mapping[str, LabelledMatrix], coordinates: object) -> tuple[dict[str, Any], list[str] | None]:
    """Arrange matrices whose rows have names in one order of coordinates.

    Coordinates that have an entry of 1e36 on the diagonal of the stiffness, as Abaqus marks fixed ones, are left out.
    Coordinates that one of the files lacks have zeros in its matrix.
    """
    named = {key: each for key, each in matrices.items() if each.names}
    if not named:
        return {key: each.matrix for key, each in matrices.items()}, None
    first = named.get("stiffness") or next(iter(named.values()))
    names = list(dict.fromkeys((*first.names, *(name for each in named.values() for name in each.names))))
    if "stiffness" in named:
        diagonal = dict(zip(first.names, np.abs(first.matrix.diagonal()), strict=True))
        names = [name for name in names if diagonal.get(name, 0.0) < FIXED]
    if coordinates is not None:
        listed = coordinates if isinstance(coordinates, list) else []
        if sorted(map(str, listed)) != sorted(names):
            some = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
            raise ValueError(
                f"is {given(coordinates)}, but the files name {len(names)} coordinates ({some}); leave the key out, or "
                "list all of them in the order that you want"
            )
        names = [str(name) for name in listed]
    arrays: dict[str, Any] = {}
    for key, each in matrices.items():
        if not each.names:
            arrays[key] = each.matrix
            continue
        places = {name: place for place, name in enumerate(each.names)}
        found = [(new, places[name]) for new, name in enumerate(names) if name in places]
        new, old = (
            (np.array(part, dtype=int) for part in zip(*found, strict=True)) if found else (np.zeros(0, int),) * 2
        )
        arrays[key] = np.zeros((len(names), len(names)))
        arrays[key][np.ix_(new, new)] = each.matrix[np.ix_(old, old)]
    return arrays, names


# Matrices as finite-element programs write them in text: Abaqus (``*.mtx``), Nastran DMIG cards and OP4 files.
#
# Sources: Abaqus Keywords Reference Guide, MATRIX INPUT and MATRIX OUTPUT; MSC Nastran Quick Reference Guide, DMIG;
# MSC Nastran DMAP Programmer's Guide, OUTPUT4.

_LONGEST_LINE = 10_000  # characters
_MOST_ENTRIES = MAX_COORDINATES**2
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([-+]\d+)|[eEdD](\d+))?")


def lines_of(path: str) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text file with their numbers; raise an UnusableError if it is no text."""
    with open_file(path) as file:
        for number, line in enumerate(iter(lambda: file.readline(_LONGEST_LINE + 1), b""), start=1):
            if len(line) > _LONGEST_LINE or b"\0" in line:
                raise UnusableError("which is not a text file; let the program write it as text (formatted)")
            yield number, line.decode("latin-1").rstrip("\r\n")


def real(text: str) -> float:
    """Read a number as Fortran and Nastran write it: ``1.5D+3``, ``1.5+3``; raise a ValueError if it is none."""
    match = _NUMBER.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{given(text.strip())}, where a number is expected,")
    return float(f"{match[1]}e{match[2] or match[3] or 0}")


class _Entries(dict[Any, float]):
    """Entries of a matrix by their places, each read once."""

    def __init__(self) -> None:
        super().__init__()
        self._lines: dict[Any, int] = {}

    def read(self, place: Any, value: float, line: int) -> None:
        """Take the entry of a line; raise an UnusableError for one that is there already, and for too many."""
        if place in self:
            raise UnusableError(
                f"which gives the same entry in lines {self._lines[place]} and {line}; leave one of them out"
            )
        if len(self) >= _MOST_ENTRIES:
            raise UnusableError(
                f"which holds more than {_MOST_ENTRIES:,} entries; condense the model before it is written"
            )
        self[place], self._lines[place] = value, line


def read_abaqus(path: str) -> LabelledMatrix:
    """Read a matrix that Abaqus writes by ``*MATRIX OUTPUT``, in any of its three text formats.

    The formats MATRIX INPUT and LABELS have in each line a node and a degree of freedom for the row, the same for the
    column, and the entry: the rows get names such as ``n12_z``.
    The format COORDINATE has row, column and entry. Of a symmetric matrix one triangle suffices.
    """
    entries = _Entries()
    symmetric: bool | None = None
    scale, headed, width = 1.0, False, 0
    for number, line in lines_of(path):
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            keyword, *options = (part.strip().upper() for part in line.split(","))
            if re.sub(r"\s+", " ", keyword) == "*MATRIX ASSEMBLE":
                continue
            if re.sub(r"\s+", " ", keyword) != "*MATRIX INPUT" or headed:
                what = "a second matrix" if headed else f"{given(keyword)}"
                raise UnusableError(f"which has {what} in line {number}; keep one matrix of *MATRIX OUTPUT in a file")
            headed, symmetric = True, True  # which is the default
            for option in options:
                key, _, value = (part.strip() for part in option.partition("="))
                if key in ("TYPE", "MATRIX TYPE"):
                    symmetric = value != "UNSYMMETRIC"
                elif key == "SCALE FACTOR":
                    scale = real(value)
            continue
        cells = line.replace(",", " ").split()
        width = width or len(cells)
        if len(cells) != width or width not in (3, 5):
            raise UnusableError(
                f"which has {len(cells)} numbers in line {number}; it is neither Matrix Market (which begins with "
                "%%MatrixMarket) nor a matrix of Abaqus: row node, row dof, column node, column dof, entry"
            )
        try:
            *indices, value = [int(cell) for cell in cells[:-1]] + [real(cells[-1])]
        except ValueError:
            raise UnusableError(
                f"which has {given(line.strip())} in line {number}, where numbers are expected"
            ) from None
        row, column = (indices[0], indices[1]) if width == 3 else (tuple(indices[:2]), tuple(indices[2:]))
        _check_label(row, column, number)
        entries.read((row, column), scale * value, number)
    return assembled(entries, symmetric=symmetric)


def _check_label(row: Any, column: Any, number: int) -> None:
    if any((each if isinstance(each, int) else each[0]) < 1 for each in (row, column)):
        raise UnusableError(
            f"which has a row or column without a node in line {number}, an internal variable of Abaqus (such as a "
            "Lagrange multiplier); write the matrix without contact and constraints, or as a substructure"
        )


def read_dmig(path: str, wanted: str) -> LabelledMatrix:
    """Read a matrix from the DMIG cards of a Nastran file (bulk data or punch); other cards are ignored."""
    heads: dict[str, int] = {}
    matrices: defaultdict[str, _Entries] = defaultdict(_Entries)
    for number, cells in _cards(path):
        name = cells[0].upper() if cells else ""
        try:
            if cells[1] in ("0", ""):
                form, kind = int(cells[2]), int(cells[3])
                if name in heads:
                    raise UnusableError(f"which begins the matrix {name} again in line {number}")
                heads[name] = form if kind in (1, 2) else -kind
                continue
            column = int(cells[1]), int(cells[2] or 0)
            groups = [cells[start : start + 4] for start in range(4, len(cells), 4)]
            for group in groups:
                if any(group):
                    row = int(group[0]), int(group[1] or 0)
                    value = real(group[2]) if group[2] else 0.0
                    matrices[name].read((row, column), value, number)
        except UnusableError:
            raise
        except (IndexError, ValueError):
            raise UnusableError(f"which has a card DMIG in line {number} that cannot be read") from None
    name = chosen(wanted, list(matrices), "DMIG")
    form = heads.get(name)
    if form is None:
        raise UnusableError(f"which has no head of the matrix {name}: the card DMIG, {name}, 0, form, type")
    if form < 0:
        raise UnusableError(f"whose matrix {name} is complex; only real matrices are read")
    if form not in (1, 6):
        raise UnusableError(f"whose matrix {name} has the form {form}; only square (1) and symmetric (6) ones are read")
    return assembled(matrices[name], symmetric=form == 6)


def chosen(wanted: str, names: Sequence[str], what: str) -> str:
    """Return the name of the matrix that is wanted from a file with several."""
    if not names:
        raise UnusableError(f"which holds no matrix ({what})")
    if not wanted and len(names) == 1:
        return names[0]
    if wanted.upper() in names:
        return wanted.upper()
    if wanted:
        raise UnusableError(f"which holds no matrix {wanted}; {did_you_mean(wanted.upper(), names, 'it holds')}")
    raise UnusableError(f"which holds the matrices {', '.join(names)}; name one, as in file.ext:{names[0]}")


def _cards(path: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each DMIG card, after its first, with the number of its first line.

    Cells are in columns of 8, or of 16 on lines with an asterisk in the first column or after the word; or separated by
    commas. The first and the last column of 8 continue cards.
    """
    card: list[str] | None = None
    first = 0
    for number, line in lines_of(path):
        text = line.partition("$")[0].rstrip()
        if not text:
            continue
        begins, continues = text[:4].upper() == "DMIG" and text[4:5] in ("", " ", "*", ","), text[0] in " +*,"
        if not continues and card is not None:
            yield first, card
            card = None
        if begins:
            first, card = number, []
        if card is None or not (begins or continues):
            continue
        is_wide = "*" in text[:8].partition(",")[0]
        if "," in text:
            cells = [cell.strip() for cell in text.split(",")[1:]]
            cells += [""] * ((4 if is_wide else 8) - len(cells))
            card += cells[: 4 if is_wide else 8]
        else:
            step, count = (16, 4) if is_wide else (8, 8)
            padded = text.expandtabs(8).ljust(8 + step * count)
            card += [padded[8 + step * k : 8 + step * (k + 1)].strip() for k in range(count)]
    if card is not None:
        yield first, card


class _Head(NamedTuple):
    """Head of a matrix in an OP4 file."""

    columns: int
    rows: int
    kind: int
    name: str
    width: int


def read_op4(path: str, wanted: str) -> LabelledMatrix:
    """Read a matrix of a Nastran OP4 file written as text (OUTPUT4, ``FORM=FORMATTED``); rows have no names."""
    found: dict[str, Any] = {}
    lines = (line for _, line in lines_of(path))
    for line in lines:
        if line.strip():
            head = _head_of(line)
            found[head.name] = _op4_matrix(head, lines)
    matrix = found[chosen(wanted, list(found), "OP4")]
    if isinstance(matrix, str):
        raise UnusableError(matrix)
    return LabelledMatrix(matrix)


def _head_of(line: str) -> _Head:
    try:
        columns, rows, _, kind = (int(line[8 * k : 8 * k + 8]) for k in range(4))
    except ValueError:
        raise UnusableError(
            "which is no OP4 file in text; write it by OUTPUT4 with FORM=FORMATTED in its ASSIGN statement"
        ) from None
    match = re.search(r"\d*[EeDd](\d+)\.\d+", line[40:])
    return _Head(columns, rows, kind, line[32:40].strip().upper(), int(match[1]) if match else 16)


def _op4_matrix(head: _Head, lines: Iterator[str]) -> Any:
    """Return a matrix; or, in words, why it cannot be used."""
    big, rows = head.rows < 0, abs(head.rows)
    wrong = ""
    if head.kind not in (1, 2):
        wrong = f"whose matrix {head.name} is complex; only real matrices are read"
    elif rows != head.columns or rows > MAX_COORDINATES:
        wrong = (
            f"whose matrix {head.name} has {rows:,} rows and {head.columns:,} columns; it must be square, with "
            f"{MAX_COORDINATES:,} rows at most"
        )
    matrix = np.zeros((0, 0) if wrong else (rows, rows))
    column, start, words = 0, 0, 0
    values: list[float] = []
    for line in lines:
        if "." in line:  # numbers; all other lines hold integers alone
            if column > head.columns:
                return wrong or matrix  # a number ends the matrix
            width = head.width
            values += [real(line[k : k + width]) for k in range(0, len(line.rstrip()), width)]
            continue
        if values:
            # programs count words of 4 bytes, or numbers
            if len(values) not in (words, words // 2) or start < 1 or start - 1 + len(values) > rows:
                break
            if not wrong:
                matrix[start - 1 : start - 1 + len(values), column - 1] = values
            values = []
        if len(line.rstrip()) > 16:
            column, start, words = (int(line[k : k + 8]) for k in (0, 8, 16))
        elif big:
            words, start = (int(part) for part in line.split())
            words -= 1
        else:
            string = int(line)
            words = string // 65536 - 1
            start = string - 65536 * (words + 1)
    raise UnusableError(
        f"whose matrix {head.name} cannot be read: it ends too early, or has a column of a wrong length"
    )


OF_NASTRAN: Mapping[str, Any] = {
    **dict.fromkeys((".pch", ".bdf", ".dat", ".nas", ".dmig"), ("cards DMIG of Nastran", read_dmig)),
    ".op4": ("an OP4 file of Nastran", read_op4),
}
"""Readers by the endings of files that may hold several matrices, each with the form in words."""


_MAX_BYTES = 200_000_000  # of a file, and of its unpacked content
_MAX_LINE = 100 * MAX_COORDINATES  # characters in a line of CSV: a number takes some 25
_REAL_KINDS = "fiu"  # kinds of NumPy's numbers that are real


def split_name(name: str) -> tuple[str, str]:
    """Split ``model.pch:KAAX`` into a file that may hold several matrices and the name of one; others have none."""
    file, mark, matrix = name.rpartition(":")
    return (file, matrix) if mark and os.path.splitext(file)[1].lower() in OF_NASTRAN else (name, "")


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
    if kind.kind not in _REAL_KINDS:
        raise UnusableError(f"which holds numbers of the kind {kind}; they must be real")


def _check_shape(shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or shape[0] != shape[1]:
        held = f"a matrix of {' x '.join(map(str, shape))}" if shape else "one number"
        raise UnusableError(f"which holds {held}; it must have a row and a column per coordinate")
    if shape[0] > MAX_COORDINATES:
        raise UnusableError(f"which holds a matrix of {shape[0]} rows; there may be {MAX_COORDINATES} at most")
