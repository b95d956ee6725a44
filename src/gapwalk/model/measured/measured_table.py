"""A measured table from a CSV file, whose columns are found by their quantity or by their name.

The line of names has the units: ``deflection (deg), torque (N m)``, or ``deflection [deg]; torque [Nm]``.
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.files import open_file
from gapwalk.model.measured.csv_columns import CsvColumns, parse_csv
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import Quantity, QuantityKind, Unit, read_unit

MAX_BYTES = 10_000_000
"""Largest size of a file."""
MAX_ROWS = 100_000
"""Largest number of rows of a table."""

_PIECE = 1 << 20
_NO_UNIT = ("", "-", "1")
_SHOWN = 20  # columns that a message lists


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file that a model file names, with its content."""

    name: str  #: Its name, as it stands in the model file.
    content: bytes  #: Its bytes.

    def __repr__(self) -> str:
        return repr(self.name)


@dataclass(frozen=True, slots=True)
class WantedColumn:
    """A column that a table must have."""

    role: str  #: What it is for, such as ``"deflection"``; also the first name by which it is looked for.
    kind: QuantityKind | None  #: Its kind of quantity. None if it must have no unit, since the model has none.
    #: Other names by which it is looked for, such as ``("angle",)``; capital letters make no difference.
    others: tuple[str, ...] = ()
    name: str = ""  #: Its name in the file, if the user gave it: then it is not looked for.
    key: str = ""  #: The key with which the user gives that name, for messages.

    @property
    def head(self) -> str:
        """How the column should be named in the file."""
        return self.role if self.kind is None else f"{self.role} ({self.kind.usual[0]})"


@dataclass(frozen=True, eq=False)
class MeasuredColumn:
    """A column of a table."""

    head: str  #: Its name in the file, with its unit.
    numbers: NDArray[np.float64]  #: shape (rows,): Its numbers, as they are written.
    unit: Unit | None  #: Its unit; None for plain numbers.
    kind: QuantityKind | None  #: Its kind of quantity; None for plain numbers.

    @property
    def quantity(self) -> Quantity | None:
        """One unit of the column, from which a train may choose its units; None for plain numbers."""
        if self.unit is None or self.kind is None:
            return None
        return Quantity(1.0, self.unit.text, self.unit.factor, self.kind)

    def values(self, unit: Unit | None = None) -> NDArray[np.float64]:
        """Return the numbers in a unit of its kind; by default in the reference unit (SI, angles in rad)."""
        factor = (1.0 if self.unit is None else self.unit.factor) / (1.0 if unit is None else unit.factor)
        return self.numbers * factor


@dataclass(frozen=True, eq=False)
class MeasuredTable:
    """The columns of a measured table."""

    name: str  #: Name of the file, for messages.
    columns: dict[str, MeasuredColumn]  #: The columns that were wanted, by their roles.
    lines: tuple[int, ...]  #: shape (rows,): The line of each row in the file, for messages.

    def __len__(self) -> int:
        return len(self.lines)

    def __getitem__(self, role: str) -> MeasuredColumn:
        return self.columns[role]


