"""A force as a tree of arithmetic: evaluated with any numbers or symbols, with modes where it switches.

`gapwalk.model.laws.grammar` makes it of a text. ``abs``, ``min`` and ``max`` have a kink where their *guard* vanishes.
A mode, 1 or 0, says on which side of it the motion is, and multiplies: with modes given, the formula is smooth.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from gapwalk.model.laws.power_edge import edge_polynomial

EDGE = "_edge"
"""Key of the environment under which the width of the edge of fractional powers is given."""

LARGEST_POWER = 100
"""The largest whole exponent; whole powers are products."""


class Edge(NamedTuple):
    """A place of a formula where a function ends: ``sqrt``, ``log`` or a fractional power of something negative.

    Attributes
    ----------
    function
        ``"sqrt"``, ``"log"`` or ``"**"``.
    text
        The argument, which must stay positive.
    column
        Column of the formula as it was given, from 1.
    """

    function: str
    text: str
    column: int

    @property
    def words(self) -> str:
        """The reason why a formula cannot be evaluated there, and the line to write instead."""
        if self.function == "**":
            return (
                f"a fractional power of a negative number, at column {self.column}: {self.text} must stay positive; "
                f"for a force beyond a clearance write max({self.text}, 0)**1.5, with a number above 1 as exponent"
            )
        return (
            f"{self.function} of a negative number, at column {self.column}: {self.text} must stay positive; "
            f"keep it away from 0, as in {self.function}(({self.text})**2 + 1e-6)"
        )


class Guard(NamedTuple):
    """A condition of a mode: the mode is 1 where ``sign * node - width`` is positive.

    Attributes
    ----------
    node
        Expression that vanishes at the kink.
    sign
        +1, or -1 for a kink at which the expression falls below 0.
    is_edge
        True if `width` is that of the edge of a fractional power, otherwise it is 0.
    """

    node: Node
    sign: int
    is_edge: bool = False

    @property
    def key(self) -> str:
        """Text that identifies the mode: kinks at the same place have one mode, also if their signs differ."""
        return f"{self.node.text} at {self.sign} edge" if self.is_edge else self.node.text


@dataclass(frozen=True, slots=True)
class Values:
    """What a formula is evaluated with: numbers by name, functions by name, and modes by the key of their guard."""

    environment: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]]
    modes: dict[str, Any]
    edges: Mapping[str, int] = field(default_factory=dict)

    def mode(self, guard: Guard) -> Any:
        """Return a mode; that of a guard without any name is known."""
        number = guard.node.number
        if number is not None:
            return 1.0 if guard.sign * number > 0.0 else 0.0
        mode = self.modes[guard.key]
        return mode if guard.sign > 0 or guard.is_edge else 1.0 - mode

    def guard(self, guard: Guard) -> Any:
        """Evaluate a guard."""
        value = guard.node.at(self)
        if not guard.is_edge:
            return value
        width = self.width(guard)
        return (value if guard.sign > 0 else -value) - (0.0 if width is None else width)

    def width(self, guard: Guard) -> Any:
        """Return the width of the edge of a fractional power; None if it has none."""
        if guard.node.number is not None:
            return None
        width = self.environment.get(EDGE)
        if isinstance(width, (tuple, list)):
            width = width[self.edges[guard.node.text]]
        return None if isinstance(width, (int, float)) and width == 0.0 else width


class Node(ABC):
    """A part of a formula.

    Parameters
    ----------
    text
        The part as it is written again.
    parts
        The parts that it consists of.
    work
        Number of operations if it were written out without powers.

    Attributes
    ----------
    number
        Its value if no name occurs in it, otherwise None.
    names
        The names in it, in the order of their first appearance.
    size, depth
        Number of nodes, and of levels.
    """

    strength: ClassVar[int] = 5  # of its outermost operation: sum 1, product 2, sign 3, power 4

    def __init__(self, text: str, parts: tuple[Node, ...], work: int) -> None:
        self.text, self.parts, self.work = text, parts, work
        self.size = 1 + sum(part.size for part in parts)
        self.depth = 1 + max((part.depth for part in parts), default=0)
        self.names: tuple[str, ...] = tuple(dict.fromkeys(name for part in parts for name in part.names))
        self.number: float | None = None
        if parts and not self.names:
            self.number = _finite(self.evaluate(_PLAIN))

    def at(self, values: Values) -> Any:
        """Evaluate the part."""
        return self.evaluate(values) if self.number is None else self.number

    @abstractmethod
    def evaluate(self, values: Values) -> Any:
        """Evaluate the part even if it is a number."""

    def guards(self) -> Iterator[Guard]:
        """Yield all guards below it, those on which others depend first; some may occur twice."""
        for part in self.parts:
            yield from part.guards()

    def within(self, strength: int) -> str:
        """Write the part as an operand of an operation, in parentheses if it binds less."""
        return self.text if self.strength >= strength else f"({self.text})"


class Number(Node):
    """A number."""

    def __init__(self, value: float) -> None:
        super().__init__(repr(value).removesuffix(".0"), (), 1)
        self.number = _finite(value)

    def evaluate(self, values: Values) -> float:
        """See `Node.evaluate`."""
        assert self.number is not None
        return self.number


class Constant(Number):
    """A number that has a name."""

    def __init__(self, name: str, value: float) -> None:
        super().__init__(value)
        self.text = name


class Name(Node):
    """A variable or a parameter."""

    def __init__(self, name: str) -> None:
        super().__init__(name, (), 1)
        self.names = (name,)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        return values.environment[self.text]


class Negative(Node):
    """The part with its sign changed."""

    strength = 3

    def __init__(self, part: Node) -> None:
        super().__init__(f"-{part.within(self.strength)}", (part,), part.work + 1)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        return -self.parts[0].at(values)


class Sum(Node):
    """A sum of terms, each with its sign; that of the first is +."""

    strength = 1

    def __init__(self, terms: Iterable[tuple[int, Node]]) -> None:
        self.terms = tuple(terms)
        first, *others = self.terms
        written = [f" {'+' if sign > 0 else '-'} {part.within(2)}" for sign, part in others]
        parts = tuple(part for _, part in self.terms)
        super().__init__(first[1].within(1) + "".join(written), parts, sum(part.work for part in parts) + len(others))

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        total = self.parts[0].at(values)
        for sign, part in self.terms[1:]:
            total = total + part.at(values) if sign > 0 else total - part.at(values)
        return total


class Product(Node):
    """A product of factors, each with the power 1 or -1; that of the first is 1."""

    strength = 2

    def __init__(self, factors: Iterable[tuple[int, Node]]) -> None:
        self.factors = tuple(factors)
        first, *others = self.factors
        written = [f"{'*' if power > 0 else '/'}{part.within(3)}" for power, part in others]
        parts = tuple(part for _, part in self.factors)
        super().__init__(first[1].within(2) + "".join(written), parts, sum(part.work for part in parts) + len(others))

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        total = self.parts[0].at(values)
        for power, part in self.factors[1:]:
            total = total * part.at(values) if power > 0 else total / part.at(values)
        return total


class WholePower(Node):
    """A power with a whole number as exponent: a product, exact at 0 with all its derivatives."""

    strength = 4

    def __init__(self, base: Node, exponent: Node, power: int) -> None:
        self.power = power
        super().__init__(_power_text(base, exponent), (base,), max(abs(power), 1) * base.work + 1)
        if power == 0:
            self.number = 1.0

    def evaluate(self, values: Values) -> Any:
        """Multiply repeatedly: squares of the base, and the product of some of them."""
        if self.power == 0:
            return 1.0
        square, left, product = self.parts[0].at(values), abs(self.power), None
        while True:
            if left % 2:
                product = square if product is None else product * square
            left //= 2
            if not left:
                return product if self.power > 0 else 1.0 / product
            square = square * square


class Power(Node):
    """Any other power, by the function ``pow``."""

    strength = 4

    def __init__(self, base: Node, exponent: Node) -> None:
        super().__init__(_power_text(base, exponent), (base, exponent), base.work + exponent.work + 1)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        base, exponent = (part.at(values) for part in self.parts)
        return values.functions["pow"](base, exponent)


class Call(Node):
    """A smooth function of one argument."""

    def __init__(self, function: str, part: Node) -> None:
        self.function = function
        super().__init__(f"{function}({part.text})", (part,), part.work + 1)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        return values.functions[self.function](self.parts[0].at(values))


class Absolute(Node):
    """The absolute value: ``(2 m - 1) u`` in the mode ``m``."""

    def __init__(self, part: Node) -> None:
        self.guard = Guard(*_directed(part))
        super().__init__(f"abs({part.text})", (part,), part.work + 3)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        mode, value = values.mode(self.guard), self.parts[0].at(values)
        return (2.0 * mode - 1.0) * value

    def guards(self) -> Iterator[Guard]:
        """See `Node.guards`."""
        yield from (*super().guards(), self.guard)


class Extreme(Node):
    """The larger or the smaller of two parts: ``m a + (1 - m) b`` in the mode ``m``.

    Parameters
    ----------
    function
        ``"max"`` or ``"min"``; of more than two arguments, the first part is the extreme of all but the last.
    """

    def __init__(self, function: str, first: Node, second: Node) -> None:
        self.function = function
        self.guard = Guard(*_directed(Sum([(1, first), (-1, second)])))
        same = isinstance(first, Extreme) and first.function == function
        arguments = f"{first.arguments if same else first.text}, {second.text}"
        self.arguments = arguments
        super().__init__(f"{function}({arguments})", (first, second), first.work + second.work + 4)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        mode = values.mode(self.guard)
        one, other = self.parts if self.function == "max" else self.parts[::-1]
        if isinstance(mode, float):  # of one state: the other part may be infinite
            return (one if mode else other).at(values)
        return mode * one.at(values) + (1.0 - mode) * other.at(values)

    def guards(self) -> Iterator[Guard]:
        """See `Node.guards`."""
        yield from (*super().guards(), self.guard)


class PositivePower(Node):
    """A fractional power of the positive part, ``max(u, 0)**p`` with ``p > 1``, such as the force of Hertz.

    Where ``u`` is 0 it is not analytic, which an integrator by Taylor series needs on each side of an event. So there
    are two modes, ``m1`` beyond ``u = 0`` and ``m2`` beyond ``u = width``, and a polynomial between them. If no width
    is given, the power holds down to 0.
    """

    strength = 4

    def __init__(self, part: Node, exponent: Node) -> None:
        assert exponent.number is not None
        self.exponent = exponent.number
        node, sign = _directed(part)
        self.closed, self.beyond = Guard(node, sign), Guard(node, sign, is_edge=True)
        # written out, the argument occurs once in each of the factors of the polynomial
        super().__init__(f"max({part.text}, 0)**{exponent.within(3)}", (part,), 16 * part.work + 32)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`; no part that is switched off can be infinite, or not a number."""
        value, closed, width = self.parts[0].at(values), values.mode(self.closed), values.width(self.beyond)
        power = values.functions["pow"]
        if width is None:
            return closed * power(closed * value + (1.0 - closed), self.exponent)
        beyond = values.mode(self.beyond)
        depth = (closed - beyond) * value / width
        first, *factors = edge_polynomial(self.exponent)
        polynomial = first
        for factor in factors:
            polynomial = polynomial * depth + factor
        far = beyond * power(beyond * value + (1.0 - beyond) * width, self.exponent)
        return far + power(width, self.exponent) * (polynomial * depth)

    def guards(self) -> Iterator[Guard]:
        """See `Node.guards`."""
        yield from super().guards()
        if self.closed.node.number is None:
            yield from (self.closed, self.beyond)


