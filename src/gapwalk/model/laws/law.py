"""The protocol of a force law, and the registry of all of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, legendre

from gapwalk.errors import ModelError
from gapwalk.model.registry import Parameter, Registry
from gapwalk.model.units import QuantityKind

# The arguments of a formula of a force law, and its closed form: a sum of products, read from the formula.
#
# The closed form is what harmonic balance and equilibria need, and what makes the batch integrator fast: where the
# force is a polynomial of the depth of one stage at a time, its spectrum, its integral and the error that its kinks
# leave are known exactly.


@dataclass(frozen=True, slots=True)
class StageTerms:
    """A stage on one side as a formula sees it; its parameters are ``stage["stiffness"]`` and so on."""

    sign: int  #: The side: +1 or -1.
    #: Deflection past the breakpoint, ``x - sign * clearance``: positive beyond it on the positive side, negative
    #: beyond it on the negative side.
    depth: Any
    closed: Any  #: The mode: 1 while the deflection is beyond the breakpoint, otherwise 0.
    innermost: bool  #: True for the first stage on its side.
    numbers: Mapping[str, Any] = field(hash=False)  #: Its parameters by name.
    #: The mode of the breakpoint itself, in a gap that keeps its state whatever that is; None: it is `closed`.
    own: Any = None

    @property
    def touching(self) -> Any:
        """The mode for damping that grows with the depth: 0 beyond the breakpoint of a stage that is kept closed."""
        return self.closed if self.own is None else self.own

    def __getitem__(self, name: str) -> Any:
        return self.numbers[name]


class Host(NamedTuple):
    """Another contact on which a formula depends: its stages, and its force."""

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

        The modes are still of the kind of the backend: numbers, arrays or expressions. Damping that grows with the
        depth would feed energy in where the spring pulls; it acts only while the stage is `touching`.
        """
        found = copy(self)
        found._stages = tuple(
            replace(each, closed=0.0 * each.closed + is_own, own=is_own * each.closed)
            if not (is_own := float(each.sign == side)) or each.innermost
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


class _NoFunctions(dict[str, Any]):
    """Functions of which a closed form has none."""

    def __missing__(self, name: str) -> Any:
        raise TypeError(f"{name} is no sum of products")


@lru_cache(maxsize=256)
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
        raise ValueError("a term of the force depends on two stages; write the force as a sum over its stages")
    return Term(
        factor,
        tuple(symbol[1] for symbol in product if symbol[0] == _NUMBER),
        tuple(symbol[2] for symbol in of_stages if symbol[0] == _STAGE_NUMBER),
        stage,
        sum(symbol[0] == _DEPTH for symbol in product),
        sum(symbol[0] == _RATE for symbol in product),
    )


CLEARANCE = Parameter("clearance", QuantityKind.ANGLE, "it is half the width of the gap", least=0.0)
STIFFNESS = Parameter("stiffness", QuantityKind.STIFFNESS, "it is what this spring adds to the slope of the force")
CUBIC = Parameter("cubic", QuantityKind.CUBIC, "it is the coefficient of the cubic term", default=0.0)


class Law(ABC):
    """The force of a contact as a function of its deflection ``x`` and its rate ``v``.

    A law is one class in one file, registered once by `register`. A new law needs no other code.

    A contact has *stages*. Each acts, on one side or on both, beyond its clearance: its breakpoint is an event of the
    flow, at which its mode changes between open and closed. At the start of a motion the side of the breakpoint on
    which the deflection lies decides on the mode; exactly on the breakpoint the sign of the rate decides, then that of
    the acceleration, and so on.

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
    The formula stands only in `force`. It is written in ``+``, ``-``, ``*`` (products, not powers; a sum over the
    stages by `Stages.total`), so that it can be evaluated with symbolic expressions, with arrays, real or complex, and
    with the `Symbols` from which the closed form is read. All derivatives come from the expression. For speed, multiply
    each parameter with a depth or a rate first, and parameters with one another last.

    Where the force is a polynomial of the depth of one stage at a time, and linear in the rate, every method can
    include it. Otherwise harmonic balance refuses it by name, and equilibria (``gapwalk modes``) are searched from many
    positions; all other methods can include it, too.

    Where the force jumps at a breakpoint, sensitivities are carried over the jump by the general rule of
    `gapwalk.flow.contact_events`; where it does not, no correction is needed.

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
            The force on the positive side of the deflection, of the type of the arguments.
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
            Name of the parameter, without the names of contact and stage before it.
        """
        return any(each.name == name for each in self.stage_parameters)

    @property
    def mode_count(self) -> int:
        """Number of its modes."""
        return 0

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Sequence[Any]:
        """Compute one number for each mode of the law: the mode is 1 where its number is positive, and otherwise 0.

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
        """True if its formula may depend on the unit of length; it is then evaluated in the unit of the model."""
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


# Springs whose force is another polynomial beyond each clearance: with a preload, and measured curves.


class Piecewise(Law):
    """A polynomial beyond each clearance: ``scale * sum of (preload + stiffness xi + quadratic xi**2 + cubic xi**3)``.

    ``xi`` is the depth of a stage on its side, and its force is towards the gap. A preload is a force with which a
    stage begins: the force jumps where it closes. ``offset`` is a constant force and ``even_quadratic`` a quadratic
    term that does not change its sign, both while the innermost stage is closed: with them a stage without a clearance
    is the middle piece of a measured curve.
    """

    name, words = "piecewise", "a polynomial beyond each clearance, with a preload"
    parameters = (
        Parameter("scale", None, "it is the factor of the whole force", 1.0, optional=True),
        Parameter(
            "offset",
            QuantityKind.TORQUE,
            "it is a constant force while the innermost stage is closed; the middle of a gap is its centre",
            0.0,
            optional=True,
        ),
        Parameter(
            "even_quadratic",
            None,
            "it is a quadratic term of the same sign on both sides",
            0.0,
            None,
            -2,
            1,
            optional=True,
        ),
    )
    stage_parameters = (
        CLEARANCE,
        STIFFNESS,
        CUBIC,
        Parameter("preload", QuantityKind.TORQUE, "it is the force with which the stage begins", 0.0),
        Parameter("quadratic", None, "it is the coefficient of the quadratic term", 0.0, None, -2, 1),
    )

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        parts = []
        for stage in stages:
            depth, closed = stage.depth, stage.closed
            odd = stage["stiffness"] * depth + stage["cubic"] * (depth * depth * depth)
            even = stage["preload"] + stage["quadratic"] * (depth * depth)
            parts.append(closed * (odd + stage.sign * even))
            if stage.innermost:
                parts.append(closed * (numbers["offset"] + numbers["even_quadratic"] * (depth * depth)))
        return numbers["scale"] * stages.total(parts)


# The polynomial that replaces a fractional power near 0, where that power is not analytic.

DEGREE, MOMENTS = 8, 4


@lru_cache(maxsize=256)
def edge_polynomial(exponent: float) -> tuple[float, ...]:
    """Fit ``s**p`` on [0, 1] by ``s Q(s)`` and return the coefficients of ``Q``, that of the highest power first.

    The fit has the value 0 at 0, and the value and the first two derivatives of the power at 1. The first moments of
    its error vanish: the integral of the error over ``s``, which is the work; that of the error times
    ``s``, from which the duration of a passage follows; ... So the motion beyond the edge has almost no error: four
    moments did more in trials than a higher degree, whose large coefficients cost digits. What is left of the
    coefficients minimises the square of the error.

    An impact whose depth is 10 times the width of the edge, against ``max(x, 0)**1.5``, has a relative error of 4e-15
    in its duration, and of 2e-14 in the derivative of its end by its speed; 5 times, 2e-13 and 1e-12; 2.5 times, 5e-12
    and 1e-11. Rounding adds less than 1e-12 to the transition matrix. An impact that reaches a quarter of the edge
    is wrong by 4e-4 of its duration, and 4e-3 of that derivative.
    """
    # Legendre polynomials in z = 2 s - 1 are orthogonal: powers of s would lose ten digits
    size, p = DEGREE + 1, exponent
    basis = [legendre.Legendre.basis(k, domain=[0.0, 1.0]) for k in range(size)]
    nodes, weights = legendre.leggauss(size + MOMENTS + 8)
    s = (nodes + 1.0) / 2.0
    powers = np.array([each(s) for each in basis])
    rows = [
        [each(0.0) for each in basis],
        *([each.deriv(j)(1.0) if j else each(1.0) for each in basis] for j in range(3)),
    ]
    wanted = [0.0, 1.0, p, p * (p - 1.0)]
    for j in range(MOMENTS):
        rows.append((powers @ (weights * s**j) / 2.0).tolist())
        wanted.append(1.0 / (p + j + 1.0))
    # the integral of s**p times a Legendre polynomial is a product of ratios
    best = [1.0 / (p + 1.0)]
    for k in range(1, size):
        best.append(best[-1] * (p - k + 1.0) / (p + k + 1.0))
    best = np.array(best) * (2.0 * np.arange(size) + 1.0)
    # least squares: the nearest coefficients to `best` that satisfy the conditions, in the norm of the polynomials
    scale = 1.0 / np.sqrt(2.0 * np.arange(size) + 1.0)
    conditions = np.array(rows) / scale
    change, *_ = np.linalg.lstsq(conditions, np.array(wanted) - np.array(rows) @ best, rcond=None)
    fit = legendre.Legendre(best + change / scale, domain=[0.0, 1.0]).convert(kind=Polynomial, domain=[-1, 1])
    return tuple(float(each) for each in fit.coef[:0:-1])


# A rigid stop: impacts with a coefficient of restitution.


class Rigid(Law):
    """A rigid stop: where the deflection reaches its clearance, the rate is reversed, ``v+ = -restitution v-``.

    Between impacts it has no force. Impacts that follow each other ever faster end in a contact that is held; its force
    is a reaction, and it ends where that force would pull.
    """

    name, words = "rigid", "rigid stops with a coefficient of restitution"
    parameters = (Parameter("restitution", None, "it is the rate after an impact over the rate before", None, 0.0),)
    stage_parameters = (CLEARANCE,)

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """Refuse a restitution that feeds energy in."""
        if not 0.0 <= numbers["restitution"] <= 1.0:
            yield f"restitution is {numbers['restitution']:g}; it must lie between 0 and 1"

    def rebound(self, rate: Any, numbers: Mapping[str, Any]) -> Any:
        """See `Law.rebound`."""
        return -numbers["restitution"] * rate

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """Return 0: its force is an impulse, or a reaction."""
        return 0.0 * rate


# Springs with clearances: without damping, with a damper while they touch, and with damping by their force.


def spring(stage: StageTerms) -> Any:
    """Return the force of a closed stage: ``stiffness * xi + cubic * xi**3``, ``xi`` its depth."""
    return stage["stiffness"] * stage.depth + stage["cubic"] * (stage.depth * stage.depth * stage.depth)


class Elastic(Law):
    """``f = g``: the springs alone. Each stage acts beyond its clearance, in addition to those with smaller clearances.

    Examples
    --------
    >>> gw.Contact("stop", {"x": 1.0}, [gw.Stage(1.0, 20.0)], law="elastic").law.name
    'elastic'
    """

    name, words = "elastic", "springs without damping"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        return stages.total(stage.closed * spring(stage) for stage in stages)


class Viscous(Elastic):
    """``f = g + c v`` while any stage touches (Dubowsky and Freudenstein 1971); it jumps at contact."""

    name, words = "viscous", "springs, and a viscous damper while they touch"
    parameters = (Parameter("viscous_damping", QuantityKind.DAMPING, "it is the coefficient of the damper", 0.0, 0.0),)

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        touching = stages.total(stage.closed for stage in stages if stage.innermost)
        return super().force(rate, stages, numbers) + numbers["viscous_damping"] * touching * rate


class HuntCrossley(Elastic):
    """``f = g + beta |g| v`` (Hunt and Crossley 1975): it dissipates on both sides."""

    name, words = "hunt-crossley", "springs, and damping in proportion to their force"
    parameters = (
        Parameter(
            "impact_damping", QuantityKind.IMPACT, "it is the factor beta of the damping by force and rate", 0.0, 0.0
        ),
    )

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        size = stages.total(stage.sign * (stage.touching * spring(stage)) for stage in stages)
        return super().force(rate, stages, numbers) + numbers["impact_damping"] * (size * rate)


class HuntCrossleyAsPrinted(HuntCrossley):
    """``f = g (1 + beta v)`` (paper, equation 15): it feeds energy in on the negative side."""

    name, words = "hunt-crossley-as-printed", "hunt-crossley with a signed force: one side feeds energy in"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        size = stages.total(stage.touching * spring(stage) for stage in stages)
        return Elastic.force(self, rate, stages, numbers) + numbers["impact_damping"] * (size * rate)


# Springs and dampers that push, and never pull.


class Pushing(Law):
    """``f = max(0, g + c v)`` on each side: the damper acts while the sum pushes, as in Modelica's ``ElastoBacklash``.

    As a contact opens, the damping force would pull from some depth on; there the force is 0 instead. It ends
    continuously: the mode of a side is 1 while its sum pushes.
    """

    name, words = "pushing", "springs and a viscous damper that push, and never pull"
    parameters = (Parameter("viscous_damping", QuantityKind.DAMPING, "it is the coefficient of the damper", None, 0.0),)

    @property
    def mode_count(self) -> int:
        """One mode for each side."""
        return 2

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """Refuse a damper of 0: each side would begin and cease to push at the breakpoint itself."""
        if not numbers["viscous_damping"] > 0.0:
            given = numbers["viscous_damping"]
            yield f'viscous_damping is {given:g}; it must be > 0: without a damper write law = "elastic"'

    @property
    def is_damped(self) -> bool:
        """True: the damper dissipates."""
        return True

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> list[Any]:
        """See `Law.guards`; while a side is open its mode follows the rate, so that it is 1 where a contact begins."""
        found = []
        for sign in (1, -1):
            own = [stage for stage in stages if stage.sign == sign]
            touching = stages.total([0.0 * rate, *(stage.closed for stage in own if stage.innermost)])
            force = stages.total([0.0 * rate, *(stage.closed * spring(stage) for stage in own)])
            found.append(sign * (force + (numbers["viscous_damping"] * touching + (1.0 - touching)) * rate))
        return found

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        parts = []
        for sign, mode in zip((1, -1), stages.modes, strict=True):
            for stage in stages:
                if stage.sign == sign:
                    damper = numbers["viscous_damping"] * rate if stage.innermost else 0.0
                    parts.append(mode * (stage.closed * (spring(stage) + damper)))
        return stages.total(parts)
