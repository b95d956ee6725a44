"""How far the members of a family go, and how their special points are joined."""

from __future__ import annotations

from dataclasses import dataclass, field

from gapwalk.bifurcation.branch import Kind
from gapwalk.errors import ModelError


@dataclass(frozen=True, slots=True)
class FamilyOptions:
    """How far the members of a family go, and how their special points are joined.

    Parameters
    ----------
    max_period
        Follow what branches off too, up to this period in forcing periods, as in a diagram; None: the first branch
        alone.
    kinds
        Kinds of special points that are joined.
    exact
        Whether special points are joined by the exact loci that lead from member to member; otherwise each to the
        nearest of its kind, which is a guess.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    max_period: int | None = None
    kinds: tuple[Kind, ...] = Kind.known()
    exact: bool = True
    workers: int | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name in ("max_period", "workers"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 1, or None")
        if not self.kinds or not set(self.kinds) <= set(Kind.known()):
            names = ", ".join(kind.value for kind in Kind.known())
            raise ModelError(f"kinds is {[str(kind) for kind in self.kinds]}; they may be {names}")
