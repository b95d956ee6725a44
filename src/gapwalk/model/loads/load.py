"""The protocol of a load, and the registry of all of them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

from gapwalk.errors import ModelError
from gapwalk.model.parameter import Parameter
from gapwalk.model.registry import Registry


class Line(NamedTuple):
    """A part ``cosine * cos(order * W * t) + sine * sin(order * W * t)`` of a load; of order 0 it is constant."""

    order: int
    cosine: Any
    sine: Any = 0.0


class Levels(NamedTuple):
    """A part of a variation with two levels: ``high`` from the angle `up` to `down` in each cycle, otherwise ``low``.

    The angles are those of the excitation, W t; they repeat after ``2 pi / order``.
    """

    low: Any
    high: Any
    up: Any
    down: Any


class Load(ABC):
    """A load that repeats with the excitation, along one vector of coordinates; or a variation of other numbers.

    A kind of load is one class in one file, registered once by `register`: a frozen dataclass with a field for each of
    its parameters, and the four below. All other code iterates over the registry: the tables of model files, names and
    units of parameters, the flow, the batch integrator, harmonic balance, drive trains, documentation.

    Parameters
    ----------
    acts_on
        The vector by coordinate name, for example ``{"q1": 1.0}``; in a drive train by inertia. Empty for a variation.
    order
        Multiple of the fundamental frequency, an integer >= 1.
    name
        Prefix of its parameters' names; by default its key and its order, as in ``harmonic2``.
    varies
        Names of what it varies instead, each with a factor: ``{"mesh.stiffness": 1.0}``. A deflection (or the clearance
        of a contact with one side) varies by the load itself; any other number of a contact or a force becomes that
        number times ``1 + load``.

    Attributes
    ----------
    key
        Its table in a model file, ``[[harmonic]]``.
    words
        Description, in a few words.
    parameters
        Its parameters, in the order of its fields. Any further fields are constants.

    Notes
    -----
    `lines` is the only place of the formula; the frequency may enter it. All derivatives, by the frequency
    too, are taken of it by a complex step.

    Examples
    --------
    An unbalance, whose force grows with the square of the frequency::

        @dataclass(frozen=True)
        class Unbalance(Load):
            key, words = "unbalance", "the force of an unbalance"
            parameters = (Parameter("moment", None, "it is the mass times its distance from the axis"),)
            moment: float
            acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
            order: int = 1
            name: str = ""
            varies: Mapping[str, float] = field(default_factory=dict, hash=False)

            @classmethod
            def lines(cls, order, frequency, numbers):
                yield Line(order, numbers["moment"] * (order * frequency) * (order * frequency))


        register(Unbalance)
    """

    key: ClassVar[str]
    words: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    has_levels: ClassVar[bool] = False
    frequencies: ClassVar[tuple[str, ...]] = ()
    """Names of further fields that are frequencies W; in a drive train with units they are texts."""

    __dataclass_fields__: ClassVar[dict[str, Any]]  # every kind is a dataclass
    acts_on: Mapping[str, float]
    order: int
    name: str
    varies: Mapping[str, float] = MappingProxyType({})  # a kind without such a field varies nothing

    def __post_init__(self) -> None:
        check_order(self.order)
        if not self.name:
            object.__setattr__(self, "name", f"{self.key}{int(self.order)}")
        object.__setattr__(self, "order", int(self.order))
        if isinstance(self.varies, str):
            object.__setattr__(self, "varies", {self.varies: 1.0})
        if bool(self.acts_on) is bool(self.varies):
            both = "both acts_on and varies" if self.varies else "neither acts_on nor varies"
            raise ModelError(
                f'{self.name} has {both}; write acts_on = {{ q1 = 1.0 }} for a force, or varies = "mesh.stiffness"'
            )
        if self.has_levels and self.acts_on:
            raise ModelError(f"{self.name} is {self.words}: it varies a number of a contact or a force, and is no load")

    @classmethod
    @abstractmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give the load in parts of one order each.

        Parameters
        ----------
        order
            Order of the load.
        frequency
            The frequency W of the excitation: real or complex, or an array.
        numbers
            Its parameters by name, of the same kinds, and its constants.
        """

    @classmethod
    def levels(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Levels:
        """Give the two levels of a variation that jumps (``has_levels = True``); parameters as in `lines`."""
        raise NotImplementedError

    def values(self) -> Iterator[float]:
        """Iterate over the values of its parameters."""
        yield from (getattr(self, each.name) for each in self.parameters)

    def constants(self) -> tuple[tuple[str, Any], ...]:
        """Return its further fields with their values."""
        known = {"acts_on", "order", "name", "varies", *(each.name for each in self.parameters)}
        return tuple((each.name, getattr(self, each.name)) for each in fields(self) if each.name not in known)


@dataclass(frozen=True, slots=True)
class LoadForm:
    """A load without its numbers: its name, its order, its kind, its constants, and what it varies, with factors."""

    name: str
    order: int
    kind: type[Load]
    constants: tuple[tuple[str, Any], ...] = ()
    varies: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, load: Load) -> LoadForm:
        """Make the form of a load."""
        return cls(load.name, load.order, type(load), load.constants(), tuple(load.varies.items()))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of its parameters."""
        return tuple(f"{self.name}.{each.name}" for each in self.kind.parameters)

    @property
    def shape(self) -> str:
        """The name of the vector along which it acts."""
        return f"{self.name}.acts_on"

    def lines(self, frequency: Any, values: Iterable[Any]) -> tuple[Line, ...]:
        """Give its lines, for values of its parameters in their order."""
        return tuple(self.kind.lines(self.order, frequency, self._numbers(values)))

    def levels(self, frequency: Any, values: Iterable[Any]) -> Levels:
        """Give its levels, for values of its parameters in their order."""
        return self.kind.levels(self.order, frequency, self._numbers(values))

    def _numbers(self, values: Iterable[Any]) -> dict[str, Any]:
        numbers = {each.name: value for each, value in zip(self.kind.parameters, values, strict=True)}
        return {**dict(self.constants), **numbers}

    @property
    def orders(self) -> tuple[int, ...]:
        """The orders of its lines."""
        return tuple(line.order for line in _example(self, 1.0))

    @property
    def depends_on_frequency(self) -> bool:
        """True if the frequency enters its lines."""
        return _example(self, 0.7) != _example(self, 1.3)


@lru_cache
def _example(load: LoadForm, frequency: float) -> tuple[Line, ...]:
    """Give lines for numbers at which nothing vanishes by chance."""
    return load.lines(frequency, [1.0 + 0.0123 * place for place, _ in enumerate(load.parameters, start=1)])


LOADS: Registry[type[Load]] = Registry("load")
"""All kinds of loads that model files have tables of, by their keys; `register` adds one."""


def register(kind: type[Load]) -> None:
    """Register a kind of load for model files and result files; raise a ModelError if another kind has its key."""
    LOADS.add(kind.key, kind)


def check_order(order: float) -> None:
    """Refuse an order that is not a positive integer, with the reason."""
    if isinstance(order, bool) or not isinstance(order, int | float) or not abs(order) < math.inf:
        raise ModelError(f"order is {order!r}; it must be an integer >= 1")
    if order != int(order):
        raise ModelError(
            f"order is {order}; it must be an integer >= 1: with a non-integer order the excitation is not "
            "periodic in 2 pi/W, so no periodic motion exists. If the orders are commensurate (1 and 1.5, "
            "say), make the largest common divisor the fundamental (orders 2 and 3)"
        )
    if order < 1:
        raise ModelError(f"order is {order}; it must be an integer >= 1 (a constant load belongs in `mean`)")
