"""Boxes of initial states: a range or a fixed value for each coordinate and velocity, by name.

The extension of a contact with a state of its own begins at zero.

States in a box are the centres of the cells of a plane, their neighbours, or random.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System

Range = Sequence[float] | float
"""The two ends of a range, or one number for a fixed component."""
_DRAWS = 1000  # of all states, to find enough of them within rigid stops
_NEAREST = 4  # as for a cell of a plane


@dataclass(frozen=True)
class Box:
    """Initial states at theta = 0, each component within a range; a component with equal ends is fixed.

    Examples
    --------
    >>> gw.records.Box.of(system, {"x": (-1, 1)}).draw(3, seed=0).shape
    (3, 2)
    """

    names: tuple[str, ...]  #: Names of the components: coordinates, velocities, then extensions, which are zero.
    #: low, high: The ends of the ranges, in the order of the names.
    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(cls, system: System, ranges: Mapping[str, Range]) -> Box:
        """Create a box from ranges (two numbers) or fixed values (one number) by name; all others are 0.

        Parameters
        ----------
        system
            The system.
        ranges
            Two numbers, or one, by the name of a coordinate or velocity.
        """
        names = system.state_names
        low, high = np.zeros(len(names)), np.zeros(len(names))
        for name, given in ranges.items():
            if name in names[2 * system.size :]:
                raise ModelError(f"{name} is no axis of a box: it begins at 0, as a spring of friction without a force")
            if name not in names:
                known = did_you_mean(name, names[: 2 * system.size])
                raise ModelError(f"there is no coordinate or velocity {name!r}; {known}")
            place = names.index(name)
            low[place], high[place] = _ends(name, given)
        return cls(names, tuple(low.tolist()), tuple(high.tolist()))

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the components that are not fixed."""
        return tuple(name for name, a, b in zip(self.names, self.low, self.high, strict=True) if a < b)

    def draw(
        self, count: int, seed: int, is_possible: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None
    ) -> NDArray[np.float64]:
        """Draw random states, uniformly distributed over the box and repeatable, shape (count, state_size).

        Only those that are possible are kept.

        Parameters
        ----------
        count
            Number of states.
        seed
            Seed of the random numbers.
        is_possible
            Returns which of some states are possible; None if all are.

        Returns
        -------
        array, shape (count, state_size)
            The states.
        """
        random, found = np.random.default_rng(seed), np.empty((0, len(self.names)))
        for _ in range(_DRAWS):
            drawn = random.uniform(self.low, self.high, (count, len(self.names)))
            found = np.concatenate((found, drawn if is_possible is None else drawn[is_possible(drawn)]))
            if len(found) >= count:
                return found[:count]
        raise ModelError(
            f"only {len(found)} of {_DRAWS * count} states in the box are within the rigid stops; give a smaller box"
        )


@dataclass(frozen=True)
class Window:
    """A window on a plane of initial states: a box with two free components.

    Examples
    --------
    >>> window = gw.records.Window.of(system, {"x": (-1, 1), "x'": (-2, 2)}, {})
    >>> window.states((4, 3)).shape
    (12, 2)
    """

    box: Box  #: The box.
    #: across, up: Names of the components along the two axes.
    across: str
    up: str

    @classmethod
    def of(cls, system: System, ranges: Mapping[str, Sequence[float]], fixed: Mapping[str, float]) -> Window:
        """Create the window on two components with their ranges, the horizontal one first; others are fixed or 0.

        Parameters
        ----------
        system
            The system.
        ranges
            The two ranges by name, the horizontal one first.
        fixed
            Fixed values by name.
        """
        if len(ranges) != 2:
            raise ModelError(
                f"a plane has two axes, but {len(ranges)} ranges were given ({', '.join(ranges) or 'none'}); write "
                '{"q1": (-4, 4), "q1\'": (-4, 4)}'
            )
        both = [name for name in ranges if name in fixed]
        if both:
            raise ModelError(f"{both[0]} is both an axis of the plane and fixed; remove it from the fixed ones")
        for name, given in ranges.items():
            if isinstance(given, int | float):
                raise ModelError(f"{name} is {given}; an axis of the plane needs a range such as (-4, 4)")
        for name, given in fixed.items():
            if not isinstance(given, int | float | np.floating | np.integer):
                raise ModelError(f"{name} is fixed at {given!r}; it must be one number")
        across, up = ranges
        return cls(Box.of(system, {**fixed, **ranges}), across, up)

    @property
    def within(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The ranges of the two axes."""
        first, second = (self.box.names.index(name) for name in (self.across, self.up))
        return (self.box.low[first], self.box.high[first]), (self.box.low[second], self.box.high[second])

    def centres(self, resolution: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the centres of `resolution` cells (columns, rows) along the two axes."""
        across, up = (centres(ends, count) for ends, count in zip(self.within, resolution, strict=True))
        return across, up

    def states(self, resolution: tuple[int, int]) -> NDArray[np.float64]:
        """Return the states at the centres of all cells, row by row from the bottom; shape (cells, state_size).

        Returns
        -------
        array, shape (cells, state_size)
            The states.
        """
        across, up = self.centres(resolution)
        states = np.tile(self.box.low, (len(across) * len(up), 1))
        states[:, self.box.names.index(self.across)] = np.tile(across, len(up))
        states[:, self.box.names.index(self.up)] = np.repeat(up, len(across))
        return states


def beside_cells(rows: int, columns: int) -> NDArray[np.intp]:
    """Return the indices of the left, right, lower and upper neighbours of the cells, row by row; shape (cells, 4).

    At an edge of the plane the missing neighbour is the cell itself.
    """
    numbers = np.arange(rows * columns).reshape(rows, columns)
    wide = np.pad(numbers, 1, mode="edge")
    sides = (wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1])
    return np.stack([side.ravel() for side in sides], axis=1)


def beside_states(states: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the four nearest other states of each state, scaled by the ranges of the components; shape (count, 4)."""
    from scipy.spatial import cKDTree  # imported late: it takes long

    widths = np.ptp(states, axis=0)
    scaled = states / np.where(widths > 0.0, widths, 1.0)
    count = min(_NEAREST, len(states) - 1)
    _, nearest = cKDTree(scaled).query(scaled, k=np.arange(1, count + 2))
    return np.asarray(nearest[:, 1:], dtype=np.intp)


def differs(labels: NDArray[np.int_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark the labels that differ from the label of a neighbour."""
    return (labels[neighbours] != labels[:, None]).any(axis=1)


def about(marked: NDArray[np.bool_], neighbours: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark the states that are marked already or have a marked neighbour."""
    return marked | marked[neighbours].any(axis=1)


def _ends(name: str, given: Range) -> tuple[float, float]:
    try:
        ends = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        ends = np.array([np.nan])
    if ends.shape not in {(1,), (2,)} or not np.isfinite(ends).all():
        raise ModelError(f"the range of {name} is {given!r}; write two finite numbers (low, high), or one to fix it")
    if len(ends) == 2 and not ends[0] < ends[1]:
        raise ModelError(f"the range of {name} is from {ends[0]:g} to {ends[1]:g}: it is empty; write (low, high)")
    return float(ends[0]), float(ends[-1])


def centres(within: tuple[float, float], count: int) -> NDArray[np.float64]:
    """Return the centres of `count` cells that divide a range evenly."""
    low, high = within
    return low + (high - low) * (np.arange(count) + 0.5) / count
