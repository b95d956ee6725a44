"""Verify what was found: branches, diagrams, maps, families, and the results of their studies."""

from __future__ import annotations

import os
from contextlib import nullcontext
from dataclasses import replace

from gapwalk.bifurcation.diagram import Diagram
from gapwalk.continuation.branch import Branch
from gapwalk.errors import ModelError
from gapwalk.study.family.record import Family
from gapwalk.study.map.chart import Map
from gapwalk.study.options import BranchOptions
from gapwalk.study.result import Result
from gapwalk.study.store.database import close_whole, lock, open_to_write, transaction
from gapwalk.study.store.rows import write_about
from gapwalk.study.store.stored import load
from gapwalk.verification import Ledger, Verification, verify_branches, verify_loci, verify_tree
from gapwalk.verification.verification import Advance

Verifiable = Branch | Diagram | Map | Family | Result


def verify(what: Verifiable | str | os.PathLike[str], *, report: Advance | None = None) -> Verification:
    """Check what was found by means that are independent of how it was found.

    Each orbit is carried around by another integrator; its stages, extremes and multipliers are checked. Between
    neighbouring points there must be orbits of the same branch; changes of stability, direction and contacts must be
    explained by special points between; each special point is looked at from both sides and located again. Balanced
    orbits are checked by quadrature and beside exact ones; of loci some points are shot again. See `Check`.

    Parameters
    ----------
    what
        A branch, a diagram, a map, a family, a result, or the name of a result file. What is not complete is verified
        as far as it goes.
    report
        Called with a word for what is verified, how many of its pieces are done, and how many there are.

    Raises
    ------
    ModelError
        If there is nothing that can be verified, as in the result of a sweep.
    StoreError
        If a file is no result, or damaged.
    """
    if isinstance(what, str | os.PathLike):
        what = load(what)
    ledger = Ledger()
    _verify(ledger, what, report)
    return ledger.verification


def _verify(ledger: Ledger, what: Verifiable, report: Advance | None) -> None:
    match what:
        case Branch():
            verify_branches(ledger, [(f"P{what.period}-1", what)], report)
        case Diagram():
            verify_branches(ledger, [(limb.name, limb.branch) for limb in what.limbs], report)
            verify_tree(ledger, what)
        case Map():
            sections = enumerate(what.sections, start=1)
            named = [(f"S{number}-{name}", branch) for number, each in sections for name, branch in each.named]
            verify_branches(ledger, named, report)
            verify_loci(ledger, list(zip(what.names, what.loci, strict=True)), report)
        case Family():
            for member in what.members:
                named = [(f"{what.over.name} = {member.value:g}, {name}", branch) for name, branch in member.named]
                verify_branches(ledger, named, report)
            ledger.note("the joints between the members of a family are not verified, their branches are")
        case Result():
            _verify(ledger, _found(what), report)


def _found(result: Result) -> Verifiable:
    """What of a result can be verified."""
    if result.finding is not None:
        if isinstance(result.finding.record, Family):
            return result.finding.record
        raise ModelError(
            f"a study of the kind {result.options.kind} has no branches to verify; responses, diagrams, maps and "
            "families have"
        )
    return result.map or result.diagram or result.branches[0]


def with_verification(result: Result, output: str | os.PathLike[str] | None) -> Result:
    """A complete result with its verification, if its study wants one; it is written to the result file too."""
    wanted = isinstance(result.options, BranchOptions) and result.options.verify and result.complete
    if not wanted or result.verification is not None:
        return result
    found = verify(result)
    with nullcontext() if output is None else lock(output):
        if output is not None:
            connection = open_to_write(output)
            try:
                with transaction(output, connection):
                    write_about(connection, "verification", found.document())
            finally:
                close_whole(output, connection)
    return replace(result, verification=found)
