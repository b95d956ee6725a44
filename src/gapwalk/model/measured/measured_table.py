"""A measured table from a CSV file, whose columns are found by their quantity or by their name.

The line of names has the units: ``deflection (deg), torque (N m)``, or ``deflection [deg]; torque [Nm]``.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.files import open_file
from gapwalk.model.model_source import Source
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import Quantity, QuantityKind, Unit, read_unit

# Columns of numbers in a CSV file: a line of names, then rows. Records and measured tables are read with it.
#
# The file is treated as data only. Its lines are separated by any usual end of a line; its entries by tabs, semicolons
# or commas, the first of these that the line of names contains. Empty lines, and lines that begin with ``#``, are
# skipped. Numbers may have a decimal comma where the comma does not separate them; then all of them must have it.

_MAX_COLUMNS = 1000
_QUOTED = 40  # characters of an entry that is quoted


@dataclass(frozen=True, eq=False)
class CsvColumns:
    """The text of a CSV file, in lines; the numbers of its columns are read on request."""

    heads: tuple[str, ...]  #: The names of the columns, as they are written.
    mark: str  #: What separates the entries: a tab, a semicolon or a comma.
    rows: tuple[tuple[int, str], ...]  #: The other lines, each with its number in the file, from 1.

    def numbers(self, places: Mapping[str, int]) -> dict[str, NDArray[np.float64]]:
        """Read the numbers of some columns, each of shape (rows,)."""
        table = np.empty((len(places), len(self.rows)))
        commas: dict[bool, tuple[int, str]] = {}  # the first number with a point, and the first one with a comma
        for row, (number, line) in enumerate(self.rows):
            try:
                entries = _entries(line, self.mark, strict=True)
            except csv.Error as error:
                raise ModelError(f"line {number}: it cannot be divided into entries: {error}") from None
            if len(entries) > len(self.heads) and any(entry.strip() for entry in entries[len(self.heads) :]):
                hint = "; with decimal commas, separate the columns by semicolons" if self.mark == "," else ""
                raise ModelError(
                    f"line {number}: it has {len(entries)} entries, but the first line names {len(self.heads)} "
                    f"columns{hint}"
                )
            for index, (name, place) in enumerate(places.items()):
                entry = entries[place].strip() if place < len(entries) else ""
                try:
                    table[index, row] = _number(entry, self.mark)
                except ValueError:
                    raise ModelError(f"line {number}: {_complaint(name, entry, self.mark)}") from None
                if "." in entry or "," in entry:
                    first = commas.setdefault("," in entry, (number, entry))
                    if len(commas) == 2:
                        other = commas["," not in entry]
                        raise ModelError(
                            f"line {first[0]}: {name} is {first[1]!r}, but line {other[0]} has {other[1]!r}; write all "
                            "numbers with a decimal point, or all with a decimal comma, and none with separators of "
                            "thousands"
                        )
        return dict(zip(places, table, strict=True))

    def texts(self, place: int) -> list[str]:
        """Return the entries of a column as texts; empty where a line ends before it."""
        lines = [_entries(line, self.mark) for _, line in self.rows]
        return [line[place].strip() if place < len(line) else "" for line in lines]


def number_row(values: object, what: str) -> NDArray[np.float64]:
    """Return one row of finite numbers; refuse anything else, with the reason."""
    try:
        row = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"the {what} must be a list of numbers") from None
    if row.ndim != 1 or not np.isfinite(row).all():
        raise ModelError(f"the {what} must be one row of finite numbers")
    return row


def parse_csv(content: bytes, example: str, most: int, hint: str = "") -> CsvColumns:
    """Divide the content of a CSV file into its line of names and its rows."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, error.start) + 1
        raise ModelError(
            f"line {place}: it is not UTF-8 text (byte 0x{content[error.start]:02x}); save it as CSV in UTF-8"
        ) from None
    rows: list[tuple[int, str]] = []
    commented = False
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):  # it knows all ends of lines
        if line.lstrip().startswith("#"):
            commented = commented or not rows
        elif line.strip():
            rows.append((number, line.rstrip("\n")))
            if len(rows) > most + 1:  # before the lines take far more memory than the text
                raise ModelError(f"it has more than {most:,} rows{hint and f'; {hint}'}")
    if not rows:
        raise ModelError(f"it is empty; the first line names the columns, as in {example}")
    number, first = rows[0]
    mark = next((mark for mark in "\t;," if mark in first), ",")
    try:
        heads = tuple(head.strip() for head in _entries(first, mark))
    except csv.Error as error:
        raise ModelError(f"line {number}: it is not a line of column names: {error}") from None
    if len(heads) > _MAX_COLUMNS:
        raise ModelError(f"line {number}: it names more than {_MAX_COLUMNS:,} columns; leave out those not needed")
    if all(_is_number(head, mark) for head in heads):
        skipped = "; a line that begins with # is a comment" if commented else ""
        raise ModelError(f"its first line holds numbers; it must name the columns, as in {example}{skipped}")
    return CsvColumns(heads, mark, tuple(rows[1:]))


