"""Chromium for the tests of the page: the one of the system, driven by Playwright; nothing is downloaded."""

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")
_PATIENCE = 30.0  # seconds


def chromium() -> str:
    """The path of the browser; without one the test is skipped, but fails in CI."""
    found = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if found is None:
        reason = "no Chromium here: install it (apt-get install chromium) and run these tests again"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser without a window."""
    path = chromium()
    with sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=path, args=list(_FLAGS))
        try:
            yield found
        finally:
            found.close()


def until(page: Page, condition: str) -> None:
    """Wait until a condition holds on the page; its security policy lets no text be evaluated there by itself."""
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        if page.evaluate(condition):
            return
        page.wait_for_timeout(30)
    raise AssertionError(f"{condition} has not come true; the page says: {page.inner_text('#error')}")