class AbsolutePower(Node):
    """A fractional power of an absolute value: that of the positive part, and that of the negative part."""

    strength = 4

    def __init__(self, part: Node, exponent: Node) -> None:
        parts = (PositivePower(part, exponent), PositivePower(Negative(part), exponent))
        super().__init__(f"abs({part.text})**{exponent.within(3)}", parts, sum(each.work for each in parts) + 1)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        return self.parts[0].at(values) + self.parts[1].at(values)


@dataclass(frozen=True)
class Formula:
    """A force as a function of some variables and parameters; `formula_of` makes it of a text.

    It is equal by content: two texts that differ in spaces and needless parentheses give the same formula.

    Attributes
    ----------
    text
        The formula written again, in one way only.
    variables
        Names of the variables that occur in it, such as ``x``, its rate ``x'`` and ``v``.
    parameters
        All other names, in the order of their first appearance.
    edges
        The places where a function ends at 0, with their columns in the text as it was given.

    Examples
    --------
    >>> formula = formula_of("k*max(x - gap, 0)**2 + c*v", ("x", "v"))
    >>> formula.parameters
    ('k', 'gap', 'c')
    >>> values = {"x": 0.5, "v": 0.1, "k": 8.0, "gap": 0.25, "c": 1.0}
    >>> formula.value(values, NUMPY_FUNCTIONS, formula.modes_at(values, NUMPY_FUNCTIONS))
    0.6
    """

    text: str
    variables: tuple[str, ...]
    parameters: tuple[str, ...]
    edges: tuple[Edge, ...] = field(compare=False)
    tree: Node = field(compare=False, repr=False)
    edge_nodes: tuple[Node, ...] = field(compare=False, repr=False, default=())

    def value(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]], modes: Sequence[Any]
    ) -> Any:
        """Evaluate the formula in given modes.

        Parameters
        ----------
        environment
            The variables and parameters by name: numbers, arrays, symbols, anything with ``+ - * /``. Under the key
            ``"_edge"`` the width of the edges of fractional powers, in the unit of what stands in ``max(..., 0)``:
            one for all, or a tuple in the order of `edge_widths`. Without it they are exact, and not smooth.
        functions
            ``sin cos exp log sqrt tanh`` of one argument, and ``pow(base, exponent)``.
        modes
            One number 1 or 0, an array of them, or a symbol, for each mode.
        """
        return self.tree.at(self._values(environment, functions, modes))

    def guards(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]], modes: Sequence[Any]
    ) -> list[Any]:
        """Evaluate the guard of each mode: the mode is 1 where it is positive. Parameters as in `value`.

        A guard depends on modes before its own at most.
        """
        values = self._values(environment, functions, modes)
        return [values.guard(guard) for guard in self._guards.values()]

    def modes_at(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]
    ) -> list[float | np.ndarray]:
        """Decide all modes by the real parts of their guards, for numbers or arrays; 0 where a guard is 0."""
        values = Values(environment, functions, {}, self._edge_numbers)
        for key, guard in self._guards.items():
            values.modes[key] = (np.real(values.guard(guard)) > 0.0) * 1.0
        return list(values.modes.values())

    def edge_values(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]], modes: Sequence[Any]
    ) -> list[Any]:
        """Evaluate the argument of each of the `edges`, which must be positive. Parameters as in `value`."""
        values = self._values(environment, functions, modes)
        return [node.at(values) for node in self.edge_nodes]

    @property
    def mode_count(self) -> int:
        """Number of modes."""
        return len(self._guards)

    @property
    def guard_names(self) -> tuple[tuple[str, ...], ...]:
        """For each mode the names that its guard depends on; without a variable among them it is no event."""
        return tuple(guard.node.names for guard in self._guards.values())

    @property
    def edge_widths(self) -> tuple[str, ...]:
        """The arguments of all fractional powers of a positive part, for each of which an edge has a width."""
        return tuple(self._edge_numbers)

    def _values(self, environment: Mapping[str, Any], functions: Any, modes: Sequence[Any]) -> Values:
        return Values(environment, functions, dict(zip(self._guards, modes, strict=True)), self._edge_numbers)

    @cached_property
    def _guards(self) -> dict[str, Guard]:
        """The guards by key, in an order in which they can be decided."""
        found: dict[str, Guard] = {}
        for guard in self.tree.guards():
            if guard.node.number is None:
                found.setdefault(guard.key, guard if guard.is_edge else Guard(guard.node, 1))
        return found

    @cached_property
    def _edge_numbers(self) -> dict[str, int]:
        texts = dict.fromkeys(guard.node.text for guard in self._guards.values() if guard.is_edge)
        return {text: index for index, text in enumerate(texts)}


