"""Views of tori on the page: families over their parameter, with lockings and rotation numbers; pictures of tori."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.explorer.answer_picture import AnswerPicture
from gapwalk.explorer.answer_view import AnswerView, Json, Series, panel, shown
from gapwalk.explorer.axis_quantities import SECTION, quantity_words
from gapwalk.model.system import System
from gapwalk.model.words import full_measure
from gapwalk.tori.tongue import Tongue
from gapwalk.tori.torus import TURN, Torus, at_phases
from gapwalk.tori.torus_family import TorusDiagram, TorusEventKind, TorusFamily

_COORDINATES = 4  # whose measures are drawn
_MEASURES = ("half", "max", "min")
_PICTURES = 6  # of single tori
_FINE = 400  # points of a curve
_LOOKS = ("main", "rising", "falling", "other")  # of successive curves
_STABLE, _UNSTABLE = ("torus", "torus, stable"), ("torus-unstable", "torus, unstable")


class _FamiliesView(AnswerView):
    """Families of tori in the diagram of their parameter, their rotation numbers below it, and pictures of tori."""

    @property
    def families(self) -> Sequence[TorusFamily]:
        """The families of tori."""
        raise NotImplementedError

    @property
    def parameter(self) -> str:
        """The parameter along which they are followed."""
        raise NotImplementedError

    @property
    def axes(self) -> tuple[str, str]:
        """The parameter, and half the range of the first coordinate."""
        return self.parameter, full_measure("half", self.system.coordinates)

    def drawn(self) -> Json:
        """Return the families over their parameter, windows in which motions lock, and rotation numbers."""
        over, system = self.parameter, self.system
        names = [f"{kind}.{each}" for each in system.coordinates[:_COORDINATES] for kind in _MEASURES]
        events = [event for family in self.families for event in family.events]
        windows = [event.window for event in events if event.window is not None]
        locked = "locked to a periodic motion"
        return {
            "layers": [each.plain for name in names for each in self._over(name)],
            "shades": [
                {"over": over, "low": each.low, "high": each.high, "tint": "goal", "text": locked} for each in windows
            ],
            "below": [panel("rotation number", over, system, self._rotations(), fitted=True)] if self.families else [],
            "quantities": quantity_words(names, system),
        }

    def _over(self, measure: str) -> Iterator[Series]:
        for family in self.families:
            yield from _lines(family, family.measure(measure), (self.parameter, measure))

    def _rotations(self) -> Iterator[Series]:
        for family in self.families:
            yield from _lines(family, family.rotations)
        for kind in TorusEventKind:
            found = [each for family in self.families for each in family.events if each.kind is kind]
            if found:
                values, rotations = zip(*((each.value, each.rotation) for each in found), strict=True)
                mark = "crosses" if kind is TorusEventKind.RESONANCE else "stars"
                yield Series(values, rotations, mark, "worst" if mark == "stars" else "measured", kind.value)

    def pictures(self) -> list[AnswerPicture]:
        """Return the picture of the whole, and those of some tori of each family, in the section and in space."""
        found = [AnswerPicture("all tori over the parameter", self.record)]
        each = max(1, _PICTURES // max(1, len(self.families)))
        for number, family in enumerate(self.families[:_PICTURES], start=1):
            for torus in _some(family, each):
                found.append(_picture(torus, f"T{number}, {self.parameter} = {torus.system[self.parameter]:.8g}"))
        return found


def _lines(family: TorusFamily, heights: NDArray[np.float64], axes: tuple[str, ...] = ()) -> Iterator[Series]:
    """Yield the stable and the unstable part of a family; a step from one to the other counts as unstable."""
    values, stable = family.values, np.array([point.torus.stable for point in family.points])
    if len(values) == 1:
        yield Series(values, heights, "dots", *(_STABLE if stable[0] else _UNSTABLE), axes=axes)
        return
    steps = stable[:-1] & stable[1:]
    for held, look in ((True, _STABLE), (False, _UNSTABLE)):
        own = steps == held
        if own.any():
            # a value that is left out cuts the line: between two points of which no step is drawn, one is left out
            drawn = np.append(own, False) | np.append(False, own)
            cuts = np.flatnonzero(~own & drawn[:-1] & drawn[1:]) + 1
            x = np.insert(np.where(drawn, values, np.nan), cuts, np.nan)
            y = np.insert(np.where(drawn, heights, np.nan), cuts, np.nan)
            yield Series(x, y, "line", *look, axes=axes)


def _tongue_lines(tongues: Sequence[Tongue]) -> Iterator[Series]:
    for tongue, look in zip(tongues, cycle(_LOOKS), strict=False):
        for side in tongue.sides:
            first, second = side.values.T
            yield Series(first, second, "line", look, f"tongue {tongue.ratio}", axes=(side.first, side.second))
        if tongue.tip is not None:
            first, second = tongue.tip.values
            yield Series([first], [second], "stars", "worst", "tip", axes=(tongue.first, tongue.second))


def _some(family: TorusFamily, count: int) -> list[Torus]:
    """Return the largest torus of a family and others that are spread along it, in order along the family."""
    sizes = [point.torus.size for point in family.points]
    places = [int(np.argmax(sizes)), *np.linspace(0, len(sizes) - 1, count + 1)[1:].round().astype(int).tolist()]
    return [family.points[place].torus for place in sorted(list(dict.fromkeys(places))[:count])]


def _picture(torus: Torus, text: str) -> AnswerPicture:
    rotation = f"rotation number {torus.rotation:.8g}"
    return AnswerPicture(f"{text}: {rotation}", torus, "png", {"title": f"{text}, {rotation}"})


@shown(TorusDiagram)
class TorusDiagramView(_FamiliesView):
    """All tori of a range, over the branches on which they begin."""

    script = "[member.branch for member in record.diagram.members]"
    record: TorusDiagram

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return the branches of periodic motions."""
        return [(member.name, member.branch) for member in self.record.diagram.members]

    @property
    def families(self) -> tuple[TorusFamily, ...]:
        """The families of tori."""
        return self.record.families

    @property
    def parameter(self) -> str:
        """The parameter of the study."""
        return self.record.diagram.parameter

    @property
    def system(self) -> System:
        """The system of the first branch; with a second tone, that of the first torus."""
        members = self.record.diagram.members
        return members[0].branch.points[0].orbit.system if members else self.families[0].points[0].torus.system

    def sentences(self) -> list[str]:
        """Return how many families there are."""
        return [next(iter(text for text in self.record.summary() if isinstance(text, str)))]

    def drawn(self) -> Json:
        """Return the families, where the range has any motion, and tongues over their own axes."""
        if not (self.record.diagram.members or self.families):
            return {}
        drawn = super().drawn()
        layers = [*drawn["layers"], *(each.plain for each in _tongue_lines(self.record.tongues))]
        return {**drawn, "layers": layers, "within": {self.parameter: list(self.record.diagram.within)}}

    def pictures(self) -> list[AnswerPicture]:
        """Return the picture of the whole, that of the tongues, and those of some tori."""
        whole, *tori = super().pictures()
        tongues = self.record.tongues
        return [whole, *([AnswerPicture("tongues over both parameters", list(tongues))] if tongues else []), *tori]

    @property
    def parameters(self) -> tuple[str, ...]:
        """The second parameter of tongues."""
        return tuple(dict.fromkeys(tongue.second for tongue in self.record.tongues))


