"""The studies that figures and claims rest on: parameter sets of the paper, each with what is computed of it.

Several figures may show the same study, which is run once. The paper can be read in two ways at two places (`Reading`),
and every study can be run in each reading.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import Any

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.tables import consistent_machine

MEASURE = "half.q1"
"""What frequency responses show: half the peak to peak of q1."""


Values = tuple[tuple[str, float], ...]

_SYMBOLS = {
    "K11": ("stiffness.q1.q1", 1.0),
    "K12": ("stiffness.q1.q3", -1.0),
    "K21": ("stiffness.q3.q1", -1.0),
    "K22": ("stiffness.q3.q3", 1.0),
    "C11": ("damping.q1.q1", 1.0),
    "C21": ("damping.q3.q1", -1.0),
    "C12": ("damping.q1.q3", -1.0),
    "C22": ("damping.q3.q3", 1.0),
    "β": ("stage2.impact_damping", 1.0),
    "n1": ("stage2.force.q1", 1.0),
    "n2": ("stage2.force.q3", -1.0),
    "Tm1": ("mean.q1", 1.0),
    "Tm2": ("mean.q3", 1.0),
    "Te1": ("harmonic1.amplitude", 1.0),
    "Te2": ("harmonic2.amplitude", 1.0),
    "φ": ("harmonic2.phase", 1.0),
    "Ω": ("frequency", 1.0),
}
"""The numbers of the tables: parameters, and the signs with which they stand in the equations of motion."""

# One spring or damper of the machine stands behind both: if they change by one factor, one number has changed.
_ONE_ELEMENT = (("K11", "K21"), ("C11", "C21"), ("C12", "C22"), ("K12", "K22"), ("n1", "n2"))


def changed_numbers(printed: gw.System, other: gw.System) -> dict[str, tuple[float, float]]:
    """Return the numbers of the tables in which two systems differ: the printed value and the other one."""
    found = {
        symbol: (sign * printed[name], sign * other[name])
        for symbol, (name, sign) in _SYMBOLS.items()
        if name in printed.parameters and name in other.parameters and printed[name] != other[name]
    }
    for pair in _ONE_ELEMENT:
        if not set(pair) <= set(found):
            continue
        (before, after), (also_before, also_after) = (found[symbol] for symbol in pair)
        alike = (before, after) == (also_before, also_after)
        if alike or (before and abs(before * also_after - after * also_before) < 1e-9):
            first, second = pair
            del found[second]
            found = {
                (f"{first} = {second}" if alike else f"{first}, {second}") if key == first else key: each
                for key, each in found.items()
            }
    return found


def in_words(changed: Mapping[str, tuple[float, float]]) -> str:
    """Name numbers with their other values, such as ``C11 = C21 = 0.025``."""
    return ", ".join(f"{symbol} = {other:.3g}" for symbol, (_, other) in changed.items())


@dataclass(frozen=True)
class OtherNumber:
    """Numbers of the tables that may be misprints, or other numbers than those of the figure.

    Parameters
    ----------
    slug
        The end of file names.
    given
        Values of parameters, or a function that computes them.
    cases
        Parameter sets that have them.
    """

    slug: str
    given: Values | Callable[[], Values]
    cases: tuple[str, ...]

    @cached_property
    def values(self) -> Values:
        """Values of parameters."""
        return self.given() if callable(self.given) else self.given

    @cached_property
    def changed(self) -> dict[str, tuple[float, float]]:
        """The numbers of the tables that differ: the printed value and the other one, by their symbols."""
        printed = gw.paper.case(self.cases[0])
        return changed_numbers(printed, printed.at(dict(self.values)))

    @property
    def words(self) -> str:
        """The numbers, such as ``C11 = C21 = 0.025``."""
        return in_words(self.changed)

    @property
    def printed(self) -> str:
        """What is printed in their place."""
        return ", ".join(f"{printed:.3g}" for printed, _ in self.changed.values())


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read the paper.

    Parameters
    ----------
    slope, damping
        How the slope of the second stage and the impact damping are read, as in `gapwalk.paper.case`.
    number
        A number that differs from the printed one; None for the printed ones.
    """

    slope: gw.paper.SlopeReading = gw.paper.SlopeReading.REDUCED
    damping: gw.paper.DampingReading = gw.paper.DampingReading.DISSIPATIVE
    number: OtherNumber | None = None

    @property
    def changes(self) -> tuple[tuple[str, str], ...]:
        """What differs from the default reading, such as ``("slope", "literal")``."""
        pairs = (("slope", self.slope, USUAL.slope), ("damping", self.damping, USUAL.damping))
        return tuple((word, own.value) for word, own, usual in pairs if own != usual)

    @property
    def suffix(self) -> str:
        """The end of file names: empty for the default reading, otherwise such as ``-literal``."""
        return "".join(f"-{value}" for _, value in self.changes) + (f"-{self.number.slug}" if self.number else "")

    @property
    def differs(self) -> str:
        """The same in words, such as ``slope literal``; empty for the default reading."""
        words = [f"{word} {value.replace('-', ' ')}" for word, value in self.changes]
        return ", ".join([*words, self.number.words] if self.number else words)

    def __str__(self) -> str:
        return f"slope {self.slope.value}, damping {self.damping.value}" + (f", {self.differs}" if self.number else "")

    def of_case(self, case: str) -> Reading:
        """Leave out what changes nothing: without a first stage both slopes are 1, without beta all laws agree.

        Another number concerns some parameter sets only.
        """
        numbers = gw.paper.parameter_set(case)
        return Reading(
            self.slope if numbers.stiffness[0] else USUAL.slope,
            self.damping if numbers.beta else USUAL.damping,
            self.number if self.number and case in self.number.cases else None,
        )


