"""Records written in the formats of other programs, and files that are written completely or not at all."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError, StoreError
from gapwalk.model.registry import Registry
from gapwalk.results.labelled_tables import (
    Labelled,
    LabelledTable,
    attributes_of,
    columns_of,
    labelled_tables,
    needed,
    parameter_table,
    table_headings,
)
from gapwalk.results.result_file import check_place
from gapwalk.summary import Described

# The protocol of a format in which tables are written, and the formats by name.


class DataFormat(ABC):
    """A format in which a record is written.

    A format is one object in one file: it names itself and makes the contents. `gapwalk.studies.export` writes them,
    each file completely or not at all. The decorator `add_format` makes a format of your own known.
    """

    name: ClassVar[str]
    """Name of the format, as ``--format`` takes it."""

    ending: ClassVar[str]
    """Ending of its files, with the point."""

    table_by_table: ClassVar[bool] = False
    """True if a file has one table: the others are then in files next to it."""

    needs: ClassVar[tuple[str, ...]] = ()
    """Modules that it needs of the extra ``data``."""

    @abstractmethod
    def content(self, record: Described, table: str) -> bytes:
        """Return the content of the file."""

    def contents(self, record: Described, path: Path, *, named: bool) -> Mapping[Path, bytes]:
        """Return the contents of all files by their paths."""
        for module in self.needs:
            needed(module, f"the format {self.name}")
        if not self.table_by_table:
            return {path: self.content(record, "")}
        names = list(record.tables())
        paths = [path.with_name(f"{path.stem}-{name}{path.suffix or self.ending}") for name in names]
        if not named and paths:
            paths[0] = path
        return {each: self.content(record, name) for each, name in zip(paths, names, strict=True)}


# Each is loaded only when it is asked for: the libraries of some take seconds.
_HOMES = {name: f"{__name__}.{name.capitalize()}Format" for name in ("csv", "json", "netcdf", "mat", "parquet", "xlsx")}
_FORMATS: Registry[type[DataFormat]] = Registry("format", "the formats of tables", _HOMES)
_OTHER_ENDINGS = {"nc": "netcdf", "pq": "parquet"}


def format_names() -> tuple[str, ...]:
    """Return the names of all formats."""
    return _FORMATS.names


def canonical(name: str) -> str:
    """Return the name of a format by its name, or by the ending of its files without the point; unknown as it is."""
    return _OTHER_ENDINGS.get(name, name)


def format_of(name: str) -> DataFormat:
    """Return a format by its name, or by the ending of its files."""
    return _FORMATS.named(canonical(name))()


def add_format(form: type[DataFormat]) -> type[DataFormat]:
    """Register a format under its name, also as a decorator."""
    return _FORMATS.add(form.name, form)


# Comma-separated values: a file for each table, headings with units, numbers with all digits.


class CsvFormat(DataFormat):
    """Comma-separated values in UTF-8."""

    name: ClassVar[str] = "csv"
    ending: ClassVar[str] = ".csv"
    table_by_table: ClassVar[bool] = True

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        return table_of(record, table).encode()


def _text(value: object) -> object:
    """Return what a cell has: nothing where there is no value."""
    if isinstance(value, bool):
        return str(value).lower()
    return "" if isinstance(value, float) and math.isnan(value) else value


def table_of(record: Described, name: str) -> str:
    """Return one of the tables of a record as comma-separated values; headings have units if its system has some."""
    header, *rows = record.tables()[name]()
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table_headings(record, name, header))
    writer.writerows(map(_text, row) for row in rows)
    return text.getvalue()


# JSON: one document with everything that the record says of itself.


class JsonFormat(DataFormat):
    """The document of `to_dict`, with all points; numbers have all digits, and those that do not exist are null."""

    name: ClassVar[str] = "json"
    ending: ClassVar[str] = ".json"

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        return f"{json.dumps(record.to_dict(), indent=1, allow_nan=False, ensure_ascii=False)}\n".encode()


# MATLAB files (MAT, version 5): a structure for each table, with arrays, units and headings; written by SciPy.

_LONGEST = 63  # characters of a name in MATLAB
_MOST = 1 << 31  # bytes of a variable
_PRIMES = {"'": "_dot", "''": "_ddot"}


class MatFormat(DataFormat):
    """Structures of arrays: ``points.half`` has a row for each point and a column for each coordinate.

    Names become those that MATLAB allows (``mean.q1`` is ``mean_q1``, ``q1'`` is ``q1_dot``); the field ``names`` of
    each structure has the names as gapwalk writes them, ``units`` their units, and ``dims`` the dimensions.
    """

    name: ClassVar[str] = "mat"
    ending: ClassVar[str] = ".mat"

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        from scipy.io import savemat

        tables = labelled_tables(record)
        if (system := getattr(record, "system", None)) is not None:
            tables["parameters"] = parameter_table(system)
        names = matlab_names([*tables, "about"])
        found = {names[name]: _structure(each) for name, each in tables.items()}
        for name, each in tables.items():
            size = sum(array.values.nbytes for array in (*each.coordinates.values(), *each.variables.values()))
            if size >= _MOST:
                raise ModelError(
                    f"the table {name} takes {size / 1e9:.1f} GB, and a MAT file holds 2 GB; write --format netcdf"
                )
        content = io.BytesIO()
        savemat(content, {**found, names["about"]: attributes_of(record)}, long_field_names=True, oned_as="column")
        return content.getvalue()


def _structure(table: LabelledTable) -> dict[str, Any]:
    arrays: dict[str, Labelled] = {**table.coordinates, **table.variables}
    names = matlab_names([*arrays, "names", "units", "dims"][: len(arrays)], taken=("names", "units", "dims"))
    return {
        **{names[name]: _values(each.values) for name, each in arrays.items()},
        "names": _texts(arrays),
        "units": _texts(each.unit for each in arrays.values()),
        "dims": _texts(" ".join(map(repr, each.dims)) for each in arrays.values()),
    }


def _values(values: NDArray[Any]) -> NDArray[Any]:
    return values if values.dtype != object else _texts(values.ravel()).reshape(values.shape)


def _texts(texts: Iterable[object]) -> NDArray[Any]:
    """Return texts as SciPy writes a cell array of them."""
    listed = [str(text) for text in texts]
    cells = np.empty(len(listed), dtype=object)
    cells[:] = listed
    return cells


def matlab_names(names: Iterable[str], taken: Iterable[str] = ()) -> Mapping[str, str]:
    """Return a name for each name that MATLAB allows: distinct, of letters, digits and underscores, a letter first."""
    found: dict[str, str] = {}
    used = set(taken)
    for name in names:
        plain = re.sub(r"'+", lambda primes: _PRIMES.get(primes[0], "_"), name)
        plain = re.sub(r"\W+", "_", plain, flags=re.ASCII).strip("_") or "x"
        plain = plain if plain[0].isalpha() else f"x{plain}"
        short, number = plain[:_LONGEST], 1
        while short in used:
            number += 1
            short = f"{plain[: _LONGEST - 1 - len(str(number))]}_{number}"
        used.add(short)
        found[name] = short
    return found


# netCDF-4: a group for each table, arrays over labelled axes, units as attributes; written by xarray and h5netcdf.


class NetcdfFormat(DataFormat):
    """The arrays of `to_xarray`; `xarray.open_datatree` reads them, and any program that knows HDF5."""

    name: ClassVar[str] = "netcdf"
    ending: ClassVar[str] = ".nc"
    needs: ClassVar[tuple[str, ...]] = ("xarray", "h5netcdf", "h5py")

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        with TemporaryDirectory() as folder:
            file = Path(folder, "tables.nc")
            record.to_xarray().to_netcdf(file, engine="h5netcdf")
            return file.read_bytes()


# Parquet: a file for each table, with typed columns; written by Arrow, read by pandas, Polars, DuckDB and others.


class ParquetFormat(DataFormat):
    """Columns with headings as in CSV files; the unit of each is also in its metadata, and missing values are null."""

    name: ClassVar[str] = "parquet"
    ending: ClassVar[str] = ".parquet"
    needs: ClassVar[tuple[str, ...]] = ("pyarrow",)
    table_by_table: ClassVar[bool] = True

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        types = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}
        columns = columns_of(record, table)
        fields = [
            pa.field(each.head, types[each.type], metadata={"heading": each.heading, "unit": each.unit})
            for each in columns
        ]
        about = {"gapwalk": json.dumps({"table": table, **attributes_of(record)})}
        arrays = [pa.array(each.values, types[each.type]) for each in columns]
        content = io.BytesIO()
        pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=about)), content)
        return content.getvalue()


# Excel workbooks: a sheet for each table, and one for the parameters; written by openpyxl.

_ROWS, _COLUMNS, _TEXT = 1_048_576, 16_384, 32_767  # of a sheet, and characters of a cell


class XlsxFormat(DataFormat):
    """Sheets with headings as in CSV files. A number that is not finite is an empty cell (nan), or inf or -inf."""

    name: ClassVar[str] = "xlsx"
    ending: ClassVar[str] = ".xlsx"
    needs: ClassVar[tuple[str, ...]] = ("openpyxl",)

    def content(self, record: Described, table: str) -> bytes:
        """See `DataFormat.content`."""
        from openpyxl import Workbook

        book = Workbook(write_only=True)
        for name in record.tables():
            columns = columns_of(record, name)
            _fill(book, name, [each.head for each in columns], [each.values for each in columns])
        if (system := getattr(record, "system", None)) is not None:
            found = parameter_table(system)
            values = (found.coordinates["parameter"], found.variables["value"], found.variables["unit"])
            _fill(book, "parameters", ["parameter", "value", "unit"], [each.values.tolist() for each in values])
        content = io.BytesIO()
        book.save(content)
        return content.getvalue()


def _fill(book: Any, name: str, headings: Sequence[str], columns: Sequence[Iterable[Any]]) -> None:
    rows = list(zip(*columns, strict=True))
    if len(rows) >= _ROWS or len(headings) > _COLUMNS:
        raise ModelError(
            f"the table {name} has {len(rows):,} rows and {len(headings):,} columns, and a sheet holds {_ROWS - 1:,} "
            f"and {_COLUMNS:,}; write --format parquet or netcdf"
        )
    sheet = book.create_sheet(name[:31])
    sheet.freeze_panes = "A2"
    for row in ([*headings], *rows):
        sheet.append([_cell(sheet, value) for value in row])


def _cell(sheet: Any, value: Any) -> Any:
    """Return a value as openpyxl can write it."""
    # A text that begins with = must not become a formula, and a number keeps all digits: openpyxl would write 16 of
    # them.
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE, WriteOnlyCell

    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        cell = WriteOnlyCell(sheet, ILLEGAL_CHARACTERS_RE.sub("?", value)[:_TEXT])
        cell.data_type = "s"
    else:
        cell = WriteOnlyCell(sheet, value)
        cell._value = repr(value)
    return cell


def save_tables(record: Described, stem: str | os.PathLike[str], form: str = "csv") -> tuple[Path, ...]:
    """Write all tables of a record; those of a result are its points, its special points, and others of its study.

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
