"""Verification of results by methods independent of those that found them."""

from gapwalk.verification.confirm import confirm
from gapwalk.verification.verification import Check, Figure, Ledger, Spot, Summary, Verification
from gapwalk.verification.verify_branch import verify_branches
from gapwalk.verification.verify_complete import verify_distinct, verify_whole
from gapwalk.verification.verify_locus import verify_loci
from gapwalk.verification.verify_tree import verify_tree

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
