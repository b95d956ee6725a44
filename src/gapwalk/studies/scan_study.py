"""The study of claims over variations: which change of a system makes what is described of it hold."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from annotated_types import Gt
from pydantic import AfterValidator, Field, ValidationInfo

from gapwalk.answers.scan import Scan, check_claims
from gapwalk.answers.scan_claims import AnyClaim, MotionClaim, PointClaim
from gapwalk.attractors.regime_judge import RegimeOptions
from gapwalk.bifurcation.kinds import Kind
from gapwalk.errors import ModelError
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.parallel.workers import Workers
from gapwalk.studies.derived_schema import key_type
from gapwalk.studies.runner import Report, call
from gapwalk.studies.scan_work import ScanWork
from gapwalk.studies.study_kind import StudyKind, values_of
from gapwalk.studies.study_registry import INLINE, OPEN, Counted, check_integers
from gapwalk.studies.tables import Surroundings

if TYPE_CHECKING:
    from typing import Self

MAX_VARIATIONS = 1_000_000
"""Largest number of variations of a study."""


@dataclass(frozen=True, slots=True)
class ScanOptions:
    """Options of a scan.

    Examples
    --------
    >>> gw.ask.ScanOptions(factors=(0.9, 1.1), neighbours=500).neighbours
    500
    """

    #: Factors by which each parameter is multiplied, one at a time; 0 leaves it out.
    factors: tuple[float, ...] = (0.0, 0.5, 0.8, 0.9, 1.1, 1.25, 2.0)
    pairs: int = 0  #: Number of random pairs of these changes that are tried too.
    #: Number of random neighbours, for which all parameters are multiplied: they tell the chance of luck.
    neighbours: int = 200
    spread: Annotated[float, Gt(0)] = 0.1  #: Standard deviation of the logarithm of their factors.
    starts: int = 6  #: Starts of the motions of each variation: rest, and states spread over a box.
    seed: int = 0  #: Seed of the random numbers.
    #: Criteria that separate kinds of motion.
    judging: Annotated[RegimeOptions, INLINE] = field(default_factory=lambda: RegimeOptions(forces=False))
    check: int = 3  #: Number of the best variations whose motions are classified again with the exact flow.
    #: Number of processes; by default one for each local core. The result does not depend on it.
    workers: Counted | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_integers(self, most=MAX_VARIATIONS, pairs=0, neighbours=0, starts=1, check=0)
        check_integers(self, seed=0)
        if not self.spread > 0.0:
            raise ModelError(f"spread is {self.spread!r}; it must be > 0, as 0.1 for changes of about 10 %")


@dataclass(frozen=True, slots=True)
class ClaimTable:
    """Table of a claim: one of `motion`, `point` and `no`, with its range or its values."""

    #: Kind of motion on which starts settle: ``"period 3"``, ``"periodic"``, ``"quasi-periodic"`` or ``"chaotic"``.
    motion: str | None = None
    point: str | None = None  #: A kind of special point that lies in the range.
    no: str | None = None  #: A kind of special point of which none lies in the range.
    parameter: str | None = None  #: Parameter of the range; by default the frequency or speed.
    #: begin, end: The range, the lower end first.
    begin: Annotated[Any, Field(alias="from")] = None
    end: Annotated[Any, Field(alias="to")] = None
    #: Range over which the branch is walked, from the first value to the second; by default the range of the claim,
    #: from its upper end.
    over: Annotated[Any, Field()] = None
    period: Counted = 1  #: Number m of forcing periods after which the orbits of the branch repeat.
    at: Annotated[Any, Field()] = None  #: Values of parameters, by name, at which it is said.
    share: float = 0.0  #: Least share of the starts that must settle on the motion; at 0, one start is enough.

    def __post_init__(self) -> None:
        named = [name for name in ("motion", "point", "no") if getattr(self, name) is not None]
        if len(named) != 1:
            raise ModelError(
                f"a claim names {' and '.join(named) or 'nothing'}; write one of them, as in "
                '{ motion = "period 3", at = { frequency = 0.63 } }, { point = "flip", from = 0.62, to = 0.85 } or '
                '{ no = "fold", from = 0.6, to = 0.7 }'
            )

    def claim(self, system: System) -> AnyClaim:
        """Return the claim that it describes."""
        at = _values(system, {} if self.at is None else self.at, "at")
        if self.motion is not None:
            if self.begin is not None or self.end is not None or self.over is not None:
                raise ModelError("a claim about a motion has no range; write at = { frequency = 0.63 }")
            return MotionClaim(self.motion, at, self.share)
        parameter = self.parameter or system.structure.pace
        if self.begin is None or self.end is None:
            raise ModelError("a claim about a special point has no range; write from = 0.62 and to = 0.85")
        low, high = (_number(system, parameter, each) for each in (self.begin, self.end))
        over = None
        if self.over is not None:
            if not isinstance(self.over, list) or len(self.over) != 2:
                raise ModelError(
                    f"over is {self.over!r}; write where the walk begins and ends, as in over = [2.0, 0.5]"
                )
            first, last = (_number(system, parameter, each) for each in self.over)
            over = first, last
        return PointClaim(
            Kind.named(str(self.point or self.no)), parameter, low, high, self.no is not None, over, self.period, at
        )


def _number(system: System, parameter: str, value: object) -> float:
    """Return a value of a parameter as a number in its unit."""
    system.structure.place(parameter)
    if system.units is not None and system.units.parameter(parameter):
        try:
            return float(system.units.read(parameter, value))
        except ValueError as error:
            raise ModelError(f"a value of {parameter} {error}") from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ModelError(f"a value of {parameter} is {value!r}; write a number")
    return float(value)


def _values(system: System, table: object, key: str) -> dict[str, float]:
    """Return values of parameters by name; a file may write the names in quotes, or as tables in tables."""
    if not isinstance(table, Mapping):
        raise ModelError(f"{key} is {table!r}; write values of parameters, as in {key} = {{ frequency = 0.63 }}")
    return {name: _number(system, name, value) for name, value in _leaves(table)}


def _leaves(table: Mapping[str, object], above: str = "") -> Iterator[tuple[str, object]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def _known(parameters: tuple[str, ...] | None, info: ValidationInfo[Surroundings]) -> tuple[str, ...]:
    if info.context.system:
        for name in parameters or ():
            info.context.system.structure.place(name)
    return tuple(parameters or ())


@dataclass(frozen=True)
class ScanStudy(ScanOptions, StudyKind):
    """A scan: which claims hold for which variations of a system."""

    kind: ClassVar[str] = "scan"
    gives_frequency: ClassVar[bool] = False
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

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the study of a table."""
        rest = dict(values)
        claims = tuple(table.claim(system) for table in rest.pop("claim"))
        listed = tuple(_values(system, each, "listed") for each in rest.pop("listed", ()))
        check_claims(system, claims)
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

    def work(self, system: System) -> ScanWork:
        """Return the work on the scan."""
        return ScanWork(system, self)


