"""Views of free motions on the page: backbones over the responses, and self-excited motions with their equilibria."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.explorer.answer_picture import AnswerPicture
from gapwalk.explorer.answer_view import AnswerView, Json, Series, panel, shown, with_unit
from gapwalk.explorer.axis_quantities import quantity_words
from gapwalk.free import backbone_curve, rest_walk
from gapwalk.free.backbone_curve import Backbone
from gapwalk.free.island_births import Backbones
from gapwalk.free.rest_walk import Rests
from gapwalk.free.self_excitation import SelfExcited
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words

_COORDINATES = 6  # whose amplitudes are drawn
_MEASURES = ("max", "min")
_LOOKS = ("backbone", "falling", "other", "main")  # of successive backbones


class _BackbonesView(AnswerView):
    """Backbones over the frequency: in the diagram they lie over the responses of other results."""

    @property
    def lines(self) -> Sequence[Backbone]:
        """The backbones."""
        raise NotImplementedError

    @property
    def system(self) -> System:
        """The system without losses."""
        return self.lines[0].system

    @property
    def axes(self) -> tuple[str, str] | None:
        """The frequency, and half the range of the first coordinate; None before the first backbone is known."""
        if not self.lines:
            return None
        return self.system.structure.pace, f"half.{self.system.coordinates[0]}"

    def sentences(self) -> list[str]:
        """Return the range of each backbone."""
        return [
            text for line in self.lines for text in line.summary() if isinstance(text, str) and "backbone" in text[:8]
        ]

    def drawn(self) -> Json:
        """Return the amplitude of each coordinate over the frequency, and the frequency over the energy."""
        if not self.lines:
            return {}
        names = [f"half.{each}" for each in self.system.coordinates[:_COORDINATES]]
        values = np.concatenate([line.values for line in self.lines])
        return {
            "layers": [each.plain for name in names for each in self._over(name)],
            "charts": self._energies(),
            "quantities": quantity_words(names, self.system),
            "within": {self.system.structure.pace: [float(values.min()), float(values.max())]},
        }

    def _over(self, measure: str) -> Iterator[Series]:
        coordinate, axes = measure.partition(".")[2], (self.system.structure.pace, measure)
        place = self.system.coordinates.index(coordinate)
        for line, look in zip(self.lines, cycle(_LOOKS), strict=False):
            yield Series(line.values, line.half(coordinate), "line", look, line.name, axes=axes)
        for kind in backbone_curve.EVENTS:
            found = [event for line in self.lines for event in line.events if event.kind == kind]
            if found:
                x, y = zip(*((each.value, each.point.half[place]) for each in found), strict=True)
                yield Series(x, y, "stars", "worst", kind, axes=axes)

    def _energies(self) -> list[Json]:
        """Return a chart of the frequency over the logarithm of the energy, where the equations show the energy."""
        known = [line for line in self.lines if np.isfinite(line.energies).all() and line.energies.max() > 0.0]
        if not known:
            return []
        pace = self.system.structure.pace
        series = []
        for line, look in zip(known, cycle(_LOOKS), strict=False):
            own = line.energies > 0.0
            series.append(Series(np.log10(line.energies[own]), line.values[own], "line", look, line.name))
        chart = panel(parameter_words(pace, self.system.units), pace, self.system, series, fitted=True)
        return [{**chart, "across": "energy, power of ten"}]

    def pictures(self) -> list[AnswerPicture]:
        """Return the picture of the backbones."""
        return [AnswerPicture("backbones over frequency and energy", self.record)] if self.lines else []


@shown(Backbones)
class BackbonesView(_BackbonesView):
    """All backbones of a study."""

    record: Backbones

    @property
    def lines(self) -> tuple[Backbone, ...]:
        """The backbones."""
        return self.record.lines

    def sentences(self) -> list[str]:
        """Return the range of each backbone; without any, how much is stored."""
        return super().sentences() or [self.finding.stored]


@shown(Backbone)
class BackboneView(_BackbonesView):
    """One backbone."""

    record: Backbone

    @property
    def lines(self) -> tuple[Backbone, ...]:
        """The backbone itself."""
        return (self.record,)


@shown(SelfExcited)
class SelfExcitedView(AnswerView):
    """Branches of self-excited motions over the parameter, the equilibria, and the frequency of the motions below."""

    script = "list(record.cycles)"
    record: SelfExcited

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the branches of motions."""
        return [(f"motions {number}", each) for number, each in enumerate(self.record.cycles, start=1)]

    @property
    def axes(self) -> tuple[str, str]:
        """The parameter, and the largest value of the first coordinate: an equilibrium has no range."""
        return self.record.parameter, f"max.{self.record.system.coordinates[0]}"

    def sentences(self) -> list[str]:
        """Return where motions begin by themselves."""
        found = self.record
        points = [f"{event.words} at {found.parameter} = {_rounded(event.value):.8g}" for event in found.hopf_points]
        count = len(found.cycles)
        branches = f"{count} {'branch' if count == 1 else 'branches'} of self-excited motions"
        return ["; ".join([branches, *points])]

    def drawn(self) -> Json:
        """Return the equilibria over the parameter, and the frequency of the motions."""
        found, system = self.record, self.record.system
        names = [f"{kind}.{each}" for each in system.coordinates[:_COORDINATES] for kind in _MEASURES]
        pace = system.structure.pace
        series = [Series(each.values, _frequencies(each), text="self-excited motion") for each in found.cycles]
        title = with_unit("frequency of the motion", parameter_words(pace, system.units).partition(" [")[2].rstrip("]"))
        return {
            "layers": [each.plain for name in names for line in found.rests for each in _rest_lines(line, name)],
            "below": [panel(title, found.parameter, system, series, fitted=True)] if series else [],
            "quantities": quantity_words(names, system),
            "within": {found.parameter: list(found.within)},
        }

    def pictures(self) -> list[AnswerPicture]:
        """Return the picture of equilibria and motions."""
        return [AnswerPicture("equilibria and motions over the parameter", self.record)]


def _rounded(value: float) -> float:
    """Return a value without digits that are rounding errors next to 1."""
    return round(value, 12) + 0.0


def _frequencies(branch: Branch) -> list[float]:
    pace = branch.points[0].orbit.system.structure.pace
    return [point.orbit.system[pace] for point in branch.points]


def _rest_lines(line: Rests, measure: str) -> Iterator[Series]:
    """Yield the equilibria over the parameter, stable and unstable, and what happens along them."""
    coordinate, axes = measure.partition(".")[2], (line.parameter, measure)
    values, heights = line.values, line.coordinate(coordinate)
    stable = np.array([point.stable for point in line.points])
    for held, look, text in ((True, "torus", "stable equilibrium"), (False, "torus-unstable", "unstable equilibrium")):
        own = stable == held
        drawn = own.copy()
        if not held:  # the step between a stable and an unstable point is drawn as unstable
            drawn[:-1] |= own[1:]
            drawn[1:] |= own[:-1]
        if drawn.any():
            yield Series(values, np.where(drawn, heights, np.nan), "line", look, text, axes=axes)
    place = line.system.coordinates.index(coordinate)
    for kind in rest_walk.EVENTS:
        found = [event for event in line.events if event.kind == kind]
        if found:
            x, y = zip(*((each.value, each.point.position[place]) for each in found), strict=True)
            mark = "crosses" if kind == rest_walk.BORDER else "stars"
            yield Series(x, y, mark, "measured" if mark == "crosses" else "worst", kind, axes=axes)
