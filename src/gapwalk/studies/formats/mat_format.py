"""MATLAB files (MAT, version 5): a structure for each table, with arrays, units and headings; written by SciPy."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.results.labelled import Labelled, LabelledTable, attributes_of, labelled_tables, parameter_table
from gapwalk.studies.formats.data_format import DataFormat
from gapwalk.summary import Described

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
