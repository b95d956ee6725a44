"""A drive train from a spreadsheet is the train of the same numbers; a wrong cell is named with what to write."""

from pathlib import Path

import openpyxl
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.model.drivetrain.train_sheet import COLUMNS, letters
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import parse_source
from gapwalk.studies.study_file import read_studies, text_of_sheet

EXAMPLES = Path(__file__).parents[3] / "examples"
TABLE = """\
part,name,from,to,inertia [kg m^2],torque [N m],stiffness [N m/deg],damping (N m s/rad),backlash [deg],\
impact damping [s/rad],order,amplitude [N m],speed [rpm],note
inertia,flywheel,,,0.14,20,,,,,,,1500,with crankshaft
inertia,hub,,,0.005,,,,,,,,,
inertia,gearbox,,,0.011,,,,,,,,,
inertia,vehicle,,,4.1,reaction,,,,,,,,
# a comment
clutch,clutch,flywheel,hub,,,2.5,0.2,,0.01,,,,
stage,,,,,,19.5,,6,,,,,"hard, second"
shaft,input,hub,gearbox,,,9200 N m/rad,0.6,,,,,,

shaft,halfshafts,gearbox,vehicle,,,320 N m/rad,0.6,,,,,,
load,firing,flywheel,,,,,,,,2,100,,
"""
"""The train of examples/drivetrain.toml."""


def system_of(path: Path) -> gw.System:
    model, problems = check_model(parse_source(text_of_sheet(path)))
    assert not problems
    assert model is not None
    return model.system


