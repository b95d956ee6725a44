"""What the paper says, statement by statement, each as a check with evidence."""

from reproductions.padmanabhan_singh_1995.claims import (  # noqa: F401 (they define the claims)
    damping,
    dual,
    explanations,
    method,
    single,
)
from reproductions.padmanabhan_singh_1995.claims.claim import (
    ALL,
    Against,
    Claim,
    Counts,
    Finding,
    Outcome,
    Tried,
    Verdict,
    counts,
)
from reproductions.padmanabhan_singh_1995.claims.trades import Trade, decide, jobs_of

__all__ = [
    "CLAIMS",
    "Against",
    "Claim",
    "Counts",
    "Finding",
    "Outcome",
    "Trade",
    "Tried",
    "Verdict",
    "claims_about",
    "counts",
    "decide",
    "jobs_of",
]

CLAIMS: tuple[Claim, ...] = tuple(
    sorted(ALL, key=lambda claim: int(claim.figure) if claim.figure.isdigit() else 99)  # the order of the paper
)


def claims_about(figure: int) -> tuple[Claim, ...]:
    """Return the claims about one figure, by its number."""
    return tuple(claim for claim in CLAIMS if claim.figure == str(figure))
