"""The study of rattle in production: in how many of all parts gaps rattle at some speeds, how badly, and why.

Each part settles from rest, and from random states if they are asked for; it rattles if one of its motions does.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import BeforeValidator, ValidationInfo

from gapwalk.answers.gap_states import WATCHED, GapVerdicts, chosen_gaps, judge_gaps
from gapwalk.answers.lane_sweep import random_states
from gapwalk.answers.tolerance import BINS, Chance, Spreads, chance_of
from gapwalk.errors import ModelError
from gapwalk.flow.motion import accelerations_at, quadrature
from gapwalk.model.bounds import Counted, Natural
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words, value_words
from gapwalk.notebook import Shown
from gapwalk.orbit.find import initial_state
from gapwalk.picture_parts import Panel, Parts, Picture, Series, pictured
from gapwalk.results.codec import plain_rows
from gapwalk.results.result_file import Part
from gapwalk.studies.rattle_study import GAPS
from gapwalk.studies.study_kind import OPEN, Found, Job, StudyKind
from gapwalk.studies.study_schema import Surroundings
from gapwalk.studies.tolerance_study import (
    SPREAD_KEYS,
    SPREADS,
    check_spreads,
    read_number,
    spreads_of_call,
    with_spreads,
)
from gapwalk.summary import Rows, SummaryParts, Table, Tables, remarks, summarizes

if TYPE_CHECKING:
    from typing import Self

CHUNK = 32
"""Parts in a chunk: one piece of work, and what a killed run loses at most."""
_PATIENCE = 300  # forcing periods of a transient without equal steps
STATES = ("refused", "closed", "open", "quiet so far", "diverged", "one side", "both sides")
"""States of a gap, by their codes: the largest of several motions is that of the part, of several gaps that of any."""
_REFUSED, _SO_FAR, _DIVERGED, _RATTLES = 0, 3, 4, 5
_OF_GAPS = np.array([1, 2, 5, 6, _DIVERGED])  # of those of `GapState`, the last for a motion that diverges
_SURE, _MOST = 3.0, 3  # standard errors beyond chance, and parameters that a line names
_LOOKS = ("first", "second", "third", "fourth", "main", "falling", "other")
_SAID = {
    _REFUSED: "samples do not count, because the model does not allow their values",
    _DIVERGED: "samples do not count for a gap, because a motion diverges",
    _SO_FAR: "samples have a gap that is quiet so far, in a motion without period: it may rattle later",
}


@dataclass(frozen=True, eq=False)
class ChanceChunk:
    """States of the gaps of some parts at all speeds; see `RattleChance`."""

    number: int  #: Number of the chunk.
    samples: NDArray[np.float64]  #: shape (samples, parameters): Values of the parameters that vary.
    codes: NDArray[np.int_]  #: shape (samples, values, names): States.
    rms: NDArray[np.float64]  #: shape (samples, values, names): Accelerations.


@dataclass(frozen=True, eq=False, repr=False)
class RattleChance(Shown):
    """In how many of all parts gaps rattle, how badly, and which parameters matter."""

    system: System  #: The nominal system.
    spreads: Spreads  #: Distribution of the parameters.
    values: tuple[float, ...]  #: Values of the speed, or of the frequency.
    names: tuple[str, ...]  #: The gaps; then ``any gap`` if there are several.
    samples: NDArray[np.float64]  #: shape (samples, parameters): Values of the parameters that vary.
    codes: NDArray[np.int_]  #: shape (samples, values, names): States, the worst of all starts; places in `STATES`.
    #: shape (samples, values, names): Root mean square acceleration behind the gap, the largest of all starts.
    rms: NDArray[np.float64]
    complete: bool = True  #: True if all samples were done.

    def _check_read(self) -> None:
        """Raise a ValueError if its arrays do not fit together."""
        if not self.codes.shape == self.rms.shape == (len(self.samples), len(self.values), len(self.names)):
            raise ValueError("samples, values and gaps do not fit together")

    def at(self, name: str, value: float) -> tuple[NDArray[np.int_], NDArray[np.float64]]:
        """Return states and accelerations of a gap at a value, each with the shape (samples,)."""
        place = self.values.index(value), self.names.index(name)
        return self.codes[:, *place], self.rms[:, *place]

    def chance(self, name: str, value: float) -> Chance:
        """Return the probability that a gap rattles at a value; anything from 0 to 1 if no sample tells."""
        codes, _ = self.at(name, value)
        known = int(np.sum(~np.isin(codes, (_REFUSED, _DIVERGED))))
        return chance_of(int(np.sum(codes >= _RATTLES)), known) if known else Chance(0, 0, np.nan, 0.0, 1.0)

    def level(self, name: str, value: float) -> list[float]:
        """Return mean and 95 % quantile of the acceleration behind a gap; nan if none is known."""
        _, rms = self.at(name, value)
        own = rms[np.isfinite(rms)]
        return [float(own.mean()), float(np.quantile(own, 0.95))] if len(own) else [np.nan, np.nan]

    def influence(self, name: str, value: float) -> NDArray[np.float64]:
        """Return the rank correlation of each parameter with acceleration and rattle, shape (2, parameters); or nan."""
        from scipy.stats import rankdata  # imported late, because the import is slow

        codes, rms = self.at(name, value)
        known = np.isfinite(rms) if np.isfinite(rms).any() else ~np.isin(codes, (_REFUSED, _DIVERGED))
        if known.sum() < 2:
            return np.full((2, self.samples.shape[1]), np.nan)
        ranks = rankdata(np.column_stack((self.samples, rms, codes >= _RATTLES))[known], axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.corrcoef(ranks, rowvar=False)[-2:, :-2]

    @summarizes
    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return how often each gap rattles at each value, its acceleration, what matters, and the loudest part."""
        units, rows, varied = self.system.units, list[list[str]](), self.spreads.varied
        for value, name in ((value, name) for value in self.values for name in self.names):
            found, both = self.chance(name, value), np.nan_to_num(self.influence(name, value))
            rank = np.where(np.abs(both[0]) >= np.abs(both[1]), both[0], both[1])
            share = f"{100.0 * found.value:.3g} %" if found.samples else "an unknown share"
            within = f"({100.0 * found.low:.3g} to {100.0 * found.high:.3g} % with 95 % confidence"
            where = value_words(value, self.system.structure.pace, units, 6)
            yield f"{name} rattles at {where} in {share} of all parts {within}, {found.samples:,} samples)"
            order = np.argsort(-np.abs(rank), kind="stable")[:_MOST]
            told = [k for k in order if abs(rank[k]) >= _SURE / np.sqrt(max(found.samples, 1))]
            level = ["" if np.isnan(each) else f"{each:.4g}" for each in self.level(name, value)]
            level += [self.unit(name)] * bool(units)
            rows.append([name, f"{value:g}", *level, ", ".join(f"{varied[k]} {rank[k]:+.2f}" for k in told)])
        heads = (
            "gap",
            f">{self.system.structure.pace}",
            ">rms",
            ">95 %",
            *["unit"] * bool(units),
            "rank correlation with rms or rattle",
        )
        yield Table(heads, rows)
        for unit, own in self.alike.items():
            if not np.isfinite(self.rms[:, :, own]).any():
                continue
            number, at, gap = np.unravel_index(np.nanargmax(self.rms[:, :, own]), self.rms[:, :, own].shape)
            numbers = zip(self.samples[number].tolist(), varied, strict=True)
            text = ", ".join(value_words(*each, units, 4) for each in numbers)
            level = f"rms {self.rms[number, at, own[gap]]:.4g} {unit}".rstrip()
            yield f"the loudest part is sample {number + 1}, {level} behind {self.names[own[gap]]}: {text}"
        if notes:
            yield from remarks(self.notes, ())

    @property
    def notes(self) -> tuple[str, ...]:
        """Samples that do not count, and gaps that may part later, in sentences."""
        counts = {text: int((self.codes == code).any(axis=(1, 2)).sum()) for code, text in _SAID.items()}
        stopped = () if self.complete else (f"stopped when {len(self.samples):,} samples were done",)
        return (*stopped, *(f"{count:,} {text}" for text, count in counts.items() if count))

    def unit(self, name: str) -> str:
        """Return the unit of the accelerations behind a gap; empty without units, and if those of any gap differ."""
        own = {unit for unit, places in self.alike.items() if self.names.index(name) in (*places, len(self.gaps))}
        return own.pop() if len(own) == 1 else ""

    @property
    def gaps(self) -> tuple[str, ...]:
        """The names without ``any gap``."""
        return self.names[:-1] or self.names

    @cached_property
    def alike(self) -> dict[str, list[int]]:
        """The numbers of the gaps by the unit of their accelerations."""
        units = [unit_behind(self.system, gap) for gap in self.gaps]
        return {unit: [k for k, own in enumerate(units) if own == unit] for unit in dict.fromkeys(units)}

    def tables(self) -> Tables:
        """Return the probabilities with accelerations and rank correlations, and all samples."""
        return {"chances": self._rows, "samples": self._sample_rows}

    def _rows(self) -> Rows:
        heads = ("samples", "rattles", "low", "high", "rms.mean", "rms.95")
        yield [
            "gap",
            self.system.structure.pace,
            *heads,
            *["unit"] * bool(self.system.units),
            *(f"{of}.{name}" for of in ("rank.rms", "rank.rattle") for name in self.spreads.varied),
        ]
        for value, name in ((value, name) for value in self.values for name in self.names):
            level = [*self.chance(name, value)[1:], *self.level(name, value)]
            unit = [self.unit(name)] * bool(self.system.units)
            yield [name, value, *level, *unit, *self.influence(name, value).ravel().tolist()]

    def _sample_rows(self) -> Rows:
        units = [[self.unit(name)] * bool(self.system.units) for name in self.names]
        heads = ["gap", "state", "rms", *["unit"] * bool(self.system.units)]
        yield ["sample", *self.spreads.varied, self.system.structure.pace, *heads]
        for (k, j, g), code in np.ndenumerate(self.codes):
            level = [float(self.rms[k, j, g]), *units[g]]
            yield [k + 1, *self.samples[k].tolist(), self.values[j], self.names[g], STATES[code], *level]

    def __repr__(self) -> str:
        return f"RattleChance({', '.join(self.names)}, {len(self.samples):,} samples)"


