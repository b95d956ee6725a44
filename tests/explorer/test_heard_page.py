"""The page plays a run-up while a line moves over its pictures; sounds of motions have their true pitch and level."""

import re
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page

import gapwalk as gw
from tests.explorer.browser import boxes, opened, overlap, until, watched
from tests.explorer.conftest import CLUTCH
from tests.explorer.serving import serving
from tests.explorer.test_heard import TRAIN

LOOP = """import("/static/sound.js").then(({ loopOf }) => {
    const { motion } = gapwalk.motion, { values, rate } = loopOf(motion, "q1", 48000);
    return [[...values], rate];
})"""
FRAMES = """(() => {
    const { heard } = gapwalk.answer, by = (id) => document.getElementById(id);
    window.frames_ = [];
    heard.point = function () {
        Object.getPrototypeOf(this).point.call(this);
        if (!this.source) return;
        const { left } = by("heard-line").getBoundingClientRect(), leg = by("heard-map").selectedOptions[0].text;
        frames_.push([this.at, left, by("heard-now").textContent, leg, by("heard-play").textContent]);
    };
})()"""
"""Records what each frame shows while it plays: it cannot be asked in time on a machine that is busy."""


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    """The page of a folder with the clutch and a train; no errors, and no request to anyone else."""
    folder = tmp_path_factory.mktemp("heard")
    (folder / "clutch.toml").write_text(CLUTCH.read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "train.toml").write_text(TRAIN, encoding="utf-8")
    with serving(folder / "train.toml") as address, watched(address, height=800) as page:
        yield page


@pytest.fixture(scope="module")
def played(page) -> Page:
    """The page with a run-up through the resonance of the train, up and down."""
    opened(page, "train.toml")
    page.click("summary:text-is('Run up, and listen')")
    until(page, "document.getElementById('run-up-low').value === '500'")  # proposed once the part is open
    for name, value in (("low", "600"), ("high", "1100"), ("seconds", "1")):
        page.fill(f"#run-up-{name}", value)
    page.click("#run-up")
    until(page, "gapwalk.page.results[0]?.state === 'done' && Boolean(gapwalk.answer.heard.found)")
    return page


def left_of(page: Page) -> float:
    (line,) = boxes(page, "#heard-line")
    return line[0]


def test_a_line_moves_with_the_sound_up_and_down(played) -> None:
    page = played
    assert page.input_value("#heard-map") == "0"
    begin = left_of(page)
    page.evaluate(FRAMES)
    page.click("#heard-play")
    until(page, "frames_.length > 0 && !gapwalk.answer.heard.source")  # it ends by itself
    frames = page.evaluate("delete gapwalk.answer.heard.point, frames_")
    up, down = ([frame for frame in frames if low < frame[0] < high] for low, high in ((0.1, 0.95), (1.1, 1.95)))
    assert up
    assert down
    assert all("rising" in words and plays == "Pause" for _, _, words, _, plays in up)
    assert all("falling" in words and leg == "falling speed" for _, _, words, leg, _ in down)
    assert page.inner_text("#heard-play") == "Play"
    assert begin < up[-1][1]
    assert [left for _, left, *_ in up] == sorted(left for _, left, *_ in up)
    assert [left for _, left, *_ in down] == sorted((left for _, left, *_ in down), reverse=True)
    assert left_of(page) == pytest.approx(begin, abs=2.0)
    assert "Root mean square" in page.inner_text("#heard-note")
    # the line is at the speed of its time in the diagram, and the dot on the amplitude there
    page.evaluate("gapwalk.answer.heard.seek(0.5)")
    at = "(({ xaxis, _offset }) => xaxis._offset + xaxis.l2p(850))(gapwalk.diagram.place._fullLayout)"
    (plot,) = boxes(page, "#diagram")
    assert left_of(page) == pytest.approx(plot[0] + page.evaluate(at), abs=2.5)
    assert page.locator("#heard-dot").is_visible()
    page.focus("#heard-at")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("gapwalk.answer.heard.at") > 0.5


def test_the_map_has_colours_over_orders_and_frequencies_in_both_schemes(played) -> None:
    page = played
    shown = []
    for over in ("orders", "frequencies"):
        page.select_option("#heard-over", over)
        shown += [page.get_attribute("#heard-picture image", "href"), page.text_content("#heard-picture .title")]
    assert shown[0] != shown[2]
    assert [shown[1], shown[3]] == ["order", "frequency [Hz]"]
    page.emulate_media(color_scheme="dark")
    # The page draws again when it hears of the new scheme, which may be a moment later.
    page.wait_for_function(
        "old => document.querySelector('#heard-picture image')?.getAttribute('href') !== old", arg=shown[2]
    )
    page.emulate_media(color_scheme="light")