def read_table(
    source: str | os.PathLike[str] | io.StringIO | NamedFile, wanted: Sequence[WantedColumn], *, name: str = ""
) -> MeasuredTable:
    r"""Read a measured table from a CSV file.

    Parameters
    ----------
    source
        A CSV file in UTF-8, its text as ``io.StringIO``, or its content: a line of column names with units, then
        numbers, separated by commas, semicolons or tabs. Lines that begin with ``#`` are comments. Where commas do not
        separate numbers, they may be decimal ones.
    wanted
        The columns to find. A column without a given name is found by its unit, if it is the only one with a unit of
        its kind, or by its role or one of its other names.
    name
        Name of the table in messages; by default that of the file.

    Returns
    -------
    MeasuredTable
        The wanted columns, finite numbers in the order of the file.

    Raises
    ------
    ModelError
        If the file cannot be read, is larger than 10 MB or 100,000 rows, has no such columns, a column without a unit
        (or with one, if it must have none), or an entry that is no finite number. The message begins with the name.

    Examples
    --------
    >>> text = "twist (deg), M (kN m)\n-2, -0.5\n2, 0.5\n"
    >>> wanted = [WantedColumn("deflection", QuantityKind.ANGLE), WantedColumn("torque", QuantityKind.TORQUE)]
    >>> read_table(io.StringIO(text), wanted)["torque"].values()
    array([-500.,  500.])
    """
    if isinstance(source, io.StringIO):
        name, content = name or "the table", source.getvalue().encode("utf-8", "replace")
    elif isinstance(source, NamedFile):
        name, content = name or source.name, source.content
    else:
        name = name or os.path.basename(os.fspath(source))
        content = _content(source, name)
    try:
        if len(content) > MAX_BYTES:
            raise ModelError(f"it is larger than {MAX_BYTES // 1_000_000} MB; leave out rows")
        text = parse_csv(content, ", ".join(each.head for each in wanted), MAX_ROWS, "leave out rows")
        if not text.rows:
            raise ModelError("it has a line of names, but no numbers below it")
        return MeasuredTable(name, _columns(text, wanted), tuple(number for number, _ in text.rows))
    except ModelError as error:
        raise ModelError(f"{name}: {_printable(str(error))}") from None


def read_heads(source: NamedFile) -> list[ColumnHead]:
    """Read the names of the columns of a file, each divided into a name and a unit; errors as of `read_table`."""
    try:
        text = parse_csv(source.content, "angle (deg), torque (N m)", MAX_ROWS, "leave out rows")
    except ModelError as error:
        raise ModelError(f"{source.name}: {_printable(str(error))}") from None
    return [ColumnHead.of(head) for head in text.heads]


def _content(path: str | os.PathLike[str], name: str) -> bytes:
    content = bytearray()
    try:
        with open_file(path) as file:
            while len(content) <= MAX_BYTES and (piece := file.read(_PIECE)):
                content += piece
    except (OSError, ValueError) as error:
        raise ModelError(f"{name}: it cannot be read: {getattr(error, 'strerror', None) or error}") from None
    return bytes(content)


def _printable(text: str) -> str:
    """Write characters of a file that would control the terminal as their codes."""
    return "".join(char if char.isprintable() else repr(char)[1:-1] for char in text)


def _columns(text: CsvColumns, wanted: Sequence[WantedColumn]) -> dict[str, MeasuredColumn]:
    heads = [ColumnHead.of(head) for head in text.heads]
    places: dict[str, int] = {}
    for each in (*(each for each in wanted if each.name), *(each for each in wanted if not each.name)):
        places[each.role] = _place(heads, each, {*places.values()})
    units = {each.role: _unit(heads[places[each.role]], each) for each in wanted}  # before any number is read
    labels = {each.role: heads[places[each.role]].name or each.role for each in wanted}
    if len({*labels.values()}) < len(labels):  # two columns of one name
        labels = {each.role: each.role for each in wanted}
    numbers = text.numbers({labels[each.role]: places[each.role] for each in wanted})
    for label, column in numbers.items():
        wrong = np.flatnonzero(~np.isfinite(column))
        if len(wrong):
            more = f" ({len(wrong)} such entries)" if len(wrong) > 1 else ""
            raise ModelError(f"line {text.rows[wrong[0]][0]}: {label} is not a finite number{more}; leave out its line")
        column.flags.writeable = False
    return {
        each.role: MeasuredColumn(
            heads[places[each.role]].text, numbers[labels[each.role]], units[each.role], units[each.role] and each.kind
        )
        for each in wanted
    }


