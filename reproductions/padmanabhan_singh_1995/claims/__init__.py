"""What the paper says, statement by statement, as checks with evidence."""

from reproductions.padmanabhan_singh_1995.claims.claim import Claim, Outcome, Verdict
from reproductions.padmanabhan_singh_1995.claims.table import CLAIMS, claims_about

__all__ = ["CLAIMS", "Claim", "Outcome", "Verdict", "claims_about"]
