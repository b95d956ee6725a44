"""Registry of all kinds of one thing by name: force laws, loads, special points, orbit methods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from importlib import import_module
from types import MappingProxyType
from typing import TypeVar, overload

from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean, near_names
from gapwalk.model.units import PACES, QuantityKind, name_kind

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
    #: a number without a kind; `angle` and `torque` then give its unit in a drive train.
    kind: QuantityKind | None
    words: str  #: Explanation of the parameter, after its name: ``it is half the width of the gap``.
    default: float | None = None  #: Default value; None if the parameter is required.
    least: float | None = None  #: Its smallest value; None if it may be negative.
    #: angle, torque: For a parameter without a kind, the powers of an angle (or length) and of a torque (or force) in
    #: it.
    angle: int = 0
    torque: int = 0
    #: True if a model file that names the law may leave out this parameter of the contact as a whole.
    optional: bool = False

    def __post_init__(self) -> None:
        if self.kind is not None:
            name_kind(self.name, self.kind)

    @property
    def growth(self) -> int:
        """The power of L by which its number changes if the units of length and of force become L times as large."""
        powers = self.kind or self
        return -powers.angle - powers.torque


# The names of the parameters of a system, in the order of their values.

_SHOWN = 5  # names that are listed if none is similar to the unknown one
_FEW = 20_000  # names that may be listed, for a faster look-up and to find similar ones


@dataclass(frozen=True, slots=True)
class NameBlock:
    """Consecutive parameters: one number (rank 0), one for each coordinate (1), or for each pair of them (2)."""

    prefix: str
    rank: int = 0


@dataclass(frozen=True)
class ParameterNames(Sequence[str]):
    """All names in the order of the value vector; they are not stored if there are very many."""

    blocks: tuple[NameBlock, ...]  #: The blocks of names, in their order.
    coordinates: tuple[str, ...] = ()  #: The names by which vectors and matrices are indexed: ``stiffness.q1.q3``.

    def __len__(self) -> int:
        return self._starts[-1]

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(len(self)))]
        place = range(len(self))[index]
        number = next(i for i, end in enumerate(self._starts[1:]) if place < end)
        block, offset, n = self.blocks[number], place - self._starts[number], len(self.coordinates)
        words = [block.prefix]
        for power in range(block.rank - 1, -1, -1):
            words.append(self.coordinates[offset // n**power % n])
        return ".".join(words)

    def __iter__(self) -> Iterator[str]:
        for block in self.blocks:
            prefixes = [block.prefix]
            for _ in range(block.rank):
                prefixes = [f"{prefix}.{name}" for prefix in prefixes for name in self.coordinates]
            yield from prefixes

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def start(self, prefix: str) -> int:
        """Return the place of the first parameter of a block; raise a KeyError for an unknown prefix."""
        return self._starts[self._blocks[prefix]]

    def place(self, name: str) -> int:
        """Return the place of one parameter."""
        place = self._find(name) if isinstance(name, str) else None
        if place is None:
            raise ModelError(self._unknown(str(name)))
        return place

    @property
    def single(self) -> list[int]:
        """The places of the parameters that are not entries of a vector or a matrix."""
        return [start for block, start in zip(self.blocks, self._starts, strict=False) if block.rank == 0]

    @cached_property
    def _starts(self) -> list[int]:
        starts = [0]
        for block in self.blocks:
            starts.append(starts[-1] + len(self.coordinates) ** block.rank)
        return starts

    @cached_property
    def _blocks(self) -> dict[str, int]:
        return {block.prefix: number for number, block in enumerate(self.blocks)}

    @cached_property
    def _indices(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.coordinates)}

    @cached_property
    def _listed(self) -> dict[str, int] | None:
        return {name: place for place, name in enumerate(self)} if len(self) <= _FEW else None

    def _find(self, name: str) -> int | None:
        return self._listed.get(name) if self._listed is not None else self._compute(name)

    def _compute(self, name: str) -> int | None:
        words = name.split(".")
        for rank in (0, 1, 2):
            number = self._blocks.get(".".join(words[: len(words) - rank]))
            indices = [self._indices.get(word, -1) for word in words[len(words) - rank :]]
            if number is not None and self.blocks[number].rank == rank and -1 not in indices:
                return self._starts[number] + reduce(
                    lambda offset, index: offset * len(self._indices) + index, indices, 0
                )
        return None

    def _unknown(self, name: str) -> str:
        known = list(self) if len(self) <= _FEW else [block.prefix for block in self.blocks if block.rank == 0]
        friction = name.replace(".hysteresis", "_friction.limit")  # hysteresis in a file is an element of its own
        near = [friction] if friction != name and friction in known else near_names(name, known)
        if not near:  # those of the same part, else the same of other parts
            pairs = [(each.rpartition("."), each) for each in known]
            (part, _, last) = name.rpartition(".")
            near = [each for pair, each in pairs if part and pair[0] == part]
            near = (near or [each for pair, each in pairs if pair[2] == last])[:3]
        if not near and name in PACES:
            near = known[:1]  # the other of the two
        if near:
            return f"there is no parameter {name!r}; did you mean {' or '.join(map(repr, near))}?"
        rest = ", ... (system.parameters lists them all)" if len(self) > _SHOWN else ""
        return f"there is no parameter {name!r}; there are {', '.join(map(repr, known[:_SHOWN]))}{rest}"
