"""The protocol of a load, and the registry of all of them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from gapwalk.errors import ModelError, OutsideError
from gapwalk.model.channels.channel_file import NamedFile
from gapwalk.model.laws.formula import NUMPY_FUNCTIONS, Formula, formula_of
from gapwalk.model.measured.measured_table import SpeedTable, WantedColumn, read_heads, read_table, speed_table
from gapwalk.model.registry import Parameter, Registry
from gapwalk.model.units import QuantityKind, Units

# Factors that depend on the speed: by a formula, or by a measured table.
#
# The factor of a load is kept as plain data in its constants, so that result files have it: `FactorOverSpeed.data`.

_NAMES = ("W", "speed")


@dataclass(frozen=True)
class FactorOverSpeed:
    """A factor that depends on the frequency of the excitation.

    Raises
    ------
    ModelError
        If the text is no formula, or has names other than ``W`` and ``speed``, or kinks.

    Examples
    --------
    >>> float(gw.loads.FactorOverSpeed("1 + 0.1*W").value(2.0))
    1.2
    """

    #: A smooth formula of the angular frequency ``W`` (in a train with a speed, the angular speed of its reference
    #: shaft) and of the ``speed``, the first parameter of the system in its own unit; empty if there is a table.
    formula: str = ""
    table: SpeedTable | None = None  #: A table over the speed; None if there is a formula.
    pace: float = 1.0  #: The frequency W at the speed 1; 1 in a system without units.
    turns: float = 1.0  #: Periods of the excitation in one turn of the shaft, if a formula is of its speed.

    def __post_init__(self) -> None:
        if self.table is not None:
            return
        formula = self._read
        if formula.parameters:
            raise ModelError(
                f"over_speed is {self.formula!r}, and {formula.parameters[0]} is unknown in it; its names are W, the "
                "angular frequency, and speed, the first parameter of the system, as in 1 + 0.1*W"
            )
        if formula.mode_count:
            raise ModelError(
                f"over_speed is {self.formula!r}, which has a kink; write a smooth formula, or a table over "
                'the speed: over_speed = "gas.csv"'
            )

    @property
    def words(self) -> str:
        """Description in a few words."""
        return f"times {self._read.text}" if self.table is None else f"times the table {self.table.name}"

    @property
    def limits(self) -> tuple[float, float]:
        """The range of frequencies W in which it has values."""
        return (self.points[0], self.points[-1]) if self.points else (0.0, math.inf)

    @property
    def points(self) -> tuple[float, ...]:
        """The frequencies W of the points of its table; none of a formula."""
        return () if self.table is None else tuple(speed * self.pace for speed in self.table.speeds)

    @property
    def data(self) -> tuple[Any, ...]:
        """Its parts as texts, numbers and tuples, from which `factor_over_speed` makes it again."""
        if self.table is None:
            return "formula", self.formula, self.pace, self.turns
        table = self.table
        return "table", table.name, table.unit, self.pace, table.speeds, table.values

    def value(self, frequency: Any) -> Any:
        """Return the factor at a frequency W: real or complex, or an array.

        Beyond its limits a table is continued by its first or last piece, for steps of Newton's method that pass its
        end; `gapwalk.model.coefficients.coefficients_of` refuses such systems.
        """
        speed = frequency / self.pace
        if self.table is not None:
            return self.table.value(speed, continued=True)
        with np.errstate(all="ignore"):
            found = self._read.value({"W": frequency / self.turns, "speed": speed}, NUMPY_FUNCTIONS, ())
        if not np.all(np.isfinite(found)):
            raise OutsideError(f"over_speed is {self.formula!r}, which has no value at W = {np.real(frequency)}")
        return found

    def in_train(self, units: Units) -> FactorOverSpeed:
        """Return the factor in the units of a drive train: a formula has the speed in the train's own unit."""
        turns = float(units.turns or 1)
        if self.table is None:
            return replace(self, pace=units.frequency, turns=turns)
        return replace(self, pace=self.pace * turns)

    def scaled(self, frequency: float) -> FactorOverSpeed:
        """Return the factor where the frequency is counted in another unit."""
        return replace(self, pace=self.pace / frequency, turns=self.turns / frequency)

    @cached_property
    def _read(self) -> Formula:
        return formula_of(self.formula, _NAMES)


