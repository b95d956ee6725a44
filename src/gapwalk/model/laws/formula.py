"""A force as a formula of variables and parameters, with the modes of its kinks and the places where it ends."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, NoReturn

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.model.laws.arithmetic import (
    FUNCTIONS,
    KINKS,
    LARGEST_FRACTION,
    LARGEST_POWER,
    Absolute,
    AbsolutePower,
    Call,
    Constant,
    Extreme,
    Guard,
    Name,
    Negative,
    Node,
    Number,
    PositivePower,
    Power,
    Product,
    Sum,
    Values,
    WholePower,
)
from gapwalk.model.laws.law import Law, Stages
from gapwalk.model.problems import near_names
from gapwalk.model.registry import Parameter

# Numbers of formulas that follow from the frequency, or from the mean speed of a train. They are parameters of the
# equations of motion, and an assembly computes them.

PACE, MEAN_SLIP, GROUP_SCALE, MEAN_SPEED = "speed_W", "mean_slip", "drag_scale", "mean_speed_"
STATE_LAG = "state_lag"
"""The lag of coordinates without inertia: see `gapwalk.model.states`."""


def is_computed(parameter: str) -> bool:
    """Return True if a parameter of a contact follows from the frequency or from the speed of a train."""
    last = parameter.rpartition(".")[2]
    return last in (PACE, MEAN_SLIP, GROUP_SCALE, STATE_LAG) or last.startswith(MEAN_SPEED)


NUMPY_FUNCTIONS: dict[str, Callable[..., Any]] = {**{name: getattr(np, name) for name in FUNCTIONS}, "pow": np.power}
"""The functions of formulas for numbers and arrays, real or complex."""


class Edge(NamedTuple):
    """A place of a formula where a function ends: ``sqrt``, ``log`` or a fractional power of something negative."""

    function: str  #: ``"sqrt"``, ``"log"`` or ``"**"``.
    text: str  #: The argument, which must stay positive.
    column: int  #: Column of the formula as it was given, from 1.

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


@dataclass(frozen=True)
class Formula:
    """A force as a function of some variables and parameters; `formula_of` makes it of a text.

    It is equal by content: two texts that differ in spaces and needless parentheses give the same formula.
    """

    text: str  #: The formula written again, in one way only.
    variables: tuple[str, ...]  #: Names of the variables that occur in it, such as ``x``, its rate ``x'`` and ``v``.
    parameters: tuple[str, ...]  #: All other names, in the order of their first appearance.
    #: The places where a function ends at 0, with their columns in the text as it was given.
    edges: tuple[Edge, ...] = field(compare=False)
    _tree: Node = field(compare=False, repr=False)

    def value(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]], modes: Sequence[Any]
    ) -> Any:
        """Evaluate the formula in given modes."""
        return self._tree.at(self._values(environment, functions, modes))

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

    @property
    def mode_count(self) -> int:
        """Number of modes."""
        return len(self._guards)

    @property
    def edge_widths(self) -> tuple[str, ...]:
        """The arguments of all fractional powers of a positive part, for each of which an edge has a width."""
        return tuple(self._edge_numbers)

    def _values(self, environment: Mapping[str, Any], functions: Any, modes: Sequence[Any]) -> Values:
        kinks = dict(zip(self._guards, environment.get(KINKS, ()), strict=False))
        return Values(environment, functions, dict(zip(self._guards, modes, strict=True)), self._edge_numbers, kinks)

    @cached_property
    def _guards(self) -> dict[str, Guard]:
        """The guards by key, in an order in which they can be decided."""
        found: dict[str, Guard] = {}
        for guard in self._tree.guards():
            if guard.node.number is None:
                found.setdefault(guard.key, guard if guard.is_edge else Guard(guard.node, 1))
        return found

    @cached_property
    def _edge_numbers(self) -> dict[str, int]:
        texts = dict.fromkeys(guard.node.text for guard in self._guards.values() if guard.is_edge)
        return {text: index for index, text in enumerate(texts)}


# The closed grammar of force expressions in model files: from a text to a `Formula`, without Python's own parser.
#
#     sum      = product { ("+" | "-") product }
#     product  = sign { ("*" | "/") sign }
#     sign     = ("+" | "-") sign | power
#     power    = operand [ "**" sign ]
#     operand  = number | name | function "(" sum { "," sum } ")" | "(" sum ")"
#
# As in Python, ``**`` binds tighter than a sign on its left, and ``a**b**c`` is ``a**(b**c)``.

LONGEST = 2000  # characters
DEEPEST = 50  # parentheses, signs and exponents inside one another
MOST_NODES = 500
MOST_WORK = 2000  # operations, if powers are written out: (x**100)**100 is refused
MOST_ARGUMENTS = 20

_SWITCHES = ("abs", "min", "max")
ALLOWED = (*FUNCTIONS, *_SWITCHES)
"""The functions of the grammar."""

_SHOWN = 100  # characters of the line that an error shows

_TOKEN = re.compile(
    r"""(?P<space>\s+)
    | (?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
    | (?P<name>[^\W\d]\w*'?)
    | (?P<sign>\*\*|[-+*/(),])""",
    re.VERBOSE,
)

_INSTEAD = {
    "^": "write ** for a power: x**2",
    "|": "write abs(x) for the absolute value of x",
    "=": "a formula is only what would stand on the right of =",
    "<": "a formula compares nothing: write min, max or abs, which switch where their arguments are equal",
    ">": "a formula compares nothing: write min, max or abs, which switch where their arguments are equal",
    "[": "write round parentheses",
    "]": "write round parentheses",
    "{": "write round parentheses",
    "}": "write round parentheses",
    "'": "an apostrophe directly follows the name of a deflection, and means its rate: x'; there is no x''",
    "%": "write a ratio as a plain number: 0.05",
    "√": "write sqrt(x)",
    "²": "write **2",
    "³": "write **3",
    **dict.fromkeys("·×∗⋅•", "write * for a product"),
    **dict.fromkeys("−–—", "write the minus sign of the keyboard: -"),
    **dict.fromkeys("÷∕:", "write / for a quotient"),
    **dict.fromkeys("’′`", "write the straight apostrophe of the keyboard: x'"),
}

_JUMPS = "a force that jumps with the rate is dry friction, which is a [[friction]]; a force that jumps with the "
_JUMPS += "deflection is a preload, which a contact has"
_FUNCTIONS_INSTEAD = {
    **dict.fromkeys(("sign", "sgn", "signum", "step", "heaviside", "copysign"), _JUMPS),
    **dict.fromkeys(("floor", "ceil", "round", "mod", "fmod"), "a formula cannot have a function that jumps"),
    "ln": "write log(x) for the natural logarithm",
    "log10": "write log(x)/log(10)",
    "log2": "write log(x)/log(2)",
    "tan": "write sin(x)/cos(x)",
    "sinh": "write (exp(x) - exp(-x))/2",
    "cosh": "write (exp(x) + exp(-x))/2",
    "pow": "write a**b for pow(a, b)",
    "square": "write x**2",
    "cbrt": "write max(x, 0)**(4/3) for a force beyond a clearance; a cube root has an infinite slope at 0",
    "hypot": "write sqrt(x**2 + y**2 + 1e-12)",
    "fabs": "write abs(x)",
    **dict.fromkeys(("if", "where", "select"), "write min, max or abs, which switch where their arguments are equal"),
}


class FormulaError(ModelError):
    """A text that is no formula.

    Attributes
    ----------
    reason
        The reason in one line, with what to write instead.
    column
        Column in the text, from 1 (in its line, if it has several).

    Examples
    --------
    >>> try:
    ...     gw.force("spring", {"x": 1.0}, "k*x^2", k=1.0)
    ... except gw.laws.FormulaError as error:
    ...     print(error.column, error.reason)
    4 '^' is not part of a formula: write ** for a power: x**2
    """

    def __init__(self, reason: str, text: str, position: int) -> None:
        before = text[:position].split("\n")
        line = text.split("\n")[len(before) - 1] if text else ""
        self.reason, self.column = reason, len(before[-1]) + 1
        where = (
            f"column {self.column}"
            if len(before) == 1 and "\n" not in text
            else (f"line {len(before)}, column {self.column}")
        )
        start = max(0, min(self.column - _SHOWN // 2, len(line) - _SHOWN))
        shown = "".join(each if each.isprintable() else " " for each in line[start : start + _SHOWN])
        super().__init__(f"{reason} ({where})\n    {shown}\n    {' ' * (self.column - 1 - start)}^")

    def __reduce__(self) -> tuple[Callable[..., FormulaError], tuple[object, ...]]:
        return _raised_again, (self.args, self.reason, self.column)


def _raised_again(arguments: tuple[str, ...], reason: str, column: int) -> FormulaError:
    error = FormulaError.__new__(FormulaError, *arguments)
    error.reason, error.column = reason, column
    return error


def formula_of(text: str, variables: Collection[str]) -> Formula:
    """Read a force expression."""
    if not isinstance(text, str):
        raise FormulaError(f'a formula is a text, not {text!r:.60}: write "k*x"', "", 0)
    for name in variables:
        if name.removesuffix("'") in {*ALLOWED, "pi"}:
            raise FormulaError(f"a variable cannot have the name {name!r}, which a formula already knows", text, 0)
    return _Parser(text, frozenset(variables)).formula()


class _Token(NamedTuple):
    kind: str  # "number", "name", "sign", "end"
    text: str
    position: int


class _Parser:
    """Reads one text from left to right; one method for each line of the grammar."""

    def __init__(self, text: str, variables: Collection[str]) -> None:
        self._text, self._variables = text, variables
        if len(text) > LONGEST:
            self._fail(f"a formula has at most {LONGEST} characters, this one has {len(text)}", LONGEST)
        if not text.strip():
            self._fail('the formula is empty: write for example "k*x + c*v"', 0)
        self._tokens = self._split()
        self._index, self._level = 0, 0
        self._edges: list[Edge] = []

    def formula(self) -> Formula:
        """Read the whole text."""
        tree = self._sum()
        if self._next.kind != "end":
            self._stray()
        names = tree.names
        return Formula(
            tree.text,
            tuple(name for name in names if name in self._variables),
            tuple(name for name in names if name not in self._variables),
            tuple(self._edges),
            tree,
        )

    def _split(self) -> list[_Token]:
        tokens, position = [], 0
        while position < len(self._text):
            found = _TOKEN.match(self._text, position)
            if found is None:
                sign = self._text[position]
                hint = _INSTEAD.get(sign, "it consists of numbers, names, + - * / **, parentheses and commas")
                self._fail(f"{sign!r} is not part of a formula: {hint}", position)
            kind = found.lastgroup or ""
            if kind == "name":
                self._check_name(found[0], position)
            if kind != "space":
                tokens.append(_Token(kind, found[0], position))
            position = found.end()
        return [*tokens, _Token("end", "", len(self._text.rstrip()))]

    def _check_name(self, name: str, position: int) -> None:
        plain = name.removesuffix("'")
        for index, letter in enumerate(plain):
            if letter in "²³":
                self._fail(
                    f"{name!r} is not a name: write {plain[:index]}**{2 if letter == '²' else 3}", position + index
                )
        if plain.startswith("_"):
            number = re.search(r"[0-9]+$", self._text[:position])
            digits = f"{number[0]}{plain.replace('_', '')}" if number else ""
            hint = f"write {digits} without underscores" if digits.isdigit() else f"write {plain.strip('_') or 'a'}"
            self._fail(f"a name does not begin with an underscore: {hint}", position)
        if not plain.isidentifier():
            self._fail(f"{name!r} is not a name: a name consists of letters, digits and underscores", position)
        if plain == "π":
            self._fail("write pi", position)

    # ---- the grammar

    def _sum(self) -> Node:
        first = self._product()
        terms = list(first.terms) if isinstance(first, Sum) else [(1, first)]
        position = self._next.position
        while self._next.text in ("+", "-"):
            position = self._next.position
            sign = 1 if self._take().text == "+" else -1
            terms.append((sign, self._product()))
        return self._made(position, Sum, terms) if len(terms) > 1 else first

    def _product(self) -> Node:
        first = self._sign()
        factors = list(first.factors) if isinstance(first, Product) else [(1, first)]
        position = self._next.position
        while self._next.text in ("*", "/"):
            sign = self._take()
            position = sign.position
            if sign.text == "/" and self._next.text == "/":
                self._fail("write / for a quotient; a formula has no whole-number division", sign.position)
            factors.append((1 if sign.text == "*" else -1, self._sign()))
            if sign.text == "/" and factors[-1][1].number == 0.0:
                self._fail("a division by zero", sign.position)
        return self._made(position, Product, factors) if len(factors) > 1 else first

    def _sign(self) -> Node:
        if self._next.text not in ("+", "-"):
            return self._power()
        sign = self._take()
        part = self._deeper(self._sign, sign)
        return self._made(sign.position, Negative, part) if sign.text == "-" else part

    def _power(self) -> Node:
        start = self._next.position
        base = self._operand()
        if self._next.text != "**":
            return base
        sign = self._take()
        return self._raised(base, self._deeper(self._sign, sign), start, sign.position)

    def _operand(self) -> Node:
        token = self._take()
        if token.kind == "number":
            if self._next.kind == "name" or self._next.text == "(":
                self._fail(self._missing_times(token), self._next.position)
            return self._made(token.position, Number, float(token.text))
        if token.kind == "name":
            if self._next.text == "(":
                return self._function(token)
            return self._name(token)
        if token.text == "(":
            part = self._deeper(self._sum, token)
            self._close(token)
            return part
        return self._expected(token)

    def _name(self, token: _Token) -> Node:
        name = token.text
        if name in ALLOWED:
            arguments = "x, 0" if name in ("min", "max") else "x"
            self._fail(f"{name} is a function: write {name}({arguments})", token.position)
        if name in _FUNCTIONS_INSTEAD and self._next.kind in ("name", "number"):
            self._fail(f"there is no function {name}: {_FUNCTIONS_INSTEAD[name]}", token.position)
        if name == "pi":
            return Constant("pi", math.pi)
        if name.endswith("'") and name not in self._variables:
            plain, rates = name[:-1], sorted(each for each in self._variables if each.endswith("'"))
            hint = f"the rates are {', '.join(rates)}" if rates else "this formula has no rates"
            self._fail(f"{name} would be the rate of a deflection {plain}, but there is none: {hint}", token.position)
        return self._made(token.position, Name, name)

    def _function(self, token: _Token) -> Node:
        name, bracket = token.text, self._take()
        if name not in ALLOWED:
            self._unknown(token)
        arguments: list[Node] = []
        if self._next.text != ")":
            arguments.append(self._deeper(self._sum, bracket))
            while self._next.text == ",":
                self._take()
                arguments.append(self._deeper(self._sum, bracket))
        self._close(bracket)
        if name in ("min", "max"):
            if not 2 <= len(arguments) <= MOST_ARGUMENTS:
                words = f"{name} has two to {MOST_ARGUMENTS} arguments, not {len(arguments)}: write {name}(x, 0)"
                self._fail(words, token.position)
            extreme = arguments[0]
            for argument in arguments[1:]:
                extreme = self._made(token.position, Extreme, name, extreme, argument)
            return extreme
        if len(arguments) != 1:
            self._fail(f"{name} has one argument, not {len(arguments)}: write {name}(x)", token.position)
        (argument,) = arguments
        if name == "abs":
            return self._made(token.position, Absolute, argument)
        if name in ("sqrt", "log"):
            self._check_edge(name, argument, token.position)
        return self._made(token.position, Call, name, argument)

    # ---- powers, and functions that end at 0

    def _check_edge(self, name: str, argument: Node, position: int) -> None:
        """Refuse a function at the end of its range; note the place of any other."""
        if argument.number is not None:
            return
        if isinstance(argument, Absolute) or _positive_part(argument) is not None:
            what = "slope" if name == "sqrt" else "value"
            self._fail(
                f"{name}({argument.text}) has an infinite {what} where its argument becomes 0: add a small number, as "
                f"in {name}({argument.text} + 1e-6), or write a power above 1, as in max(x, 0)**1.5",
                position,
            )
        self._check_even(argument, position)
        self._edges.append(Edge(name, argument.text, position + 1))

    def _check_even(self, base: Node, position: int) -> None:
        """Refuse a kink that would be no event: the root of a square is an absolute value."""
        if isinstance(base, WholePower) and base.power % 2 == 0:
            words = f"{base.text} touches 0, where its root has a kink and its logarithm is infinite"
            instead = (
                f"write abs({base.parts[0].text}) for the root of a square, or add a small number: {base.text} + 1e-6"
            )
            self._fail(f"{words}: {instead}", position)

    def _raised(self, base: Node, exponent: Node, start: int, position: int) -> Node:
        """Make a power: a product, a power of a positive part, or any other."""
        number = exponent.number
        positive = None if base.number is not None else _positive_part(base)
        sharp = base.number is None and (positive is not None or isinstance(base, Absolute))
        if sharp and (number is None or (number < 1.0 and number != 0.0)):
            if number is None:
                why = f"the exponent {exponent.text} must be a number, because it decides how the force begins"
            else:
                why = f"it has an infinite {'slope' if number > 0.0 else 'value'} where its base becomes 0"
            self._fail(f"{base.text}**{exponent.within(3)}: {why}; write a number above 1: {base.text}**1.5", position)
        if number is not None and number == round(number):
            if abs(number) > LARGEST_POWER:
                self._fail(f"a whole exponent is at most {LARGEST_POWER}, not {exponent.text}", position)
            return self._made(position, WholePower, base, exponent, int(number))
        if sharp and abs(number or 0.0) > LARGEST_FRACTION:
            words = f"a fractional exponent of {base.text} is at most {LARGEST_FRACTION}, not {exponent.text}"
            self._fail(f"{words}: write a whole number", position)
        if positive is not None:
            return self._made(position, PositivePower, positive, exponent)
        if sharp:
            return self._made(position, AbsolutePower, base.parts[0], exponent)
        if isinstance(base, Extreme) and base.function == "min" and any(each.number == 0.0 for each in base.parts):
            part = next(each for each in base.parts if each.number != 0.0)
            instead = f"-max(-{part.within(3)}, 0)**{exponent.within(3)}"
            self._fail(f"{base.text} is never positive, and has no such power: write {instead}", position)
        if base.number is None:
            self._check_even(base, position)
            self._edges.append(Edge("**", base.text, start + 1))
        elif base.number <= 0.0 and number is None:
            self._fail(f"{base.text}**{exponent.within(3)}: the base must be positive", position)
        return self._made(position, Power, base, exponent)

    def _made(self, position: int, kind: Callable[..., Node], *arguments: object) -> Node:
        """Make a node, unless the formula becomes too large, or a number cannot be computed."""
        try:
            node = kind(*arguments)
        except (ArithmeticError, ValueError) as error:
            self._fail(f"this number cannot be computed: {error}", position)
        if node.size > MOST_NODES:
            self._fail(f"a formula has at most {MOST_NODES} numbers, names and operations", position)
        if node.depth > 2 * DEEPEST:
            self._fail(f"at most {2 * DEEPEST} operations stand inside one another", position)
        if node.work > MOST_WORK:
            words = f"written out without powers, a formula has at most {MOST_WORK} operations: use smaller exponents"
            self._fail(words, position)
        return node

    # ---- tokens and errors

    @property
    def _next(self) -> _Token:
        return self._tokens[self._index]

    def _take(self) -> _Token:
        token = self._next
        self._index = min(self._index + 1, len(self._tokens) - 1)
        return token

    def _deeper(self, rule: Callable[[], Node], token: _Token) -> Node:
        self._level += 1
        if self._level > DEEPEST:
            self._fail(f"at most {DEEPEST} parentheses, signs and exponents stand inside one another", token.position)
        part = rule()
        self._level -= 1
        return part

    def _close(self, bracket: _Token) -> None:
        if self._next.text == ")":
            self._take()
        elif self._next.kind == "end":
            self._fail("this parenthesis is never closed: write ) where it ends", bracket.position)
        else:
            self._stray()

    def _missing_times(self, before: _Token) -> str:
        after = self._next
        if re.fullmatch("[eE]", after.text) and before.kind == "number":
            return f"a power of ten needs digits, or an operation is missing: write {before.text}e3 or {before.text}*e"
        shown = "(...)" if after.text == "(" else after.text
        return f"an operation is missing: write {before.text}*{shown}"

    def _stray(self) -> NoReturn:
        """Refuse a token after a complete operand."""
        token, before = self._next, self._tokens[self._index - 1]
        if token.text == ")":
            self._fail("this parenthesis was never opened: leave it out, or write ( where it begins", token.position)
        if token.text == ",":
            follows = self._tokens[self._index + 1]
            hint = "only min and max have several arguments, separated by commas"
            if before.kind == follows.kind == "number":
                hint = f"write a decimal point: {before.text}.{follows.text}"
            self._fail(f"a comma does not belong here: {hint}", token.position)
        if before.kind == "name" and before.text in ("if", "and", "or", "not", "else"):
            self._fail(f"{before.text}: {_FUNCTIONS_INSTEAD['if']}", before.position)
        if token.text in ("if", "and", "or", "not", "else"):
            self._fail(f"{token.text}: {_FUNCTIONS_INSTEAD['if']}", token.position)
        shown = _Token(before.kind, "(...)" if before.text == ")" else before.text, before.position)
        self._fail(self._missing_times(shown), token.position)

    def _expected(self, token: _Token) -> NoReturn:
        """Refuse a token where an operand must stand."""
        what = "the formula ends" if token.kind == "end" else f"there is {token.text!r}"
        if token.text == "**" or (token.text == "*" and self._next.text == "*"):
            what += ", which needs a number or a name on its left"
        self._fail(f"{what} where a number, a name or a parenthesis must stand", token.position)

    def _unknown(self, token: _Token) -> NoReturn:
        name = token.text
        known = {*self._variables, "pi"}
        if name in known or name.endswith("'"):
            self._fail(f"{name} is not a function: write {name}*(...)", token.position)
        if name.casefold() in _FUNCTIONS_INSTEAD:
            self._fail(f"there is no function {name}: {_FUNCTIONS_INSTEAD[name.casefold()]}", token.position)
        near = near_names(name, ALLOWED)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        words = f"there is no function {name}: {hint}The functions are {', '.join(ALLOWED)}"
        self._fail(f"{words}; for a product write {name}*(...)", token.position)

    def _fail(self, words: str, position: int) -> NoReturn:
        raise FormulaError(words, self._text, position)


def _positive_part(part: Node) -> Node | None:
    """Return ``u`` of ``max(u, 0)`` or ``max(0, u)``; None if the part is another one."""
    if not isinstance(part, Extreme) or part.function != "max":
        return None
    first, second = part.parts
    if second.number == 0.0:
        return first
    return second if first.number == 0.0 else None


# A force given as a formula of deflections and their rates, as it stands in a model file.


_NEGATIVE = 1e-12  # a limit that is 0 is allowed


@dataclass(frozen=True, eq=False)
class Expression(Law):
    """The force of a formula, such as ``k*x + a*x**3 - mu*(1 - x**2)*v``; its grammar is that of `formula_of`.

    It has no stages. Where ``abs``, ``min`` or ``max`` switches, a mode of the law changes, which is an event of the
    flow.

    Raises
    ------
    FormulaError
        If the text is no formula.
    ModelError
        If a deflection has no name that a formula can use, or does not occur in the formula.

    Examples
    --------
    >>> [each.name for each in gw.laws.Expression("k*x + c*v*abs(v)").parameters]
    ['k', 'c']
    >>> gw.laws.Expression("k*(x*y**2)", ("x", "y")) == gw.laws.Expression("k * (x * y ** 2)", ("x", "y"))
    True
    """

    #: The formula. ``x'`` is the rate of the deflection ``x``; all names that are no deflections are parameters.
    text: str
    #: Names of the deflections. A single deflection with the name ``x`` has the rate ``v`` too.
    variables: tuple[str, ...] = ("x",)
    #: True for the limit of a friction, which has one more mode: it is 1 while the limit is not negative. A motion on
    #: which the limit becomes negative is refused.
    is_limit: bool = False

    name, words = "expression", "a formula of deflections and their rates"
    stage_parameters = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "variables", tuple(self.variables))
        for name in self.variables:
            if not name.isidentifier() or name.startswith("_") or name in {*ALLOWED, "pi"}:
                raise ModelError(
                    f"a deflection cannot have the name {name!r} in a formula: a name consists of letters, digits and "
                    f"underscores, begins with a letter, and is none of {', '.join(ALLOWED)} and pi; write x"
                )
        if not self.variables or len({*self.variables}) < len(self.variables):
            raise ModelError(f"a formula has one or more deflections of different names, not {self.variables}")
        used = {name.removesuffix("'") for name in self.formula.variables}
        used |= {"x"} if "v" in used and "v" not in self.variables else set()
        for name in self.variables:
            if name not in used:
                raise ModelError(
                    f"the formula {self.text!r} depends neither on the deflection {name} nor on its rate {name}': "
                    f"write {name} where you mean it, or leave the deflection out"
                )

    @cached_property
    def formula(self) -> Formula:
        """The formula, read from the text."""
        names = [*self.variables, *(f"{name}'" for name in self.variables)]
        return formula_of(self.text, [*names, "v"] if self.variables == ("x",) else names)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The parameters of the formula, in the order of their first appearance; each is required."""
        words = f"it is a parameter of the formula {self.formula.text}"
        return tuple(Parameter(name, None, words) for name in self.formula.parameters)

    @property
    def arguments(self) -> tuple[str, ...]:
        """See `Law.arguments`."""
        return self.variables

    @property
    def title(self) -> str:
        """See `Law.title`; with the names that users know."""
        text = self.formula.text.replace(f"x' + {MEAN_SLIP}", "s").replace("(s)", "s").replace(GROUP_SCALE, "drag")
        text = re.sub(rf" - \(\w+ \+ {STATE_LAG}\*\w+'\)/{STATE_LAG}$", "", text)  # of the rate of a state
        text = re.sub(rf"(?<!\w)\((\w+) \+ {STATE_LAG}\*\w+'\)|(\w+) \+ {STATE_LAG}\*\w+'", r"\1\2", text)
        text = re.sub(rf"\({math.radians(1.0)!r}\*([\w']+)\)", r"\1", text)  # in units per radian, as it was written
        return re.sub(rf"\b{PACE}\b", "W", text)

    def with_frequency(self, name: str) -> Expression:
        """Return the formula with the frequency of the excitation in place of one of its parameters."""
        if name not in self.formula.parameters:
            return self
        return replace(self, text=re.sub(rf"(?<![\w.]){name}(?![\w'])", PACE, self.text))

    @property
    def mode_count(self) -> int:
        """See `Law.mode_count`."""
        return self.formula.mode_count + self.is_limit

    @property
    def has_edges(self) -> bool:
        """See `Law.has_edges`."""
        return bool(self.formula.edge_widths)

    @property
    def is_damped(self) -> bool:
        """True if a rate occurs in the formula."""
        return any(name not in self.variables for name in self.formula.variables)

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`; the deflections, modes and functions are those of `stages`."""
        modes = stages.modes[: self.formula.mode_count]
        return self.formula.value(self.environment(stages, numbers), stages.functions, modes)

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> list[Any]:
        """See `Law.guards`."""
        modes = stages.modes[: self.formula.mode_count]
        found = self.formula.guards(self.environment(stages, numbers), stages.functions, modes)
        return [*found, self.force(rate, stages, numbers) + _NEGATIVE] if self.is_limit else found

    def environment(self, stages: Stages, numbers: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of the names of the formula.

        Parameters
        ----------
        stages
            Its ``deflections`` give the deflection and its rate for each variable.
        numbers
            The parameters by name, and perhaps ``"_edge"`` and ``"_kinks"`` as in `Formula.value`.
        """
        found = dict(numbers)
        for name in self.variables:
            found[name], found[f"{name}'"] = stages.deflections[name]
        if self.variables == ("x",):
            found["v"] = found["x'"]
        return found

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and self._key == other._key

    def __hash__(self) -> int:
        return hash((Expression, *self._key))

    @property
    def _key(self) -> tuple[Formula, tuple[str, ...], bool]:
        return self.formula, self.variables, self.is_limit

    def __repr__(self) -> str:
        return f"Expression({self.text!r}, {self.variables!r})"
