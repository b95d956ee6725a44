"""A kind of study: one class says what is asked, does the work part by part, and describes the answer.

Its fields are the keys of its table in a model file, the keywords of its Python function, and what a file keeps.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, ParamSpec, TypeVar

from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.bounds import check_fields
from gapwalk.model.registry import Registry
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import OneOf, column_of, register
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.summary import Rows, SummaryParts, summarizes

if TYPE_CHECKING:
    from typing import Self


# The kinds of study, by their names in model files.

K = TypeVar("K", bound="StudyKind")

INLINE = "inline"
"""In ``Annotated``, marks a field whose own fields are keys of the table around it."""

OPEN = "open"
"""In ``Annotated``, marks a field that a table may leave out though it has no default: it depends on the system."""

MAX_VALUES = 100_000
"""Largest number of values of a parameter, of periods and of branches."""


def check_values(name: str, values: object, least: int, parameter: str) -> None:
    """Require a number of values of a parameter, at least `least`, or a tuple of its values."""
    if isinstance(values, tuple):
        fits = len(values) >= least and all(isinstance(each, float | int) and math.isfinite(each) for each in values)
    else:
        fits = isinstance(values, int) and not isinstance(values, bool) and least <= values <= MAX_VALUES
    if not fits:
        allowed = f"an integer from {least} to {MAX_VALUES:,}, or values of {parameter}"
        raise ModelError(f"{name} is {values!r}; it must be {allowed}")


# Each is loaded only when it is asked for: a frequency response need not wait for the code of basins.
_KINDS: Registry[type[StudyKind]] = Registry(
    "kind of study",
    "kinds of study",
    {
        "response": "gapwalk.studies.response_study.ResponseOptions",
        "diagram": "gapwalk.studies.diagram_study.DiagramStudyOptions",
        "map": "gapwalk.studies.map_study.MapStudyOptions",
        "locus": "gapwalk.studies.locus_study.LocusStudyOptions",
        "family": "gapwalk.studies.family_study.FamilyStudy",
        "settle": "gapwalk.studies.settle_study.SettleStudyOptions",
        "sweep": "gapwalk.studies.sweep_study.SweepStudy",
        "basins": "gapwalk.studies.basin_study.BasinStudy",
        "shares": "gapwalk.studies.share_study.ShareStudy",
        "regimes": "gapwalk.studies.regime_study.RegimeStudy",
        "tolerance": "gapwalk.studies.tolerance_study.ToleranceStudy",
        "rattle": "gapwalk.studies.rattle_study.RattleStudy",
        "threshold": "gapwalk.studies.threshold_study.ThresholdStudy",
        "run-up": "gapwalk.studies.run_up_study.RunUpStudy",
        "design": "gapwalk.studies.design_study.DesignStudy",
        "backbone": "gapwalk.studies.backbone_study.BackboneStudy",
        "self-excited": "gapwalk.studies.self_excited_study.SelfExcitedStudy",
        "tori": "gapwalk.studies.tori_study.ToriStudy",
        "campbell": "gapwalk.studies.campbell_study.CampbellStudy",
        "scan": "gapwalk.studies.scan_study.ScanStudy",
        "rattle-chance": "gapwalk.studies.rattle_chance.RattleChanceStudy",
    },
)


def kinds() -> tuple[str, ...]:
    """Return the names of all kinds of study."""
    return _KINDS.names


def added_kinds() -> tuple[str, ...]:
    """Return the names of the kinds of study that are not the package's own."""
    return _KINDS.added


def kind_of(name: str) -> type[StudyKind]:
    """Return a kind of study by its name, one of `kinds`."""
    return _KINDS.named(name)


def add_kind(kind: type[K]) -> type[K]:
    """Register a kind of study under its `kind`, also as a decorator; a redefined class replaces the old one.

    Parameters
    ----------
    kind
        The class of the study.

    Returns
    -------
    type
        The class itself.

    Raises
    ------
    ModelError
        If another kind has the name.

    Examples
    --------
    >>> gw.studies.add_kind(type(study.options)) is type(study.options)  # as gapwalk has done
    True
    """
    _KINDS.add(kind.kind, kind)
    return kind


