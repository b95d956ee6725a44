"""The model editor in Chromium: from nothing to a growing diagram, without a text editor and without a mouse."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.explorer.browser import boxes, nameless, new_page, opened, overlap, tree_of, until, watched
from tests.explorer.conftest import CLUTCH, STOP
from tests.explorer.serving import serving

CHOOSING = "document.querySelectorAll('[data-start]').length > 5"
WALKED = "gapwalk.editor.chart.curve?.whole && !gapwalk.editor.isBusy && gapwalk.editor.timer === undefined"


LOCUS = """
[[study]]
name = "touch"
kind = "locus"
of = "grazing"
parameter = "frequency"
from = 0.7
to = 0.95
second = { parameter = "harmonic1.amplitude", from = 0.18, to = 0.25 }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("nothing")


@pytest.fixture(scope="module")
def page(folder) -> Iterator[Page]:
    """The page of a folder without a file: it begins in the editor."""
    with serving(folder) as address, watched(address, ready=CHOOSING) as page:
        yield page


def focused(page: Page) -> str:
    return page.evaluate("document.activeElement.id || document.activeElement.dataset.start || ''")


def lines(page: Page, word: str) -> list[str]:
    return [line for line in page.input_value("#edit-text textarea").split("\n") if line.startswith(word)]


def go_to(page: Page, name: str) -> None:
    """Move the focus with the Tab key alone."""
    for _ in range(80):
        if focused(page) == name:
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"{name} cannot be reached with the Tab key")