@shows_progress(lambda count, part, pace: str(pace))
def scan(
    system: System,
    claims: Sequence[AnyClaim],
    parameters: Sequence[str] = (),
    *,
    listed: Sequence[Mapping[str, float]] = (),
    options: ScanOptions | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Scan:
    """Find which claims hold for which variations of a system, and how likely it is that a hit is luck.

    Parameters
    ----------
    system
        The system.
    claims
        What is said of it; as `MotionClaim` and `PointClaim`.
    parameters
        The parameters that vary; by default all that are not 0 and have no value in a claim.
    listed
        Further variations that are tried: values of parameters by name.
    options
        Options of the scan.
    workers
        Number of local processes, or workers that were started before; by default as the options say. The result does
        not depend on them.
    report
        Called with each part of the work once it is done and written to the file.
    output
        A file to write while the work is done; `gapwalk.load` reads it, and a stopped scan continues.

    Returns
    -------
    Scan
        What each claim comes to for each variation.

    Raises
    ------
    ModelError
        For unknown parameters, or a parameter that varies and has a value in a claim.
    Interrupted
        After Ctrl-C; its `found` is the record so far.

    Examples
    --------
    >>> claims = [gw.ask.PointClaim("fold", "frequency", 1.3, 1.45, over=(1.6, 1.1))]
    >>> options = gw.ask.ScanOptions(factors=(0.5,), neighbours=0)
    >>> found = gw.ask.scan(system, claims, ["harmonic1.amplitude"], options=options)
    >>> found.holds.tolist()  # the model, and half of its excitation
    [[1], [0]]
    """
    check_system(system, "scan")
    asked = ScanStudy(
        **values_of(options or ScanOptions()),
        claims=tuple(claims),
        parameters=tuple(parameters),
        listed=tuple(dict(each) for each in listed),
    )
    found = call(asked, asked.work(system), system, workers=workers, report=report, output=output).record
    assert found is not None
    return found
