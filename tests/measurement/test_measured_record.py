"""Records, and their files: what is read, and what is refused with a sentence that helps."""

import tracemalloc
from contextlib import suppress

import numpy as np
import pytest
from scipy.io import savemat

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.measurement.measured_record import MAX_SAMPLES
from gapwalk.model.channels.channel_file import open_channels

TIME = np.arange(40) * 0.1


def write(tmp_path, text: str):
    path = tmp_path / "r.csv"
    path.write_text(text)
    return path


def rows(*lines: str, head: str = "time,acceleration", count: int = 20) -> str:
    """A file that is right but for the lines that are given."""
    own = dict(line.split(":", 1) for line in lines)
    return "\n".join([head, *(own.get(str(i), f"{i / 10},{i % 7}") for i in range(count))]) + "\n"


def test_a_csv_file_is_read_with_its_own_names_and_units(tmp_path) -> None:
    text = "# a comment\n t [ms] ; n [rpm];a3\n" + "".join(f"{100 * i};3000;{i}.5e1\n" for i in range(20)) + "\n\n"
    path = write(tmp_path, text)
    names = {"time": "t [ms]", "acceleration": "a3", "speed": "n [rpm]"}
    found = gw.measure.read_measurement(path, names, time_scale=1e-3, scale=0.1, speed_scale=2 * np.pi / 60)
    np.testing.assert_allclose(found.time, np.arange(20) * 0.1)
    np.testing.assert_allclose(found.acceleration, np.arange(20) + 0.5)
    assert found.speed is not None
    np.testing.assert_allclose(found.speed, 100 * np.pi)
    assert (found.name, len(found)) == ("r.csv", 20)


def test_decimal_commas_are_read_where_commas_do_not_separate(tmp_path) -> None:
    text = rows(count=20)
    with_points = gw.measure.read_measurement(write(tmp_path, text))
    with_commas = gw.measure.read_measurement(write(tmp_path, text.replace(",", ";").replace(".", ",")))
    np.testing.assert_array_equal(with_commas.time, with_points.time)
    np.testing.assert_array_equal(with_commas.acceleration, with_points.acceleration)
    mixed = text.replace(",", ";").replace(".", ",").replace("0,3;", "0.3;")
    with pytest.raises(ModelError, match=r"line 5: time is '0\.3', but line 2 has '0,0'; write all numbers with a"):
        gw.measure.read_measurement(write(tmp_path, mixed))


@pytest.mark.parametrize("shape", [(40,), (1, 40), (40, 1)])
def test_a_mat_file_gives_the_same_record(tmp_path, shape) -> None:
    path = tmp_path / "r.mat"
    vectors = {"time": TIME.reshape(shape), "a": np.sin(TIME).reshape(shape), "speed": np.ones(shape)}
    savemat(path, {**vectors, "more": {"x": 1}}, do_compression=True)
    found = gw.measure.read_measurement(path, {"acceleration": "a"})
    np.testing.assert_array_equal(found.time, TIME)
    np.testing.assert_array_equal(found.acceleration, np.sin(TIME))
    assert found.speed is not None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "it is empty; the first line names the columns"),
        ("1,2\n3,4\n", "its first line holds numbers; it must name the columns"),
        (rows(head="time,accel"), "no column 'acceleration' for acceleration; did you mean accel"),
        (rows(head="t,acceleration"), "no column 'time' for time"),
        (rows("3:0.3,x"), "line 5: acceleration is 'x'; it must be a number"),
        (rows("3:0.3"), "line 5: acceleration is missing; every line must have as many entries"),
        (rows("3:0.3,nan"), "acceleration is not a finite number in sample 4; cut the record there"),
        (rows("3:0.3,1e999", "5:0.5,inf"), r"not a finite number in sample 4 \(2 in all\)"),
        (rows("3:0.1,1"), r"time does not increase from sample 3 \(0.2\) to sample 4 \(0.1\)"),
        (rows("3:0.34,1"), r"time is uneven: its steps are 0.1, but 0.14 from sample 3 to sample 4 \(2 such steps\)"),
        (rows(count=5), "it has 5 samples; a record has 16 to 200,000"),
        (rows("3:0.3,1,5"), "line 5: it has 3 entries, but the first line names 2 columns; with decimal commas"),
        (rows("3:0.3,1_5"), "line 5: acceleration is '1_5'; it must be a number"),
        ('time,"acc\n1,2\n', "no column 'acceleration'"),
        ("\0time\n\0", "no column 'time'"),
    ],
)
def test_a_csv_file_that_makes_no_record_is_refused(tmp_path, text, told) -> None:
    with pytest.raises(ModelError, match=rf"^r\.csv: .*{told}"):
        gw.measure.read_measurement(write(tmp_path, text))


