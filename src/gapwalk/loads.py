"""Loads, and what a load of your own needs.

Functions: `register`, `orders_of`, `displacement_orders`, `speed_table`.

Classes: `Harmonic`, `Measured`, `Rectangle`, `Steady`, `OrderTable`, `OrderLine`, `SpeedTable`, `FactorOverSpeed`,
`Levels`, `Line`, `Load`, `Parameter`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
