"""One computation that figures and claims rest on: a case, and what is to be done with it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from gapwalk.attractor.lyapunov import LyapunovOptions
from gapwalk.bifurcation.search import SearchOptions
from gapwalk.orbit.balance import Balance
from gapwalk.study.file import Study
from gapwalk.study.options import DiagramStudyOptions, ResponseOptions, StudyOptions
from gapwalk.study.settle.study_options import SettleStudyOptions
from reproductions.padmanabhan_singh_1995.reading import USUAL, Reading

PERIOD_1 = "-period-1"
"""What the keys of jobs end with that leave out longer periods; see `BranchJob.shortest`."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """What is to be done with a case of the paper; subclasses say what.

    Parameters
    ----------
    case
        Name of the parameter set, as in `gapwalk.paper.case`.
    name
        What its files are called; by default as the case.
    reading
        How the paper is read.
    changes
        Other values of parameters than those of the case.
    effort
        Seconds of one core that it takes, roughly: the longest is begun first.
    """

    case: str
    name: str = ""
    reading: Reading = USUAL
    changes: tuple[tuple[str, float], ...] = ()
    effort: float = field(default=2.0, compare=False)

    @property
    def key(self) -> str:
        """What tells it from all others: its name and its reading."""
        return f"{self.name or self.case}{self.reading.suffix}"

    def at(self, reading: Reading) -> Job:
        """The same in another reading; itself, if that changes nothing of its case."""
        return replace(self, reading=reading.of_case(self.case))

    @property
    def begin(self) -> dict[str, float]:
        """Values at which it begins, of parameters that it walks."""
        return {}

    @property
    def options(self) -> StudyOptions:
        """What is to be done, as a study has it."""
        raise NotImplementedError

    @property
    def study(self) -> Study:
        """The study that does it."""
        system = self.reading.system(self.case).at({**dict(self.changes), **self.begin})
        title = f"Padmanabhan and Singh (1995), set of figure {self.case} ({self.reading})"
        return Study(system, self.options, title)


@dataclass(frozen=True, kw_only=True)
class BranchJob(Job):
    """A diagram: motions of period 1 over one parameter, and what is attached to them.

    Parameters
    ----------
    parameter, begins, ends
        The parameter, and the range from the first value to the second.
    max_period, max_branches
        As in `DiagramOptions`.
    search_values
        Values at which branches are sought that hang together with no other.
    short_search
        The same where only period 1 is looked at in another reading (`shortest`); None: as `search_values`.
    """

    parameter: str = "frequency"
    begins: float = 2.0
    ends: float = 0.15
    max_period: int = 4
    max_branches: int = 40
    search_values: int | tuple[float, ...] = 0
    short_search: tuple[float, ...] | None = None

    @property
    def shortest(self) -> BranchJob:
        """The same without motions of longer periods: enough for what is said of period 1 in another reading."""
        values = self.search_values if self.short_search is None else self.short_search
        return replace(self, name=f"{self.name or self.case}{PERIOD_1}", max_period=1, search_values=values)

    # Islands of period 1: Newton's method finds them whether they attract or not, and transients need not wait long.
    _SEARCH: ClassVar = SearchOptions(starts=8, periods=2, newton_starts=24, newton_periods=(1,), patience=64)

    @property
    def begin(self) -> dict[str, float]:
        """The first value of the parameter."""
        return {self.parameter: self.begins}

    @property
    def options(self) -> DiagramStudyOptions:
        """The diagram, done in one process: several jobs are done side by side."""
        return DiagramStudyOptions(
            self.parameter,
            self.begins,
            self.ends,
            "half.q1",
            max_period=self.max_period,
            max_branches=self.max_branches,
            workers=1,
            search_values=self.search_values,
            search=self._SEARCH,
        )


@dataclass(frozen=True, kw_only=True)
class BalanceJob(Job):
    """The branch of period 1 over the frequency by harmonic balance, as figure 9 compares it with shooting.

    Parameters
    ----------
    harmonics
        What the paper takes for its lighter loads (section 5: 15 to 20). The truncation may be large: the comparison
        shows what it does.
    """

    harmonics: int = 20

    @property
    def begin(self) -> dict[str, float]:
        """Where frequency responses begin."""
        return {"frequency": BranchJob.begins}

    @property
    def options(self) -> ResponseOptions:
        """The response."""
        method = Balance(self.harmonics, error=0.01)
        return ResponseOptions("frequency", BranchJob.begins, BranchJob.ends, "half.q1", method=method)


@dataclass(frozen=True, kw_only=True)
class MotionJob(Job):
    """A settled motion.

    Parameters
    ----------
    signal
        What is shown, as in `SettleStudyOptions`.
    start
        ``"rest"``, or the state at theta = 0.
    """

    signal: str = "q1"
    start: str | tuple[float, ...] = "rest"

    @property
    def options(self) -> SettleStudyOptions:
        """The settled motion. Its kind is told by the sign of the largest exponent, so errors may be of a tenth."""
        return SettleStudyOptions(self.signal, self.start, lyapunov=LyapunovOptions(max_periods=4096, relative=0.1))
