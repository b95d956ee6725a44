"""Results in the formats of other programs: read back by xarray, h5py, SciPy, pandas and openpyxl, to the bit."""

import json
import struct
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
import xarray as xr
from scipy.io import loadmat

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.studies.export import XlsxFormat, export_data, format_names, format_of, matlab_names
from gapwalk.summary import Described, TableRows, Tables
from tests.studies.studies import stop_study

BITS = np.random.default_rng(3).integers(0, 1 << 64, 400, dtype=np.uint64).view(np.float64)
NUMBERS = [0.1, -0.0, 5e-324, sys.float_info.max, 1 / 3, *BITS[np.isfinite(BITS)].tolist()]
"""Numbers that no rounding survives: of random bits."""


def train() -> gw.System:
    """Two inertias with units: a coordinate and its rate have different ones."""
    parts = gw.train.Inertia("engine", "0.1 kg m^2"), gw.train.Inertia("load", "0.2 kg m^2")
    shaft = gw.train.Shaft("shaft", ("engine", "load"), stiffness="10 N m/deg", damping="0.5 N m s/rad")
    load = gw.Harmonic("5 N m", {"engine": 1.0})
    return gw.train.Train(parts, [shaft], harmonics=[load], speed="1500 rpm").system()


@dataclass(frozen=True, eq=False)
class Book(Described):
    """A record with a table of every sort."""

    system: gw.System = field(default_factory=train)
    title: str = "=1+1, with ° and \N{SNOWMAN}"

    def tables(self) -> Tables:
        return {
            "numbers": self._numbers,
            "mixed": self._mixed,
            "grid": TableRows(self._grid, 2),
            "orders": TableRows(self._orders, 1, "shaft'"),
            "empty": lambda: [["kind", "speed"]],
        }

    def _numbers(self) -> Iterator[Sequence[object]]:
        yield ["speed", "half.shaft", "max.shaft", "shaft(0)", "shaft'(0)", "modulus.multiplier1"]
        yield from ([x, -x, x, x, x, abs(x)] for x in NUMBERS)

    def _mixed(self) -> Iterator[Sequence[object]]:
        yield ["name", "stable", "count", "hole", "kind", "infinite", "name"]
        yield ["=A1", True, 1, 2.5, None, np.inf, "a"]
        yield ['\N{SNOWMAN}, "x"\n', False, (1 << 62) + 1, None, "fold", np.nan, "b"]

    def _grid(self) -> Iterator[Sequence[object]]:
        yield ["speed", "mean.engine", "regime"]
        yield from ([x, y, int(10 * x + y)] for y in (3.0, 1.0) for x in (5.0, 7.0, 6.0))

    def _orders(self) -> Iterator[Sequence[object]]:
        yield ["time", "order 0", "order 0.3333333333333333", "order 1"]
        yield from ([0.5, 1.0, 2.0, 3.0], [0.75, 4.0, 5.0, 6.0])


BOOK = Book()


def bits(values: object) -> bytes:
    return np.asarray(values, dtype=float).tobytes()


def check_arrays(read: xr.DataTree) -> None:
    numbers, grid, orders = read["numbers"], read["grid"], read["orders"]
    assert bits(numbers["half"].sel(coordinate="shaft")) == bits([-x for x in NUMBERS])
    assert bits(numbers["speed"]) == bits(NUMBERS)
    assert numbers["half"].dims == ("numbers", "coordinate")
    units = {name: array.attrs.get("units") for name, array in numbers.variables.items()}
    assert (units["speed"], units["half"], units["position(0)"], units["velocity(0)"]) == ("rpm", "deg", "deg", "deg/s")
    assert (units["modulus"], numbers["modulus"].dims) == (None, ("numbers", "multiplier"))
    assert grid["regime"].dims == ("mean.engine", "speed")
    assert int(grid["regime"].sel({"speed": 7.0, "mean.engine": 1.0})) == 71
    assert grid["mean.engine"].attrs == {"units": "N m"}
    assert bits(orders["amplitude.shaft'"].sel(order=1 / 3)) == bits([2.0, 5.0])
    assert (orders["amplitude.shaft'"].attrs, orders["time"].attrs) == ({"units": "deg/s"}, {"units": "s"})
    mixed = read["mixed"]
    assert mixed["name"].values.tolist() == ["=A1", '\N{SNOWMAN}, "x"\n']
    assert mixed["name.2"].values.tolist() == ["a", "b"]
    assert mixed["count"].values.tolist() == [1, (1 << 62) + 1]
    assert mixed["stable"].values.tolist() == [True, False]
    assert bits(mixed["hole"]) == bits([2.5, np.nan])
    assert np.isposinf(mixed["infinite"].values[0])
    parameters = read["parameters"]
    assert float(parameters["value"].sel(parameter="shaft.stiffness")) == BOOK.system["shaft.stiffness"]
    assert str(parameters["unit"].sel(parameter="speed").item()) == "rpm"
    assert (read.attrs["title"], read["empty"].sizes["empty"]) == (BOOK.title, 0)


