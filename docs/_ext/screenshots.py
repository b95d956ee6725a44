"""Screenshots of the explorer for these pages: it opens examples, is operated, and is photographed.

    python -m docs._ext.screenshots [FOLDER]

writes ``explorer-NAME.png`` into a folder, by default that of the pictures of the documentation. Needs Chromium.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, FloatRect, Page

from tests.explorer.browser import READY, browser, choose_special, opened, served, until

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
EDGE = 6  # pixels round a panel
EXAMPLES = (
    "clutch.toml",
    "den_hartog.toml",
    "drivetrain.toml",
    "engine_start.toml",
    "family.toml",
    "idle.toml",
    "settle.toml",
)


@dataclass(frozen=True)
class Shot:
    """A picture to make.

    Parameters
    ----------
    name
        ``explorer-NAME.png``.
    panel
        The heading of the panel of the page that it shows; empty for the whole window.
    """

    name: str
    panel: str = ""

    @property
    def file(self) -> str:
        """The name of its file."""
        return f"explorer-{self.name}.png"


@dataclass(frozen=True)
class Scene:
    """What is done on the page before some pictures are made of it.

    Parameters
    ----------
    file
        The example that is opened.
    play
        What is done.
    shots
        What is then photographed.
    """

    file: str
    play: Callable[[Page], None]
    shots: tuple[Shot, ...]


def open_first(page: Page) -> None:
    """Show the quick response of a file of which nothing is computed yet."""
    until(page, "Boolean(gapwalk.curves.quick) && document.body.dataset.branches === '0'")
    page.wait_for_timeout(3000)  # until it is whole


def respond(page: Page) -> None:
    """Show figure 13, the branch of period 2 at its first flip, and a motion on it."""
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    choose_special(page, "flip", 6)
    until(page, "!document.getElementById('switch').disabled")
    page.click("#switch")
    until(page, "gapwalk.page.results[1]?.state === 'done' && gapwalk.curves.all.size === 2")
    page.focus("#diagram")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Home")
    for _ in range(3):
        page.keyboard.press("Shift+ArrowLeft")
    rest(page)


def settle(page: Page) -> None:
    """Show a motion that never repeats."""
    page.select_option("#study", "torus")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done'")
    page.click("#results button:text-is('Show')")
    rest(page)


def stick(page: Page) -> None:
    """Show a motion that sticks."""
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    choose_special(page, "crossing-sliding")
    for _ in range(2):
        page.keyboard.press("Shift+ArrowLeft")
    rest(page)


def follow(page: Page) -> None:
    """Show the locus of a flip over frequency and excitation, with the points at which it meets other curves."""
    page.focus("#diagram")
    page.keyboard.press("ArrowDown")  # from the doubled branch to the first one
    choose_special(page, "flip", 6)
    page.select_option("#locus-parameter", "harmonic1.amplitude")
    page.fill("#locus-low", "0.05")
    page.fill("#locus-high", "0.6")
    until(page, "!document.getElementById('locus').disabled")
    page.click("#locus")
    until(page, "gapwalk.page.results[2]?.state === 'done'")
    page.wait_for_timeout(1500)  # for the curve


def answer(page: Page) -> None:
    """Show where the idling gearbox rattles."""
    page.select_option("#study", "rattle")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && Boolean(gapwalk.answer.content)")
    page.wait_for_timeout(1500)  # for the curves


def turn(page: Page) -> None:
    """Show what moves a flip of the first branch, which is chosen already."""
    choose_special(page, "flip")
    until(page, "Boolean(gapwalk.motion.details)")
    page.evaluate("gapwalk.movers.open()")
    until(page, "gapwalk.movers.found?.rows.length > 4 && gapwalk.diagram.arrows.length > 0")
    page.fill("#movers-percent", "5")
    rest(page)
    until(page, "gapwalk.movers.found.rows.some(({ name }) => name === 'stage2.clearance')")


def edit(page: Page) -> None:
    """The model editor: the text of a drive train, its machine, its response, and sliders for its numbers."""
    page.click("#edit-open")
    until(page, "gapwalk.editor.chart.curve?.whole && !gapwalk.editor.isBusy")
    assert not page.inner_text("#edit-response-note").startswith("stopped")
    page.evaluate("gapwalk.editor.text.go(19)")
    page.wait_for_timeout(500)


def begin(page: Page) -> None:
    """The drawings of what a new model begins with."""
    page.click("#edit-new")
    until(page, "document.querySelectorAll('#edit-starts-list svg').length > 9")


def leave_editor(page: Page) -> None:
    """Go back to the results."""
    page.click("#edit-close")


def tabulate(page: Page) -> None:
    """Show the curve as a table."""
    page.click("#table-open")


def untabulate(page: Page) -> None:
    """Hide it again."""
    page.click("#table-open")


def deepen(page: Page) -> None:
    """Show a family of responses in three dimensions."""
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && Boolean(gapwalk.answer.content)")
    until(page, "gapwalk.curves.all.size === 6 && !gapwalk.page.updating")
    page.select_option("#z", "of the family")
    until(page, "Boolean(gapwalk.depth.space.content)")


def turn_torus(page: Page) -> None:
    """Show a torus in three dimensions; it has settled already."""
    page.click("#results button:text-is('Show')")
    until(page, "Boolean(gapwalk.motion.details)")
    page.click("#solid-figure summary")
    rest(page)
    until(page, "(gapwalk.motion.solid.space.content?.dots.length ?? 0) > 100")


def run_up(page: Page) -> None:
    """Show a run-up and down through the jump of a dual-mass flywheel, at an instant on the way up."""
    page.click("summary:text-is('Run up, and listen')")
    until(page, "document.getElementById('run-up-hint').textContent !== ''")  # its range is proposed then
    for name, value in (("low", "200"), ("high", "600"), ("seconds", "8")):
        page.fill(f"#run-up-{name}", value)
    page.click("#run-up")
    until(page, "gapwalk.page.results[0]?.state === 'done' && Boolean(gapwalk.answer.heard.found)")
    page.evaluate("gapwalk.answer.heard.seek(4.2)")
    page.wait_for_timeout(1000)


SCENES = (
    Scene("clutch.toml", open_first, (Shot("quick"),)),
    Scene(
        "clutch.toml",
        respond,
        (Shot("light"), Shot("history", "Time history"), Shot("loop", "Contact force")),
    ),
    Scene("clutch.toml", tabulate, (Shot("table", "Diagram"),)),
    Scene("clutch.toml", untabulate, ()),
    Scene("clutch.toml", follow, (Shot("locus", "Diagram"),)),
    Scene("clutch.toml", turn, (Shot("movers", "What moves it most"),)),
    Scene("settle.toml", settle, (Shot("spectrum", "Spectrum"), Shot("section", "Section"))),
    Scene("settle.toml", turn_torus, (Shot("torus", "In three dimensions"),)),
    Scene("family.toml", deepen, (Shot("depth", "Diagram"),)),
    Scene("engine_start.toml", run_up, (Shot("heard", "Diagram"),)),
    Scene("den_hartog.toml", stick, (Shot("strip", "Time history"), Shot("hysteresis", "Hysteresis loop"))),
    Scene("idle.toml", answer, (Shot("answer"),)),
    Scene("drivetrain.toml", edit, (Shot("editor"),)),
    Scene("drivetrain.toml", begin, (Shot("new"),)),
    Scene("drivetrain.toml", leave_editor, ()),
)
SHOTS = tuple(shot for scene in SCENES for shot in scene.shots)


def rest(page: Page) -> None:
    """Wait until a motion is shown whole, and stop it where something touches."""
    until(page, "gapwalk.motion.motion && document.querySelectorAll('#section .dot').length > 0")
    page.wait_for_timeout(800)  # what was asked for on the way is not shown any more
    until(page, "document.getElementById('next').hidden || !document.querySelector('#next-steps button:disabled')")
    page.evaluate("gapwalk.motion.machine.at(Math.round(0.3 * gapwalk.motion.motion.theta.length))")


def panel(page: Page, heading: str):
    """The panel of a heading: a figure, a fold of the controls, a section or a dialog."""
    if heading == "Diagram":
        return page.locator("#picture")
    for part in (
        f"figure:has(> figcaption:text-is('{heading}')):visible",
        f"details:has(> summary:text-is('{heading}')):visible",
        f"dialog:has(> h2:text-is('{heading}')):visible",
    ):
        if page.locator(part).count():
            return page.locator(part)
    raise LookupError(f"the page has no panel {heading!r}")


def photograph(page: Page, shot: Shot, folder: Path) -> None:
    """Write one picture, in 256 colours: as good to the eye, and a third of the size."""
    page.evaluate("document.activeElement.blur()")  # no frame round what has the focus
    if shot.panel:
        found = panel(page, shot.panel)
        found.scroll_into_view_if_needed()
        box = found.bounding_box()
        assert box is not None
        x, y, wide, high = (box[key] for key in ("x", "y", "width", "height"))
        clip = FloatRect(x=x - EDGE, y=y - EDGE, width=wide + 2 * EDGE, height=high + 2 * EDGE)
        data = page.screenshot(clip=clip)
    else:
        page.evaluate("document.getElementById('motion').scrollTop = 0")
        data = page.screenshot()
    picture = Image.open(io.BytesIO(data)).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, kmeans=8)
    picture.save(folder / shot.file, optimize=True)


def make_pictures(chrome: Browser, address: str, folder: Path, scenes: tuple[Scene, ...] = SCENES) -> None:
    """Play all scenes, and photograph them."""
    page = chrome.new_page(viewport={"width": 1280, "height": 800}, device_scale_factor=1.5, reduced_motion="reduce")
    page.goto(address)
    until(page, READY)
    for scene in scenes:
        if page.evaluate("gapwalk.page.about.file") != scene.file:
            opened(page, scene.file)
        scene.play(page)
        for shot in scene.shots:
            photograph(page, shot, folder)
            print(shot.file, flush=True)


def main(folder: Path = PICTURES) -> None:
    """Serve copies of the examples, and make all pictures."""
    with tempfile.TemporaryDirectory() as place:
        for name in EXAMPLES:
            shutil.copy(ROOT / "examples" / name, place)
        with served(Path(place) / EXAMPLES[0]) as address, browser() as chrome:
            make_pictures(chrome, address, folder)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
