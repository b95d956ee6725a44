"""Channels of an HDF5 file, and so of a MAT file of version 7.3: its vectors, columns and fields of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from gapwalk.model.channels.channel_file import ChannelFile

_BEGIN = b"\x89HDF\r\n\x1a\n"
_MOST = 1000  # channels of a file, and columns of a matrix
_UNITS = ("unit", "units", "Unit", "Units", "unit_string")


class HdfChannels(ChannelFile):
    """An HDF5 file; channels of one folder in it belong together."""

    words, endings, begins = "an HDF5 file", (".h5", ".hdf5", ".hdf", ".mat"), (_BEGIN, b"MATLAB 7.3 MAT-file")
    module = "h5py"

    @classmethod
    def fits(cls, head: bytes) -> bool:
        """See `ChannelFile.fits`; a MAT file has a head of its own before that of HDF5."""
        return head.startswith(cls.begins) or head[512:520] == _BEGIN

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        import h5py

        self.file = h5py.File(path, "r")
        self.file.visititems(self._visit)

    def _visit(self, name: str, data: Any) -> None:
        if not hasattr(data, "shape") or len(self.heads) >= _MOST or name.startswith("#refs#"):
            return
        shape = tuple(each for each in data.shape or () if each != 1) or (1,)
        if data.dtype.names:
            problem = "" if len(shape) == 1 else "is a matrix"
            for each in data.dtype.names:
                self._part(data, f"{name}/{each}", each, data.dtype[each], shape[0], problem)
        elif len(shape) == 2 and min(shape) <= _MOST:
            for each in range(min(shape)):  # MATLAB's columns are rows here
                place = (each, slice(None)) if shape[0] < shape[1] else (slice(None), each)
                self._part(data, f"{name}/{each + 1}", place, data.dtype, max(shape), "")
        else:
            self._part(data, name, (), data.dtype, shape[0], "" if len(shape) == 1 else f"has the shape {data.shape}")

    def _part(self, data: Any, name: str, place: Any, kind: np.dtype[Any], count: int, problem: str) -> None:
        if data.is_virtual or data.external:
            problem = "is stored in other files, which are not read"
        if not problem and kind.kind not in "fiub":
            problem = f"holds {'texts or objects' if kind.kind in 'OSV' else kind}, which are not read"
        folder, _, own = name.rpartition("/")
        unit = next((data.attrs[key] for key in _UNITS if key in data.attrs), "")
        unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
        unit = str(unit) if isinstance(unit, str) else ""
        self.add(lambda: np.asarray(data[place]).reshape(-1), own, unit, folder, count, problem)
