"""Results as tables of comma-separated values, and files that are written whole or not at all."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.errors import StoreError
from gapwalk.results.result_file import check_place
from gapwalk.studies.columns import (
    COVERAGE,
    coverage_rows,
    measure_names,
    measure_values,
    method_names,
    method_values,
    parameter_headings,
    with_units,
)
from gapwalk.studies.map import codim2_rows, locus_rows
from gapwalk.studies.result import Result


def export_csv(result: Result, paths: Mapping[str, str | os.PathLike[str]]) -> None:
    """Write the tables of a result as CSV files.

    Numbers have all digits: they read back as the same numbers.

    Parameters
    ----------
    result
        The result.
    paths
        The files to write, by the names of `table_names`.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    for name, path in paths.items():
        write_whole(path, table_of(result, name).encode())


def save_tables(result: Result, stem: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write all tables of a result as CSV files: points, special points, and others that depend on the kind of study.

    Numbers have all digits: they read back as the same numbers.

    Parameters
    ----------
    result
        The result of a study.
    stem
        How the file names begin; a hyphen, the name of the table and ``.csv`` follow.

    Returns
    -------
    tuple of Path
        The files that were written.

    Raises
    ------
    StoreError
        If a file cannot be written.

    Examples
    --------
    >>> gw.save_tables(gw.load("clutch.gapwalk"), "out/clutch")
    (PosixPath('out/clutch-points.csv'), PosixPath('out/clutch-special-points.csv'))
    """
    paths = {name: Path(f"{os.fspath(stem)}-{name}.csv") for name in table_names(result)}
    export_csv(result, paths)
    return tuple(paths.values())


def table_names(result: Result) -> tuple[str, ...]:
    """The tables of a result.

    ``points`` and ``special-points`` are those of its branches; of a map those of its loci, and the points of its
    branches are in ``sections``. What a search for a diagram has covered is in ``search``. A study without branches
    has tables of its own.
    """
    if result.finding is not None:
        return tuple(result.finding.tables())
    if result.map is not None:
        return "points", "special-points", "sections"
    searched = result.diagram is not None and result.diagram.search is not None
    return ("points", "special-points", *(["search"] if searched else []))


def points_csv(result: Result) -> str:
    """The points of all branches, a line each.

    The columns are: number and name of the branch, period, parameter, stability, contacts; maximum, minimum, half the
    peak to peak, mean and rms of each coordinate; the state at theta = 0; modulus and argument (in radians) of the
    multipliers; by harmonic balance, the number of harmonics and the truncation error. On the sections of a map, the
    second parameter comes after the first.
    """
    coordinates = result.system.coordinates
    chart = result.map
    second = [] if chart is None else [section.value for section in chart.sections for _ in section.branches]
    states = [*(f"{q}(0)" for q in coordinates), *(f"{q}'(0)" for q in coordinates)]
    multipliers = [f"{part}.multiplier{i + 1}" for i in range(len(states)) for part in ("modulus", "argument")]
    names = parameter_headings([result.walked.parameter, *([chart.second] if chart else [])], coordinates)
    header = ["branch", "name", "period", *names, "stable", "instability", "contacts"]
    return table_csv(
        with_units(
            [*header, *measure_names(coordinates), *states, *multipliers, *method_names(result.walked)], result.system
        ),
        (
            [
                number,
                name,
                branch.period,
                point.value,
                *second[number - 1 : number],
                point.stable,
                point.instability.label,
                point.orbit.pattern,
                *measure_values(point),
                *point.orbit.state.tolist(),
                *np.column_stack((np.abs(point.orbit.multipliers), np.angle(point.orbit.multipliers))).ravel().tolist(),
                *method_values(point.orbit),
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
    (parameter,) = parameter_headings([result.walked.parameter], coordinates)
    header = ["branch", "name", "period", "kind", parameter, "uncertainty", "before", "after"]
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
    return table_csv(
        with_units([*header, *measure_names(coordinates), *method_names(result.walked)], result.system),
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
                " ".join(member.name for member in result.diagram.attached(name, index)) if result.diagram else "",
                *measure_values(special.point),
                *method_values(special.orbit),
            ]
            for number, (name, branch) in enumerate(_named(result), start=1)
            for index, special in enumerate(branch.special_points)
        ),
    )


def table_of(result: Result, name: str) -> str:
    """One of the tables of a result, by its name in `table_names`."""
    if result.finding is not None:
        header, *rows = result.finding.tables()[name]()
        return table_csv(with_units(map(str, header), result.system), rows)
    return _TABLES[name](result)


def _map_csv(result: Result, table: Callable[..., Iterable[Sequence[object]]]) -> str:
    """A table of the loci of a map."""
    header, *rows = table(result.map, result.system.coordinates, method_names(result.walked))
    return table_csv(with_units(map(str, header), result.system), rows)


def _search_csv(result: Result) -> str:
    assert result.diagram is not None
    assert result.diagram.search is not None
    return table_csv(COVERAGE, coverage_rows(result.diagram.search))


_TABLES: dict[str, Callable[[Result], str]] = {
    "points": lambda result: _map_csv(result, locus_rows) if result.map is not None else points_csv(result),
    "special-points": lambda result: (
        _map_csv(result, codim2_rows) if result.map is not None else special_points_csv(result)
    ),
    "sections": points_csv,
    "search": _search_csv,
}


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file such that under its name there is the old content, or the new, but never a part of it.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    check_place(path)  # a device would be replaced
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


def table_csv(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """One table as comma-separated values."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([str(value).lower() if isinstance(value, bool) else value for value in row] for row in rows)
    return text.getvalue()
