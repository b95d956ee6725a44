"""The protocol of a force law, and the registry of all of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

from gapwalk.errors import ModelError
from gapwalk.model.laws.closed_form import Stages, StageShape, closed_form_of
from gapwalk.model.parameter import Parameter
from gapwalk.model.registry import Registry
from gapwalk.model.units import QuantityKind

CLEARANCE = Parameter("clearance", QuantityKind.ANGLE, "it is half the width of the gap", least=0.0)
STIFFNESS = Parameter("stiffness", QuantityKind.STIFFNESS, "it is what this spring adds to the slope of the force")
CUBIC = Parameter("cubic", QuantityKind.CUBIC, "it is the coefficient of the cubic term", default=0.0)


class Law(ABC):
    """The force of a contact as a function of its deflection ``x`` and its rate ``v``.

    A law is one class in one file, registered once by `register`. All other code iterates over the registry: the keys
    of model files, names and units of parameters, the compiled flow, NumPy, the kernel of the batch integrator,
    harmonic balance, equilibria, documentation.

    A contact has *stages*. Each acts, on one side or on both, beyond its clearance: its breakpoint is an event of the
    flow, at which its mode changes between open and closed. The mode at the start of a motion is the side of the
    breakpoint on which the deflection is, then the side to which its rate, its acceleration, ... lead.

    Attributes
    ----------
    name
        Its name in a model file: ``law = "viscous"``.
    words
        Description, in a few words.
    parameters
        The parameters of the contact as a whole.
    stage_parameters
        Parameters of each stage; the first is the clearance.
    host
        Name of another contact on whose stages and force it depends, as friction does; empty for none.

    Notes
    -----
    `force` is the only place of the formula. It is written in ``+``, ``-``, ``*`` (products, not powers; a
    sum over the stages by `Stages.total`), so that it can be evaluated with symbolic expressions, with arrays, real or
    complex, and with the `Symbols` from which the closed form is read. All derivatives come from the expression.
    Parameters are best multiplied with a depth or a rate first, and with one another last: to the integrator a product
    of two parameters is a series like any other.

    Where the force is a polynomial of the depth of one stage at a time, and linear in the rate, every backend can carry
    it. Otherwise harmonic balance refuses it by name, and equilibria (``gapwalk modes``) are searched from many
    positions; the flow, the batch integrator (basins, regime maps), shooting, special points, loci, verification and
    files work with it.

    Where the force jumps at a breakpoint, sensitivities are carried over the jump by the general rule of
    `gapwalk.flow.contact_events`; where it does not, nothing is computed.

    Examples
    --------
    A spring with a force that begins at once. A class in a file of its own registers itself for model files by
    ``gw.laws.register(Preloaded())``.

    >>> class Preloaded(gw.laws.Law):
    ...     name, words = "preloaded", "a spring with a preload"
    ...     stage_parameters = (
    ...         gw.laws.CLEARANCE,
    ...         gw.laws.STIFFNESS,
    ...         gw.laws.Parameter("preload", gw.laws.QuantityKind.TORQUE, "it is the force at the breakpoint"),
    ...     )
    ...
    ...     def force(self, rate, stages, numbers):
    ...         return stages.total(s.closed * (s.sign * s["preload"] + s["stiffness"] * s.depth) for s in stages)
    >>> stage = gw.Stage(1.0, 20.0, numbers={"preload": 2.0})
    >>> gw.Contact("stop", {"x": 1.0}, [stage], law=Preloaded()).law.title
    'preloaded'
    """

    name: ClassVar[str]
    words: ClassVar[str]
    host: str = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    stage_parameters: ClassVar[tuple[Parameter, ...]] = (CLEARANCE, STIFFNESS, CUBIC)

    @abstractmethod
    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """Compute the force of the contact.

        Parameters
        ----------
        rate
            Rate of the deflection over time.
        stages
            All stages on each side on which they act.
        numbers
            The parameters of the contact by name.

        Returns
        -------
        number, expression or array
            The force on the positive side of the deflection, of the kind of the arguments.
        """

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """List the errors of values of its parameters (those of the contact as a whole), one sentence each.

        Parameters
        ----------
        numbers
            Values of the parameters by name.
        """
        return iter(())

    def rebound(self, rate: Any, numbers: Mapping[str, Any]) -> Any:
        """Compute the rate of the deflection just after an innermost breakpoint is reached from within: the reset.

        By default the motion continues through the breakpoint, and the stage closes. A law that overrides this reverses
        the rate there, and its stage never closes. The change acts along the contact's force, as an impulse does.

        Parameters
        ----------
        rate
            Rate of the deflection just before.
        numbers
            The parameters of the contact by name.
        """
        return rate

    @property
    def title(self) -> str:
        """Its name, or its formula, for a line of a summary."""
        return self.name

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the deflections on which the force depends; a contact has one."""
        return ("x",)

    def has_stage_parameter(self, name: str) -> bool:
        """Return True if its stages have a parameter of that name.

        Parameters
        ----------
        name
            Name of the parameter, without those of contact and stage.
        """
        return any(each.name == name for each in self.stage_parameters)

    @property
    def mode_count(self) -> int:
        """Number of its modes."""
        return 0

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Sequence[Any]:
        """Compute one number for each mode of the law, which is 1 where that number is positive, and otherwise 0.

        The force must be continuous where a guard vanishes. A guard may depend on earlier modes.

        Parameters
        ----------
        rate
            Rate of the deflection over time.
        stages
            All stages on each side on which they act, with the modes.
        numbers
            The parameters of the contact by name.
        """
        return ()

    @property
    def has_edges(self) -> bool:
        """True if the force has no higher derivatives where a guard vanishes, as fractional powers have none at 0."""
        return False

    @property
    def is_dry(self) -> bool:
        """True for dry friction, whose modes are slip in either direction and stick; see `Friction`."""
        return False

    @property
    def is_formula(self) -> bool:
        """True if it may be any formula of lengths, which is evaluated in the unit of the model."""
        return not self.stage_parameters and not self.is_dry

    @property
    def has_memory(self) -> bool:
        """True if it has a state of its own: the extension of a spring that slips."""
        return False

    @property
    def rebounds(self) -> bool:
        """True if the law has a reset."""
        return type(self).rebound is not Law.rebound

    @property
    def is_damped(self) -> bool:
        """True if the force depends on the rate, or an impact dissipates energy."""
        terms = closed_form_of(self, (StageShape(1, True),))
        return self.rebounds or terms is None or any(term.rate for term in terms)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(type(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"


_KEYS = {"name", "deflection", "force", "law", "side", "stage", "between", "ratio", "damping"}  # of tables

LAWS: Registry[Law] = Registry("force law")
"""All force laws by name, in the order of their registration; `register` adds one."""


FORMULAS: Registry[type[Law]] = Registry("kind of force")
"""Laws that are dataclasses with data of their own, such as a formula or a measured curve; `register_formula` adds."""


def register_formula(kind: type[Law]) -> None:
    """Register a law with data of its own, a frozen dataclass of texts, numbers and tuples, for result files.

    Parameters
    ----------
    kind
        The class of the law.

    Examples
    --------
    >>> gw.laws.register_formula(gw.laws.Expression)  # gapwalk has done so
    """
    FORMULAS.add(kind.name, kind)


def register(law: Law) -> None:
    """Register a force law for model files under its name.

    Parameters
    ----------
    law
        The law.

    Raises
    ------
    ModelError
        If another law has that name, or a parameter has the name of another key of its table.

    Examples
    --------
    >>> class Doubled(gw.laws.Elastic):
    ...     name, words = "doubled", "twice the force of the springs"
    ...
    ...     def force(self, rate, stages, numbers):
    ...         return 2.0 * super().force(rate, stages, numbers)
    >>> gw.laws.register(Doubled())
    """
    whole, of_stages = ([each.name for each in those] for those in (law.parameters, law.stage_parameters))
    others = {*law_parameters("stage_parameters")}
    for name in (*(each for each in of_stages if each in _KEYS), *(each for each in whole if each in _KEYS | others)):
        raise ModelError(f"the force law {law.name!r} has a parameter {name!r}, but that is another key of its table")
    if of_stages[:1] != [CLEARANCE.name]:
        raise ModelError(f"the force law {law.name!r} has the stage parameters {of_stages}; the first is the clearance")
    LAWS.add(law.name, law)


def data_of(law: Law) -> dict[str, Any]:
    """Return the data of a law by the names of its fields; empty for a law without any."""
    return {each.name: getattr(law, each.name) for each in fields(law)} if is_dataclass(law) else {}


def law_of(given: str | Law) -> Law:
    """Return the law with a name, or a law as it is; an `UnknownNameError` if there is none."""
    return given if isinstance(given, Law) else LAWS.named(given)


def law_with(parameters: Collection[str]) -> Law:
    """Return the first law that has parameters of some names: that of a contact which gives them, and names no law."""
    names = sorted({*parameters})
    for law in LAWS.values():
        if {*names} <= {each.name for each in law.parameters}:
            return law
    raise ModelError(f"no force law has {'both' if names[1:] else 'the parameter'} {' and '.join(names)}")


def law_parameters(*which: str) -> dict[str, Parameter]:
    """Return the parameters of all laws by name: the ``"stage_parameters"``, the ``"parameters"``, or both."""
    groups = which or ("stage_parameters", "parameters")
    return {each.name: each for law in LAWS.values() for group in groups for each in getattr(law, group)}


def never_negative() -> set[str]:
    """Return the names of all parameters of force laws that must not be negative."""
    return {name for name, each in law_parameters().items() if each.least is not None}
