"""``gapwalk export --format wav``: the sound of a run-up or a settled motion, and what it says of its level."""

import io

import numpy as np
import pytest
from scipy.io import wavfile

import gapwalk as gw
from gapwalk.cli import main
from tests.explorer.test_answer_page import ONE_RUN_UP
from tests.models import STOP, response


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sounds")
    settled = STOP + '\n[study]\nkind = "settle"\nsignal = "x"\n'
    walked = STOP + response(0.72)
    for name, text in (("run", ONE_RUN_UP), ("settled", settled), ("walked", walked)):
        gw.run(gw.read_study(io.StringIO(text)), folder / f"{name}.gapwalk")
    return folder


def export(*words) -> int:
    return main([*map(str, ("export", *words))])


def test_a_run_up_is_saved_at_the_full_scale_that_is_said(folder, capsys) -> None:
    assert export(folder / "run.gapwalk", "--format", "wav", "--signal", "stage2.force") == 0
    said = capsys.readouterr().out
    record = gw.open_result(folder / "run.gapwalk").finding.record
    exact = record.sound("stage2.force")
    assert f"peak {exact.peak:.4g}" in said
    assert f"give --full-scale {exact.full_scale:g} to each sound compared with this one" in said
    rate, values = wavfile.read(folder / "run.wav")
    assert rate == exact.rate
    np.testing.assert_allclose(
        values / 2.0**31 * exact.full_scale, exact.values - exact.values.mean(), atol=1e-6 * exact.full_scale
    )


def test_a_settled_motion_is_heard_in_its_acceleration(folder, capsys) -> None:
    assert export(folder / "settled.gapwalk", "--output", folder / "a.wav", "--full-scale", "100") == 0
    assert "x'', 3 s at 48000 Hz" in capsys.readouterr().out
    exact = gw.analysis.sound(gw.open_result(folder / "settled.gapwalk").finding.record, "x''")
    assert np.abs(wavfile.read(folder / "a.wav")[1]).max() / 2.0**31 * 100.0 == pytest.approx(exact.peak, rel=1e-4)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("walked.gapwalk", "--format", "wav"), "a sound is that of one motion"),
        (("run.gapwalk", "--format", "wav", "--full-scale", "1e-9"), "above the full scale of 1e-09"),
        (("run.gapwalk", "--format", "csv", "--signal", "q1"), "--signal and --full-scale concern sounds"),
        (("run.gapwalk", "--format", "wav", "--signal", "nothing"), "no signal 'nothing'"),
    ],
)
def test_what_is_no_sound_is_refused(folder, capsys, words, said) -> None:
    name, *rest = words
    assert export(folder / name, *rest) == 2
    assert said in capsys.readouterr().err
