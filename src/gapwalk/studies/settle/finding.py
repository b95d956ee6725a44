"""Where a motion has settled: the attractor with its evidence, how it rattles, the lines of its spectrum."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, astuple, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.attractor import Attractor, AttractorKind
from gapwalk.attractors.box import state_names
from gapwalk.attractors.rattle import ContactLoad, Impulsiveness, Rattle, SideRattle
from gapwalk.attractors.settled import Settled
from gapwalk.attractors.spectrum import Peak
from gapwalk.results.plain import plain
from gapwalk.studies.finding import Finding, Rows, plain_numbers
from gapwalk.studies.settle.study_options import SettleStudyOptions


@dataclass(frozen=True, eq=False)
class SettleFinding(Finding):
    """Where a motion has settled.

    Attributes
    ----------
    options
        What was asked.
    attractor
        The attractor.
    settled
        The motion on it, after its transient.
    section : shape (points, 2n)
        States at the phase of the study, a forcing period apart.
    rattle
        Impacts, contact forces, energy and impulsiveness.
    lines
        The highest lines of the spectrum of the signal.
    """

    options: SettleStudyOptions
    attractor: Attractor
    settled: Settled
    section: NDArray[np.float64]
    rattle: Rattle
    lines: tuple[Peak, ...]

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if self.section.ndim != 2 or self.section.shape[1] != 2 * self.attractor.system.size:
            raise ValueError(f"a section of shape {self.section.shape} is none of this system")

    @property
    def record(self) -> Settled:
        """The settled motion."""
        return self.settled

    @property
    def complete(self) -> bool:
        """True: there is no part of it."""
        return True

    @property
    def stored(self) -> str:
        """That it is there."""
        return "the settled motion is stored"

    @property
    def failures(self) -> tuple[str, ...]:
        """Why it is not known what the motion is, if it is not."""
        return self.attractor.evidence if self.attractor.kind is AttractorKind.UNDECIDED else ()

    def document(self, points: bool) -> dict[str, Any]:
        """The same as plain JSON values; with the section if points are wanted."""
        attractor = plain(self.attractor)
        del attractor["strobes"]
        rattle = self.rattle
        document: dict[str, Any] = {
            "attractor": {"label": self.attractor.label, **attractor, "state": self.attractor.state.tolist()},
            "transient": self.settled.periods,
            "converged": self.settled.converged,
            "spectrum": {"signal": self.options.signal, "lines": [line._asdict() for line in self.lines]},
            "rattle": {
                "periods": rattle.periods,
                "index": rattle.index,
                "sides": [asdict(side) for side in rattle.sides],
                "contacts": [asdict(contact) for contact in rattle.contacts],
                "coordinates": [asdict(coordinate) for coordinate in rattle.coordinates],
            },
        }
        if points:
            document["section"] = {"phase": self.options.phase, "states": plain_numbers(self.section.tolist())}
        return document

    def tables(self) -> Mapping[str, Callable[[], Rows]]:
        """The section, the lines of the spectrum, and the tables of `Rattle`."""
        rattle = self.rattle
        return {
            "section": self._section_rows,
            "lines": lambda: [("line", "order", f"amplitude.{self.options.signal}"), *self.lines],
            "sides": lambda: _rows(SideRattle, rattle.sides),
            "contacts": lambda: _rows(ContactLoad, rattle.contacts),
            "signals": lambda: _rows(Impulsiveness, rattle.coordinates),
        }

    def _section_rows(self) -> Iterator[list[object]]:
        yield ["period", *state_names(self.attractor.system.coordinates)]
        for number, state in enumerate(self.section.tolist()):
            yield [number, *state]


def motion_of(attractor: Attractor, settled: Settled) -> Settled:
    """The motion on an attractor; what did not repeat when it was settled may be known by now to do so."""
    converged = settled.converged or attractor.orbit is not None
    return replace(settled, orbit=attractor.orbit, strobes=attractor.strobes, converged=converged)


def _rows(kind: type[Any], records: tuple[Any, ...]) -> Iterator[tuple[object, ...]]:
    yield tuple(field.name for field in fields(kind))
    yield from (astuple(record) for record in records)
