"""The map: every locus that bounds a regime in the plane of two parameters."""

from gapwalk.studies.map.chart import Map, Ranges, Section
from gapwalk.studies.map.charting import Report, bifurcation_map
from gapwalk.studies.map.options import KINDS, MapOptions

__all__ = ["KINDS", "Map", "MapOptions", "Ranges", "Report", "Section", "bifurcation_map"]
