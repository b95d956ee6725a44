"""Views of answers about changed parameters and speeds on the page: designs, tolerances and many run-ups."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.design import ChangedParameter, Design
from gapwalk.answers.run_ups import RunUps
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.answers.tolerance import Tolerance
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.bifurcation.special_point import Kind
from gapwalk.explorer.answer_view import AnswerView, Json, Series, numbers, panel, shown, unit_of, with_unit
from gapwalk.model.system import System

_SAID = 2  # points that the sentences name
_DOTS = 600  # of the cloud of one point
_BINS = 60  # classes of a distribution
_COORDINATES = 6  # whose motion is drawn over a diagram
_SPEEDS = 100  # classes of the speed of many run-ups
_LEVELS = ((0.5, "middle", "half of them are below"), (0.95, "most", "95 % are below"), (1.0, "largest", "largest"))


@shown(Design)
class DesignView(AnswerView):
    """The responses before and after, the bands of the goals, and the changes as bars."""

    script = "(record.response, *record.isolated, record.response_before)"
    record: Design

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the response after the change, isolated branches of it, and the response before."""
        isolated = [(f"isolated-{number}", branch) for number, branch in enumerate(self.record.isolated, start=1)]
        return [("after", self.record.response), *isolated, ("before", self.record.response_before)]

    @property
    def earlier(self) -> tuple[int, ...]:
        """The response before the change."""
        return (1 + len(self.record.isolated),)

    @property
    def axes(self) -> tuple[str, str]:
        """The walked parameter, and the measure of what is asked for."""
        return self.record.parameter, shown_measure(self.record.system, self.record)

    def drawn(self) -> Json:
        """Return the bands of the goals, and the change of each parameter within its limits."""
        found = self.record
        words: dict[tuple[float, float], list[str]] = {}
        for goal, judged in zip(found.goals, found.judged, strict=True):
            if goal.band:
                words.setdefault(goal.band, []).append(judged.words)
        return {
            "shades": [
                {"over": found.parameter, "low": low, "high": high, "tint": "goal", "text": "; ".join(texts)}
                for (low, high), texts in words.items()
            ],
            "lines": [
                {"over": found.parameter, "at": value, "text": f"{value:.6g}", "exact": True}
                for value in dict.fromkeys(value for band in words for value in band)
            ],
            "bars": [self._bar(each) for each in found.changes],
        }

    def _bar(self, change: ChangedParameter) -> Json:
        """Return a change and its limits in percent: of its value, or of half its range if that was zero."""
        size = abs(change.before) or 0.5 * (change.high - change.low)
        low, high, moved = (100.0 * (end - change.before) / size for end in (change.low, change.high, change.after))
        unit = unit_of(change.name, self.record.system)
        text = f"{change.before:.4g} → {change.after:.4g} {unit}".rstrip() + f" ({moved:+.2f} %)"
        return {"name": change.name, "low": low, "high": high, "moved": moved, "text": text}


