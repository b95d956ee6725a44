"""The studies of free motions: from a file through store, tables, JSON and picture."""

import json

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.free.free_shooting import FreeOrbit
from gapwalk.free.self_excitation import SelfExcited
from tests.studies.jobs import study_of


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("free") / "self.gapwalk"
    return gw.run(study_of("self-excited"), path), path


def test_self_excitation_is_stored_and_verified(stored):
    result, path = stored
    found = result.finding.record
    assert isinstance(found, SelfExcited)
    assert found.complete
    assert len(found.hopf_points) == len(found.cycles) == 1
    again = gw.open_result(path).finding.record
    assert again.cycles[0].points[-1].orbit.state.tolist() == found.cycles[0].points[-1].orbit.state.tolist()
    assert isinstance(again.cycles[0].points[-1].orbit, FreeOrbit)
    assert gw.verify(path).ok


def test_tables_and_json_have_motions_and_equilibria(stored):
    finding = stored[0].finding
    tables = {name: [*rows()] for name, rows in finding.tables().items()}
    found = finding.record
    assert len(tables["motions"]) == len(found.cycles[0].points) + 1
    assert len(tables["equilibria"]) == len(found.rests[0].points) + 1
    assert {"frequency", "period", "half.x"} <= set(tables["motions"][0])
    document = json.loads(json.dumps(finding.document(points=True)))
    assert document["equilibria"][0]["events"][0]["kind"] == "Hopf point"
    last = document["motions"][0]["points"][-1]
    assert last["frequency"] == found.cycles[0].points[-1].orbit.system.frequency
    assert "Hopf point" in str(finding.summary())


def test_pictures_show_equilibria_motions_and_frequency(stored):
    found = stored[0].finding.record
    figure = gw.plot.draw(found).figure
    upper, lower = figure.axes
    assert lower.get_ylabel() == "frequency of the motion"
    top = max(np.nanmax(line.get_ydata()) for line in upper.lines if len(line.get_ydata()) > 2)
    assert top == pytest.approx(found.cycles[0].points[-1].measure("max.x"), rel=1e-6)
    gw.plot.draw(found.rests[0])
    with pytest.raises(ModelError, match="must be one of x"):
        gw.plot.draw(found, coordinate="y")


def test_a_backbone_study_foretells(tmp_path):
    path = tmp_path / "backbone.gapwalk"
    finding, stored = gw.run(study_of("backbone"), path).finding, gw.open_result(path).finding
    assert finding is not None
    assert stored is not None
    found, again = finding.record, stored.record
    assert [birth.amplitude for birth in again.births] == [birth.amplitude for birth in found.births]
    assert all(birth.mode in (1, 2) for birth in found.births)
    document = finding.document(points=False)
    assert len(document["births"]) == len(found.births) > 0
    assert "foretold for the damping" in str(found.summary())


def test_a_study_refuses_what_cannot_be_followed():
    study = study_of("self-excited")
    with pytest.raises(ModelError, match="belongs to the excitation"):
        gw.free.follow_rest(study.system, "frequency", 2.0)
    with pytest.raises(ModelError, match="range"):
        gw.free.self_excited(study.system, "damper.mu", (0.5, 1.0))
