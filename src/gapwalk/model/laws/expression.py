"""A force given as a formula of deflections and their rates, as it stands in a model file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.laws.closed_form import Stages
from gapwalk.model.laws.formula import Formula
from gapwalk.model.laws.grammar import ALLOWED, formula_of
from gapwalk.model.laws.law import Law
from gapwalk.model.parameter import Parameter


@dataclass(frozen=True, eq=False)
class Expression(Law):
    """The force of a formula, such as ``k*x + a*x**3 - mu*(1 - x**2)*v``; its grammar is that of `formula_of`.

    It has no stages. It switches where ``abs``, ``min`` or ``max`` do: each of these modes is an event of the flow.

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
        """See `Law.title`."""
        return self.formula.text

    @property
    def mode_count(self) -> int:
        """See `Law.mode_count`."""
        return self.formula.mode_count

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
        return self.formula.value(self.environment(stages, numbers), stages.functions, stages.modes)

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> list[Any]:
        """See `Law.guards`."""
        return self.formula.guards(self.environment(stages, numbers), stages.functions, stages.modes)

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
        return isinstance(other, Expression) and (self.formula, self.variables) == (other.formula, other.variables)

    def __hash__(self) -> int:
        return hash((Expression, self.formula, self.variables))

    def __repr__(self) -> str:
        return f"Expression({self.text!r}, {self.variables!r})"
