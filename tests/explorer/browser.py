"""The explorer in Chromium, driven by Playwright: for the tests of the page, its benchmark, and its pictures.

The browser is that of the system; nothing is downloaded.
"""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright
from playwright.sync_api import TimeoutError as PatienceEnded

from tests.waiting import PATIENCE

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")

# each request of the page begins up to some milliseconds later: what a test does not wait for then shows
_DELAYED = """const at_once = window.fetch;
window.fetch = (...asked) => new Promise((go) => setTimeout(go, Math.random() * %g)).then(() => at_once(...asked));"""

READY = "Boolean(window.gapwalk?.page.about)"
"""A file is open on the page."""


def chromium() -> str:
    """The path of the browser; without one a test is skipped, but fails in CI."""
    found = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if found is None:
        reason = "no Chromium here: install it (apt-get install chromium) and run this again"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@contextmanager
def started() -> Iterator[Browser]:
    """A new browser without a window."""
    path = chromium()
    with sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=path, args=list(_FLAGS))
        try:
            yield found
        finally:
            found.close()


_keeper: ExitStack | None = None
_kept: list[Browser] = []


@contextmanager
def browser_kept() -> Iterator[None]:
    """Within it, `browser` starts one browser, which is closed at its end."""
    global _keeper  # noqa: PLW0603
    with ExitStack() as _keeper:
        yield
    _kept.clear()
    _keeper = None


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser that has no page open, and remembers none."""
    if _keeper is None:
        with started() as found:
            yield found
        return
    if not _kept:
        _kept.append(_keeper.enter_context(started()))
    (found,) = _kept
    before = found.contexts
    try:
        yield found
    finally:
        for context in found.contexts:
            if context not in before:
                context.close()


@contextmanager
def served(file: Path, port: int = 0, *, end: int = signal.SIGINT) -> Iterator[str]:
    """The address of the explorer of a file, as the command prints it; it ends by Ctrl-C, or another signal."""
    command = [sys.executable, "-m", "gapwalk", "explore", str(file), "--no-browser", "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            assert str((file if file.is_dir() else file.parent).resolve()) in server.stdout.readline()
            yield server.stdout.readline().strip()
        finally:
            server.send_signal(end)
        assert server.wait() in (0, 130, -end)


def new_page(chrome: Browser | None, **options: Any) -> Page:
    """A page in a context of its own, in which all waits are as patient as `until`: the machine may be busy.

    By default its machines stand still: to draw them again in each frame takes more time than all that is tested.
    """
    assert chrome is not None  # a page has lost its browser
    context = chrome.new_context(**{"reduced_motion": "reduce", **options})
    context.set_default_timeout(1e3 * PATIENCE)
    if delay := os.environ.get("GAPWALK_DELAYS"):
        context.add_init_script(_DELAYED % float(delay))
    return context.new_page()


def until(page: Page, condition: str) -> None:
    """Wait until a condition holds on the page, which looks itself: to ask it all the time takes a sixth of a core.

    The page's security policy lets no text be evaluated there by itself, so the condition is made a function.
    A result is marked as done before the page has all of its curves: with a result that is done these are waited for.
    """
    if "'done'" in condition:
        condition = f"({condition}) && !gapwalk.page.updating"
    try:
        page.wait_for_function(f"() => ({condition})", polling=10, timeout=1e3 * PATIENCE)
    except PatienceEnded:
        text = page.inner_text("#error")
        raise AssertionError(f"{condition} has not come true; the page says: {text}") from None


@contextmanager
def watched(address: str, *, height: int = 720, ready: str = READY) -> Iterator[Page]:
    """The page at an address, with an ear for errors, and for requests to anyone else: there are none."""
    wrong: list[str] = []
    own = (address.partition("?")[0], "blob:", "data:")
    with browser() as chrome:
        page = new_page(chrome, viewport={"width": 1280, "height": height}, accept_downloads=True)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
        page.on("request", lambda asked: None if asked.url.startswith(own) else wrong.append(asked.url))
        page.goto(address)
        until(page, ready)
        yield page
    assert wrong == [], wrong


def opened(page: Page, file: str) -> None:
    """Choose a file, and wait until it is open, with all its curves."""
    page.select_option("#file", file)
    until(page, f"gapwalk.page.about?.file === '{file}' && !gapwalk.page.updating")


def choose_special(page: Page, kind: str, count: int = 1) -> None:
    """Walk by keyboard along a branch to the next special point of a kind, or to one further on."""
    page.focus("#diagram")
    page.keyboard.press("Home")
    for _ in range(30):
        page.keyboard.press("s")
        count -= page.evaluate("gapwalk.page.chosen.special?.kind") == kind
        if not count:
            return
    raise AssertionError(f"no such {kind} on the branch")


BOXES = """(all) => all.filter((each) => each.checkVisibility({ visibilityProperty: true }))
    .map((each) => each.getBoundingClientRect()).filter(({ width, height }) => width > 0 && height > 0)
    .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""


def boxes(page: Page, what: str) -> list[tuple[float, float, float, float]]:
    """Left, top, right and bottom of all visible elements, at one moment, after the next frame."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return [(left, top, right, bottom) for left, top, right, bottom in page.locator(what).evaluate_all(BOXES)]


def overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Return True if two boxes share more than a pixel."""
    return min(a[2], b[2]) - max(a[0], b[0]) > 1.0 and min(a[3], b[3]) - max(a[1], b[1]) > 1.0


Node = tuple[str, str]
"""The role and the name of a part of the page, as a screen reader has them."""


def tree_of(page: Page) -> tuple[list[Node], list[Node]]:
    """Return the parts of the tree that a screen reader reads, and those of them that take the focus."""
    tool = page.context.new_cdp_session(page)
    nodes = tool.send("Accessibility.getFullAXTree")["nodes"]
    tool.detach()
    found = [(str(node["role"]["value"]), str(node.get("name", {}).get("value", ""))) for node in nodes]
    takes = [
        any(each["name"] == "focusable" and each["value"].get("value") for each in node.get("properties", ()))
        for node in nodes
    ]
    return found, [each for each, is_taken in zip(found, takes, strict=True) if is_taken]


_HOLDERS = {"RootWebArea", "generic", "figure", "MenuListPopup", "scrollable"}  # of things that have names


def nameless(nodes: list[Node]) -> list[Node]:
    """Return those parts that a screen reader cannot name."""
    return [each for each in nodes if not each[1].strip() and each[0] not in _HOLDERS]
