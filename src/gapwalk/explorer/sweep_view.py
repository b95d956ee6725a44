"""View of a sweep on the page: the states at each forcing period over the parameter, for each direction and start."""

from __future__ import annotations

import numpy as np

from gapwalk.explorer.answer_view import AnswerView, Json, Series, shown
from gapwalk.explorer.axis_quantities import SECTION, quantity_words
from gapwalk.studies.sweep_study import Sweep, Way

_LEVELS = 700  # of the section points at one value: points nearer to each other than a pixel are drawn once
_SAID = 5  # bands that the sentence names
_COORDINATES = 4  # whose sections are drawn
_MOST = 6000  # points of one order of values that a page draws without waiting
_LOOKS = {
    Way.UP: ("rising", "rising parameter"),
    Way.DOWN: ("falling", "falling parameter"),
    Way.AGAIN: ("main", "each value from the start"),
}


@shown(Sweep)
class SweepView(AnswerView):
    """The points of the section over the parameter, in a colour for each order of the values."""

    record: Sweep

    @property
    def axes(self) -> tuple[str, str]:
        """The parameter, and the section of the first coordinate."""
        return self.record.parameter, f"{SECTION}{self.record.system.coordinates[0]}"

    def sentences(self) -> list[str]:
        """Return the motions that the first direction meets, one after the other."""
        found, lane = self.record, self.record.lanes[0]
        bands = found.bands(0)
        if not bands:
            return [self.finding.stored]
        bands = bands[::-1] if lane.way is Way.DOWN else bands
        ends = [band.low if lane.way is Way.DOWN else band.high for band in bands]
        told = ", ".join(f"{band.regime} to {end:.4g}" for band, end in zip(bands[:_SAID], ends[:_SAID], strict=True))
        more = f", and {len(bands) - _SAID} more" if len(bands) > _SAID else ""
        return [f"{_LOOKS[lane.way][1].capitalize()}: {told}{more}"]

    def drawn(self) -> Json:
        """Return the section points of each coordinate, which the axes choose."""
        found, ways = self.record, [way for way in Way if any(lane.way is way for lane in self.record.lanes)]
        coordinates = found.system.coordinates[:_COORDINATES]
        return {
            "layers": [self._layer(way, each).plain for each in coordinates for way in ways],
            "quantities": quantity_words([f"{SECTION}{each}" for each in coordinates], found.system),
            "within": {self.record.parameter: [float(self.record.values[0]), float(self.record.values[-1])]},
        }

    def _layer(self, way: Way, coordinate: str) -> Series:
        """Return the points of all lanes of one order, without those that a screen cannot tell apart."""
        found = self.record
        parts = [found.section(coordinate, place) for place, lane in enumerate(found.lanes) if lane.way is way]
        x, y = (np.concatenate(each) for each in zip(*parts, strict=True))
        look, text = _LOOKS[way]
        if len(y):
            height = float(np.ptp(y)) or 1.0
            level = np.rint((y - y.min()) / height * _LEVELS)
            _, places = np.unique(np.column_stack([x, level]), axis=0, return_index=True)
            places = places[:: -(-len(places) // _MOST)]
            x, y = x[places], y[places]
        return Series(x, y, "dots", look, text, axes=(found.parameter, f"{SECTION}{coordinate}"))
