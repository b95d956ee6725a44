"""All claims, in the order of the paper."""

from __future__ import annotations

from reproductions.padmanabhan_singh_1995.claims import amplitude, dual, light, models, rattle, single
from reproductions.padmanabhan_singh_1995.claims.claim import Claim

CLAIMS: tuple[Claim, ...] = (
    *models.CLAIMS,
    *rattle.CLAIMS,
    *single.CLAIMS,
    *light.CLAIMS,
    *dual.CLAIMS,
    *amplitude.CLAIMS,
)


def claims_about(figure: int) -> tuple[Claim, ...]:
    """The claims about one figure, by its number."""
    return tuple(claim for claim in CLAIMS if claim.figure == str(figure))
