"""Measured tables: texts against numbers converted by hand, and what is refused with a sentence that helps."""

import io
import math
import os
import tracemalloc

import numpy as np
import pytest

from gapwalk.errors import ModelError
from gapwalk.model.channels import channel_file
from gapwalk.model.measured.measured_table import WantedColumn, read_table
from gapwalk.model.units import QuantityKind, Unit
from tests.tiers import in_campaign

DEGREE = math.pi / 180.0
DEFLECTION = WantedColumn("deflection", QuantityKind.ANGLE, ("angle", "twist"))
TORQUE = WantedColumn("torque", QuantityKind.TORQUE)
CURVE = (DEFLECTION, TORQUE)
PLAIN = (WantedColumn("deflection", None, ("x",)), WantedColumn("force", None))


def read(text: str, wanted=CURVE):
    return read_table(io.StringIO(text), wanted)


@pytest.mark.parametrize(
    "text",
    [
        "deflection (deg), torque (N m)\n-2, -1500\n0.5, 250\n",
        "deflection [deg]; torque [Nm]\r\n-2;-1500\r\n0,5;250,0\r\n\r\n",
        "torque [kN m]\tdeflection [deg]\r-1,5\t-2\r0.25\t0.5\r".replace("0.25\t0.5", "0,25\t0,5"),
        "\ufeff# clutch 4711\n\n M (kN m) , phi (°), note\n# loading\n-1.5, -2, a\n.25e0, 0.5, b\n",
        '"phi (deg)","T, static (N m)",T_max\n"-2","-1500",9\n"0.5","250",9\n',
        "time (s),torque (N m),x (mrad/s),deflection (deg)\n1,-1500,1,-2\n2,250,1,0.5\n",
        "Deflection (deg),Torque (N m)\n-2,-1500,\n0.5,250,,\n",
    ],
)
def test_columns_are_found_by_their_quantity(text: str) -> None:
    table = read(text)
    np.testing.assert_allclose(table["deflection"].values(), [-2.0 * DEGREE, 0.5 * DEGREE], rtol=1e-14)
    np.testing.assert_allclose(table["torque"].values(), [-1500.0, 250.0], rtol=1e-14)
    np.testing.assert_array_equal(table["deflection"].values(Unit("deg", DEGREE)), [-2.0, 0.5])
    quantity = table["deflection"].quantity
    assert quantity is not None
    assert (quantity.unit, quantity.kind) == ("deg", QuantityKind.ANGLE)
    assert len(table) == 2


def test_columns_are_found_by_name_among_several() -> None:
    text = "time (s),angle (deg),shaft (deg),M1 (N m),torque (N m)\n0,1,2,3,4\n"
    table = read(text)
    assert (table["deflection"].head, table["torque"].head) == ("angle (deg)", "torque (N m)")
    named = (
        WantedColumn("deflection", QuantityKind.ANGLE, name="shaft"),
        WantedColumn("torque", TORQUE.kind, name="m1"),
    )
    table = read(text, named)
    assert (table["deflection"].head, table["torque"].head) == ("shaft (deg)", "M1 (N m)")
    table = read(text, (DEFLECTION, WantedColumn("turn", QuantityKind.PHASE, name="shaft (deg)")))
    assert (table["deflection"].head, table["turn"].head) == ("angle (deg)", "shaft (deg)")


def test_kinds_that_only_tables_have() -> None:
    wanted = (WantedColumn("time", QuantityKind.TIME), WantedColumn("acceleration", QuantityKind.ACCELERATION))
    table = read("t (ms), a (deg/s^2)\n2, 90\n", wanted)
    np.testing.assert_allclose([table["time"].values()[0], table["acceleration"].values()[0]], [2e-3, math.pi / 2])
    speed = (WantedColumn("speed", QuantityKind.FREQUENCY),)
    np.testing.assert_allclose(read("n (rpm)\n600\n", speed)["speed"].values(), 20.0 * math.pi)


def test_plain_numbers_are_for_models_without_units() -> None:
    table = read("X, Force\n1, 2\n", PLAIN)
    assert table["deflection"].values()[0] == 1.0
    assert table["force"].unit is table["force"].quantity is None
    assert read("force [-], x []\n1, 2\n", PLAIN)["force"].numbers[0] == 1.0