@shown(Tongue)
class TongueView(AnswerView):
    """One tongue: both sides over both parameters, which are loci to choose."""

    script = "list(record.sides)"
    record: Tongue

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return both sides."""
        return [(f"{name} side", side) for name, side in zip(("lower", "upper"), self.record.sides, strict=True)]

    @property
    def axes(self) -> tuple[str, str]:
        """Both parameters."""
        return self.record.first, self.record.second

    @property
    def system(self) -> System:
        """The system of its first point."""
        return self.record.sides[0].points[0].orbit.system

    def drawn(self) -> Json:
        """Return the tip."""
        tips = (each for each in _tongue_lines((self.record,)) if each.mark == "stars")
        return {"layers": [each.plain for each in tips]}

    def pictures(self) -> list[AnswerPicture]:
        """Return the picture of the tongue."""
        return [AnswerPicture("the tongue over both parameters", self.record)]


@shown(TorusFamily)
class TorusFamilyView(_FamiliesView):
    """One family of tori."""

    record: TorusFamily

    @property
    def families(self) -> tuple[TorusFamily, ...]:
        """The family itself."""
        return (self.record,)

    @property
    def parameter(self) -> str:
        """The parameter of the family."""
        return self.record.parameter

    @property
    def system(self) -> System:
        """The system of its first torus."""
        return self.record.points[0].torus.system


@shown(Torus)
class TorusView(AnswerView):
    """One torus: its picture, in the section and in space."""

    record: Torus

    @property
    def axes(self) -> tuple[str, str]:
        """The section of the first coordinate and its velocity."""
        name = self.record.system.coordinates[0]
        return f"{SECTION}{name}", f"{SECTION}{name}'"

    def sentences(self) -> list[str]:
        """Return the torus in words."""
        return [repr(self.record)]

    def drawn(self) -> Json:
        """Return each of its curves in the sections of all coordinates."""
        system, sections = self.record.system, self.record.sections
        names = [f"{SECTION}{each}" for each in system.state_names]
        layers = []
        for place, name in enumerate(system.coordinates[:_COORDINATES]):
            axes = (f"{SECTION}{name}", f"{SECTION}{name}'")
            for number, curve in enumerate(sections, start=1):
                closed = at_phases(curve, np.linspace(0.0, TURN, _FINE))
                text = "the curve" if len(sections) == 1 else f"forcing period {number} of {len(sections)}"
                look = _LOOKS[(number - 1) % len(_LOOKS)]
                layers.append(Series(closed[:, place], closed[:, system.size + place], "line", look, text, axes=axes))
        return {"layers": [each.plain for each in layers], "quantities": quantity_words(names, system)}

    def pictures(self) -> list[AnswerPicture]:
        """Return the picture of the torus."""
        return [_picture(self.record, "in the section, and in space")]
