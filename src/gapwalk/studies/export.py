"""Records written in the formats of other programs, and files that are written completely or not at all."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from gapwalk.errors import StoreError
from gapwalk.results.result_file import check_place
from gapwalk.studies.formats.csv_format import table_of
from gapwalk.studies.formats.data_format import format_of
from gapwalk.summary import Described


def save_tables(record: Described, stem: str | os.PathLike[str], form: str = "csv") -> tuple[Path, ...]:
    """Write all tables of a record: of a result points, special points, and others of its kind of study.

    Numbers have all digits, so that reading restores them exactly.

    Parameters
    ----------
    record
        The result of a study, or another record with tables, such as a branch.
    stem
        Beginning of the file names. If a file has one table, a hyphen and the name of the table follow; then the
        ending.
    form
        The format: ``"csv"``, ``"json"`` (one document), ``"netcdf"``, ``"mat"``, ``"parquet"`` or ``"xlsx"``. The
        formats netcdf, parquet and xlsx need ``pip install "gapwalk[data]"``.

    Returns
    -------
    tuple of Path
        The files that were written.

    Raises
    ------
    ModelError
        If there is no such format, it cannot hold the tables, or a library is missing.
    StoreError
        If a file cannot be written.

    Examples
    --------
    >>> [path.name for path in gw.save_tables(branch, "stop")]
    ['stop-points.csv', 'stop-special-points.csv', 'stop-ends.csv']
    """
    path = Path(f"{os.fspath(stem)}{format_of(form).ending}")
    return export_data(record, path, form, named=True)


def export_data(record: Described, path: Path, form: str, *, named: bool = False) -> tuple[Path, ...]:
    """Write a record in a format; return the files. Parameters as `DataFormat.contents`, errors as `save_tables`."""
    contents = format_of(form).contents(record, path, named=named)
    for each, content in contents.items():
        write_whole(each, content)
    return tuple(contents)


def export_csv(record: Described, paths: Mapping[str, str | os.PathLike[str]]) -> None:
    """Write tables of a record into the files that are given by the names of the tables; errors as `save_tables`."""
    for name, path in paths.items():
        write_whole(path, table_of(record, name).encode())


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file atomically: it always has either the old or the new content, never a part of it."""
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
