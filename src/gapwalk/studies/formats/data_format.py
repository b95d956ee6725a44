"""The protocol of a format in which tables are written, and the formats by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from gapwalk.model.registry import Registry
from gapwalk.results.labelled import needed
from gapwalk.summary import Described


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
_HOMES = {
    name: f"{__package__}.{name}_format.{name.capitalize()}Format"
    for name in ("csv", "json", "netcdf", "mat", "parquet", "xlsx")
}
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
