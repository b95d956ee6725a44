"""One meaning for one colour: in pictures, in maps, on the explorer's page, and in the documentation."""

import re
from importlib.resources import files
from itertools import combinations
from pathlib import Path

import pytest

from gapwalk.attractors.regimes import Regime
from gapwalk.bifurcation.special_point import Kind
from gapwalk.meanings import MEANINGS, REGIMES, TINTS, color_of, page_colors, period_color
from gapwalk.plot.answers import LOOKS, SYMBOLS
from gapwalk.plot.style import LINES, locus_options, regime_color, symbol_style

PAGE = files("gapwalk.explorer") / "page"
NAMED = {each.name: each for each in (*MEANINGS, *TINTS)}
LAYOUT = {
    *("page", "card", "ink", "soft", "line", "grid", "accent", "accent-ink", "warn", "field", "chosen", "radius"),
    *(f"result-{each}" for each in ("blue", "orange", "green", "purple", "red", "grey")),
}
"""Colours of the page that say nothing about a motion, or that its user chooses."""


def _distance(one: str, other: str) -> float:
    """The largest difference of red, green and blue, of 255."""
    return max(abs(int(one[k : k + 2], 16) - int(other[k : k + 2], 16)) for k in (1, 3, 5))


def test_no_two_meanings_have_one_colour() -> None:
    same = {frozenset(("stop", "neutral"))}  # grey thin and grey with markers
    for one, other in combinations(MEANINGS, 2):
        if {one.name, other.name} not in same:
            assert _distance(one.color, other.color) >= 40, (one.name, other.name)


@pytest.mark.parametrize("period", range(2, 33))
def test_periods_have_no_colour_of_anything_else(period: int) -> None:
    for each in MEANINGS:
        assert _distance(period_color(period), each.color) >= 30, each.name


def test_short_periods_differ_and_doublings_grow_lighter() -> None:
    for one, other in combinations(range(1, 9), 2):
        assert _distance(period_color(one), period_color(other)) >= 30, (one, other)
    for odd in (1, 3, 5, 7):
        one, twice = (period_color(odd * m) for m in (1, 2))
        assert sum(bytes.fromhex(one[1:])) < sum(bytes.fromhex(twice[1:]))


def test_a_motion_without_period_has_the_colour_of_what_it_comes_from() -> None:
    assert regime_color(Regime.QUASI_PERIODIC.text) == LINES["pair"].color == LOOKS["torus"][0]
    assert {each.text for each in Regime} - REGIMES.keys() == {"periodic"}


def test_symbols_of_answers_are_those_of_special_points() -> None:
    for name, kind in (("fold", Kind.FOLD), ("doubling", Kind.FLIP), ("pair", Kind.NEIMARK_SACKER)):
        marker, _, _, edge = SYMBOLS[name]
        assert (marker, edge) == (kind.symbol.marker, symbol_style(kind).color), name


def test_the_page_takes_its_colours_from_the_table() -> None:
    light, _, dark = page_colors().partition("@media")
    for each in NAMED.values():
        assert f"--{each.name}: {each.color};" in light
        assert not each.dark or f"--{each.name}: {each.dark};" in dark
    style = (PAGE / "style.css").read_text(encoding="utf-8")
    defined = set(re.findall(r"--([\w-]+):", style))
    assert not defined & NAMED.keys(), "a colour with a meaning is defined twice"
    assert defined == LAYOUT
    scripts = [path.read_text(encoding="utf-8") for path in Path(str(PAGE)).glob("*.js")]
    used = set(re.findall(r"var\(--([\w-]+)", style)) | {
        name for text in scripts for name in re.findall(r'"--([\w-]+)"', text)
    }
    assert used <= NAMED.keys() | LAYOUT | {"place"}, used - NAMED.keys() - LAYOUT


def test_symbols_have_the_colours_of_the_page() -> None:
    script = (PAGE / "diagram.js").read_text(encoding="utf-8")
    found = {
        kind: color_of(name) for kind, name in re.findall(r'"?([\w-]+)"?: \["[\w-]+", "--([\w-]+)", \d+\]', script)
    }
    assert found == {kind.value: symbol_style(kind).color for kind in Kind.known()}


def test_loci_have_the_colours_of_their_special_points() -> None:
    for kind in (Kind.FOLD, Kind.FLIP, Kind.NEIMARK_SACKER, Kind.GRAZING):
        assert locus_options(kind, 0)["color"] == symbol_style(kind).color
