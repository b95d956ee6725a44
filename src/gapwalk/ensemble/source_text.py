"""Source text by arithmetic: terms with ``+ - * /`` and functions write the lines of a kernel that compute them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.forces import Angles
from gapwalk.model.coefficients import CoefficientLayout, CycleSlots, Wave


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


# Variations over the angle in a kernel: the table of the excitation step by step, and the lines that read it.
#
# If all lanes have the same coefficients, the table holds the loads, the displacements and the variations of numbers
# themselves. Otherwise it holds cosines and sines, which each lane multiplies by its own coefficients.
#
# Method: docs/numerics/batch-integrator.md

_Key = tuple[Any, ...]


class Excitation:
    """Writer of the terms that read the table ``T``, and the columns of it that they need.

    Shapes: `loaded` (2n,), bool.
    """

    def __init__(
        self,
        layout: CoefficientLayout,
        shared: bool,
        loaded: NDArray[np.bool_],
        name: Callable[[int], str],
        active: Callable[[int], bool],
    ) -> None:
        self._layout, self._shared, self._loaded, self._name, self._active = layout, shared, loaded, name, active
        self._first = int(loaded.sum()) if shared else 1 + 2 * len(layout.orders)
        self._keys: dict[_Key, tuple[int, Any]] = {}

    @property
    def columns(self) -> int:
        """Numbers per step; known when all lines are written."""
        return self._first + len(self._keys)

    def load(self, component: int) -> str:
        """Name the load on a component of the state over a step; for shared coefficients."""
        return f"t{int(self._loaded[:component].sum())}"

    def sway(self, sheet: Sheet, contact: int, argument: int, derivative: int = 0, *, start: bool = False) -> Any:
        """Write the displacement of a deflection, or its rate over time, at the end (or start) of a step; else 0."""
        slots = self._layout.contacts[contact]
        wave = slots.waves.get(slots.form.law.arguments[argument])
        if wave is None:
            return 0.0
        if self._shared:
            return self._column(sheet, ("sway", contact, argument, derivative, start), (slots, argument))
        lines = self._lines(sheet, wave, derivative, start)
        return lines / sheet.name(self._name(0)) if derivative and isinstance(lines, Term) else lines

    def varied(self, sheet: Sheet, slot: int, wave: Wave) -> Term:
        """Write a coefficient that varies, at the end of a step."""
        if self._shared:
            part: Any = self._column(sheet, ("wave", slot), wave)
        else:
            part = self._lines(sheet, wave, 0, False)
            for number, factor in wave.cycles:
                part = part + factor * self._level(sheet, self._layout.cycles[number])
        return sheet.name(self._name(slot)) * (1.0 + part)

    def table(self, coefficients: NDArray[np.float64], loads: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
        """Compute the table over one forcing period, shape (steps, columns).

        Shapes: `loads` (2n, 1 + 2 orders).
        """
        theta = 2.0 * np.pi * np.arange(steps) / steps
        after = 2.0 * np.pi * np.arange(1, steps + 1) / steps
        angles = np.multiply.outer(theta, np.array(self._layout.orders, dtype=float))
        basis = np.ones((steps, 1 + 2 * angles.shape[1]))
        basis[:, 1::2], basis[:, 2::2] = np.cos(angles), np.sin(angles)
        if self._shared:
            basis = basis @ loads[self._loaded].T
        if not self._keys:
            return basis
        levels: list[Any] = [share_at(coefficients, cycle, after, steps) for cycle in self._layout.cycles]
        start, end = (Angles(self._layout, coefficients, each, levels) for each in (theta, after))
        columns = [basis]
        for (kind, *rest), (_, what) in self._keys.items():
            if kind == "sway":
                (slots, argument), (*_, derivative, at_start) = what, rest
                column = (start if at_start else end).sway(slots, argument, derivative)
            elif kind == "wave":
                column = end.wave(what)
            elif kind == "angle":
                column = after
            elif kind == "steps":
                column = np.full(steps, steps / (2.0 * np.pi))
            else:
                column = end.waves[:, what]
            columns.append(np.broadcast_to(column, steps)[:, None])
        return np.hstack(columns)

    def _column(self, sheet: Sheet, key: _Key, what: Any = None) -> Term:
        place, _ = self._keys.setdefault(key, (self._first + len(self._keys), what))
        return sheet.name(f"t{place}")

    def _lines(self, sheet: Sheet, wave: Wave, derivative: int, start: bool) -> Any:
        """Write a sum of cosines and sines of all orders, or its derivative by theta."""
        total, count = 0.0, len(self._layout.orders)
        for place, slot in enumerate(wave.lines.tolist()):
            if not self._active(slot):
                continue
            order, is_sine = place % count, place >= count
            factor = 1.0 if not derivative else float(self._layout.orders[order]) * (1.0 if is_sine else -1.0)
            other = is_sine is not bool(derivative)  # a derivative swaps cosines and sines
            if start:
                column = sheet.name(f"t{1 + 2 * order + other}")
            else:
                column = self._column(sheet, ("line", order, other), order + count * other)
            total = total + factor * (sheet.name(self._name(slot)) * column)
        return total

    def _level(self, sheet: Sheet, cycle: CycleSlots) -> Term:
        theta, scale = self._column(sheet, ("angle",)), self._column(sheet, ("steps",))
        low, high, up, down = (sheet.name(self._name(slot)) for slot in cycle[1:])
        return low + (high - low) * _share(theta, up, down, cycle.order, scale, floor, clipped)


def share_at(
    coefficients: NDArray[np.float64], cycle: CycleSlots, theta: NDArray[np.float64] | float, steps: int
) -> NDArray[np.float64]:
    """Return the share of the higher level in samples at some angles, so that their sums are those of the jumps.

    Shapes: `coefficients` (..., number of coefficients).
    """
    up, down = coefficients[..., cycle.up], coefficients[..., cycle.down]
    return _share(theta, up, down, cycle.order, steps / (2.0 * np.pi), np.floor, lambda t: np.clip(t, 0.0, 1.0))


def _share(theta: Any, up: Any, down: Any, order: int, scale: Any, floor: Callable, clip: Callable) -> Any:
    """Return the share of the higher level; `scale` is the number of steps per radian."""
    length, half = 2.0 * np.pi / order, (down - up) * 0.5
    turned = theta - (up + half)  # from the middle of the higher level
    turned = turned - length * floor(turned * (1.0 / length) + 0.5)
    rising, falling, cycle = (turned + half) * scale, (turned - half) * scale, length * scale
    return (
        (smooth_step(rising, clip) - smooth_step(falling, clip))
        + smooth_step(rising - cycle, clip)
        + (1.0 - smooth_step(falling + cycle, clip))
    )


def smooth_step(t: Any, clip: Callable[[Any], Any]) -> Any:
    """Return samples of a jump at 0; `t` is the distance from it in steps.

    Their sums with a smooth function are those of its integral from the jump on, up to an error of third order: the
    derivative of this function reproduces linear functions by its values a step apart, and its second moment is 0. It
    is the integral ``Q`` of the hat function, less a twelfth of the second difference of ``Q``.
    """
    after, at, before, last = clip(t + 2.0), clip(t + 1.0), clip(t), clip(t - 1.0)
    middle = 0.5 * (at * at) + (before - 0.5 * (before * before))
    sides = 0.5 * (after * after) + (at - 0.5 * (at * at)) + 0.5 * (before * before) + (last - 0.5 * (last * last))
    return middle * (7.0 / 6.0) - sides * (1.0 / 12.0)
