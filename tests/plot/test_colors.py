"""One colour for one thing: in pictures, in maps, and on the explorer's page."""

import re
from importlib.resources import files

from gapwalk.bifurcation.special_point import Kind
from gapwalk.plot.style import LINES, locus_options, symbol_style

PAGE = files("gapwalk.explorer") / "page"


def _page_colors() -> dict[str, str]:
    """The colours of the light page by name."""
    text = (PAGE / "style.css").read_text(encoding="utf-8").partition("@media")[0]
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", text))


def test_lines_have_the_colours_of_the_page() -> None:
    colors = _page_colors()
    for label, style in LINES.items():
        assert colors[label] == style.color.lower()


def test_symbols_have_the_colours_of_the_page() -> None:
    colors = _page_colors()
    script = (PAGE / "diagram.js").read_text(encoding="utf-8")
    found = {kind: colors[name] for kind, name in re.findall(r'"?([\w-]+)"?: \["[\w-]+", "--([\w-]+)", \d+\]', script)}
    assert found == {kind.value: symbol_style(kind).color.lower() for kind in Kind.known()}


def test_loci_have_the_colours_of_their_special_points() -> None:
    for kind in (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER, Kind.GRAZING):
        assert locus_options(kind, 0)["color"] == symbol_style(kind).color
