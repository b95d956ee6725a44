"""The page while its model file is edited, and while its server is killed and started again."""

import shutil
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

import gapwalk as gw
from tests.explorer.browser import READY, browser, chromium, new_page, opened, served, until
from tests.explorer.conftest import CLUTCH, STOP
from tests.explorer.serving import serving

LONG = STOP + "\n[study.walk]\ninitial_step = 1e-5\nlargest_step = 1e-5\nmax_points = 1000000\n"


@pytest.fixture(scope="module")
def chrome() -> Iterator[Page]:
    chromium()
    with browser() as chrome:
        yield new_page(chrome, viewport={"width": 1280, "height": 720})


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "stop.toml").write_text(STOP, encoding="utf-8")
    (tmp_path / "long.toml").write_text(LONG, encoding="utf-8")
    shutil.copy(CLUTCH, tmp_path)
    return tmp_path


@pytest.fixture
def page(chrome, folder) -> Iterator[Page]:
    with serving(folder / "stop.toml") as address:
        chrome.goto(address)
        until(chrome, READY)
        yield chrome
        chrome.goto("about:blank")


def computed(page: Page, button: str, count: int) -> None:
    page.click(button)
    until(page, f"gapwalk.page.results.length === {count} && gapwalk.page.results.at(-1).state === 'done'")
    until(page, f"gapwalk.curves.all.size === {count}")


def field(page: Page, name: str) -> str:
    return f".parameter[data-name='{name}'] input[type=number]"


def test_what_the_page_shows_is_what_it_computes(page, folder) -> None:
    """The clearance of a chosen result stays as it stands in its field when something else is changed."""
    page.click("summary:text-is('Values')")
    page.fill(field(page, "stop.clearance"), "0.5")
    computed(page, "#compute-values", 1)
    until(page, "[...gapwalk.curves.all.values()][0]?.x.length > 2")  # it is fetched once the result is complete
    page.evaluate("gapwalk.diagram.chosen({ curve: [...gapwalk.curves.all.values()][0], index: 2 })")
    until(page, "gapwalk.motion.motion?.parameters['stop.clearance'] === 0.5")
    until(page, f"document.querySelector(\"{field(page, 'stop.clearance')}\").value === '0.5'")
    page.fill(field(page, "mean.x"), "0.1")
    shown = page.evaluate("[...document.querySelectorAll('.parameter.changed')].map((row) => row.dataset.name)")
    assert {"stop.clearance", "mean.x"} <= set(shown)
    computed(page, "#compute-values", 2)
    last = sorted((folder / "stop.explorer").glob("*.gapwalk"))[-1]
    system = gw.open_result(last).branches[0].points[0].orbit.system
    assert (system["stop.clearance"], system["mean.x"], system["frequency"]) == (0.5, 0.1, 0.7)
    assert "stop.clearance = 0.5" in page.inner_text("#results li:last-child")
    page.click("#reset-file")
    assert page.input_value(field(page, "stop.clearance")) == "1"


def test_an_edit_is_noticed_a_broken_model_is_told_whole_and_results_stay(page, folder) -> None:
    computed(page, "#compute", 1)
    assert page.locator("#results .earlier").count() == 0
    (folder / "stop.toml").write_text(STOP.replace("clearance = 1.0", "clearance = 0.6"), encoding="utf-8")
    until(page, "document.querySelectorAll('#results .earlier').length === 1")
    until(page, f"document.querySelector(\"{field(page, 'stop.clearance')}\").value === '0.6'")
    computed(page, "#compute", 2)
    assert page.locator("#results .earlier").count() == 1
    assert page.evaluate("[...gapwalk.curves.all.values()].map((c) => Boolean(c.earlier)).sort()") == [False, True]
    assert page.is_visible("#legend .of-earlier")
    many = "".join(f"nonsense{i} = {i}\n" for i in range(30))
    (folder / "stop.toml").write_text(many + STOP, encoding="utf-8")
    until(page, "!document.getElementById('error').hidden")
    told = page.inner_text("#error")
    assert all(f"stop.toml:{line}: nonsense{line - 1} is not a key here" in told for line in range(1, 31))
    assert page.is_disabled("#compute")
    assert page.evaluate("gapwalk.curves.all.size") == 2
    page.reload()
    until(page, "window.gapwalk?.curves.all.size === 2")
    assert "nonsense29" in page.inner_text("#error")
    (folder / "stop.toml").write_text(STOP, encoding="utf-8")
    until(page, "document.getElementById('error').hidden && !document.getElementById('compute').disabled")


@pytest.mark.slow
def test_after_a_kill_and_a_restart_the_page_goes_on_by_itself(chrome, folder) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with served(folder / "long.toml", port, end=signal.SIGKILL) as address:
        chrome.goto(address)
        until(chrome, READY)
        opened(chrome, "long.toml")
        chrome.click("#compute")
        until(chrome, "[...gapwalk.curves.all.values()][0]?.count > 10")
    until(chrome, "document.getElementById('status').textContent.includes('does not answer')")
    with served(folder / "long.toml", port):
        until(chrome, "gapwalk.page.results[0]?.state === 'stopped'")
        until(chrome, "[...gapwalk.curves.all.values()][0].count === gapwalk.page.results[0].branches[0].points")
        assert chrome.locator("#results button:text-is('Resume')").count() == 1
        assert "is being computed" not in chrome.inner_text("#results")
        assert "does not answer" not in chrome.inner_text("#status")
        chrome.goto("about:blank")
