"""Functions of a state, of the angle and of run-time parameters, as expressions; equal parts are stored once.

Arithmetic with them builds new ones; `derivative` and `replaced` follow the usual rules. What the flow integrates is
written with them once, and `gapwalk.taylor.program` turns it into data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any
from weakref import WeakValueDictionary

_KNOWN: WeakValueDictionary[tuple[Any, ...], Symbol] = WeakValueDictionary()
_NONE: frozenset[Symbol] = frozenset()


class Symbol:
    """A number, a leaf (parameter, variable, angle), or an operation on other symbols.

    Attributes
    ----------
    operation
        ``number``, ``parameter``, ``variable``, ``angle``, ``sum``, ``product``, ``quotient``, ``power``, or the name
        of a function.
    arguments
        The symbols on which it operates.
    value
        The number, the index of a parameter, or the name of a variable.
    leaves
        The parameters, variables and the angle on which it depends.
    """

    __slots__ = ("__weakref__", "arguments", "leaves", "operation", "value")

    operation: str
    arguments: tuple[Symbol, ...]
    value: Any
    leaves: frozenset[Symbol]

    def __repr__(self) -> str:
        inside = ", ".join(map(repr, self.arguments))
        return f"{self.operation}({inside})" if self.arguments else f"{self.operation[0]}{self.value}"

    @property
    def is_constant(self) -> bool:
        """True if it depends on parameters only."""
        return all(leaf.operation == "parameter" for leaf in self.leaves)

    def __add__(self, other: Any) -> Symbol:
        return total((self, other))

    __radd__ = __add__

    def __neg__(self) -> Symbol:
        return self * -1.0

    def __sub__(self, other: Any) -> Symbol:
        return total((self, symbol(other) * -1.0))

    def __rsub__(self, other: Any) -> Symbol:
        return total((other, self * -1.0))

    def __mul__(self, other: Any) -> Symbol:
        other = symbol(other)
        for one, factor in ((self, other), (other, self)):
            if one.operation == "number":
                if one.value == 0.0:
                    return ZERO
                if one.value == 1.0:
                    return factor
                if factor.operation == "number":
                    return number(one.value * factor.value)
                if factor.operation == "product" and factor.arguments[0].operation == "number":
                    first, rest = factor.arguments
                    return number(one.value * first.value) * rest
                return _made("product", (one, factor))
        for one, factor in ((self, other), (other, self)):  # numbers come to the front
            if one.operation == "product" and one.arguments[0].operation == "number":
                return one.arguments[0] * (one.arguments[1] * factor)
        return _made("product", (self, other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Symbol:
        other = symbol(other)
        if other.operation == "number":
            return self * (1.0 / other.value)
        return self if self is ZERO else _made("quotient", (self, other))

    def __rtruediv__(self, other: Any) -> Symbol:
        return symbol(other) / self

    def __pow__(self, power: Any) -> Symbol:
        power = symbol(power)
        if power.operation != "number":
            return _made("power", (self, power)) if power.is_constant else exp(power * log(self))
        if self.operation == "number":
            return number(self.value**power.value)
        if power.value == 0.0:
            return ONE
        if power.value < 0.0 and power.value == int(power.value):
            return ONE / self ** (-power.value)
        return {1.0: self, 2.0: self * self}.get(power.value) or _made("power", (self, power))


def _made(operation: str, arguments: tuple[Symbol, ...], value: Any = None) -> Symbol:
    """Return the one symbol of an operation."""
    key = (operation, value, *map(id, arguments))
    found = _KNOWN.get(key)
    if found is None:
        found = Symbol()
        found.operation, found.arguments, found.value = operation, arguments, value
        if operation in ("parameter", "variable", "angle"):
            found.leaves = frozenset((found,))
        else:
            found.leaves = _NONE.union(*(each.leaves for each in arguments))
        found = _KNOWN.setdefault(key, found)  # another thread may have made it meanwhile
    return found


def number(value: float) -> Symbol:
    """Return a number."""
    return _made("number", (), float(value))


def symbol(value: Any) -> Symbol:
    """Return a symbol as it is, a number as a symbol."""
    return value if isinstance(value, Symbol) else number(value)


def parameter(index: int) -> Symbol:
    """Return a run-time parameter."""
    return _made("parameter", (), int(index))


def variable(name: str) -> Symbol:
    """Return a variable."""
    return _made("variable", (), name)


ZERO, ONE = number(0.0), number(1.0)
ANGLE = _made("angle", (), "theta")
"""The angle of the excitation."""


def total(terms: Iterable[Any]) -> Symbol:
    """Return a sum; sums among its terms are taken apart."""
    parts: list[Symbol] = []
    constant = 0.0
    for term in map(symbol, terms):
        for each in term.arguments if term.operation == "sum" else (term,):
            if each.operation == "number":
                constant += each.value
            else:
                parts.append(each)
    if constant or not parts:
        parts.append(number(constant))
    return parts[0] if len(parts) == 1 else _made("sum", tuple(parts))


def _function(name: str, plain: Callable[[float], float]) -> Callable[[Any], Symbol]:
    def apply(argument: Any) -> Symbol:
        given = symbol(argument)
        if given.operation == "number":
            return number(plain(given.value))
        return _made(name, (given,))

    return apply


sin, cos, exp, log, sqrt, tanh = (
    _function(each.__name__, each) for each in (math.sin, math.cos, math.exp, math.log, math.sqrt, math.tanh)
)


def _slope(of: Symbol, by: Callable[[Symbol], Symbol]) -> Symbol:
    """Return the derivative of an operation, from those of its arguments."""
    arguments = of.arguments
    a = arguments[0]
    match of.operation:
        case "sum":
            return total(map(by, arguments))
        case "product":
            b = arguments[1]
            return by(a) * b + a * by(b)
        case "quotient":
            b = arguments[1]
            return (by(a) - of * by(b)) / b
        case "power":
            b = arguments[1]
            grown = b * a ** (b - 1.0) * by(a)
            return grown if by(b) is ZERO else grown + of * log(a) * by(b)
        case "sin":
            return cos(a) * by(a)
        case "cos":
            return sin(a) * by(a) * -1.0
        case "exp":
            return of * by(a)
        case "log":
            return by(a) / a
        case "sqrt":
            return 0.5 * by(a) / of
        case _:  # tanh
            return (1.0 - of * of) * by(a)


def derivative(of: Symbol, leaf: Symbol) -> Symbol:
    """Return the derivative by a variable, a parameter or the angle."""
    known: dict[Symbol, Symbol] = {}

    def by(each: Symbol) -> Symbol:
        if leaf not in each.leaves:
            return ZERO
        if each is leaf:
            return ONE
        found = known.get(each)
        if found is None:
            known[each] = found = _slope(each, by)
        return found

    return by(of)


def changed(of: Symbol, changes: Mapping[Symbol, Symbol]) -> Symbol:
    """Return the change of a function to first order, for changes of some leaves."""
    return total(derivative(of, leaf) * change for leaf, change in changes.items() if leaf in of.leaves)


def replaced(functions: Sequence[Symbol], others: Mapping[Symbol, Any]) -> list[Symbol]:
    """Return functions with other symbols in place of some leaves."""
    known, leaves = {leaf: symbol(other) for leaf, other in others.items()}, frozenset(others)

    def of(each: Symbol) -> Symbol:
        if leaves.isdisjoint(each.leaves):
            return each
        found = known.get(each)
        if found is None:
            known[each] = found = _applied(each.operation, [of(argument) for argument in each.arguments])
        return found

    return [of(function) for function in functions]


def _applied(operation: str, arguments: list[Symbol]) -> Symbol:
    match operation:
        case "sum":
            return total(arguments)
        case "product":
            return arguments[0] * arguments[1]
        case "quotient":
            return arguments[0] / arguments[1]
        case "power":
            return arguments[0] ** arguments[1]
        case _:
            return FUNCTIONS[operation](arguments[0])


def parameters_of(function: Symbol) -> set[int]:
    """Return the indices of the parameters on which a function depends."""
    return {leaf.value for leaf in function.leaves if leaf.operation == "parameter"}


FUNCTIONS: dict[str, Callable[..., Symbol]] = {
    "sin": sin,
    "cos": cos,
    "exp": exp,
    "log": log,
    "sqrt": sqrt,
    "tanh": tanh,
    "pow": lambda base, power: symbol(base) ** power,
}
"""Functions of formulas, of symbols."""
