"""Pictures of branches, diagrams, maps, motions, sweeps, basins, regimes and records, drawn with matplotlib."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
