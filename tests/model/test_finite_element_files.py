"""Matrices of finite-element programs: read to the bit, named by node and direction, with closed-form frequencies.

tests/data/dense.op4 and sparse.op4 were written by pyNastran 1.4.1.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import hb_write, mmwrite
from scipy.linalg import eigh
from scipy.sparse import csc_array

from gapwalk.errors import ModelError
from gapwalk.model.matrix_file import read_labelled, real, split_name
from gapwalk.studies.study_file import read_study

DATA = Path(__file__).parents[1] / "data"
Array = NDArray[np.float64]


def beam(elements: int = 12) -> tuple[Array, Array, list[tuple[int, int]]]:
    """Mass, stiffness and labels of a cantilever (E I = rho A = L = 1) by Hermite's elements, nodes in tens."""
    h = 1.0 / elements
    k = np.array([[12, 6 * h, -12, 6 * h], [0, 4 * h * h, -6 * h, 2 * h * h], [0, 0, 12, -6 * h], [0, 0, 0, 4 * h * h]])
    m = [[156, 22 * h, 54, -13 * h], [0, 4 * h * h, 13 * h, -3 * h * h], [0, 0, 156, -22 * h], [0, 0, 0, 4 * h * h]]
    size = 2 * elements + 2
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for first in range(0, size - 2, 2):
        part = slice(first, first + 4)
        mass[part, part] += (np.array(m) + np.triu(m, 1).T) * h / 420
        stiffness[part, part] += (k + np.triu(k, 1).T) / h**3
    return mass, stiffness, [(10 * (place // 2 + 1), 2 + 4 * (place % 2)) for place in range(size)]


MASS, STIFFNESS, LABELS = beam()
NAMES = tuple(f"n{node}_{'y' if dof == 2 else 'rz'}" for node, dof in LABELS)
FREE = slice(2, None)
CLAMPED = STIFFNESS.copy()
CLAMPED[0, 0] = CLAMPED[1, 1] = 1e36  # as Abaqus writes boundary conditions


def abaqus(matrix: Array, form: str) -> str:
    """Write a matrix as Abaqus does."""
    head = "** Assembled nodal matrix\n*MATRIX INPUT, NAME=K, TYPE=SYMMETRIC\n" if form == "matrix input" else ""
    lines = []
    for i, j in zip(*np.nonzero(matrix), strict=True):
        if form == "coordinate":
            lines.append(f"{i + 1:8d} {j + 1:8d}   {float(matrix[i, j])!r}")
        elif j <= i or form == "labels":
            (a, b), (c, d) = LABELS[i], LABELS[j]
            lines.append(f"{a},{b}, {c},{d}, {float(matrix[i, j])!r}")
    return head + "\n".join(lines) + "\n"


def dmig(matrix: Array, name: str, form: str, kind: int = 6) -> str:
    """Write DMIG cards: columns of 16 as in punch files, with commas, or columns of 8 (of few digits)."""
    size = len(matrix)
    lines = ["$ by a test", "GRID,10,,0.0,0.0,0.0"]
    wide = {
        "wide": f"DMIG    {name:8}{0:8d}{kind:8d}{2:8d}{0:8d}{'':16}{size:8d}",
        "free": f"DMIG,{name},0,{kind},2,0,,,{size}",
    }
    lines.append(wide.get(form, wide["wide"]))
    for j in range(size):
        rows = [i for i in range(j if kind == 6 else 0, size) if matrix[i, j]]
        if not rows:
            continue
        node, dof = LABELS[j]
        if form == "wide":
            lines.append(f"DMIG*   {name:16}{node:16d}{dof:16d}{'':16}*")
            lines += [
                f"*       {LABELS[i][0]:16d}{LABELS[i][1]:16d}{matrix[i, j]:16.9E}".replace("E", "D") for i in rows
            ]
        else:
            cells = [f"{LABELS[i][0]},{LABELS[i][1]},{float(matrix[i, j])!r},0.0" for i in rows]
            lines.append(f"DMIG,{name},{node},{dof},,{cells[0]}")
            lines += [f"+,{','.join(cells[k : k + 2])}" for k in range(1, len(cells), 2)]
    return "\n".join([*lines, "ENDDATA", ""])


@pytest.mark.parametrize("form", ["matrix input", "labels", "coordinate"])
def test_abaqus_writes_three_formats(form, tmp_path: Path) -> None:
    (tmp_path / "k.mtx").write_text(abaqus(STIFFNESS, form))
    read = read_labelled(str(tmp_path / "k.mtx"))
    assert read.matrix.tobytes() == STIFFNESS.tobytes()
    assert read.names == (() if form == "coordinate" else NAMES)


def test_of_a_symmetric_matrix_one_triangle_suffices_without_a_head(tmp_path: Path) -> None:
    lower = abaqus(STIFFNESS, "matrix input").split("\n", 2)[2]
    (tmp_path / "k.mtx").write_text(lower)
    assert read_labelled(str(tmp_path / "k.mtx")).matrix.tobytes() == STIFFNESS.tobytes()
    (tmp_path / "k.mtx").write_text(
        "*MATRIX INPUT, NAME=C, TYPE=UNSYMMETRIC, SCALE FACTOR=2.\n1,1,1,1,1.\n1,2,1,1,3.D0\n"
    )
    assert read_labelled(str(tmp_path / "k.mtx")).matrix.tolist() == [[2.0, 0.0], [6.0, 0.0]]


@pytest.mark.parametrize("form", ["wide", "free"])
@pytest.mark.parametrize("kind", [6, 1])
def test_cards_dmig(form, kind, tmp_path: Path) -> None:
    (tmp_path / "m.pch").write_text(dmig(STIFFNESS, "KAAX", form, kind) + dmig(MASS, "MAAX", form, kind))
    for name, matrix in (("KAAX", STIFFNESS), ("maax", MASS)):
        read = read_labelled(str(tmp_path / "m.pch"), name)
        np.testing.assert_allclose(read.matrix, matrix, rtol=0.0 if form == "free" else 5e-10)
        assert read.names == NAMES


def test_the_small_fields_of_the_quick_reference_guide(tmp_path: Path) -> None:
    (tmp_path / "m.bdf").write_text(
        "DMIG    STIF    0       6       1       0                      3\n"
        "DMIG    STIF    27      1               27      1       3.+5\n"
        "DMIG    STIF    27      3               27      1       2.5+4           \n"
        "        50      0       -1.-2\n"
    )
    read = read_labelled(str(tmp_path / "m.bdf"))
    assert read.names == ("n27_x", "n27_z", "n50")
    assert read.matrix.tolist() == [[3e5, 2.5e4, 0.0], [2.5e4, 0.0, -0.01], [0.0, -0.01, 0.0]]


@pytest.mark.parametrize("name", ["dense", "sparse"])
def test_op4_of_another_program_to_the_bit(name: str) -> None:
    chain = np.array([[2.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1]]) * 1.2345678901234567e6
    mass = np.diag([1.0, 2.0, 3.0, 4.0]) / 7
    mass[0, 1] = mass[1, 0] = 0.1 / 3
    assert read_labelled(str(DATA / f"{name}.op4"), "KAA").matrix.tobytes() == chain.tobytes()
    assert read_labelled(str(DATA / f"{name}.op4"), "maa").matrix.tobytes() == mass.tobytes()
    with pytest.raises(ValueError, match=r"holds the matrices KAA, MAA; name one, as in file.ext:KAA"):
        read_labelled(str(DATA / f"{name}.op4"))


@pytest.mark.parametrize("big", [False, True])
def test_op4_with_several_strings_in_a_column(big, tmp_path: Path) -> None:
    first, second = ("       3       1", "       5       3") if big else (str(1 + 65536 * 3), str(3 + 65536 * 5))
    rows = -4 if big else 4
    (tmp_path / "a.op4").write_text(
        f"{4:8d}{rows:8d}{1:8d}{2:8d}{'A':8}1P,3E23.16\n{1:8d}{0:8d}{8:8d}\n{first}\n{1.0:23.16E}\n{second}\n"
        f"{2.0:23.16E}{-3e-5:23.16E}\n{5:8d}{1:8d}{1:8d}\n{1.0:23.16E}\n"
    )
    assert read_labelled(str(tmp_path / "a.op4")).matrix[:, 0].tolist() == [1.0, 0.0, 2.0, -3e-5]


def test_harwell_boeing(tmp_path: Path) -> None:
    path = tmp_path / "k.rua"
    hb_write(path, csc_array(STIFFNESS))
    assert read_labelled(str(path)).matrix.tobytes() == STIFFNESS.tobytes()
    hb_write(path, csc_array(np.tril(STIFFNESS)))
    lines = path.read_text().splitlines()
    symmetric = tmp_path / "k.rsa"
    symmetric.write_text("\n".join([*lines[:2], lines[2].replace("RUA", "RSA"), *lines[3:], ""]))
    assert read_labelled(str(symmetric)).matrix.tobytes() == STIFFNESS.tobytes()
    path.write_text("\n".join([*lines[:2], lines[2].replace("RUA", "CUA"), *lines[3:], ""]))
    with pytest.raises(ValueError, match='type "CUA"; only real assembled matrices'):
        read_labelled(str(path))


STUDY = """
[[contact]]
name = "stop"
deflection = { n130_y = 1.0 }
clearance = 0.1
stiffness = 50.0
[[harmonic]]
order = 1
amplitude = 0.1
acts_on = { n130_y = 1.0 }
[study]
kind = "response"
parameter = "frequency"
from = 4.5
to = 3.0
"""


def model(folder: Path, top: str) -> Path:
    (folder / "k.mtx").write_text(abaqus(CLAMPED, "matrix input"))
    (folder / "m.mtx").write_text(abaqus(MASS, "labels"))
    (folder / "both.pch").write_text(dmig(STIFFNESS[FREE, FREE], "K", "free"))
    path = folder / "beam.toml"
    path.write_text(f'mass = "m.mtx"\nstiffness = "k.mtx"\ndamping = {{ ratios = 0.01 }}\n{top}{STUDY}')
    return path


def test_a_clamped_beam_has_the_frequencies_of_the_closed_form(tmp_path: Path) -> None:
    system = read_study(model(tmp_path, "")).system
    assert system.coordinates == NAMES[FREE]  # those with 1e36 are fixed
    assert system.matrix("stiffness").tobytes() == STIFFNESS[FREE, FREE].tobytes()
    found = np.sqrt(eigh(system.matrix("stiffness"), system.matrix("mass"), eigvals_only=True))[:3]
    exact = np.array([1.8751040687119611, 4.694091132974174, 7.854757438237613]) ** 2  # cos x cosh x = -1
    # elements of cubic polynomials are too stiff: by (wave number times length)^4 / 1440 in the frequency
    np.testing.assert_allclose(found / exact - 1, exact**2 / 12**4 / 1440, rtol=0.1)


def test_the_order_of_the_coordinates_is_that_of_the_model_file(tmp_path: Path) -> None:
    names = list(NAMES[FREE])[::-1]
    system = read_study(model(tmp_path, f"coordinates = {names}\n")).system
    assert system.coordinates == tuple(names)
    assert system.matrix("stiffness").tolist() == STIFFNESS[FREE, FREE][::-1, ::-1].tolist()
    with pytest.raises(ModelError, match=r"but the files name 24 coordinates .*; leave the key out"):
        read_study(model(tmp_path, "coordinates = 24\n"))


def test_a_reduced_beam_states_its_error(tmp_path: Path) -> None:
    path = model(tmp_path, "")
    path.write_text(path.read_text() + "[reduction]\nmodes = 4\n")
    study = read_study(path)
    assert study.reduced is not None
    assert study.system.size < 24
    assert "24" in study.reduced.words


def test_a_rod_by_dmig_has_the_closed_form_of_its_elements(tmp_path: Path) -> None:
    count, h = 10, 0.1
    stiffness = (2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)) / h
    mass = (4 * np.eye(count) + np.eye(count, k=1) + np.eye(count, k=-1)) * h / 6
    stiffness[-1, -1], mass[-1, -1] = 1 / h, 2 * h / 6
    (tmp_path / "rod.pch").write_text(dmig(stiffness, "KAAX", "free") + dmig(mass, "MAAX", "free"))
    text = 'mass = "rod.pch:MAAX"\nstiffness = "rod.pch:KAAX"\n' + STUDY.replace("n130_y", "n50_rz")
    (tmp_path / "rod.toml").write_text(text)
    system = read_study(tmp_path / "rod.toml").system
    angle = (2 * np.arange(1, count + 1) - 1) * math.pi / (2 * count)
    exact = np.sqrt(6 * (1 - np.cos(angle)) / (2 + np.cos(angle))) / h
    found = np.sqrt(eigh(system.matrix("stiffness"), system.matrix("mass"), eigvals_only=True))
    np.testing.assert_allclose(found, exact, rtol=1e-11)


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("a.mtx", "1,1,1,1,2.0\n1,1,1,1,3.0\n", "gives the same entry in lines 1 and 2"),
        (
            "a.mtx",
            "*MATRIX INPUT, NAME=K\n1,1,1,2,2.0\n1,2,1,1,3.0\n",
            "said to be symmetric, but has 2 and 3 between n1_x",
        ),
        ("a.mtx", "*MATRIX INPUT, NAME=K\n1,1,1,1,2.\n*MATRIX INPUT, NAME=M\n", "a second matrix in line 3"),
        ("a.mtx", "*CLOAD\n", "line 1; keep one matrix"),
        ("a.mtx", "-1,1,-1,1,2.0\n", "without a node in line 1, an internal variable of Abaqus"),
        ("a.mtx", "1 2 3 4\n", "4 numbers in line 1; it is neither Matrix Market"),
        ("a.mtx", "1,1,1,1,x\n", "where numbers are expected"),
        ("a.mtx", "** nothing\n", "holds no entries"),
        ("a.mtx", "\n".join(f"{k},1,{k},1,1." for k in range(1, 1002)), "1,001 rows; there may be 1,000"),
        ("a.mtx", "1 1 1.0\n2000 2000 1.0\n", "2,000 rows; there may be 1,000"),
        ("a.pch", "GRID,1\n", "holds no matrix .DMIG"),
        ("a.pch", "DMIG,K,0,6,3,0,,,2\nDMIG,K,1,1,,1,1,2.0,1.0\n", "K is complex"),
        ("a.pch", "DMIG,K,0,9,1,0,,,2\nDMIG,K,1,1,,1,1,2.0\n", r"form 9; only square \(1\)"),
        ("a.pch", "DMIG,K,1,1,,1,1,2.0\n", "no head of the matrix K"),
        ("a.pch", "DMIG,K,0,6,1,0,,,2\nDMIG,K,x,1,,1,1,2.0\n", "line 2 that cannot be read"),
        ("a.op4", "hello\n", "no OP4 file in text; write it by OUTPUT4 with FORM=FORMATTED"),
        ("a.op4", f"{4:8d}{4:8d}{1:8d}{3:8d}{'A':8}1P,3E23.16\n", "cannot be read: it ends too early"),
        ("a.op4", "\0\0", "not a text file"),
        ("a.hb", "x\n", "too short for a Harwell-Boeing file"),
    ],
)
def test_what_cannot_be_read_is_refused_with_the_reason(name, text, complaint, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=complaint):
        read_labelled(str(tmp_path / name))


def test_matrix_market_is_read_as_before(tmp_path: Path) -> None:
    mmwrite(tmp_path / "k.mtx", csc_array(STIFFNESS), precision=17)
    read = read_labelled(str(tmp_path / "k.mtx"))
    assert (read.names, read.matrix.tobytes()) == ((), STIFFNESS.tobytes())


@pytest.mark.parametrize(
    ("text", "value"), [("1.5", 1.5), (" 1.5D+3 ", 1500.0), ("2.+5", 2e5), ("-.5-2", -0.005), ("1E5", 1e5)]
)
def test_numbers_of_fortran(text: str, value: float) -> None:
    assert real(text) == value


def test_the_matrix_of_a_file_is_named_after_a_colon() -> None:
    assert split_name("a/b.pch:KAAX") == ("a/b.pch", "KAAX")
    assert split_name("C:/k.mtx") == ("C:/k.mtx", "")
