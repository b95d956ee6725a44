"""Words that gapwalk does not use: private metaphors and stiff phrases, each with the word to write instead."""

from pathlib import Path

import pytest

from docs._ext.texts import repeated, uses

ROOT = Path(__file__).resolve().parents[1]
FILES = [
    file
    for pattern in (
        "src/**/*.py",
        "src/**/*.js",
        "src/**/*.html",
        "docs/**/*.md",
        "examples/*",
        "README.md",
        "CONTRIBUTING.md",
    )
    for file in sorted(ROOT.glob(pattern))
    if file.is_file() and file.name not in ("CHANGELOG.md", "glossary.md")
]


def test_no_file_uses_one_of_the_words() -> None:
    found = [
        f"{file.relative_to(ROOT).as_posix()}:{use}" for file in FILES for use in uses(file.read_text(encoding="utf-8"))
    ]
    assert len(FILES) > 200
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("text", ["a desk", "The motion runs away.", "it is told", "started anew"])
def test_a_use_is_seen(text: str) -> None:
    assert len(uses(text)) == 1


@pytest.mark.parametrize("text", ["a desktop", "$\\Omega$", "it is toldest", "boarding"])
def test_other_words_pass(text: str) -> None:
    assert uses(text) == []


def test_a_paragraph_that_is_repeated_is_seen(tmp_path: Path) -> None:
    paragraph = "Every branch ends with a stated reason, and nothing that was reported is lost when a run is killed."
    (tmp_path / "a.md").write_text(f"# A\n\n{paragraph}\n\n```toml\n{paragraph}\n```\n", encoding="utf-8")
    assert repeated(tmp_path) == []
    (tmp_path / "c.md").write_text(f"# C\n\n{paragraph.replace(' lost', chr(10) + '*lost*')}\n", encoding="utf-8")
    assert [found.partition(" repeats")[0] for found in repeated(tmp_path)] == ["c.md"]


def test_no_page_repeats_a_paragraph() -> None:
    assert repeated(ROOT / "docs") == []
