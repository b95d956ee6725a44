"""What the paper says, statement by statement, as checks with evidence."""

from gapwalk.paper.claims.claim import Claim, Outcome, Verdict
from gapwalk.paper.claims.table import CLAIMS, claims_about

__all__ = ["CLAIMS", "Claim", "Outcome", "Verdict", "claims_about"]