def test_labelled_arrays_have_axes_and_units() -> None:
    check_arrays(BOOK.to_xarray())


def test_netcdf_reads_back_by_xarray_to_the_bit(tmp_path: Path) -> None:
    (path,) = gw.save_tables(BOOK, tmp_path / "book", "netcdf")
    assert path.name == "book.nc"
    with xr.open_datatree(path, engine="h5netcdf") as read:
        check_arrays(read.load())


def test_mat_reads_back_by_scipy_to_the_bit(tmp_path: Path) -> None:
    (path,) = gw.save_tables(BOOK, tmp_path / "book", "mat")
    read = loadmat(path, squeeze_me=True, struct_as_record=False)
    numbers, grid, mixed = read["numbers"], read["grid"], read["mixed"]
    assert bits(numbers.half) == bits([-x for x in NUMBERS])
    assert dict(zip(numbers.names.tolist(), numbers.units.tolist(), strict=True))["velocity(0)"] == "deg/s"
    assert grid.regime.tolist() == [[53, 73, 63], [51, 71, 61]]
    assert dict(zip(grid.names, grid.dims, strict=True))["regime"] == "'mean.engine' 'speed'"
    assert mixed.name.tolist() == ["=A1", '\N{SNOWMAN}, "x"\n']
    assert mixed.count.tolist() == [1, (1 << 62) + 1]
    assert read["orders"].amplitude_shaft_dot.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert read["about"].title == BOOK.title


def test_names_of_matlab_are_valid_and_distinct() -> None:
    found = matlab_names(["mean.q1", "mean q1", "q1'", "1st", "'", "a" * 80, "a" * 81], taken=["mean_q1"])
    assert list(found.values())[:4] == ["mean_q1_2", "mean_q1_3", "q1_dot", "x1st"]
    assert all(name.isidentifier() and len(name) <= 63 for name in found.values())
    assert len(set(found.values())) == len(found)


def test_parquet_reads_back_by_pandas_to_the_bit(tmp_path: Path) -> None:
    files = {path.stem: path for path in gw.save_tables(BOOK, tmp_path / "book", "parquet")}
    numbers, mixed = pd.read_parquet(files["book-numbers"]), pd.read_parquet(files["book-mixed"])
    assert list(numbers)[:2] == ["speed [rpm]", "half.shaft [deg]"]
    assert bits(numbers["speed [rpm]"]) == bits(NUMBERS)
    assert mixed["count"].tolist() == [1, (1 << 62) + 1]
    assert mixed["stable"].dtype == bool
    assert bits(mixed["hole"]) == bits([2.5, np.nan])
    assert list(mixed)[-1] == "name.2"
    import pyarrow.parquet as pq

    assert pq.read_schema(files["book-numbers"]).field("speed [rpm]").metadata == {
        b"heading": b"speed",
        b"unit": b"rpm",
    }