def test_files_that_are_no_records_are_refused(tmp_path) -> None:
    with pytest.raises(ModelError, match="cannot be read: No such file"):
        gw.measure.read_measurement(tmp_path / "none.csv")
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="not UTF-8 text"):
        gw.measure.read_measurement(tmp_path / "x.csv")
    for content, told in (
        (b"MATLAB 5.0 MAT-file" + b"\x01" * 300, r"its name ends in \.mat, as that of a MAT file .* as a text file"),
        (b"MATLAB 7.3 MAT-file, by" + b" " * 300, "it is an HDF5 file that cannot be read"),
        (b" " * 126 + b"IM" + b"\x0e\x00\x00\x00\x10\x00\x00\x00", "a MAT file .* that cannot be read"),
        (b"time,acceleration\n1,2\n", r"it begins as a text file \('time,acceleration'\); give it the ending \.csv"),
    ):
        (tmp_path / "x.mat").write_bytes(content)
        with pytest.raises(ModelError, match=told):
            gw.measure.read_measurement(tmp_path / "x.mat")
    with pytest.raises(ModelError, match="a record has no column 'accelaration'; did you mean acceleration"):
        gw.measure.read_measurement(tmp_path / "x.csv", {"accelaration": "a"})


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (np.ones((5, 8)), r"of class double and shape \(5, 8\), and no vector of real numbers"),
        (np.ones(40) + 1j, "of class complex double"),
        ("words", "of class char"),
        ({"x": 1.0}, "of class struct"),
        (np.zeros(MAX_SAMPLES + 1, dtype=np.int8), "has 200,001 samples; give at most 200,000"),
        (np.ones(39), "time has 40 samples, but acceleration has 39 samples"),
    ],
)
def test_a_mat_file_with_something_else_is_refused_before_it_is_unpacked(tmp_path, value, told) -> None:
    path = tmp_path / "r.mat"
    savemat(path, {"time": TIME, "acceleration": value}, do_compression=True)
    with pytest.raises(ModelError, match=rf"^r\.mat: .*{told}"):
        gw.measure.read_measurement(path)


@pytest.mark.parametrize("compressed", [True, False])
def test_numbers_of_every_class_are_those_that_scipy_wrote(tmp_path, compressed) -> None:
    """Its reader is the usual one, but damaged files make it crash."""
    kinds = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
    written = {f"a_{kind}_{'x' * place}": np.arange(3 + place).astype(kind) for place, kind in enumerate(kinds)}
    path = tmp_path / "r.mat"
    savemat(path, {**written, "text": "words", "cell": np.array([1, "a"], dtype=object)}, do_compression=compressed)
    with open_channels(path, "") as file:
        names = [head.name for head in file.heads]
        assert set(names) == {*written, "text", "cell"}
        for name, values in written.items():
            assert file.heads[names.index(name)].count == len(values)
            np.testing.assert_array_equal(file.read(names.index(name)), values)


@pytest.mark.parametrize("compressed", [True, False])
def test_damaged_files_are_refused_and_nothing_worse(tmp_path, compressed) -> None:
    path, random = tmp_path / "r.mat", np.random.default_rng(1)
    savemat(path, {"time": TIME, "acceleration": np.sin(TIME), "more": {"x": 1}}, do_compression=compressed)
    whole = path.read_bytes()
    for _ in range(300):
        content = bytearray(whole)
        for place in random.integers(120, len(whole), random.integers(1, 4)):
            content[place] = random.integers(256)
        if random.random() < 0.2:
            del content[int(random.integers(100, len(whole))) :]
        path.write_bytes(content)
        with suppress(ModelError):
            assert len(gw.measure.read_measurement(path)) == 40


def test_a_small_file_cannot_fill_the_memory(tmp_path) -> None:
    """Forty million zeros in forty thousand bytes are unpacked to their head, and no further."""
    path = tmp_path / "r.mat"
    savemat(path, {"time": np.zeros(5_000_000), "acceleration": TIME}, do_compression=True)
    assert path.stat().st_size < 100_000
    tracemalloc.start()
    with pytest.raises(ModelError, match="time has 5,000,000 samples; give at most 200,000"):
        gw.measure.read_measurement(path)
    assert tracemalloc.get_traced_memory()[1] < 3_000_000
    tracemalloc.stop()


def test_everything_that_is_wrong_with_a_record_is_said_at_once() -> None:
    with pytest.raises(ModelError) as error:
        gw.measure.Record(TIME[::-1], np.full(40, np.nan), np.zeros(40))
    assert len(str(error.value).splitlines()) == 3
    with pytest.raises(ModelError, match=r"time has the shape \(2, 20\)"):
        gw.measure.Record(TIME.reshape(2, 20), TIME)
    with pytest.raises(ModelError, match="acceleration must be a list of numbers"):
        gw.measure.Record(TIME, ["a"] * 40)
    with pytest.raises(ModelError, match="the factor of time is -1"):
        gw.measure.Record(TIME, TIME).scaled(time=-1)


def test_angles_follow_the_measured_speed() -> None:
    speed = 3.0 + 0.02 * np.sin(TIME)
    record = gw.measure.Record(5.0 + TIME, TIME, speed)
    exact = 2.0 * (3.0 * TIME + 0.02 * (1 - np.cos(TIME)))
    np.testing.assert_allclose(record.angles(6.0, 2.0), exact, atol=1e-4)
    assert record.frequency(2.0) == pytest.approx(float(exact[-1] / TIME[-1]), rel=1e-5)
    with pytest.raises(ModelError, match=r"corresponds to an excitation frequency of 3\.00884, but the motion has 6"):
        record.angles(6.0)
    plain = gw.measure.Record(5.0 + TIME, TIME).between(6.0, 8.0)
    np.testing.assert_allclose(plain.angles(0.5), 0.5 * (plain.time - plain.time[0]))
    assert plain.frequency() is None
    assert 19 <= len(plain) <= 21
