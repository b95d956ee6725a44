"""All code of the documentation runs, and its commands print what it says."""

import re
import shutil
from importlib import import_module
from pathlib import Path
from types import ModuleType

import matplotlib.pyplot as plt
import pytest

import gapwalk
from docs._ext.api_links import extensions_page
from docs._ext.links import problems
from docs._ext.texts import MOST_PAGES, MOST_WORDS, size, too_many
from tests.docs.page import blocks_of, run_page
from tests.release.names import namespaces
from tests.tiers import in_campaign

DOCS = Path(__file__).parents[2] / "docs"
ELSEWHERE = {
    "cluster.md"
}  # for machines that are not here; tests/studies/test_cluster.py does the same with a local one
PAGES = [page for page in sorted(DOCS.rglob("*.md")) if any(blocks_of(page)) and page.name not in ELSEWHERE]

TEMPLATES = "src/gapwalk/studies/templates"
NAMES = [page.relative_to(DOCS).as_posix() for page in PAGES]
# `make docs` runs them too
LONG = {
    f"gallery/{name}.md"
    for name in (
        "collide",
        "stop",
        "clutch",
        "duffing",
        "drivetrain",
        "rod",
        "bearing",
        "mesh",
        "engine",
        "rub",
        "pendulum",
        "rigid-stop",
        "dry-friction",
        "hysteresis",
        "belt",
        "impact-damper",
        "windows",
        "crankshaft",  # tests/model/loads/test_cylinder.py has its numbers
    )
} | {"howto/nothing-missing.md", "howto/loads.md", "howto/pictures.md", "howto/export.md"}
LONG |= {"tutorial/research.md"}
PARTS = {
    "gallery/bilinear.md": "If the excitation doubles",
    "howto/two-gaps.md": "The parameters of these contacts",
    "howto/why-stopped.md": "## Friction and rigid stops",
    "tutorial/first-system.md": "## Follow the other branches",
    "tutorial/rattle.md": "## 3. Where",
}
"""Where `make test` ends on a long page."""
CASES = [(name, "") for name in NAMES if name not in LONG | PARTS.keys()] + [*PARTS.items()]
WHOLE = [in_campaign(name, "") for name in sorted(LONG | PARTS.keys())]


@pytest.mark.parametrize(("name", "until"), CASES + WHOLE)
def test_a_page_does_what_it_says(name, until, tmp_path, monkeypatch) -> None:
    page = DOCS / name
    folder, examples = tmp_path / "docs" / Path(name).parent, tmp_path / "examples"
    for there in (folder, examples):
        there.mkdir(parents=True)
    for source, there in ((page.parent, folder), (DOCS.parent / "examples", examples)):
        for file in (*source.glob("*.toml"), *source.glob("*.csv")):
            shutil.copy(file, there)
    shutil.copytree(DOCS / "howto", tmp_path / "docs" / "howto", dirs_exist_ok=True)
    shutil.copytree(DOCS.parent / TEMPLATES, tmp_path / TEMPLATES)
    monkeypatch.chdir(folder)
    try:
        run_page(page, until)
    finally:
        plt.close("all")


OF_THEIR_OWN = {
    "index.md",
    "design.md",
    "reference/security.md",
}  # an entrance, a record of the design, a file of the root


@pytest.mark.parametrize(
    "name",
    [
        page.relative_to(DOCS).as_posix()
        for page in sorted(DOCS.rglob("*.md"))
        if not {"numerics", "generated"} & {*page.parts} and page.relative_to(DOCS).as_posix() not in OF_THEIR_OWN
    ],
)
def test_a_page_begins_with_what_the_reader_gets(name: str) -> None:
    text = re.sub(r"\A---\n.*?\n---\n", "", (DOCS / name).read_text(encoding="utf-8"), flags=re.S)
    title, opening, *_ = text.strip().split("\n\n")
    assert title.startswith("# ")
    assert re.search(r"\b(You|[Tt]his page|[Tt]hese pages|Each page|For programs|Every|The examples)\b", opening), (
        opening
    )


LISTS = {"index.md", "studies.md"}  # of pages, and of all kinds of studies


@pytest.mark.parametrize("page", [page for page in PAGES if page.parent.name in ("gallery", "howto")], ids=str)
def test_a_page_of_the_gallery_or_a_howto_links_on(page: Path) -> None:
    end = page.read_text(encoding="utf-8").splitlines()[-12:]
    assert page.name in LISTS or re.search(r"\]\([\w./-]+\.md", " ".join(end))


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#here">b</a> <a href="c.html">c</a>', encoding="utf-8")
    (tmp_path / "b.html").write_text('<a href="a.html">a</a> <img src="https://elsewhere.org/x.png">', encoding="utf-8")
    assert sorted(problems(tmp_path)) == [
        "a.html: b.html#here names a place that is not there",
        "a.html: c.html leads nowhere",
        "b.html fetches https://elsewhere.org/x.png",
    ]


def test_the_reference_has_every_public_name() -> None:
    text = (DOCS / "reference" / "api.md").read_text(encoding="utf-8") + extensions_page()
    listed = []
    for part in text.split("currentmodule:: ")[1:]:
        module = import_module(part.split()[0])
        names = re.findall(r"^(?:   |\.\. auto\w+:: )(\w+)$", part, re.M)
        listed += [thing for name in names if (thing := getattr(module, name))]
    for module in namespaces():
        if module in (gapwalk.errors, gapwalk.paper):
            assert f"automodule:: {module.__name__}" in text
            continue
        things = {name: getattr(module, name) for name in module.__all__}
        missing = [name for name, thing in things.items() if not any(thing is each for each in listed)]
        assert not [name for name in missing if not isinstance(things[name], ModuleType)], module.__name__


def test_words_of_pages_are_counted(tmp_path: Path) -> None:
    page = "<p>menu</p><article>three words <code>here</code><pre>a = 1</pre></article>"
    (tmp_path / "a.html").write_text(page, encoding="utf-8")
    (tmp_path / "_static").mkdir()
    (tmp_path / "_static" / "b.html").write_text(page, encoding="utf-8")
    assert size(tmp_path) == (1, 3, 5)
    assert not too_many(MOST_PAGES, MOST_WORDS)
    assert len(too_many(MOST_PAGES + 1, MOST_WORDS + 1)) == 2


def test_pages_are_found() -> None:
    assert {*LONG, *PARTS} <= {*NAMES}
    assert all(until in (DOCS / name).read_text(encoding="utf-8") for name, until in PARTS.items())
    assert sum(name.startswith("gallery/") for name in NAMES) >= 8
    kinds = [block.kind for page in PAGES for block in blocks_of(page)]
    assert kinds.count("console") >= 4
