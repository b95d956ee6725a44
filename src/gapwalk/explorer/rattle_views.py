"""Views of answers about rattle on the page: bands with their severity, maps of two parameters, and thresholds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from gapwalk.answers.gap_states import BandEnd, GapState
from gapwalk.answers.rattle_bands import RattleBands, RattleMap, Severity, cell_word
from gapwalk.answers.settled_sweep import Direction
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.answers.threshold import Threshold
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.errors import GapwalkError
from gapwalk.explorer.answer_view import AnswerView, Json, Series, panel, shown, unit_of, with_unit
from gapwalk.explorer.motion_panels import gradient_content

_WATCHED, _SAMPLES = 16, 64  # forcing periods of a motion without period, and samples of each
_TINTS = {GapState.ONE_SIDE: ("one", "rattles on one side"), GapState.BOTH_SIDES: ("both", "on both sides")}
_CELLS = {GapState.CLOSED: "closed", GapState.OPEN: "open", GapState.ONE_SIDE: "one", GapState.BOTH_SIDES: "both"}
_WAYS = {str(Direction.UP): "rising", str(Direction.DOWN): "falling"}


@shown(RattleBands)
class RattleView(AnswerView):
    """The bands of each gap over the response, and severity below."""

    script = "[stretch.branch for sweep in record.sweeps for stretch in sweep.stretches]"
    record: RattleBands

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the stretches of settled periodic motions, named after the sweeps that met them."""
        return [
            (f"{sweep.met}-{number}", stretch.branch)
            for sweep in self.record.sweeps
            for number, stretch in enumerate(sweep.stretches, start=1)
        ]

    @property
    def axes(self) -> tuple[str, str]:
        """The parameter, and the amplitude of the coordinate that deflects the first gap most."""
        return self.record.parameter, shown_measure(self.record.system, self.record)

    @property
    def contacts(self) -> Sequence[str]:
        """The gaps."""
        return self.record.gaps

    def sentences(self) -> list[str]:
        """Return a sentence for each gap."""
        return [self.record.sentence(gap) for gap in self.record.gaps]

    def drawn(self) -> Json:
        """Return bands with their ends, samples of motions without a branch, and severity."""
        found = self.record
        return {
            "shades": [each for gap in found.gaps for each in self._shades(gap)],
            "lines": [each for gap in found.gaps for each in self._lines(gap)],
            "ends": [each for gap in found.gaps for each in self._ends(gap)],
            "layers": [self._samples().plain],
            "below": [each for gap in found.gaps for each in self._severity(gap)],
            "within": {found.parameter: list(found.within)},
        }

    def _shades(self, gap: str) -> Iterator[Json]:
        """Yield the spans of each state; where motions of both kinds exist, the worse one shows."""
        spans = [span for band in self.record.of(gap) for span in band.spans]
        values = sorted({end.value for span in spans for end in (span.low, span.high)})
        before: Json | None = None
        for low, high in pairwise(values):
            states = [span.state for span in spans if span.low.value <= low and high <= span.high.value]
            tint, text = _TINTS[max(states, key=list(_TINTS).index)] if states else ("", "")
            if before is not None and before["tint"] == tint and before["high"] == low:
                before["high"] = high
                continue
            if before is not None:
                yield before
            before = {"over": self.record.parameter, "low": low, "high": high, "tint": tint, "text": text, "of": gap}
            before = before if tint else None
        if before is not None:
            yield before

    def _ends_of(self, gap: str) -> list[tuple[str, BandEnd]]:
        return [pair for band in self.record.of(gap) for pair in (("from", band.low), ("to", band.high))]

    def _lines(self, gap: str) -> Iterator[Json]:
        for _, end in self._ends_of(gap):
            line = {"over": self.record.parameter, "at": end.value, "text": f"{end.value:.6g}"}
            yield {**line, "exact": end.is_located, "of": gap}

    def _ends(self, gap: str) -> Iterator[Json]:
        unit = unit_of(self.record.parameter, self.record.system)
        for word, end in self._ends_of(gap):
            place = self.place_of(end.special)
            if place is not None:
                most = ", ".join(f"{each.name} {each.share:+.2f}" for each in end.movers[:2])
                yield {
                    "text": f"{word} {end.value:.7g} {unit}".rstrip(),
                    "kind": end.kind,
                    "most": most,
                    **place,
                    "of": gap,
                }

    def _samples(self) -> Series:
        """Return the amplitudes of the motions that were sampled, because they have no branch."""
        found, measure = self.record, self.axes[1]
        place = found.system.coordinates.index(measure.partition(".")[2])
        x, y = [], []
        for sweep in found.sweeps:
            for each in sweep.samples:
                x.append(each.value)
                y.append(0.5 * float(np.ptp(each.motion.motion(_WATCHED, _SAMPLES).q[:, place])))
        text = "not periodic, or of long period"
        return Series(x, y, "crosses", "wild", text if x else "", axes=self.axes)

    def _severity(self, gap: str) -> Iterator[Json]:
        """Yield the panels of severity: the peak force, or the approach velocity of a rigid stop; and the impacts."""
        found, units = self.record, self.record.system.units
        rows = [row for row in found.severities if row.gap == gap]
        if all(math.isnan(row.peak) for row in rows if row.state.rattles):
            title, key = with_unit("approach velocity", units and units.state("'")), "approach"
        else:
            title, key = ("peak torque [N m]" if units else "peak force"), "peak"
        worst = next((each.severity for each in found.worst if each.severity.gap == gap), None)
        series = list(_along(rows, key))
        if worst is not None:
            series.append(Series([worst.value], [getattr(worst, key)], "stars", "worst", "worst"))
        yield panel(title, found.parameter, found.system, series, gap)
        many = "impacts per second" if units else "impacts per unit of time"
        yield panel(many, found.parameter, found.system, _along(rows, "per_second"), gap)


