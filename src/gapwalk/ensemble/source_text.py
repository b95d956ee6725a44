"""Source text by arithmetic: terms with ``+ - * /`` and functions write the lines of a kernel that compute them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


class Sheet:
    """Lines of source text, one for each operation; an operation that occurs twice is written once."""

    def __init__(self, prefix: str = "e") -> None:
        self._prefix = prefix
        self._names: dict[str, str] = {}
        self._needs: dict[str, tuple[str, list[str]]] = {}  # text of each name, and the names in it

    def name(self, text: str) -> Term:
        """Make a term of a name that the kernel knows already."""
        return Term(self, text)

    def write(self, pattern: str, *parts: Any) -> Term:
        """Write an operation: its text with ``{}`` for each part, a term or a number."""
        texts = [each.text if isinstance(each, Term) else _number(each) for each in parts]
        text = pattern.format(*texts)
        if text not in self._names:
            name = f"{self._prefix}{len(self._names)}"
            self._names[text] = name
            self._needs[name] = text, texts
        return Term(self, self._names[text])

    def lines(self, *results: Any) -> list[str]:
        """Return the lines on which some terms depend, in the order in which they were written."""
        needed, open_ = set(), [each.text for each in results if isinstance(each, Term)]
        while open_:
            name = open_.pop()
            if name in self._needs and name not in needed:
                needed.add(name)
                open_ += self._needs[name][1]
        return [f"{name} = {text}" for name, (text, _) in self._needs.items() if name in needed]


class Term:
    """A number that the kernel knows under a name."""

    __slots__ = ("sheet", "text")

    def __init__(self, sheet: Sheet, text: str) -> None:
        self.sheet, self.text = sheet, text

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.sheet.write("{} + {}", self, other)

    def __radd__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.sheet.write("{} + {}", other, self)

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.sheet.write("{} - {}", self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0.0) else self.sheet.write("{} - {}", other, self)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Switch):
            return other * self
        if _is(other, 0.0):
            return 0.0
        return self if _is(other, 1.0) else self.sheet.write("{} * {}", self, other)

    def __rmul__(self, other: Any) -> Any:
        return self * other

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1.0) else self.sheet.write("{} / {}", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.sheet.write("{} / {}", other, self)

    def __neg__(self) -> Any:
        return self.sheet.write("-{}", self)


class Switch(Term):
    """A mode, 1 where a term is positive and otherwise 0; it selects, so what it switches off may be infinite."""

    __slots__ = ("condition", "opposite")

    def __init__(self, sheet: Sheet, condition: str, opposite: str) -> None:
        super().__init__(sheet, sheet.write("1.0 if {} else 0.0", Term(sheet, condition)).text)
        self.condition, self.opposite = condition, opposite

    @classmethod
    def of(cls, guard: Any) -> Any:
        """Make the mode of a guard, a term or a number."""
        if not isinstance(guard, Term):
            return 1.0 if guard > 0.0 else 0.0
        condition = guard.sheet.write("{} > 0.0", guard).text
        return cls(guard.sheet, condition, guard.sheet.write("not {}", Term(guard.sheet, condition)).text)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        if _is(other, 1.0):
            return self
        return self.sheet.write("{} if {} else 0.0", other, Term(self.sheet, self.condition))

    def __rsub__(self, other: Any) -> Any:
        return Switch(self.sheet, self.opposite, self.condition) if _is(other, 1.0) else super().__rsub__(other)


def _is(value: Any, number: float) -> bool:
    return isinstance(value, int | float) and value == number


def _number(value: Any) -> str:
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def least(one: Any, other: Any) -> Any:
    """Return the smaller of a term and a term or a number."""
    return one.sheet.write("min({}, {})", one, other)


def greatest(one: Any, other: Any) -> Any:
    """Return the larger of a term and a term or a number."""
    return one.sheet.write("max({}, {})", one, other)


def size(term: Any) -> Any:
    """Return the absolute value of a term."""
    return term.sheet.write("abs({})", term)


def clipped(term: Any) -> Any:
    """Return a term between 0 and 1."""
    return least(greatest(term, 0.0), 1.0)


def either(condition: Term, one: Any, other: Any) -> Any:
    """Return one of two terms or numbers: the first where a condition holds."""
    return condition.sheet.write("{} if {} else {}", one, condition, other)


def bump(guard: Any, width: Any) -> Any:
    """Write the error of ``max(guard, 0)`` next to its kink, if the guard changes by `width` in a step."""
    away = least(size(guard) / width, 1.0)
    return width * (1.0 / 12.0) * ((1.0 - away) * (1.0 - 3.0 * away))


def floor(term: Any) -> Any:
    """Return the largest whole number below a term."""
    return term.sheet.write("np.floor({})", term)


def _function(name: str) -> Callable[..., Any]:
    def apply(*arguments: Any) -> Any:
        sheet = next((each.sheet for each in arguments if isinstance(each, Term)), None)
        if sheet is None:
            return float(getattr(np, name)(*arguments))
        return sheet.write(f"np.{name}({', '.join('{}' for _ in arguments)})", *arguments)

    return apply


def _power(base: Any, exponent: Any) -> Any:
    """Raise to a power; half of an odd number by a root, for which the processor has an instruction."""
    if isinstance(base, Term) and not isinstance(exponent, Term) and exponent in _HALVES:
        product = FUNCTIONS["sqrt"](base)
        for _ in range(int(exponent)):
            product = product * base
        return product
    return _function("power")(base, exponent)


_HALVES = (0.5, 1.5, 2.5, 3.5)

FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: _function(name) for name in ("sin", "cos", "exp", "log", "sqrt", "tanh")},
    "pow": _power,
}
"""The functions of formulas, of terms."""
