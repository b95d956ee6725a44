"""Summaries on the console: tables with groups and aligned columns, trees, and texts from files."""

from gapwalk.cli.output import show
from gapwalk.summary import Table, Tree, remarks


def test_a_table_has_aligned_columns_and_gaps_between_groups(capsys) -> None:
    show([Table(["name", ">value"], [["a", "1"], ["", "12"], ["b", "3"]], groups=[1])])
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == "name   value"
    assert lines[2:] == ["a          1", "          12", "", "b          3"]


def test_a_tree_is_indented(capsys) -> None:
    show([Tree("root", [Tree("first\nsecond line", [Tree("leaf")]), Tree("last")])])
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines == ["root", "├── first", "│   second line", "│   └── leaf", "└── last"]


def test_texts_of_files_cannot_control_the_terminal(capsys) -> None:
    show(["a\x1b[2J", Table(["\x07"], [["\x1b[31m"]]), Tree("\x1b]0;title\x07"), "[bold]not markup[/bold]"])
    text = capsys.readouterr().out
    assert "\x1b" not in text
    assert "\x07" not in text
    assert "[bold]not markup[/bold]" in text


def test_remarks_name_notes_and_failures() -> None:
    assert list(remarks(["slow"], ["lost"])) == ["note: slow", "failed: lost"]
