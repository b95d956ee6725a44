"""The parameters that a kind of force law or of load has: name, kind of quantity, default, bound, and a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from gapwalk.model.units import QuantityKind, name_kind


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a force law or of a load.

    Examples
    --------
    >>> each = gw.laws.Parameter("preload", gw.laws.QuantityKind.TORQUE, "it is the force at the breakpoint", least=0.0)
    >>> each.name, each.least
    ('preload', 0.0)
    """

    name: str  #: The last part of its name, as in ``stop.impact_damping``, and its key in a model file.
    #: Its kind of quantity, which determines its unit in a drive train and its change with the unit of length. None for
    #: a plain number; in a drive train with units, its unit is made of that of angles, s and N m.
    kind: QuantityKind | None
    words: str  #: Explanation of the parameter, after its name: ``it is half the width of the gap``.
    default: float | None = None  #: Default value; None if the parameter is required.
    least: float | None = None  #: Its smallest value; None if it may be negative.
    #: angle, torque: For a parameter without a kind, the powers of an angle (a length) and of a torque (a force) in it.
    angle: int = 0
    torque: int = 0
    #: True if a model file that names the law may leave out this parameter of the contact as a whole.
    optional: bool = False

    def __post_init__(self) -> None:
        if self.kind is not None:
            name_kind(self.name, self.kind)

    @property
    def growth(self) -> int:
        """The power of the unit of length by which its number grows; forces, by mass, are divided by that unit."""
        powers = self.kind or self
        return -powers.angle - powers.torque
