"""``gapwalk compare`` of maps: which cells have other labels, how many of how many, and the exit code."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.cli import main
from gapwalk.errors import ModelError
from gapwalk.studies.compare import compare_cells
from gapwalk.studies.export import save_tables
from tests import models
from tests.tiers import keeps

PLANE = 'second = { parameter = "harmonic1.amplitude", from = 0.05, to = 0.4 }\nresolution = [4, 3]\n'
ALONG = 'parameter = "frequency"\nfrom = 0.6\nto = 1.4\n'
STUDIES = {
    "regimes": f'kind = "regimes"\n{ALONG}{PLANE}check = 0\nworkers = 1\n',
    "rattle": f'kind = "rattle"\n{ALONG}{PLANE}workers = 1\n',
    "basins": 'kind = "basins"\nplane = { x = [-2.0, 0.25], "x\'" = [-1.0, 1.0] }\nresolution = [4, 3]\n'
    "exact_borders = false\ncheck = 0\nworkers = 1\n",
}
COLUMN = {"regimes": "regime", "rattle": "state.stop", "basins": "leads.to"}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Callable[[str, str], Path]:
    """The result of a small map of a kind, with its tables, over a clearance of 1 (a) or of 0.3 (b)."""
    folder = tmp_path_factory.mktemp("maps")

    @cache
    def make(kind: str, name: str) -> Path:
        text = models.STOP.replace("x = [-2.0, 0.9]", "")
        if name == "b":
            text = text.replace("clearance = 1.0", "clearance = 0.3")
        path = folder / f"{kind}-{name}.gapwalk"
        path.with_suffix(".toml").write_text(f"{text}\n[study]\n{STUDIES[kind]}")
        save_tables(gw.run(gw.read_study(path.with_suffix(".toml")), path), path.with_suffix(""))
        return path

    return make


def labels(path: Path, column: str) -> dict[tuple[str, str], str]:
    """The labels of the cells by their places, from the table of a run."""
    (table,) = path.parent.glob(f"{path.stem}-cells.csv")
    rows = csv.DictReader(table.read_text(encoding="utf-8").splitlines())
    return {tuple(list(row.values())[:2]): row[column] for row in rows}


@keeps("regimes", "basins")
@pytest.mark.parametrize("kind", STUDIES)
def test_cells_that_differ_are_counted_and_named(kind, made, capsys) -> None:
    a, b = (made(kind, name) for name in "ab")
    capsys.readouterr()
    assert main(["compare", str(a), str(a)]) == 0
    assert "0 of 12 cells differ: they agree within a share of 0.001" in capsys.readouterr().out
    before, after = labels(a, COLUMN[kind]), labels(b, COLUMN[kind])
    expected = {place for place in before if before[place] != after[place]}
    if kind == "rattle":
        assert expected
    assert main(["compare", str(a), str(b), "--json"]) == (4 if expected else 0)
    document = json.loads(capsys.readouterr().out)
    assert (document["agree"], document["cells"]) == (not expected, 12)
    found = {tuple(each["at"]): (each["first"], each["second"]) for each in document["cell_differences"]}
    assert {tuple(map(float, place)) for place in expected} == set(found)
    assert {(before[place], after[place]) for place in expected} <= set(found.values())
    (count,) = document["different"].values()
    assert count == len(expected)
    assert main(["compare", str(a), str(b), "--tolerance", "1.0"]) == 0
    out = capsys.readouterr().out
    assert f"{count} of 12 cells differ" in out
    assert "stop.clearance is 1 in the first and 0.3 in the second" in out


def test_maps_that_cannot_be_compared_are_refused_in_a_sentence(made, capsys) -> None:
    path = made("regimes", "a")
    regimes, rattle = str(path), str(made("rattle", "a"))
    assert main(["compare", regimes, rattle]) == 2
    assert (
        "the first result is of the kind regimes, the second result is of the kind rattle;" in capsys.readouterr().err
    )
    fine = path.with_name("fine.toml")
    fine.write_text(path.with_suffix(".toml").read_text().replace("[4, 3]", "[4, 4]"))
    gw.run(gw.read_study(fine), fine.with_suffix(".gapwalk"))
    assert main(["compare", regimes, str(fine.with_suffix(".gapwalk"))]) == 2
    error = capsys.readouterr().err
    assert "(3), the second" in error
    assert "compare maps over the same cells" in error
    assert main(["compare", regimes, regimes, "--output", "x.png"]) == 2
    assert "leave --output out" in capsys.readouterr().err


def test_a_map_whose_axes_are_reversed_or_exchanged_has_the_same_cells(made) -> None:
    result = gw.open_result(made("regimes", "a"))
    chart = result.finding.record
    marked = replace(chart, regimes=chart.regimes.copy())
    marked.regimes[0, 3] = 2  # one chaotic cell, in a corner
    first = replace(result, finding=replace(result.finding, found=marked))
    parts = ("regimes", "periods", "exponents", "peak_force", "impacts", "states")
    turned = replace(
        marked,
        within=(marked.within[0][::-1], marked.within[1]),
        **{name: getattr(marked, name)[:, ::-1] for name in parts},
    )
    exchanged = replace(
        marked,
        first=marked.second,
        second=marked.first,
        within=marked.within[::-1],
        **{name: np.swapaxes(getattr(marked, name), 0, 1) for name in parts},
    )
    for other in (turned, exchanged):
        assert not compare_cells(first, replace(result, finding=replace(result.finding, found=other))).differences
    (found,) = compare_cells(result, first).differences
    assert found.labels == ("period 1", "chaotic")
    assert found.place == pytest.approx((1.3, 0.05 + 0.35 / 6))


def test_basins_of_one_motion_are_the_same_whatever_their_letters(made) -> None:
    """Letters follow the sizes of basins: those of two mirrored motions may be exchanged."""
    result = gw.open_result(made("basins", "a"))
    basins = result.finding.record
    one = basins.attractors[0]
    other = replace(one, strobes=-one.strobes)
    checkered = np.indices(basins.labels.shape).sum(axis=0) % 2
    a = replace(basins, attractors=(one, other), labels=checkered)
    b = replace(basins, attractors=(other, one), labels=1 - checkered)
    both = [replace(result, finding=replace(result.finding, found=each)) for each in (a, b)]
    assert a.names == ("period 1a", "period 1b")
    assert compare_cells(*both).within_share(0.0)
    less = replace(basins, attractors=(one,), labels=np.zeros_like(checkered))
    found = compare_cells(both[0], replace(result, finding=replace(result.finding, found=less)))
    assert found.counts == {"leads to": 6}
    assert {each.labels for each in found.differences} == {("period 1b", "period 1a")}
    with pytest.raises(ModelError, match="compare two maps of one kind"):
        compare_cells(both[0], gw.open_result(made("regimes", "a")))
