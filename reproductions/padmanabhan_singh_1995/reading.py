"""A reading of the paper: how it is understood where its text allows two things."""

from __future__ import annotations

from dataclasses import dataclass

from gapwalk.model.system import System
from gapwalk.paper import DampingReading, SlopeReading, case, parameter_set


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read the paper.

    Parameters
    ----------
    slope, damping
        How the slope of the second stage and the impact damping are read, as in `case`.
    """

    slope: SlopeReading = SlopeReading.REDUCED
    damping: DampingReading = DampingReading.DISSIPATIVE

    @staticmethod
    def of(slope: str, damping: str) -> Reading:
        """The reading of these two words."""
        return Reading(SlopeReading(slope), DampingReading(damping))

    @property
    def suffix(self) -> str:
        """What file names end with: nothing for the default reading, otherwise such as ``-literal``."""
        usual = Reading()
        pairs = ((self.slope, usual.slope), (self.damping, usual.damping))
        return "".join(f"-{own.value}" for own, other in pairs if own != other)

    @property
    def differs(self) -> str:
        """What is read otherwise than by default, such as ``slope literal``; empty for the default reading."""
        usual = Reading()
        pairs = (("slope", self.slope, usual.slope), ("damping", self.damping, usual.damping))
        return ", ".join(f"{word} {own.value.replace('-', ' ')}" for word, own, other in pairs if own != other)

    def __str__(self) -> str:
        return f"slope {self.slope.value}, damping {self.damping.value}"

    def of_case(self, name: str) -> Reading:
        """The reading of one case: without a first stage both slopes are 1, without impact damping all laws agree."""
        numbers, usual = parameter_set(name), Reading()
        slope = self.slope if numbers.stiffness[0] else usual.slope
        return Reading(slope, self.damping if numbers.beta else usual.damping)

    def system(self, name: str) -> System:
        """The system of a case in this reading."""
        return case(name, slope=self.slope, damping=self.damping)


USUAL = Reading()
LITERAL = Reading(slope=SlopeReading.LITERAL)
AS_PRINTED = Reading(damping=DampingReading.AS_PRINTED)
