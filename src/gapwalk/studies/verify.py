"""Verification of branches, diagrams, maps, families and results; comparison of reduced with full systems."""

from __future__ import annotations

import math
import os
from contextlib import suppress
from dataclasses import replace
from itertools import chain

from gapwalk.answers.threshold import Threshold
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.errors import ModelError, NumericalError, StoreError
from gapwalk.free.equilibrium_walk import Rests, verify_rests
from gapwalk.free.self_excitation import SelfExcited
from gapwalk.orbit.orbit import Orbit
from gapwalk.results.result_file import lock, reading, seal_fault, write_more
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.branch_family import Family
from gapwalk.studies.options import BranchOptions
from gapwalk.studies.result import CHECKS, REQUEST, VERIFICATION, FullCheck, Result, load_result
from gapwalk.studies.study_kind import StudyKind
from gapwalk.tori.tongue import Tongue
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_family import TorusDiagram, TorusFamily, verify_families, verify_torus
from gapwalk.verification import Check, Ledger, Spot, Verification
from gapwalk.verification.verification import Advance
from gapwalk.verification.verify_branch import verify_branches
from gapwalk.verification.verify_orbits import verify_distinct, verify_loci, verify_orbit, verify_tree, verify_whole

Tori = TorusDiagram | TorusFamily | Torus | Tongue
Verifiable = Orbit | Branch | Diagram | Map | Family | Threshold | Tori | Rests | SelfExcited | Result


def verify(what: Verifiable | str | os.PathLike[str], *, report: Advance | None = None) -> Verification:
    """Verify a result by methods that are independent of its computation.

    Each orbit is integrated over its period by another integrator; its contacts, extremes and multipliers are checked.
    Between neighbouring points there must be orbits of the same branch; changes of stability, direction and contacts
    must be explained by special points between; each special point is located again, from both sides. Orbits by
    harmonic balance are checked by quadrature and against exact ones, and loci by shooting. See `Check`.

    Parameters
    ----------
    what
        An orbit, a branch, a diagram, a map, a family, tori, a threshold, equilibria with self-excited motions, a
        result, or the name of a result file. An incomplete result is verified as far as it goes.
    report
        Called with a word for what is verified, the number of pieces that are done, and the number of all.

    Returns
    -------
    Verification
        Each check, with its worst figure.

    Raises
    ------
    ModelError
        If there is nothing that can be verified, as in the result of a sweep.
    StoreError
        If a file is not a result, or so damaged that it cannot be read. A file that can be read, but was changed by
        another program, is verified, and fails because of its checksum.

    Notes
    -----
    The other integrator is that of Prince and Dormand (1981), Journal of Computational and Applied Mathematics 7,
    67-75.

    Examples
    --------
    >>> found = gw.verify(gw.follow(orbit, "frequency", 0.65))
    >>> found.ok
    True
    """
    if isinstance(what, str | os.PathLike):
        return verified_result(what, report)[1]
    if not isinstance(what, Verifiable):
        raise ModelError(
            f"{what!r:.60} cannot be verified; give an orbit, a branch, a diagram, a map, a family, tori, a threshold, "
            'a result, or the name of a result file, as in gw.verify("clutch.gapwalk")'
        )
    ledger = Ledger()
    _verify(ledger, what, report)
    return ledger.verification


def verified_result(path: str | os.PathLike[str], report: Advance | None = None) -> tuple[Result, Verification]:
    """Return the result in a file, and its verification; parameters and errors as in `verify`."""
    with reading(path, sealed=False) as parts, suppress(StoreError):
        options = parts.one(REQUEST).options
        if options.answer is not None and not issubclass(options.answer.type, Verifiable):
            raise _nothing(options)  # before what may be hundreds of motions is read
    ledger = Ledger()
    fault = seal_fault(path)
    ledger.enter(Check.SEAL, Spot("the file", "its parts", math.nan), 1.0 if fault else 0.0, fault)
    result = load_result(path, sealed=False)
    _verify(ledger, result, report)
    return result, ledger.verification


def _verify(ledger: Ledger, what: Verifiable, report: Advance | None) -> None:
    match what:
        case Orbit():
            verify_orbit(ledger, what)
        case Branch():
            verify_branches(ledger, [(f"P{what.period}-1", what)], report)
        case Diagram():
            _verify_diagram(ledger, what, report)
        case Map():
            _verify_map(ledger, what, report)
        case Family():
            for member in what.members:
                named = [(f"{what.over.name} = {member.value:g}, {name}", branch) for name, branch in member.named]
                verify_branches(ledger, named, report, what.within)
                verify_distinct(ledger, named)
            ledger.note("the branches of a family are verified, but not the connections between its members")
        case Threshold():
            if not what.loci:
                words = f"; the study rattle checks it, with --set {what.parameter}={what.value:.6g}" * bool(
                    what.between
                )
                raise ModelError(f"there is no locus to verify{words}: {what.sentence}")
            verify_loci(ledger, [(f"L{k}", locus) for k, locus in enumerate(what.loci, start=1)], report)
            ledger.note("the loci of the threshold are verified, not the motions that were tried beyond it")
        case Rests():
            verify_rests(ledger, "the equilibria", what)
        case SelfExcited():
            _verify_self_excited(ledger, what, report)
        case TorusDiagram() | TorusFamily() | Torus() | Tongue():
            _verify_tori(ledger, what, report)
        case Result():
            found = _found(what)
            if isinstance(found, Branch):
                _verify_response(ledger, what, found, report)
            else:
                _verify(ledger, found, report)


