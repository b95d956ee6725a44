"""The goal that a resonance lies below or above a value of the frequency or speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gapwalk.answers.goals.goal import Goal, Need
from gapwalk.answers.local_response import LocalResponse
from gapwalk.errors import ModelError
from gapwalk.model.equilibria import Equilibrium, find_equilibria
from gapwalk.model.modes import find_modes
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System

_STATES = ("rest", "closed", "open")
_STEP = 1e-5  # relative change of a parameter for the derivative of a natural frequency


@dataclass(frozen=True)
class Resonance(Goal):
    """A resonance lies below or above a value of the frequency or speed.

    Examples
    --------
    >>> gw.ask.Resonance(1, above=1.1, at="open").value(system)
    1.0
    """

    number: int  #: Number of the natural frequency: 1 for the first that is not zero.
    #: below, above: The limits, in the unit of the frequency or speed; give one or both.
    below: float | None = None
    above: float | None = None
    #: Order of the excitation that meets it: per turn where the first parameter is the speed of a shaft, otherwise a
    #: multiple of the frequency.
    order: float = 1.0
    #: The linearisation: ``"rest"``, about the static equilibrium under the mean load, with the stages that are closed
    #: there; ``"closed"``, with the first stage of every contact, or ``"open"``, as in `gapwalk.find_modes`.
    at: str = "rest"

    def __post_init__(self) -> None:
        if self.below is None and self.above is None:
            raise ModelError("a goal names a resonance, but no limit; write below = ... or above = ...")
        if not self.order > 0.0:
            raise ModelError(f"the order of a resonance is {self.order!r}; it must be a number > 0")
        if self.at not in _STATES:
            raise ModelError(f"a resonance is taken at {self.at!r}; {did_you_mean(str(self.at), _STATES)}")

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        unit = f" {system.units.parameter(system.structure.pace)}" if system.units else ""
        limits = (("above", self.above), ("below", self.below))
        parts = [f"{word} {value:g}{unit}" for word, value in limits if value is not None]
        about = "" if self.at == "rest" else f", {self.at},"
        return f"resonance {self.number}{about} with order {self.order:g} {' and '.join(parts)}"

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if the system has no such natural frequency."""
        self.value(system)

    def value(self, system: System) -> float:
        """Return the frequency or speed at which the order meets the natural frequency."""
        rates = find_modes(system, self._state(system)).frequencies
        rates = rates[np.isfinite(rates)]
        rates = rates[rates > 1e-6 * max(float(rates.max(initial=0.0)), np.finfo(float).tiny)]
        if not 1 <= self.number <= len(rates):
            raise ModelError(f"a goal names resonance {self.number}; the system has {len(rates)}")
        order = self.order / float(system.turns or 1)
        return float(rates[self.number - 1]) / (order * system.structure.frequency)

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins, with their derivatives."""
        system, slopes = response.system, np.empty(len(response.names))
        value = self.value(system)
        for k, (name, scale) in enumerate(zip(response.names, response.scales, strict=True)):
            pair = [self.value(system.at({name: system[name] + sign * _STEP * scale})) for sign in (-1.0, 1.0)]
            slopes[k] = (pair[1] - pair[0]) / (2.0 * _STEP)
        words = f"resonance {self.number} at {value:.6g}"
        return [
            Need(side * (value - limit) / abs(limit) - margin, side * slopes / abs(limit), words)
            for side, limit in ((-1.0, self.below), (1.0, self.above))
            if limit is not None
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the distance from the nearest limit, as a share of it."""
        value = self.value(response.system)
        pairs = ((-1.0, self.below), (1.0, self.above))
        return min(side * (value - limit) / abs(limit) for side, limit in pairs if limit is not None)

    def _state(self, system: System) -> Equilibrium | str:
        if self.at != "rest":
            return self.at
        found = find_equilibria(system).equilibria
        if not found or not found[0].stable:
            raise ModelError(
                f"a goal names resonance {self.number} about the static equilibrium, but there is no stable one; write "
                'at = "closed", with the first stage of every contact, or at = "open"'
            )
        return found[0]
