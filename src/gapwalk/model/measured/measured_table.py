"""A measured table from a file of any format, whose columns are found by their quantity or by their name.

In a CSV file the line of names has the units: ``deflection (deg), torque (N m)``, or ``deflection [deg]; torque [Nm]``.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import (
    MAX_ROWS,
    ChannelFile,
    ColumnHead,
    NamedFile,
    named_file,
    open_channels,
    spelled,
)
from gapwalk.model.model_source import Source
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import Quantity, QuantityKind, Unit, read_unit


def number_row(values: object, what: str) -> NDArray[np.float64]:
    """Return one row of numbers; refuse anything else, with the reason."""
    try:
        row = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"{what} must be a list of numbers") from None
    if row.ndim != 1:
        raise ModelError(f"{what} has the shape {row.shape}; it must be one row of numbers")
    return row


def finite_row(values: object, what: str) -> NDArray[np.float64]:
    """Return one row of finite numbers; refuse anything else, with the reason."""
    row = number_row(values, f"the row of {what}")
    if not np.isfinite(row).all():
        raise ModelError(f"the {what} must be one row of finite numbers")
    return row


_LISTED = 20  # columns that a message lists


@dataclass(frozen=True, slots=True)
class WantedColumn:
    """A column that a table must have."""

    role: str  #: What it is for, such as ``"deflection"``; also the first name by which it is looked for.
    kind: QuantityKind | None  #: Its kind of quantity. None if it must have no unit, since the model has none.
    #: Other names by which it is looked for, such as ``("angle",)``; capital letters make no difference.
    others: tuple[str, ...] = ()
    #: Its name in the file, if the user gave it: then it is not looked for. It may have the unit, ``"M (N m)"``, which
    #: a file may lack, and the group of the channel, ``"bench/M"``.
    name: str = ""
    key: str = ""  #: The key with which the user gives that name, for messages.
    any_unit: bool = False  #: True if its unit does not matter, as that of a square wave.

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
    where: Callable[[int], str]  #: Says where a row stands in the file, as in ``line 5``.

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())).numbers)

    def __getitem__(self, role: str) -> MeasuredColumn:
        return self.columns[role]


def read_table(
    source: str | os.PathLike[str] | io.StringIO | NamedFile, wanted: Sequence[WantedColumn], *, most: int = MAX_ROWS
) -> MeasuredTable:
    """Read the wanted columns of a file of any format, or of a text: finite numbers, at most so many of a channel.

    A column without a given name is found by its unit, if it is the only one with a unit of its kind, or by its role or
    one of its other names.
    """
    source, name = _source_of(source)
    with named_errors(name), open_channels(source, ", ".join(each.head for each in wanted)) as file:
        return MeasuredTable(name, _columns(file, wanted, most), file.where)


def read_heads(source: NamedFile | str | os.PathLike[str] | io.StringIO) -> list[ColumnHead]:
    """Read the names of the columns of a file, each divided into a name and a unit; errors as of `read_table`."""
    source, name = _source_of(source)
    with named_errors(name), open_channels(source, "angle (deg), torque (N m)", names_only=True) as file:
        return list(file.heads)


@contextmanager
def named_errors(name: str) -> Iterator[None]:
    """Put the name of a file in front of what is wrong with it; codes in place of what would control the terminal."""
    try:
        yield
    except ModelError as error:
        text = "".join(char if char.isprintable() else repr(char)[1:-1] for char in str(error))
        raise ModelError(text if text.startswith(f"{name}: ") else f"{name}: {text}") from None


def _source_of(
    source: str | os.PathLike[str] | io.StringIO | NamedFile,
) -> tuple[NamedFile | str | os.PathLike[str], str]:
    """Return a file or a text as something to open, and its name in messages."""
    if isinstance(source, io.StringIO):
        return NamedFile("the table", source.getvalue().encode("utf-8", "replace")), "the table"
    return source, source.name if isinstance(source, NamedFile) else os.path.basename(os.fspath(source))


def _columns(file: ChannelFile, wanted: Sequence[WantedColumn], most: int) -> dict[str, MeasuredColumn]:
    places = _places(file.heads, wanted)
    heads = {role: file.heads[place] for role, place in places.items()}
    units = {each.role: _unit(heads[each.role], each) for each in wanted}  # before any number is read
    labels = {role: head.name or role for role, head in heads.items()}
    if len({*labels.values()}) < len(labels):  # two columns of one name
        labels = {role: role for role in heads}
    numbers = file.numbers({labels[each.role]: places[each.role] for each in wanted}, most)
    for label, column in numbers.items():
        wrong = np.flatnonzero(~np.isfinite(column))
        if len(wrong):
            more = f" ({len(wrong)} such entries)" if len(wrong) > 1 else ""
            do = "leave out its line" if file.row == "line" else "cut the record there, or correct it"
            raise ModelError(f"{file.where(int(wrong[0]))}: {label} is not a finite number{more}; {do}")
        column.flags.writeable = False
    return {
        r: MeasuredColumn(heads[r].text, numbers[labels[r]], units[r], units[r] and each.kind)
        for r, each in ((each.role, each) for each in wanted)
    }


def _places(heads: Sequence[ColumnHead], wanted: Sequence[WantedColumn]) -> dict[str, int]:
    """Return where the wanted columns are: together in one group of channels, if there is one that has all of them."""
    everywhere = range(len(heads))
    groups = dict.fromkeys(head.group for head in heads)
    fits: dict[str, dict[str, int] | _AmbiguousError] = {}
    for group in groups if len(groups) > 1 else ():
        try:
            fits[group] = _found(heads, wanted, [place for place in everywhere if heads[place].group == group])
        except _AmbiguousError as error:
            fits[group] = error
        except ModelError:
            continue
    if len(fits) > 1:
        asked = next((each for each in reversed(wanted) if not each.name), wanted[-1])
        found = [place for place in everywhere if heads[place].group in fits]
        names = [f"{heads[k].group}/{heads[k].name}" for k in _sought(heads, asked, found)][:_LISTED]
        write = f'; name one: {asked.key} = "{names[0]}"' if asked.key else "; leave the others out of the file"
        raise ModelError(f"{len(names)} channels may be {asked.role}: {', '.join(map(repr, names))}{write}")
    for held in fits.values():
        if isinstance(held, ModelError):
            raise held
        return held
    if len(groups) < 2 or not any(head.is_time for head in heads):
        return _found(heads, wanted, everywhere)
    others = [place for place in everywhere if not heads[place].is_time]  # each group has a time: that of the finest
    clocks = [each for each in wanted if each.role == "time" and not each.name]
    found = _found(heads, [each for each in wanted if each not in clocks], others)
    finest = heads[max(found.values(), key=lambda place: heads[place].count)].group
    return found | _found(heads, clocks, [place for place in everywhere if heads[place].group == finest])


class _AmbiguousError(ModelError):
    """Several columns may be the wanted one."""


def _found(heads: Sequence[ColumnHead], wanted: Sequence[WantedColumn], among: Sequence[int]) -> dict[str, int]:
    places: dict[str, int] = {}
    for each in (*(each for each in wanted if each.name), *(each for each in wanted if not each.name)):
        places[each.role] = _place(heads, each, {*places.values()}, among)
    return places


def _place(heads: Sequence[ColumnHead], wanted: WantedColumn, taken: set[int], among: Sequence[int]) -> int:
    """Return the index of a wanted column."""
    shown = list(dict.fromkeys(heads[place].text for place in among if heads[place].text))[:_LISTED]
    write = f'. Name it: {wanted.key} = "..."' if wanted.key else f". Name it {wanted.head}"
    if wanted.name:
        own = ColumnHead.of(wanted.name).name
        found = _named(heads, (wanted.name,), among) or (_named(heads, (own,), among) if own else [])
        if not found:
            raise ModelError(
                f"there is no column {wanted.name!r} for {wanted.role}; "
                f"{did_you_mean(wanted.name, shown, 'columns are')}"
            )
    else:
        found = _sought(heads, wanted, [place for place in among if place not in taken])
        if not found:
            unit = f" with the unit of {wanted.kind.words}" if wanted.kind else ""
            raise ModelError(
                f"there is no column {wanted.role!r}{unit}; {did_you_mean(wanted.role, shown, 'columns are')}{write}"
            )
    if len(found) > 1:
        grouped = len({heads[place].group for place in found}) > 1
        texts = [f"{heads[place].group}/" * grouped + heads[place].text for place in found[:_LISTED]]
        several = " and ".join(map(repr, texts))
        raise _AmbiguousError(f"{len(found)} columns may be {wanted.role}: {several}{write}")
    if found[0] in taken:
        raise ModelError(f"the column {heads[found[0]].text!r} cannot be {wanted.role} and something else{write}")
    return found[0]


def _sought(heads: Sequence[ColumnHead], wanted: WantedColumn, free: Sequence[int]) -> list[int]:
    """Return the indices of the columns that may be meant: those of the right name among those of the right unit."""
    names = (wanted.role, *wanted.others)
    if wanted.kind is not None:
        of_kind = [place for place in free if heads[place].is_of(wanted.kind)]
        for name in names:
            if by_name := _named(heads, (name,), of_kind):
                return by_name
        if of_kind:
            return of_kind
    for name in names:  # a column of this name has no unit, or a wrong one, which is said then
        if by_name := _named(heads, (name,), free):
            return by_name
    return []


def _named(heads: Sequence[ColumnHead], names: Sequence[str], among: Sequence[int]) -> list[int]:
    """Return the indices of the columns of a name: as written, with its group, or in other letters or without unit."""
    ways = (*_WRITTEN, lambda head: head.name.casefold())
    return first_found(heads, ways, [*names, *(each.casefold() for each in names)], among)


_WRITTEN: tuple[Callable[[ColumnHead], str], ...] = (
    lambda head: head.text,
    lambda head: f"{head.group}/{head.name}" if head.group else head.name,
    lambda head: head.name,
)


def first_found(
    heads: Sequence[ColumnHead], ways: Iterable[Callable[[ColumnHead], str]], names: Sequence[str], among: Sequence[int]
) -> list[int]:
    """Return the indices of the columns that have one of some names by the first way that finds any."""
    found = ([place for place in among if way(heads[place]) in names] for way in ways)
    return next(filter(None, found), [])


def as_written(file: ChannelFile, name: str) -> list[int]:
    """Return the channels of a name as it is written, with the group before it, or without its unit."""
    return first_found(file.heads, _WRITTEN, [name], range(len(file.heads)))


def _unit(head: ColumnHead, wanted: WantedColumn) -> Unit | None:
    written = ColumnHead.of(wanted.name)
    own = written.unit if wanted.name != head.name else ""
    if wanted.any_unit:
        return None
    if wanted.kind is None:
        if head.unit:
            raise ModelError(
                f"the column {head.text!r} has the unit {head.unit}, but this model has no units; convert its numbers "
                f"to those of the model, and name it {head.name or wanted.role}"
            )
        return None
    if not head.unit and not own:
        here = f', or {wanted.key} = "{head.name} ({wanted.kind.usual[0]})"' if wanted.key else ""
        raise ModelError(
            f"the column {head.text!r} has no unit; write {wanted.kind.words} as in "
            f"{head.name or wanted.role} ({wanted.kind.usual[0]}){here}"
        )
    try:
        found = read_unit(spelled(head.unit or own), wanted.kind)
        said = read_unit(spelled(own or head.unit), wanted.kind)
    except ValueError as error:
        raise ModelError(
            f"the column {head.text!r}: {error}; {wanted.kind.words} is expected, as in "
            f"{head.name or wanted.role} ({wanted.kind.usual[0]})"
        ) from None
    if found.factor != said.factor:
        raise ModelError(
            f"the column {head.text!r} has the unit {head.unit} in the file, but {wanted.key} = {wanted.name!r} says "
            f'{own}; write {wanted.key} = "{written.name}", or correct the file'
        )
    return found


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
        return named_file(name, path_of(name, source))
    except ModelError as error:
        raise ValueError(f"but {error}") from None
    except ValueError as error:
        raise ValueError(f"which {error}") from None


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
        """Return the value at some speeds, real or complex; `continued`: by the outer pieces beyond the table."""
        (cubic, quadratic, slope, value), d = self._piece(speed, continued)
        return (value + d * (slope + d * (quadratic + d * cubic)))[()]

    def slope(self, speed: ArrayLike) -> Any:
        """Return the derivative of the value by the speed."""
        (cubic, quadratic, slope, _), d = self._piece(speed)
        return (slope + d * (2.0 * quadratic + d * (3.0 * cubic)))[()]

    @cached_property
    def _pieces(self) -> Pieces:
        return monotone(self.speeds, self.values)

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
        return piece_at(self._pieces, x)


Pieces = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Speeds, and the coefficients of cubics between them, the highest first."""


def monotone(speeds: Sequence[float], values: ArrayLike) -> Pieces:
    """Return the monotone cubics through points, whose values may be rows."""
    from scipy.interpolate import PchipInterpolator  # only where tables are used

    return np.array(speeds), PchipInterpolator(speeds, values).c


def piece_at(pieces: Pieces, speed: Any) -> tuple[NDArray[np.float64], Any]:
    """Return the coefficients of the cubic at each speed, and the distance from its beginning."""
    places, coefficients = pieces
    piece = np.clip(np.searchsorted(places, np.real(speed), side="right") - 1, 0, len(places) - 2)
    return coefficients[:, piece], speed - places[piece]


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
    return tuple(number_row(numbers, f"the row of {what} of a table").tolist())


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
