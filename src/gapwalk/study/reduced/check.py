"""What the full system says of the branches of a study of a reduced one."""

from __future__ import annotations

import math
import os
from contextlib import nullcontext
from dataclasses import replace

from gapwalk.errors import NumericalError
from gapwalk.study.reduced.full_check import FullCheck, plain_checks
from gapwalk.study.result import Result
from gapwalk.study.store.database import close_whole, lock, open_to_write, transaction
from gapwalk.study.store.rows import write_about


def with_checks(result: Result, output: str | os.PathLike[str] | None) -> Result:
    """A complete result of branches with what the full system says of them; it is written to the result file too."""
    origin = result.study.reduced
    wanted = origin is not None and origin.reduction is not None and result.complete and result.map is None
    if not wanted or result.checks or not result.branches:
        return result
    checks = tuple(_check(result, name, index) for index, name in enumerate(result.names))
    with nullcontext() if output is None else lock(output):
        if output is not None:
            connection = open_to_write(output)
            try:
                with transaction(output, connection):
                    write_about(connection, "checks", plain_checks(checks))
            finally:
                close_whole(output, connection)
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
