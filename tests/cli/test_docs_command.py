"""`gapwalk docs` opens a page of the copy in the package; each help text has examples that can be typed."""

from pathlib import Path

import pytest

from docs._ext.offline import pack
from gapwalk.cli import docs_command, main
from gapwalk.cli.commands import app
from tests.docs.commands import commands_in, parse_command


@pytest.fixture
def archive(tmp_path, monkeypatch):
    """Pages packed as `make docs` packs them."""
    pages = tmp_path / "pages"
    for name in ("index.html", "reference/glossary.html", "reference/generated/gapwalk.follow.html", "_sources/a.txt"):
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        (pages / name).write_text(name, encoding="utf-8")
    assert pack(pages, tmp_path / "docs.zip") == 3
    first = (tmp_path / "docs.zip").read_bytes()
    pack(pages, tmp_path / "docs.zip")
    assert (tmp_path / "docs.zip").read_bytes() == first
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(docs_command.open_docs, "__kwdefaults__", {"browser": True, "archive": tmp_path / "docs.zip"})
    return tmp_path / "docs.zip"


@pytest.mark.parametrize(
    ("words", "page"),
    [
        ([], "index.html"),
        (["glossary"], "reference/glossary.html"),
        (["gw.follow"], "reference/generated/gapwalk.follow.html"),
    ],
)
def test_a_page_is_unpacked_and_opened(archive, words, page, capsys, monkeypatch) -> None:
    opened = []
    monkeypatch.setattr(docs_command.webbrowser, "open", opened.append)
    for _ in range(2):
        assert main(["docs", *words]) == 0
    path = capsys.readouterr().out.splitlines()[0]
    assert path.endswith(page)
    assert Path(path).read_text(encoding="utf-8") == page
    assert len(opened) == 2
    assert opened[0].startswith("file:///")
    assert len([*(archive.parent / "cache" / "gapwalk" / "docs").iterdir()]) == 1


def test_a_page_that_is_not_there_is_refused(archive, capsys) -> None:
    assert main(["docs", "glosary", "--no-browser"]) != 0
    assert "glossary" in capsys.readouterr().err


def test_without_pages_it_says_how_to_make_them(tmp_path, monkeypatch, capsys) -> None:
    missing = {"browser": True, "archive": tmp_path / "none.zip"}
    monkeypatch.setattr(docs_command.open_docs, "__kwdefaults__", missing)
    assert main(["docs"]) == 2
    assert "make docs" in capsys.readouterr().err


@pytest.mark.parametrize("name", [name for name in app if not name.startswith("-")])
def test_a_help_text_has_examples_that_can_be_typed(name) -> None:
    shown = list(commands_in(str(app[name].help_epilogue)))
    assert shown
    for words in shown:
        assert words[1] == name
        parse_command(words)
