"""Summaries on the console: tables with groups and aligned columns, trees, and texts from files."""

import os
import re
import subprocess
import sys
from collections import Counter
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from gapwalk.cli.output import show
from gapwalk.summary import Table, Tree, remarks, render


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


def drawn(parts, width: int) -> list[str]:
    """Render the parts of a summary on a console of some width."""
    stream = StringIO()
    render(parts, Console(file=stream, width=width, force_terminal=True, color_system=None, markup=False))
    return [line.rstrip() for line in re.sub(r"\x1b\[[0-9;]*m", "", stream.getvalue()).splitlines()]


def random_table(random: np.random.Generator) -> Table:
    """Draw a table as results have them: numbers of up to 12 digits, pairs, and texts of up to eight words."""
    makers = [
        lambda: f"{random.normal():.{random.integers(1, 12)}g}",
        lambda: f"{random.normal():.6f} ± {abs(random.normal()):.6f}i",
        lambda: " ".join(f"word{k}"[: random.integers(2, 9)] for k in range(random.integers(1, 9))),
        lambda: f"stage{random.integers(9)} +",
    ]
    chosen = random.integers(0, len(makers), random.integers(1, 12))
    rows = [[makers[kind]() for kind in chosen] for _ in range(6)]
    headings = [f"{'>' if kind < 2 else ''}of column {k}" for k, kind in enumerate(chosen)]
    return Table(headings, rows, groups=[2])


@pytest.mark.parametrize("width", [80, 100, 120])
def test_no_number_and_no_word_is_ever_cut(width: int) -> None:
    random = np.random.default_rng(7)
    for _ in range(60):
        table = random_table(random)
        lines = drawn([table], width)
        assert max(map(len, lines)) <= width
        assert "…" not in "".join(lines)
        numbers = [cell for row in table.rows for cell, name in zip(row, table.headings, strict=True) if name[0] == ">"]
        text = "\n".join(lines)
        for number in numbers:  # whole, in one line
            assert number in text
        words = Counter(word for row in table.rows for cell in row for word in cell.split())
        words += Counter(word for heading, _ in table.columns for word in heading.split())
        assert Counter(word for line in lines for word in line.split() if "─" not in word) == words


def test_columns_that_may_be_left_out_are_named_where_the_width_does_not_suffice() -> None:
    cells = ["700", "both sides", "12.25", "3.5", "0.186"]
    spare = [">kurtosis", ">lost [W]"]
    table = Table([">speed [rpm]", "state", ">rms " + "x" * 50, *spare], [cells], spare=spare)
    lines = drawn([table], 80)
    assert lines[1].split() == ["[rpm]", "state", "x" * 50, "[W]"]
    assert [word for line in lines[3:5] for word in line.split()] == ["700", "both", "12.25", "0.186", "sides"]
    assert lines[5] == "left out at 80 columns: kurtosis"
    lines = drawn([table], 120)
    assert lines[2].split() == ["700", "both", "sides", "12.25", "3.5", "0.186"]
    assert len(lines) == 3


def test_rows_that_do_not_fit_take_several_lines_in_columns() -> None:
    wide = Table(["kind", ">value", ">more", "text"], [["fold", "1." + "2" * 30, "3" * 36, "a b"]])
    lines = drawn([wide], 80)
    assert lines[0].split() == ["kind", "value", "more"]
    assert lines[1] == "  text"
    assert lines[3:] == [f"fold  1.{'2' * 30}  {'3' * 36}", "  a b"]


def test_a_sentence_is_broken_between_words_and_keeps_its_indent() -> None:
    sentence = "  " + "somewhat long words " * 6 + "x" * 90
    lines = drawn([sentence], 80)
    assert " ".join(" ".join(lines).split()) == " ".join(sentence.split())
    assert lines[1].startswith("    words")
    assert lines[-1].strip() == "x" * 90  # what has no blank stays whole: the address of a file can be copied


def test_a_terminal_of_eighty_columns_shows_all_digits(tmp_path) -> None:
    pty = pytest.importorskip("pty")  # there is none on Windows
    source, sink = pty.openpty()
    termios = pytest.importorskip("termios")
    termios.tcsetwinsize(sink, (40, 80))
    code = (
        "from gapwalk.cli.output import show; from gapwalk.summary import Table;"
        "row = ['neimark-sacker', *['0.7106873456' * 2] * 3, 'x'];"
        "show([Table(['kind', '>value', '>other', '>third', 'how'], [row])])"
    )
    environment = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    subprocess.run([sys.executable, "-c", code], stdout=sink, check=True, env={**environment, "TERM": "xterm"})
    os.close(sink)
    text = os.read(source, 65536).decode()
    os.close(source)
    assert text.count("0.71068734560.7106873456") == 3
    assert "…" not in text
