"""The parts of a formula: a tree of arithmetic, evaluated with any numbers or symbols.

`gapwalk.model.laws.formula` makes it of a text. ``abs``, ``min`` and ``max`` have a kink where their *guard* vanishes.
A mode, 1 or 0, says on which side of it the motion is, and multiplies: with modes given, the formula is smooth.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from gapwalk.model.laws.law import edge_polynomial

FUNCTIONS = ("sin", "cos", "exp", "log", "sqrt", "tanh")
"""Names of the smooth functions of one argument."""

EDGE = "_edge"
"""Key of the environment under which the width of the edge of fractional powers is given."""

KINKS = "_kinks"
"""Key of the environment under which a correction of each kink may be given: the error of ``max(u, 0)`` there."""

LARGEST_POWER = 100
"""The largest whole exponent; whole powers are products."""

LARGEST_FRACTION = 10
"""The largest fractional exponent of a positive part: above, the polynomial at its edge would fit badly."""


class Guard(NamedTuple):
    """A condition of a mode: the mode is 1 where ``sign * node - width`` is positive."""

    node: Node  #: Expression that vanishes at the kink.
    sign: int  #: +1, or -1 for a kink at which the expression falls below 0.
    is_edge: bool = False  #: True if `width` is that of the edge of a fractional power, otherwise it is 0.

    @property
    def key(self) -> str:
        """Text that identifies the mode: kinks at the same place have one mode, also if their signs differ."""
        return f"{self.node.text} at {self.sign} edge" if self.is_edge else self.node.text


@dataclass(frozen=True, slots=True)
class Values:
    """Values with which a formula is evaluated: numbers and functions by name, modes by the key of their guard."""

    environment: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]]
    modes: dict[str, Any]
    edges: Mapping[str, int] = field(default_factory=dict)
    kinks: Mapping[str, Any] = field(default_factory=dict)

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

    def width(self, guard: Guard) -> Any | None:
        """Return the width of the edge of a fractional power; None if it has none."""
        if guard.node.number is not None:
            return None
        width = self.environment.get(EDGE)
        if isinstance(width, (tuple, list)):
            width = width[self.edges[guard.node.text]]
        return None if isinstance(width, (int, float)) and width == 0.0 else width


class Node(ABC):
    """A part of a formula.

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
        square, left = self.parts[0].at(values), abs(self.power)
        product: Any = None
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
        mode, value, kink = values.mode(self.guard), self.parts[0].at(values), values.kinks.get(self.guard.key)
        found = (2.0 * mode - 1.0) * value
        return found if kink is None else found + 2.0 * kink

    def guards(self) -> Iterator[Guard]:
        """See `Node.guards`."""
        yield from (*super().guards(), self.guard)


class Extreme(Node):
    """The larger or the smaller of two parts: ``m a + (1 - m) b`` in the mode ``m``."""

    def __init__(self, function: str, first: Node, second: Node) -> None:
        self.function = function
        self.guard = Guard(*_directed(Sum([(1, first), (-1, second)])))
        begun = first.arguments if isinstance(first, Extreme) and first.function == function else first.text
        self.arguments: str = f"{begun}, {second.text}"
        super().__init__(f"{function}({self.arguments})", (first, second), first.work + second.work + 4)

    def evaluate(self, values: Values) -> Any:
        """See `Node.evaluate`."""
        mode = values.mode(self.guard)
        one, other = self.parts if self.function == "max" else self.parts[::-1]
        if isinstance(mode, float):  # of one state: the other part may be infinite
            return (one if mode else other).at(values)
        kink, found = values.kinks.get(self.guard.key), mode * one.at(values) + (1.0 - mode) * other.at(values)
        return found if kink is None else found + kink if self.function == "max" else found - kink

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


_PLAIN = Values({}, {name: getattr(math, name) for name in (*FUNCTIONS, "pow")}, {})