OverSpeed = str | SpeedTable | FactorOverSpeed | tuple[Any, ...]
"""A factor over the speed as it is given: a formula, a table, or the data of one; empty for none."""


def read_factor(file: NamedFile, *, units: bool) -> FactorOverSpeed:
    """Read a table over the speed from a file."""
    speed = WantedColumn("speed", QuantityKind.FREQUENCY if units else None, ("frequency", "W", "n"))
    factor = WantedColumn("factor", None, ("amplitude", "value", "scale"))
    if units and any(head.is_of(QuantityKind.TORQUE) for head in read_heads(file)):
        factor = WantedColumn("torque", QuantityKind.TORQUE)
    elif not units:
        factor = replace(factor, others=(*factor.others, "torque", "force", "load"))
    table = read_table(file, (speed, factor))
    column = table["speed"]
    name, pace = (column.unit.text, column.unit.factor) if column.unit else ("", 1.0)
    values = table[factor.role].values()
    return FactorOverSpeed("", speed_table(column.numbers, values, file.name, name), pace)


@lru_cache(maxsize=256)
def factor_over_speed(data: tuple[Any, ...]) -> FactorOverSpeed:
    """Make a factor from its `FactorOverSpeed.data`; raise a ValueError if it is none."""
    match data:
        case ("formula", str(text), float(pace), float(turns)):
            return FactorOverSpeed(text, None, pace, turns)
        case ("table", str(name), str(unit), float(pace), tuple(speeds), tuple(values)):
            return FactorOverSpeed("", SpeedTable(speeds, values, name, unit), pace)
    raise ValueError("a factor over the speed is a formula or a table")


def over_speed_data(given: object) -> tuple[Any, ...]:
    """Return the data of a factor from a formula, a table, or such data; empty for nothing."""
    if isinstance(given, FactorOverSpeed):
        return given.data
    if isinstance(given, SpeedTable):
        return FactorOverSpeed("", given).data
    if isinstance(given, str):
        return FactorOverSpeed(given).data if given.strip() else ()
    if isinstance(given, Sequence) and not given:
        return ()
    try:
        return factor_over_speed(tuple(given)).data  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise ModelError(
            f'over_speed is {given!r}; write a formula such as "1 + 0.1*W", or a table from gw.loads.read_speed_table'
        ) from None


class Line(NamedTuple):
    """A part ``cosine * cos(order * W * t) + sine * sin(order * W * t)`` of a load; of order 0 it is constant.

    Examples
    --------
    >>> list(gw.Harmonic.lines(2, 1.5, dict(amplitude=0.5, phase=0.0, growth=0, at=1.0)))
    [Line(order=2, cosine=np.float64(0.5), sine=np.float64(-0.0))]
    """

    order: int  #: Multiple of the fundamental frequency.
    #: cosine, sine: Amplitudes, in the unit of the load.
    cosine: Any
    sine: Any = 0.0


class Levels(NamedTuple):
    """A part of a variation with two levels: ``high`` from the angle `up` to `down` in each cycle, otherwise ``low``.

    The angles are those of the excitation, W t; they repeat after ``2 pi / order``.

    Examples
    --------
    >>> gw.loads.Levels(low=-0.3, high=0.2, up=-1.0, down=1.0).high
    0.2
    """

    low: Any  #: The lower level, relative to the number that varies.
    high: Any  #: The higher level.
    #: up, down: Angles at which the higher level begins and ends, in radians.
    up: Any
    down: Any