def written(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def test_the_table_is_the_example(tmp_path: Path, capsys) -> None:
    table, model = written(tmp_path / "train.csv", TABLE), tmp_path / "train.toml"
    assert main(["new", str(model), "--from", str(table)]) == 0
    assert "gapwalk run" in capsys.readouterr().out
    (study,), expected = read_studies(model), read_studies(EXAMPLES / "drivetrain.toml")[0].system
    assert study.system.structure.names == expected.structure.names
    assert study.system.at({"speed": expected["speed"]}) == expected
    text = model.read_text(encoding="utf-8")
    assert "[[inertia]]  # row 2: with crankshaft" in text
    assert "[[shaft.stage]]  # row 8: hard, second" in text
    assert 'clearance = "3 deg"  # half the backlash of 6' in text
    assert main(["new", str(model), "--from", str(table)]) == 2
    assert "exists already" in capsys.readouterr().err


@pytest.mark.parametrize("mark", [";", "\t"])
@pytest.mark.parametrize("head", ["", "\N{BYTE ORDER MARK}", "sep"])
def test_other_separators_and_decimal_commas(mark, head, tmp_path: Path) -> None:
    expected = system_of(written(tmp_path / "a.csv", TABLE))
    text = TABLE.replace(".", "\0").replace('"hard, second"', "hard").replace(",", mark).replace("\0", ",")
    text = f"sep={mark}\n{text}" if head == "sep" else head + text
    assert system_of(written(tmp_path / "b.csv", text.replace("\n", "\r\n"))) == expected


def test_a_workbook_is_read(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for line in TABLE.replace('"hard, second"', "hard").splitlines():
        cells = line.split(",")
        sheet.append([float(cell) if cell.replace(".", "").isdecimal() else cell or None for cell in cells])
    book.save(tmp_path / "train.xlsx")
    assert system_of(tmp_path / "train.xlsx") == system_of(written(tmp_path / "a.csv", TABLE))
    with pytest.raises(ModelError, match=r"is not a readable workbook .* save the table as CSV UTF-8"):
        text_of_sheet(written(tmp_path / "b.xlsx", TABLE))


def test_gears_have_teeth_or_a_ratio_and_units_may_be_left_out(tmp_path: Path) -> None:
    text = (
        "part,name,from,to,inertia,stiffness,clearance,damping,ratio,z1,z2\n"
        "inertia,a,,,1,,,,,,\ninertia,b,,,2,,,,,,\ninertia,c,,,3,,,,,,\n"
        "gear,m,a,b,,100,0.5,,,27,41\ngear,n,b,c,,50,,,2.5,,\nshaft,s,c,ground,,1,,0.1,,,\n"
    )
    system = system_of(written(tmp_path / "a.csv", text))
    gears = [
        gw.train.Gear("m", ("a", "b"), teeth=(27, 41), stiffness=100.0, clearance=0.5),
        gw.train.Gear("n", ("b", "c"), 2.5, stiffness=50.0),
    ]
    inertias = [gw.train.Inertia(name, value) for name, value in (("a", 1.0), ("b", 2.0), ("c", 3.0))]
    shafts = [gw.train.Shaft("s", ("c", "ground"), stiffness=1.0, damping=0.1)]
    assert system == gw.train.Train(inertias, shafts, gears).system()


def test_drags_and_radii(tmp_path: Path) -> None:
    text = (
        "part,name,from,to,inertia [kg m^2],radius [mm],torque [N m],stiffness [N m/rad],ratio,constant [N m],"
        "linear [N m s/rad],speed [rpm]\ninertia,a,,,1,,reaction,,,,,800\ninertia,b,,,2,35,,,,,,\n"
        "gear,m,a,b,,,,100,2.5,,,\ndrag,d,b,ground,,,,,,1.5,0.01,\n"
    )
    system = system_of(written(tmp_path / "a.csv", text))
    inertias = [gw.train.Inertia("a", "1 kg m^2"), gw.train.Inertia("b", "2 kg m^2", "35 mm")]
    gears = [gw.train.Gear("m", ("a", "b"), 2.5, stiffness="100 N m/rad")]
    drags = [gw.train.Drag("d", ("b", "ground"), constant="1.5 N m", linear="0.01 N m s/rad")]
    assert system == gw.train.Train(inertias, gears=gears, drags=drags, reaction="a", speed="800 rpm").system()
    with pytest.raises(ModelError, match=r"constant .* is empty; write its torque, as in 1.2"):
        text_of_sheet(written(tmp_path / "b.csv", text.replace("1.5,0.01", ",")))


HEAD = "part,name,from,to,inertia [kg m^2],stiffness [N m/rad],clearance [deg],backlash [deg],ratio\n"
BODIES = "inertia,a,,,1,,,,\ninertia,b,,,2,,,,\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "is empty; write headings in its first row"),
        (HEAD, "has no parts below its headings"),
        (HEAD.replace("stiffness", "stifness") + BODIES, "row 1, column F: the heading .* did you mean stiffness"),
        (HEAD.replace("N m/rad", "N/m") + BODIES, r"column F: .* write the heading stiffness \[N m/rad\]"),
        (HEAD.replace("ratio", "ratio [mm]") + BODIES, "column I: ratio has no unit; write the heading ratio"),
        (HEAD.replace("ratio", "name") + BODIES, "column I: .* is column B again"),
        (HEAD.replace("part", "note") + BODIES, "row 1: there is no column part"),
        (HEAD + BODIES + "shaf,s,a,b,,1,,,\n", r"row 4, column A \(part\) is \"shaf\"; .* did you mean shaft"),
        (HEAD + BODIES + "shaft,s t,a,b,,1,,,\n", r"row 4, column B \(name\) .*digits and underscores: s_t"),
        (HEAD + BODIES + "shaft,a,a,b,,1,,,\n", r"column B \(name\) is \"a\", as in row 2; write another name"),
        (HEAD + BODIES + "shaft,s,a,d,,1,,,\n", r"column D \(to\) is \"d\", .* write one of a, b, or ground"),
        (HEAD + BODIES + "shaft,s,a,b,,1x,,,\n", r"row 4, column F \(stiffness \[N m/rad\]\) is"),
        (HEAD + BODIES + "shaft,s,a,b,,soft,,,\n", r"column F .* is \"soft\"; write a number, as in 12.5"),
        (HEAD + BODIES + "shaft,s,a,b,,1 kg m^2,,,\n", r"column F .* kg m\^2 is the unit of an inertia"),
        (HEAD + BODIES + 'shaft,s,a,b,,"1,234",,,\n', "write a decimal point"),
        (HEAD + BODIES + "shaft,s,a,b,,1.234.5,,,\n", "write a number|without separators of thousands"),
        (HEAD + BODIES + "shaft,s,a,b,,1,1,2,\n", "beside the clearance, which is half of it"),
        (HEAD + BODIES + "gear,m,a,b,,1,,,\n", r"row 4, column I \(ratio\) is empty; write the ratio"),
        (HEAD + BODIES + "shaft,s,a,b,,1,,,2\n", "a shaft has no ratio; .* write gear as the part"),
        (HEAD + BODIES + "stage,,,,,1,,,\n", "write it below its shaft or gear"),
        (HEAD + BODIES + "shaft,s,a,b,,-1,,,\n", r"row 4: shaft .*stiffness is .* > 0"),
        (HEAD + "inertia,a,,,,,,,\n", r"row 2, column E \(inertia \[kg m\^2\]\) is empty; write the moment of inertia"),
        (HEAD.replace(" [kg m^2]", "") + BODIES + "shaft,s,a,b,,1,,,\n", "has a unit, but others have none"),
        (HEAD.replace(",", ";") + "inertia;a;;;1,5;;;;\ninertia;b;;;1.5;;;;\n", "all with a comma"),
        (HEAD + '"' + BODIES, "cannot be divided into cells"),
        (HEAD.encode() + b"inertia,\xfc,,,1,,,,\n", "row 2 is not UTF-8 text; save the table as CSV UTF-8"),
    ],
)
def test_a_wrong_cell_is_named_with_what_to_write(text, complaint, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=complaint):
        text_of_sheet(written(tmp_path / "train.csv", text))


def test_a_note_cannot_break_the_model_file(tmp_path: Path) -> None:
    note = '"x\n[study]\nkind = ""map"""'
    text = HEAD.replace("ratio", "note") + f"inertia,a,,,1,,,,{note}\n" + "shaft,s,a,ground,,1,,,\n"
    assert "# row 2: x [study] kind" in text_of_sheet(written(tmp_path / "a.csv", text))


def test_all_columns_are_documented() -> None:
    page = (EXAMPLES.parent / "docs" / "howto" / "spreadsheet.md").read_text(encoding="utf-8")
    assert [each.name for each in COLUMNS if f"| {each.name} |" not in page] == []


def test_the_table_of_the_page_is_a_train(tmp_path: Path) -> None:
    page = (EXAMPLES.parent / "docs" / "howto" / "spreadsheet.md").read_text(encoding="utf-8")
    lines = [line.strip("|") for line in page.split("## The columns")[0].splitlines() if line.startswith("| ")]
    text = "\n".join(";".join(cell.strip() for cell in line.split("|")) for line in lines)
    assert system_of(written(tmp_path / "a.csv", text)).coordinates == ("clutch", "mesh")


def test_letters_of_columns() -> None:
    assert [letters(place) for place in (0, 25, 26, 701, 702)] == ["A", "Z", "AA", "ZZ", "AAA"]
