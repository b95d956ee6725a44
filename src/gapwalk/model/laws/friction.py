"""Dry friction: Coulomb's, which sticks rigidly, and a Jenkins element, which sticks by a spring."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.model.laws.law import LAWS, Law, Stages
from gapwalk.model.registry import Parameter
from gapwalk.model.units import QuantityKind

HYSTERESIS = Parameter("hysteresis", QuantityKind.TORQUE, "it is the dry friction while this stage is closed", 0.0, 0.0)
"""Parameter of the stages of a contact that hosts friction."""

_LIMIT = Parameter("limit", QuantityKind.TORQUE, "it is the force of friction in slip", None, 0.0)
_MORE = Parameter("limit", QuantityKind.TORQUE, "it is friction that acts whether a stage is closed or not", 0.0, 0.0)
_COEFFICIENT = Parameter("coefficient", None, "it is the coefficient of friction mu", None, 0.0)
_STATIC = Parameter("static", None, "it is the largest force in stick over the force in slip", 1.0, 1.0, optional=True)
_SPEED = Parameter("speed", QuantityKind.RATE, "it is the constant rate of the base, as of a belt", 0.0, optional=True)
_SPRING = Parameter("stiffness", QuantityKind.STIFFNESS, "it is the stiffness of the spring that sticks", None, 0.0)


@dataclass(frozen=True)
class Friction(Law):
    """Dry friction on one deflection: a force of a limited size against its rate.

    In *slip* the force has the size of its limit and the sign of the slip rate, which is the rate of the deflection
    less the constant `speed` of the base. In *stick* it is whatever keeps the element from slipping, up to the limit;
    so it is no function of the deflection and its rate. Slip in one direction, slip in the other and stick are modes of
    the flow (`gapwalk.flow.friction_switches`); `Stages.slip` is 1, -1 or 0 in them.
    """

    #: ``"limit"``: the limit is a number. ``"stages"``: it is the sum of the numbers `hysteresis` of the closed stages
    #: of another contact, and of a limit of its own. ``"normal"``: it is a coefficient times the force of another
    #: contact, which presses.
    by: str = "limit"
    host: str = ""  #: Name of that other contact; empty without one.

    stage_parameters = ()

    def __post_init__(self) -> None:
        if self.by not in ("limit", "stages", "normal"):
            raise ModelError(f'friction is given by {self.by!r}; it must be "limit", "stages" or "normal"')
        if bool(self.host) is (self.by == "limit"):
            need = "needs the name of a contact as host" if self.by != "limit" else f"has a host, {self.host!r}"
            raise ModelError(f"friction by {self.by!r} {need}")

    @property
    def _limits(self) -> tuple[Parameter, ...]:
        return {"limit": (_LIMIT,), "stages": (_MORE,), "normal": (_COEFFICIENT,)}[self.by]

    @property
    def title(self) -> str:
        """See `Law.title`."""
        by = {"limit": "", "stages": f" by the stages of {self.host}", "normal": f" by the force of {self.host}"}
        return f"{self.words}{by[self.by]}"

    @property
    def is_dry(self) -> bool:
        """True: it sticks."""
        return True

    @property
    def is_damped(self) -> bool:
        """True: slip dissipates."""
        return True

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """Refuse numbers with which friction would feed energy in, or could not stick."""
        for each in self.parameters:
            value = numbers[each.name]
            if each.least is not None and not value >= each.least:
                why = "at rest it is no smaller than in slip" if each.name == "static" else "friction only takes energy"
                yield f"{each.name} is {value:g}; it must be >= {each.least:g}: {why}"

    def limit(self, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """Compute the size of the force in slip; arguments are as in `force`."""
        if self.by == "limit":
            return numbers["limit"]
        host = stages.host
        assert host is not None
        if self.by == "stages":
            return numbers["limit"] + host.stages.total(each.closed * each["hysteresis"] for each in host.stages)
        if not [*host.stages]:  # a formula of the load
            return numbers["coefficient"] * host.force
        side = host.stages.total(each.sign * each.closed for each in host.stages if each.innermost)
        return numbers["coefficient"] * (side * host.force)

    def breakaway(self, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """Compute the size of the force at which slip begins; arguments are as in `force`."""
        return self.limit(stages, numbers)


class Coulomb(Friction):
    """Friction that sticks rigidly: in stick the slip rate is zero, and the force follows from that.

    Slip ends where its rate is zero, and begins where the force in stick reaches `static` times the limit.

    Examples
    --------
    >>> gw.friction("brake", {"x": 1.0}, 0.3).law
    Coulomb(by='limit', host='')
    """

    name, words = "coulomb", "dry friction that sticks rigidly"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its limit, the factor of the limit at which slip begins, and the speed of the base."""
        return (*self._limits, _STATIC, _SPEED)

    def breakaway(self, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Friction.breakaway`.

        Parameters
        ----------
        stages
            For a law with a host: stages and force of that contact.
        numbers
            The parameters of the contact by name.
        """
        return numbers["static"] * self.limit(stages, numbers)

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`; it is 0 in stick, where the force is a reaction that depends on the whole system."""
        return stages.slip * self.limit(stages, numbers)


class Jenkins(Friction):
    """A spring in series with a slider, the usual model of hysteresis and joints (Jenkins 1962; several: Iwan 1966).

    Its own state ``z``, the extension of the spring, follows the deflection in stick, and stays at the limit in slip.
    Slip begins where the force ``stiffness z`` reaches the limit, and ends where the slip rate changes its sign.
    """

    name, words = "jenkins", "a spring in series with dry friction"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its limit, the stiffness of its spring, and the speed of the base."""
        return (*self._limits, _SPRING, _SPEED)

    @property
    def has_memory(self) -> bool:
        """True: the extension of its spring is a state."""
        return True

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """Refuse a spring without stiffness."""
        yield from super().problems({**numbers, "stiffness": 0.0})
        if not numbers["stiffness"] > 0.0:
            yield f"stiffness is {numbers['stiffness']:g}; it must be > 0. Friction that sticks rigidly has none"

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        return numbers["stiffness"] * stages.extension


FRICTION: dict[str, Parameter] = {
    each.name: each for law in (Coulomb(), Coulomb("normal", "host"), Jenkins()) for each in law.parameters
}
"""The parameters of friction in all its forms, by name."""


@dataclass(frozen=True)
class Hysteretic(Law):
    """Springs with clearances that host friction: each stage has a number more, its `hysteresis`.

    The springs are those of a law that has a name; the friction is a contact of its own, `Friction` by ``"stages"``.
    """

    springs: str = "elastic"  #: Name of the law of the springs.

    name, words = "hysteretic", "springs whose stages have dry friction"

    def __post_init__(self) -> None:
        if LAWS.named(self.springs).rebounds:
            raise ModelError(f"the law {self.springs!r} has no stages that could have dry friction")

    @property
    def base(self) -> Law:
        """The law of the springs."""
        return LAWS.named(self.springs)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The parameters of the springs."""
        return self.base.parameters

    @cached_property
    def stage_parameters(self) -> tuple[Parameter, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The parameters of the stages of the springs, and `HYSTERESIS`."""
        return (*self.base.stage_parameters, HYSTERESIS)

    @property
    def title(self) -> str:
        """See `Law.title`."""
        return f"{self.springs} with hysteresis"

    @property
    def mode_count(self) -> int:
        """See `Law.mode_count`."""
        return self.base.mode_count

    @property
    def is_damped(self) -> bool:
        """See `Law.is_damped`."""
        return self.base.is_damped

    def problems(self, numbers: Mapping[str, float]) -> Iterator[str]:
        """See `Law.problems`."""
        return self.base.problems(numbers)

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Sequence[Any]:
        """See `Law.guards`."""
        return self.base.guards(rate, stages, numbers)

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        return self.base.force(rate, stages, numbers)
