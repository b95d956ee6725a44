"""Channels of an HDF5 file, and so of a MAT file of version 7.3: its vectors, columns and fields of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile, ColumnHead

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

    def __init__(self, path: str) -> None:
        import h5py

        self._file = h5py.File(path, "r")
        self._places: list[tuple[Any, Any]] = []
        heads: list[ColumnHead] = []

        def add(data: Any, name: str, part: Any, kind: np.dtype[Any], count: int, problem: str) -> None:
            if data.is_virtual or data.external:
                problem = "is stored in other files, which are not read"
            if not problem and kind.kind not in "fiub":
                problem = f"holds {'texts or objects' if kind.kind in 'OSV' else kind}, which are not read"
            folder, _, own = name.rpartition("/")
            unit = next((data.attrs[key] for key in _UNITS if key in data.attrs), "")
            unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
            self._places.append((data, part))
            heads.append(ColumnHead.channel(own, str(unit) if isinstance(unit, str) else "", folder, count, problem))

        def visit(name: str, data: Any) -> None:
            if not isinstance(data, h5py.Dataset) or len(heads) >= _MOST or name.startswith("#refs#"):
                return
            shape = tuple(each for each in data.shape or () if each != 1) or (1,)
            if data.dtype.names:
                problem = "" if len(shape) == 1 else "is a matrix"
                for each in data.dtype.names:
                    add(data, f"{name}/{each}", each, data.dtype[each], shape[0], problem)
            elif len(shape) == 2 and min(shape) <= _MOST:
                rows = int(shape[0] < shape[1])  # MATLAB's columns are rows here
                for each in range(min(shape)):
                    add(data, f"{name}/{each + 1}", (rows, each), data.dtype, max(shape), "")
            else:
                add(data, name, None, data.dtype, shape[0], "" if len(shape) == 1 else f"has the shape {data.shape}")

        self._file.visititems(visit)
        self.heads = tuple(heads)

    def read(self, place: int) -> NDArray[Any]:
        """See `ChannelFile.read`."""
        data, part = self._places[place]
        if part is None:
            return np.asarray(data[()]).reshape(-1)
        if isinstance(part, str):
            return np.asarray(data[part]).reshape(-1)
        row, index = part
        return np.asarray(data[index, :] if row else data[:, index])

    def close(self) -> None:
        """See `ChannelFile.close`."""
        self._file.close()
