"""The live shares of basins: few starts, sorted by the motions that are known; at rest the ordinary computation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Self

import numpy as np

from gapwalk.attractors.basins import RUNAWAY, UNRESOLVED, Attractor, BasinShares, Box, Range, signature_of
from gapwalk.attractors.many_motions import has_kernel, motions_of
from gapwalk.bifurcation.isolated.search_starts import state_box
from gapwalk.ensemble.batch_flow import within_stops
from gapwalk.errors import NumericalError
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words
from gapwalk.orbit.find import find_orbit
from gapwalk.studies.basin_study import BasinStudy, basin_shares
from gapwalk.studies.live_answer import LiveAnswer
from gapwalk.studies.live_response import range_study
from gapwalk.studies.options import RangeStudy
from gapwalk.studies.share_study import ShareStudy
from gapwalk.studies.study_file import Study

FEW = 200
"""Starts of a coarse picture."""
AT_REST = 400
"""Starts at rest, where no study says how many."""
_SAID = 4  # ranges of starts that are stated
_ERROR = 1e-3  # of coarse motions over a period, relative to their size
_TRANSIENT, _WATCHED = 64, 24  # periods of a coarse motion, then those in which it is compared with what is known
_NEAR = 0.05  # distance of a motion from a known one, relative to its size, up to which it is that one there


class LiveShares(LiveAnswer):
    """Shares of random starts that lead to each motion."""

    key = "shares"

    def __init__(
        self, box: Mapping[str, Range], starts: int = AT_REST, confidence: float = 0.95, seed: int = 0
    ) -> None:
        self.box, self.starts, self.confidence, self.seed = box, starts, confidence, seed
        self.known: tuple[Attractor, ...] = ()

    @classmethod
    def of(cls, studies: Sequence[Study], at: float | None) -> tuple[Self, System]:
        """See `LiveAnswer.of`."""
        own = next((each for each in studies if isinstance(each.options, BasinStudy | ShareStudy)), None)
        study = own if own is not None and isinstance(own.options, BasinStudy) else range_study(studies)
        system, at_words, value = study.system, "", None
        if isinstance(study.options, RangeStudy):
            parameter, (low, high) = study.options.parameter, study.options.ends
            value = system[parameter] if low < system[parameter] < high else 0.5 * (low + high)
            value = value if at is None else min(max(at, low), high)
            system, at_words = system.at({parameter: value}), parameter_words(parameter, system.units)
        asked = None if own is None else own.options
        if isinstance(asked, BasinStudy):
            live = cls({**asked.fixed, **asked.plane})
        elif isinstance(asked, ShareStudy):
            live = cls(asked.box, asked.starts, asked.confidence, asked.seed)
        else:
            widths = zip(system.state_names, state_box(system).tolist(), strict=False)
            live = cls({name: (-width, width) for name, width in widths})
        live.about = study.system.structure, asked
        free = [(name, ends) for name, ends in live.box.items() if isinstance(ends, Sequence)]
        told = [f"{name} from {low:.3g} to {high:.3g}" for name, (low, high) in free[:_SAID]]
        box = ", ".join(told) + f" and {len(free) - _SAID} more" * (len(free) > _SAID)
        live.title = {"at": value, "across": at_words, "box": box}
        return live, system

    @classmethod
    def of_shares(cls, shares: BasinShares) -> LiveShares:
        """Return the live answer of shares."""
        ends = zip(shares.box.names, shares.box.low, shares.box.high, strict=True)
        box = {name: low if low == high else (low, high) for name, low, high in ends if (low, high) != (0.0, 0.0)}
        live = cls(box, len(shares.labels), shares.confidence)
        live.known = shares.attractors
        return live

    def renew(self, other: LiveAnswer) -> None:
        """Take the value at which starts are sorted; the box stays the same while numbers change."""
        self.title = {**other.title, "box": self.title["box"]}

    def coarse(self, system: System) -> BasinShares | None:
        """Return the shares of few starts among the known motions, which are corrected; others are unresolved."""
        if not self.known or not has_kernel(system):
            return None
        self.known = tuple(self._moved(system))
        room = Box.of(system, self.box)
        states = room.draw(min(FEW, self.starts), self.seed, lambda each: within_stops(system, each))
        track = motions_of(system, states, error=_ERROR).strobes(states, _WATCHED, after=_TRANSIENT)
        labels = np.where(np.isfinite(track).all(axis=(0, 2)), UNRESOLVED, RUNAWAY)
        for index, each in enumerate(self.known):
            labels[(labels == UNRESOLVED) & (signature_of(each, _NEAR).distance(track) <= 1.0)] = index
        return BasinShares(system, room, states, labels, self.known, self.confidence, complete=False)

    def rest(self, system: System) -> Iterator[BasinShares]:
        """Yield the shares."""
        yield self.exact(system)

    def exact(self, system: System) -> BasinShares:
        """Return the shares with labels that are exact at borders."""
        found = basin_shares(
            system, self.box, self.starts, confidence=self.confidence, seed=self.seed, workers=1,
            report=lambda *_: None,
        )  # fmt: skip
        self.known = found.attractors
        return found

    def _moved(self, system: System) -> Iterator[Attractor]:
        """Yield the known motions of a system with other numbers; those without a period as they are."""
        for each in self.known:
            if each.orbit is None:
                yield each
                continue
            with suppress(NumericalError):
                orbit = find_orbit(system, each.period, each.orbit.state)
                if orbit.stable:
                    yield replace(each, system=system, orbit=orbit, strobes=orbit.strobes(orbit.period))
