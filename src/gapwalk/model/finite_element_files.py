"""Matrices as finite-element programs write them in text: Abaqus (``*.mtx``), Nastran DMIG cards and OP4 files.

Sources: Abaqus Keywords Reference Guide, MATRIX INPUT and MATRIX OUTPUT; MSC Nastran Quick Reference Guide, DMIG;
MSC Nastran DMAP Programmer's Guide, OUTPUT4.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gapwalk.files import open_file
from gapwalk.model.labelled_matrix import LabelledMatrix, UnusableError, assembled
from gapwalk.model.problems import did_you_mean, given
from gapwalk.model.schema import MAX_COORDINATES

_LONGEST_LINE = 10_000  # characters
_MOST_ENTRIES = MAX_COORDINATES**2
_REAL = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([-+]\d+)|[eEdD](\d+))?")


def lines_of(path: str) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text file with their numbers; raise an UnusableError if it is no text."""
    with open_file(path) as file:
        for number, line in enumerate(iter(lambda: file.readline(_LONGEST_LINE + 1), b""), start=1):
            if len(line) > _LONGEST_LINE or b"\0" in line:
                raise UnusableError("which is not a text file; let the program write it as text (formatted)")
            yield number, line.decode("latin-1").rstrip("\r\n")


def real(text: str) -> float:
    """Read a number as Fortran and Nastran write it: ``1.5D+3``, ``1.5+3``; raise a ValueError if it is none."""
    match = _REAL.fullmatch(text.strip())
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
