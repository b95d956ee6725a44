"""The file of a map: each section and each locus is written when it is accepted, whole."""

from __future__ import annotations

from dataclasses import replace

from gapwalk.bifurcation.locus import Locus
from gapwalk.results.file import Entry, Part, Parts
from gapwalk.study.map.chart import Map, Section
from gapwalk.study.request import Keeper

SECTION = Part("section", Section, numbered=True)
LOCUS = Part("locus", Locus, numbered=True)
STATE = Part("map", tuple[Map, int, int])
"""What is known of the map as a whole, without its sections and loci; and how many of each there are."""


class MapStore:
    """Writes the file of a map that is being computed.

    Parameters
    ----------
    file
        The file.
    """

    def __init__(self, file: Keeper) -> None:
        self._file = file

    def add(self, chart: Map, addition: Section | Locus) -> None:
        """Write the section or the locus that was added to a map last.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        is_section = isinstance(addition, Section)
        added = SECTION.entry(addition, len(chart.sections) - 1) if is_section else None
        self._file.write(added or LOCUS.entry(addition, len(chart.loci) - 1), _state(replace(chart, complete=False)))

    def finish(self, chart: Map) -> None:
        """Write what is known of the map as a whole. Errors as `add`."""
        self._file.write(_state(chart))


def stored_map(parts: Parts) -> Map:
    """The map of a file; a ValueError if it makes no sense."""
    sections, loci = ([value for _, value in parts.all(part)] for part in (SECTION, LOCUS))
    chart, *counts = parts.one(STATE)
    if counts != [len(sections), len(loci)]:
        raise ValueError("a section or a locus is missing")
    return replace(chart, sections=tuple(sections), loci=tuple(loci))


def _state(chart: Map) -> Entry:
    return STATE.entry((replace(chart, sections=(), loci=()), len(chart.sections), len(chart.loci)))