@pictured(RattleChance, size=(8.0, 4.8), forms=("panels",))
def chance_picture(found: RattleChance) -> Picture:
    """Describe the probabilities over the values, or at one value how many parts have which acceleration."""
    return Picture(found.system, None, (), partial(_parts, found), panels=("charts",))


def _parts(found: RattleChance) -> Parts:
    pace, units, series = found.system.structure.pace, found.system.units, list[Series]()
    if len(found.values) > 1:
        alike: dict[Any, list[str]] = {}  # the gaps with equal shares are one curve
        for name in found.names:
            alike.setdefault(tuple(found.chance(name, value)[2:] for value in found.values), []).append(name)
        for k, (share, names) in enumerate(alike.items()):
            look, (middle, *ends) = _LOOKS[k % len(_LOOKS)], 100.0 * np.array(share).T
            series.append(Series(found.values, np.array(ends), "between", look))
            series.append(Series(found.values, middle, "line", look, ", ".join(names)))
            series.append(Series(found.values, middle, "dots", look))
        return Parts(charts=[Panel("parts that rattle [%]", pace, series, across=parameter_words(pace, units))])
    charts = []
    for unit, own in found.alike.items():
        every, series = found.rms[:, 0, own], list[Series]()
        ends = (float(np.nanmin(every)), float(np.nanmax(every))) if np.isfinite(every).any() else (0.0, 1.0)
        for k in own:
            rms = found.rms[np.isfinite(found.rms[:, 0, k]), 0, k]
            heights, edges = np.histogram(rms, min(BINS, max(5, int(np.sqrt(len(rms))))), ends)
            y = np.concatenate(([0.0], np.repeat(heights, 2), [0.0]))
            series.append(Series(np.repeat(edges, 2), y, "line", _LOOKS[k % len(_LOOKS)], found.names[k]))
        across = f"rms acceleration{f' [{unit}]' if unit else ''} at {value_words(min(found.values), pace, units, 6)}"
        charts.append(Panel("parts", "rms", series, across=across))
    return Parts(charts=charts)