@shown(Tolerance)
class ToleranceView(AnswerView):
    """The nominal response with the cloud of each special point, and the distributions below."""

    script = "(record.branch,)"
    record: Tolerance

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the nominal branch."""
        return [(f"P{self.record.branch.period}-1", self.record.branch)]

    @property
    def axes(self) -> tuple[str, str]:
        """The parameter of the branch, and the measure of what varies."""
        return self.record.parameter, shown_measure(self.system, self.record)

    @property
    def system(self) -> System:
        """The nominal system."""
        return self.record.branch.system

    def sentences(self) -> list[str]:
        """Return the probability of a jump in the band; without a band, where the first points lie."""
        first = [part for part in self._parts()[:1] if isinstance(part, str)]
        if self.record.band is not None or not self.record.known.any():
            return first
        return [
            f"{self._title(index)}: {self._words(index)[1]}" for index in range(min(_SAID, len(self.record.points)))
        ]

    def _title(self, index: int) -> str:
        special = self.record.points[index]
        return f"{special.kind} {special.contact}".rstrip()

    def drawn(self) -> Json:
        """Return a cloud for each point, the band, and the distributions."""
        found = self.record
        band = found.band
        text = "" if band is None else "band in which no fold should lie"
        shades = [] if band is None else [{"low": band[0], "high": band[1], "tint": "goal", "text": text}]
        ends = [] if band is None else [{"at": value, "text": f"{value:.6g}", "exact": True} for value in band]
        if not found.known.any():
            return {}
        below = [panel("distribution", found.parameter, self.system, self._distributions())]
        return {
            "shades": [{"over": found.parameter, **each} for each in shades],
            "lines": [{"over": found.parameter, **each} for each in ends],
            "clouds": [self._cloud(index) for index in range(len(found.points))],
            "ends": list(self._ends()),
            "below": below,
            "within": {found.parameter: list(self._reach())},
        }

    def _column(self, index: int) -> NDArray[np.float64]:
        column = self.record.values[self.record.known][:, index]
        return column[~np.isnan(column)]

    def _reach(self) -> tuple[float, float]:
        """Return the range of the picture: that of the branch, and most of each distribution."""
        values = self.record.branch.values
        ends = [float(values.min()), float(values.max())]
        for index in range(len(self.record.points)):
            if len(column := self._column(index)):
                ends += np.quantile(column, (0.003, 0.997)).tolist()
        return min(ends), max(ends)

    def _words(self, index: int) -> list[str]:
        """Return the quantiles of a point, the probability that it exists or lies in the band, and what matters."""
        found, column = self.record, self._column(index)
        unit = unit_of(found.parameter, self.system)
        special = found.points[index]
        lines = [f"nominal {special.value:.7g} {unit}".rstrip()]
        if len(column):
            low, middle, high = np.quantile(column, (0.05, 0.5, 0.95))
            where = f"from {low:.6g} to {high:.6g}, half below {middle:.6g} {unit}".rstrip()
            lines.append(f"in 90 % of the parts that have it {where}")
        lines.append(f"exists in {found.exists[index]} of all parts")
        if found.band is not None:
            lines.append(f"in the band in {found.chances(*found.band)[index]}")
        return [*lines, f"what matters: {words}"] if (words := found.words(index)) else lines

    def _cloud(self, index: int) -> Json:
        found, column = self.record, self._column(index)
        special = found.points[index]
        every = max(1, -(-len(column) // _DOTS))
        quantiles = np.quantile(column, (0.05, 0.5, 0.95)) if len(column) else []
        return {
            "over": found.parameter,
            "kind": special.kind.value,
            "title": self._title(index),
            "x": numbers(column[::every]),
            "quantiles": numbers(quantiles),
            "lines": self._words(index),
            "place": self.place_of(special),
        }

    def _ends(self) -> Iterator[Json]:
        unit = unit_of(self.record.parameter, self.system)
        for index, special in enumerate(self.record.points):
            place = self.place_of(special)
            if place is not None:
                most = self.record.words(index)
                yield {
                    "text": f"{special.value:.7g} {unit}".rstrip(),
                    "kind": special.kind.value,
                    "most": most,
                    **place,
                }

    def _distributions(self) -> Iterator[Series]:
        """Yield the distribution of each point, the highest of its classes being 1."""
        seen: set[Kind] = set()
        for index, special in enumerate(self.record.points):
            column = self._column(index)
            if len(column) < 2 or np.ptp(np.quantile(column, (0.01, 0.99))) == 0.0:
                continue
            low, high = np.quantile(column, (0.01, 0.99))
            wide = 0.5 * (high - low)  # beyond this, single parts lie: they would widen all classes
            reach = max(low - wide, float(column.min())), min(high + wide, float(column.max()))
            heights, edges = np.histogram(column, min(_BINS, max(5, int(np.sqrt(len(column))))), reach)
            x, y = np.repeat(edges, 2), np.concatenate(([0.0], np.repeat(heights / heights.max(), 2), [0.0]))
            text = "" if special.kind in seen else f"{special.kind}: distribution"
            seen.add(special.kind)
            yield Series(x, y, "area", f"kind-{special.kind.value}", text)


@shown(RunUps)
class RunUpsView(AnswerView):
    """The largest forces over the rate, and quantiles of amplitudes and forces over the speed."""

    record: RunUps

    @property
    def axes(self) -> tuple[str, str]:
        """The speed, and the amplitude of the first coordinate."""
        return self.record.system.structure.pace, f"half.{self.record.system.coordinates[0]}"

    @property
    def contacts(self) -> Sequence[str]:
        """The contacts that touch."""
        return self.record.touching

    def sentences(self) -> list[str]:
        """Return the largest force of each contact with its spread; without any, the number of run-ups."""
        return list(self.record.sentences) or super().sentences()

    def drawn(self) -> Json:
        """Return quantiles of the amplitudes over the speed, and of the forces below; and the forces over the rate."""
        found, pace, units = self.record, self.axes[0], self.record.system.units
        layers = []
        for place, name in enumerate(found.system.coordinates[:_COORDINATES]):
            half = 0.5 * (found.high[:, :, place] - found.low[:, :, place])
            layers += [each._replace(axes=(pace, f"half.{name}")).plain for each in self._levels(half)]
        force = "force of {}" + " [N m]" * bool(units)
        below, charts = [], []
        for name in found.touching:
            values = found.forces[:, :, found.contacts.index(name)]
            below.append(panel(force.format(name), pace, found.system, self._levels(values), name))
            charts.append(self._over_rate(name, f"largest {force.format(name)}"))
        return {
            "layers": layers,
            "below": below,
            "charts": charts,
            "within": {pace: numbers((found.speeds.min(), found.speeds.max()))},
        }

    def _levels(self, values: NDArray[np.float64]) -> list[Series]:
        """Return quantiles over all run-ups of values near each speed."""
        speeds, kept = self.record.speeds.ravel(), values.ravel()
        speeds, kept = speeds[np.isfinite(kept)], kept[np.isfinite(kept)]
        if not len(kept):
            return []
        edges = np.linspace(self.record.speeds.min(), self.record.speeds.max(), min(self.record.bins, _SPEEDS) + 1)
        place = np.clip(np.digitize(speeds, edges) - 1, 0, len(edges) - 2)
        groups = [(middle, kept[place == k]) for k, middle in enumerate(0.5 * (edges[1:] + edges[:-1]))]
        filled = [(middle, group) for middle, group in groups if len(group)]
        x = [middle for middle, _ in filled]
        return [
            Series(x, [np.quantile(group, level) for _, group in filled], "line", look, text)
            for level, look, text in _LEVELS
        ]

    def _over_rate(self, contact: str, title: str) -> Json:
        found = self.record
        pace, units = found.system.structure.pace, found.system.units
        rates, (low, middle, high) = found.quantiles(contact)
        across = with_unit(f"rate of {pace}", f"{units.parameter(pace)}/s" if units else "")
        series = [Series(found.rates, found.peaks(contact), "dots", "run", "a run-up")]
        if len(rates) > 1 and len(found.courses) > 2 * len(rates):
            series += [
                Series(rates, middle, "line", "middle", "half of them are below"),
                Series(rates, low, "line", "most", "5 % and 95 %"),
                Series(rates, high, "line", "most"),
            ]
        return {"title": title, "across": across, "series": [each.plain for each in series], "of": contact}