def test_xlsx_reads_back_by_pandas_to_the_bit(tmp_path: Path) -> None:
    (path,) = gw.save_tables(BOOK, tmp_path / "book", "xlsx")
    sheets = pd.read_excel(path, sheet_name=None, keep_default_na=False)
    assert list(sheets) == ["numbers", "mixed", "grid", "orders", "empty", "parameters"]
    assert sheets["numbers"]["speed [rpm]"].tolist() == NUMBERS  # pandas takes -0.0 for 0
    book = openpyxl.load_workbook(path)
    assert bits([row[0].value for row in book["numbers"].iter_rows(min_row=2)]) == bits(NUMBERS)
    cells = [[cell.value for cell in row] for row in book["mixed"].iter_rows()]
    assert cells[1] == ["=A1", True, 1, 2.5, None, "inf", "a"]
    assert cells[2] == ['\N{SNOWMAN}, "x"\n', False, (1 << 62) + 1, None, "fold", None, "b"]
    assert book["mixed"]["A2"].data_type == "s"  # and no formula


def test_what_a_sheet_cannot_hold_is_refused(monkeypatch) -> None:
    monkeypatch.setattr("gapwalk.studies.export._ROWS", 100)
    with pytest.raises(ModelError, match=r"the table numbers has .* rows .* --format parquet or netcdf"):
        XlsxFormat().content(BOOK, "")


@pytest.mark.parametrize("form", ["netcdf", "parquet", "xlsx"])
def test_a_missing_library_is_named_with_the_line_that_installs_it(form, tmp_path, monkeypatch) -> None:
    for module in format_of(form).needs:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ModelError, match=r'install it: pip install "gapwalk\[data\]"'):
        gw.save_tables(BOOK, tmp_path / "book", form)
    assert not list(tmp_path.iterdir())


def test_every_format_writes_the_result_of_a_study(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    result = gw.run(stop_study(), "stop.gapwalk")
    (branch,) = result.branches
    for form in format_names():
        assert main(["export", "stop.gapwalk", "--format", form]) == 0
    assert {path.suffix for path in Path().glob("stop*")} >= {".csv", ".json", ".nc", ".mat", ".parquet", ".xlsx"}
    with xr.open_datatree("stop.nc", engine="h5netcdf") as tree:
        points = tree["points"].load()
        assert bits(points["frequency"]) == bits(branch.values)
        assert bits(points["half"].sel(coordinate="x")) == bits(branch.measure("half.x"))
        assert bits(points["position(0)"][:, 0]) == bits([each.orbit.state[0] for each in branch.points])
        assert tree.attrs["study"] == "response"
    assert bits(loadmat("stop.mat", squeeze_me=True)["points"]["frequency"].item()) == bits(branch.values)
    assert bits(pd.read_parquet("stop-points.parquet")["frequency"]) == bits(branch.values)
    assert json.loads(Path("stop.json").read_text())["branches"][0]["points"][3]["parameter"] == branch.values[3]
    capsys.readouterr()
    assert main(["export", "stop.gapwalk", "--output", "other.nc"]) == 0
    assert Path("other.nc").exists()
    assert main(["export", "stop.gapwalk", "--output", "stop.ods"]) == 2
    assert "write --format csv, json, netcdf, mat, parquet, xlsx" in capsys.readouterr().err


def test_a_waterfall_is_an_array_over_orders(tmp_path: Path) -> None:
    system = stop_study().system
    orbits = [gw.find_orbit(system.at({"frequency": value})) for value in (2.0, 2.1)]
    found = gw.analysis.waterfall(orbits, "x", 3.0)
    (path,) = export_data(found, tmp_path / "w.nc", "netcdf")
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        read = tree["amplitudes"].load()
    assert read["amplitude.x"].dims == ("frequency", "order")
    assert bits(read["amplitude.x"]) == bits(found.amplitudes)
    assert bits(read["order"]) == bits(found.orders)
    lines = gw.analysis.spectrum(orbits[0], "x").to_xarray()["lines"]
    state = orbits[0].to_xarray()["state"]
    assert float(state["value"].sel(state="x'")) == orbits[0].state[1]
    assert float(lines["amplitude.x"].sel(order=1.0)) == gw.analysis.spectrum(orbits[0], "x").amplitude(1.0)


def test_random_bits_are_numbers() -> None:
    assert struct.pack("d", NUMBERS[-1]) == bits(NUMBERS[-1:])
    assert len(NUMBERS) > 300
