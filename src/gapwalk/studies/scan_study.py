"""The study of claims over variations: which change of a system makes what is described of it hold."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationInfo

from gapwalk.answers.scan import FAILS, HOLDS, UNKNOWN, Scan, ScanCheck, Variations, variations
from gapwalk.answers.scan_claims import (
    AlikeClaim,
    AnyClaim,
    Course,
    LoopClaim,
    MotionClaim,
    PointClaim,
    RangeClaim,
    Settled,
    SizeClaim,
    check_claims,
    fixed_by,
    said,
)
from gapwalk.attractors.many_motions import (
    BatchMotions,
    ExactMotions,
    ManyMotions,
    enough,
    finite_rows,
    has_kernel,
    motions_of,
)
from gapwalk.attractors.regimes import Regime, RegimeOptions, judge, regime_word, take_another_look
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.bifurcation.kinds import Kind
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit, initial_state
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies import functions
from gapwalk.studies.options import check_measure
from gapwalk.studies.study_kind import INLINE, OPEN, Found, Job, StudyKind
from gapwalk.studies.study_schema import Surroundings, key_type, number_in_unit

if TYPE_CHECKING:
    from typing import Self


Motion = tuple[int, int]
"""A `Regime` as a number, and the period of a periodic motion."""

# Work on a scan: claims judged for many variations, in chunks, then the best ones again with the exact flow.

CHUNK = 8
"""Variations in a chunk of settled motions: one piece of work, and what a killed run loses at most."""
_STEPS = 400  # per forcing period from which on the exact flow is faster for one variation
_FAR = 1000.0  # times the box of starts: a motion that goes so far does not come back
_LOOKS, _BETWEEN = 8, 4  # how often it is looked for, and after how many forcing periods each time


@dataclass(frozen=True, eq=False)
class ScanChunk:
    """Outcomes of the claims for some variations in a row."""

    number: int  #: Number of the chunk.
    #: holds, amounts: As in `gapwalk.ask.Scan`.
    holds: NDArray[np.int_]
    amounts: NDArray[np.float64]
    error: float  #: Error of the batch integrator.


SCANNED = Part("scanned", ScanChunk, numbered=True)


@dataclass(frozen=True)
class _Scanner:
    """Judges all claims for some variations; other processes can do it."""

    system: System
    asked: ScanStudy
    names: tuple[str, ...]

    @property
    def _claims(self) -> tuple[AnyClaim, ...]:
        return self.asked.claims

    @property
    def _places(self) -> list[Mapping[str, float]]:
        """The different values of parameters at which claims speak of motions."""
        places: list[Mapping[str, float]] = []
        for claim in self._claims:
            if isinstance(claim, MotionClaim) and claim.at not in places:
                places.append(claim.at)
        return places

    def judge(self, values: NDArray[np.float64]) -> tuple[NDArray[np.int_], NDArray[np.float64], float]:
        """Return what the claims come to for variations whose values have the shape (count, names)."""
        holds = np.full((len(values), len(self._claims)), UNKNOWN)
        amounts = np.full(holds.shape, np.nan)
        settled, error = self.settle(values)
        for index, row in enumerate(values):
            walks = self._walks(self._system(row))
            for number, claim in enumerate(self._claims):
                if isinstance(claim, MotionClaim):
                    found = claim.judge(self._with_patterns(claim, row, *settled[index][self._places.index(claim.at)]))
                else:
                    known = [walks[course] for course in claim.courses]
                    found = claim.judge(*known) if all(known) else (None, np.nan)
                holds[index, number] = UNKNOWN if found[0] is None else HOLDS if found[0] else FAILS
                amounts[index, number] = found[1]
        return holds, amounts, error

    def settle(self, values: NDArray[np.float64]) -> tuple[list[list[tuple[list[Motion], NDArray[np.float64]]]], float]:
        """Return the motions, and their last states, of all starts: for each variation, at each place of a claim."""
        places = self._places
        if not places:
            return [[] for _ in values], 0.0
        starts = self._starts()
        by_name = self._lanes(values, starts)
        begun = self._begin(by_name, np.tile(starts, (len(values) * len(places), 1)))
        motions, states, error = self._settled(by_name, begun, len(values))
        shape = len(values), len(places), len(starts)
        kinds = np.array(motions).reshape(*shape, 2)
        ends = states.reshape(*shape, -1)
        for v, p in np.ndindex(shape[:2]):
            self._look_again(kinds[v, p], ends[v, p], self._system(values[v]).at(places[p]), places[p])
        return [
            [([(int(a), int(b)) for a, b in kinds[v, p]], ends[v, p]) for p in range(shape[1])] for v in range(shape[0])
        ], error

    def _lanes(self, values: NDArray[np.float64], starts: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the values of the parameters of all motions: of each variation, at each place, from each start."""
        places = self._places
        by_name = dict(zip(self.names, np.repeat(values, len(places) * len(starts), axis=0).T, strict=True))
        for name in sorted({name for place in places for name in place}):
            own = [place.get(name, float(self.system[name])) for place in places]
            by_name[name] = np.tile(np.repeat(own, len(starts)), len(values))
        return by_name

    def _begin(self, by_name: dict[str, NDArray[np.float64]], states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Follow the first periods with the exact flow; motions that go far away become nan."""
        # A variation without a bounded motion would take very small steps, and many of them, before it is given up.
        motions, reach = ExactMotions(self.system, by_name), _FAR * state_box(self.system)
        for _ in range(_LOOKS):
            states = motions.advance(states, _BETWEEN)
            with np.errstate(invalid="ignore"):
                states[(np.abs(states[:, : len(reach)]) > reach).any(axis=1)] = np.nan
        return states

    def _settled(
        self, by_name: dict[str, NDArray[np.float64]], states: NDArray[np.float64], count: int
    ) -> tuple[list[Motion], NDArray[np.float64], float]:
        """Classify the motions of a number of variations, side by side."""
        # A variation that needs many more steps than the others, or the exact flow, would take all of them along: they
        # are halved until it stands alone, and alone it is followed by the exact flow.
        left = finite_rows(states)
        if not left.any():
            return [(int(Regime.RUNAWAY), 0)] * len(states), states, 0.0
        # those that have gone away keep their places, as motions of the model that set no steps
        by_name = {name: np.where(left, each, float(self.system[name])) for name, each in by_name.items()}
        motions: ManyMotions = motions_of(self.system, np.where(left[:, None], states, 0.0), by_name)
        if has_kernel(self.system) and not (isinstance(motions, BatchMotions) and motions.steps <= _STEPS):
            if count > 1:
                half = count // 2
                cut = half * (len(states) // count)
                parts = [(slice(None, cut), half), (slice(cut, None), count - half)]
                one, two = (
                    self._settled({name: each[part] for name, each in by_name.items()}, states[part], number)
                    for part, number in parts
                )
                return one[0] + two[0], np.concatenate([one[1], two[1]]), max(one[2], two[2])
            motions = ExactMotions(self.system, by_name)
        structure = self.system.structure
        paces = by_name.get(structure.pace, np.full(len(states), float(self.system[structure.pace])))
        scales = np.array([self.system.state_scales(1.0, structure.frequency * each) for each in paces.tolist()])
        work = partial(judge, states=states, scales=scales, options=self.asked.judging)
        verdicts, error = enough(motions, work)
        kinds = list(zip(verdicts.regimes.tolist(), verdicts.periods.tolist(), strict=True))
        return kinds, verdicts.states, error

    def _look_again(
        self, kinds: NDArray[np.int_], states: NDArray[np.float64], system: System, place: Mapping[str, float]
    ) -> None:
        """Classify motions that seem quasi-periodic with the exact flow, where a claim speaks of such motions."""
        torus = int(Regime.QUASI_PERIODIC), 0
        claims = (claim for claim in self._claims if isinstance(claim, MotionClaim) and claim.at == place)
        if any(claim.matches(Settled(*torus)) for claim in claims):
            for start in np.flatnonzero(np.isin(kinds[:, 0], (Regime.QUASI_PERIODIC, Regime.UNDECIDED))).tolist():
                kinds[start] = take_another_look(system, states[start])

    def _walks(self, system: System) -> dict[Course, Sequence[Branch]]:
        """Walk all courses of the claims; a walk with the branches that leave it serves those without them too."""
        walked = (claim for claim in self._claims if not isinstance(claim, MotionClaim))
        courses = dict.fromkeys(course for claim in walked for course in claim.courses)
        wider = {course: course._replace(doubled=True) for course in courses}
        walks = {c: self._walk(system, c) for c, wide in wider.items() if c == wide or wide not in courses}
        return walks | {c: walks[wide][:1] for c, wide in wider.items() if c not in walks}

    def _walk(self, system: System, course: Course) -> Sequence[Branch]:
        """Walk a branch, and those of twice the period that leave it if they are wanted; none without a first orbit."""
        begin = system.at({**dict(course.at), course.parameter: course.begin})
        try:
            orbit = find_orbit(begin, course.period)
            if not course.doubled:
                return (follow(orbit, course.parameter, course.end),)
            ends = min(course.begin, course.end), max(course.begin, course.end)
            options = {"start": orbit, "max_period": 2 * course.period, "workers": 1}
            return tuple(functions.diagram(begin, course.parameter, ends, **options).branches)
        except NumericalError:
            return ()

    def _with_patterns(
        self, claim: MotionClaim, row: NDArray[np.float64], motions: Sequence[Motion], states: NDArray[np.float64]
    ) -> list[Settled]:
        """Return what starts settle on, with the contact patterns of periodic motions if a claim speaks of them."""
        settled, known = [], dict[str, str]()
        system = self._system(row).at(claim.at)
        for (regime, period), state in zip(motions, states, strict=True):
            each = Settled(regime, period)
            if claim.hits and claim.matches(each._replace(pattern=claim.hits)):
                key = np.array2string(state, precision=6)  # most starts lead to the same motion
                if key not in known:
                    try:
                        known[key] = find_orbit(system, period, start=state).pattern
                    except NumericalError:
                        known[key] = ""
                each = each._replace(pattern=known[key])
            settled.append(each)
        return settled

    def _starts(self) -> NDArray[np.float64]:
        rest = np.asarray(initial_state(self.system, "rest"))[None, :]
        if self.asked.starts == 1:
            return rest
        others = spread_starts([self.system], state_box(self.system), self.asked.starts - 1, self.asked.seed, 0.0)
        return np.concatenate([rest, others])

    def _system(self, row: NDArray[np.float64]) -> System:
        return self.system.at(dict(zip(self.names, row.tolist(), strict=True)))

    def check(self, row: NDArray[np.float64]) -> tuple[int, list[str]]:
        """Classify the motions of one variation again with the exact flow, one of each kind at each place."""
        (settled,), _ = self.settle(row[None, :])
        checked, sentences = 0, []
        for place, (kinds, states) in zip(self._places, settled, strict=True):
            system = self._system(row).at(place)
            for kind in dict.fromkeys(kinds):
                exact = take_another_look(system, states[kinds.index(kind)])
                checked += 1
                if exact != kind:
                    where = ", ".join(f"{name} = {value:g}" for name, value in place.items())
                    sentences.append(f"at {where}: {regime_word(*kind)}, but {regime_word(*exact)} by the exact flow")
        return checked, sentences


def _scan_piece(scanner: _Scanner, piece: tuple[int, NDArray[np.float64]]) -> ScanChunk:
    number, values = piece
    return ScanChunk(number, *scanner.judge(values))


def _check_piece(scanner: _Scanner, piece: tuple[int, NDArray[np.float64]]) -> tuple[int, list[str]]:
    return scanner.check(piece[1])


MAX_VARIATIONS = 1_000_000
"""Largest number of variations of a study."""
Count = Annotated[int, Ge(0), Le(MAX_VARIATIONS)]


@dataclass(frozen=True, slots=True)
class ClaimTable:
    """Table of a claim: what it speaks of (the first keys; one of them), and its range or its values."""

    #: Kind of motion on which starts settle: ``"period 3"``, ``"periodic"``, ``"quasi-periodic"`` or ``"chaotic"``.
    motion: str | None = None
    point: str | None = None  #: A kind of special point that lies in the range.
    no: str | None = None  #: A kind of special point of which none lies in the range.
    #: Nature of the motions that extend from one end of the range to the other: ``"doubled"`` (a multiplier beyond -1),
    #: ``"folded"`` (beyond +1), ``"pair"`` (quasi-periodic motions leave there), ``"unstable"`` or ``"stable"``.
    range: str | None = None
    width: str | None = None  #: Nature of motions, as in `range`, whose total width is said.
    peak: str | None = None  #: A measure, such as ``"half.q1"``, whose largest value is said.
    place: str | None = None  #: A measure; the value of the parameter at its peak is said.
    alike: str | None = None  #: A measure, or a kind of special point, that is alike in another model.
    loop: Counted | None = None  #: Period of a closed branch that leaves another one at a flip and returns to it.
    parameter: str | None = None  #: Parameter of the range; by default the frequency or speed.
    #: begin, end: The range, the lower end first.
    begin: Annotated[Any, Field(alias="from")] = None
    end: Annotated[Any, Field(alias="to")] = None
    #: Range over which the branch is walked, from the first value to the second; by default the range of the claim,
    #: from its upper end.
    over: Annotated[Any, Field()] = None
    #: Number m of forcing periods after which the orbits of the branch repeat; ``[1, 2]`` speaks of the branch and of
    #: those of twice the period that leave it.
    period: Annotated[Any, Field()] = 1
    at: Annotated[Any, Field()] = None  #: Values of parameters, by name, at which it is said.
    share: float = 0.0  #: Least share of the starts that must settle on the motion; at 0, one start is enough.
    #: Contact pattern of the motion: ``"4+/1-"`` for four impacts on the positive side and one on the other.
    hits: str = ""
    says: str = ""  #: The claim in your own words, for tables and pictures.
    #: Largest distance of the ends of a range, in the unit of the parameter; or largest relative difference of what is
    #: alike.
    within: Annotated[Any, Field()] = None
    least: Annotated[Any, Field()] = None  #: Least width, peak or place.
    most: Annotated[Any, Field()] = None  #: Largest width, peak or place.
    than: Annotated[Any, Field()] = None  #: Values of parameters, by name, of the model that is alike.
    larger_than: Annotated[Any, Field()] = None  #: Values of the model in which the width, peak or place is smaller.
    smaller_than: Annotated[Any, Field()] = None  #: Values of the model in which it is larger.

    def __post_init__(self) -> None:
        named = [name for name in _SPOKEN if getattr(self, name) is not None]
        if len(named) != 1:
            raise ModelError(
                f"a claim names {' and '.join(named) or 'nothing'}; write one of {', '.join(_SPOKEN)}, as in "
                '{ motion = "period 3", at = { frequency = 0.63 } }, { point = "flip", from = 0.62, to = 0.85 } or '
                '{ peak = "half.q1", from = 0.4, to = 0.8, least = 2.0 }'
            )
        (name,) = named
        useful = {"within": ("range", "alike"), "than": ("alike",), "share": ("motion",), "hits": ("motion",)}
        useful |= dict.fromkeys(("least", "most", "larger_than", "smaller_than"), ("width", "peak", "place"))
        for key, users in useful.items():
            if getattr(self, key) not in (None, "", 0.0) and name not in users:
                raise ModelError(f"{key} has no meaning in a claim about {name}; it belongs to {' or '.join(users)}")

    def claim(self, system: System) -> AnyClaim:
        """Return the claim that it describes."""
        at = _values(system, self.at or {}, "at")
        if self.motion is not None:
            if self.begin is not None or self.end is not None or self.over is not None:
                raise ModelError("a claim about a motion has no range; write at = { frequency = 0.63 }")
            return MotionClaim(self.motion, at, self.share, self.hits, self.says)
        name = self.parameter or system.structure.pace
        if self.begin is None or self.end is None:
            raise ModelError("a claim about a branch has no range; write from = 0.62 and to = 0.85")
        low, high = (number_in_unit(system, name, each) for each in (self.begin, self.end))
        over = None
        if self.over is not None:
            if not isinstance(self.over, list) or len(self.over) != 2:
                raise ModelError(
                    f"over is {self.over!r}; write where the walk begins and ends, as in over = [2.0, 0.5]"
                )
            first, last = (number_in_unit(system, name, each) for each in self.over)
            over = first, last
        where: dict[str, Any] = {
            "parameter": name,
            "low": low,
            "high": high,
            "over": over,
            "period": _periods(self.period),
            "at": at,
            "says": self.says,
        }
        if self.loop is not None:
            return LoopClaim(**{**where, "period": self.loop})
        if self.alike is not None:
            than = _values(system, self.than or {}, "than")
            return AlikeClaim(self.alike, 0.05 if self.within is None else float(self.within), **where, than=than)
        if self.range is not None:
            within = None if self.within is None else number_in_unit(system, name, self.within)
            return RangeClaim(self.range, **where, within=within)
        if (kind := self.point or self.no) is not None:
            return PointClaim(Kind.named(str(kind)), **where, absent=self.no is not None)
        size = next(each for each in ("width", "peak", "place") if getattr(self, each) is not None)
        bounds = (
            None if each is None else each if size == "peak" else number_in_unit(system, name, each)
            for each in (self.least, self.most)
        )
        other = self.larger_than or self.smaller_than or {}
        return SizeClaim(
            size, getattr(self, size), **where, **dict(zip(("least", "most"), bounds, strict=True)),
            than=_values(system, other, "larger_than" if self.larger_than else "smaller_than"),
            smaller=self.smaller_than is not None,
        )  # fmt: skip


_SPOKEN = ("motion", "point", "no", "range", "width", "peak", "place", "alike", "loop")


def _periods(value: Any) -> int | tuple[int, int]:
    """Return a period, or a pair of them."""
    whole: list[Any] = value if isinstance(value, list) else [value]
    if not all(isinstance(each, int) and not isinstance(each, bool) for each in whole) or len(whole) not in (1, 2):
        raise ModelError(f"period is {value!r}; write a number of forcing periods, or one and its double: [1, 2]")
    return whole[0] if len(whole) == 1 else (whole[0], whole[1])


def _values(system: System, table: object, key: str) -> dict[str, float]:
    """Return values of parameters by name; a file may write the names in quotes, or as tables in tables."""
    if not isinstance(table, Mapping):
        raise ModelError(f"{key} is {table!r}; write values of parameters, as in {key} = {{ frequency = 0.63 }}")
    return {name: number_in_unit(system, name, value) for name, value in _leaves(table)}


def _leaves(table: Mapping[str, object], above: str = "") -> Iterator[tuple[str, object]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def _check(system: System, claims: Sequence[AnyClaim]) -> None:
    """Refuse claims about parameters, values or measures that a system does not have."""
    check_claims(system, claims)
    for claim in claims:
        if isinstance(claim, (SizeClaim, AlikeClaim)) and claim.is_measure:
            try:
                check_measure(system, claim.of)
            except ValueError as error:
                raise ModelError(f"the measure of a claim {error}") from None


def _known(parameters: tuple[str, ...] | None, info: ValidationInfo[Surroundings]) -> tuple[str, ...]:
    if info.context.system:
        for name in parameters or ():
            info.context.system.structure.place(name)
    return tuple(parameters or ())


@dataclass(frozen=True)
class ScanStudy(StudyKind):
    """A scan: which claims hold for which variations of a system, and how likely it is that a hit is luck.

    Raises
    ------
    ModelError
        For unknown parameters, or a parameter that varies and has a value in a claim.

    Examples
    --------
    >>> claims = [gw.ask.PointClaim("fold", parameter="frequency", low=1.3, high=1.45, over=(1.6, 1.1))]
    >>> found = gw.ask.scan(system, claims, ["harmonic1.amplitude"], factors=(0.5,), neighbours=0)
    >>> found.holds.tolist()  # the model, and half of its excitation
    [[1], [0]]
    """

    kind: ClassVar[str] = "scan"
    gives_frequency: ClassVar[bool] = False
    stored: ClassVar[tuple[Part, ...]] = (SCANNED,)
    answer: ClassVar[Part | None] = Part("scan", Scan)
    arguments: ClassVar[tuple[str, ...]] = ("claims", "parameters")
    table_types: ClassVar[Mapping[str, Any]] = {
        "claims": None,
        "claim": (
            Annotated[
                list[key_type(ClaimTable)],
                Field(description='write tables [[study.claim]], as with motion = "period 3"', min_length=1),
            ],
            ...,
        ),
        "parameters": Annotated[
            list[str] | None,
            Field(description='write the parameters that vary, as in parameters = ["mean.q1"]'),
            AfterValidator(_known),
        ],
        "listed": Annotated[list[dict[str, Any]], Field()],
    }

    claims: tuple[AnyClaim, ...] = field(kw_only=True)  #: The claims. In a table they are tables ``[[study.claim]]``.
    #: The parameters that vary; by default all that are not 0 and have no value in a claim.
    parameters: Annotated[tuple[str, ...], OPEN] = ()
    listed: tuple[Mapping[str, float], ...] = ()  #: Further variations that are tried: values of parameters by name.
    #: Factors by which each parameter is multiplied, one at a time; 0 leaves it out.
    factors: tuple[float, ...] = (0.0, 0.5, 0.8, 0.9, 1.1, 1.25, 2.0)
    pairs: Count = 0  #: Number of random pairs of these changes that are tried too.
    #: Number of random neighbours, with all parameters multiplied by random factors, to estimate the chance of luck.
    neighbours: Count = 200
    spread: Annotated[float, Gt(0)] = 0.1  #: Standard deviation of the logarithm of their factors.
    #: Starts of the motions of each variation: rest, and states spread over a box.
    starts: Annotated[int, Ge(1), Le(MAX_VARIATIONS)] = 6
    seed: Natural = 0  #: Seed of the random numbers.
    #: Criteria that separate kinds of motion.
    judging: Annotated[RegimeOptions, INLINE] = field(default_factory=lambda: RegimeOptions(forces=False))
    check: Count = 3  #: Number of the best variations whose motions are classified again with the exact flow.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table."""
        rest = dict(values)
        claims = tuple(table.claim(system) for table in rest.pop("claim"))
        listed = tuple(_values(system, each, "listed") for each in rest.pop("listed", ()))
        _check(system, claims)
        return cls(**rest, claims=claims, listed=listed)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        count = len(self.claims)
        what = ", ".join(self.parameters) or "all parameters"
        return (
            f"scan of {count} claim{'s' if count != 1 else ''} over variations of {what}, with {self.neighbours:,} "
            "random neighbours"
        )

    def refuse_invalid(self, system: System) -> None:
        """Refuse claims and variations that are not possible."""
        _check(system, self.claims)
        self._variations(system)

    def _variations(self, system: System) -> Variations:
        names = ("factors", "pairs", "listed", "neighbours", "spread", "seed")
        options: dict[str, Any] = {name: getattr(self, name) for name in names}
        return variations(system, self.parameters, fixed=fixed_by(self.claims), **options)

    def _every(self, job: Job) -> Variations:
        return job.cached("variations", lambda: self._variations(job.system))

    def _pieces(self, every: Variations) -> dict[int, tuple[int, NDArray[np.float64]]]:
        """Return the chunks of variations by number."""
        size = self._size
        firsts = enumerate(range(0, len(every), size))
        return {number: (number, every.values[first : first + size]) for number, first in firsts}

    @property
    def _size(self) -> int:
        return CHUNK if all(isinstance(claim, MotionClaim) for claim in self.claims) else 1

    def do(self, job: Job) -> Generator[Found]:
        """Judge the variations that are left; then compare the best ones with the exact flow."""
        every = self._every(job)
        scanner = _Scanner(job.system, self, every.names)
        # those that are walked may take long, and each other's states are not needed: any order will do
        yield from job.each(SCANNED, partial(_scan_piece, scanner), self._pieces(every))
        found = self._found(job, every, complete=True)
        best = [index for index in found.best[: self.check] if found.scores[index] > 0]
        pieces = [(index, every.values[index]) for index in best]
        checked, different = 0, []
        for _, (count, sentences) in job.workers.each(partial(_check_piece, scanner), pieces):
            checked += count
            different += sentences
        yield job.end(self._found(job, every, complete=True, check=ScanCheck(checked, tuple(different))))

    def check_read(self, job: Job) -> None:
        """Raise a ValueError if the scan has other claims."""
        assert self.answer is not None
        whole = job.one(self.answer)
        if whole is not None and whole.claims != self.claims:
            raise ValueError("the scan does not belong to the study")

    def total(self, job: Job) -> int:
        """Return the number of parts: the chunks, and the record."""
        return len(self._pieces(self._every(job))) + 1

    def so_far(self, job: Job) -> Scan | None:
        """Return the scan of the chunks that are done; None before the first."""
        return self._found(job, self._every(job), complete=False) if job.known[SCANNED] else None

    def _found(self, job: Job, every: Variations, *, complete: bool, check: ScanCheck | None = None) -> Scan:
        shape = len(every), len(self.claims)
        holds, amounts = np.full(shape, UNKNOWN), np.full(shape, np.nan)
        chunks = job.known[SCANNED]
        for number, chunk in chunks.items():
            part = slice(number * self._size, number * self._size + len(chunk.holds))
            holds[part], amounts[part] = chunk.holds, chunk.amounts
        notes = [*every.left_out]
        unknown = int((holds == UNKNOWN).sum())
        if not complete:
            notes.append(f"stopped when {len(chunks)} of {len(self._pieces(every))} chunks were done")
        elif unknown:
            notes.append(
                f"{unknown} of {holds.size} verdicts are unknown: no orbit was found, or a walk did not reach the range"
            )
        error = max((chunk.error for chunk in chunks.values()), default=0.0)
        about = holds, amounts, check or ScanCheck(), error, complete, tuple(notes)
        return Scan(job.system, self.claims, every, *about)

    def document(self, found: Scan, points: bool) -> dict[str, Any]:
        """Return the best variations and the chance of luck as JSON values; with all variations if wanted."""
        best = found.best[:20]
        score = int(found.scores[best[0]]) if best else 0
        document: dict[str, Any] = {
            "answer": found.sentence,
            "claims": [said(claim) for claim in found.claims],
            "variations": len(found.variations),
            "model": self._row(found, 0),
            "best": [self._row(found, index) for index in best],
            "luck": plain(found.luck(score)._asdict()),
            "check": {"checked": found.check.checked, "different": list(found.check.different)},
            "error": found.error,
        }
        if points:
            every = range(len(found.variations))
            document["all"] = [self._row(found, index) | {"values": found.variations.of(index)} for index in every]
        return document

    @staticmethod
    def _row(found: Scan, index: int) -> dict[str, Any]:
        return {
            "variation": found.words(index),
            "score": int(found.scores[index]),
            "holds": found.holds[index].tolist(),
            "amounts": plain(found.amounts[index]),
        }
