"""The protocol of a kind of study: its request, its work, and its finding.

One class is the request, the table in a model file and the stored form. A second does the work. A third describes the
finding if it is not, or not only, branches.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, ParamSpec, Protocol, TypeVar

from gapwalk.errors import Interrupted
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import OneOf, column_of, register
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.study_registry import kind_of
from gapwalk.summary import Rows, SummaryParts, summarizes

if TYPE_CHECKING:
    from typing import Self


@dataclass(frozen=True)
class StudyKind:
    """Request of a study of any kind.

    A kind of study is a frozen dataclass that derives from this class:

    - Its fields are what `gapwalk.Study.options` holds, what a result file keeps (`gapwalk.results.codec` works along
      their type hints), and the keys of the table ``[study]`` of a model file (`gapwalk.studies.derived_schema` makes
      its schema along the same hints). Validators of pydantic in ``Annotated`` may look at the system and at the
      fields before.
    - Options that a Python function takes too are a dataclass of their own, from which the kind derives as well, or
      which it holds: no option is written down twice.
    - `work` returns its `Work`, which yields its results part by part. So one runner (`gapwalk.studies.runner`)
      serves all kinds: it writes each part, reports it once it is safe, and continues stopped runs.
    - A line in `gapwalk.studies.study_registry`, or its function `add_kind`, makes it known by its `kind`.

    Examples
    --------
    >>> gw.studies.ResponseOptions.kind, issubclass(gw.studies.ResponseOptions, gw.studies.StudyKind)
    ('response', True)
    """

    kind: ClassVar[str]
    """Name of this kind of study in a model file."""

    reports: ClassVar[str] = "parts"
    """Reports of a run: ``points`` of a branch, ``branches`` of a diagram, ``sections and loci`` of a map,
    ``branches and families`` of tori, whose number is not known before, or parts of the work."""

    gives_frequency: ClassVar[bool] = False
    """True if the study gives the frequency itself, without a parameter, so that the model need not."""

    table_types: ClassVar[Mapping[str, Any]] = {}
    """Types of keys for pydantic, where they do not follow from the fields; None for a field that is no key.

    A pair of a type and a default is a key that is no field of this type: `of_table` makes something of it. These keys
    are checked after all others, in this order: a validator sees the keys before it in ``info.data``."""

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        return self.kind

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

    @property
    def limits(self) -> Any:
        """Return the options of the Python function of the same name, if the kind derives from them."""
        options = next(each for each in type(self).__mro__ if is_dataclass(each) and not issubclass(each, StudyKind))
        return options(**{field.name: getattr(self, field.name) for field in fields(options)})

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

    def work(self, system: System) -> Work:
        """Return the work of the study on a system, not yet begun; raise a ModelError if the study is invalid.

        Parameters
        ----------
        system
            The system at the beginning of the study.
        """
        raise NotImplementedError


class Found(NamedTuple):
    """One result of the work on a study.

    Examples
    --------
    >>> part = gw.studies.Part("name", str)
    >>> gw.studies.Found.part(part, "a text").entries[0].value
    'a text'
    """

    #: Entries for the file, written all or none. If there is none yet, the next entries contain this too, and only then
    #: it is reported; where there is no file, it is reported at once.
    entries: tuple[Entry, ...]
    #: Reports after it is stored: the arguments of each call. None: the value of the first entry, and the
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

    Examples
    --------
    >>> work = study.options.work(study.system)
    >>> work.complete, work.done
    (False, 0)
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
    OneOf(
        lambda value: value.kind if isinstance(value, StudyKind) else None,
        lambda kind: column_of(kind_of(kind)),
    ),
)


class Finding(ABC):
    """Result of a study of a kind that finds more than, or something other than, branches.

    A kind of study has a subclass, which describes itself: `summary` is what the terminal shows, `document` its JSON
    values, `tables` the CSV files. A function that draws its `record` is registered with `gapwalk.plot.draws`.

    Examples
    --------
    >>> changed = gw.studies.SettleFinding
    >>> [name for name in ("summary", "document", "tables") if name in vars(changed)]  # what a finding describes
    ['summary', 'document', 'tables']
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


class Answer(Protocol):
    """Record that describes itself, and of which part may be missing."""

    @property
    def complete(self) -> bool:
        """True if no work is left."""
        ...

    def summary(self, *, notes: bool = True) -> SummaryParts:
        """Return the record in words; with notes and failures or without."""
        ...

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return its tables by name."""
        ...


A = TypeVar("A", bound=Answer)


@dataclass(frozen=True)
class AnswerFinding(Finding, Generic[A]):
    """Finding of a study whose record describes itself, complete or not."""

    found: A | None  #: The record; None before its first part is done.
    #: done, total: Number of parts that are done, and of all.
    done: int
    total: int

    @property
    def record(self) -> A | None:
        """The record; None before its first part is done."""
        return self.found

    @property
    def stored(self) -> str:
        """Describe how many parts are stored."""
        return f"{self.done} of {self.total} parts are stored"

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the record in words; notes are apart."""
        return () if self.found is None else self.found.summary(notes=False)

    def document(self, points: bool) -> dict[str, Any]:
        """Return the record as JSON values, or how many parts are done."""
        if self.found is None:
            return {"parts": {"done": self.done, "total": self.total}}
        return self.document_of(self.found, points)

    @abstractmethod
    def document_of(self, found: A, points: bool) -> dict[str, Any]:
        """Return the record as JSON values; with everything point by point if wanted."""

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the tables of the record."""
        return {} if self.found is None else self.found.tables()


class AnswerWork(Work, Generic[A]):
    """Work whose last part is a record that describes itself.

    A kind of it writes `take` and `parts`, which set `whole`, and says how many parts come before the record.

    Attributes
    ----------
    whole
        The complete record; None before it is known.
    """

    found_as: ClassVar[type[AnswerFinding[Any]]]
    whole: A | None = None

    @property
    @abstractmethod
    def before(self) -> int:
        """Number of parts that are done, without the record."""

    @property
    @abstractmethod
    def total(self) -> int:
        """Number of all parts, with the record."""

    def so_far(self) -> A | None:
        """Return the record of the parts that are done; None if they have none."""
        return None

    @property
    def complete(self) -> bool:
        """True if the record is complete."""
        return self.whole is not None

    @property
    def done(self) -> int:
        """Number of parts that are done."""
        return self.total if self.complete else self.before

    @property
    def record(self) -> A | None:
        """The record so far; None if there is none yet."""
        return self.so_far() if self.whole is None else self.whole

    def finding(self) -> AnswerFinding[A]:
        """Return the record so far as the finding of a study."""
        return self.found_as(self.record, self.done, self.total)


def plain_numbers(values: Any) -> Any:
    """Return numbers in nested lists as JSON values; those that are not finite become null."""
    if isinstance(values, list):
        return [plain_numbers(value) for value in values]
    return None if isinstance(values, float) and not math.isfinite(values) else values


P = ParamSpec("P")
R = TypeVar("R")


def found_by(call: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
    """Return the result of a call; after Ctrl-C, the result so far."""
    try:
        return call(*arguments, **options)
    except Interrupted as stop:
        return stop.found
