"""Maps of rattle against the closed form of the motion that does not touch."""

import io
import math

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.answers.gap_states import GapState
from gapwalk.bifurcation.special_point import Kind
from gapwalk.model.model_source import parse_source
from gapwalk.studies import read_studies
from gapwalk.studies.study_file import check_study
from tests.answers.test_rattle_bands import DAMPING, GAP, STOP, stopped
from tests.studies.test_complete_response import TRAIN

MODEL = f"""
coordinates = ["x"]
stiffness = [1.0]
damping = [{DAMPING}]

[[contact]]
name = "stop"
deflection = {{ x = 1.0 }}
side = "positive"
clearance = {GAP}
stiffness = {STOP}

[[harmonic]]
amplitude = 0.15
acts_on = {{ x = 1.0 }}

[study]
kind = "rattle"
parameter = "frequency"
from = 0.7
to = 1.4
gaps = "stop"
second = {{ parameter = "harmonic1.amplitude", from = 0.02, to = 0.25 }}
resolution = [12, 8]
check = 16
workers = 1
"""


@pytest.fixture(scope="module")
def found():
    study = check_study(parse_source(MODEL))
    assert study.system.at(frequency=0.5) == stopped()
    return gw.run(study).finding


def reach(frequency, load):
    """Return the amplitude of the linear oscillator."""
    return load / np.abs(1.0 - frequency**2 + 1j * DAMPING * frequency)


def test_cells_are_open_exactly_where_the_linear_motion_stays_off_the_stop(found):
    across, up = found.record.axes
    reached = reach(*np.meshgrid(across, up))
    codes = found.record.codes[..., 0]
    # well inside, started from rest: where it coexists with rattle, just outside of the border, either may be reached
    assert (codes[reached < 0.6 * GAP] == GapState.OPEN.code).all()
    assert (codes[reached > GAP] == GapState.ONE_SIDE.code).all()
    assert (found.record.periods[reached < 0.6 * GAP] == 1).all()
    assert found.record.checked == 16
    assert not found.record.different


def test_the_borders_are_the_closed_form_and_a_fold(found):
    kinds = [locus.kind for locus in found.record.loci]
    assert kinds.count(Kind.GRAZING) == 1  # both flanks are one curve
    (grazing,) = [locus for locus in found.record.loci if locus.kind is Kind.GRAZING]
    assert reach(*grazing.values.T) == pytest.approx(GAP, abs=1e-9)
    assert grazing.values[:, 1].min() == pytest.approx(GAP * DAMPING * math.sqrt(1.0 - DAMPING**2 / 4.0), rel=1e-3)
    folds = [locus for locus in found.record.loci if locus.kind is Kind.FOLD]
    assert folds
    # a rattling motion jumps beyond the border, where the quiet one does not touch
    assert (reach(*folds[0].values.T) < GAP).any()


def test_it_tells_itself(found):
    text = str(found.summary())
    assert text.startswith("stop: open: ")
    assert "grazing" in text
    assert found.document(points=True)["resolution"] == [12, 8]
    rows = list(found.tables()["cells"]())
    assert len(rows) == 1 + 12 * 8
    assert found.record.plot() is not None


def test_a_map_of_a_train_of_many_parts_is_made_of_cells_alone() -> None:
    second = '{ parameter = "flywheel.inertia", from = "0.1 kg m^2", to = "0.2 kg m^2" }'
    more = f"second = {second}\nresolution = [2, 2]\ncheck = 0"
    head = 'kind = "rattle"\nparameter = "speed"\nfrom = "800 rpm"\nto = "900 rpm"\n'
    text = f"{TRAIN[: TRAIN.index('[study]')]}[study]\n{head}{more}\nworkers = 1\n"
    (study,) = read_studies(io.StringIO(text))
    found = gw.run(study).finding.record
    assert not found.loci
    assert sum(found.cells("mesh1").values()) == 4
    assert found.notes[0].startswith("no borders are followed where a train has so many parts")
