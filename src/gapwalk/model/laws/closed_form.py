"""The arguments of a formula of a force law, and its closed form: a sum of products, read from the formula.

The closed form is what harmonic balance and equilibria need, and what makes the batch integrator fast: where the force
is a polynomial of the depth of one stage at a time, its spectrum, its integral and the error that its kinks leave are
known exactly.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from gapwalk.model.laws.law import Law


@dataclass(frozen=True, slots=True)
class StageTerms:
    """A stage on one side as a formula sees it; its parameters are ``stage["stiffness"]`` and so on.

    Examples
    --------
    >>> stage = gw.laws.StageTerms(sign=1, depth=0.2, closed=1, innermost=True, numbers={"stiffness": 20.0})
    >>> stage.closed * stage["stiffness"] * stage.depth
    4.0
    """

    sign: int  #: The side: +1 or -1.
    #: Deflection past the breakpoint, ``x - sign * clearance``: positive beyond it on the positive side, negative
    #: beyond it on the negative side.
    depth: Any
    closed: Any  #: The mode: 1 while the deflection is beyond the breakpoint, otherwise 0.
    innermost: bool  #: True for the first stage on its side.
    numbers: Mapping[str, Any] = field(hash=False)  #: Its parameters by name.

    def __getitem__(self, name: str) -> Any:
        return self.numbers[name]


class Host(NamedTuple):
    """Another contact on which a formula depends: its stages, and its force.

    Examples
    --------
    >>> gw.laws.Host(stages=None, force=2.0).force
    2.0
    """

    stages: Stages  #: Its stages.
    force: Any  #: Its force.


class Stages:
    """All stages of a contact, on each side on which they act, and the other arguments of a formula.

    Parameters
    ----------
    stages
        The stages.
    add
        Function with which a backend adds several terms.
    deflections
        Each deflection by its name in the formula, with its rate.
    modes
        The modes of the law, 1 or 0 each, if it has any (`Law.guards`).
    functions
        Functions such as ``"sin"`` by name, as the backend has them.

    Attributes
    ----------
    slip
        For dry friction: 1 or -1 in slip, by its direction, and 0 in stick.
    extension
        For friction with a memory: the extension of its spring.
    host
        For a law with a host: the stages and the force of that contact.

    Examples
    --------
    >>> numbers = {"stiffness": 20.0, "cubic": 0.0}
    >>> stage = gw.laws.StageTerms(sign=1, depth=0.2, closed=1, innermost=True, numbers=numbers)
    >>> gw.laws.Elastic().force(0.0, gw.laws.Stages([stage], sum), {})
    4.0
    """

    slip: Any = 0.0
    extension: Any = 0.0
    host: Host | None = None

    def __init__(
        self,
        stages: Iterable[StageTerms],
        add: Callable[[list[Any]], Any] = sum,
        deflections: Mapping[str, tuple[Any, Any]] | None = None,
        modes: Sequence[Any] = (),
        functions: Mapping[str, Callable[..., Any]] | None = None,
    ) -> None:
        self._stages, self._add = tuple(stages), add
        self.deflections, self.modes = deflections or {}, modes
        self.functions = {} if functions is None else functions

    def __iter__(self) -> Iterator[StageTerms]:
        return iter(self._stages)

    def total(self, terms: Iterable[Any]) -> Any:
        """Return the sum of some terms."""
        return self._add(list(terms))

    def kept(self, side: int) -> Stages:
        """Return the stages as they are if the innermost one on a side is always closed, and those on the other open.

        The modes are still of the kind of the backend: numbers, arrays or expressions.
        """
        found = copy(self)
        found._stages = tuple(
            replace(each, closed=0.0 * each.closed + float(each.sign == side))
            if each.sign != side or each.innermost
            else each
            for each in self._stages
        )
        return found


class Term(NamedTuple):
    """One product of a closed form: ``factor * numbers * closed * depth**power * rate**rate``."""

    factor: float  #: A plain number.
    numbers: tuple[str, ...]  #: Parameters of the contact as a whole that it is multiplied by.
    stage_numbers: tuple[str, ...]  #: Parameters of its stage that it is multiplied by.
    stage: int  #: Index of the stage and its side among those of the contact.
    #: power, rate: Powers of the depth and of the rate.
    power: int
    rate: int


class StageShape(NamedTuple):
    """Properties of a stage that determine a closed form: its side, and whether it is the first there."""

    sign: int
    innermost: bool


class Symbols:
    """A sum of products of symbols, with the arithmetic of a formula."""

    __slots__ = ("products",)

    def __init__(self, products: Mapping[tuple[Any, ...], float]) -> None:
        self.products = {product: factor for product, factor in products.items() if factor != 0.0}

    @classmethod
    def of(cls, *symbol: Any) -> Symbols:
        """Make a single symbol."""
        return cls({(symbol,): 1.0})

    def __add__(self, other: Any) -> Symbols:
        found = defaultdict(float, self.products)
        for product, factor in _symbols(other).products.items():
            found[product] += factor
        return Symbols(found)

    def __mul__(self, other: Any) -> Symbols:
        found: dict[tuple[Any, ...], float] = defaultdict(float)
        for mine, factor in self.products.items():
            for yours, times in _symbols(other).products.items():
                found[_product(mine, yours)] += factor * times
        return Symbols(found)

    def __neg__(self) -> Symbols:
        return self * -1.0

    def __sub__(self, other: Any) -> Symbols:
        return self + _symbols(other) * -1.0

    def __rsub__(self, other: Any) -> Symbols:
        return _symbols(other) + self * -1.0

    def __truediv__(self, other: Any) -> Symbols:
        return self * (1.0 / other)

    __radd__, __rmul__ = __add__, __mul__


def _symbols(value: Any) -> Symbols:
    return value if isinstance(value, Symbols) else Symbols({(): float(value)})


def _product(a: tuple[Any, ...], b: tuple[Any, ...]) -> tuple[Any, ...]:
    """Multiply two products of symbols; a mode times itself is itself."""
    modes = {symbol for symbol in (*a, *b) if symbol[0] == _CLOSED}
    return tuple(sorted([*(symbol for symbol in (*a, *b) if symbol[0] != _CLOSED), *modes]))


_CLOSED, _DEPTH, _RATE, _NUMBER, _STAGE_NUMBER = "closed", "depth", "rate", "number", "stage number"


@lru_cache(maxsize=256)
class _NoFunctions(dict[str, Any]):
    """Functions of which a closed form has none."""

    def __missing__(self, name: str) -> Any:
        raise TypeError(f"{name} is no sum of products")


def closed_form_of(law: Law, shapes: tuple[StageShape, ...]) -> tuple[Term, ...] | None:
    """Return the force of a law as a sum of products, each of one stage; None if it is no such sum."""
    if law.mode_count or not law.stage_parameters:
        return None
    stages = [
        StageTerms(
            sign,
            Symbols.of(_DEPTH, index),
            Symbols.of(_CLOSED, index),
            innermost,
            {each.name: Symbols.of(_STAGE_NUMBER, index, each.name) for each in law.stage_parameters},
        )
        for index, (sign, innermost) in enumerate(shapes)
    ]
    arguments = Stages(stages, functions=_NoFunctions())
    numbers = {each.name: Symbols.of(_NUMBER, each.name) for each in law.parameters}
    try:
        force = _symbols(law.force(Symbols.of(_RATE), arguments, numbers))
        return tuple(_term(product, factor) for product, factor in force.products.items())
    except (TypeError, ValueError):  # a function, another operation, or a product of several stages
        return None


def _term(product: tuple[Any, ...], factor: float) -> Term:
    """Make a term of a product of symbols; raise a ValueError unless it belongs to one stage in its mode."""
    (stage,) = [symbol[1] for symbol in product if symbol[0] == _CLOSED]
    of_stages = [symbol for symbol in product if symbol[0] in (_DEPTH, _STAGE_NUMBER)]
    if any(symbol[1] != stage for symbol in of_stages):
        raise ValueError("a term of one stage depends on another one")
    return Term(
        factor,
        tuple(symbol[1] for symbol in product if symbol[0] == _NUMBER),
        tuple(symbol[2] for symbol in of_stages if symbol[0] == _STAGE_NUMBER),
        stage,
        sum(symbol[0] == _DEPTH for symbol in product),
        sum(symbol[0] == _RATE for symbol in product),
    )
