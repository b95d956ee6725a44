"""What the paper says, statement by statement, each as a check with evidence."""

from reproductions.padmanabhan_singh_1995.claims import damping, dual, single  # noqa: F401 (they define the claims)
from reproductions.padmanabhan_singh_1995.claims.claim import ALL, Claim, Outcome, Verdict

__all__ = ["CLAIMS", "Claim", "Outcome", "Verdict", "claims_about"]

CLAIMS: tuple[Claim, ...] = tuple(
    sorted(ALL, key=lambda claim: int(claim.figure) if claim.figure.isdigit() else 99)  # the order of the paper
)


def claims_about(figure: int) -> tuple[Claim, ...]:
    """Return the claims about one figure, by its number."""
    return tuple(claim for claim in CLAIMS if claim.figure == str(figure))