def _directed(part: Node) -> tuple[Node, int]:
    """Write a guard in one way only, with its sign: ``max(g - x, 0)``, ``max(x, g)`` and ``abs(x - g)`` have one kink.

    Two events at the same instant would have to be put in order; one event with one mode serves both.
    """
    left: dict[str, tuple[int, Node]] = {}
    for sign, term in _flat(1, part):
        count, _ = left.get(term.text, (0, term))
        left[term.text] = (count + sign, term)
    terms = [(1 if count > 0 else -1, term) for _, (count, term) in sorted(left.items()) for _ in range(abs(count))]
    terms = [(sign, term) for sign, term in terms if term.number != 0.0]
    if not terms:
        return Number(0.0), 1
    first = next((sign for sign, term in terms if term.number is None), terms[0][0])
    terms.sort(key=lambda each: each[1].number is not None)  # a name first, so that its sign is +
    if len(terms) == 1:
        return terms[0][1], first
    return Sum([(sign * first, term) for sign, term in terms]), first


def _flat(sign: int, part: Node) -> Iterator[tuple[int, Node]]:
    """Yield the terms of a part, each with its sign."""
    if isinstance(part, Negative):
        yield from _flat(-sign, part.parts[0])
    elif isinstance(part, Product) and isinstance(part.parts[0], Negative):
        yield from _flat(-sign, Product([(1, part.parts[0].parts[0]), *part.factors[1:]]))
    elif isinstance(part, Sum):
        for own, term in part.terms:
            yield from _flat(sign * own, term)
    else:
        yield sign, part


def _power_text(base: Node, exponent: Node) -> str:
    return f"{base.within(5)}**{exponent.within(3)}"


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise OverflowError("it is too large")
    return float(value)


NUMPY_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "tanh": np.tanh,
    "pow": np.power,
}
"""The functions of formulas for numbers and arrays, real or complex."""

FUNCTIONS = tuple(name for name in NUMPY_FUNCTIONS if name != "pow")
"""Names of the smooth functions of one argument."""

_PLAIN = Values({}, {name: getattr(math, name) for name in NUMPY_FUNCTIONS}, {})
