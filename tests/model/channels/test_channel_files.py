"""Files of the test bench: what their libraries write is read by channel, and what is no record is refused."""

import os
import pickle
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.model.channels.channel_file import FORMATS, endings, open_channels
from gapwalk.model.measured.measured_table import WantedColumn, read_table
from gapwalk.model.units import QuantityKind
from tests.tiers import in_campaign, keeps

pytestmark = [  # of libraries that fail to close damaged files
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

TIME = np.arange(64) * 0.125
TORQUE = np.sin(TIME)  # kN m
SPEED = 1500.0 + TIME  # 1/min
UNITS = {"time": "s", "torque": "kN m", "n": "1/min"}
DATA = {"time": TIME, "torque": TORQUE, "n": SPEED}
WANTED = [
    WantedColumn("time", QuantityKind.TIME),
    WantedColumn("torque", QuantityKind.TORQUE, key="column"),
    WantedColumn("speed", QuantityKind.FREQUENCY),
]


def library(name: str):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip(name, reason=f"{name} of the extra files is not installed")


def write_mat(path: Path, data=None) -> None:
    savemat(path, {f"{name}": value for name, value in (data or DATA).items()})


def write_hdf(path: Path, data=None, folder: str = "bench") -> None:
    with library("h5py").File(path, "w") as file:
        for name, value in (data or DATA).items():
            file[f"{folder}/{name}"] = value
            file[f"{folder}/{name}"].attrs["unit"] = UNITS.get(name, "")


def write_mat73(path: Path, data=None) -> None:
    h5py = library("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in (data or DATA).items():
            file[name] = np.atleast_2d(value)
            file[name].attrs["unit"] = UNITS[name]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(126) + b"\x02IM")


def write_xlsx(path: Path, data=None) -> None:
    book = library("openpyxl").Workbook()
    rows = data or DATA
    book.active.append([f"{name} ({UNITS[name]})" for name in rows])
    for row in zip(*rows.values(), strict=True):
        book.active.append([each.item() if isinstance(each, np.generic) else each for each in row])
    book.save(path)


def write_mdf(path: Path, data=None) -> None:
    mdf = library("asammdf")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with mdf.MDF(version="4.10") as file:
            rows = dict(data or DATA)
            time = rows.pop("time")
            file.append([mdf.Signal(value, time, unit=UNITS[name], name=name) for name, value in rows.items()])
            file.save(path, overwrite=True)


def write_tdms(path: Path, data=None) -> None:
    tdms = library("nptdms")
    with tdms.TdmsWriter(path) as file:
        for name, value in (data or DATA).items():
            if name != "time":
                clock = {"wf_increment": 0.125, "wf_start_offset": 0.0, "unit_string": UNITS[name]}
                file.write_segment([tdms.ChannelObject("bench", name, value, properties=clock)])


def write_uff(path: Path, data=None, binary: int = 0) -> None:
    pyuff = library("pyuff")
    for name, value in (data or DATA).items():
        if name != "time":
            one: dict[str, object] = {"type": 58, "func_type": 1, "binary": binary, "data": value, "x": TIME}
            one |= {"ord_data_type": 4, "num_pts": len(value), "z_axis_value": 0.0, "id1": name, "rsp_node": 1}
            one |= dict.fromkeys(("rsp_dir", "ref_node", "ref_dir"), 1) | {"ver_num": 0, "load_case_id": 0}
            one |= dict.fromkeys(("rsp_ent_name", "ref_ent_name", "id2", "id3", "id4", "id5"), "NONE")
            one |= {"abscissa_spacing": 1, "abscissa_min": 0.0, "abscissa_inc": 0.125}
            axes = {"abscissa": (17, "s"), "ordinate": (0, UNITS[name]), "orddenom": (0, ""), "z_axis": (0, "")}
            for axis, (kind, unit) in axes.items():
                one |= {f"{axis}_spec_data_type": kind, f"{axis}_axis_units_lab": unit, f"{axis}_axis_lab": "NONE"}
                one |= {f"{axis}_{each}_unit_exp": 0 for each in ("len", "force", "temp")}
            pyuff.UFF(str(path)).write_sets([one], "add")


def write_uff_binary(path: Path) -> None:
    write_uff(path, binary=1)


def write_csv(path: Path, data=None) -> None:
    rows = data or DATA
    lines = [";".join(map(repr, row)) for row in zip(*(each.tolist() for each in rows.values()), strict=True)]
    path.write_text("\n".join([";".join(f"{name} [{UNITS[name]}]" for name in rows), *lines]))


WRITERS: dict[str, Callable[..., None]] = {
    "bench.csv": write_csv,
    "bench.h5": write_hdf,
    "bench.mat": write_mat73,
    "bench.xlsx": write_xlsx,
    "bench.mf4": write_mdf,
    "bench.tdms": write_tdms,
    "bench.uff": write_uff,
    "bench.unv": write_uff_binary,
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_a_library_wrote_is_read_with_its_units(tmp_path, name) -> None:
    WRITERS[name](tmp_path / name)
    table = read_table(tmp_path / name, WANTED)
    np.testing.assert_allclose(table["time"].values(), TIME, rtol=1e-11)
    np.testing.assert_allclose(table["torque"].values(), 1000.0 * TORQUE, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(table["speed"].values(), SPEED * np.pi / 30.0, rtol=1e-11)


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_readers_serve_records(tmp_path, name) -> None:
    """The columns of a CSV file have their units in their names."""
    WRITERS[name](tmp_path / name)
    columns = {"time": "time", "acceleration": "torque", "speed": "n"}
    if name.endswith(".csv"):
        columns = {"time": "time [s]", "acceleration": "torque [kN m]", "speed": "n [1/min]"}
    found = gw.measure.read_measurement(tmp_path / name, columns, speed_scale=np.pi / 30.0)
    np.testing.assert_allclose(found.acceleration, TORQUE, rtol=1e-11, atol=1e-12)
    assert found.speed is not None
    np.testing.assert_allclose(found.speed, SPEED * np.pi / 30.0, rtol=1e-11)


def test_other_sets_of_a_universal_file_are_passed_over(tmp_path) -> None:
    path = tmp_path / "bench.uff"
    write_uff(path)
    other = "    -1\n  2414\nwhat the library cannot read\n    -1\n"
    path.write_text(other + path.read_text() + other)
    assert len(read_table(path, WANTED)) == 64


def test_units_of_a_mat_file_are_said_in_the_model_file(tmp_path) -> None:
    """It has none; a unit that is said where the file has another is an error with both."""
    write_mat(tmp_path / "r.mat", {"M": TORQUE})
    wanted = WantedColumn("torque", QuantityKind.TORQUE, name="M (kN m)", key="column")
    np.testing.assert_allclose(read_table(tmp_path / "r.mat", [wanted])["torque"].values(), 1000.0 * TORQUE)
    with pytest.raises(ModelError, match=r"'M' has no unit; .* or column = \"M \(N m\)\""):
        read_table(tmp_path / "r.mat", [WantedColumn("torque", QuantityKind.TORQUE, name="M", key="column")])
    write_hdf(tmp_path / "r.h5")
    for written, told in (
        (
            "torque (N m)",
            r"the unit kN m in the file, but column = 'torque \(N m\)' says N m; write column = \"torque\"",
        ),
        ("n", "1/min is the unit of|rpm is the unit of a rate|rpm is the unit of a frequency"),
        ("tourque", "no column 'tourque' for torque; columns are n \\(1/min\\), time \\(s\\), torque"),
    ):
        with pytest.raises(ModelError, match=told):
            read_table(tmp_path / "r.h5", [WantedColumn("torque", QuantityKind.TORQUE, name=written, key="column")])


def test_several_channels_that_may_be_meant_are_listed(tmp_path) -> None:
    h5py = library("h5py")
    with h5py.File(tmp_path / "r.h5", "w") as file:
        for name in ("run1/left", "run1/right", "run2/left"):
            file[name] = TORQUE
            file[name].attrs["unit"] = "N m"
    torque = WantedColumn("torque", QuantityKind.TORQUE, key="column")
    with pytest.raises(
        ModelError,
        match=r"3 channels may be torque: 'run1/left', 'run1/right', 'run2/left'; name one: column = \"run1/left",
    ):
        read_table(tmp_path / "r.h5", [torque])
    named = WantedColumn("torque", QuantityKind.TORQUE, name="run1/right", key="column")
    assert read_table(tmp_path / "r.h5", [named])["torque"].head == "right (N m)"


def test_channels_of_different_rates_meet_at_the_times_of_the_finest(tmp_path) -> None:
    mdf, path = library("asammdf"), tmp_path / "r.mf4"
    coarse, fine = np.linspace(0.0, 8.0, 41), np.linspace(0.5, 8.5, 801)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with mdf.MDF(version="4.10") as file:
            file.append([mdf.Signal(1500.0 + 100.0 * coarse, coarse, unit="rpm", name="n")])
            file.append([mdf.Signal(np.sin(fine), fine, unit="Nm", name="M")])
            file.save(path, overwrite=True)
    table = read_table(path, WANTED)
    time = fine[fine <= 8.0]
    np.testing.assert_allclose(table["time"].values(), time)
    np.testing.assert_allclose(table["torque"].values(), np.sin(time))
    np.testing.assert_allclose(table["speed"].values(), (1500.0 + 100.0 * time) * np.pi / 30.0)


def matrices(path: Path) -> None:
    h5py = library("h5py")
    with h5py.File(path, "w") as file:
        file["m"] = np.column_stack((TIME, TORQUE))
        file["record"] = np.array(list(zip(TIME, TORQUE, strict=True)), dtype=[("t", "f8"), ("M", "f4")])


def test_columns_and_fields_of_an_hdf5_file_are_channels(tmp_path) -> None:
    matrices(tmp_path / "r.h5")
    with open_channels(tmp_path / "r.h5", "") as file:
        found = {f"{head.group}/{head.name}": file.read(place) for place, head in enumerate(file.heads)}
    assert list(found) == ["m/1", "m/2", "record/t", "record/M"]
    np.testing.assert_array_equal(found["m/2"], TORQUE)
    np.testing.assert_allclose(found["record/M"], TORQUE, rtol=1e-6)


def test_an_hdf5_file_that_names_other_files_does_not_open_them(tmp_path) -> None:
    h5py = library("h5py")
    (tmp_path / "secret").write_bytes(b"12345678")
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.create_dataset("torque", (1,), dtype="f8", external=[(str(tmp_path / "secret"), 0, 8)])
        file["linked"] = h5py.ExternalLink(str(tmp_path / "secret"), "/x")
    with open_channels(tmp_path / "r.h5", "") as held:
        assert [(head.name, head.problem) for head in held.heads] == [
            ("torque", "is stored in other files, which are not read")
        ]


def refused(path: Path) -> str:
    with pytest.raises(ModelError) as error:
        read_table(path, WANTED)
    assert str(error.value).startswith(f"{path.name}: ")
    return str(error.value)


def test_channels_of_unequal_length_and_no_numbers_are_refused(tmp_path) -> None:
    write_hdf(tmp_path / "r.h5", {**DATA, "torque": TORQUE[:60]})
    assert "torque has 60 samples, but n has 64 samples; channels that belong together" in refused(tmp_path / "r.h5")
    write_hdf(tmp_path / "r.h5", {**DATA, "torque": np.where(TIME == 1.0, np.nan, TORQUE)})
    assert "sample 9: torque is not a finite number; cut the record there" in refused(tmp_path / "r.h5")
    h5py = library("h5py")
    write_hdf(tmp_path / "r.h5", {"time": TIME, "n": SPEED})
    with h5py.File(tmp_path / "r.h5", "a") as file:  # an object of Python, as some programs keep it
        held = np.frombuffer(pickle.dumps({"torque": os.getcwd}), dtype="u1")
        file.create_dataset("bench/torque", data=np.array(held.tobytes().hex(), dtype=h5py.string_dtype()))
    assert "the channel 'torque' holds texts or objects, which are not read" in refused(tmp_path / "r.h5").replace(
        "the column 'torque' has no unit", "the channel 'torque' holds texts or objects, which are not read"
    )
    savemat(tmp_path / "r.mat", {"time": TIME, "torque (N m)": 1, "x": np.array([{"a": 1}], dtype=object)})
    assert "no column" in refused(tmp_path / "r.mat")


@keeps("bench.h5-3", "bench.tdms-3")
@pytest.mark.parametrize("count", [3, in_campaign(200)])
@pytest.mark.parametrize("name", [name for name in WRITERS if name != "bench.csv"])
def test_damaged_files_are_refused_and_nothing_worse(tmp_path, name, count) -> None:
    path, random = tmp_path / name, np.random.default_rng(3)
    WRITERS[name](path)
    whole = path.read_bytes()
    for turn in range(count):
        content = bytearray(whole)
        for place in random.integers(0, len(whole), 3):
            content[place] = random.integers(256)
        path.write_bytes(content[: len(content) if turn % 3 else int(random.integers(1, len(content)))])
        told = f"{name}: "
        try:
            read_table(path, WANTED)
        except ModelError as error:
            told = str(error)
        assert told.startswith(f"{name}: ")
        assert told.isprintable()


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("r.mat", b"time;M\n1;2\n", "begins as a text file ('time;M'); give it the ending .csv"),
        ("r.mat", b"\0\0\0\0\x0a\0\0\0", "not those of a MAT file of MATLAB up to version 7; a MAT file of version 4"),
        ("r.csv", b"TDSm\x0e\0\0\0", "ends in .csv, as that of a text file, but it begins as a TDMS file of LabVIEW"),
        ("r.xlsx", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "ends in .xlsx, as that of a workbook of Excel"),
        ("r.mf4", b"", "it is empty"),
        ("r.tdms", b"TDSm", "it is a TDMS file of LabVIEW without any channel"),
        ("r.h5", b"\x89HDF\r\n\x1a\n" + b"\0" * 40, "it is an HDF5 file that cannot be read"),
    ],
)  # fmt: skip
def test_a_name_that_says_another_format_is_refused(tmp_path, name, content, told) -> None:
    library({"r.tdms": "nptdms", "r.h5": "h5py"}.get(name, "numpy"))
    (tmp_path / name).write_bytes(content)
    assert told in refused(tmp_path / name)


def test_a_workbook_that_unpacks_to_too_much_is_refused(tmp_path) -> None:
    library("openpyxl")
    path = tmp_path / "bomb.xlsx"
    write_xlsx(path)
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open("xl/sharedStrings2.xml", "w") as part,
    ):
        for _ in range(300):
            part.write(b" " * 1_000_000)
    assert path.stat().st_size < 400_000
    assert "it unpacks to 300 MB, 300 MB of them texts; a workbook may have 200 MB" in refused(path)