@dataclass(frozen=True)
class StudyKind:
    """A study of any kind: what is asked, the work, and the answer.

    A kind of study is a frozen dataclass that derives from this class:

    - Its fields are what `gapwalk.Study.options` holds, what a result file keeps (`gapwalk.results.codec` works along
      their type hints), the keys of the table ``[study]`` of a model file (`gapwalk.studies.study_schema` makes its
      schema along the same hints), and the keywords of the function that `gapwalk.studies.functions` makes of it.
      Validators of pydantic in ``Annotated`` may use the system and earlier fields.
    - `do` does the work part by part with a `Job`, which knows the parts that are done. So one runner
      (`gapwalk.studies.runner`) serves all kinds: it writes each part, reports it once it is safe, and continues
      stopped runs. The last part is the record, of the type `answer`, which describes itself by
      `summary`, `tables`, `notes` and `complete`.
    - A line in `gapwalk.studies.study_kind`, or its function `add_kind`, makes it known by its `kind`.

    Examples
    --------
    >>> study.options.kind, isinstance(study.options, gw.studies.StudyKind)
    ('response', True)
    """

    kind: ClassVar[str]
    """Name of this kind of study in a model file."""

    reports: ClassVar[str] = "parts"
    """Reports of a run: ``points`` of a branch, ``branches`` of a diagram, ``sections and loci`` of a map,
    ``branches and families`` of tori, whose number is not known before, or parts of the work."""

    gives_frequency: ClassVar[bool] = False
    """True if the study gives the frequency itself, without a parameter, so that the model need not."""

    stored: ClassVar[tuple[Part, ...]] = ()
    """Kinds of parts that come before the record."""

    answer: ClassVar[Part | None] = None
    """The part that is the record; None if the record is made from the other parts."""

    always_counts: ClassVar[bool] = False
    """True if the JSON values say how many parts are done even where there is a record."""

    arguments: ClassVar[tuple[str, ...]] = ()
    """Fields that are positional arguments of its function, in their order; ``to`` are both ends of its range."""

    call_types: ClassVar[Mapping[str, tuple[Any, Any, str]]] = {}
    """Type, default and description of arguments of its function that are no fields: `of_call` makes fields of them."""

    not_asked: ClassVar[tuple[str, ...]] = ()
    """Fields that are no keywords of its function."""

    table_types: ClassVar[Mapping[str, Any]] = {}
    """Types of keys for pydantic, where they do not follow from the fields; None for a field that is no key.

    A pair of a type and a default is a key that is no field of this type: `of_table` makes something of it. These keys
    are checked after all others, in this order: a validator sees the keys before it in ``info.data``."""

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return self.kind

    def words_so_far(self, parts: Sequence[Any], total: int) -> str:
        """Describe what is done next and the best so far, for the progress of a job; empty where nothing is known."""
        return ""

    @property
    def most_workers(self) -> int | None:
        """The most processes that can work at a time; None if that depends on what is found."""
        return None

    @property
    def plan_with_workers(self) -> str:
        """Describe the work in one line; if only few processes can share it, also say how many."""
        most = self.most_workers
        if most is None:
            return self.plan
        return f"{self.plan} ({'one process' if most == 1 else f'at most {most} processes'})"

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study that a table requests.

        Parameters
        ----------
        values
            Checked values of the table, by the names of fields; fields that are missing have their defaults.
        system
            The system, from which further defaults may come.
        """
        return cls(**values)

    @classmethod
    def of_call(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study that a call of its function requests.

        Parameters
        ----------
        values
            Values by the names of fields, and of what `call_types` adds.
        system
            The system, from which further defaults may come.
        """
        return cls(**values)

    @classmethod
    def unused(cls, table: Mapping[str, object]) -> tuple[str, ...]:
        """Names of tables in a model file that have no effect on the study.

        Parameters
        ----------
        table
            The table ``[study]`` of the file.
        """
        return ()

    def first_system(self, system: System) -> System:
        """Return the system at the beginning of the study.

        Parameters
        ----------
        system
            The system of the model file.
        """
        return system

    def system_of_call(self, system: System) -> System:
        """Return the system with which the work of a call of the function begins."""
        return self.first_system(system)

    def refuse_invalid(self, system: System) -> None:
        """Raise a ModelError if the study is invalid for the system at its beginning."""

    def work(self, system: System) -> Work:
        """Return the work of the study on a system, not yet begun; raise a ModelError if the study is invalid.

        Parameters
        ----------
        system
            The system at the beginning of the study.
        """
        return Job(system, self)

    def do(self, job: Job) -> Generator[Found]:
        """Do the steps of the work that are not done, by `Job.once` and `Job.each`.

        Parameters
        ----------
        job
            The system, and the parts that are known.
        """
        raise NotImplementedError

    def so_far(self, job: Job) -> Any:
        """Return the record of the parts that are known; None if they do not suffice."""
        return None

    def is_complete(self, job: Job) -> bool:
        """Return True if no work is left, once the record is stored."""
        return bool(job.known[self.answer]) if self.answer is not None else self.done(job) == self.total(job)

    def done(self, job: Job) -> int:
        """Return the number of parts that are done."""
        return sum(len(job.known[part]) for part in self.stored)

    def total(self, job: Job) -> int:
        """Return the number of all parts, as far as it is known."""
        return len(self.stored) + 1

    def check_read(self, job: Job) -> None:
        """Raise a ValueError if the parts of a file do not belong to the study."""

    def document(self, found: Any, points: bool) -> dict[str, Any]:
        """Return the record as JSON values; with everything point by point if wanted.

        Parameters
        ----------
        found
            The record.
        points
            True for everything, point by point.
        """
        raise NotImplementedError

    def summary(self, found: Any) -> SummaryParts:
        """Return the record in words, without its notes."""
        return found.summary(notes=False)

    def tables(self, found: Any) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of the record by name, the most important one first."""
        return found.tables()

    def remarks(self, found: Any) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return notes and numerical failures, in sentences."""
        return getattr(found, "notes", ()), getattr(found, "failures", ())

    def stored_words(self, finding: AnswerFinding) -> str:
        """Describe how many parts are stored."""
        return f"{finding.done} of {finding.total} {finding.counted} are stored"

    def can_be_drawn(self, found: Any) -> bool:
        """Return True if there is something to draw."""
        return True

    def finding_of(self, job: Job) -> Finding | None:
        """Return what the work has found so far; None before there is anything."""
        return AnswerFinding(self, job.record, job.done, job.total)

    def drawn(self, found: Any) -> Mapping[str, Any]:
        """Return options of the picture of the record that the study decides."""
        return {}

    @classmethod
    def progress_words(cls, count: int, *news: Any) -> str:
        """Put the latest report of the study's Python function into a few words."""
        return str(news[-1])