USUAL = Reading()
LITERAL = Reading(slope=gw.paper.SlopeReading.LITERAL)
AS_PRINTED = Reading(damping=gw.paper.DampingReading.AS_PRINTED)

_AMPLITUDE, _BETA = "harmonic1.amplitude", "stage2.impact_damping"
_ONE_HARMONIC = 1.5  # the frequency of figure 3, where the response has one harmonic


@cache
def matched_damping(viscous: str, impact: str) -> Any:
    """Match the impact damping of one set to the viscous damping of another by the rule of the paper's section 4."""
    motion = gw.find_orbit(gw.paper.case(viscous), frequency=_ONE_HARMONIC)
    return gw.measure.match_impact_damping(motion, gw.paper.case(impact))


def _matched(viscous: str, impact: str) -> Values:
    return ((_BETA, float(matched_damping(viscous, impact).impact_damping)),)


def _c11(value: float) -> Values:
    """C11 = C21 of the first stage; the second stands in the matrix with the other sign."""
    return ("damping.q1.q1", value), ("damping.q3.q1", -value)


def _of_machine() -> Values:
    """The numbers of the consistent machine that differ from the printed ones, but for its loads."""
    numbers = gw.train.paper_numbers(consistent_machine())
    return ("damping.q3.q1", -numbers.C21), ("damping.q1.q3", -numbers.C12)


_ROW_3 = ("4a", "3-impact", "10a", "10b")
_ROW_5 = ("5", "6", "7-impact", "7-viscous", "8a")
_ROW_12 = ("12", "13", "9a", "20a", "20b", "22", "27", "28")  # the set of figure 12 under other loads; 14 is 9a

