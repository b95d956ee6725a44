"""Columns of records that are more than their fields: systems, their structures, orbits."""

# ruff: noqa: D102 (the methods of columns are described in gapwalk.results.codec.Column)

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.special_point_kind import KINDS, Kind
from gapwalk.model.drivetrain.train_assembly import TrainAssembly, structure_of
from gapwalk.model.laws import FORMULAS, LAWS, Law
from gapwalk.model.laws.law import data_of
from gapwalk.model.loads import LOADS, Load, LoadForm
from gapwalk.model.registry import Registry
from gapwalk.model.structure import ContactForm, Structure
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.balance import BalancedOrbit
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.arrays import Node, Reader, Writer
from gapwalk.results.codec import Column, Converted, MisfitError, OneOf, Record, column_of, register

MANY = 10_000
"""Parameters beyond which zeros of vectors and matrices are not written."""

_COORDINATES = 5_000  # at most, in a file


class PlainStructure(NamedTuple):
    """Parts of a structure without an assembly."""

    coordinates: tuple[str, ...]
    contacts: tuple[ContactForm, ...]
    harmonics: tuple[LoadForm, ...]


class WholeSystem(NamedTuple):
    """Structure of a system, and its parameters by name."""

    structure: Structure
    parameters: Mapping[str, float]


class Systems(Column):
    """Systems of one structure, stored by the parameters in which they differ from a base system.

    If there is no base, or it has another structure, the first of them is written completely and is the base.
    """

    tag = "System"

    def fits(self, value: Any) -> bool:
        return isinstance(value, System)

    def put(self, values: Sequence[Any], writer: Writer) -> Node:
        for value in values:
            if value.structure is not values[0].structure and value.structure != values[0].structure:
                raise MisfitError(f"{value!r:.60} cannot be kept beside systems of another structure")
        base, whole = writer.base, None
        if values and (base is None or base.structure != values[0].structure):
            base = values[0]
            whole = column_of(WholeSystem).write([WholeSystem(base.structure, parameters_of(base))], writer)
        changes = _changes(values, base) if values else []
        places = sorted({place for each in changes for place in each})
        rows = [[change.get(place, base.values[place]) for place in places] for change in changes]
        numbers = np.array(rows, dtype=float).reshape(len(values), len(places))
        names = [base.structure.names[place] for place in places]
        return {"base": whole, "names": names, "values": writer.put(numbers, "f8")}

    def read(self, node: Node, count: int, reader: Reader) -> list[Any]:
        base: Any = reader.base
        names = node["names"]
        if node["base"] is not None:
            (whole,) = column_of(WholeSystem).read(node["base"], 1, reader)
            base = system_of(whole)
        numbers = reader.take(node["values"], "f8")
        if numbers.shape != (count, len(names)) or not np.isfinite(numbers).all():
            raise ValueError("the parameters of some systems are missing")
        if base is None:
            if count:
                raise ValueError("there is no system from which others differ")
            return []
        places = [base.structure.place(name) for name in names]
        return [_changed(base, places, row) for row in numbers.tolist()]


def parameters_of(system: System) -> dict[str, float]:
    """Return the parameters by name; of very many, zeros in vectors and matrices are left out."""
    if len(system.parameters) <= MANY:
        return dict(system.parameters)
    names, values = system.structure.names, system.values
    places = {*np.flatnonzero(_bits(values)).tolist(), *names.single}
    return {names[place]: float(values[place]) for place in sorted(places)}


def system_of(whole: WholeSystem) -> System:
    """Return the system; raise a ValueError (such as a ModelError) if the stored values do not describe one."""
    structure, parameters = whole
    if len(structure.coordinates) > min(_COORDINATES, len(parameters)):  # before room is made for their matrices
        raise ValueError("a system has more parameters than are given")
    names = structure.names
    places = [names.place(name) for name in parameters]
    values = np.zeros(len(names))
    values[places] = list(parameters.values())
    if not set(range(len(names)) if len(names) <= MANY else names.single) <= set(places):
        raise ValueError("the parameters are not those of the system")
    return System.from_values(structure, values).at()  # `at` refuses values that no system can have


def _changes(systems: Sequence[System], base: System) -> list[dict[int, float]]:
    """Return the parameters, by place, in which each system differs from the base; zeros may differ in their signs."""
    shared: dict[int, dict[int, float]] = {}
    changes = []
    for system in systems:
        values, own = system.shared
        if id(values) not in shared:
            places = np.flatnonzero(_bits(values) != _bits(base.values)).tolist()
            shared[id(values)] = {place: float(values[place]) for place in places}
        changes.append(shared[id(values)] | own)
    return changes