def test_from_nothing_to_a_growing_diagram_by_keyboard_alone(page, folder) -> None:
    assert focused(page) == "template"
    go_to(page, "clutch")
    page.keyboard.press("Enter")
    until(page, "document.activeElement === document.querySelector('#edit-text textarea')")
    until(page, WALKED)
    assert page.inner_text("#edit-status") == "No errors, not saved yet."
    assert page.locator("#edit-machine svg").count() == 1
    assert list(folder.iterdir()) == []  # nothing is written before it is saved
    page.keyboard.press("Control+Home")
    page.keyboard.type("# My own clutch\n")
    page.keyboard.press("Shift+Tab")
    go_to(page, "edit-name")
    page.keyboard.press("Control+a")
    page.keyboard.type("mine")
    page.keyboard.press("Control+Enter")
    until(page, "gapwalk.page.results?.[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    assert page.locator("#editor").is_hidden()
    assert (folder / "mine.toml").read_text(encoding="utf-8").startswith("# My own clutch\n# Figure 13 of")
    assert page.inner_text("#title") == "Two-stage clutch, moderate mean load"
    assert page.input_value("#file") == "mine.toml"


def edited(page: Page) -> None:
    """Open the editor of the file of the page."""
    if not page.evaluate("gapwalk.editor.isOpen"):
        page.click("#edit-open")
    until(page, "gapwalk.editor.isOpen && !document.getElementById('edit-left').hidden")
    until(page, WALKED)


@pytest.fixture
def stop(page, folder) -> Page:
    """The page with the editor of a file of its own."""
    if page.evaluate("gapwalk.editor.isOpen"):
        page.click("#edit-close")
    (folder / "stop.toml").write_text(
        STOP.replace("clearance = 1.0", "clearance = 1.0  # of the stop"), encoding="utf-8"
    )
    page.reload()
    until(page, "Boolean(window.gapwalk?.page.about)")
    opened(page, "stop.toml")
    edited(page)
    return page


def test_a_slider_changes_the_digits_alone_and_the_curve_follows(stop) -> None:
    size = "gapwalk.editor.chart.curve.y.reduce((sum, y) => sum + y, 0) / gapwalk.editor.chart.curve.y.length"
    before = stop.evaluate(size)
    slider = "#edit-values [data-name='stop.clearance'] input[type=range]"
    stop.focus(slider)
    for _ in range(40):
        stop.keyboard.press("ArrowRight")
    until(stop, f"{WALKED} && Math.abs({size} / {before} - 1) > 0.01")
    assert stop.evaluate("Number(gapwalk.editor.chart.place.dataset.moved)") > 0  # pictures while it moved
    move = "(({ chart }) => { chart.move({}); chart.moved = null; return chart.note.textContent; })(gapwalk.editor)"
    assert "Coarse until it rests" in stop.evaluate(move)
    assert lines(stop, "clearance") == ["clearance = 1.2  # of the stop"]
    assert focused(stop) == ""  # it stays at the slider, which has no id
    assert stop.evaluate(f'document.activeElement === document.querySelector("{slider}")')
    assert stop.input_value("#edit-values [data-name='stop.clearance'] input[type=number]") == "1.2"
    assert "2.2" not in stop.inner_text("#edit-status")
    stop.click("#edit-undo")  # the steps of one slider are one step
    assert lines(stop, "clearance") == ["clearance = 1.0  # of the stop"]
    stop.click("#edit-redo")
    assert lines(stop, "clearance") == ["clearance = 1.2  # of the stop"]
    stop.click("#edit-undo")
    until(stop, WALKED)


def test_shares_and_a_locus_move_with_a_slider_and_are_whole_at_rest(stop, folder) -> None:
    text = (folder / "stop.toml").read_text(encoding="utf-8")
    text = text.replace("[study]", '[[study]]\nname = "amplitude"') + LOCUS
    stop.fill("#edit-text textarea", text)
    until(stop, "!document.getElementById('edit-locus-more').parentElement.hidden")
    stop.click("#edit-shares-more summary")
    until(stop, "gapwalk.editor.kinds.length === 3")
    stop.click("#edit-response", position={"x": 200, "y": 60})  # chooses where starts are sorted
    whole = "gapwalk.editor.live.locus.curve?.whole && document.querySelector('#edit-shares-note').textContent"
    whole = f"{whole}.includes('with 95 % confidence') && {WALKED}"
    until(stop, f"gapwalk.editor.at !== null && {whole}")
    assert stop.locator("#edit-shares .bars rect").count() >= 1
    assert float(stop.input_value("#edit-at")) == stop.evaluate("gapwalk.editor.at")
    before = stop.evaluate("gapwalk.editor.live.locus.curve.x[0]")
    stop.focus("#edit-values [data-name='stop.clearance'] input[type=range]")
    for _ in range(12):
        stop.keyboard.press("ArrowRight")
        stop.wait_for_timeout(60)
    for kind in ("response", "locus", "shares"):
        until(stop, f"Number(document.getElementById('edit-{kind}').dataset.moved) > 0")
    until(stop, whole)
    assert lines(stop, "clearance") == ["clearance = 1.06  # of the stop"]
    assert stop.evaluate("gapwalk.editor.live.locus.curve.x.length") > 20
    assert stop.evaluate("gapwalk.editor.live.locus.curve.x[0]") != before
    stop.click("#edit-shares-more summary")


def test_checks_and_curves_come_at_most_twenty_times_a_second_while_a_slider_moves(stop) -> None:
    counted = stop.evaluate(
        """() => new Promise((done) => {
            const checks = [], drawn = [], { editor } = gapwalk, { chart } = editor;
            const [check, draw] = [editor.check, chart.draw];
            editor.check = function () { checks.push(performance.now()); return check.call(this); };
            chart.draw = function () { drawn.push(performance.now()); return draw.call(this); };
            const slider = document.querySelector("#edit-values [data-name='stop.stiffness'] input[type=range]");
            let k = 0;
            const timer = setInterval(() => {
                const [low, high] = [Number(slider.min), Number(slider.max)];
                slider.value = low + (high - low) * (0.5 + 0.3 * Math.sin(k / 9));
                slider.dispatchEvent(new Event("input"));
                if ((k += 1) < 100) return;
                clearInterval(timer);
                delete editor.check;
                delete chart.draw;
                done({ checks, drawn });
            }, 30);
        })"""
    )
    times = counted["checks"]
    assert len(times) >= 3
    assert min(b - a for a, b in itertools.pairwise(times)) > 45.0
    assert len(counted["drawn"]) <= 20 * (counted["drawn"][-1] - counted["drawn"][0]) / 1000.0 + 4


def test_an_error_has_its_line_a_sentence_and_a_way_there(stop) -> None:
    stop.evaluate("gapwalk.editor.text.go(1)")
    stop.keyboard.press("Control+End")
    stop.keyboard.type("\nmesure = 3\n")
    until(stop, "document.querySelector('#edit-problems li')?.textContent.endsWith('did you mean measure?')")
    told = stop.inner_text("#edit-problems li")
    number = stop.input_value("#edit-text textarea").split("\n").index("mesure = 3") + 1
    assert told.startswith(f"line {number} ")
    assert stop.locator("#edit-problems li").count() == 1
    assert stop.locator("#edit-text .gutter .bad").inner_text().strip() == str(number)
    (bar,), (paper,) = boxes(stop, "#edit-text .shade i"), boxes(stop, "#edit-text .paper")
    assert paper[1] <= bar[1] < bar[3] <= paper[3] + 1.0
    assert stop.inner_text("#edit-status").startswith("1 problem,")
    assert stop.evaluate("document.getElementById('edit-machine').querySelectorAll('svg').length") == 1  # it stays
    stop.evaluate("gapwalk.editor.text.go(1)")
    stop.focus("#edit-problems button")
    stop.keyboard.press("Enter")
    assert stop.evaluate("gapwalk.editor.text.line") == number
    stop.keyboard.press("Control+Enter")
    until(stop, "document.getElementById('edit-status').textContent.startsWith('Correct the problems first')")
    stop.keyboard.press("Delete")
    until(stop, "!document.querySelectorAll('#edit-problems li').length")
    until(stop, WALKED)


def test_the_drawing_follows_the_text_and_finds_parts_in_it(stop) -> None:
    assert (
        stop.locator("#edit-machine [data-words^='stop: ']").get_attribute("data-words")
        == "stop: spring with a gap of +1"
    )
    at = stop.input_value("#edit-text textarea").split("\n").index("clearance = 1.0  # of the stop") + 1
    stop.evaluate(f"gapwalk.editor.text.go({at})")
    stop.keyboard.type("clearance = 0.5")
    until(stop, "document.querySelector('#edit-machine [data-words^=\"stop: \"]')?.dataset.words.endsWith('+0.5')")
    assert stop.evaluate("document.querySelector('#edit-values .here').dataset.name") == "stop.clearance"
    stop.focus("#edit-machine [data-words^='stop: ']")
    stop.keyboard.press("Enter")
    line = stop.evaluate("gapwalk.editor.text.line")
    assert stop.input_value("#edit-text textarea").split("\n")[line - 1] == "[[contact]]"
    until(stop, WALKED)


def test_a_file_that_changed_meanwhile_is_replaced_only_if_asked(stop, folder) -> None:
    file = folder / "stop.toml"
    file.write_text(STOP + "# of another program\n", encoding="utf-8")
    stop.focus("#edit-text textarea")
    stop.keyboard.press("Control+End")
    stop.keyboard.type("# mine\n")
    stop.keyboard.press("Control+s")
    until(stop, "!document.getElementById('edit-replace').hidden")
    assert "changed meanwhile" in stop.inner_text("#edit-status")
    assert file.read_text(encoding="utf-8").endswith("# of another program\n")
    stop.click("#edit-replace")
    until(stop, "document.getElementById('edit-status').textContent.endsWith(', saved.')")
    assert file.read_text(encoding="utf-8").endswith("# mine\n")
    with stop.expect_download() as found:
        stop.click("#edit-export")
    assert found.value.suggested_filename == "stop.toml"
    assert Path(found.value.path()).read_text(encoding="utf-8") == file.read_text(encoding="utf-8")


def test_a_text_that_is_left_without_being_saved_is_there_again(stop, folder) -> None:
    stop.evaluate("gapwalk.editor.text.go(1)")
    stop.keyboard.type("# unfinished\n")
    stop.click("#edit-close")
    until(stop, "!gapwalk.editor.isOpen")
    stop.click("#edit-open")
    until(stop, "gapwalk.editor.isOpen")
    assert stop.input_value("#edit-text textarea").startswith("# unfinished\n")
    assert "not saved since the last change" in stop.inner_text("#edit-status")
    stop.click("#edit-new")
    until(stop, CHOOSING)
    stop.keyboard.press("Escape")
    assert stop.input_value("#edit-text textarea").startswith("# unfinished\n")
    stop.click("#edit-new")
    until(stop, CHOOSING)
    stop.click("[data-start='rotor']")
    until(stop, "gapwalk.editor.name === 'rotor.toml'")
    stop.keyboard.type("# mine\n")
    stop.click("#edit-new")
    until(stop, "!document.getElementById('edit-starts').hidden")
    cards = stop.locator("#edit-starts-list b").all_inner_texts()
    assert cards[:2] == ["stop.toml", "rotor.toml"]
    stop.click("[data-start='stop.toml']")
    until(stop, "gapwalk.editor.text.text.startsWith('# unfinished')")
    assert "# unfinished" not in (folder / "stop.toml").read_text(encoding="utf-8")
    stop.click("#edit-save")
    until(stop, "document.getElementById('edit-status').textContent.endsWith(', saved.')")
    stop.evaluate("gapwalk.editor.drafts.clear()")


def test_a_file_with_errors_can_be_opened_in_the_editor(tmp_path, page) -> None:
    (tmp_path / "broken.toml").write_text('coordinates = ["x"]\nstifness = [1.0]\n', encoding="utf-8")
    other = new_page(page.context.browser)
    with serving(tmp_path) as address:
        other.goto(address)
        until(other, "!document.getElementById('error').hidden")
        assert "broken.toml:2: stifness is not a key here" in other.inner_text("#error")
        other.click("#edit-open")
        until(other, "document.querySelectorAll('#edit-problems li').length > 1")
        assert "line 2 stifness is not a key here" in other.inner_text("#edit-problems")
        other.close()


def test_the_tree_of_the_editor_names_all_that_can_be_reached(stop) -> None:
    nodes, reached = tree_of(stop)
    assert nameless(reached) == []
    assert {("main", "Model editor"), ("toolbar", "The file"), ("textbox", "Text of the model file")} <= set(nodes)
    assert {("textbox", "File"), ("figure", "Values"), ("status", "")} <= set(nodes)
    names = {role: {name for each, name in reached if each == role} for role in ("button", "slider", "spinbutton")}
    assert {"New model", "Save", "Save and compute", "Export", "Back to the results"} <= names["button"]
    assert {"clearance of stop, slider", "stiffness of stop, slider"} <= names["slider"]
    assert {"clearance of stop", "stiffness of stop"} <= names["spinbutton"]
    assert any(name.startswith("stop: spring with a gap") for name in names["button"])  # of the drawing


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (3840, 2160), (390, 844)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_of_the_editor_overlaps_on_any_screen(stop, width, height, scheme) -> None:
    stop.emulate_media(color_scheme=scheme)
    stop.set_viewport_size({"width": width, "height": height})
    stop.wait_for_timeout(250)
    parts = [
        "#editor .bar",
        "#edit-text",
        "#edit-plan",
        "#edit-machine-figure",
        "#edit-response",
        "#edit-values-figure",
    ]
    found = {name: boxes(stop, name)[0] for name in parts}
    for a, b in itertools.combinations(parts, 2):
        assert not overlap(found[a], found[b]), (a, b)
    buttons = boxes(stop, "#editor .bar > *")
    assert not any(overlap(a, b) for k, a in enumerate(buttons) for b in buttons[:k])
    assert all(left >= 0 and right <= width for left, _, right, _ in [*buttons, *found.values()])
    texts = boxes(stop, "#edit-response text")
    assert len(texts) >= 6
    assert not any(overlap(a, b) for k, a in enumerate(texts) for b in texts[:k])
    rows = boxes(stop, "#edit-values .parameter > *")
    assert not any(overlap(a, b) for k, a in enumerate(rows) for b in rows[:k])
    stop.emulate_media(color_scheme="light")
    stop.set_viewport_size({"width": 1280, "height": 720})


def test_units_stand_at_the_numbers_of_a_train(page, folder) -> None:
    if page.evaluate("gapwalk.editor.isOpen"):
        page.click("#edit-close")
    text = CLUTCH.with_name("drivetrain.toml").read_text(encoding="utf-8")
    (folder / "train.toml").write_text(text, encoding="utf-8")
    page.reload()
    until(page, "Boolean(window.gapwalk?.page.about)")
    opened(page, "train.toml")
    edited(page)
    names = page.locator("#edit-values .parameter span").all_inner_texts()
    assert {"speed [rpm]", "clutch.stiffness [N m/deg]", "input.stiffness [N m/rad]"} <= set(names)  # as written
    assert [name for name in names if not name.endswith("]") and not name.endswith(".flywheel")] == []
    titles = page.locator("#edit-response .title").all_text_contents()
    assert titles == ["speed [rpm]", "amplitude of clutch (half the peak to peak) [deg]"]