_NUMBERS = (
    OtherNumber("matched", partial(_matched, "3-viscous", "3-impact"), _ROW_3),
    OtherNumber("matched-light", partial(_matched, "6", "5"), ("5", "7-impact", "8a")),
    OtherNumber("c11-0.025", _c11(0.025), _ROW_12),
    OtherNumber("beta-0", ((_BETA, 0.0),), ("12", "27", "28")),
    OtherNumber("te1-0.37", ((_AMPLITUDE, 0.37),), _ROW_5),
    OtherNumber("te1-0.338", ((_AMPLITUDE, 0.338),), _ROW_5),
    OtherNumber("beta-0.1", ((_BETA, 0.1),), _ROW_3),
    OtherNumber(
        "exchanged",
        (("stage2.force.q1", 1.0), ("stage2.force.q3", -0.6), ("stiffness.q1.q3", -0.36)),
        ("11b",),
    ),
    OtherNumber("machine", _of_machine, (*_ROW_12, "15")),
    OtherNumber("k11-0", (("stiffness.q1.q1", 0.0),), ("17", "18", "19")),
)
CHANGES = {number.slug: Reading(number=number) for number in _NUMBERS}
"""Readings with other numbers, by the ends of their file names."""


WHOLE = frozenset({"4a-matched"})
"""Jobs at other numbers whose longer periods a figure shows: statements on period 1 share them."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """A study of one parameter set, in one reading.

    Parameters
    ----------
    case
        Name of the parameter set, as in `gapwalk.paper.case`.
    options
        What is computed.
    name
        Name of its files; by default that of the case.
    changes
        Values of parameters that differ from the parameter set.
    effort
        Seconds of one core that it takes, roughly: the longest job begins first.
    reading
        How the paper is read.
    """

    case: str
    options: gw.studies.ResponseOptions | gw.studies.DiagramStudyOptions | gw.studies.SettleStudyOptions
    name: str = ""
    changes: Mapping[str, float] = field(default_factory=dict)
    effort: float = field(default=2.0, compare=False)
    reading: Reading = USUAL

    @property
    def key(self) -> str:
        """The name of its files, which no other job has."""
        return f"{self.name or self.case}{self.reading.suffix}"

    def at(self, reading: Reading) -> Job:
        """Return the job in another reading; the same job, if that changes nothing of its parameter set."""
        return replace(self, reading=reading.of_case(self.case))

    @property
    def shortest(self) -> Job:
        """The job without longer periods, for statements on period 1; itself, if it has none or they are shown too."""
        options = self.options
        if not isinstance(options, gw.studies.DiagramStudyOptions) or options.max_period == 1 or self.key in WHOLE:
            return self
        return replace(self, name=f"{self.name or self.case}-period-1", options=replace(options, max_period=1))

    @property
    def study(self) -> gw.Study:
        """The study, as `gapwalk.run` takes it."""
        system = gw.paper.case(self.case, slope=self.reading.slope, damping=self.reading.damping).at(self.changes)
        if self.reading.number:
            system = system.at(dict(self.reading.number.values))
        if not isinstance(self.options, gw.studies.SettleStudyOptions):
            system = system.at({self.options.parameter: self.options.begin})
        return gw.Study(
            system,
            self.options,
            f"Padmanabhan and Singh (1995), set of figure {self.case} ({self.reading})",
        )


# Isolated branches of period 1: Newton's method finds them whether they are stable or not, so transients may be short.
_SEARCH = gw.SearchOptions(starts=8, periods=2, newton_starts=8, newton_periods=(1,), patience=64)


def _branches(
    case: str,
    name: str = "",
    *,
    parameter: str = "frequency",
    over: tuple[float, float] = (2.0, 0.15),
    max_period: int = 1,
    search_values: int | tuple[float, ...] = 0,
    changes: Mapping[str, float] | None = None,
    effort: float = 2.0,
) -> Job:
    """A diagram: motions of period 1 over one parameter, and the branches that leave them.

    Where the paper says nothing of longer periods, none is followed.
    """
    options = gw.studies.DiagramStudyOptions(
        parameter,
        *over,
        MEASURE,
        max_period=max_period,
        max_branches=40,
        workers=1,  # several jobs are done at the same time
        search_values=search_values,
        search=_SEARCH,
    )
    return Job(case=case, options=options, name=name, changes=changes or {}, effort=effort)


def _balance(case: str, harmonics: int) -> Job:
    """The response of period 1 by harmonic balance.

    At the moderate stiffness ratio it has as many harmonics as the paper takes for its lighter loads (section 5: 15 to
    20). The truncation may be large: the comparison with shooting shows what it does.
    """
    walk = gw.WalkOptions(largest_step=0.02)
    options = gw.studies.ResponseOptions(
        "frequency", 2.0, 0.15, MEASURE, method=gw.Balance(harmonics, error=0.05), walk=walk
    )
    return Job(case=case, options=options, name=f"{case}-balance", effort=1.0)


_TRANSIENT = 4000  # forcing periods at most until a motion has settled


def _motion(
    case: str,
    name: str = "",
    changes: Mapping[str, float] | None = None,
    *,
    signal: str = "q1",
    start: str | tuple[float, ...] = "rest",
    max_periods: int = 4096,
    effort: float = 0.5,
) -> Job:
    """A settled motion. The sign of the largest exponent decides its kind, so errors may be of a tenth."""
    lyapunov = gw.analysis.LyapunovOptions(max_periods=max_periods, relative=0.1)
    options = gw.studies.SettleStudyOptions(max_periods=_TRANSIENT, signal=signal, start=start, lyapunov=lyapunov)
    return Job(case=case, options=options, name=name, changes=changes or {}, effort=effort)


# Isolated branches away from 0 come in pairs, since the sign of Te1 is a shift by half a period: one of each pair is
# searched for.
_OVER_AMPLITUDE = _branches(
    "27",
    parameter=_AMPLITUDE,
    over=(-0.8, 0.8),
    search_values=tuple(round(0.125 + 0.2 * place, 3) for place in range(4)),
    effort=5.0,
)

# The place nearest to the printed numbers of figures 5 and 6 that was found to have both of their motions, with all
# multipliers below 0.9 (docs/numerics/reproduction.md: how). Over Te1 or Tm1 alone each of them exists, but not both at
# one place.
_NEAR = {"mean.q1": 0.2143, "mean.q3": 0.2047, _AMPLITUDE: 0.2968, "frequency": 0.1679}
_FOUR_PEAKS = (2.432, 0.709, 0.46, 0.282)  # a state on the motion of figure 5
_VERY_LOW = {"mean.q1": 0.05, "mean.q3": 0.05, "frequency": 0.35}

_SHOWN = (  # in figures
    _motion("3-impact", signal="q1''"),
    _motion("3-viscous", signal="q1''"),
    _branches("4a", max_period=2),
    _branches("4b", max_period=2),
    _motion("5", "5-near", _NEAR | {_BETA: 0.1103}, signal="stage2"),
    _motion("6", "6-near", _NEAR, signal="stage2", start=_FOUR_PEAKS),
    # Three times the viscous damping, and the impact damping that gives the nearest force: the paper prints neither.
    _motion("7-viscous", "7-viscous-near", _NEAR | {"damping.q1.q1": 0.12, "damping.q3.q1": -0.12}, start=_FOUR_PEAKS),
    _motion("7-impact", "7-impact-near", _NEAR | {_BETA: 0.287}, start=_FOUR_PEAKS),
    _motion("8a", "8-impact", _VERY_LOW),
    _motion("6", "8-viscous", _VERY_LOW),
    _branches("9a", max_period=2),
    _branches("9b"),
    _balance("9a", 12),
    _balance("9b", 20),
    _branches("10b"),
    _branches("11a"),
    _branches("11b", over=(2.0, 0.4)),  # below, K12 as it can be read has a thicket of which the paper says nothing
    _branches("12"),
    _branches("13", max_period=2),
    _branches("13", "13-doubled", over=(0.8, 0.64), max_period=4, effort=1.0),
    _branches("15"),
    # The two loops of period 2 that the paper draws; the lower one doubles again.
    _branches("15", "16-high", over=(1.25, 1.05), max_period=2),
    _branches("15", "16", over=(0.43, 0.38), max_period=2, effort=3.0),
    _branches("15", "16-doubled", over=(0.43, 0.406), max_period=4, effort=2.0),
    # Where the motions of these three figures are: the printed frequencies have none of them.
    _motion("15", "17-near", {"frequency": 0.864}),
    _motion("15", "18-near", {"frequency": 0.855}, max_periods=2048, effort=3.0),
    # After 4096 forcing periods the largest exponent may still be zero: 0.019 +- 0.006.
    _motion("15", "19-near", {"frequency": 0.833}, start=(0.5, 1.0, 0.5, 0.5), max_periods=8192, effort=5.0),
    _branches("20a"),
    _branches("20b", max_period=2, effort=4.0),
    _branches("22"),
    _branches("23b"),
    _branches("24"),
    _branches("25"),
    _branches("26b"),
    _OVER_AMPLITUDE,
    replace(_OVER_AMPLITUDE, case="28"),
    _branches("29", parameter=_AMPLITUDE, over=(0.02, 1.0), max_period=2, effort=6.0),
    _branches("29", "29-doubled", parameter=_AMPLITUDE, over=(0.235, 0.265), max_period=4, effort=5.0),
)

_RAISED = {"7-viscous": dict(_c11(0.08)), "7-impact": {_BETA: 0.40}}  # not printed: chosen so that the forces match

TORI = (0.58, 0.6, 0.61, 0.62, 0.81)
"""Frequencies at which the claim on the tori of figure 11b integrates."""

_CHECKED = (  # in claims only
    _motion("5", signal="stage2"),
    _motion("6", "6-near-rest", _NEAR),
    _motion("6", signal="stage2"),
    *(_branches(case, f"{case}-response") for case in ("5", "6")),
    *(_motion(case, f"{case}-raised", changes) for case, changes in _RAISED.items()),
    *(_motion("11b", f"11b-{value}", {"frequency": value}, effort=1.5) for value in TORI),
    # The sets of figures 27 and 13 have the same numbers but for the second harmonic.
    _branches("27", "13-dual", changes={_AMPLITUDE: 0.25}),
    *(
        _branches("27", f"13-dual-{turn}", changes={_AMPLITUDE: 0.25, "harmonic2.phase": math.radians(turn)})
        for turn in (120, 180)
    ),
    _branches("27", "15-dual", changes={_AMPLITUDE: 0.5}, effort=4.0),
    _motion("15", "15-0.4", {"frequency": 0.4}, effort=2.0),
    _motion("17"),
    _motion("18"),
    _motion("19"),
    # From a start that leads to period 3 where the first stage is left out; for the printed numbers it is not needed.
    *(_motion(case, f"{case}-start", start=(-0.3, 0.3, 1.9, -0.2), effort=1.5) for case in ("17", "18", "19")),
    _motion("5", "5-start", start=(0.74, 1.66, 0.68, 2.5)),
    _branches("23b", "23b-180", changes={"harmonic2.phase": math.pi}),
    *(_motion("27", f"27-{value}", {_AMPLITUDE: value}) for value in (0.3, 0.34, 0.4, 0.44)),
    *(_motion("29", f"29-{value}", {_AMPLITUDE: value}, effort=0.5) for value in (0.5, 0.58)),
    _motion("29", "29-0.27", {_AMPLITUDE: 0.27}, effort=3.0),
    *(_motion("29", f"29-{value}", {_AMPLITUDE: value}, effort=0.5) for value in (0.65, 0.8, 0.95)),
)

JOBS = {job.key: job for job in (*_SHOWN, *_CHECKED)}
"""All jobs by their keys, in the default reading."""
