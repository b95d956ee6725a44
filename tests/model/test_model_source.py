"""Reading a file: what it may be, and what is said of it otherwise."""

from pathlib import Path

import pytest

from gapwalk.model.model_source import MAX_BYTES, parse_source, read_source
from gapwalk.model.problems import ModelFileError, Problem


def one_problem(path: Path | str) -> Problem:
    with pytest.raises(ModelFileError) as error:
        read_source(path)
    (problem,) = error.value.problems
    assert str(error.value) == str(problem)
    assert problem.file == str(path)
    return problem


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes("\ufefftitle = 'Spiel'\r\n[a]\r\nb = 'ü'\r\n".encode())
    source = read_source(path)
    assert source.data == {"title": "Spiel", "a": {"b": "ü"}}
    assert (source.line(("a", "b")), source.line(("a", "x", 3)), source.line(("c",))) == (3, 2, None)


def test_a_missing_file_offers_its_neighbours(tmp_path: Path) -> None:
    assert "`gapwalk new FILE` writes" in one_problem(tmp_path / "clutch.toml").message
    (tmp_path / "clutch.toml").write_text("a = 1")
    for name in ("cluch.toml", "clutch.tml", "clutch"):
        assert one_problem(tmp_path / name).message == "there is no such file; did you mean clutch.toml?"
    assert "there is no folder" in one_problem(tmp_path / "none" / "clutch.toml").message


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    assert one_problem(tmp_path).message == "this is a folder; name a file in it"
    assert "cannot be read" in one_problem("a\0b").message


@pytest.mark.parametrize("content", [b"", b"\n\n", b"# only a comment\n"])
def test_an_empty_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes(content)
    assert one_problem(path).message.startswith("the file is empty")


def test_other_encodings_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes("a = 1\ntitle = 'Getriebegeräusch'\n".encode("latin-1"))
    problem = one_problem(path)
    assert (problem.line, problem.message) == (2, "byte 0xe4 is not UTF-8; save the file as UTF-8")


def test_a_large_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes(b"#" * (MAX_BYTES + 1))
    assert "larger than 10 MB" in one_problem(path).message
    path.write_bytes(b"a = 1\n#".ljust(MAX_BYTES, b"x"))
    assert read_source(path).data == {"a": 1}


@pytest.mark.parametrize(
    ("text", "line", "fragments"),
    [
        ("a = 1\nb = .5\n", 2, ["column 5", "b = .5", "as in 0.5"]),
        ("a = 5.\n", 1, ["as in 0.5"]),
        ("a = [1, -.5]\n", 1, ["as in 0.5"]),
        ("a = True\n", 1, ["true or false"]),
        ("side = both\n", 1, ["write a text in quotes"]),
        ("coordinates = [mast, load]\n", 1, ["write each name in quotes, as in"]),
        ("a =\n", 1, ["a value must follow"]),
        ("a: 1\n", 1, ["write key = value"]),
        ("a = 1\na = 2\n", 2, ["overwrite"]),
        ("[a]\n[a]\n", 2, ["[a] is here a second time; if there are several, write [[a]] for each"]),
        ("a = [1,\n2", 2, ["not TOML"]),
        ("a = '''\n\n", 3, ["end of the file"]),
        ("a = 1,5\n", 1, ["column"]),
    ],
)
def test_a_slip_of_toml_has_its_line(text: str, line: int, fragments: list[str]) -> None:
    with pytest.raises(ModelFileError) as error:
        parse_source(text, "m.toml")
    (problem,) = error.value.problems
    assert problem.line == line
    for fragment in ["not TOML", *fragments]:
        assert fragment in problem.message


@pytest.mark.parametrize("text", ["a = " + "[" * 100_000, "a = " + "{b=" * 100_000, f"a = {'9' * 5000}"])
def test_monsters_are_refused(text: str) -> None:
    with pytest.raises(ModelFileError, match=r"m\.toml"):
        parse_source(text, "m.toml")


def test_a_changed_value_has_no_line() -> None:
    source = parse_source("a = 1\n[b]\nc = 2\n")
    changed = source.with_value(("b", "c"), 3).with_value(("d", "e"), 4)
    assert changed.data == {"a": 1, "b": {"c": 3}, "d": {"e": 4}}
    assert source.data == {"a": 1, "b": {"c": 2}}
    assert (changed.line(("a",)), changed.line(("b",)), changed.line(("b", "c"))) == (1, 2, None)
    with pytest.raises(ModelFileError, match="a is no table"):
        source.with_value(("a", "b"), 1)
