"""Many special points stay readable, on screens of all sizes."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page

from gapwalk.explorer.motion_panels import scenes_of
from gapwalk.studies import read_studies
from tests.explorer.browser import boxes, opened, overlap, until, watched
from tests.explorer.conftest import CLUTCH, STOP
from tests.explorer.serving import serving
from tests.explorer.test_machine_page import TRAIN

STUDY = 'kind = "response"\nparameter = "speed"\nfrom = "1500 rpm"\nto = "1450 rpm"\nmeasure = "max.mesh"\n'

# one curve with 220 special points of five kinds, most of them in four heaps, which no news from the server takes away
MANY = """() => {
    const { curves, diagram } = gapwalk, n = 400, kinds = ["fold", "flip", "neimark-sacker", "branch-point", "grazing"];
    const words = { fold: "fold (LP)", flip: "flip (PD)", "neimark-sacker": "NS", "branch-point": "BP", grazing: "G" };
    const label = { fold: "LP", flip: "PD", "neimark-sacker": "NS", "branch-point": "BP", grazing: "" };
    const x = new Float64Array(n), y = new Float64Array(n), special = [];
    for (let i = 0; i < n; i++) [x[i], y[i]] = [i / n, Math.sin((9 * i) / n)];
    for (let k = 0; k < 220; k++) {
        const t = k < 20 ? (k + 0.5) / 20 : (k % 4) * 0.2 + 0.15 + 1e-4 * (k - 20), kind = kinds[k % 5];
        special.push({ kind, text: words[kind], label: label[kind], x: t, y: Math.sin(9 * t), lines: ["at 1"] });
    }
    const more = { key: "many/0", result: "many", branch: 0, name: "P1-1", period: 1, count: n };
    curves.update = async () => false;
    curves.clear();
    curves.all.set(more.key, { ...more, x, y, node: Int32Array.from(x.keys()), label: new Uint8Array(n), special });
    diagram.fit();
}"""
SHOWN = """(() => {
    const { place, clusters } = gapwalk.diagram, drawn = place.data.filter(({ customdata, name }) => customdata && name !== "clusters");
    const inside = ({ x, y }) => { const { xaxis, yaxis } = place._fullLayout; return x >= xaxis.range[0] && x <= xaxis.range[1] && y >= yaxis.range[0] && y <= yaxis.range[1]; };
    const single = drawn.reduce((sum, trace) => sum + [...trace.x.keys()].filter((k) => inside({ x: trace.x[k], y: trace.y[k] })).length, 0);
    return [single, clusters.map(({ points }) => points.length)];
})()"""  # noqa: E501
PLACE = """(number) => {
    const { place, clusters } = gapwalk.diagram, { xaxis, yaxis } = place._fullLayout;
    const box = place.getBoundingClientRect();
    const { x, y } = clusters[number];
    return [box.left + xaxis._offset + xaxis.l2p(x), box.top + yaxis._offset + yaxis.l2p(y)];
}"""
# the boxes of capital letters as they are seen: without what the font keeps free above and below them
INK = """(all) => all.map((each) => {
    const { left, right, bottom } = each.getBoundingClientRect();
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = getComputedStyle(each).font;
    const { actualBoundingBoxAscent: above, fontBoundingBoxDescent: below } = pen.measureText(each.textContent);
    return [left, bottom - below - above, right, bottom - below];
})"""


def marks_at_rest(page: Page) -> tuple[int, list[int]]:
    """The marks once they no longer change: the page draws again some time after its window has another size."""
    before = None
    for _ in range(20):
        shown = page.evaluate(SHOWN)
        if shown == before:
            break
        before = shown
        page.wait_for_timeout(500)
    return before


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """The page of a folder with a train and an oscillator; no errors, and no request to anyone else."""
    folder = tmp_path_factory.mktemp("look")
    file = folder / "train.toml"
    file.write_text(TRAIN.partition("[study]")[0] + "[study]\n" + STUDY, encoding="utf-8")
    (folder / "stop.toml").write_text(STOP, encoding="utf-8")
    with serving(file) as address, watched(address) as page:
        yield page


@pytest.fixture(autouse=True)
def _curves_come_from_the_server_again(page) -> Iterator[None]:
    yield
    page.evaluate("delete gapwalk.curves.update")


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (3840, 2160), (390, 844)])
def test_many_special_points_become_clusters_and_no_texts_meet(page, width, height) -> None:
    opened(page, "stop.toml")
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(200)
    page.evaluate(MANY)
    single, clusters = marks_at_rest(page)
    assert single + sum(clusters) == 220  # none is lost
    assert 3 <= len(clusters) <= 60
    letters = boxes(page, "#diagram .textpoint text")
    assert len(letters) > len(clusters) + 3  # the number of each cluster, and letters beside single points
    assert not any(overlap(a, b) for k, a in enumerate(letters) for b in letters[:k])
    symbols = boxes(page, "#diagram .points path")  # ticks of grazing have no width, and no box
    assert page.locator("#diagram .points path").count() == single + len(clusters)
    words = page.locator("#diagram .textpoint text >> text=/^[A-Z]/").evaluate_all(INK)
    assert len(words) == len(letters) - len(clusters)
    assert [(word, symbol) for word in words for symbol in symbols if overlap(word, symbol)] == []
    names = re.findall(r"[^\n]+", page.inner_text("#legend"))
    assert "fold (LP)" in names
    assert "number of special points: click to open" in names
    entries = boxes(page, "#legend li")
    assert not any(overlap(a, b) for k, a in enumerate(entries) for b in entries[:k])


def test_a_cluster_opens_and_what_it_says_covers_neither_pointer_nor_curve(page) -> None:
    opened(page, "stop.toml")
    page.set_viewport_size({"width": 1280, "height": 720})
    page.wait_for_timeout(200)
    page.evaluate(MANY)
    _, clusters = page.evaluate(SHOWN)
    number = clusters.index(max(clusters))
    x, y = page.evaluate(PLACE, number)
    page.mouse.move(x, y)
    until(page, "!gapwalk.diagram.tip.hidden")
    assert page.inner_text("#diagram .tip").startswith(f"{max(clusters)} special points\n")
    (tip,) = boxes(page, "#diagram .tip")
    assert not (tip[0] - 10 < x < tip[2] + 10 and tip[1] - 10 < y < tip[3] + 10)
    assert page.locator("#diagram .hoverlayer").is_hidden()
    before = page.evaluate("gapwalk.diagram.place._fullLayout.xaxis.range")
    page.mouse.click(x, y)
    after = page.evaluate("gapwalk.diagram.place._fullLayout.xaxis.range")
    assert after[1] - after[0] < 0.2 * (before[1] - before[0])
    single, opened_ = page.evaluate(SHOWN)
    assert max(opened_, default=0) < max(clusters)
    assert single + sum(opened_) >= max(clusters)
    page.click("#fit")
    assert page.evaluate("gapwalk.diagram.place._fullLayout.xaxis.range") == before


@pytest.mark.slow
def test_the_drawing_of_a_machine_does_not_depend_on_its_pace() -> None:
    """All points of a branch over the frequency share one drawing, which is computed once."""
    for name in ("clutch", "train", "drivetrain", "idle", "engine", "reducer", "belt", "rub", "mesh", "bearing"):
        system = read_studies(CLUTCH.with_name(f"{name}.toml"))[0].system
        pace = system.structure.pace
        first = scenes_of(system)
        assert scenes_of(system.at({pace: 1.1 * system[pace]})) is first, name
        assert [each["width"] for each in first] == sorted(each["width"] for each in first)
