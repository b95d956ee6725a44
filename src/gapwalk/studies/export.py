"""Records as tables of comma-separated values, and files that are written whole or not at all."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from gapwalk.errors import StoreError
from gapwalk.results.result_file import check_place
from gapwalk.studies.columns import with_units
from gapwalk.summary import Described


def save_tables(record: Described, stem: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write all tables of a record as CSV files: of a result points, special points, and others of its kind of study.

    Numbers have all digits: they read back as the same numbers.

    Parameters
    ----------
    record
        The result of a study, or another record with tables, such as a branch.
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
    paths = {name: Path(f"{os.fspath(stem)}-{name}.csv") for name in record.tables()}
    export_csv(record, paths)
    return tuple(paths.values())


def export_csv(record: Described, paths: Mapping[str, str | os.PathLike[str]]) -> None:
    """Write tables of a record into the files that are given by the names of the tables; errors as `save_tables`."""
    for name, path in paths.items():
        write_whole(path, table_of(record, name).encode())


def table_of(record: Described, name: str) -> str:
    """Return one of the tables of a record as comma-separated values; headings have units if its system has some."""
    header, *rows = record.tables()[name]()
    system = getattr(record, "system", None)
    return table_csv(map(str, header) if system is None else with_units(map(str, header), system), rows)


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


def table_csv(header: Iterable[object], rows: Iterable[Sequence[object]]) -> str:
    """One table as comma-separated values."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([str(value).lower() if isinstance(value, bool) else value for value in row] for row in rows)
    return text.getvalue()