class Found(NamedTuple):
    """One result of the work on a study.

    Examples
    --------
    >>> part = gw.studies.Part("name", str)
    >>> gw.studies.Found.part(part, "a text").entries[0].value
    'a text'
    """

    #: Entries for the file, written together or not at all. A result without entries is stored with the next entries,
    #: and reported only then; without a file it is reported at once.
    entries: tuple[Entry, ...]
    #: Reports after it is stored: the arguments of each call. None: one call with the value of the first entry and the
    #: `gapwalk.parallel.workers.Pace` of the work.
    news: tuple[tuple[Any, ...], ...] | None = None

    @classmethod
    def part(cls, part: Part, value: Any, number: int = 0) -> Found:
        """Return one part of the work, counted by its pace."""
        return cls((part.entry(value, number),))


class Work(ABC):
    """The work on one study: the part that is done, and the part that is left.

    Most kinds of work are made from the system at the beginning of the study and from the request. The methods are
    called in this order: `take` with the parts of a file, `parts` until no work is left, `last`; and `record` or
    `finding` at any time.
    """

    @abstractmethod
    def take(self, known: Parts) -> None:
        """Read the parts of a file; raise a LookupError, TypeError or ValueError if they are inconsistent."""

    @abstractmethod
    def parts(self, workers: Workers) -> Generator[Found]:
        """Do the remaining work, part by part; raise KeyboardInterrupt if Ctrl-C ends it.

        Each part is complete together with those before it: the contents of the file after any part suffice to
        continue to the same result, bit for bit.

        Parameters
        ----------
        workers
            Executor of pieces of the work.

        Yields
        ------
        Found
            Each part once it is done.
        """

    def last(self, *, finished: bool) -> Iterable[Entry]:
        """Return the parts that a file keeps when the work ends, because all is done or after Ctrl-C.

        Numbered parts that the file has are left out: Ctrl-C may come when a part is done and not yet in the file.

        Parameters
        ----------
        finished
            True if all is done, False after Ctrl-C.
        """
        return ()

    def again(self) -> Iterator[tuple[Any, ...]]:
        """Yield the reports of parts that were read from the file, if they are reported again.

        Yields
        ------
        tuple
            The arguments of each report.
        """
        return iter(())

    @property
    @abstractmethod
    def complete(self) -> bool:
        """True if no work is left."""

    @property
    def done(self) -> int:
        """Number of parts that are done."""
        return int(self.complete)

    @property
    def total(self) -> int:
        """Number of all parts."""
        return 1

    @property
    @abstractmethod
    def record(self) -> Any:
        """Record so far, as the Python function of the same work returns it."""

    def finding(self) -> Finding | None:
        """Return the finding so far; None for a branch, a diagram or a map."""
        return None


