"""The picture of a kept page for the documentation: ``make screenshots``."""

import sys
import tempfile
from pathlib import Path

import gapwalk as gw
from tests.explorer.browser import browser, new_page, until
from tests.explorer.conftest import CLUTCH


def take_picture(path: Path) -> None:
    """Save the page of the clutch with the motion at a fold, in a picture."""
    with tempfile.TemporaryDirectory() as folder, browser() as chrome:
        file = Path(folder) / "clutch.html"
        gw.save_html(gw.run(gw.read_study(CLUTCH)), file)
        page = new_page(chrome, viewport={"width": 1280, "height": 800}, offline=True)
        page.goto(file.as_uri())
        until(page, "Number(document.body.dataset.branches) === 1")
        page.focus("#diagram")
        page.keyboard.press("End")
        for _ in range(5):
            page.keyboard.press("Shift+S")
        until(page, "document.querySelectorAll('#history path.curve').length === 1")
        page.evaluate("document.activeElement.blur()")
        page.wait_for_timeout(1200)  # so that the parts have moved
        page.screenshot(path=path)


if __name__ == "__main__":
    take_picture(Path(sys.argv[1]))
