"""Special points measured in slow sweeps, and the special points of a branch to which they belong."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass

from gapwalk.bifurcation.kinds import Kind
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.files import open_file
from gapwalk.model.measured.measured_table import parse_csv
from gapwalk.model.problems import did_you_mean

MAX_POINTS = 10_000
"""Most points that a file may have."""
_MAX_BYTES = 10_000_000
_COLUMNS = ("kind", "value", "error", "which")
_LISTED = 6  # points that a message lists
_CLEAR = 2.0  # the second nearest special point must be farther than the nearest one by this factor


@dataclass(frozen=True, slots=True)
class MeasuredPoint:
    """A special point that was measured, such as the frequency of a jump in a slow sweep."""

    kind: str  #: Its kind: ``"fold"`` for a jump, ``"grazing"`` for a stop that is first touched, or another.
    value: float  #: Measured value of the parameter of the branch, in its units.
    error: float  #: Standard uncertainty of this value.
    #: The special point of the computed branch that was measured, if the nearest one of its kind is in doubt: its
    #: number among those of its kind along the branch, from 1; or its contact, such as ``"stage2 +"``.
    which: int | str = ""

    def __post_init__(self) -> None:
        kinds = [str(kind) for kind in Kind.known()]
        if self.kind not in kinds:
            raise ModelError(f"kind is {self.kind!r}; {did_you_mean(str(self.kind), kinds)}")
        for name in ("value", "error"):
            number = getattr(self, name)
            if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                raise ModelError(f"{name} of the {self.kind} is {number!r}; it must be a finite number")
        if self.error <= 0.0:
            raise ModelError(f"error of the {self.kind} is {self.error!r}; its standard uncertainty must be > 0")
        if isinstance(self.which, bool) or not isinstance(self.which, int | str):
            raise ModelError(f"which is {self.which!r}; write a number from 1, or a contact such as 'stage2 +'")

    @property
    def words(self) -> str:
        """Kind, measured value and uncertainty."""
        return f"{self.kind} measured at {self.value:.8g} ± {self.error:.2g}"


def measured_of(row: MeasuredPoint | Sequence[object]) -> MeasuredPoint:
    """Return a measured point from (kind, value, error) or (kind, value, error, which)."""
    if isinstance(row, MeasuredPoint):
        return row
    if isinstance(row, str) or not isinstance(row, Sequence) or len(row) not in {3, 4}:
        raise ModelError(f"a measured point is {row!r}; write (kind, value, error), as in ('fold', 0.619, 0.0005)")
    return MeasuredPoint(*row)  # type: ignore[arg-type]


def match_points(specials: Sequence[SpecialPoint], measured: Sequence[MeasuredPoint]) -> list[SpecialPoint]:
    """Return the special point that belongs to each measured one."""
    if not measured:
        raise ModelError("no point was measured; write some, as in [('fold', 0.619, 0.0005)]")
    if len({(each.parameter, each.orbit.system) for each in specials}) == 0:
        raise ModelError("the branch has no special points; walk a longer one")
    found: list[SpecialPoint] = []
    for each in measured:
        alike = [special for special in specials if special.kind == each.kind]
        listed = _listed(alike, each.value)
        if not alike:
            known = ", ".join(dict.fromkeys(str(special.kind) for special in specials))
            raise ModelError(f"a {each.words}, but the branch has none; it has {known}")
        if isinstance(each.which, int):
            if not 1 <= each.which <= len(alike):
                raise ModelError(f"a {each.words} is number {each.which}, but the branch has {len(alike)} ({listed})")
            found.append(alike[each.which - 1])
            continue
        near = [special for special in alike if each.which in ("", special.contact)]
        if not near:
            raise ModelError(f"a {each.words} is that of {each.which}; the branch has {listed}")
        near.sort(key=lambda special: abs(special.value - each.value))
        distances = [abs(special.value - each.value) for special in near]
        if len(near) > 1 and distances[1] < _CLEAR * distances[0]:
            raise ModelError(
                f"a {each.words} may be that at {near[0].value:.8g} or at {near[1].value:.8g}; say which, as in "
                f"which = {alike.index(near[0]) + 1} (the branch has {listed})"
            )
        for other, special in zip(measured, found, strict=False):
            if special is near[0] and not isinstance(other.which, int):
                raise ModelError(
                    f"a {each.words} and a {other.words} are both nearest to that at {special.value:.8g}; say which "
                    f"they are, as in which = {alike.index(special) + 1} (the branch has {listed})"
                )
        found.append(near[0])
    return found


def _listed(alike: Sequence[SpecialPoint], value: float) -> str:
    """List the points nearest to a value by their numbers along the branch."""
    numbered = list(enumerate(alike, start=1))
    nearest = sorted(numbered, key=lambda each: abs(each[1].value - value))[:_LISTED]
    texts = [
        f"{number}: at {special.value:.8g}{', ' * bool(special.contact)}{special.contact}"
        for number, special in sorted(nearest, key=lambda each: each[0])
    ]
    return "; ".join([*texts, *(["and others"] if len(alike) > _LISTED else [])])


def read_points(path: str | os.PathLike[str]) -> tuple[MeasuredPoint, ...]:
    r"""Read measured special points from a CSV file with the columns kind, value, error and, if needed, which.

    Numbers are in the units of the parameter of the branch, such as rpm.

    Parameters
    ----------
    path
        The file; its first line names the columns.

    Returns
    -------
    points : tuple of MeasuredPoint
        One for each line.

    Raises
    ------
    ModelError
        If the file cannot be read, a column is missing, or an entry is invalid.

    Examples
    --------
    >>> from pathlib import Path
    >>> written = Path("jumps.csv").write_text("kind,value,error,which\nfold,1.39,0.001,1\n")
    >>> gw.measure.read_points("jumps.csv")[0].value
    1.39
    """
    name = repr(os.fspath(path))
    try:
        with open_file(path) as file:
            table = parse_csv(file.read(_MAX_BYTES + 1), "kind,value,error", MAX_POINTS)
        places = {head: place for place, head in enumerate(table.heads)}
        for head in _COLUMNS[:3]:
            if head not in places:
                raise ModelError(
                    f"has no column {head}; its first line must be kind,value,error or {','.join(_COLUMNS)}"
                )
        for head in places:
            if head not in _COLUMNS:
                raise ModelError(f"has a column {head!r}, which points do not have; {did_you_mean(head, _COLUMNS)}")
        numbers = table.numbers({head: places[head] for head in ("value", "error")})
        kinds = table.texts(places["kind"])
        which = table.texts(places["which"]) if "which" in places else [""] * len(kinds)
        points = []
        for (line, _), kind, value, error, text in zip(table.rows, kinds, *numbers.values(), which, strict=True):
            try:
                points.append(MeasuredPoint(kind, float(value), float(error), int(text) if text.isdigit() else text))
            except ModelError as problem:
                raise ModelError(f"line {line}: {problem}") from None
    except OSError as problem:
        raise ModelError(f"points cannot be read from {name}: {problem.strerror or problem}") from None
    except ModelError as problem:
        raise ModelError(f"points in {name}: {problem}") from None
    return tuple(points)
