"""Results as things: titles that say what they are, names and colours of one's own, and deletion that can be undone."""

import io
from dataclasses import replace

import pytest

import gapwalk as gw
from gapwalk.attractors.rotation import Rotation
from gapwalk.attractors.settle import AttractorKind
from gapwalk.explorer.opened_file import Exploration, deleted, listed
from gapwalk.explorer.saved_page import Blob, content_of, lines_of
from gapwalk.explorer.workspace_folder import study_title, verdict
from gapwalk.studies.settle_study import SettleFinding
from tests.explorer.conftest import CLUTCH, STOP, about


def change(client, file: str, key: str, **changes):
    return client.post("/api/result/change", json={"file": file, "result": key, **changes})


def test_titles_say_what_a_result_is(client, do, session, model) -> None:
    first = do(model, do="compute", values={"stop.clearance": 0.8})
    assert first["title"] == "Ω 0.7 to 0.9, stop.clearance = 0.8"
    start = {"result": first["key"], "point": 0}
    walked = do(model, do="walk", start=start, parameter="harmonic1.amplitude", to=0.1)
    assert walked["title"] == "harmonic1.amplitude 0.2 to 0.1, stop.clearance = 0.8"
    settled = do(model, do="settle", start=start, values={"frequency": 0.6})
    assert settled["title"] == "settled at Ω = 0.6, stop.clearance = 0.8"
    assert settled["verdict"] == "period 1, stable"


def test_titles_have_the_units_of_a_drive_train() -> None:
    speed, load = (gw.read_study(CLUTCH.with_name("drivetrain.toml"), name=each) for each in ("speed", "load"))
    assert study_title(speed, {"clutch.clearance": 0.5}).startswith("speed 3000 to 800 rpm, clutch.clearance = 0.5 ")
    assert study_title(load, {}).startswith("load: ")


def test_what_is_chosen_for_a_result_is_kept_and_undone(client, do, session, model) -> None:
    key = do(model, do="compute")["key"]
    answer = change(client, model, key, name="  with the  soft spring ", colour="blue", drawn="pale")
    assert answer.json() == {"before": {"name": "", "colour": "", "drawn": "full"}}
    (again,) = listed(Exploration(session.workspace, model))  # as a server that begins anew reads it
    shown = [again[word] for word in ("title", "colour", "drawn")]
    assert shown == ["with the soft spring", "blue", "pale"]
    change(client, model, key, **answer.json()["before"])
    (back,) = about(client, model)["results"]
    assert (back["title"], back["colour"], back["drawn"]) == (back["automatic"], "", "full")


def test_a_deleted_result_can_be_restored_until_it_is_removed(client, do, session, model) -> None:
    first = do(model, do="compute")
    second = do(model, do="walk", start={"result": first["key"], "point": 0}, parameter="frequency", to=0.6)
    folder = session.workspace.exploration(session.workspace.path(model))
    for each in (first, second):
        assert change(client, model, each["key"], deleted=True).status_code == 200
    assert about(client, model)["results"] == []
    again = Exploration(session.workspace, model)
    assert [each["title"] for each in deleted(again)] == [first["title"], second["title"]]
    change(client, model, second["key"], deleted=False)
    assert [each["key"] for each in about(client, model)["results"]] == [second["key"]]
    # the first is still needed, by the walk that starts from it
    assert client.post("/api/result/clean", json={"file": model}).json() == {"removed": 0}
    assert client.get("/api/export/script", params={"file": model, "result": second["key"]}).status_code == 200
    change(client, model, second["key"], deleted=True)
    assert client.post("/api/result/clean", json={"file": model}).json() == {"removed": 2}
    assert not [*folder.glob("*.gapwalk"), *folder.glob("*.json")]
    assert listed(Exploration(session.workspace, model)) == deleted(Exploration(session.workspace, model)) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"drawn": "dotted"}, "drawn"),
        ({"colour": "#fff"}, "blue, orange"),
        ({"name": "x" * 200}, "at most 120"),
        ({"title": "other"}, "What can be changed"),
    ],
)
def test_a_change_that_makes_no_sense_is_refused(client, do, model, changes, words) -> None:
    key = do(model, do="settle")["key"]
    answer = change(client, model, key, **changes)
    assert answer.status_code == 400
    assert words in answer.json()["error"]
    assert change(client, model, "99-none", name="a").status_code == 400


def test_the_verdict_of_a_torus_has_its_rotation_number() -> None:
    text = STOP.partition("[study]")[0] + '[study]\nkind = "settle"\n'
    result = gw.run(gw.read_study(io.StringIO(text)))
    finding = result.finding
    assert isinstance(finding, SettleFinding)
    assert verdict(finding.settled, finding) == "period 1, stable"
    # the same records, as those of a torus around a motion of period 2 would be
    found, kind = Rotation(0.112232, 1e-9, 2, 1.0), AttractorKind.QUASI_PERIODIC
    attractor = replace(finding.attractor, kind=kind, orbit=None, period=2, rotation=found)
    torus = replace(finding, attractor=attractor, settled=replace(finding.settled, orbit=None))
    assert verdict(torus.settled, torus) == "2 x torus, rotation number 0.112232"
    saved = content_of(lines_of(replace(result, finding=torus)), "half", "", 10, Blob())
    assert saved["verdict"] == "2 x torus, rotation number 0.112232"