def values_of(options: Any) -> dict[str, Any]:
    """Return the fields of a dataclass of options by name, to make a kind of study that derives from it."""
    return {field.name: getattr(options, field.name) for field in fields(options)}


register(
    StudyKind,
    OneOf(lambda value: value.kind if isinstance(value, StudyKind) else None, lambda kind: column_of(kind_of(kind))),
)


class Finding(ABC):
    """Result of a study of a kind that finds more than, or something other than, branches.

    Most kinds have an `AnswerFinding`. `summary` is for the terminal, `document` for JSON, `tables` for CSV files. A
    function that draws its `record` is registered with `gapwalk.plot.draws`.
    """

    @property
    @abstractmethod
    def record(self) -> Any:
        """Record that the Python function of the same name returns; None if the work was stopped before that."""

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self.record is not None and self.record.complete

    @property
    @abstractmethod
    def stored(self) -> str:
        """Description of the finished part of incomplete work."""

    @property
    def can_be_drawn(self) -> bool:
        """True if there is something to draw."""
        return self.record is not None

    @property
    def drawn(self) -> Mapping[str, Any]:
        """Options of the picture of the record that the study decided."""
        return {}

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks, in sentences."""
        return getattr(self.record, "notes", ())

    @property
    def failures(self) -> tuple[str, ...]:
        """Numerical failures, in sentences."""
        return getattr(self.record, "failures", ())

    @summarizes
    def summary(self) -> SummaryParts:
        """Return lines, `Table` and `Tree` for the terminal, without notes and failures."""
        return (repr(self.record),)

    @abstractmethod
    def document(self, points: bool) -> dict[str, Any]:
        """Return plain JSON values; with everything point by point if wanted.

        Parameters
        ----------
        points
            True for everything, point by point.
        """

    @abstractmethod
    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The tables by name, the most important one first."""


