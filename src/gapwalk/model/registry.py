"""Registry of all kinds of one thing by name: force laws, loads, special points, orbit methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TypeVar

from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.units import QuantityKind, name_kind

T = TypeVar("T")

_extensions: dict[str, str] = {}


class UnknownNameError(ModelError):
    """A name under which nothing is registered."""


class Registry(dict[str, T]):
    """Registry of the kinds of one concept by name, in the order of their registration."""

    def __init__(self, words: str, plural: str = "", homes: Mapping[str, str] = MappingProxyType({})) -> None:
        super().__init__()
        self.words, self._plural, self._homes = words, plural or f"{words}s", dict(homes)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all kinds, loaded or not."""
        return tuple(dict.fromkeys((*self._homes, *self)))

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the kinds that have no home."""
        return tuple(name for name in self if name not in self._homes)

    def add(self, name: str, kind: T) -> T:
        """Register a kind under its name, and return it; a class defined again replaces its earlier definition."""
        known = _class(self.named(name) if name in self._homes else self.get(name, kind)).__qualname__
        if known != _class(kind).__qualname__:
            raise ModelError(f"there is a {self.words} {name!r} already, {known}; choose another name")
        self[name] = kind
        if (module := _class(kind).__module__).partition(".")[0] != "gapwalk":
            _extensions[module] = f"{self.words} {name!r}"
        return kind

    def named(self, name: str) -> T:
        """Return the kind with a name."""
        if not isinstance(name, str) or name not in self.names:
            hint = did_you_mean(str(name), [*self.names], f"{self._plural} are")
            raise UnknownNameError(f"there is no {self.words} {name!r:.60}; {hint}")
        if name not in self:
            module, _, kind = self._homes[name].rpartition(".")
            self[name] = getattr(import_module(module), kind)
        return self[name]


def extensions() -> dict[str, str]:
    """Return the modules outside of gapwalk that registered kinds, each with one of its kinds in words.

    Other processes must import them before they work: a kind that is not registered there is unknown to them.
    """
    return dict(_extensions)


def _class(kind: object) -> type:
    """Return the class of a kind, which is registered as the class or as its only object."""
    return kind if isinstance(kind, type) else type(kind)


# The parameters that a kind of force law or of load has: name, kind of quantity, default, bound, and a sentence.


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a force law or of a load.

    Examples
    --------
    >>> each = gw.laws.Parameter("preload", gw.laws.QuantityKind.TORQUE, "it is the force at the breakpoint", least=0.0)
    >>> each.name, each.least
    ('preload', 0.0)
    """

    name: str  #: The last part of its name, as in ``stop.impact_damping``, and its key in a model file.
    #: Its kind of quantity, which determines its unit in a drive train and its change with the unit of length. None for
    #: a plain number; in a drive train with units, its unit is made of that of angles, s and N m.
    kind: QuantityKind | None
    words: str  #: Explanation of the parameter, after its name: ``it is half the width of the gap``.
    default: float | None = None  #: Default value; None if the parameter is required.
    least: float | None = None  #: Its smallest value; None if it may be negative.
    #: angle, torque: For a parameter without a kind, the powers of an angle (a length) and of a torque (a force) in it.
    angle: int = 0
    torque: int = 0
    #: True if a model file that names the law may leave out this parameter of the contact as a whole.
    optional: bool = False

    def __post_init__(self) -> None:
        if self.kind is not None:
            name_kind(self.name, self.kind)

    @property
    def growth(self) -> int:
        """The power of the unit of length by which its number grows; forces, by mass, are divided by that unit."""
        powers = self.kind or self
        return -powers.angle - powers.torque
