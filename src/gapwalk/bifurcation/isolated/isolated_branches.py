"""Branches through orbits found by a search, each followed once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import follow
from gapwalk.bifurcation.isolated.search_result import Found
from gapwalk.bifurcation.membership import Curve
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import Interrupted, NumericalError
from gapwalk.orbit.method import Method


@dataclass(frozen=True)
class Isolated:
    """Result of following the orbits of a search.

    Attributes
    ----------
    branches
        The new branches, in the order in which they were followed.
    lost
        Orbits from which no branch could be followed, each with the reason.
    complete
        False if the work was stopped before its end.
    """

    branches: tuple[Branch, ...]
    lost: tuple[tuple[Found, str], ...]
    complete: bool


def isolated(
    found: Iterable[Found],
    parameter: str,
    to: tuple[float, float],
    *,
    known: Sequence[Branch] = (),
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Callable[[Branch], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Isolated:
    """Follow each orbit of a search that lies on no known branch and on no branch followed before it.

    Orbits on which most transients have settled come first.

    Parameters
    ----------
    found
        The orbits, as from `SearchResult.new`.
    parameter
        Name of the parameter.
    to
        The values between which the branches are followed, in both directions.
    known
        Branches along this parameter that have been followed already.
    walk, method
        Options of the walk and of the method.
    report
        Called with each new branch.
    stop
        Called before each new branch; True stops the work.

    Raises
    ------
    ModelError
        For an unknown parameter, or a range that does not contain an orbit.
    """
    curves = [Curve(branch) for branch in known if branch.parameter == parameter]
    branches: list[Branch] = []
    lost: list[tuple[Found, str]] = []
    try:
        for each in sorted(found, key=lambda f: (not f.orbit.stable, -f.hits_settled, f.orbit.period)):
            if stop is not None and stop():
                return Isolated(tuple(branches), tuple(lost), False)
            if any(curve.holds(each.orbit) for curve in curves):
                continue
            try:
                branch = follow(each.orbit, parameter, to, walk=walk, method=method)
            except NumericalError as error:
                lost.append((each, str(error)))
                continue
            curves.append(Curve(branch))
            branches.append(branch)
            if report is not None:
                report(branch)
    except KeyboardInterrupt:
        raise Interrupted(Isolated(tuple(branches), tuple(lost), False)) from None
    return Isolated(tuple(branches), tuple(lost), True)
