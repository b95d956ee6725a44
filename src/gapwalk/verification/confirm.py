"""Verification of a branch directly after its walk."""

from __future__ import annotations

from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import VerificationError
from gapwalk.verification.verification import Ledger
from gapwalk.verification.verify_branch import verify_branches


def confirm(branch: Branch) -> None:
    """Verify a branch.

    Raises
    ------
    VerificationError
        If a check fails.
    """
    ledger = Ledger()
    verify_branches(ledger, [(f"P{branch.period}-1", branch)])
    found = ledger.verification
    if not found.ok:
        raise VerificationError(f"the branch was followed, but {found.words}", found)
