"""The explorer in a browser: how long a motion takes to appear, and how smoothly many points pan and zoom.

    python -m benchmarks.explorer

This needs Chromium. Times are wall-clock milliseconds, so measure on an idle machine; beside those of a click stand the
CPU times of what the page and the server do for it. Without a GPU, frames take longer than in ordinary use.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import CDPSession, Page

import gapwalk as gw
from gapwalk.explorer.motion_panels import panels_of
from tests.explorer.browser import READY, browser, served, until

MODEL = Path(__file__).parents[1] / "examples" / "clutch.toml"
CLICKS = 100  # on points along the branch, a motion each

# 200 branches of 2,000 points each, in pieces of all kinds of stability
MANY = """() => {
    const { curves, diagram } = gapwalk;
    curves.clear();
    for (let b = 0; b < 200; b++) {
        const n = 2000, x = new Float64Array(n), y = new Float64Array(n);
        const node = new Int32Array(n), label = new Uint8Array(n);
        for (let i = 0; i < n; i++) {
            const t = i / (n - 1);
            x[i] = 0.2 + 1.6 * t + 0.02 * Math.sin(9 * t + b);
            y[i] = 1 + b * 0.02 + 0.5 * Math.sin(6 * t + b * 0.3) + 0.2 * Math.cos(31 * t + b);
            [node[i], label[i]] = [i, Math.floor(t * 8 + b) % 4];
        }
        const curve = { key: `b/${b}`, result: "b", branch: b, name: "P1-1", period: 1, count: n, special: [] };
        curves.all.set(curve.key, { ...curve, x, y, node, label });
    }
    const times = [];
    for (let k = 0; k < 5; k++) { diagram.draw(); times.push(diagram.drawTime); }
    return times;
}"""
# the place on the screen of the point nearest to a fraction of the branch that is in no cluster
PLACE = """(share) => {
    const { curves, diagram } = gapwalk, [curve] = curves.all.values();
    const { xaxis, yaxis } = diagram.place._fullLayout, box = diagram.place.getBoundingClientRect();
    const at = (x, y) => [box.left + xaxis._offset + xaxis.l2p(x), box.top + yaxis._offset + yaxis.l2p(y)];
    const covered = diagram.clusters.map(({ x, y }) => at(x, y));
    const places = [...curve.node.keys()].filter((k) => curve.node[k] >= 0).map((k) => at(curve.x[k], curve.y[k]));
    const free = places.filter(([px, py]) => covered.every(([qx, qy]) => Math.hypot(px - qx, py - qy) > 14));
    return free[Math.floor(share * free.length)];
}"""
# from the release of the mouse to the frame after the one in which the motion is drawn: then it is on the screen
SEEN = """() => {
    let pressed = 0;
    window.seen_ = [];
    window.addEventListener("pointerup", () => { pressed = performance.now(); }, true);
    new MutationObserver(() => {
        const from = pressed, drawn = performance.now();
        requestAnimationFrame(() => setTimeout(() => seen_.push([performance.now() - from, drawn - from]), 0));
    }).observe(document.body, { attributeFilter: ["data-shown"] });
}"""
FRAMES = """() => {
    window.frames_ = [];
    let last = performance.now();
    const frame = () => {
        const now = performance.now();
        frames_.push(now - last);
        last = now;
        requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
}"""


def main() -> None:
    """Measure, and print a line for each figure."""
    with copied() as model, served(model) as address, browser() as chrome:
        page = chrome.new_page(viewport={"width": 1280, "height": 720})
        page.goto(address)
        until(page, READY)
        page.click("#compute")
        until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
        times, busy = click(page)
        say(f"a motion is on the screen after a click ({CLICKS} clicks)", times)
        print(
            f"of which the page computes {busy:.0f} ms of CPU time per click, with all panels and answers that follow"
        )
        print(f"and the server {1e3 * computed():.0f} ms of CPU time for the motion", flush=True)
        say("200 branches of 2,000 points are drawn", page.evaluate(MANY))
        page.evaluate(FRAMES)
        say("frames of a drag", drag(page))
        say("frames while zooming", zoom(page))


def click(page: Page) -> tuple[list[float], float]:
    """Click on points all along the branch.

    Returns
    -------
    times : list of float
        Milliseconds from each click to its motion on the screen.
    busy : float
        CPU milliseconds of the page's main thread per click, until everything has come that a click asks for.
    """
    page.evaluate(SEEN)
    tool = page.context.new_cdp_session(page)
    tool.send("Performance.enable", {"timeDomain": "threadTicks"})
    before = busy(tool)
    for k in range(CLICKS):
        place = page.evaluate(PLACE, (k + 0.5) / CLICKS)
        page.mouse.click(*place)
        until(page, f"seen_.length > {k}")
        page.wait_for_timeout(150)  # spectrum and section come after
    return [seen for seen, _ in page.evaluate("seen_")], (busy(tool) - before) / CLICKS


def busy(tool: CDPSession) -> float:
    """Return the CPU milliseconds of the page's main thread so far."""
    found = {each["name"]: each["value"] for each in tool.send("Performance.getMetrics")["metrics"]}
    return 1e3 * found["TaskDuration"]


def computed() -> float:
    """Return the CPU seconds in which the server computes the motion of a click, the median over the branch."""
    branch = gw.run(gw.read_study(MODEL)).branches[0]
    times = []
    for point in branch.points[:: max(1, len(branch.points) // CLICKS)]:
        began = time.process_time()
        panels_of(point.orbit, "q1")
        times.append(time.process_time() - began)
    return sorted(times)[len(times) // 2]


def drag(page: Page) -> list[float]:
    """Return the milliseconds of each frame while the diagram is dragged."""
    x, y = middle(page)
    page.mouse.move(x, y)
    page.mouse.down()
    for i in range(40):
        page.mouse.move(x + 3 * i, y + i)
        page.wait_for_timeout(8)
    frames = page.evaluate("frames_.splice(0)")
    page.mouse.up()
    page.wait_for_timeout(800)
    page.evaluate("frames_.splice(0)")
    return frames


def zoom(page: Page) -> list[float]:
    """Return the milliseconds of each frame while the wheel is turned."""
    page.mouse.move(*middle(page))
    for _ in range(20):
        page.mouse.wheel(0, -60)
        page.wait_for_timeout(16)
    return page.evaluate("frames_.splice(0)")


def middle(page: Page) -> tuple[float, float]:
    """Return the middle of the diagram."""
    box = page.locator("#diagram").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def say(what: str, times: Sequence[float]) -> None:
    """Print the median of some times, and their 90th percentile."""
    ordered = sorted(times)
    print(
        f"{what}: {ordered[len(ordered) // 2]:.0f} ms; slowest tenth {ordered[int(0.9 * len(ordered))]:.0f} ms",
        flush=True,
    )


@contextmanager
def copied() -> Iterator[Path]:
    """Copy the clutch to its own folder."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(shutil.copy(MODEL, folder))


if __name__ == "__main__":
    main()