@dataclass(frozen=True)
class AnswerFinding(Finding):
    """Finding of a study whose record describes itself, complete or not."""

    asked: StudyKind  #: The request.
    found: Any  #: The record; None before its first part is done.
    #: done, total: Number of parts that are done, and of all.
    done: int
    total: int
    counted: str = "parts"  #: What these parts are.

    @property
    def record(self) -> Any:
        """The record; None before its first part is done."""
        return self.found

    @property
    def stored(self) -> str:
        """Describe how many parts are stored."""
        return self.asked.stored_words(self)

    @property
    def can_be_drawn(self) -> bool:
        """True if there is something to draw."""
        return self.found is not None and self.asked.can_be_drawn(self.found)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks, in sentences."""
        return self.asked.remarks(self.found)[0]

    @property
    def failures(self) -> tuple[str, ...]:
        """Numerical failures, in sentences."""
        return self.asked.remarks(self.found)[1]

    @property
    def drawn(self) -> Mapping[str, Any]:
        """Options of the picture of the record that the study decided."""
        return self.asked.drawn(self.found)

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the record in words, without its notes."""
        return () if self.found is None else self.asked.summary(self.found)

    def document(self, points: bool) -> dict[str, Any]:
        """Return the record as JSON values, or how many parts are done."""
        counts = {self.counted.partition(" ")[0]: {"done": self.done, "total": self.total}}
        if self.found is None:
            return counts
        document = self.asked.document(self.found, points)
        return {**counts, **document} if self.asked.always_counts or self.counted != "parts" else document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of the record."""
        return {} if self.found is None else self.asked.tables(self.found)


V = TypeVar("V")


class Job(Work):
    """The work on a study, in parts; a part that is known is not done again.

    Attributes
    ----------
    system, asked
        The system at the beginning of the study, and the study.
    known
        The parts that are known, by their kind and number.
    workers
        Executor of pieces of the work, while it is done.

    Examples
    --------
    >>> from gapwalk.studies.sweep_study import SweepStudy
    >>> job = gw.studies.Job(system, SweepStudy("frequency", 0.6, 1.0))
    >>> job.known
    {Part(name='sweep', type=<class 'gapwalk.studies.sweep_study.Sweep'>, numbered=False): {}}
    """

    workers: Workers

    def __init__(self, system: System, asked: Any) -> None:
        self._cached: dict[str, Any] = {}
        asked.refuse_invalid(system)
        self.system, self.asked = system, asked
        self.known: dict[Part, dict[int, Any]] = {
            part: {} for part in (*asked.stored, asked.answer) if part is not None
        }

    def take(self, known: Parts) -> None:
        """Read the record of a file, or its parts if it is incomplete; raise a ValueError if they do not fit."""
        answer = self.asked.answer
        if answer is not None and (record := known.get(answer)) is not None:
            self.known[answer] = {0: record}
        else:
            for part in self.asked.stored:
                if part.numbered:
                    self.known[part] = dict(known.all(part))
                elif (value := known.get(part)) is not None:
                    self.known[part] = {0: value}
        self.asked.check_read(self)

    def parts(self, workers: Workers) -> Generator[Found]:
        """Do the remaining steps."""
        self.workers = workers
        if not self.complete:
            yield from self.asked.do(self)

    def once(self, part: Part, compute: Callable[[], Any], number: int = 0) -> Generator[Found]:
        """Do one step, unless its part is known."""
        if number not in self.known[part]:
            yield self.keep(part, compute(), number)

    def each(self, part: Part, compute: Callable[[V], Any], pieces: Mapping[int, V]) -> Generator[Found]:
        """Do one step for each piece whose part is not known, several at a time; the key is the number of the part."""
        left = [number for number in pieces if number not in self.known[part]]
        for index, found in self.workers.several(compute, [pieces[number] for number in left]):
            yield self.keep(part, found, left[index])

    def keep(self, part: Part, value: Any, number: int = 0) -> Found:
        """Keep a part as known, and return it as found."""
        self.known[part][number] = value
        return Found.part(part, value, number)

    def end(self, record: Any) -> Found:
        """Keep the complete record, and return it as found."""
        return self.keep(self.asked.answer, record)

    def cached(self, name: str, compute: Callable[[], V]) -> V:
        """Return a value that the work needs several times, computed once."""
        if name not in self._cached:
            self._cached[name] = compute()
        return self._cached[name]

    def all(self, part: Part) -> list[Any]:
        """Return what is known of a kind of part, in the order of the numbers."""
        return [value for _, value in sorted(self.known[part].items())]

    def one(self, part: Part) -> Any:
        """Return a part that has no number; None if it is not known."""
        return self.known[part].get(0)

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        return self.asked.is_complete(self)

    @property
    def done(self) -> int:
        """Number of parts that are done."""
        return self.total if self.complete else self.asked.done(self)

    @property
    def total(self) -> int:
        """Number of all parts, as far as it is known."""
        return self.asked.total(self)

    @property
    def record(self) -> Any:
        """The record so far; None if there is none yet."""
        whole = None if self.asked.answer is None else self.one(self.asked.answer)
        return self.asked.so_far(self) if whole is None else whole

    def finding(self) -> Finding | None:
        """Return the record so far as the finding of a study."""
        return self.asked.finding_of(self)


P = ParamSpec("P")
R = TypeVar("R")


def found_by(call: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
    """Return the result of a call; after Ctrl-C, the result so far."""
    try:
        return call(*arguments, **options)
    except Interrupted as stop:
        return stop.found