@pytest.mark.parametrize(
    ("text", "wanted", "words"),
    [
        ("", CURVE, r"it is empty; the first line names the columns, as in deflection \(deg\), torque \(N m\)"),
        ("# a (deg)\n1,2\n", CURVE, "its first line holds numbers; .*a line that begins with # is a comment"),
        ("deflection (deg), torque (N m)\n", CURVE, "no numbers below it"),
        (
            "deflection, torque (N m)\n1,2\n",
            CURVE,
            r"'deflection' has no unit; write an angle as in deflection \(deg\)",
        ),
        ("a (deg), torque\n1,2\n", CURVE, r"the column 'torque' has no unit; write a torque as in torque \(N m\)"),
        ("deflection (mm), torque (N m)\n1,2\n", CURVE, "a length; an angle is expected, as in deflection"),
        ("deflection (deg), torque (N m/deg)\n1,2\n", CURVE, "the unit of a stiffness; a torque is expected"),
        ("deflection (furlong), torque (N m)\n1,2\n", CURVE, "there is no unit 'furlong' here"),
        ("deflection (deg), force (N)\n1,2\n", CURVE, "no column 'torque' with the unit of a torque; columns are"),
        (
            "a (deg), b (rad), M (N m)\n1,2,3\n",
            CURVE,
            r"2 columns may be deflection: 'a \(deg\)' and 'b \(rad\)'. Name",
        ),
        ("x (deg), x (deg), M (N m)\n1,2,3\n", (WantedColumn("y", DEFLECTION.kind, name="x"),), "2 columns may be y"),
        (
            "x (deg), M (N m)\n1,2\n",
            (WantedColumn("y", DEFLECTION.kind, name="z", key="column"),),
            "no column 'z' for y",
        ),
        ("x (deg)\n1\n", (DEFLECTION, WantedColumn("turn", QuantityKind.PHASE, key="turn")), 'Name it: turn = "..."'),
        ("x (deg)\n1\n", tuple(WantedColumn(r, DEFLECTION.kind, name="x") for r in "ab"), "cannot be b and something"),
        ("x (mm), force\n1,2\n", PLAIN, "has the unit mm, but this model has no units; convert .* and name it x"),
        ("x (deg), M (N m)\n1,2\n3,nan\n", CURVE, r"line 3: M is not a finite number; leave out its line"),
        ("x (deg), M (N m)\n1,1e999\n3,inf\n", CURVE, r"line 2: M is not a finite number \(2 such entries\)"),
        ("x (deg), M (N m)\n# c\n\n1,two\n", CURVE, "line 4: M is 'two'; it must be a number"),
        ("x (deg), M (N m)\n1,\n", CURVE, "line 2: M is missing"),
        (
            "x (deg), M (N m)\n1,2,3\n",
            CURVE,
            "line 2: it has 3 entries, but the first line names 2 columns; with decimal",
        ),
        ("x (deg); M (N m)\n1,5;2.5\n", CURVE, "line 2: M is '2.5', but line 2 has '1,5'; write all numbers"),
        ("x (deg); M (N m)\n1;2.000,5\n", CURVE, "it must be a number, without separators of thousands"),
        ("x (deg); M (N m)\n1;2_000\n", CURVE, "M is '2_000'"),
        ("x (deg); M (N m)\n1;0x10\n", CURVE, "M is '0x10'"),
        ('x (deg), M (N m)\n1,"2\n', CURVE, "line 2: it cannot be divided into entries: unexpected end"),
        ("x (deg), \x1b[2J (N m), M (N m)\n1,2,3\n", CURVE, r"\\x1b"),
    ],
)
def test_what_cannot_be_read_is_said(text: str, wanted, words: str) -> None:
    with pytest.raises(ModelError, match=words) as caught:
        read(text, wanted)
    assert str(caught.value).startswith("the table: ")
    assert str(caught.value).isprintable()


def test_files_are_bounded_and_named(tmp_path) -> None:
    path = tmp_path / "clutch.csv"
    path.write_text("x (deg), M (N m)\n1,2\n")
    assert read_table(path, CURVE).name == "clutch.csv"
    path.write_text("x (deg), M (N m)\n" + "1,2\n" * channel_file.MAX_ROWS)
    assert len(read_table(path, CURVE)) == channel_file.MAX_ROWS
    for content, words in (
        (b"x (deg), M (N m)\n" + b"1,2\n" * (channel_file.MAX_ROWS + 1), "more than 100,000 rows; leave out rows"),
        (b"0" * (channel_file.MAX_BYTES + 1), "larger than 10 MB"),
        (b"x (\xb0), M (N m)\n1,2\n", "line 1: it is not UTF-8 text .byte 0xb0.; save it as CSV in UTF-8"),
        ("x (deg), M (N m)\n1,2\n".encode("utf-16"), "not UTF-8 text"),
        (b"a," * 2000 + b"\n1", "line 1: it names more than 1,000 columns"),
        (b'"' + b"a" * 200_000 + b'",b\n1,2', "line 1: it is not a line of column names: field larger"),
    ):
        path.write_bytes(content)
        with pytest.raises(ModelError, match=rf"^clutch\.csv: .*{words}"):
            read_table(path, CURVE)
    with pytest.raises(ModelError, match=r"none\.csv: it cannot be read: No such file"):
        read_table(tmp_path / "none.csv", CURVE)
    with pytest.raises(ModelError, match="cannot be read: Is a directory"):
        read_table(tmp_path, CURVE)
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ModelError, match="a pipe or a device"):
        read_table(tmp_path / "pipe.csv", CURVE)


@pytest.mark.parametrize(
    "content", [in_campaign(b"\n" * 9_000_000), b"x (deg)\n" + b"0\n" * 4_000_000, b"x (deg)\n1" + b",1" * 4_000_000]
)
def test_a_hostile_file_takes_little_memory(tmp_path, content) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(ModelError):
            read_table(path, CURVE[:1])
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("seed", range(100))
def test_damaged_texts_are_refused_and_nothing_worse(seed: int) -> None:
    random = np.random.default_rng(seed)
    text = list("deflection (deg); torque (N m)\n1,5;2\n-3;4e2\n")
    for place in random.integers(len(text), size=random.integers(1, 6)):
        text[place] = str(random.choice(list('";,.()[]\n\r\0#e-1é\t/^ ')))
    try:
        table = read("".join(text))
    except ModelError:
        return
    assert all(np.isfinite(column.values()).all() for column in table.columns.values())
