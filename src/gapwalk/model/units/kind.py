"""The kinds of quantities of a drive train: how each is called, in which unit it is counted, what its parameters are.

Angles are a dimension of their own here, so that N m/deg, N m/rad and N m are three different things.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True, slots=True)
class KindForm:
    """What belongs to a kind.

    Parameters
    ----------
    words
        What it is called, with its article.
    reference
        The unit in which it is counted inside, as pint writes it.
    usual
        Units in which it is written, the most usual one first.
    angle
        The power of an angle of the train in it. Inertia is counted per angle: times an acceleration it is a torque.
    time, torque
        The powers of time and torque in it.
    """

    words: str
    reference: str
    usual: tuple[str, ...]
    angle: int = 0
    time: int = 0
    torque: int = 0


class QuantityKind(Enum):
    """The kinds of quantities of a drive train; phases are angles of the excitation, which scale with nothing."""

    ANGLE = KindForm("an angle", "radian", ("deg", "rad"), angle=1)
    INERTIA = KindForm("an inertia", "kilogram*meter**2", ("kg m^2",), angle=-1, time=2, torque=1)
    STIFFNESS = KindForm("a stiffness", "newton*meter/radian", ("N m/rad", "N m/deg"), angle=-1, torque=1)
    CUBIC = KindForm("a cubic stiffness", "newton*meter/radian**3", ("N m/rad^3", "N m/deg^3"), angle=-3, torque=1)
    DAMPING = KindForm(
        "a damping", "newton*meter*second/radian", ("N m s/rad", "N m s/deg"), angle=-1, time=1, torque=1
    )
    IMPACT = KindForm("an impact damping", "second/radian", ("s/rad", "s/deg"), angle=-1, time=1)
    TORQUE = KindForm("a torque", "newton*meter", ("N m",), torque=1)
    FREQUENCY = KindForm("a frequency or speed", "radian/second", ("rpm", "Hz", "rad/s"), time=-1)
    PHASE = KindForm("a phase", "radian", ("deg", "rad"))

    @property
    def words(self) -> str:
        """What it is called, with its article."""
        return self.value.words

    def __repr__(self) -> str:
        return self.name

    @property
    def usual(self) -> tuple[str, ...]:
        """Units in which it is written, the most usual one first."""
        return self.value.usual


PACES = ("frequency", "speed")
"""The names that the first parameter may have."""

_BY_WORD = {
    "frequency": QuantityKind.FREQUENCY,
    "speed": QuantityKind.FREQUENCY,
    "inertia": QuantityKind.INERTIA,
    "stiffness": QuantityKind.STIFFNESS,
    "damping": QuantityKind.DAMPING,
    "viscous_damping": QuantityKind.DAMPING,
    "impact_damping": QuantityKind.IMPACT,
    "clearance": QuantityKind.ANGLE,
    "cubic": QuantityKind.CUBIC,
    "amplitude": QuantityKind.TORQUE,
    "phase": QuantityKind.PHASE,
}


def kind_of(parameter: str) -> QuantityKind | None:
    """The kind of a parameter of a drive train by its name; None for a plain number (ratios, shares)."""
    words = parameter.split(".")
    if words[0] == "mean":
        return QuantityKind.TORQUE
    return None if "acts_on" in words[:-1] else _BY_WORD.get(words[-1])
