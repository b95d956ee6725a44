"""Drive trains: their parts, chains of equal parts, scales, and the numbers of Padmanabhan and Singh (1995).

Functions: `chain`, `nondimensional`, `paper_numbers`.

Classes: `Counted`, `Force`, `Friction`, `Gear`, `Inertia`, `Link`, `NonDimensional`, `PaperNumbers`, `Quantity`,
`Scales`, `Shaft`, `Train`, `Unit`, `Units`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
