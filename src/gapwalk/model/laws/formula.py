"""A force as a formula of variables and parameters, with the modes of its kinks and the places where it ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gapwalk.model.laws.arithmetic import FUNCTIONS, KINKS, Guard, Node, Values

NUMPY_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in FUNCTIONS},
    "pow": np.power,
}
"""The functions of formulas for numbers and arrays, real or complex."""


class Edge(NamedTuple):
    """A place of a formula where a function ends: ``sqrt``, ``log`` or a fractional power of something negative.

    Examples
    --------
    >>> law = gw.force("orifice", {"x": 1.0}, "c*sqrt(x + h)", c=1.0, h=2.0).law
    >>> [edge.function for edge in law.formula.edges]
    ['sqrt']
    """

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

    Examples
    --------
    >>> law = gw.force("spring", {"x": 1.0}, "k*max(x - gap, 0)**2 + c*v", k=8.0, gap=0.25, c=1.0).law
    >>> law.formula.parameters
    ('k', 'gap', 'c')
    """

    text: str  #: The formula written again, in one way only.
    variables: tuple[str, ...]  #: Names of the variables that occur in it, such as ``x``, its rate ``x'`` and ``v``.
    parameters: tuple[str, ...]  #: All other names, in the order of their first appearance.
    #: The places where a function ends at 0, with their columns in the text as it was given.
    edges: tuple[Edge, ...] = field(compare=False)
    _tree: Node = field(compare=False, repr=False)
    _edge_nodes: tuple[Node, ...] = field(compare=False, repr=False, default=())

    def value(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]], modes: Sequence[Any]
    ) -> Any:
        """Evaluate the formula in given modes.

        Parameters
        ----------
        environment
            The variables and parameters by name: numbers, arrays, symbols, anything with ``+ - * /``. Under the key
            ``"_edge"`` the width of the edges of fractional powers, in the unit of what stands in ``max(..., 0)``:
            one for all, or a tuple in the order of `edge_widths`. Without it they are exact, and not smooth. Under the
            key ``"_kinks"`` the error of sampled values of ``max(u, 0)`` at the kink of each mode, or None.
        functions
            ``sin cos exp log sqrt tanh`` of one argument, and ``pow(base, exponent)``.
        modes
            One number 1 or 0, an array of them, or a symbol, for each mode.
        """
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

    def edge_values(
        self, environment: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]], modes: Sequence[Any]
    ) -> list[Any]:
        """Evaluate the argument of each of the `edges`, which must be positive. Parameters as in `value`."""
        values = self._values(environment, functions, modes)
        return [node.at(values) for node in self._edge_nodes]

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
