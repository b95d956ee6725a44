"""Regimes: the kind of a motion as a number that arrays can hold, and in words."""

from __future__ import annotations

from enum import IntEnum


class Regime(IntEnum):
    """The kind of a motion."""

    RUNAWAY = -2
    UNDECIDED = -1
    PERIODIC = 0
    QUASI_PERIODIC = 1
    CHAOTIC = 2

    @property
    def text(self) -> str:
        """The regime in words."""
        return ("periodic", "quasi-periodic", "chaotic", "runs away", "undecided")[self.value]


def regime_word(regime: int, period: int) -> str:
    """Return the name of a regime in a regime map: ``period 3``, ``quasi-periodic``, ``chaotic``, ..."""
    return f"period {period}" if regime == Regime.PERIODIC else Regime(regime).text
