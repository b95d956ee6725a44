"""Verification of results by methods independent of those that found them."""

from gapwalk.verification.verification import Check, Figure, Ledger, Spot, Summary, Verification

__all__ = ["Check", "Figure", "Ledger", "Spot", "Summary", "Verification"]
