"""netCDF-4: a group for each table, arrays over labelled axes, units as attributes; written by xarray and h5netcdf."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

from gapwalk.studies.formats.data_format import DataFormat
from gapwalk.summary import Described


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