def _changed(base: System, places: Sequence[int], values: Sequence[float]) -> System:
    if not places:
        return base
    if len(places) == 1:
        return System.beside(base, places[0], values[0])
    changed = base.values.copy()
    changed[list(places)] = values
    return System.from_values(base.structure, changed)


def _bits(values: NDArray[np.float64]) -> NDArray[np.int64]:
    return values.view(np.int64)


def _plain_structure(structure: Structure) -> Any:
    if structure.assembly is not None:
        return structure.assembly
    return PlainStructure(structure.coordinates, structure.contacts, structure.harmonics)


def _structure_of(plain: Any) -> Structure:
    structure = structure_of(plain) if isinstance(plain, TrainAssembly) else Structure(*plain)
    for each in (structure, structure.equations):
        prefixes = [block.prefix for block in each.names.blocks]
        words = [*each.coordinates, *(word for prefix in prefixes for word in prefix.split("."))]
        if not all(word.isidentifier() for word in words) or len(set(prefixes)) < len(prefixes):
            raise ValueError("a part of the system has no name, or the name of another part")
        if len(set(each.coordinates)) < len(each.coordinates):
            raise ValueError("two coordinates have one name")
    return structure


def _options_of(name: str) -> Column:
    """Return the column of the options of a method, by its name."""
    return column_of(Method.named(name))


@cache
def _orbits_of(name: str) -> Column:
    """Return the column of orbits of a class, by its name: those of a method may have more fields than others."""
    return Record({kind.__name__: kind for kind in (Orbit, BalancedOrbit, *Orbit.__subclasses__())}[name])


class Registered(Converted):
    """Members of a registry, by their names; an unregistered object is refused, because it could not be read again."""

    def __init__(self, registry: Registry[Any], name_of: Callable[[Any], str]) -> None:
        super().__init__(object, str, name_of, registry.named)
        self.tag, self._registry = f"a {registry.words} that is registered", registry

    def fits(self, value: Any) -> bool:
        return value in self._registry.values()


register(Kind, Registered(KINDS, str))


class PlainLaw(NamedTuple):
    """Name of a force law, and its data as JSON; none if it is registered under that name."""

    name: str
    data: str


class PlainLoad(NamedTuple):
    """Parts of the form of a load, with its constants as JSON."""

    name: str
    order: int
    kind: type[Load]
    constants: str
    varies: tuple[tuple[str, float], ...]


class Laws(Converted):
    """Force laws by their names, with the data of those that have some; one that could not be read is refused."""

    def __init__(self) -> None:
        super().__init__(Law, PlainLaw, _plain_law, _law_of)
        self.tag = f"a {LAWS.words} that is registered"

    def fits(self, value: Any) -> bool:
        return value in LAWS.values() or type(value) in FORMULAS.values()


def _plain_law(law: Law) -> PlainLaw:
    return PlainLaw(law.name, _json(data_of(law)) if type(law) in FORMULAS.values() else "")


def _law_of(plain: PlainLaw) -> Law:
    if not plain.data:
        return LAWS.named(plain.name)
    return FORMULAS.named(plain.name)(**_from_json(plain.data))


def _plain_load(form: LoadForm) -> PlainLoad:
    return PlainLoad(form.name, form.order, form.kind, _json(dict(form.constants)), form.varies)


def _load_of(plain: PlainLoad) -> LoadForm:
    return LoadForm(*plain[:3], tuple(_from_json(plain.constants).items()), plain.varies)


def _json(data: Mapping[str, Any]) -> str:
    return json.dumps(data, allow_nan=False)


def _from_json(text: str) -> dict[str, Any]:
    """Read data of texts, numbers and tuples; raise a ValueError for anything else."""

    def tuples(value: Any) -> Any:
        if isinstance(value, dict):
            raise ValueError("the data of a force law or a load are not plain")
        return tuple(map(tuples, value)) if isinstance(value, list) else value

    data = json.loads(text)
    if not isinstance(data, dict):
        raise ValueError("the data of a force law or a load are no table")
    return {name: tuples(value) for name, value in data.items()}


register(Fraction, Converted(Fraction, str, str, Fraction))
register(Law, Laws())
register(LoadForm, Converted(LoadForm, PlainLoad, _plain_load, _load_of))
register(type[Load], Registered(LOADS, lambda kind: kind.key))
register(System, Systems())
register(Structure, Converted(Structure, TrainAssembly | PlainStructure, _plain_structure, _structure_of))
register(Method, OneOf(lambda value: value.name if isinstance(value, Method) else None, _options_of))
register(Orbit, OneOf(lambda value: type(value).__name__ if isinstance(value, Orbit) else None, _orbits_of))
