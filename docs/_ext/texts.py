"""Checks of the texts of the pages: not too many, no paragraph twice, no word that gapwalk does not use.

python docs/_ext/texts.py SOURCES PAGES

SOURCES is the folder of the Markdown, whose paragraphs are compared with each other; the words are those of
``docs/_ext/words.toml``, which are looked for in the built pages too, because docstrings are shown there.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

INSTEAD: dict[str, str] = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))["instead"]
MOST_PAGES = 280
MOST_WORDS = 130_000  # of the articles of the built pages, without blocks of code and output
LEAST = 12  # words of a paragraph that is compared: shorter ones, such as headings of tables, may repeat
GENERATED = "generated"
_FENCE = re.compile(r"^(```+|:::+).*?^\1\s*$", re.M | re.S)


def uses(text: str) -> list[str]:
    """List the lines of a text that use one of the words, with the word to write instead."""
    seen = {word: instead for word, instead in INSTEAD.items() if re.search(word, text)}  # few, and quick to find
    return [
        f"{number}: {found[0]!r}: write {instead}"
        for number, line in enumerate(text.splitlines() if seen else (), start=1)
        for word, instead in seen.items()
        if (found := re.search(rf"(?<![\\\w])({word})(?!\w)", line))
    ]


def paragraphs(text: str) -> Iterator[str]:
    """List the paragraphs, rows of tables and items of a page in Markdown, without its code, in one line each."""
    for block in re.split(r"\n\s*\n|\n(?=[-*] |[|])", _FENCE.sub("", text)):
        words = re.sub(r"[*`_]|\]\([^)]*\)|!?\[", "", block).split()
        reference = any(word.startswith("doi:") for word in words)  # two pages may cite one article
        if len(words) >= LEAST and not reference and not set("".join(words)) <= set("|-─ "):
            yield " ".join(words).strip("| ")


def repeated(folder: Path) -> list[str]:
    """List the paragraphs that are on two pages, or twice on one."""
    seen: dict[str, str] = {}
    found = []
    for path in sorted(folder.rglob("*.md")):
        where = path.relative_to(folder).as_posix()
        if GENERATED in path.parts:
            continue
        for paragraph in paragraphs(path.read_text(encoding="utf-8")):
            if paragraph in seen:
                found.append(f"{where} repeats a paragraph of {seen[paragraph]}: {paragraph[:100]}...")
            seen.setdefault(paragraph, where)
    return found


class _Words(HTMLParser):
    """The text of the article of a built page, without some elements."""

    def __init__(self, text: str, *left_out: str) -> None:
        super().__init__()
        self.parts: list[str] = []
        self._left_out = (*left_out, "style", "script")
        self._article, self._code = 0, 0
        self.feed(text[text.find("<article") : text.rfind("</article>")])  # the list of all pages around it is long

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._article += tag == "article"
        self._code += tag in self._left_out

    def handle_endtag(self, tag: str) -> None:
        self._article -= tag == "article"
        self._code -= tag in self._left_out

    def handle_data(self, data: str) -> None:
        if self._article and not self._code:
            self.parts.append(data)


def old_words(folder: Path) -> list[str]:
    """List the uses of words in built pages; the glossary names the words that it replaces."""
    return [
        f"{path.relative_to(folder).as_posix()}:{use}"
        for path in sorted(folder.rglob("*.html"))
        if path.stem != "glossary"
        for use in uses("".join(_Words(path.read_text(encoding="utf-8"), "pre", "code").parts))
    ]


def size(built: Path) -> tuple[int, int, int]:
    """Return the number of built pages, and of the words of their articles without blocks of code, and with them."""
    pages = [path for path in sorted(built.rglob("*.html")) if "_static" not in path.relative_to(built).parts]
    texts = [path.read_text("utf-8") for path in pages]
    text, code = (sum(len("".join(_Words(each, *out).parts).split()) for each in texts) for out in (("pre",), ()))
    return len(pages), text, code


def words_of_sources(folder: Path) -> int:
    """Return the number of words of the pages that are written by hand, in Markdown."""
    pages = (path for path in folder.rglob("*.md") if GENERATED not in path.parts)
    return sum(len(path.read_text("utf-8").split()) for path in pages)


def too_many(pages: int, words: int) -> list[str]:
    """List what exceeds the size that the documentation may have."""
    found = [f"{pages} pages: {MOST_PAGES} at most"] if pages > MOST_PAGES else []
    return found + ([f"{words} words of built pages: {MOST_WORDS} at most"] if words > MOST_WORDS else [])


if __name__ == "__main__":
    sources, built = map(Path, sys.argv[1:3])
    pages, words, all_words = size(built)
    written = words_of_sources(sources)
    print(f"{pages} pages, {words:,} words ({all_words:,} with code); {written:,} words of Markdown written by hand")
    found = too_many(pages, words) + repeated(sources) + old_words(built)
    print("\n".join(found) or "no paragraph is repeated, and no old word is used")
    sys.exit(bool(found))
