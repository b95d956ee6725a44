"""Pictures of records over motions, of two motions side by side, and of hysteresis loops."""

import matplotlib as mpl
import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.plot import draw, save
from tests.systems import clutch

mpl.use("Agg")


@pytest.fixture(scope="module")
def orbit() -> gw.Orbit:
    return gw.find_orbit(clutch(frequency=0.8))


def record_of(orbit: gw.Orbit, samples: int, name: str = "a$b_") -> gw.measure.Record:
    motion = gw.integrate(orbit.system, orbit.state, 4, samples)
    return gw.measure.Record(motion.time[:-1], motion.signal("q1''")[:-1], name=name)


@pytest.mark.parametrize(("samples", "marker"), [(60, "o"), (400, "None")])
def test_a_record_is_drawn_over_the_motion(orbit, samples, marker) -> None:
    found = gw.measure.align(orbit, record_of(orbit, samples), "q1''")
    figure = found.plot("A clutch").figure
    history, lines, rest = figure.axes
    measured, computed = history.lines
    assert measured.get_marker() == marker
    np.testing.assert_allclose(measured.get_ydata(), found.measured[: len(measured.get_ydata())])
    # at the record's instants the computed line passes through the record
    at = np.interp(measured.get_xdata(), computed.get_xdata(), computed.get_ydata())
    np.testing.assert_allclose(at, measured.get_ydata(), atol=2e-3 * np.abs(found.measured).max())
    heights = lines.lines[0].get_ydata()
    amplitudes = np.array([line.first for line in found.agreement.lines[: len(heights)]])
    np.testing.assert_allclose(heights, np.maximum(amplitudes, lines.get_ylim()[0]), rtol=1e-9)
    assert len(rest.lines[1].get_ydata()) == len(found.theta)
    assert history.get_legend().get_texts()[0].get_text() == r"record (a\$b_)"
    assert figure.get_suptitle().startswith("A clutch\nrms error")
    mpl.pyplot.close(figure)


def test_files_of_a_record_are_written(orbit, tmp_path) -> None:
    found = gw.measure.align(orbit, record_of(orbit, 60), "q1''")
    save(found, tmp_path / "a.png", tmp_path / "a.svg", title="costs $5")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert "costs $5" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    with pytest.raises(ModelError, match="shows its own signal, and no measure"):
        save(found, tmp_path / "b.png", measure="half.q1")


def test_two_motions_are_drawn_signal_by_signal(orbit) -> None:
    other = gw.find_orbit(clutch(frequency=0.8, **{"stage2.impact_damping": 0.3}))
    figure = gw.analysis.contrast(orbit, other, names=("light", "heavy")).plot().figure
    assert len(figure.axes) == 4
    assert figure.get_suptitle() == "light and heavy at Ω = 0.8"
    assert [axes.get_ylabel() for axes in figure.axes[::2]] == ["q1''", "force of stage2"]
    assert figure.axes[0].get_title("left").startswith("rms difference 0.")
    mpl.pyplot.close(figure)
    chaos = gw.settle(gw.paper.case("15").at(frequency=0.4), options=gw.SettleOptions(max_periods=64))
    figure = gw.analysis.contrast(chaos, orbit, ["q1"]).plot("").figure
    assert len(figure.axes[1].lines) == 2
    mpl.pyplot.close(figure)


def test_loops_are_drawn_over_one_another() -> None:
    loops = [gw.analysis.hysteresis(clutch(**{"stage2.impact_damping": b}), 2.0) for b in (0.1, 0.2)]
    ax = draw(loops, ["light", "heavy"])
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == [f"light: loss {loops[0].loss:.4g} per cycle", f"heavy: loss {loops[1].loss:.4g} per cycle"]
    np.testing.assert_array_equal(ax.lines[1].get_ydata(), loops[1].force)
    mpl.pyplot.close(ax.figure)
    ax = loops[0].plot()
    assert len(ax.lines) == 1 + 1 + 2  # the loop, the axis, and the gap's two sides
    mpl.pyplot.close(ax.figure)
