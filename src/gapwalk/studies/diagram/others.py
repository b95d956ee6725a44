"""The branches connected to no known one: a search over a range of one parameter, and all it leads to."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.isolated import Progress
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.method import Method
from gapwalk.studies.diagram.diagram import DiagramOptions, Grower, Growth, Report, empty_diagram

_VALUES = 60  # of the parameter, at which is searched by default


def find_others(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    known: Sequence[Branch] = (),
    options: DiagramOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Diagram | None = None,
) -> Diagram:
    """Search for motions connected to no known branch, and follow all that is found.

    What the search has covered, and what it may have missed, is in the `notes` of the diagram.

    Parameters
    ----------
    system
        The system; its value of the parameter does not matter.
    parameter, to
        Name of the parameter, and the range.
    known
        Branches along this parameter that have been followed already. They do not become part of the diagram.
    options
        How far it goes; `search_values` are where it searches, by default 60 values.
    walk, method, report, resume
        As in `diagram`.

    Raises
    ------
    ModelError
        For an unknown parameter, a value that is not allowed, or no value at which to search.
    Interrupted
        After Ctrl-C; its `found` is the diagram as far as it has come, from which `resume` goes on.
    """
    options = options or DiagramOptions(search_values=_VALUES)
    return grow_others(system, parameter, to, known, options, walk, method, report, resume).whole


def grow_others(
    system: System,
    parameter: str,
    to: tuple[float, float],
    known: Sequence[Branch],
    options: DiagramOptions,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    resume: Diagram | None = None,
    searching: Callable[[Progress], None] | None = None,
) -> Growth:
    """The diagram, and whether it is finished; as `find_others`, which can tell the progress of its search."""
    if not options.search_values:
        raise ModelError("search_values is 0; say at how many values to search, as in DiagramOptions(search_values=60)")
    for bound in to:
        system.at({parameter: bound})
    grower = Grower(resume or empty_diagram(parameter, to), options, walk, method, report, known, searching)
    return grower.grow(lambda hands: grower.search(system, hands))
