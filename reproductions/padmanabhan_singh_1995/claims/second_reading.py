"""The second reading of the paper: statements that hold at one other number, and statements that can be explained.

The printed numbers stay the default. Another number stands beside them with what it gains and what it costs
(`weigh` in ``claims/trades.py``); an explanation is a check with evidence, as a claim is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from reproductions.padmanabhan_singh_1995.jobs import LITERAL, USUAL, OtherNumber, Reading

_AMPLITUDE, _BETA = "harmonic1.amplitude", "stage2.impact_damping"


def _c11(value: float) -> tuple[tuple[str, float], ...]:
    """C11 = C21 of the first stage; the second stands in the matrix with the other sign."""
    return ("damping.q1.q1", value), ("damping.q3.q1", -value)


_ROW_12 = ("12", "13", "9a", "20a", "20b", "22", "27", "28")  # the set of figure 12 under other loads; 14 is 9a
_ROW_5 = ("5", "6", "7-impact", "7-viscous", "8a")


@dataclass(frozen=True)
class Candidate:
    """Another number, or another reading, that is weighed.

    Parameters
    ----------
    reading
        The reading.
    explains
        Names of claims that it was proposed for.
    weighed
        Names of claims that it could gain or cost besides.
    jobs
        Keys of the jobs that take the place of those on which a claim rests, by the name of the claim.
    """

    reading: Reading
    explains: tuple[str, ...] = ()
    weighed: tuple[str, ...] = ()
    jobs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def claims(self) -> tuple[str, ...]:
        """Names of all claims that it could gain or cost."""
        return tuple(dict.fromkeys((*self.explains, *self.weighed)))

    def jobs_of(self, name: str) -> tuple[str, ...]:
        """Return the keys of the other jobs of a claim; none if it rests on its own."""
        return self.jobs.get(name, ())


def _at(number: OtherNumber, slope: Reading = USUAL) -> Reading:
    return Reading(slope.slope, slope.damping, number)


_LESS_DAMPING = OtherNumber("C11 = C21 = 0.025", "0.04", "c11-0.025", _c11(0.025), _ROW_12)
_NO_IMPACT = OtherNumber("β = 0", "0.05", "beta-0", ((_BETA, 0.0),), ("12", "27", "28"))
_MORE_FORCE = OtherNumber("Te1 = 0.37", "0.25", "te1-0.37", ((_AMPLITUDE, 0.37),), _ROW_5)
_FOUR_AND_ONE = OtherNumber("Te1 = 0.338", "0.25", "te1-0.338", ((_AMPLITUDE, 0.338),), _ROW_5)
_PROPOSED = OtherNumber("Te1 = 0.35", "0.25", "te1-0.35", ((_AMPLITUDE, 0.35),), _ROW_5)
_BETA_TENTH = OtherNumber("β = 0.1", "0.075", "beta-0.1", ((_BETA, 0.1),), ("10b",))
_VISCOUS_TOO = OtherNumber("C11 = C21 = 0.04", "0", "c11-0.04", _c11(0.04), ("10b",))
_SWAPPED = OtherNumber(
    "n1, n2 exchanged with K12 = 0.36",
    "n1 = 0.6, n2 = 1.0, and a damaged K12",
    "exchanged",
    (("stage2.force.q1", 1.0), ("stage2.force.q3", -0.6), ("stiffness.q1.q3", -0.36)),
    ("11b",),
)
_COUPLING = OtherNumber("C21 = 0.024", "0.04", "c21-0.024", (("damping.q3.q1", -0.024),), ("13", "9a"))
_NO_FIRST_STAGE = OtherNumber("K11 = 0", "0.1", "k11-0", (("stiffness.q1.q1", 0.0),), ("17", "18", "19"))

_TWELVE_TO_FOURTEEN = ("12-folds", "13-flips", "13-loop", "13-natures", "14-jump", "14-second", "14-loop")
_OVER_AMPLITUDE = ("27-islands", "27-flip", "28-grow", "28-throughout")

CANDIDATES = (
    Candidate(
        _at(_LESS_DAMPING),
        ("12-beats", "27-beats", "28-overlap"),
        (*_TWELVE_TO_FOURTEEN, "20-peak", "20-flips", "21-folds", "22-flips", "22-wider", *_OVER_AMPLITUDE),
    ),
    Candidate(_at(_NO_IMPACT), ("27-beats", "28-overlap"), ("12-folds", "12-beats", *_OVER_AMPLITUDE)),
    Candidate(_at(_MORE_FORCE), ("6-single", "6-weaker", "7-differ", "8-double"), ("5-double",)),
    Candidate(
        _at(_FOUR_AND_ONE),
        ("5-double",),
        ("6-single", "7-differ", "8-double"),
        {"5-double": ("5-start",), "7-differ": ("5-start", "6"), "8-double": ("5-start",)},
    ),
    Candidate(_at(_PROPOSED), (), ("5-double", "6-single", "7-differ", "8-double")),
    Candidate(_at(_BETA_TENTH), ("10-gone",), ("10-shrinks",)),
    Candidate(_at(_VISCOUS_TOO), ("10-gone",), ("10-shrinks",)),
    Candidate(_at(_SWAPPED), ("11-second", "11-beats"), ("11-spacing",)),
    Candidate(LITERAL, (), ("14-jump", "14-second", "13-flips", "22-flips", "22-wider")),
    Candidate(_at(_COUPLING, LITERAL), ("14-jump",), ("14-second", "13-flips", "14-loop")),
    Candidate(_at(_NO_FIRST_STAGE), ("17-sequence",), (), {"17-sequence": ("17-start", "18-start", "19-start")}),
)
"""All candidates. Those that explain nothing stand here too: they were proposed, and do not hold."""


def readings_for(name: str) -> list[tuple[Reading, tuple[str, ...]]]:
    """Return the other numbers that were proposed for a claim, and the jobs on which it rests there."""
    return [(each.reading, each.jobs_of(name)) for each in CANDIDATES if name in each.explains]


@dataclass(frozen=True)
class Explanation:
    """What explains that a statement does not hold at the printed numbers, with a check of it.

    Parameters
    ----------
    by
        What explains it, in a few words.
    rests_on
        Keys of the jobs whose results the check takes, in this order.
    check
        The check: whether the explanation holds, and its evidence.
    """

    by: str
    rests_on: tuple[str, ...]
    check: Callable[..., tuple[bool, str]]


EXPLANATIONS: dict[str, Explanation] = {}
"""Explanations by the names of claims; ``claims/explanations.py`` defines them."""


def explains(
    name: str, by: str, *rests_on: str
) -> Callable[[Callable[..., tuple[bool, str]]], Callable[..., tuple[bool, str]]]:
    """Make a check the check of an explanation; parameters as those of `Explanation`."""

    def register(check: Callable[..., tuple[bool, str]]) -> Callable[..., tuple[bool, str]]:
        EXPLANATIONS[name] = Explanation(by, rests_on, check)
        return check

    return register
