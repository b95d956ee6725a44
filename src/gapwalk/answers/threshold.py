"""Threshold: the value of a parameter beyond which gaps no longer rattle over a whole range of another one.

The quiet motion begins to rattle where a contact grazes, and rattling motions cease at grazing points or folds. All of
these lie on loci in the plane of both parameters. The threshold is the extremum of the locus that reaches farthest. It
is found from both sides, and then confirmed: many motions from random starts just beyond it are followed until they
have settled. If one of them rattles, its own border is followed in the same way.

Method: docs/studies.md
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import contact_place, gap_state
from gapwalk.answers.locus_extremum import Extremum, locus_extremum
from gapwalk.attractors.many_motions import motions_of
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.bifurcation.branch_start import start_branch
from gapwalk.bifurcation.branch_tracer import BranchTracer
from gapwalk.bifurcation.isolated.search_options import spread_starts, state_box
from gapwalk.bifurcation.kinds import Kind
from gapwalk.bifurcation.loci.gradient import Gradient
from gapwalk.bifurcation.loci.locus import Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_symbol, value_words
from gapwalk.notebook import Shown
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit
from gapwalk.summary import Rows, SummaryParts, Tables, remarks, summarizes

_COARSE = 9  # values of the parameter at which motions are tried first
_FEW = 2  # starts at each pair of values then
_AGAIN = 2  # further transients, of the same length, after which impacts count as those of a settled motion
_WATCHED = 32  # forcing periods over which impacts are counted
_BEYOND = 1e-3  # distance beyond the threshold, in widths of the range, at which it is confirmed
_NEAR = 0.1  # share of the range of the other parameter about the limit in which half of all motions are tried
_SETTLE = SettleOptions(max_periods=1500)


@dataclass(frozen=True, slots=True)
class ThresholdOptions:
    """Options of a threshold.

    Parameters
    ----------
    values
        Values of the other parameter at which motions are tried.
    starts
        Starts at each of them: rest, and states spread over a box.
    periods
        Forcing periods after which a motion counts as settled.
    rounds
        The most borders that are followed one after the other.
    seed
        Seed of the starts.
    """

    values: int = 24
    starts: int = 10
    periods: int = 200
    rounds: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("values", 4), ("starts", 2), ("periods", 16), ("rounds", 1), ("seed", 0)):
            given = getattr(self, name)
            if isinstance(given, bool) or not isinstance(given, int) or given < least:
                raise ModelError(f"{name} is {given!r}; it must be an integer >= {least}")


class Confirmation(NamedTuple):
    """Motions that were tried just beyond a threshold.

    Attributes
    ----------
    value
        Value of the parameter.
    motions
        Number of motions.
    rattling
        Number of those that rattle.
    error
        Largest error of the batch integrator over a forcing period, relative to the size of the motion.
    """

    value: float
    motions: int
    rattling: int
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class Threshold(Shown):
    """Value of a parameter beyond which gaps do not rattle over a range of another one.

    Attributes
    ----------
    system
        The system.
    gaps
        Names of the contacts concerned.
    parameter, begin, end
        The parameter and its range, from the side that rattles to the side that is quiet.
    over, low, high
        The other parameter, and its range.
    limit
        The special point at the threshold, of the branch along `parameter`; None if there is no threshold in the range.
    at
        Value of the other parameter at the limit.
    uncertainty
        Estimated error of the threshold.
    is_edge
        True if the limit lies at an end of the other parameter's range, beyond which it would be farther.
    loci
        Loci that were followed, the decisive one last.
    confirmation
        Motions that were tried just beyond it.
    notes
        Remarks, in sentences.
    """

    system: System
    gaps: tuple[str, ...]
    parameter: str
    begin: float
    end: float
    over: str
    low: float
    high: float
    limit: SpecialPoint | None
    at: float
    uncertainty: float
    is_edge: bool
    loci: tuple[Locus, ...]
    confirmation: Confirmation | None
    notes: tuple[str, ...] = ()

    @property
    def value(self) -> float:
        """The threshold; nan if there is none in the range."""
        return math.nan if self.limit is None else self.limit.value

    @property
    def failures(self) -> tuple[str, ...]:
        """Reason why there is no confirmed threshold, as sentences."""
        found = self.confirmation
        if found is None or not found.rattling:
            return ()
        return (
            f"{found.rattling} of {found.motions} motions rattle beyond it, and their border could not be followed",
        )

    def gradient(self, *names: str) -> Gradient:
        """Return how far other parameters move the threshold; see `SpecialPoint.gradient`.

        At an extremum the slope by the other parameter is zero, so these are the slopes of the limit itself.

        Raises
        ------
        ModelError
            If there is no threshold, or for an unknown parameter.
        """
        if self.limit is None:
            raise ModelError("there is no threshold in the range, so it has no gradient")
        return self.limit.gradient(*names)

    @property
    def complete(self) -> bool:
        """True: a threshold has one part."""
        return True

    def tables(self) -> Tables:
        """Return the table of the loci: both parameters at each of their points."""
        return {"loci": self._rows}

    def _rows(self) -> Rows:
        yield ["locus", "kind", self.over, self.parameter]
        for number, locus in enumerate(self.loci, start=1):
            for value, other in locus.values.tolist():
                yield [number, str(locus.kind), other, value]

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        units = self.system.units
        gaps, whole = " and ".join(self.gaps), f"{self.low:.6g} to {self.high:.6g}"
        over, symbol = parameter_symbol(self.over, units), parameter_symbol(self.parameter, units)
        verb = "does" if len(self.gaps) == 1 else "do"
        if self.limit is None:
            return f"{gaps}: no threshold of {symbol} from {self.begin:.6g} to {self.end:.6g} over {over} from {whole}"
        name, unit = over.partition(" [")[0], units and units.parameter(self.over)
        way = "and above" if self.end > self.begin else "and below"
        return (
            f"{gaps} {verb} not rattle over {name} from {whole}{f' {unit}' if unit else ''} at "
            f"{value_words(self.value, self.parameter, units, 7)} {way} "
            f"(limit: {self.limit.kind.value} at {value_words(self.at, self.over, units, 7)})"
        )

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the answer, its evidence, and what moves it most; with the notes or without."""
        yield self.sentence
        if self.limit is not None:
            place = ", at the end of the range: beyond it the limit is farther" if self.is_edge else ""
            yield f"error of the limit {self.uncertainty:.0e}{place}"
        if (found := self.confirmation) is not None and not found.rattling:
            share = 300.0 / found.motions
            yield (
                f"confirmed at {found.value:.7g}: none of {found.motions:,} settled motions rattles there, "
                f"so with 95 % confidence fewer than {share:.2g} % of such starts do"
            )
        if self.limit is not None:
            with suppress(NumericalError, ModelError):
                yield f"what moves it most, in percent for one percent more: {self.gradient().words(5)}"
        if notes:
            yield from remarks(self.notes, self.failures)

    def plot(self, **options):
        """Draw the loci in the plane of both parameters, with the limit; return the figure."""
        from gapwalk.plot import draw

        return draw(self, **options)

    def __repr__(self) -> str:
        return f"Threshold({self.sentence})"


