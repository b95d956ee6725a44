"""The study of a settled motion: the attractor with its evidence, its impacts, the lines of its spectrum."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import asdict, astuple, dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ValidationInfo

from gapwalk.attractors.lyapunov import LyapunovOptions
from gapwalk.attractors.rattle import ContactLoad, Rattle, SideRattle, rattle
from gapwalk.attractors.settle import (
    Attractor,
    AttractorKind,
    ClassifyOptions,
    Settled,
    SettleOptions,
    identify,
    settle,
)
from gapwalk.attractors.spectrum import Peak, spectrum
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import ModelError
from gapwalk.flow.motion import signal_place
from gapwalk.model.problems import given
from gapwalk.model.schema import Angle
from gapwalk.model.system import System
from gapwalk.model.words import line_words, pace_words, signal_words
from gapwalk.orbit.energy import Energy, EnergyItem, energy
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.pieces import stage
from gapwalk.results.codec import plain
from gapwalk.results.result_file import Part
from gapwalk.studies.study_kind import OPEN, Finding, Found, Job, Rows, StudyKind
from gapwalk.studies.study_schema import RestOrState, Surroundings
from gapwalk.summary import SummaryParts, Table, TableRows, summarizes

if TYPE_CHECKING:
    from typing import Self


_LINES = 40  # of the spectrum
_SHOWN = 8  # of them in the summary
_FEW = 16  # periods of the impacts of a motion without period in a train of many parts


def _is_a_signal(signal: str | None, info: ValidationInfo[Surroundings]) -> str | None:
    if signal and info.context.system:
        try:
            signal_place(info.context.system, signal)
        except ModelError as error:
            raise ValueError(f"is {given(signal)}, but {error}") from None
    return signal


def _lies_in_one_turn(phase: float) -> float:
    if not 0.0 <= phase < 2.0 * math.pi:
        raise ValueError(f"is {given(phase)} radians; it must be at least 0 and less than a whole turn, 2 pi")
    return phase


def rest_words(orbit: Orbit | None) -> list[str]:
    """Say on which rigid stops a motion rests all the time: ``rests on teeth + all the time``."""
    if orbit is None:
        return []
    return [f"rests on {describe_switch(orbit, each)} all the time" for each in orbit.held if orbit.rests(each)]


@dataclass(frozen=True, eq=False)
class SettleFinding(Finding):
    r"""Finding of a settled motion.

    Examples
    --------
    >>> import io
    >>> text = file[: file.index("[study]")] + "[study]\nkind = 'settle'\n"
    >>> finding = gw.run(gw.read_study(io.StringIO(text), {"frequency": 0.6})).finding
    >>> finding.attractor.label, finding.record.converged
    ('P1', True)
    """

    options: SettleStudyOptions  #: The request.
    attractor: Attractor  #: The attractor.
    settled: Settled  #: The motion on it, after its transient.
    #: shape (points, state_size): States at the phase of the study, a forcing period apart.
    section: NDArray[np.float64]
    rattle: Rattle  #: Impacts, contact forces, energy and impulsiveness.
    lines: tuple[Peak, ...]  #: The highest lines of the spectrum of the signal.
    #: Work and losses in one period; None for a motion without period, or where no energy is known.
    energy: Energy | None = None

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if self.section.ndim != 2 or self.section.shape[1] != self.attractor.system.state_size:
            raise ValueError(f"a section of shape {self.section.shape} does not belong to this system")

    @property
    def record(self) -> Settled:
        """The settled motion."""
        return self.settled

    @property
    def complete(self) -> bool:
        """True, because the work has a single part."""
        return True

    @property
    def stored(self) -> str:
        """Description of the finished work."""
        return "the settled motion is stored"

    @property
    def failures(self) -> tuple[str, ...]:
        """Reason why the kind of motion is not known; empty if it is."""
        return self.attractor.evidence if self.attractor.kind is AttractorKind.UNDECIDED else ()

    @summarizes
    def summary(self) -> SummaryParts:
        """Return the kind of motion with its evidence, the highest lines of its spectrum, and its impacts."""
        attractor, system = self.attractor, self.attractor.system
        yield f"{attractor.label}: {attractor.kind.value} motion at {pace_words(system)}"
        yield f"  followed for {self.settled.periods} forcing periods"
        yield from (f"  {sentence}" for sentence in attractor.evidence)
        yield from (f"  {sentence}" for sentence in rest_words(self.settled.orbit))
        yield f"\nlines of {signal_words(self.options.signal, system.units)}"
        order = "multiple of Ω" if system.turns is None else "order"
        lines = [(line_words(each.name), f"{each.order:.6g}", f"{each.amplitude:.6g}") for each in self.lines]
        yield Table(["line", f">{order}", ">amplitude"], lines[:_SHOWN])
        index = f"index {self.rattle.index:.4g} (kurtosis of the acceleration)"
        yield f"\nrattle: {'impulses on rigid stops' if math.isnan(self.rattle.index) else index}\n"
        yield from self.rattle.summary()
        if self.energy is not None:
            yield ""
            yield from self.energy.summary()

    def document(self, points: bool) -> dict[str, Any]:
        """Return plain JSON values; with the section if points are wanted."""
        attractor = plain(self.attractor)
        del attractor["strobes"]
        rattle = self.rattle
        document: dict[str, Any] = {
            "attractor": {"label": self.attractor.label, **attractor, "state": self.attractor.state.tolist()},
            "transient": self.settled.periods,
            "converged": self.settled.converged,
            "rests": rest_words(self.settled.orbit),
            "spectrum": {"signal": self.options.signal, "lines": [line._asdict() for line in self.lines]},
            "rattle": {
                "periods": rattle.periods,
                "index": rattle.index,
                "sides": [asdict(side) for side in rattle.sides],
                "contacts": [asdict(contact) for contact in rattle.contacts],
                "coordinates": [asdict(coordinate) for coordinate in rattle.coordinates],
            },
        }
        if self.energy is not None:
            document["energy"] = {
                "imbalance": self.energy.imbalance,
                "work": [asdict(each) for each in self.energy.work],
                "losses": [asdict(each) for each in self.energy.losses],
            }
        if points:
            document["section"] = {"phase": self.options.phase, "states": plain(self.section)}
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """Return the section, the lines of the spectrum, the tables of `Rattle`, and those of `Energy`."""
        rattle, book = self.rattle, self.energy
        energies = {"work": book.work, "losses": book.losses} if book is not None else {}
        return {
            "section": self._section_rows,
            "lines": lambda: [("line", "order", f"amplitude.{self.options.signal}"), *self.lines],
            "sides": TableRows(lambda: _rows(SideRattle, rattle.sides), units=_OF_SIDES),
            "contacts": TableRows(
                lambda: _rows(ContactLoad, rattle.contacts), units={"peak": ".force", "rms": ".force", "power": "W"}
            ),
            "signals": rattle.signal_rows,
            **{
                name: TableRows(partial(_rows, EnergyItem, items), units={"energy": "J", "power": "W"})
                for name, items in energies.items()
            },
        }

    def _section_rows(self) -> Iterator[list[object]]:
        yield ["period", *self.attractor.system.state_names]
        for number, state in enumerate(self.section.tolist()):
            yield [number, *state]


_OF_SIDES = {"velocity": "'", "fastest": "'", "peak": ".force", "loss": "J", "costliest": "J", "impulse": "N m s"}


SETTLED = Part("settled", SettleFinding)


@dataclass(frozen=True)
class SettleStudyOptions(SettleOptions, StudyKind):
    """Study of a settled motion: its attractor, its impacts, and its spectrum.

    Parameters
    ----------
    max_periods, max_period, tolerance
        Options for settling; as `gapwalk.SettleOptions`.

    Examples
    --------
    >>> gw.studies.SettleStudyOptions(signal="x''", max_periods=2000).plan
    "settle from rest, showing x''"
    """

    kind: ClassVar[str] = "settle"
    answer: ClassVar[Part | None] = SETTLED
    table_types: ClassVar[Mapping[str, Any]] = {
        "phase": Annotated[Angle, AfterValidator(_lies_in_one_turn)],
        "lyapunov": None,
    }

    #: The signal whose spectrum is computed, and which the picture shows: a coordinate, its velocity (``q1'``) or
    #: acceleration (``q1''``), a contact's force (``stop.force``), or another signal of `Motion.signal`; by default the
    #: first coordinate.
    signal: Annotated[str, OPEN, AfterValidator(_is_a_signal)] = ""
    start: RestOrState = "rest"  #: ``"rest"``, or a state at theta = 0: positions, then velocities.
    phase: float = 0.0  #: Phase of the excitation at which the section is taken, in radians.
    #: Options for the exponents of a motion without period; not a key of a table.
    lyapunov: LyapunovOptions = LyapunovOptions()

    @property
    def most_workers(self) -> int:
        """One: each part of a motion continues from the last."""
        return 1

    @property
    def plan(self) -> str:
        """Describe the work to be done, in one line."""
        start = self.start if isinstance(self.start, str) else f"({', '.join(f'{value:g}' for value in self.start)})"
        return f"settle from {start}, showing {self.signal}"

    @classmethod
    def of_table(cls, values: dict[str, Any], system: System) -> Self:
        """Return the options in a table ``[study]``; without a `signal` there, it is that of the first coordinate."""
        return cls(**{**values, "signal": values.get("signal") or system.coordinates[0]})

    def do(self, job: Job) -> Generator[Found]:
        """Compute the settled motion, as one part."""
        with stage(0.0, 0.1):
            settled = settle(job.system, self.start, self)
        with stage(0.1, 0.3):
            attractor = identify(settled, ClassifyOptions(self, self.lyapunov))
        motion = motion_of(attractor, settled)
        with stage(0.3, 0.9):
            lines = tuple(spectrum(motion, self.signal).peaks(_LINES))
        loads = rattle(motion, _FEW) if prefers_lanes(job.system) else rattle(motion)
        found = motion.section(self.phase).states, loads, lines, _energy_of(motion)
        yield job.end(SettleFinding(self, attractor, motion, *found))._replace(news=())

    def check_read(self, job: Job) -> None:
        """Raise a ValueError if the motion belongs to another study."""
        found = self.finding_of(job)
        if found is None:
            raise ValueError("it holds no motion")
        if found.options != self:
            raise ValueError("the motion does not belong to the study")

    def finding_of(self, job: Job) -> SettleFinding | None:
        """Return the settled motion with its evidence; None before it is found."""
        return job.one(SETTLED)


def motion_of(attractor: Attractor, settled: Settled) -> Settled:
    """Return the motion on an attractor; it may be known now to be periodic even if the settled motion was not."""
    converged = settled.converged or attractor.orbit is not None
    return replace(settled, orbit=attractor.orbit, strobes=attractor.strobes, converged=converged)


def _energy_of(motion: Settled) -> Energy | None:
    """Return the energy of a periodic motion; None where its equations tell none, or nothing works on it."""
    if motion.orbit is None:
        return None
    try:
        return energy(motion.orbit)
    except ModelError:  # matrices that are not symmetric
        return None


def _rows(kind: type[Any], records: tuple[Any, ...]) -> Iterator[tuple[object, ...]]:
    yield tuple(field.name for field in fields(kind))
    yield from (astuple(record) for record in records)
