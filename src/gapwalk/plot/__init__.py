"""Pictures of branches, diagrams, maps, motions, sweeps, basins, regimes and records, drawn with matplotlib.

Functions: `begin`, `draw`, `draw_machine`, `draws`, `figure`, `in_style`, `machine_svg`, `new_sheet`,
`overlay`, `save`, `sized`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
