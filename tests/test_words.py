"""Words that gapwalk does not use: private metaphors and stiff phrases, each with the word to write instead."""

import re
from pathlib import Path

import pytest

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
    if file.is_file() and file.name != "CHANGELOG.md"
]

INSTEAD = {
    "desk": "session",
    "board": "exploration",
    "errands?": "follow-up",
    "leash": "process control",
    "shelf": "list of results",
    "haunts?": "attractor signature",
    "crew": "executor",
    "swarms?": "many motions",
    "fleet": "block plan",
    "trail": "branch tracer",
    "departures?": "branch start",
    "brink": "near grazing",
    "strands?": "path",
    "limbs?": "diagram branch",
    "second opinion": "error estimate",
    "mass flow": "batch integrator",
    "anew": "again, from scratch",
    "is told|are told": "is reported",
    "hangs? (on|together)": "is connected to",
    "runs? away": "diverges",
    "(it|what|which|file) is no (key|result)": "is not a key, is not a result",
}


def uses(text: str) -> list[str]:
    """List the lines of a text that use one of the words, with what to write instead."""
    seen = {word: instead for word, instead in INSTEAD.items() if re.search(word, text)}  # few, and quick to find
    return [
        f"{number}: {found[0]!r}: write {instead}"
        for number, line in enumerate(text.splitlines() if seen else (), start=1)
        for word, instead in seen.items()
        if (found := re.search(rf"(?<![\\\w])({word})(?!\w)", line))
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
