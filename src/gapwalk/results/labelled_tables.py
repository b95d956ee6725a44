"""Tables of records as typed columns with units, and as labelled arrays over the axes that they have.

Spreadsheets and data frames hold the columns as they are. Files of arrays (netCDF, MAT) and xarray hold them as grids:
a map over a plane is an array over both of its parameters, and columns that differ by a coordinate, a contact, a state
or an order alone are one array over it. No number is changed on the way.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.motion import signal_names
from gapwalk.model.measures import parsed
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.results.codec import parameters_of
from gapwalk.results.result_file import versions
from gapwalk.summary import Described, TableRows

if TYPE_CHECKING:
    import xarray

_NUMBERED = re.compile(r"(?P<family>modulus|argument)\.multiplier(?P<number>\d+)")
_ORDER = re.compile(r"order (?P<number>[-+.\de]+)")
_STATE = re.compile(r"(?P<state>.+)\(0\)")
_ANGLE_AND_TIME = {"theta": "rad", "time": "s"}


@dataclass(frozen=True, eq=False)
class TypedColumn:
    """A column of a table."""

    heading: str  #: Its heading, without the unit.
    unit: str  #: Its unit; empty for a plain number, a text, and in a system without units.
    values: tuple[Any, ...]  #: Its values, all of one type: bool, int, float or str; None where there is none.

    @property
    def head(self) -> str:
        """The heading with the unit, as in ``speed [rpm]``."""
        return f"{self.heading} [{self.unit}]" if self.unit else self.heading

    @property
    def type(self) -> type[bool | int | float | str]:
        """Type of its values; float if there are none."""
        return next((type(value) for value in self.values if value is not None), float)

    @cached_property
    def array(self) -> NDArray[Any]:
        """Its values, shape (rows,); missing numbers are nan, and missing texts are empty."""
        missing = any(value is None for value in self.values)
        if self.type is str:
            return np.array(["" if value is None else value for value in self.values], dtype=object)
        kind = float if missing else self.type
        return np.array([math.nan if value is None else value for value in self.values], dtype=kind)


@dataclass(frozen=True, eq=False)
class Labelled:
    """An array with named dimensions."""

    dims: tuple[str, ...]  #: Names of its dimensions.
    values: NDArray[Any]  #: The array.
    unit: str = ""  #: Its unit; empty if it has none.


@dataclass(frozen=True, eq=False)
class LabelledTable:
    """A table as arrays over the axes that it has."""

    #: The labels: axes, names of branches, parameters; those named as a dimension are its index.
    coordinates: Mapping[str, Labelled]
    variables: Mapping[str, Labelled]  #: The other columns.


def columns_of(record: Described, name: str) -> tuple[TypedColumn, ...]:
    """Return the columns of one of the tables of a record, with units if its system has some."""
    table = record.tables()[name]
    rows = list(table())
    headings = [str(heading) for heading in rows[0]]
    units = _units_of(record, table, headings)
    cells = zip(*rows[1:], strict=True) if len(rows) > 1 else [()] * len(headings)
    return tuple(
        TypedColumn(distinct, units(heading), _typed(values))
        for distinct, heading, values in zip(_distinct(headings), headings, cells, strict=True)
    )


def labelled_tables(record: Described) -> dict[str, LabelledTable]:
    """Return the tables of a record as arrays, by the names of the tables."""
    tables = record.tables()
    return {name: _labelled(record, name, table) for name, table in tables.items()}


def to_xarray(record: Described) -> xarray.DataTree:
    """Return the tables of a record as labelled arrays; see `gapwalk.summary.Described.to_xarray`."""
    xr = needed("xarray", "labelled arrays")

    def dataset(table: LabelledTable) -> xarray.Dataset:
        def arrays(which: Mapping[str, Labelled]) -> dict[str, Any]:
            return {
                name: (each.dims, each.values, {"units": each.unit} if each.unit else {})
                for name, each in which.items()
            }

        return xr.Dataset(arrays(table.variables), arrays(table.coordinates))

    groups = {name: dataset(table) for name, table in labelled_tables(record).items()}
    if (system := _system_of(record)) is not None:
        groups["parameters"] = dataset(parameter_table(system))
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs=attributes_of(record)), **groups})


def attributes_of(record: Described) -> dict[str, str]:
    """Return texts about a record as a whole: its title, its type, and the version that writes it."""
    found = {"title": str(getattr(record, "title", "") or ""), "record": type(record).__name__}
    options = getattr(record, "options", None)
    found["study"] = str(getattr(options, "kind", "") or "")
    found["source"] = f"gapwalk {versions()['gapwalk']}"
    if isinstance(complete := getattr(record, "complete", None), bool):
        found["complete"] = "yes" if complete else "no"
    return {name: text for name, text in found.items() if text}


def parameter_table(system: System) -> LabelledTable:
    """Return the parameters of a system with their values and units, over their names."""
    values = parameters_of(system)
    units = [system.units.parameter(name) if system.units else "" for name in values]
    names = ("parameter",)
    return LabelledTable(
        {"parameter": Labelled(names, np.array([*values], dtype=object))},
        {
            "value": Labelled(names, np.array([*values.values()], dtype=float)),
            "unit": Labelled(names, np.array(units, dtype=object)),
        },
    )


def needed(module: str, what: str) -> Any:
    """Import a module of the extra ``data``."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise
        raise ModelError(f'{what} needs {module}; install it: pip install "gapwalk[data]"') from None