def _along(rows: Sequence[Severity], key: str) -> Iterator[Series]:
    """Yield the series of one figure along the motions met in each way."""
    for met in dict.fromkeys(row.met for row in rows):
        own = [row for row in rows if row.met == met]
        look = _WAYS.get(met, "other")
        text = f"{met} parameter" if met in _WAYS else "other motions"
        for mark, chosen in (
            ("line", own if met in _WAYS else []),
            ("dots", [row for row in own if row.period]),
            ("crosses", [row for row in own if not row.period]),
        ):
            x, y = [row.value for row in chosen], [getattr(row, key) for row in chosen]
            if x:
                yield Series(x, y, mark, look, text if mark == "dots" else "")


@shown(RattleMap)
class RattleMapView(AnswerView):
    """The state of each gap in the plane of two parameters, with the exact borders over the cells."""

    script = "record.loci"
    record: RattleMap

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the borders."""
        return named_loci(self.record.loci)

    @property
    def axes(self) -> tuple[str, str]:
        """Both parameters."""
        return self.record.first, self.record.second

    @property
    def contacts(self) -> Sequence[str]:
        """The gaps."""
        return self.record.gaps

    def sentences(self) -> list[str]:
        """Return the share of cells of each state, for each gap."""
        return [str(part) for part in self._parts()[: len(self.record.gaps)]]

    def drawn(self) -> Json:
        """Return the cells of each gap."""
        found = self.record
        return {
            "cells": [self._cells(place, gap) for place, gap in enumerate(found.gaps)],
            "within": dict(zip(self.axes, map(list, found.within), strict=True)),
        }

    def _cells(self, place: int, gap: str) -> Json:
        codes, is_periodic = self.record.codes[..., place], self.record.periods > 0
        pairs = sorted({*zip(codes.ravel().tolist(), is_periodic.ravel().tolist(), strict=True)})
        kinds = {pair: number for number, pair in enumerate(pairs)}
        states = list(GapState)
        entries = [
            {"tint": _tint(code, states), "wild": code >= 0 and not periodic, "text": cell_word(code, periodic)}
            for code, periodic in pairs
        ]
        rows = [
            [kinds[pair] for pair in zip(line, periods, strict=True)]
            for line, periods in zip(codes.tolist(), is_periodic.tolist(), strict=True)
        ]
        return {
            "axes": list(self.axes),
            "within": list(map(list, self.record.within)),
            "rows": rows,
            "entries": entries,
            "of": gap,
        }


def _tint(code: int, states: Sequence[GapState]) -> str:
    """Return the tint of a cell: of a state, of a motion that has diverged, or of what is not known yet."""
    return _CELLS[states[code]] if code >= 0 else "none" if code == -1 else "undone"


def named_loci(loci: Sequence[Locus]) -> list[tuple[str, Branch | Locus]]:
    """Return loci with their names, such as ``grazing-2``."""
    return [(f"{locus.kind.value}-{number}", locus) for number, locus in enumerate(loci, start=1)]


@shown(Threshold)
class ThresholdView(AnswerView):
    """The borders of rattle in the plane of both parameters, the quiet side, and the limit."""

    script = "record.loci"
    record: Threshold

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the loci that were followed."""
        return named_loci(self.record.loci)

    @property
    def axes(self) -> tuple[str, str]:
        """The other parameter across, the parameter of the threshold up."""
        return self.record.over, self.record.parameter

    def sentences(self) -> list[str]:
        """Return the answer."""
        return [self.record.sentence]

    def drawn(self) -> Json:
        """Return the quiet side, the limit, and what moves it."""
        found = self.record
        drawn: Json = {
            "within": {found.over: [found.low, found.high], found.parameter: sorted((found.begin, found.end))}
        }
        if found.limit is None:
            return drawn
        low, high = sorted((found.value, found.end))
        text = f"{found.value:.6g} at {found.at:.6g}"
        place = {found.over: found.at, found.parameter: found.value}
        try:
            gradient = gradient_content(found.gradient())
        except GapwalkError as error:
            gradient = {"reason": str(error)}
        return drawn | {
            "shades": [{"over": found.parameter, "low": low, "high": high, "tint": "quiet", "text": "nothing rattles"}],
            "lines": [{"over": found.parameter, "at": found.value, "text": "", "exact": True}],
            "layers": [Series([found.at], [found.value], "stars", "worst", f"limit: {text}", axes=self.axes).plain],
            "ends": [{"text": f"limit: {text}", "kind": found.limit.kind.value, "place": place, "gradient": gradient}],
        }
