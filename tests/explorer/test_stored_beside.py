"""A model beside which a run has stored results: the page names them and opens them, instead of calling it empty."""

import io

import gapwalk as gw
from tests.explorer.browser import opened, until, watched
from tests.explorer.conftest import STOP
from tests.explorer.serving import serving


def test_results_of_a_run_are_named_and_opened(tmp_path) -> None:
    for name in ("stop.toml", "stopper.toml"):
        (tmp_path / name).write_text(STOP, encoding="utf-8")
    study = gw.read_study(io.StringIO(STOP))
    for name in ("stop.gapwalk", "stop-light.gapwalk", "stopper.gapwalk"):
        gw.run(study, tmp_path / name)
    with serving(tmp_path / "stop.toml") as address, watched(address) as page:
        opened(page, "stop.toml")
        page.wait_for_selector("#empty a")
        text = page.inner_text("#empty")
        assert text.startswith("Stored results of this file: stop-light.gapwalk, stop.gapwalk. ")
        assert "Nothing is computed" not in text
        assert "Compute follows the periodic motions exactly" in text
        page.click("#empty a >> nth=1")
        until(page, "gapwalk.page.about?.file === 'stop.gapwalk' && gapwalk.curves.all.size > 0")
        assert page.input_value("#file") == "stop.gapwalk"
