"""Verification of results by methods independent of those that found them."""

from gapwalk.verification.verification import Check, Figure, Ledger, Spot, Summary, Verification
from gapwalk.verification.verify_branch import confirm, verify_branches
from gapwalk.verification.verify_orbits import verify_distinct, verify_loci, verify_orbit, verify_tree, verify_whole

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
    "verify_orbit",
    "verify_tree",
    "verify_whole",
]
