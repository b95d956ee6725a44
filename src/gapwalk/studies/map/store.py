"""The file of a map: each section and each locus is written when it is accepted, whole."""

from __future__ import annotations

from dataclasses import replace

from gapwalk.bifurcation.loci import Locus
from gapwalk.results.result_file import Part, Parts
from gapwalk.studies.map.chart import Map, Section
from gapwalk.studies.request import Keeper

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

    def write(self, chart: Map) -> None:
        """Write the sections and loci that the file has not, and what is known of the map as a whole.

        After Ctrl-C the file may lack one that was accepted just before.

        Raises
        ------
        StoreError
            If the file cannot be written.
        """
        sections, loci = (
            [part.entry(value, number) for number, value in enumerate(values) if number >= self._file.count(part)]
            for part, values in ((SECTION, chart.sections), (LOCUS, chart.loci))
        )
        state = (replace(chart, sections=(), loci=()), len(chart.sections), len(chart.loci))
        self._file.write(*sections, *loci, STATE.entry(state))


def stored_map(parts: Parts) -> Map:
    """The map of a file; a ValueError if it makes no sense."""
    sections, loci = ([value for _, value in parts.all(part)] for part in (SECTION, LOCUS))
    chart, *counts = parts.one(STATE)
    if counts != [len(sections), len(loci)]:
        raise ValueError("a section or a locus is missing")
    return replace(chart, sections=tuple(sections), loci=tuple(loci))