def _verify_response(ledger: Ledger, what: Result, first: Branch, report: Advance | None) -> None:
    """Verify the stretches of a response, and that it begins where the study does."""
    if not first.points:
        raise ModelError("this response has settled motions alone, and no orbit to verify")
    walked, value = what.study.walked, first.points[0].value
    named = [(f"P{each.period}-{number}", each) for number, each in enumerate(what.branches, start=1)]
    low, high = sorted((walked.begin, walked.end))
    verify_branches(ledger, named, report, (low, high))
    is_late = walked.begin not in {value, *(band.value for band in first.bands)}
    detail = f"the study begins at {walked.begin:.10g}" if is_late else ""
    ledger.enter(Check.ENDS, Spot(named[0][0], "point 0", value), math.inf if detail else 0.0, detail)
    if first.bands:
        ledger.note("settled motions, at values without an orbit, are not verified")


def _verify_tori(ledger: Ledger, what: Tori, report: Advance | None) -> None:
    match what:
        case Torus():
            verify_torus(ledger, what, Spot("the torus", "its curve", what.system.frequency))
        case TorusFamily():
            verify_families(ledger, [("the family", what)], report)
        case Tongue():
            _verify_tongue(ledger, "", what, report)
        case TorusDiagram():
            _verify_diagram(ledger, what.diagram, report)
            verify_families(ledger, [(f"T{k}", each) for k, each in enumerate(what.families, start=1)], report)
            ledger.note("of families of tori, the tori are verified, but not the ends and events")
            for tongue in what.tongues:
                _verify_tongue(ledger, f"tongue {tongue.ratio}, ", tongue, report)


def _verify_tongue(ledger: Ledger, name: str, tongue: Tongue, report: Advance | None) -> None:
    sides = zip((f"{name}lower side", f"{name}upper side"), tongue.sides, strict=True)
    verify_loci(ledger, list(sides), report)


def _verify_map(ledger: Ledger, chart: Map, report: Advance | None) -> None:
    sections = enumerate(chart.sections, start=1)
    groups = [[(f"S{number}-{name}", branch) for name, branch in each.named] for number, each in sections]
    verify_branches(ledger, list(chain.from_iterable(groups)), report, chart.within[0])
    for group in groups:
        verify_distinct(ledger, group)
    verify_loci(ledger, list(zip(chart.names, chart.loci, strict=True)), report)


def _verify_self_excited(ledger: Ledger, found: SelfExcited, report: Advance | None) -> None:
    named = [(f"motions {number}", cycle) for number, cycle in enumerate(found.cycles, start=1)]
    verify_branches(ledger, named, report, found.within)
    for number, line in enumerate(found.rests, start=1):
        verify_rests(ledger, f"equilibria {number}", line)


def _verify_diagram(ledger: Ledger, diagram: Diagram, report: Advance | None) -> None:
    named = [(member.name, member.branch) for member in diagram.members]
    verify_branches(ledger, named, report, diagram.within)
    verify_distinct(ledger, named)
    verify_tree(ledger, diagram)
    if diagram.complete:
        verify_whole(ledger, diagram)


def _found(result: Result) -> Verifiable:
    """Return the record of a result that can be verified."""
    if result.finding is not None:
        if not isinstance(result.finding.record, Verifiable):
            raise _nothing(result.options)
        return result.finding.record
    return result.map or result.diagram or result.branches[0]


def _nothing(options: StudyKind) -> ModelError:
    return ModelError(
        f"this result of the kind {options.kind} has neither branches nor loci to verify; those of responses, "
        "diagrams, maps, families, tori, thresholds and self-excited motions have"
    )


def with_verification(result: Result, options: StudyKind, output: str | os.PathLike[str] | None) -> Result:
    """Return a complete result with its verification, if the options of its study request one."""
    # It is written to the result file too. A result that was resumed has the options of the run before.
    wanted = isinstance(options, BranchOptions) and options.verify and result.complete
    if not wanted or result.verification is not None:
        return result
    try:
        found = verify(result)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the result is complete, but it is not verified yet") from None
    if output is not None:
        with lock(output):
            write_more(output, result.system, VERIFICATION.entry(found))
    return replace(result, verification=found)


def with_checks(result: Result, output: str | os.PathLike[str] | None) -> Result:
    """Return a complete result of branches, compared with the full system; it is written to the result file too."""
    origin = result.study.reduced
    wanted = origin is not None and origin.reduction is not None and result.complete and result.map is None
    if not wanted or result.checks or not result.branches:
        return result
    checks = tuple(_check(result, name, index) for index, name in enumerate(result.names))
    if output is not None:
        with lock(output):
            write_more(output, result.system, CHECKS.entry(checks))
    return replace(result, checks=checks)


def _check(result: Result, name: str, index: int) -> FullCheck:
    from gapwalk.reduction.reduction_error import BranchCheck  # only now: few studies need it

    origin = result.study.reduced
    assert origin is not None
    assert origin.reduction is not None
    try:
        found = origin.reduction.check(result.branches[index])
    except NumericalError as error:
        return FullCheck(name, (), math.inf, 0, str(error))
    assert isinstance(found, BranchCheck)
    return FullCheck(name, tuple(each.error for each in found.special), found.motion, found.harmonics)