def test_rows_of_a_workbook_are_named(tmp_path) -> None:
    write_xlsx(tmp_path / "r.xlsx", {**DATA, "n": ["x" if each == 1.0 else 3.0 for each in TIME]})
    assert "row 10: n is 'x'; it must be a number" in refused(tmp_path / "r.xlsx")


MEASURE = """
import resource, sys
from gapwalk.errors import ModelError
from gapwalk.model.measured.measured_table import WantedColumn, read_table
from gapwalk.model.units import QuantityKind
wanted = [WantedColumn("torque", QuantityKind.TORQUE, name=sys.argv[2], key="column")]
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    told = f"{len(read_table(sys.argv[1], wanted, most=4_000_000))} samples"
except ModelError as error:
    told = str(error)
own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) // 1024, told)
"""


def measure(path: Path, column: str) -> tuple[int, str]:
    """Read a file in a process of its own; return how many MB that took at most, and what was said."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path), column], capture_output=True, text=True, check=True, timeout=300
    )
    size, _, told = done.stdout.partition(" ")
    return int(size), told.strip()


def sparse(path: Path, head: bytes, size: int) -> Path:
    with path.open("wb") as file:
        file.write(head)
        file.truncate(size)
    return path


UFF_HEAD = b"    -1\n    58\n" + b"name\n" * 11
HEADS = {
    "r.csv": b"time (s);torque (N m)\n0;1\n",
    "r.mat": b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + b"\x0e\0\0\0\xff\xff\xff\x3f",
    "r.h5": b"\x89HDF\r\n\x1a\n",
    "r.tdms": b"TDSm\x0e\0\0\0",
    "r.mf4": b"MDF     4.10    ",
    "r.xlsx": b"PK\x03\x04",
    "r.uff": UFF_HEAD,
}


@pytest.mark.parametrize("name", HEADS)
def test_no_memory_is_taken_to_refuse_a_file_of_a_gigabyte(tmp_path, name) -> None:
    library({"r.tdms": "nptdms", "r.mf4": "asammdf", "r.uff": "pyuff", "r.xlsx": "openpyxl"}.get(name, "h5py"))
    whole = 300_000_000 if name == "r.uff" else 1_200_000_000  # a UFF file is searched for its sets
    size, told = measure(sparse(tmp_path / name, HEADS[name], whole), "M")
    assert told.startswith(f"{name}: ")
    assert size < 250, told  # the process with the library, of which asammdf with pandas takes most


def test_a_channel_of_a_large_file_is_read_alone(tmp_path) -> None:
    """Of 1.6 GB, 16 MB."""
    h5py, path = library("h5py"), tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        for number in range(100):  # space that nothing was written to is read as zeros
            file.create_dataset(f"c{number}", shape=(2_000_000,), dtype="f8", chunks=None)[-1] = 1.0
            file[f"c{number}"].attrs["unit"] = "N m"
    assert path.stat().st_size > 1_600_000_000
    size, told = measure(path, "c42")
    assert told == "2000000 samples"
    assert size < 200


@pytest.mark.slow
@pytest.mark.parametrize("name", ["r.mf4", "r.tdms", "r.uff", "r.mat", "r.h5"])
def test_a_channel_of_a_gigabyte_of_numbers_is_read_alone(tmp_path, name) -> None:
    """Sixty-six channels of 2,000,000 numbers: 1.06 GB, of which one is read."""
    path, numbers = tmp_path / name, np.arange(2_000_000.0)
    if name == "r.mf4":
        mdf = library("asammdf")
        with mdf.MDF(version="4.10") as file:
            for number in range(66):
                file.append([mdf.Signal(numbers, numbers * 1e-4, unit="N m", name=f"c{number}")])
            file.save(path, overwrite=True)
    elif name == "r.tdms":
        tdms = library("nptdms")
        with tdms.TdmsWriter(path) as file:
            for number in range(66):
                properties = {"unit_string": "N m"}
                file.write_segment([tdms.ChannelObject("g", f"c{number}", numbers, properties=properties)])
    elif name == "r.uff":
        UNITS["c00"] = "N m"
        write_uff(path, {"c00": numbers}, binary=1)
        one = path.read_bytes()
        with path.open("wb") as file:  # the library would read all of it before each set
            for number in range(66):
                file.write(one.replace(b"c00", b"c%02d" % number, 1))
    elif name == "r.mat":
        savemat(path, {f"c{number}": numbers for number in range(66)})
    else:
        UNITS.update({f"c{number}": "N m" for number in range(66)})
        write_hdf(path, {f"c{number}": numbers for number in range(66)})
    assert path.stat().st_size > 1_050_000_000
    size, told = measure(path, "c42 (N m)")
    assert told == "2000000 samples"
    assert size < 300


def test_formats_register(tmp_path) -> None:
    assert set(FORMATS.names) >= {"mat", "hdf", "workbook", "mdf", "tdms", "uff"}
    assert {".csv", ".mat", ".h5", ".xlsx", ".mf4", ".tdms", ".uff"} <= {*endings()}


def test_a_missing_library_is_a_sentence_with_what_to_install(tmp_path, monkeypatch) -> None:
    (tmp_path / "r.tdms").write_bytes(b"TDSm")
    monkeypatch.setitem(sys.modules, "nptdms", None)
    told = refused(tmp_path / "r.tdms")
    assert 'a TDMS file of LabVIEW, which needs nptdms; install it: pip install "gapwalk[files]", or write' in told
