"""Balanced orbits verified: their lines by quadrature, and an exact motion beside them."""

from __future__ import annotations

from gapwalk.verification.track import Track
from gapwalk.verification.verification import Ledger


def verify_balanced(ledger: Ledger, name: str, track: Track) -> None:
    """Todo."""