def _entries(line: str, mark: str, *, strict: bool = False) -> list[str]:
    """Divide a line, at most into one entry more than there may be columns."""
    if '"' in line:
        return next(csv.reader([line], delimiter=mark, strict=strict))[: _MAX_COLUMNS + 1]
    return line.split(mark, _MAX_COLUMNS)


def _number(entry: str, mark: str) -> float:
    """Return a number with a decimal point, or with a decimal comma where commas do not separate the entries."""
    if "_" in entry:  # which Python would read
        raise ValueError
    if mark != "," and entry.count(",") == 1 and "." not in entry:
        entry = entry.replace(",", ".")
    return float(entry)


def _is_number(entry: str, mark: str) -> bool:
    try:
        _number(entry, mark)
    except ValueError:
        return False
    return True


def _complaint(name: str, entry: str, mark: str) -> str:
    if not entry:
        return f"{name} is missing; every line must have as many entries as the first"
    hint = ""
    if mark != "," and "," in entry:
        hint = ", without separators of thousands"
    elif entry.count(",") == 1:
        hint = "; with decimal commas, separate the columns by semicolons"
    return f"{name} is {entry[:_QUOTED]!r}; it must be a number{hint}"


MAX_BYTES = 10_000_000
"""Largest size of a file."""
MAX_ROWS = 100_000
"""Largest number of rows of a table."""

_PIECE = 1 << 20
_NO_UNIT = ("", "-", "1")
_LISTED = 20  # columns that a message lists


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
    shown = [head.text for head in heads if head.text][:_LISTED]
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
        several = " and ".join(repr(heads[place].text) for place in found[:_LISTED])
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


# Files that a model file names: where they may be, and how they are read.


def path_of(name: str, source: Source) -> str:
    """Return the path of a file that a model file names; raise a ValueError if the source is not allowed to read it."""
    path = os.path.join(os.path.dirname(source.name), name)
    if source.within:
        inside = os.path.realpath(source.within)
        if os.path.commonpath((os.path.realpath(path), inside)) != inside:
            raise ValueError(f"which lies outside of the folder {os.path.basename(inside)}; put the file into it")
    return path


def read_named(name: str, source: Source) -> NamedFile:
    """Read a file that a model file names."""
    try:
        with open_file(path_of(name, source)) as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ValueError(f"which cannot be read: {error.strerror or error}") from None
    if len(content) > MAX_BYTES:
        raise ValueError(f"which is larger than {MAX_BYTES // 1_000_000} MB; leave out rows")
    return NamedFile(name, content)


# A value over the speed, from a table: a smooth curve through its points, and no value outside of them.

MAX_POINTS = 1000
"""Largest number of points of a table."""

_ROUNDING = 1e-9  # of the range: a speed so close to an end of it, as after a conversion of units, is within