class Load(ABC):
    """A load that repeats with the excitation, along one vector of coordinates; or a variation of other numbers.

    A kind of load is one class in one file, registered once by `register`: a frozen dataclass with a field for each of
    its parameters, and the fields `acts_on`, `order`, `name` and `varies`. A new kind needs no other code.

    Parameters
    ----------
    acts_on
        The vector along which it acts, by coordinate name, for example ``{"q1": 1.0}``; in a drive train by inertia.
        Empty for a variation.
    order
        Multiple of the fundamental frequency, an integer >= 1.
    name
        Prefix of its parameters' names; by default its key and its order, as in ``harmonic2``.
    varies
        Names of what it varies instead: one, several, or each with a factor: ``{"mesh.stiffness": 1.0}``. The load is
        added to a deflection (or to the clearance of a contact with one side); any other number of a contact or a force
        is multiplied by ``1 + load``.
    over_speed
        For kinds of load with this field, a factor that depends on the speed: a formula such as ``"1 + 0.1*W"``, or a
        table.
    growth, at
        For kinds of load with these fields, the power 0, 1 or 2 of the frequency with which it grows, and the frequency
        at which it has its size; their `lines` use `grown`.

    Attributes
    ----------
    key
        Its table in a model file, ``[[harmonic]]``.
    words
        Description, in a few words.
    parameters
        Its parameters, in the order of its fields. Any further fields are constants.
    table_keys
        Its keys in a model file in place of its constants, each with its type and its default (``...`` for none), if
        they are not the fields themselves; `from_table` reads them.

    Notes
    -----
    The formula stands only in `lines`; it may contain the frequency. All derivatives, by the frequency too, are taken
    of it by a complex step. A kind with curves of its own over the speed gives their points by `tables`; one whose
    constants are torques or frequencies converts them by `rescaled`.

    Examples
    --------
    An unbalance, whose force grows with the square of the frequency. A class in a file of its own registers itself for
    model files by ``gw.loads.register(Unbalance)``.

    >>> from dataclasses import dataclass, field
    >>> @dataclass(frozen=True)
    ... class Unbalance(gw.loads.Load):
    ...     key, words = "unbalance", "the force of an unbalance"
    ...     parameters = (gw.laws.Parameter("moment", None, "it is the mass times its distance from the axis"),)
    ...     moment: float
    ...     acts_on: dict = field(default_factory=dict, hash=False)
    ...     order: int = 1
    ...     name: str = ""
    ...     varies: dict = field(default_factory=dict, hash=False)
    ...
    ...     @classmethod
    ...     def lines(cls, order, frequency, numbers):
    ...         yield gw.loads.Line(order, numbers["moment"] * (order * frequency) * (order * frequency))
    >>> gw.System(["x"], [[1.0]], harmonics=[Unbalance(0.1, {"x": 1.0})]).parameters["unbalance1.moment"]
    0.1
    """

    key: ClassVar[str]
    words: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    has_levels: ClassVar[bool] = False
    table_keys: ClassVar[Mapping[str, tuple[Any, Any]]] = MappingProxyType({})
    frequencies: ClassVar[tuple[str, ...]] = ()
    """Names of further fields that are frequencies W; in a drive train with units they are texts."""
    is_periodic: ClassVar[bool] = True
    """False if it is constant over the angle, so that it has no order."""

    __dataclass_fields__: ClassVar[dict[str, Any]]  # every kind is a dataclass
    acts_on: Mapping[str, float]
    name: str
    order: int = 1
    varies: Mapping[str, float] = MappingProxyType({})  # a kind without such a field varies nothing
    over_speed: Any = ()  # without these three, it depends on the speed only if its lines do
    growth: int = 0
    at: float = 1.0

    def __post_init__(self) -> None:
        if self.is_periodic:
            check_order(self.order)
            object.__setattr__(self, "order", int(self.order))
        if not self.name:
            object.__setattr__(self, "name", f"{self.key}{self.order if self.is_periodic else ''}")
        if "over_speed" in self.__dataclass_fields__:
            object.__setattr__(self, "over_speed", over_speed_data(self.over_speed))
        if self.growth not in (0, 1, 2) or isinstance(self.growth, bool):
            raise ModelError(f"growth is {self.growth!r}; it must be 0, 1 or 2, the power of the frequency")
        if isinstance(self.at, int | float) and not self.at > 0.0:  # a text with a unit is read by the drive train
            raise ModelError(f"at is {self.at!r}; it must be a frequency > 0, at which the load has its amplitude")
        if not isinstance(self.varies, Mapping):
            names = (self.varies,) if isinstance(self.varies, str) else self.varies
            object.__setattr__(self, "varies", dict.fromkeys(names, 1.0))
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
        """Give the load as a sum of lines, each of one order.

        Parameters
        ----------
        order
            Order of the load.
        frequency
            The frequency W of the excitation: real or complex, or an array.
        numbers
            Its parameters by name, which may also be complex or arrays, and its constants.
        """

    @classmethod
    def unscaled(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give further lines, which `over_speed` does not multiply; by default none.

        Parameters
        ----------
        order, frequency, numbers
            As for `lines`.
        """
        return ()

    @staticmethod
    def grown(size: Any, frequency: Any, numbers: Mapping[str, Any]) -> Any:
        """Return a size that grows with a power of the frequency: ``size * (W / at)**growth``.

        Parameters
        ----------
        size
            Size at the frequency ``at``.
        frequency
            The frequency W of the excitation: real or complex, or an array.
        numbers
            The parameters and constants of the load by name, ``growth`` and ``at`` among them.
        """
        for _ in range(numbers.get("growth", 0)):  # result files of earlier versions have none
            size = size * (frequency / numbers["at"])
        return size

    @classmethod
    def levels(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Levels:
        """Give the two levels of a variation that jumps (``has_levels = True``); parameters as in `lines`.

        Parameters
        ----------
        order
            Order of the load.
        frequency
            The frequency W of the excitation.
        numbers
            Its parameters by name, and its constants.
        """
        raise NotImplementedError

    @property
    def turn_order(self) -> Fraction:
        """Its order per turn of the shaft whose speed replaces the frequency of a drive train; 0 if it is constant."""
        return Fraction(self.order) if self.is_periodic else Fraction(0)

    def in_train(self, units: Units) -> Self:
        """Return the load in the units of a drive train; its parameters and frequencies are converted elsewhere."""
        if not self.over_speed:
            return self
        return replace(self, over_speed=factor_over_speed(self.over_speed).in_train(units).data)

    @classmethod
    def from_table(cls, given: Mapping[str, Any], *, units: bool) -> Self:
        """Make a load from its table in a model file.

        Parameters
        ----------
        given
            The values of its keys: those of its fields, and of `table_keys`.
        units
            True if the quantities of the file have units.
        """
        return cls(**given)

    @classmethod
    def tables(cls, constants: Mapping[str, Any]) -> Iterator[tuple[tuple[float, ...], str]]:
        """Iterate over its tables over the speed: the frequencies W of the points of each, and its name.

        Parameters
        ----------
        constants
            Values of its constants by name.
        """
        factor = factor_over_speed(data) if (data := constants.get("over_speed")) else None
        if factor is not None and factor.table is not None:
            yield factor.points, factor.table.name

    @classmethod
    def rescaled(cls, constants: Mapping[str, Any], frequency: float, size: float) -> dict[str, Any]:
        """Return its constants in other units.

        Parameters
        ----------
        constants
            Values of its constants by name.
        frequency
            The new unit of frequencies, measured in the old unit.
        size
            The new unit of its torque, of its displacement, or of the fraction by which something varies.
        """
        found = dict(constants)
        for name in cls.frequencies if found.get("growth", True) else ():
            found[name] /= frequency
        if data := found.get("over_speed"):
            factor = factor_over_speed(data)
            found["over_speed"] = factor.scaled(frequency).data
        return found

    @classmethod
    def notes(cls, constants: Mapping[str, Any]) -> str:
        """Describe its constants for a reader of the model; empty if there is nothing to say.

        Parameters
        ----------
        constants
            Values of its constants by name.
        """
        return ""

    @classmethod
    def problems(cls, numbers: Mapping[str, float]) -> Iterator[str]:
        """List the errors of values of its parameters, one sentence each that begins with the name of one.

        Parameters
        ----------
        numbers
            Values of its parameters by name.
        """
        return iter(())

    def values(self) -> Iterator[float]:
        """Iterate over the values of its parameters."""
        yield from (getattr(self, each.name) for each in self.parameters)

    def constants(self) -> tuple[tuple[str, Any], ...]:
        """Return the fields that are no parameters, with their values."""
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
        numbers = self._numbers(values)
        lines = self.kind.lines(self.order, frequency, numbers)
        if (over_speed := self.factor) is not None:
            factor = over_speed.value(frequency)
            lines = (Line(order, factor * cosine, factor * sine) for order, cosine, sine in lines)
        return (*lines, *self.kind.unscaled(self.order, frequency, numbers))

    def plain_lines(self, frequency: Any, values: Iterable[Any]) -> tuple[Line, ...]:
        """Give its lines without its factor over the speed."""
        numbers = self._numbers(values)
        given = (self.order, frequency, numbers)
        return (*self.kind.lines(*given), *self.kind.unscaled(*given))

    @property
    def tables(self) -> tuple[tuple[tuple[float, ...], str], ...]:
        """Its tables over the speed: the frequencies W of the points of each, and its name."""
        return tuple(self.kind.tables(dict(self.constants)))

    @property
    def factor(self) -> FactorOverSpeed | None:
        """Its factor over the speed; None if it has none."""
        data = dict(self.constants).get("over_speed")
        return factor_over_speed(data) if data else None

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
    def multiples(self) -> tuple[int, ...]:
        """The multiples of the fundamental frequency with which it repeats; none of a constant load."""
        own = (self.order,) if self.kind.has_levels else ()
        return (*own, *(order for order in self.orders if order))

    @property
    def depends_on_frequency(self) -> bool:
        """True if the frequency enters its lines."""
        return self.is_scaled or _example(self, 0.7) != _example(self, 1.3)

    @property
    def is_scaled(self) -> bool:
        """True if a factor or a table over the speed enters its lines, which may be the same at two speeds."""
        return self.factor is not None or bool(self.tables)


@lru_cache
def _example(load: LoadForm, frequency: float) -> tuple[Line, ...]:
    """Give lines for numbers at which nothing vanishes by chance."""
    return load.plain_lines(frequency, [1.0 + 0.0123 * place for place, _ in enumerate(load.parameters, start=1)])


LOADS: Registry[type[Load]] = Registry("load")
"""All kinds of loads that model files have tables of, by their keys; `register` adds one."""


def register(kind: type[Load]) -> None:
    """Register a kind of load for model files and result files; raise a ModelError if another kind has its key.

    Parameters
    ----------
    kind
        The class of the load.

    Raises
    ------
    ModelError
        If another kind has its key.

    Examples
    --------
    >>> gw.loads.register(gw.loads.Steady)  # as gapwalk has done; a class is registered in its own file
    """
    LOADS.add(kind.key, kind)


def check_order(order: float) -> None:
    """Refuse an order that is not a positive integer, with the reason."""
    if isinstance(order, bool) or not isinstance(order, int | float) or not abs(order) < math.inf:
        raise ModelError(f"order is {order!r}; it must be an integer >= 1")
    if order != int(order):
        raise ModelError(
            f"order is {order}; it must be an integer >= 1: with a non-integer order the excitation is not "
            "periodic in 2 pi/W, so no periodic motion exists. If the orders are commensurate (1 and 1.5, "
            "say), make the largest common divisor the fundamental (orders 2 and 3). In a drive train with a speed, "
            f"write gw.train.Counted(load, order={order}) with a load of order 1"
        )
    if order < 1:
        raise ModelError(f"order is {order}; it must be an integer >= 1 (a constant load belongs in `mean`)")


# Harmonics of the fundamental frequency.


@dataclass(frozen=True)
class Harmonic(Load):
    """One term ``amplitude * s * cos(order * W * t + phase)`` of the excitation, or of a variation.

    Examples
    --------
    >>> gw.Harmonic(0.1, {"x": 1.0}, growth=2).name  # the force of an unbalance of 0.1
    'harmonic1'
    """

    key, words, frequencies = "harmonic", "a term of the excitation", ("at",)
    parameters = (
        Parameter("amplitude", QuantityKind.TORQUE, "it is the size of the load"),
        Parameter("phase", QuantityKind.PHASE, "it is the phase", default=0.0),
    )

    #: A force or a torque; for a variation, a fraction of the number that varies, or a displacement.
    amplitude: float
    #: The vector ``s`` by coordinate name, for example ``{"q1": 1.0}``.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
    order: int = 1  #: Multiple of the fundamental frequency, an integer >= 1.
    phase: float = 0.0  #: In radians.
    name: str = ""  #: Prefix of its parameters' names; ``harmonic<order>`` by default.
    #: What it varies instead: ``"mesh.stiffness"``, or several names with factors.
    varies: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: Power 0, 1 or 2 of the frequency with which it grows: the term is ``amplitude * (W / at)**growth``. The force of
    #: an unbalance and the torque of an accelerated inertia grow with the power 2.
    growth: int = 0
    at: float = 1.0  #: The frequency W at which it has its amplitude.
    #: A factor that depends on the speed: a smooth formula of the angular frequency, such as ``"1 + 0.1*W"``, or a
    #: `SpeedTable`.
    over_speed: OverSpeed = ()

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        size, angle = cls.grown(numbers["amplitude"], frequency, numbers), numbers["phase"]
        yield Line(order, size * np.cos(angle), size * -np.sin(angle))


# Variations with two levels, such as the stiffness of spur gears with one and two pairs of teeth in contact.


@dataclass(frozen=True)
class Rectangle(Load):
    """A variation with two levels and the mean 0: high for a share of each cycle, and low for the rest of it.

    The number that varies is its mean times ``1 + amplitude`` where ``cos(order * W * t + phase) > cos(pi * share)``,
    and ``1 - amplitude * share / (1 - share)`` elsewhere. For spur gears with a contact ratio of 1.6 the share is 0.6:
    the share of time with two pairs of teeth in contact.

    Examples
    --------
    >>> gw.loads.Rectangle(0.2, {"mesh.stiffness": 1.0}, order=27, share=0.6).name
    'rectangle27'
    """

    key, words = "rectangle", "a variation with two levels"
    parameters = (
        Parameter("amplitude", None, "it is the height of the higher level over the mean, as a fraction of it"),
        Parameter("share", None, "it is the share of each cycle at the higher level", 0.5, 0.0),
        Parameter("phase", QuantityKind.PHASE, "it is the phase", default=0.0),
    )
    has_levels = True

    amplitude: float  #: Height of the higher level over the mean, as a fraction of it.
    #: What it varies: ``"mesh.stiffness"``, or several names with factors. No deflection and no clearance: they cannot
    #: jump.
    varies: Mapping[str, float] = field(default_factory=dict, hash=False)
    order: int = 1  #: Cycles per forcing period, an integer >= 1.
    share: float = 0.5  #: Share of each cycle at the higher level, between 0 and 1.
    phase: float = 0.0  #: In radians; with 0, the middle of the higher level is at ``W t = 0``.
    name: str = ""  #: Prefix of its parameters' names; ``rectangle<order>`` by default.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        for problem in self.problems({"share": self.share}):
            raise ModelError(problem)

    @classmethod
    def problems(cls, numbers: Mapping[str, float]) -> Iterator[str]:
        """See `Load.problems`."""
        if not 0.0 < numbers["share"] < 1.0:
            yield f"share is {numbers['share']!r}; it must be between 0 and 1, both excluded"

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """Give no lines: the variation jumps; see `levels`."""
        return ()

    @classmethod
    def levels(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Levels:
        """See `Load.levels`."""
        high, share = numbers["amplitude"], numbers["share"]
        middle, half = -numbers["phase"] / order, math.pi * share / order
        return Levels(-high * share / (1.0 - share), high, middle - half, middle + half)


# Constant loads that depend on the speed, such as the friction of bearings.


@dataclass(frozen=True)
class Steady(Load):
    """A load that is constant over the angle, and depends on the speed by a factor.

    Examples
    --------
    >>> gw.loads.Steady(0.2, {"x": 1.0}, over_speed="1 + 0.1*W").name  # unlike `mean`, which depends on nothing
    'steady'
    """

    key, words, frequencies = "steady", "a constant load that depends on the speed", ("at",)
    is_periodic, order = False, 0
    parameters = (Parameter("amplitude", QuantityKind.TORQUE, "it is the size of the load"),)

    amplitude: float  #: In units of a force (of a torque).
    #: The vector along which it acts, by coordinate name.
    acts_on: Mapping[str, float] = field(default_factory=dict, hash=False)
    #: The factor: a smooth formula of the angular frequency, such as ``"1 + 0.1*W"``, or a `SpeedTable`.
    over_speed: OverSpeed = ()
    #: growth, at: Power 0, 1 or 2 of the frequency with which it grows, and the frequency W at which it has its
    #: amplitude.
    growth: int = 0
    at: float = 1.0
    name: str = ""  #: Prefix of its parameters' names.

    @classmethod
    def lines(cls, order: int, frequency: Any, numbers: Mapping[str, Any]) -> Iterable[Line]:
        """See `Load.lines`."""
        yield Line(0, cls.grown(numbers["amplitude"], frequency, numbers))