CHUNKS = Part("parts", ChanceChunk, numbered=True)


def _read_values(value: object, info: ValidationInfo[Surroundings]) -> object:
    """Return the speeds of a table as numbers; one alone is a list of one."""
    if value is None or (system := info.context.system) is None:
        return value
    every = value if isinstance(value, list) else [value]
    return [read_number(each, info, system.structure.pace, relative=False) for each in every]


@dataclass(frozen=True)
class RattleChanceStudy(StudyKind):
    """The probability that gaps rattle when parameters vary from part to part, at one speed or some.

    Raises
    ------
    ModelError
        For unknown parameters or gaps, or laws that make no sense.

    Examples
    --------
    >>> found = gw.ask.rattle_chance(system, [gw.ask.Spread("stop.clearance", sd=0.3)], values=[0.5], samples=40)
    >>> found.chance("stop", 0.5).samples
    40
    """

    kind: ClassVar[str] = "rattle-chance"
    stored: ClassVar[tuple[Part, ...]] = (CHUNKS,)
    answer: ClassVar[Part | None] = Part("rattle-chance", RattleChance)
    always_counts: ClassVar[bool] = True
    arguments: ClassVar[tuple[str, ...]] = ("spreads",)
    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {"spreads": SPREADS}
    table_types: ClassVar[Mapping[str, Any]] = {"gaps": GAPS, **SPREAD_KEYS}

    #: Distribution of the parameters: `gapwalk.ask.Spread`, or measured parts. In a table they are tables
    #: ``[[study.spread]]``, with ``correlation`` between them; or ``parts`` names a CSV file of measured parts.
    spreads: Spreads
    #: Values of the speed, or of the frequency; by default that of the model.
    values: Annotated[tuple[float, ...], OPEN, BeforeValidator(_read_values)] = ()
    gaps: Annotated[tuple[str, ...], OPEN] = ()  #: Contacts with a gap; by default all at which parts can lift off.
    samples: Annotated[int, Ge(2), Le(1_000_000)] = 1000  #: Number of parts.
    starts: Annotated[int, Ge(1), Le(1000)] = 1  #: Motions of each part: from rest, the others from random states.
    seed: Natural = 0  #: Seed of the random numbers.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table."""
        return cls.of_call(with_spreads(values), system)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a call."""
        own = tuple(sorted({float(each) for each in values.get("values") or (system[system.structure.pace],)}))
        return cls(**{**values, "spreads": spreads_of_call(values["spreads"]), "values": own})

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return f"probability of rattle at {', '.join(f'{value:g}' for value in self.values)}: {self.samples:,} samples"

    def first_system(self, system: System) -> System:
        """Return the system at the first value."""
        self.refuse_invalid(system)
        return system.at({system.structure.pace: self.values[0]})

    def refuse_invalid(self, system: System) -> None:
        """Refuse gaps, values and laws that the system cannot have."""
        chosen_gaps(system, self.gaps)
        check_spreads(self.spreads, system, system.structure.pace, "the study, with values of its own")
        for value in self.values:
            system.at({system.structure.pace: value})

    def do(self, job: Job) -> Generator[Found]:
        """Follow the motions of all parts, by chunks."""
        drawn = self.spreads.about(job.system).design(self.samples, self.seed).values
        firsts = enumerate(range(0, self.samples, CHUNK))
        pieces = {k: (k, first, drawn[first : first + CHUNK]) for k, first in firsts}
        yield from job.each(CHUNKS, partial(_judge_parts, job.system, self), pieces)
        yield job.end(self._record(job, complete=True))

    def total(self, job: Job) -> int:
        """Return the number of chunks, and one for the record."""
        return -(-self.samples // CHUNK) + 1

    def so_far(self, job: Job) -> RattleChance | None:
        """Return what the parts so far tell."""
        return self._record(job, complete=False) if job.known[CHUNKS] else None

    def document(self, found: RattleChance, points: bool) -> dict[str, Any]:
        """Return the probabilities as JSON values; with all samples if wanted."""
        return {name: plain_rows(rows()) for name, rows in found.tables().items() if points or name == "chances"}

    def _record(self, job: Job, *, complete: bool) -> RattleChance:
        gaps, chunks = chosen_gaps(job.system, self.gaps), job.all(CHUNKS)
        names = (*gaps, "any gap") if len(gaps) > 1 else gaps
        samples, codes, rms = (
            np.concatenate([getattr(each, name) for each in chunks]) for name in ("samples", "codes", "rms")
        )
        return RattleChance(job.system, self.spreads, self.values, names, samples, codes, rms, complete)


def _judge_parts(system: System, asked: RattleChanceStudy, piece: tuple[int, int, NDArray[np.float64]]) -> ChanceChunk:
    """Follow the motions of the parts of a chunk, at all values and from all starts."""
    number, first, drawn = piece
    gaps, names = chosen_gaps(system, asked.gaps), (*asked.spreads.varied, system.structure.pace)
    shape, starts = (len(drawn), len(asked.values), len(gaps)), list[tuple[Any, System, NDArray[np.float64]]]()
    for place in np.ndindex(shape[:2]):
        value = asked.values[place[1]]
        try:
            here = system.at(dict(zip(names, (*drawn[place[0]].tolist(), value), strict=True)))
        except ModelError:
            continue
        rest, seed = initial_state(here, "rest"), asked.seed + first + place[0]
        others = random_states(here, rest, asked.starts - 1, seed, value) if asked.starts > 1 else ()
        starts += [(place, here, state) for state in (rest, *others)]
    codes, rms = np.full(shape, _REFUSED), np.full(shape, np.nan)
    if starts:
        values = {name: np.array([here[name] for _, here, _ in starts]) for name in names}
        found = judge_gaps(system, np.array([state for *_, state in starts]), values, gaps, _PATIENCE)
        levels = _levels(gaps, [here for _, here, _ in starts], found) if found.rms is None else found.rms
        for k, (place, *_) in enumerate(starts):
            told = _OF_GAPS[found.codes[k]]
            quiet = _SO_FAR if found.periods[k] == 0 else 0
            codes[place] = np.maximum(codes[place], np.where(told < _SO_FAR, np.maximum(told, quiet), told))
            rms[place] = np.fmax(rms[place], levels[k])
    if len(gaps) > 1:
        codes = np.concatenate((codes, codes.max(axis=2, keepdims=True)), axis=2)
        largest = np.fmax.reduce(rms, axis=2, keepdims=True)
        alike = len({unit_behind(system, gap) for gap in gaps}) == 1
        rms = np.concatenate((rms, largest if alike else np.full_like(largest, np.nan)), axis=2)
    return ChanceChunk(number, drawn, codes, rms)


def unit_behind(system: System, gap: str) -> str:
    """Return the unit of the acceleration behind a gap; empty without units."""
    names = accelerations_at(system, gap)
    return " or ".join(dict.fromkeys(system.units.signal(name)[1] for name in names)) if system.units else ""


def _levels(gaps: Sequence[str], systems: Sequence[System], found: GapVerdicts) -> NDArray[np.float64]:
    """Return the accelerations behind the gaps of motions by the exact flow, shape (motions, gaps)."""
    rms = np.full(found.codes.shape, np.nan)
    for k in np.flatnonzero(found.codes.min(axis=1) >= 0).tolist():
        motion, weights = quadrature(systems[k], found.states[k], int(found.periods[k]) or WATCHED)
        squares = [[motion.signal(name) ** 2 for name in accelerations_at(systems[k], gap)] for gap in gaps]
        rms[k] = [np.sqrt(max(weights @ each for each in own) / weights.sum()) for own in squares]
    return rms