@dataclass(frozen=True)
class SpeedTable:
    """A value over the speed: a cubic through points, which rises and falls only where they do.

    The slopes at the points are those of Fritsch and Butland (1984), as in `scipy.interpolate.PchipInterpolator`. The
    derivative is continuous. A complex speed is evaluated by the piece in which its real part is, so that derivatives
    by complex steps are exact.

    Raises
    ------
    ModelError
        If there are not 2 to 1,000 points with speeds that increase.
    """

    speeds: tuple[float, ...]  #: shape (points,): Increasing.
    values: tuple[float, ...]  #: shape (points,): The value at each.
    name: str = "over the speed"  #: Name of the table in messages.
    unit: str = ""  #: The unit of the speeds in messages; empty for plain numbers.

    def __post_init__(self) -> None:
        speeds, values = _row(self.speeds, "speeds"), _row(self.values, "values")
        problem = _problem(speeds, values)
        if problem:
            raise ModelError(f"the table {self.name}: {problem}")
        object.__setattr__(self, "speeds", speeds)
        object.__setattr__(self, "values", values)

    def covers(self, speed: ArrayLike) -> bool:
        """Return True if all speeds are within the table."""
        x = np.real(np.asarray(speed))
        slack = _ROUNDING * (self.speeds[-1] - self.speeds[0])
        return bool(np.all((x >= self.speeds[0] - slack) & (x <= self.speeds[-1] + slack)))

    def value(self, speed: ArrayLike, *, continued: bool = False) -> Any:
        """Return the value at some speeds, of their shape; real, or complex for derivatives.

        Parameters
        ----------
        speed
            The speeds.
        continued
            True to continue the first and the last piece beyond the table.

        Returns
        -------
        array
            Values, of the shape of the speeds.
        """
        (cubic, quadratic, slope, value), d = self._piece(speed, continued)
        return (value + d * (slope + d * (quadratic + d * cubic)))[()]

    def slope(self, speed: ArrayLike) -> Any:
        """Return the derivative of the value by the speed; errors as of `value`.

        Parameters
        ----------
        speed
            Speeds of any shape, within the table.

        Returns
        -------
        array
            Slopes, of the same shape.
        """
        (cubic, quadratic, slope, _), d = self._piece(speed)
        return (slope + d * (2.0 * quadratic + d * (3.0 * cubic)))[()]

    def _piece(self, speed: ArrayLike, continued: bool = False) -> tuple[NDArray[np.float64], Any]:
        """Return the coefficients of the cubic at each speed, and the distance from its beginning."""
        x = np.asarray(speed)
        if not continued and not self.covers(x):
            low, high = np.min(np.real(x)), np.max(np.real(x))
            wrong = low if low < self.speeds[0] or np.isnan(low) else high
            unit = f" {self.unit}" if self.unit else ""
            raise ModelError(
                f"the table {self.name} covers {self.speeds[0]:g} to {self.speeds[-1]:g}{unit}; it has no value at "
                f"{wrong:.6g}{unit}. Extend the table, or stay within it"
            )
        places, coefficients = self._pieces
        piece = np.clip(np.searchsorted(places, np.real(x), side="right") - 1, 0, len(places) - 2)
        return coefficients[:, piece], x - places[piece]

    @cached_property
    def _pieces(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        from scipy.interpolate import PchipInterpolator  # only where tables are used

        return np.array(self.speeds), PchipInterpolator(self.speeds, self.values).c


def speed_table(speed: ArrayLike, value: ArrayLike, name: str = "over the speed", unit: str = "") -> SpeedTable:
    """Make a table of measured points, in any order.

    Parameters
    ----------
    speed, value : shape (points,)
        The points; each speed occurs once.
    name, unit
        See `SpeedTable`.

    Returns
    -------
    SpeedTable
        The table, by increasing speed.

    Raises
    ------
    ModelError
        As `SpeedTable`.

    Examples
    --------
    >>> float(gw.loads.speed_table([3000.0, 1000.0], [40.0, 30.0], unit="rpm").value(2000.0))
    35.0
    """
    speeds, values = _row(speed, "speeds"), _row(value, "values")
    if len(speeds) != len(values):
        return SpeedTable(speeds, values, name, unit)
    pairs = sorted(zip(speeds, values, strict=True))
    return SpeedTable(tuple(a for a, _ in pairs), tuple(b for _, b in pairs), name, unit)


def _row(numbers: ArrayLike, what: str) -> tuple[float, ...]:
    try:
        row = np.array(numbers, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"the {what} of a table must be a list of numbers") from None
    if row.ndim != 1:
        raise ModelError(f"the {what} of a table must be one row of numbers")
    return tuple(row.tolist())


def _problem(speeds: Sequence[float], values: Sequence[float]) -> str:
    if len(speeds) != len(values):
        return f"there are {len(speeds)} speeds, but {len(values)} values; a point has one of each"
    if not 2 <= len(speeds) <= MAX_POINTS:
        return f"there are {len(speeds)} points; a table has 2 to {MAX_POINTS:,}"
    if not np.isfinite([*speeds, *values]).all() or max(map(abs, (*speeds, *values))) > 1e100:
        return "its numbers must be finite, and below 1e100"
    for low, high in pairwise(speeds):
        if not low < high:
            return f"the speed {high:g} follows {low:g}; speeds must increase, and each must occur once: give a mean"
    if min(np.diff(speeds)) < 1e-9 * (speeds[-1] - speeds[0]):
        return "some speeds are nearly equal; give their mean"
    return ""