def find_threshold(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: str,
    span: tuple[float, float],
    gaps: Sequence[str],
    options: ThresholdOptions,
) -> Threshold:
    """Find a threshold; parameters and errors are those of `gapwalk.ask.threshold`."""
    for first, second in ((a, b) for a in to for b in span):
        system.at({parameter: first, over: second})  # refuses what no system can have
    return _Search(_Request(system, tuple(gaps), parameter, to, over, span, options)).run()


class _Request(NamedTuple):
    system: System
    gaps: tuple[str, ...]
    parameter: str
    to: tuple[float, float]
    over: str
    span: tuple[float, float]
    options: ThresholdOptions

    @property
    def way(self) -> int:
        """1 if the quiet side is that of larger values."""
        return 1 if self.to[1] > self.to[0] else -1

    def at(self, value: float, other: float) -> System:
        return self.system.at({self.parameter: value, self.over: other})


class _Hit(NamedTuple):
    """A motion that rattles: values of both parameters, and its state at theta = 0."""

    value: float
    other: float
    state: NDArray[np.float64]


@dataclass
class _Search:
    """Search for a threshold, with what it has found so far."""

    request: _Request
    extrema: list[Extremum] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    _followed: list[float] = field(default_factory=list)
    _motions: int = 0

    def run(self) -> Threshold:
        """Return the threshold."""
        asked, options = self.request, self.request.options
        values = np.linspace(*asked.to, _COARSE)
        hits, _ = self._tried(values, np.linspace(*asked.span, max(8, options.values // 2)), _FEW)
        hit = self._farthest(hits)
        if hit is None:
            self.notes.append("nothing rattles in the whole range")
            return self._found(None)
        if any(each.value == asked.to[1] for each in hits):
            self.notes.append(f"something still rattles at {asked.parameter} = {asked.to[1]:.6g}; widen the range")
            return self._found(None)
        confirmation = None
        for _ in range(options.rounds):
            before = len(self.extrema)
            self._follow(hit)
            best = self._best()
            if best is None or (len(self.extrema) == before and confirmation is not None):
                break
            beyond = best.value + asked.way * _BEYOND * abs(asked.to[1] - asked.to[0])
            if asked.way * (beyond - asked.to[1]) > 0.0:
                beyond = asked.to[1]
            near = _NEAR * (asked.span[1] - asked.span[0])
            low, high = asked.span
            window = max(low, best.at - near), min(high, best.at + near)
            half = options.values // 2
            others = np.unique(np.concatenate((np.linspace(*asked.span, half), np.linspace(*window, half))))
            hits, error = self._tried(np.array([beyond]), others, options.starts, self._carried(best))
            confirmation = Confirmation(beyond, self._motions, len(hits), error)
            hit = self._farthest(hits)
            if hit is None:
                break
        return self._found(confirmation)

    def _found(self, confirmation: Confirmation | None) -> Threshold:
        asked, best = self.request, self._best()
        loci = tuple(each.locus for each in sorted(self.extrema, key=lambda each: asked.way * each.value))
        limit = None if best is None else best.special
        at, error, is_edge = (math.nan, float("inf"), False) if best is None else (best.at, best.error, best.is_edge)
        return Threshold(
            asked.system,
            asked.gaps,
            asked.parameter,
            *asked.to,
            asked.over,
            *asked.span,
            limit,
            at,
            error,
            is_edge,
            loci,
            confirmation,
            tuple(self.notes),
        )

    def _best(self) -> Extremum | None:
        return max(self.extrema, key=lambda each: self.request.way * each.value, default=None)

    def _farthest(self, hits: list[_Hit]) -> _Hit | None:
        return max(hits, key=lambda each: self.request.way * each.value, default=None)

    def _tried(
        self, values: NDArray[np.float64], others: NDArray[np.float64], starts: int, carried: Sequence[NDArray] = ()
    ) -> tuple[list[_Hit], float]:
        """Follow motions at all pairs of values from some starts until they have settled; return those that rattle."""
        asked, options = self.request, self.request.options
        ends = [asked.at(value, other) for value in (values[0], values[-1]) for other in (others[0], others[-1])]
        box = np.max([state_box(end) for end in ends], axis=0)
        some = [np.zeros(asked.system.state_size), *spread_starts(ends, box, starts - 1, options.seed, 0.0), *carried]
        grid = np.array(np.meshgrid(others, values, indexing="ij")).reshape(2, -1).T  # equal speeds side by side
        pairs, states = np.repeat(grid, len(some), axis=0), np.tile(some, (len(grid), 1))
        motions = motions_of(asked.system, states, {asked.over: pairs[:, 0], asked.parameter: pairs[:, 1]})
        found = motions.contacts(motions.advance(states, options.periods), _WATCHED)
        places = [contact_place(asked.system, gap) for gap in asked.gaps]
        rattling = np.flatnonzero((found.impacts[:, places] > 0.0).any(axis=1))
        last = found.states
        for _ in range(_AGAIN):  # a transient may last longer than the others
            if not len(rattling):
                break
            part = motions.part(rattling)
            again = part.contacts(part.advance(last[rattling], options.periods), _WATCHED)
            last[rattling] = again.states
            rattling = rattling[(again.impacts[:, places] > 0.0).any(axis=1)]
        self._motions = len(states)
        hits = [_Hit(float(pairs[k, 1]), float(pairs[k, 0]), last[k]) for k in rattling.tolist()]
        return hits, motions.error

    def _rattles(self, motion) -> bool:
        return any(gap_state(motion, gap).rattles for gap in self.request.gaps)

    def _follow(self, hit: _Hit) -> None:
        """Follow the borders that lie near a rattling motion over the other parameter, and note their extrema."""
        asked = self.request
        ranges = (min(asked.to), max(asked.to)), asked.span
        for special in self._borders(hit):
            if any(abs(special.value - known) <= 1e-8 * abs(known) for known in self._followed):
                continue  # the same border, met from the other side
            self._followed.append(special.value)
            try:
                extremum = locus_extremum(special, asked.parameter, asked.over, ranges, asked.way)
            except (NumericalError, ModelError) as error:
                self.notes.append(f"a {special.kind} at {special.value:.6g} was not followed: {error}")
                continue
            self.extrema.append(extremum)

    def _borders(self, hit: _Hit) -> Iterator[SpecialPoint]:
        """Yield the special points along the parameter at which rattle begins and ceases near a rattling motion."""
        asked = self.request
        with suppress(NumericalError):
            quiet = find_orbit(asked.at(asked.to[1], hit.other))
            if not self._rattles(quiet):
                yield from self._first(quiet, asked.to[0], lambda point: self._rattles(point.orbit))
        with suppress(NumericalError):
            settled = settle(asked.at(hit.value, hit.other), hit.state, _SETTLE)
            if settled.orbit is not None:
                yield from self._first(settled.orbit, asked.to[1], lambda point: not self._rattles(point.orbit))

    def _first(self, orbit: Orbit, end: float, is_over) -> Iterator[SpecialPoint]:
        """Yield the point at which a branch towards a value changes: the first graze of a gap after which it is over.

        Or the fold at which it turns back.
        """
        asked, last = self.request, None
        start = orbit.system[asked.parameter]
        tracer = BranchTracer(start_branch(orbit, asked.parameter, end, 1 if end > start else -1))
        for point, specials in tracer:
            for special in specials:
                if special.kind == Kind.FOLD:
                    yield special
                    return
                if special.kind == Kind.GRAZING and special.contact.split(" ")[0].split(".")[0] in asked.gaps:
                    last = special
            if last is not None and is_over(point):
                yield last
                return

    def _carried(self, best: Extremum) -> list[NDArray[np.float64]]:
        """Return states of rattling motions just inside the threshold, as further starts beyond it."""
        asked = self.request
        inside = best.value - asked.way * _BEYOND * abs(asked.to[1] - asked.to[0])
        states = []
        with suppress(NumericalError):
            settled = settle(asked.at(inside, best.at), best.special.orbit.state * (1.0 + 1e-3), _SETTLE)
            states.append(settled.state)
        return states