@dataclass(frozen=True, slots=True)
class ColumnHead:
    """The name of a column, divided into its name and its unit; without a unit, `unit` is empty."""

    text: str
    name: str
    unit: str

    @classmethod
    def of(cls, text: str) -> ColumnHead:
        """Divide a text at the last bracket that is not within others, as that of ``damping (N m/(rad s))``."""
        opening = {")": "(", "]": "["}.get(text[-1:])
        if opening:
            depth = 0
            for place in range(len(text) - 1, -1, -1):
                depth += (text[place] == text[-1]) - (text[place] == opening)
                if not depth:
                    unit = text[place + 1 : -1].strip()
                    return cls(text, text[:place].strip(), "" if unit in _NO_UNIT else unit)
        return cls(text, text.strip(), "")

    def is_of(self, kind: QuantityKind) -> bool:
        """Return True if its unit is one of a kind."""
        try:
            return bool(self.unit) and bool(read_unit(self.unit, kind))
        except ValueError:
            return False


def _place(heads: Sequence[ColumnHead], wanted: WantedColumn, taken: set[int]) -> int:
    """Return the index of a wanted column."""
    shown = [head.text for head in heads if head.text][:_SHOWN]
    write = f'. Name it: {wanted.key} = "..."' if wanted.key else f". Name it {wanted.head}"
    if wanted.name:
        found = _named(heads, (wanted.name,))
        if not found:
            raise ModelError(
                f"there is no column {wanted.name!r} for {wanted.role}; "
                f"{did_you_mean(wanted.name, shown, 'columns are')}"
            )
    else:
        found = _sought(heads, wanted, taken)
        if not found:
            unit = f" with the unit of {wanted.kind.words}" if wanted.kind else ""
            raise ModelError(
                f"there is no column {wanted.role!r}{unit}; {did_you_mean(wanted.role, shown, 'columns are')}{write}"
            )
    if len(found) > 1:
        several = " and ".join(repr(heads[place].text) for place in found[:_SHOWN])
        raise ModelError(f"{len(found)} columns may be {wanted.role}: {several}{write}")
    if found[0] in taken:
        raise ModelError(f"the column {heads[found[0]].text!r} cannot be {wanted.role} and something else{write}")
    return found[0]


def _sought(heads: Sequence[ColumnHead], wanted: WantedColumn, taken: set[int]) -> list[int]:
    """Return the indices of the columns that may be meant: those of the right name among those of the right unit."""
    names = (wanted.role, *wanted.others)
    free = [place for place in range(len(heads)) if place not in taken]
    if wanted.kind is not None:
        of_kind = [place for place in free if heads[place].is_of(wanted.kind)]
        for name in names:
            if by_name := [place for place in _named(heads, (name,)) if place in of_kind]:
                return by_name
        if of_kind:
            return of_kind
    for name in names:  # a column of this name has no unit, or a wrong one, which is said then
        if by_name := [place for place in _named(heads, (name,)) if place in free]:
            return by_name
    return []


def _named(heads: Sequence[ColumnHead], names: Sequence[str]) -> list[int]:
    """Return the indices of the columns of a name: exactly as written, or else in other letters or without its unit."""
    for key in (lambda head: head.text, lambda head: head.name, lambda head: head.name.casefold()):
        found = [place for place, head in enumerate(heads) if key(head) in (*names, *(n.casefold() for n in names))]
        if found:
            return found
    return []


def _unit(head: ColumnHead, wanted: WantedColumn) -> Unit | None:
    if wanted.kind is None:
        if head.unit:
            raise ModelError(
                f"the column {head.text!r} has the unit {head.unit}, but this model has no units; convert its numbers "
                f"to those of the model, and name it {head.name or wanted.role}"
            )
        return None
    if not head.unit:
        raise ModelError(
            f"the column {head.text!r} has no unit; write {wanted.kind.words} as in "
            f"{head.name or wanted.role} ({wanted.kind.usual[0]})"
        )
    try:
        return read_unit(head.unit, wanted.kind)
    except ValueError as error:
        raise ModelError(
            f"the column {head.text!r}: {error}; {wanted.kind.words} is expected, as in "
            f"{head.name or wanted.role} ({wanted.kind.usual[0]})"
        ) from None
