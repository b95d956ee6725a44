"""Force laws of contacts, and what a law of your own needs.

Exceptions: `FormulaError`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
