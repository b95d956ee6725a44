"""A branch verified as soon as it has been walked."""

from __future__ import annotations

from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import VerificationError
from gapwalk.verification.branch import verify_branches
from gapwalk.verification.verification import Ledger


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
        raise VerificationError(f"the branch was walked, but {found.words}", found)