def table_headings(record: Described, name: str, headings: Iterable[object]) -> list[str]:
    """Return the headings of a table with units, as in ``speed [rpm]``; without, if its system has none."""
    # Units are known for parameters, states, and measures and amplitudes of signals.
    texts = [str(heading) for heading in headings]
    units = _units_of(record, record.tables()[name], texts)
    return [TypedColumn(heading, units(heading), ()).head for heading in texts]


def _system_of(record: Described) -> System | None:
    system = getattr(record, "system", None)
    return system if isinstance(system, System) else None


def _units_of(record: Described, table: object, headings: Sequence[str]) -> Callable[[str], str]:
    """Return a function that returns the unit of a column of a table by its heading."""
    system = _system_of(record)
    units = system.units if system is not None else getattr(record, "units", None)
    if not isinstance(units, Units):
        return lambda _: ""
    more = table if isinstance(table, TableRows) else TableRows(lambda: ())
    signals = frozenset(() if system is None else signal_names(system))
    states = frozenset(() if system is None else system.state_names)

    def unit(heading: str) -> str:
        if like := more.units.get(heading) or next((u for h, u in more.units.items() if _begins(heading, h)), ""):
            return units.signal(like)[1] if like.endswith((".force", "'")) else units.parameter(like) or like
        if heading in _ANGLE_AND_TIME:
            return _ANGLE_AND_TIME[heading]
        if more.signal and (heading == more.signal or _ORDER.fullmatch(heading)):
            return units.signal(more.signal)[1]
        if (asked := parsed(heading)) and signals.issuperset(asked.signals) and not _is_mean_load(heading, headings):
            return asked.unit(units)
        kind, _, of = heading.partition(".")
        if kind in ("amplitude", "re", "im") and of in signals:
            return units.signal(of)[1]
        if (state := heading.removesuffix("(0)")) in states:
            return units.state(state)
        name = heading.removeprefix("parameter ")
        return units.parameter(name) if system is None or name in system.structure.names else ""

    return unit


def _begins(heading: str, beginning: str) -> bool:
    return beginning.endswith(".") and heading.startswith(beginning)


def _is_mean_load(heading: str, headings: Sequence[str]) -> bool:
    """Return True if ``mean.q1`` is the parameter: tables with the mean of a motion have its maximum too."""
    kind, _, of = heading.partition(".")
    return kind == "mean" and f"max.{of}" not in headings


def _typed(values: Iterable[object]) -> tuple[Any, ...]:
    """Return the values of a column as values of one type, the narrowest that has them all."""
    plain = [_plain(value) for value in values]
    types = {type(value) for value in plain if value is not None}
    if len(types) < 2:
        return tuple(plain)
    if types == {int, float}:
        return tuple(None if value is None else float(value) for value in plain)
    return tuple(None if value is None else _text(value) for value in plain)


