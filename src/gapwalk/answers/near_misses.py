"""Near misses: where a branch nearly has two more special points, which it may have in other systems.

Two special points of one kind are born where an extremum of a test function along the branch passes zero: of the
distance of a multiplier from +1, from -1 or from the unit circle, or of the depth of a contact beyond a breakpoint.
Linear fits to the extrema that walks met tell in which other samples an extremum may have passed it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.point_prediction import Regressions, Terms
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.kinds.defining_functions import bounded_product, pair_factors
from gapwalk.bifurcation.special_point import describe_switch
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.flow.flow import PERIOD

Array = NDArray[np.float64]

_SURE = 4.0  # standard errors of a prediction by which an extremum must be away from zero
_TURN = 0.3  # radians by which a turning point may move from point to point of a walk


@dataclass(frozen=True)
class Miss:
    """Extremum of a test function next to zero, along a branch."""

    what: str  #: Kind of the special points that would be born there, and the contact.
    place: int  #: Number of special points of the walk before it.
    size: float  #: Distance of the test function from zero.


@dataclass(frozen=True, eq=False)
class Watch:
    """Linear prediction of a near miss of one stretch of the branch."""

    stretch: int  #: Number of the stretch; see `Patterns`.
    coefficients: Array  #: shape (terms,): Coefficients of the distance from zero.
    whitening: Array  #: shape (terms, terms): Map of the terms whose squared length is the leverage.
    error: float  #: Standard error of a prediction at leverage 0; its square grows like 1 + leverage.

    def is_near(self, terms: Terms) -> NDArray[np.bool_]:
        """Return for each sample True if the extremum may have passed zero."""
        own = terms.of(1)
        errors = self.error * np.sqrt(1.0 + np.square(own @ self.whitening).sum(axis=1))
        return own @ self.coefficients < _SURE * errors


def misses_of(branch: Branch) -> tuple[Miss, ...]:
    """Return the near misses along a walked branch."""
    lengths = np.array([special.point.arclength for special in branch.special_points])
    return tuple(
        Miss(what, int(np.sum(lengths < branch.points[k].arclength)), size)
        for what, k, size in (*_of_multipliers(branch.points), *_of_depths(branch.points))
    )


def watches_of(found: Sequence[tuple[int, Sequence[tuple[int, Miss]]]], regressions: Regressions) -> tuple[Watch, ...]:
    """Return the predictions of near misses that walks met."""
    groups: dict[tuple[str, int], dict[int, float]] = {}
    for sample, misses in found:
        for stretch, miss in misses:
            sizes = groups.setdefault((miss.what, stretch), {})
            sizes[sample] = min(miss.size, sizes.get(sample, np.inf))
    watches = []
    for (_, stretch), sizes in groups.items():
        rows, values = np.array([*sizes], dtype=np.intp), np.array([*sizes.values()])
        of = regressions.best(rows, 1)
        if of is None:
            continue
        error = float(np.sqrt(np.mean(np.square(of.left_out(values)))))
        watch = Watch(stretch, of.fit(values), of.cloud.whitening, error)
        # where not even the mean of the samples is sure, nothing is known
        if float(values.mean()) > _SURE * error:
            watches.append(watch)
    return tuple(watches)


def _of_multipliers(points: Sequence[BranchPoint]) -> Iterator[tuple[str, int, float]]:
    """Yield kind, number of the point and size of each near miss of a multiplier."""
    functions: dict[str, Callable[[NDArray[np.complex128]], NDArray[np.complex128]]] = {
        "fold": lambda values: values - 1.0,
        "flip": lambda values: values + 1.0,
        "neimark-sacker": pair_factors,
    }
    for what, function in functions.items():
        sizes = [bounded_product(function(point.orbit.free_multipliers)) for point in points]
        for k in range(1, len(points) - 1):
            if _is_near(sizes[k - 1], sizes[k], sizes[k + 1]):
                yield what, k, abs(sizes[k])


def _of_depths(points: Sequence[BranchPoint]) -> Iterator[tuple[str, int, float]]:
    """Yield kind and contact, number of the point and size of each near miss of a grazing contact."""
    for k in range(1, len(points) - 1):
        before, here, after = (points[j].orbit for j in (k - 1, k, k + 1))
        full = PERIOD * here.period
        for switch, turns in enumerate(here.turning_depths):
            beside = before.turning_depths[switch], after.turning_depths[switch]
            if not all(each.thetas for each in beside):
                continue
            for theta, depth in zip(turns.thetas, turns.values, strict=True):
                places = [each.nearest(theta, full) for each in beside]
                apart = [
                    abs((each.thetas[place] - theta + 0.5 * full) % full - 0.5 * full)
                    for each, place in zip(beside, places, strict=True)
                ]
                if max(apart) <= _TURN and _is_near(beside[0].values[places[0]], depth, beside[1].values[places[1]]):
                    side = "beyond" if depth > 0.0 else "before"
                    yield f"grazing {describe_switch(here, switch)} {side}", k, abs(depth)


def _is_near(before: float, here: float, after: float) -> bool:
    """Return True if a function has an extremum next to zero that does not reach it."""
    return before * here > 0.0 and here * after > 0.0 and abs(here) < min(abs(before), abs(after))
