"""The protocol of a kind of study: its request, its work, and what it finds.

One class is the request, the table in a model file and the stored form; a second does the work; a third describes what
is found where that is more, or other, than branches.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, ParamSpec, TypeVar

from gapwalk.errors import Interrupted
from gapwalk.model.system import System
from gapwalk.parallel.workers import Workers
from gapwalk.results.codec import OneOf, column_of, register
from gapwalk.results.result_file import Entry, Part, Parts
from gapwalk.studies.study_registry import kind_of
from gapwalk.summary import Rows, Summary

if TYPE_CHECKING:
    from typing import Self


@dataclass(frozen=True)
class StudyKind:
    """Request of a study of any kind.

    A kind of study is a frozen dataclass that derives from this class:

    - Its fields are what `gapwalk.Study.options` holds, what a result file keeps (`gapwalk.results.codec` works along
      their type hints), and the keys of the table ``[study]`` of a model file (`gapwalk.studies.derive` makes its
      schema along the same hints). Validators of pydantic in ``Annotated`` may look at the system and at the fields
      before.
    - Options that a Python function takes too are a dataclass of their own, from which the kind derives as well, or
      which it holds: no option is written down twice.
    - `work` returns its `Work`, which yields what is found part by part. So one runner (`gapwalk.studies.runner`)
      serves all kinds: it writes each part, reports it once it is safe, and continues stopped runs.
    - A line in `gapwalk.studies.study_registry`, or its function `add_kind`, makes it known by its `kind`.
    """

    kind: ClassVar[str]
    """What a model file calls this kind of study."""

    reports: ClassVar[str] = "parts"
    """What a run reports: ``points`` of a branch, ``branches`` of a diagram, ``sections and loci`` of a map, or parts
    of the work."""

    table_types: ClassVar[Mapping[str, Any]] = {}
    """What pydantic takes for the types of keys, where it does not follow from the fields; None for what is not a key.

    A pair of a type and a default is a key that is no field of this type: `of_table` makes something of it. These keys
    are checked after all others, in this order: a validator sees the keys before it in ``info.data``."""

    @property
    def plan(self) -> str:
        """A line on the work to be done."""
        return self.kind

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study that a table asks for.

        Parameters
        ----------
        values
            What the table gives, by the names of fields, all of it checked; what it leaves out has the defaults.
        system
            The system, from which further defaults may come.

        Raises
        ------
        ModelError
            If the values do not fit together.
        """
        return cls(**values)

    @property
    def limits(self) -> Any:
        """The options that the Python function of the same kind takes, where the kind derives from such."""
        options = next(each for each in type(self).__mro__ if is_dataclass(each) and not issubclass(each, StudyKind))
        return options(**{field.name: getattr(self, field.name) for field in fields(options)})

    @classmethod
    def unused(cls, table: Mapping[str, object]) -> tuple[str, ...]:
        """Names of tables in a model file that change nothing of the study."""
        return ()

    def first_system(self, system: System) -> System:
        """Return the system at the beginning of the study."""
        return system

    def work(self, system: System) -> Work:
        """Return the work of the study on a system, of which nothing is done yet; a ModelError if it makes no sense."""
        raise NotImplementedError


class Found(NamedTuple):
    """Something that the work on a study has found.

    Attributes
    ----------
    entries
        What a file keeps of it, all or nothing. If there is none yet, the next entries keep this too, and only then it
        is reported; where there is no file, it is reported at once.
    news
        What is reported of it, once it is safe: the arguments of each call. None: the value of the first entry, and the
        `gapwalk.parallel.work_chunks.Pace` of the work.
    """

    entries: tuple[Entry, ...]
    news: tuple[tuple[Any, ...], ...] | None = None

    @classmethod
    def part(cls, part: Part, value: Any, number: int = 0) -> Found:
        """Return one part of the work, counted by its pace."""
        return cls((part.entry(value, number),))


class Work(ABC):
    """The work on one study: what is done of it, and what is left.

    Most kinds of work are made of a system, as it is at the beginning of the study, and of what is asked for. A work is
    used in this order: `take` what a file has, `parts` until nothing is left, `last`; and `record` or `finding`
    at any moment.
    """

    @abstractmethod
    def take(self, known: Parts) -> None:
        """Take over what a file has; any of LookupError, TypeError and ValueError if that makes no sense."""

    @abstractmethod
    def parts(self, workers: Workers) -> Generator[Found]:
        """Do what is left, part by part; KeyboardInterrupt where Ctrl-C ends it.

        The parts come in an order in which each makes sense together with those before it: what a file has after any
        of them is enough to continue to the same result, bit for bit.
        """

    def last(self, *, finished: bool) -> Iterable[Entry]:
        """Return the parts that a file keeps when the work ends, because all is done or after Ctrl-C.

        Numbered parts that the file has are left out: Ctrl-C may come when a part is done and not yet in the file.
        """
        return ()

    def again(self) -> Iterator[tuple[Any, ...]]:
        """Yield the reports of the parts that were taken over, as far as they are reported again."""
        return iter(())

    @property
    @abstractmethod
    def complete(self) -> bool:
        """True if nothing is left to do."""

    @property
    def done(self) -> int:
        """Parts that are done."""
        return int(self.complete)

    @property
    def total(self) -> int:
        """All parts."""
        return 1

    @property
    @abstractmethod
    def record(self) -> Any:
        """Record that the Python function of the same work returns, as far as the work has come."""

    def finding(self) -> Finding | None:
        """Return the finding of the study, as far as the work has come; None for a branch, a diagram or a map."""
        return None


def values_of(options: Any) -> dict[str, Any]:
    """Return the fields of a dataclass of options by name, of which a kind of study is made that derives from it."""
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
    """

    @property
    @abstractmethod
    def record(self) -> Any:
        """Record that the Python function of the same name returns; None if the work was stopped before that."""

    @property
    def complete(self) -> bool:
        """True if nothing is left to do."""
        return self.record is not None and self.record.complete

    @property
    @abstractmethod
    def stored(self) -> str:
        """Part of the work that is done, in words, while it is not complete."""

    @property
    def can_be_drawn(self) -> bool:
        """True if there is something to draw."""
        return self.record is not None

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks, in sentences."""
        return getattr(self.record, "notes", ())

    @property
    def failures(self) -> tuple[str, ...]:
        """Where the numerics gave up, in sentences."""
        return getattr(self.record, "failures", ())

    def summary(self) -> Summary:
        """Return what the terminal shows of its record: lines, `Table` and `Tree`; without notes and failures."""
        return (repr(self.record),)

    @abstractmethod
    def document(self, points: bool) -> dict[str, Any]:
        """Return plain JSON values; with everything point by point if wanted."""

    @abstractmethod
    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The tables by name, the most important one first."""


def plain_numbers(values: Any) -> Any:
    """Numbers in nested lists, as JSON has them: those that are not finite become null."""
    if isinstance(values, list):
        return [plain_numbers(value) for value in values]
    return None if isinstance(values, float) and not math.isfinite(values) else values


P = ParamSpec("P")
R = TypeVar("R")


def found_by(call: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
    """Return what a call returns; after Ctrl-C, what it had found by then."""
    try:
        return call(*arguments, **options)
    except Interrupted as stop:
        return stop.found
