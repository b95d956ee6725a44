"""Results as tables of comma-separated values, and files that are written whole or not at all."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from gapwalk.continuation.branch import Branch
from gapwalk.continuation.point import BranchPoint
from gapwalk.errors import StoreError
from gapwalk.orbit.measures import MEASURES
from gapwalk.study.result import Result


def export_csv(result: Result, points: str | os.PathLike[str], special_points: str | os.PathLike[str]) -> None:
    """Write the points and the special points of all branches of a result as CSV files.

    Numbers have all digits: they read back as the same numbers.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    write_whole(points, points_csv(result).encode())
    write_whole(special_points, special_points_csv(result).encode())


def points_csv(result: Result) -> str:
    """The points of all branches, a line each.

    The columns are: number and name of the branch, period, parameter, stability, contacts; maximum, minimum, half the
    peak to peak, mean and rms of each coordinate; the state at theta = 0; modulus and argument (in radians) of the
    multipliers.
    """
    coordinates = result.system.coordinates
    states = [*(f"{q}(0)" for q in coordinates), *(f"{q}'(0)" for q in coordinates)]
    multipliers = [f"{part}.multiplier{i + 1}" for i in range(len(states)) for part in ("modulus", "argument")]
    header = ["branch", "name", "period", result.options.parameter, "stable", "instability", "contacts"]
    return _table(
        [*header, *_measure_names(coordinates), *states, *multipliers],
        (
            [
                number,
                name,
                branch.period,
                point.value,
                point.stable,
                point.instability.label,
                point.orbit.pattern,
                *_measures(point),
                *point.orbit.state.tolist(),
                *np.column_stack((np.abs(point.orbit.multipliers), np.angle(point.orbit.multipliers))).ravel().tolist(),
            ]
            for number, (name, branch) in enumerate(_named(result), start=1)
            for point in branch.points
        ),
    )


def special_points_csv(result: Result) -> str:
    """The special points of all branches, a line each.

    The multiplier is the critical one, and empty at a grazing point; `contact` is what grazes there; `leads.to` names
    the branches of a diagram that begin or end there.
    """
    coordinates = result.system.coordinates
    header = ["branch", "name", "period", "kind", result.options.parameter, "uncertainty", "before", "after"]
    header += [
        "unstable.before",
        "unstable.after",
        "re.multiplier",
        "im.multiplier",
        "nature",
        "judged",
        "contact",
        "contacts",
        "leads.to",
    ]
    return _table(
        [*header, *_measure_names(coordinates)],
        (
            [
                number,
                name,
                branch.period,
                special.kind.value,
                special.value,
                special.uncertainty,
                special.before.label,
                special.after.label,
                special.before.total,
                special.after.total,
                *(("", "") if np.isnan(special.multiplier) else (special.multiplier.real, special.multiplier.imag)),
                special.nature,
                special.judged,
                special.contact,
                special.orbit.pattern,
                " ".join(limb.name for limb in result.diagram.attached(name, index)) if result.diagram else "",
                *_measures(special.point),
            ]
            for number, (name, branch) in enumerate(_named(result), start=1)
            for index, special in enumerate(branch.special_points)
        ),
    )


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file such that under its name there is the old content, or the new, but never a part of it.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    final = Path(path)
    part = final.with_name(f".{final.name}.{os.getpid()}.part")
    try:
        try:
            with open(part, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, final)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise
    except OSError as error:
        if not final.parent.is_dir():
            raise StoreError(f"{final} cannot be written: there is no folder {final.parent}; make it") from None
        raise StoreError(f"{final} cannot be written: {error.strerror or error}") from None


def _named(result: Result) -> Iterator[tuple[str, Branch]]:
    return zip(result.names, result.branches, strict=True)


def _measure_names(coordinates: Sequence[str]) -> list[str]:
    return [f"{kind}.{q}" for q in coordinates for kind in MEASURES]


def _measures(point: BranchPoint) -> list[float]:
    return [point.measure(name) for name in _measure_names(point.orbit.system.coordinates)]


def _table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: object) -> object:
    return str(value).lower() if isinstance(value, bool) else value
