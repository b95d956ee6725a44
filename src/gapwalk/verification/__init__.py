"""Verification of results by methods independent of those that found them."""

from gapwalk.verification.branch import verify_branches
from gapwalk.verification.confirm import confirm
from gapwalk.verification.locus import verify_loci
from gapwalk.verification.tree import verify_tree
from gapwalk.verification.verification import Check, Figure, Ledger, Spot, Summary, Verification
from gapwalk.verification.whole import verify_distinct, verify_whole

__all__ = [
    "Check",
    "Figure",
    "Ledger",
    "Spot",
    "Summary",
    "Verification",
    "confirm",
    "verify_branches",
    "verify_distinct",
    "verify_loci",
    "verify_tree",
    "verify_whole",
]