def test_the_pointer_reads_speed_order_frequency_and_level(played) -> None:
    """In the middle of the frame: half the orders, and the frequency that belongs to the speed read."""
    page = played
    page.select_option("#heard-over", "orders")
    frame = page.locator("#heard-picture .frame").bounding_box()
    page.mouse.move(frame["x"] + frame["width"] / 2, frame["y"] + frame["height"] / 2)
    text = page.text_content("#heard-picture .read")
    found = re.fullmatch(r"([\d.]+), order ([\d.]+), ([\d.]+) Hz: (below -60 dB|[\d.e-]+ .*, -?[\d.]+ dB)", text)
    assert found, text
    speed, order, hertz = map(float, found.groups()[:3])
    pitch = page.evaluate("gapwalk.answer.heard.content.pitch / gapwalk.answer.heard.found.turns")
    assert hertz == pytest.approx(order * pitch * speed, rel=0.02)
    page.mouse.move(5, 5)
    assert page.text_content("#heard-picture .read") == ""


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (1920, 1080), (390, 844)])
def test_nothing_of_it_overlaps(played, width, height) -> None:
    page = played
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(300)
    for what in ("#heard > *", "#heard-panels .head > *", "#heard-picture text", "#picture > div, #picture > ul"):
        found = [box for box in boxes(page, what) if box[2] - box[0] > 3.0]
        assert not any(overlap(a, b) for k, a in enumerate(found) for b in found[:k]), what
    page.set_viewport_size({"width": 1280, "height": 800})


def test_the_file_is_as_loud_as_what_was_heard(played) -> None:
    with played.expect_download() as saved:
        played.click("#heard-wav")
    assert saved.value.suggested_filename.endswith("shaft-dot-dot.wav")
    assert saved.value.path().read_bytes()[:4] == b"RIFF"


def test_a_quiet_motion_is_as_much_quieter_as_it_is_and_both_have_the_pitch_of_their_excitation(page) -> None:
    """The levels by Parseval's sum over exact spectra; the pitch of the loop that is played."""
    opened(page, "clutch.toml")
    page.click("#compute")
    until(page, "gapwalk.page.results[0]?.state === 'done' && gapwalk.curves.all.size === 1")
    (branch,) = gw.run(gw.read_study(CLUTCH)).branches
    levels, true = [], []
    for index in (3, int(np.argmax([point.orbit.measure("half.q1") for point in branch.points]))):
        orbit = branch.points[index].orbit
        at = f"(curve) => gapwalk.diagram.chosen({{ curve, index: curve.node.indexOf({index}) }})"
        page.evaluate(f"({at})([...gapwalk.curves.all.values()][0])")
        frequency = orbit.system.frequency
        until(page, f"Math.abs((gapwalk.motion.motion?.parameters.frequency ?? 0) - {frequency!r}) < 1e-9")
        values, rate = page.evaluate(LOOP)
        levels.append(np.sqrt(np.mean(np.square(values))))
        lines = gw.analysis.spectrum(orbit, "q1''", gw.analysis.SpectrumOptions(tolerance=1e-7)).amplitudes[1:]
        true.append(np.sqrt(np.sum(lines**2) / 2.0))
        # the loop has a whole number of periods, and is played at such a rate that Omega = 1 is 90 Hz
        spectrum = np.abs(np.fft.rfft(values))
        hertz = (np.argmax(spectrum[1:]) + 1) * 48_000 * rate / len(values)
        multiple = hertz / (90.0 * frequency)
        assert multiple == pytest.approx(round(multiple), rel=1e-9)
        assert round(multiple) == round(float(np.argmax(lines)) + 1)
    assert levels[1] / levels[0] == pytest.approx(true[1] / true[0], rel=5e-3)
    assert true[1] / true[0] > 2.0


@pytest.mark.slow
def test_sounds_have_one_scale_and_the_page_says_so(page) -> None:
    opened(page, "clutch.toml")
    until(page, "gapwalk.curves.all.size === 1")
    choose = "(curve) => gapwalk.diagram.chosen({ curve, index: curve.node.indexOf(%d) })"
    page.evaluate(f"({choose % 3})([...gapwalk.curves.all.values()][0])")
    until(page, "Boolean(gapwalk.motion.motion)")
    page.click("#sound")
    assert "The excitation is heard at" in page.inner_text("#sound-note")
    scale = 'import("/static/sound.js").then(({ loudness }) => loudness.scales.get("q1\'\'"))'
    before = page.evaluate(scale)
    page.evaluate("gapwalk.motion.motion.a.q1 = gapwalk.motion.motion.a.q1.map((v) => v / 10)")
    page.evaluate("gapwalk.motion.sound.play(gapwalk.motion.motion, 'q1')")
    assert page.evaluate(scale) == before
    assert "20.0 dB below the loudest that was heard" in page.inner_text("#sound-note")
    page.evaluate("gapwalk.motion.motion.a.q1 = gapwalk.motion.motion.a.q1.map((v) => v * 100)")
    page.evaluate("gapwalk.motion.sound.play(gapwalk.motion.motion, 'q1')")
    assert page.evaluate(scale) > 2.0 * before
    assert "quieter from now on" in page.inner_text("#sound-note")
    page.click("#sound")
