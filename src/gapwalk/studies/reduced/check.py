"""What the full system says of the branches of a study of a reduced one."""

from __future__ import annotations

import math
import os
from dataclasses import replace

from gapwalk.errors import NumericalError
from gapwalk.results.result_file import lock, write_more
from gapwalk.studies.load import CHECKS
from gapwalk.studies.reduced.full_check import FullCheck
from gapwalk.studies.result import Result


def with_checks(result: Result, output: str | os.PathLike[str] | None) -> Result:
    """A complete result of branches with what the full system says of them; it is written to the result file too."""
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
    from gapwalk.reduction.branch_check import BranchCheck  # only now: few studies need it

    origin = result.study.reduced
    assert origin is not None
    assert origin.reduction is not None
    try:
        found = origin.reduction.check(result.branches[index])
    except NumericalError as error:
        return FullCheck(name, (), math.inf, 0, str(error))
    assert isinstance(found, BranchCheck)
    return FullCheck(name, tuple(each.error for each in found.special), found.motion, found.harmonics)
