"""Variations of a system's parameters: one at a time, in pairs, listed by hand, and random neighbours.

The first three are *tried*: each is a reading of a description that may be the right one. Neighbours are for
comparison: how many of them do as well tells how much a hit among those that are tried is worth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.system import System


class VariedHow(IntEnum):
    """How a variation was made.

    Examples
    --------
    >>> gw.records.VariedHow(2).name
    'PAIR'
    """

    NONE = 0
    """The system itself."""
    ONE = 1
    """One parameter has another value."""
    PAIR = 2
    """Two of these changes together."""
    LISTED = 3
    """Given by the request."""
    NEIGHBOUR = 4
    """All parameters are multiplied by random factors."""


@dataclass(frozen=True, eq=False)
class Variations:
    """Many systems that differ in some parameters.

    Examples
    --------
    >>> found = gw.ask.variations(system, ["stop.clearance"], factors=[0.9, 1.1])
    >>> found.values[:, 0].tolist()
    [1.0, 0.9, 1.1]
    """

    names: tuple[str, ...]  #: The parameters that vary.
    values: NDArray[np.float64]  #: shape (count, names): Their values.
    how: NDArray[np.int_]  #: shape (count,): Values of `VariedHow`.
    left_out: tuple[str, ...] = ()  #: Sentences on variations that are no systems.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.values.shape != (len(self.how), len(self.names)):
            raise ValueError(f"values of shape {self.values.shape} are not those of {len(self.how)} variations")

    def __len__(self) -> int:
        return len(self.how)

    @property
    def tried(self) -> NDArray[np.bool_]:
        """True for those that may be the right ones: all but the system itself and its random neighbours."""
        return (self.how != VariedHow.NONE) & (self.how != VariedHow.NEIGHBOUR)

    @property
    def neighbours(self) -> NDArray[np.bool_]:
        """True for random neighbours."""
        return self.how == VariedHow.NEIGHBOUR

    def of(self, index: int) -> dict[str, float]:
        """Return all values of one variation by name."""
        return dict(zip(self.names, self.values[index].tolist(), strict=True))

    def changes(self, index: int) -> dict[str, float]:
        """Return the values of one variation that differ from those of the system."""
        return {name: value for name, value in self.of(index).items() if value != self.of(0)[name]}

    def words(self, index: int) -> str:
        """Describe one variation."""
        if self.how[index] == VariedHow.NEIGHBOUR:
            return "random neighbour"
        changes = self.changes(index)
        return ", ".join(f"{name} = {value + 0.0:.6g}" for name, value in changes.items()) or "as in the model"


def variations(
    system: System,
    parameters: Sequence[str] = (),
    *,
    factors: Sequence[float] = (),
    pairs: int = 0,
    listed: Sequence[Mapping[str, float]] = (),
    neighbours: int = 0,
    spread: float = 0.1,
    seed: int = 0,
    fixed: frozenset[str] = frozenset(),
) -> Variations:
    """Make variations of a system: itself first, then those that are tried, then random neighbours.

    Parameters
    ----------
    system
        The system.
    parameters
        The parameters that vary; by default all that are not 0 and not fixed.
    factors
        Factors by which each of them is multiplied, one at a time; 0 leaves it out.
    pairs
        Number of random pairs of these changes.
    listed
        Further variations: values of parameters by name.
    neighbours
        Number of random neighbours.
    spread
        Standard deviation of the logarithm of the factors by which their parameters are multiplied.
    seed
        Seed of the random numbers.
    fixed
        Parameters that may not vary.

    Returns
    -------
    Variations
        Those that are systems; the others are named.

    Raises
    ------
    ModelError
        For an unknown parameter, one that may not vary, or one that is 0 and has factors.

    Examples
    --------
    >>> found = gw.ask.variations(system, ["stop.clearance", "harmonic1.amplitude"], factors=[0.5], neighbours=3)
    >>> [found.words(index) for index in range(2)], int(found.neighbours.sum())
    (['as in the model', 'stop.clearance = 0.5'], 3)
    """
    kept = {system.structure.place(name) for name in fixed}
    every = system.parameters
    if not parameters:
        pace = system.structure.place(system.structure.pace)
        parameters = [
            name
            for name, value in every.items()
            if value != 0.0 and system.structure.place(name) not in kept and system.structure.place(name) != pace
        ]
    names = tuple(dict.fromkeys([*parameters, *(name for each in listed for name in each)]))
    for name in names:
        if system.structure.place(name) in kept:
            raise ModelError(f"{name} has a value in a claim, so it cannot vary; leave it out of the parameters")
    for name in parameters:
        if factors and system[name] == 0.0:
            raise ModelError(f"{name} is 0, and no factor changes that; write it in listed with its values")
    own = np.array([float(system[name]) for name in names])
    where = {name: place for place, name in enumerate(names)}

    def changed(*changes: tuple[str, float]) -> NDArray[np.float64]:
        row = own.copy()
        for name, value in changes:
            row[where[name]] = value
        return row

    random = np.random.default_rng(seed)
    single = [(name, float(factor) * float(system[name])) for name in parameters for factor in factors if factor != 1.0]
    both = [(one, two) for one, two in combinations(single, 2) if one[0] != two[0]]
    chosen = np.sort(random.permutation(len(both))[:pairs]).tolist()
    rows = [(own, VariedHow.NONE)]
    rows += [(changed(one), VariedHow.ONE) for one in single]
    rows += [(changed(*both[index]), VariedHow.PAIR) for index in chosen]
    rows += [(changed(*each.items()), VariedHow.LISTED) for each in listed]
    free = np.isin(names, parameters)
    for _ in range(neighbours):
        factor = np.where(free, np.exp(random.normal(0.0, spread, len(names))), 1.0)
        rows.append((own * factor, VariedHow.NEIGHBOUR))
    return _systems_among(system, names, rows)


def _systems_among(
    system: System, names: tuple[str, ...], rows: Sequence[tuple[NDArray[np.float64], VariedHow]]
) -> Variations:
    """Leave out the variations that no system can have."""
    values, how, left_out = [], [], []
    for row, kind in rows:
        changes = dict(zip(names, row.tolist(), strict=True))
        try:
            system.at(changes)
        except ModelError as error:
            differ = ", ".join(f"{name} = {value:g}" for name, value in changes.items() if value != system[name])
            left_out.append(f"left out: {differ} ({str(error).splitlines()[0]})")
            continue
        values.append(row)
        how.append(int(kind))
    return Variations(names, np.array(values).reshape(len(how), len(names)), np.array(how), tuple(left_out))
