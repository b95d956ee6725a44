"""The regime of a motion: which kind it is, as a number that arrays can hold, and in words."""

from __future__ import annotations

from enum import IntEnum


class Regime(IntEnum):
    """Which kind of motion."""

    RUNAWAY = -2
    UNDECIDED = -1
    PERIODIC = 0
    QUASI_PERIODIC = 1
    CHAOTIC = 2

    @property
    def text(self) -> str:
        """In words."""
        return ("periodic", "quasi-periodic", "chaotic", "runs away", "undecided")[self.value]


def regime_word(regime: int, period: int) -> str:
    """``period 3``, ``quasi-periodic``, ``chaotic``, ...: what a cell of a regime map is called."""
    return f"period {period}" if regime == Regime.PERIODIC else Regime(regime).text