def _plain(value: Any) -> Any:
    """Return a cell as bool, int, float or str; None for an empty one."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, list | tuple):
        value = " ".join(map(str, value))
    if value is None or value == "":
        return None
    for kind in (bool, int, float):  # also of their subclasses; a bool is an int
        if isinstance(value, kind):
            value = kind(value)
            return float(value) if kind is int and abs(value) >= 1 << 63 else value
    return str(value)


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _labelled(record: Described, name: str, table: object) -> LabelledTable:
    columns, system = columns_of(record, name), _system_of(record)
    signal = table.signal if isinstance(table, TableRows) else ""
    count = table.axes if isinstance(table, TableRows) else 0
    axes, dims, shape = _axes(columns[:count], name)
    taken = {each.heading for each in columns}
    families = _families(columns[len(axes) :], system, signal, taken | set(dims))
    labels, variables = dict(axes), {}
    for key, (along, names, members) in families.items():
        arrays = [each.array for each in members]
        if along:
            values = np.stack(arrays, axis=-1).reshape(*shape, len(names))
            labels[along] = Labelled((along,), names)
            variables[key] = Labelled((*dims, along), values, members[0].unit)
        else:
            found = Labelled(dims, arrays[0].reshape(shape), members[0].unit)
            is_label = not axes and key not in dims and " " not in key  # which netCDF cannot mark as a coordinate
            is_label = is_label and _is_label(members[0], system, [*taken])
            (labels if is_label else variables)[key] = found
    return LabelledTable(labels, variables)


def _axes(columns: Sequence[TypedColumn], name: str) -> tuple[dict[str, Labelled], tuple[str, ...], tuple[int, ...]]:
    """Return the axes of a table, its dimensions and their lengths; rows are the only dimension if it is no grid."""
    rows = (name.replace("-", "_"),)
    if not columns:
        return {}, rows, (-1,)
    names, lines = [each.heading for each in columns], [each.array for each in columns]
    ends = [np.array(list(dict.fromkeys(line.tolist()))) for line in lines]
    full = [each.ravel() for each in np.meshgrid(*ends)]  # the first axis runs fastest
    if len(set(names)) < len(names) or not all(map(np.array_equal, lines, full)):
        return {}, rows, (-1,)
    order = range(len(columns))[::-1]
    axes = {names[k]: Labelled((names[k],), ends[k], columns[k].unit) for k in order}
    return axes, tuple(axes), tuple(len(ends[k]) for k in order)


def _distinct(headings: Sequence[str]) -> list[str]:
    """Number headings that occur again."""
    seen: dict[str, int] = {}
    found = []
    for each in headings:
        seen[each] = count = seen.get(each, 0) + 1
        found.append(f"{each}.{count}" if count > 1 else each)
    return found


Family = tuple[str, NDArray[Any], list[TypedColumn]]


def _families(columns: Sequence[TypedColumn], system: System | None, signal: str, taken: set[str]) -> dict[str, Family]:
    """Group the columns that differ by one label; a family has the dimension of its labels, a lone column none."""
    # The families of one dimension must have the same labels, and the columns of a family one unit and type; columns
    # that do not fit remain single.
    headings = [each.heading for each in columns]
    groups: dict[tuple[str, str], dict[Any, TypedColumn]] = {}
    for each in columns:
        if (place := _place(each.heading, system, signal, headings)) is not None:
            family, along, label = place
            groups.setdefault((family, along), {})[label] = each
    labels: dict[str, tuple[Any, ...]] = {}
    joined: dict[str, tuple[str, str]] = {}
    for (family, along), members in groups.items():
        alike = len({(each.unit, each.array.dtype) for each in members.values()}) == 1
        known = labels.setdefault(along, tuple(members)) if alike and along not in taken else ()
        if known == tuple(members) and family not in taken:
            joined |= {each.heading: (family, along) for each in members.values()}
    found: dict[str, Family] = {}
    for each in columns:
        family, along = joined.get(each.heading, (each.heading, ""))
        if family in found and along:
            continue
        members = groups[family, along] if along else {each.heading: each}
        numbers = all(isinstance(label, int | float) for label in members)
        names = np.array([*members]) if numbers else np.array([*members], dtype=object)
        found[family] = along, names, [*members.values()]
    return found


def _place(heading: str, system: System | None, signal: str, headings: Sequence[str]) -> tuple[str, str, Any] | None:
    """Return family, dimension and label of a heading such as ``half.q1``; None of one that has no family."""
    if match := _NUMBERED.fullmatch(heading):
        return match["family"], "multiplier", int(match["number"])
    if signal and (match := _ORDER.fullmatch(heading)):
        return f"amplitude.{signal}", "order", float(match["number"])
    if system is None or heading.startswith("parameter ") or _is_parameter(heading, system, headings):
        return None
    if (match := _STATE.fullmatch(heading)) and match["state"] in system.state_names:
        name = match["state"].removesuffix("'")
        family = "position(0)" if name == match["state"] else "velocity(0)"
        return (family, "coordinate", name) if name in system.coordinates else None
    if heading.startswith("amplitude."):  # of one signal
        return None
    sets = {"coordinate": system.coordinates, "contact": [each.name for each in system.structure.contacts]}
    for along, names in sets.items():
        for name in sorted(names, key=len, reverse=True):
            if heading.endswith(f".{name}") and len(heading) > len(name) + 1:
                return heading.removesuffix(f".{name}"), along, name
    return None


def _is_parameter(heading: str, system: System, headings: Sequence[str]) -> bool:
    name = heading.removeprefix("parameter ")
    is_measure = heading.partition(".")[2] in system.coordinates and not _is_mean_load(heading, headings)
    return name in system.structure.names and not is_measure


def _is_label(column: TypedColumn, system: System | None, headings: Sequence[str]) -> bool:
    """Return True for a column that says which row it is: a text, a parameter, number and period of a branch."""
    parameter = system is not None and _is_parameter(column.heading, system, headings)
    return parameter or column.type is str or column.heading in ("branch", "period")
