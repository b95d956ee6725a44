"""The named branches of what was found, which the page shows; or the one motion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from gapwalk.attractors.settled import Settled
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import ModelError
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.family.record import Family
from gapwalk.studies.result import Result

Found = Result | Branch | Diagram | Family | Settled | Orbit
"""What can be kept."""


class Lines(NamedTuple):
    """Branches with their names, and the parameters that differ among them; or one motion, and no branches."""

    named: tuple[tuple[str, Branch], ...]
    parameters: tuple[str, ...] = ()
    motion: Orbit | Settled | None = None


def lines_of(found: Found) -> Lines:
    """What there is to show.

    Raises
    ------
    ModelError
        If it has no branches and no motion, or none yet.
    """
    match found:
        case Branch():
            return _along([(f"P{found.period}-1", found)])
        case Diagram():
            return _along((member.name, member.branch) for member in found.members)
        case Family():
            members = ((member.value, *each) for member in found.members for each in member.named)
            lines = _along((f"{name} at {found.over.name} = {value:.6g}", branch) for value, name, branch in members)
            moved = [name for name, _ in found.over.moved if name in found.system.parameters]
            return lines._replace(parameters=(*lines.parameters, *moved))
        case Settled() | Orbit():
            return Lines((), (), found)
        case Result(finding=None, map=None):
            return _along(zip(found.names, found.branches, strict=True))
        case Result(finding=finding) if finding is not None and isinstance(finding.record, Family | Settled):
            return lines_of(finding.record)
    kind = found.options.kind if isinstance(found, Result) else type(found).__name__
    raise ModelError(
        f"an HTML file shows branches and their motions, and a {kind} has none; write --format svg, pdf or png "
        "(in Python: gapwalk.plot.save)"
    )


def _along(named: Iterable[tuple[str, Branch]]) -> Lines:
    lines = tuple(named)
    if not lines:
        raise ModelError("there are no branches yet, so there is nothing to show")
    return Lines(lines, tuple(dict.fromkeys(branch.parameter for _, branch in lines)))
