import asyncio
import base64
import hashlib
import json
import math
import os
import shutil
import sqlite3
import tomllib
from urllib.parse import unquote

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.explorer import model_editor
from gapwalk.explorer.motion_panels import Flows, Quantities, SupersededError, gradient_content
from gapwalk.explorer.opened_file import Exploration, listed
from gapwalk.explorer.progress_stream import Events
from gapwalk.explorer.server_state import Session
from tests.explorer.conftest import CLUTCH, STOP, about, run_apart, wait

JSON = {"content-type": "application/json"}


def amplitude(frequency: float) -> float:
    """Of the oscillator while it does not meet its stop, in closed form."""
    return 0.2 / math.hypot(1.0 - frequency**2, 0.05 * frequency)


def unpacked(curve: dict, name: str, kind: str = "<f8") -> np.ndarray:
    return np.frombuffer(base64.b64decode(curve[name]), dtype=kind)


def test_the_page_and_all_that_it_loads_come_from_the_server(client) -> None:
    page = client.get("/")
    assert "gapwalk" in page.text
    assert "//" not in page.text.replace("<!doctype html>", "")  # no address of another server
    for path in ("/static/main.js", "/static/style.css", "/colours.css", "/plotly.js"):
        assert client.get(path).status_code == 200
    assert "default-src 'self'" in page.headers["content-security-policy"]


def test_a_computed_branch_is_the_closed_form_of_its_linear_motions(client, do, model) -> None:
    result = do(model, do="compute", values={"stop.clearance": 9.0})
    assert result["state"] == "done"
    query = {"file": model, "result": result["key"], "x": "frequency", "y": "half.x"}
    curve = client.get("/api/curve", params=query).json()
    x, y, node = unpacked(curve, "x"), unpacked(curve, "y"), unpacked(curve, "node", "<i4")
    assert x[0] == 0.7
    assert x[-1] == 0.9
    assert node.tolist() == list(range(curve["count"]))
    np.testing.assert_allclose(y, [amplitude(each) for each in x], rtol=1e-9)
    # what has been sent already is not sent again
    rest = client.get("/api/curve", params={**query, "from": curve["count"] - 2}).json()
    np.testing.assert_array_equal(unpacked(rest, "x"), x[-2:])
    # any parameter over any measure
    turned = client.get("/api/curve", params={**query, "x": "max.x", "y": "stop.clearance"}).json()
    assert set(unpacked(turned, "y")) == {9.0}


def test_the_motion_of_a_point_is_the_closed_form(client, do, model) -> None:
    result = do(model, do="compute", values={"stop.clearance": 9.0})
    place = {"file": model, "result": result["key"], "branch": 0, "point": 0, "signal": "x", "tab": "a"}
    motion = client.get("/api/motion", params=place).json()
    theta = 2 * np.pi * np.array(motion["theta"])
    lag = math.atan2(0.05 * 0.7, 1.0 - 0.7**2)
    np.testing.assert_allclose(motion["q"]["x"], amplitude(0.7) * np.cos(theta - lag), atol=2e-7)
    assert motion["stable"] is True
    assert motion["log"] == []
    modulus = math.exp(-0.05 / 2 * 2 * math.pi / 0.7)
    np.testing.assert_allclose([math.hypot(*z) for z in motion["multipliers"]], modulus, rtol=1e-9)
    details = client.get("/api/details", params=place).json()
    lines = dict(zip(details["orders"], details["amplitudes"], strict=True))
    assert lines[1.0] == pytest.approx(amplitude(0.7), rel=1e-6)
    assert len(details["section"]["q"]) == 1


def test_contacts_are_logged_and_drawn(client, do, model) -> None:
    result = do(model, do="compute")
    last = result["branches"][0]["points"] - 1
    place = {"file": model, "result": result["key"], "branch": 0, "point": last, "signal": "x", "tab": "a"}
    motion = client.get("/api/motion", params=place).json()
    assert {(entry["contact"], entry["what"]) for entry in motion["log"]} == {("stop +", "closes"), ("stop +", "opens")}
    (contact,) = motion["contacts"]
    assert contact["stops"] == [1.0]
    closed = np.array(contact["deflection"]) > 1.0
    assert np.all(np.array(contact["force"])[~closed] == 0.0)
    assert motion["machine"]["moved"] == [motion["q"]["x"]]
    assert motion["machine"]["stops"] == [None, [None, 1.0]]
    assert [[part["kind"] for part in scene["parts"]] for scene in motion["machine"]["scenes"]] == 2 * [
        ["spring", "damper", "gap", "body"]
    ]


def test_walking_from_a_point_is_an_ordinary_result(client, do, session, model) -> None:
    first = do(model, do="compute")
    start = {"result": first["key"], "branch": 0, "point": 3}
    walked = do(model, do="walk", start=start, parameter="stop.clearance", to=0.5)
    assert walked["state"] == "done"
    path = session.workspace.exploration(session.workspace.path(model)) / f"{walked['key']}.gapwalk"
    (branch,) = gw.open_result(path).branches
    assert (branch.parameter, branch.values[-1]) == ("stop.clearance", 0.5)
    orbit = gw.find_orbit(
        gw.read_study(session.workspace.path(model)).system, at=dict(branch.points[-1].orbit.system.parameters)
    )
    np.testing.assert_allclose(orbit.state, branch.points[-1].orbit.state, atol=1e-7)


def test_a_branch_of_twice_the_period_begins_at_a_flip(client, do, session) -> None:
    name = "flip.toml"
    (session.workspace.root / name).write_text(CLUTCH.read_text(encoding="utf-8"), encoding="utf-8")
    first = do(name, do="compute")
    query = {"file": name, "result": first["key"], "branch": 0, "x": "frequency", "y": "half.q1"}
    special = client.get("/api/curve", params=query).json()["special"]
    number = [each["kind"] for each in special].index("flip")
    assert special[number]["value"] == pytest.approx(1.3327, abs=1e-3)  # the paper's figure 13
    start = {"result": first["key"], "branch": 0, "special": number}
    low, high = first["branches"][0]["range"]
    child = do(name, do="switch", start=start, low=low, high=high)
    (branch,) = child["branches"]
    assert (child["state"], branch["period"]) == ("done", 2)
    curve = client.get("/api/curve", params={**query, "result": child["key"]}).json()
    assert unpacked(curve, "x")[0] == pytest.approx(special[number]["value"], abs=1e-8)
    # a fold leads nowhere
    fold = [each["kind"] for each in special].index("fold")
    action = {"file": name, "do": "switch", "start": {**start, "special": fold}, "low": low, "high": high}
    refused = client.post("/api/act", json=action)
    assert refused.status_code == 400
    assert "choose a flip" in refused.json()["error"]


def test_a_motion_settles_from_a_point_at_other_values(client, do, model) -> None:
    first = do(model, do="compute")
    start = {"result": first["key"], "branch": 0, "point": 0}
    settled = do(model, do="settle", start=start, values={"frequency": 0.6})
    assert settled["settled"] is True
    query = {"file": model, "result": settled["key"], "x": "frequency", "y": "half.x"}
    place = client.get("/api/curve", params=query).json()["settled"]
    np.testing.assert_allclose(place, [0.6, amplitude(0.6)], rtol=1e-6)
    walked = do(model, do="walk", start={"result": settled["key"]}, parameter="frequency", to=0.65)
    assert walked["state"] == "done"


@pytest.mark.slow
def test_a_motion_without_period_is_shown_too(client, do, session) -> None:
    name = "torus.toml"
    (session.workspace.root / name).write_text(CLUTCH.read_text(encoding="utf-8"), encoding="utf-8")
    settled = do(name, do="settle", values={"frequency": 0.4})
    place = {"file": name, "result": settled["key"], "signal": "q1", "tab": "a"}
    motion, details = (client.get(f"/api/{what}", params=place).json() for what in ("motion", "details"))
    assert motion["period"] is None
    assert motion["multipliers"] == []
    assert motion["theta"][-1] == 24.0
    (contact,) = motion["contacts"]
    d, f = (np.array(contact[name]) for name in ("deflection", "force"))
    chord = (f[1:] + f[:-1])[np.abs(d[1:] + d[:-1]) < 1.9 * max(contact["stops"])]  # half way between two samples
    assert np.abs(chord).max() < 1e-9  # inside the gap
    assert len({round(q, 3) for q in details["section"]["q"]}) > 100
    # it has no place on the diagram, and no branch to walk
    assert settled["saves"] == ["table", "script", "result"]
    query = {"file": name, "result": settled["key"], "x": "frequency", "y": "half.q1"}
    assert client.get("/api/curve", params=query).json() == {"settled": None}
    walk = {"do": "walk", "start": {"result": settled["key"]}, "parameter": "frequency", "to": 0.5}
    refused = client.post("/api/act", json={"file": name, **walk})
    assert "not periodic" in refused.json()["error"]


@pytest.mark.slow
def test_what_was_done_is_there_when_the_file_is_opened_again(client, do, session, model) -> None:
    first = do(model, do="compute")
    do(model, do="walk", start={"result": first["key"], "point": 0}, parameter="frequency", to=0.6)
    before = about(client, model)["results"]
    again = listed(Exploration(session.workspace, model))  # as a server that begins anew reads it from the store
    again = json.loads(json.dumps(again))
    assert [each["title"] for each in again] == [each["title"] for each in before]
    assert [each["branches"] for each in again] == [each["branches"] for each in before]
    # and a result can be opened by itself
    (found,) = session.workspace.exploration(session.workspace.path(model)).glob("01-*.gapwalk")
    opened = about(client, f"{found.parent.name}/{found.name}")
    assert opened["results"][0]["branches"] == first["branches"]


def test_many_files_can_be_opened_one_after_the_other(client, session) -> None:
    for number in range(25):
        (session.workspace.root / f"many{number}.toml").write_text(STOP, encoding="utf-8")
        assert about(client, f"many{number}.toml")["x"] == "frequency"
    assert len(session.progress()["explorations"]) <= 20


def test_a_bad_model_is_told_in_sentences(client, session) -> None:
    (session.workspace.root / "bad.toml").write_text("coordinates = 3\n", encoding="utf-8")
    answer = client.get("/api/about", params={"file": "bad.toml"})
    assert answer.status_code == 400
    assert "bad.toml" in answer.json()["error"]
    assert "study" in answer.json()["error"]


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ({"do": "dance"}, "does not match any of the expected tags"),
        ({"do": "compute", "values": {"frequency": float("1e999")}}, "finite"),
        ({"do": "compute", "values": {"stop.clearance": -1.0}}, "clearance"),
        ({"do": "compute", "values": {"__import__('os')": 1.0}}, "no parameter"),
        ({"do": "compute", "study": "other"}, "no study"),
        ({"do": "walk", "start": {"result": "none"}, "parameter": "frequency", "to": 1.0}, "no result"),
        ({"do": "compute", "extra": 1}, "extra"),
    ],
)
def test_nonsense_is_refused_in_a_sentence(client, model, action, words) -> None:
    answer = client.post(
        "/api/act", content=json.dumps({"file": model, **action}), headers={"content-type": "application/json"}
    )
    assert answer.status_code == 400
    assert words in answer.json()["error"]


def test_tables_and_model_files_say_the_same_as_the_result(client, do, model) -> None:
    result = do(model, do="compute", values={"stop.clearance": 0.8})
    query = {"file": model, "result": result["key"]}
    rows = client.get("/api/export/table", params=query).text.splitlines()
    assert len(rows) == 1 + result["branches"][0]["points"]
    text = client.get(
        "/api/export/model",
        params={**query, "branch": 0, "point": 5, "parameter": "stop.clearance", "to": 0.4, "y": "half.x"},
    ).text
    assert tomllib.loads(text)["study"]["from"] == 0.8
    stored = client.get("/api/export/result", params=query).content
    assert stored.startswith(b"SQLite format 3")
    assert client.get("/api/export/poem", params=query).status_code == 400


def test_a_model_file_of_a_point_gives_that_point(client, do, session, model) -> None:
    result = do(model, do="compute", values={"stop.clearance": 0.8})
    query = {"file": model, "result": result["key"], "branch": 0, "point": 5, "parameter": "stop.clearance", "to": 0.4}
    path = session.workspace.root / "exported.toml"
    path.write_text(client.get("/api/export/model", params={**query, "y": "half.x"}).text, encoding="utf-8")
    (entry,) = [each for key, each in session.exploration(model).entries.items() if key == result["key"]]
    (branch,) = gw.run(gw.read_study(path)).branches
    first, origin = branch.points[0].orbit, entry.result.branches[0].points[5].orbit
    assert dict(first.system.parameters) == dict(origin.system.parameters)
    np.testing.assert_allclose(first.state, origin.state, atol=1e-9)


def test_measures_that_are_stored_do_not_wait_for_a_flow_and_others_come_in_parts(client, do, session, model) -> None:
    result = do(model, do="compute")
    (line,) = session.exploration(model).entry(result["key"]).lines()
    assert list(Quantities(line, ("stop.clearance", "rms.x")).parts()) == []
    many = line._replace(points=list(line.points) * 20)
    assert len(list(Quantities(many, ("stop.clearance", "h1.x")).parts())) > 5
    query = {"file": model, "result": result["key"], "x": "frequency", "y": "h1.x"}
    y = unpacked(client.get("/api/curve", params=query).json(), "y")
    assert y[0] == pytest.approx(amplitude(0.7), rel=1e-9)


def test_two_pages_give_two_results(client, session, model) -> None:
    keys = [client.post("/api/act", json={"file": model, "do": "compute"}).json()["key"] for _ in range(4)]
    assert len(set(keys)) == 4

    counts = {wait(client, model, key)["branches"][0]["points"] for key in keys}
    assert len(counts) == 1
    folder = session.workspace.exploration(session.workspace.path(model))
    for path in folder.glob("*.gapwalk"):
        assert sqlite3.connect(path).execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_a_second_click_gives_up_the_first() -> None:
    calls: list[str] = []

    async def clicks() -> list[object]:
        flows = Flows()
        slow = flows.do(lambda: __import__("time").sleep(0.2))
        first = flows.do_last("tab", lambda: calls.append("first"))
        second = flows.do_last("tab", lambda: calls.append("second"))
        other = flows.do_last("other tab", lambda: calls.append("other"))
        found = await asyncio.gather(slow, first, second, other, return_exceptions=True)
        flows.close()
        return found

    _, first, second, other = run_apart(clicks())
    assert isinstance(first, SupersededError)
    assert (second, other) == (None, None)
    assert calls == ["second", "other"]


def test_names_and_numbers_that_are_none_are_told_in_sentences(client, session, model) -> None:
    for name in ("a\udcff.toml", "\ud800.toml"):
        answer = client.post("/api/act", content=json.dumps({"file": name, "do": "compute"}), headers=JSON)
        assert (answer.status_code, "not the name of a file" in answer.json()["error"]) == (400, True)
    for number in ("²", "٣", "-1", "1e9"):
        query = {"file": model, "x": "frequency", "y": "half.x"}
        assert client.get("/api/curve", params={**query, "branch": number}).status_code == 400
        assert client.get("/api/motion", params={"file": model, "branch": number}).status_code == 400
    assert client.post("/api/act", content=b"{}", headers={**JSON, "content-length": "²".encode()}).status_code == 413


def test_files_whose_names_are_no_text_are_left_out(client, session) -> None:
    path = os.path.join(os.fsencode(session.workspace.root), b"odd\xff.toml")
    with open(path, "wb") as file:
        file.write(STOP.encode())
    try:
        assert not [name for name in client.get("/api/files").json()["files"] if name.startswith("odd")]
    finally:
        os.unlink(path)


def test_what_has_foreign_letters_in_its_name_can_be_saved(client, do, session) -> None:
    (session.workspace.root / "模型.toml").write_text(STOP, encoding="utf-8")
    do("模型.toml", do="compute")
    folder = next((session.workspace.root / "模型.explorer").glob("*.gapwalk"))
    folder.rename(folder.with_name("结果.gapwalk"))
    name = f"{folder.parent.name}/结果.gapwalk"
    answer = client.get("/api/export/table", params={"file": name, "result": ""})
    assert answer.status_code == 200
    assert unquote(answer.headers["content-disposition"]).endswith("结果.csv")


def test_no_more_pages_listen_than_there_is_room_for() -> None:
    async def come() -> list[object]:
        events = Events(dict)
        pages = await asyncio.gather(*(asyncio.to_thread(lambda: None) for _ in range(3)))  # a loop that runs
        assert pages == [None] * 3

        async def page() -> object:
            return events.join()  # before any of them has begun to listen

        found = await asyncio.gather(*(page() for _ in range(40)), return_exceptions=True)
        for place in found[:16]:
            events.leave(place)
        assert isinstance(events.join(), asyncio.Event)
        return found

    found = run_apart(come())
    assert [isinstance(each, ModelError) for each in found] == [False] * 16 + [True] * 24


@pytest.mark.parametrize("way", ["../outside.mtx", "{outside}", "link.mtx"])
def test_a_model_reads_no_matrix_outside_of_the_workspace(client, session, way) -> None:
    name, outside = f"matrix{len(way)}.toml", session.workspace.root.parent / "outside.mtx"
    outside.write_text("%%MatrixMarket matrix array real general\n1 1\n1.0\n")
    link = session.workspace.root / "link.mtx"
    if way == "link.mtx" and not link.is_symlink():
        link.symlink_to(outside)
    text = STOP.replace("stiffness = [1.0]", f'stiffness = "{way.format(outside=outside)}"')
    (session.workspace.root / name).write_text(text)
    answer = client.get("/api/about", params={"file": name})
    assert answer.status_code == 400
    assert "lies outside of the folder" in answer.json()["error"]
    shutil.copy(outside, session.workspace.root / "inside.mtx")
    (session.workspace.root / name).write_text(text.replace(way.format(outside=outside), "inside.mtx"))
    assert about(client, name)["problem"] == ""


def test_an_edit_of_the_file_is_noticed_and_results_are_told_apart(client, do, session, model) -> None:
    first = do(model, do="compute")
    before = about(client, model)
    assert first["model"] == before["model"] == gw_mark(session, model)
    path = session.workspace.root / model
    path.write_text(STOP.replace("clearance = 1.0", "clearance = 0.5"), encoding="utf-8")
    assert session.progress()["explorations"][model]["stamp"] != before["stamp"]
    after = about(client, model)
    assert after["stamp"] == session.progress()["explorations"][model]["stamp"]
    assert after["values"]["stop.clearance"] == 0.5
    assert after["model"] != before["model"]
    second = do(model, do="compute")
    assert [each["model"] for each in about(client, model)["results"]] == [before["model"], after["model"]]
    assert second["branches"][0]["points"] != first["branches"][0]["points"]
    # what goes back to a motion of the first model belongs to that
    walked = do(model, do="walk", start={"result": first["key"], "point": 3}, parameter="frequency", to=0.75)
    assert walked["model"] == before["model"]
    # and so it is for a server that begins anew
    again = listed(Exploration(session.workspace, model))
    assert [each["model"] for each in again] == [before["model"], after["model"], before["model"]]


def test_an_edit_of_a_matrix_beside_the_file_is_noticed_and_results_are_told_apart(client, do, session) -> None:
    matrix, name = session.workspace.root / "edited.npy", "edited.toml"
    np.save(matrix, [[1.0]])
    (session.workspace.root / name).write_text(STOP.replace("stiffness = [1.0]", f'stiffness = "{matrix.name}"'))
    first, before = do(name, do="compute"), about(client, name)
    assert first["model"] == before["model"]
    matrix.unlink()
    assert session.progress()["explorations"][name]["stamp"] != before["stamp"]
    assert "No such file" in about(client, name)["problem"]
    np.save(matrix, [[1.5]])
    after = about(client, name)
    assert after["stamp"] == session.progress()["explorations"][name]["stamp"] != before["stamp"]
    assert (after["problem"], after["values"]["stiffness.x.x"]) == ("", 1.5)
    assert after["model"] != before["model"]
    changed = do(name, do="compute", values={"stiffness.x.x": 1.25})
    assert changed["model"] == after["model"]  # a value that was changed on the page is no other model
    again = listed(Exploration(session.workspace, name))
    assert [each["model"] for each in again] == [before["model"], after["model"]]
    np.save(matrix, [[1.0]])
    assert about(client, name)["model"] == before["model"]


def gw_mark(session, model: str) -> str:
    return hashlib.sha256((session.workspace.root / model).read_bytes()).hexdigest()[:8]


@pytest.mark.slow
def test_a_broken_model_is_told_whole_and_its_results_are_there(client, do, session, model) -> None:
    first = do(model, do="compute")
    path = session.workspace.root / model
    path.write_text(STOP.replace("clearance = 1.0", "clearance = -1.0\ngap = 1"), encoding="utf-8")
    for known in (about(client, model), _of_a_new_server(session, model)):
        assert [each["key"] for each in known["results"]] == [first["key"]]
        assert {"clearance is -1.0", "gap is not a key here"} <= {
            words for words in ("clearance is -1.0", "gap is not a key here") if words in known["problem"]
        }
        assert known["model"] in (first["model"], "")  # of the last good one, if this server knows it
        assert known["measures"]
    refused = client.post("/api/act", json={"file": model, "do": "compute"})
    assert (refused.status_code, "clearance is -1.0" in refused.json()["error"]) == (400, True)
    query = {"file": model, "result": first["key"], "x": "frequency", "y": "half.x"}
    assert client.get("/api/curve", params=query).json()["count"] == first["branches"][0]["points"]
    path.write_text(STOP, encoding="utf-8")
    assert about(client, model)["problem"] == ""


def _of_a_new_server(session, model: str) -> dict:
    other = Session(session.workspace.root)
    try:
        return model_editor.about(other, model)
    finally:
        other.close()


def test_values_have_the_units_of_the_file(session, client) -> None:
    text = (CLUTCH.parent / "idle.toml").read_text(encoding="utf-8").replace('"8 N m"', '"8000 mN m"')
    (session.workspace.root / "units.toml").write_text(text, encoding="utf-8")
    rows = {each["name"]: each for each in about(client, "units.toml")["parameters"]}
    (name,) = [name for name, each in rows.items() if each.get("written", "").endswith(" [mN m]")]
    assert (rows[name]["value"], rows[name]["size"]) == (8.0, pytest.approx(1e-3, rel=1e-15))
    assert rows[name]["words"].endswith(" [N m]")  # of the axes, as in results


def test_the_orders_of_one_load_move_a_point_together() -> None:
    """A linear oscillator touches where all loads over the clearance have some size: their shares are opposite."""
    stop = gw.Contact("stop", {"x": 1.0}, (gw.Stage(1.0, 1.0, side=gw.Side.POSITIVE),))
    loads = [gw.Harmonic(0.3, {"x": 1.0}, name="first"), gw.Harmonic(0.1, {"x": 1.0}, order=2, name="second")]
    system = gw.System(["x"], [[1.0]], [[0.1]], contacts=[stop], harmonics=loads, frequency=0.6)
    branch = gw.follow(gw.find_orbit(system), "frequency", 1.0)
    content = gradient_content(branch.special("grazing")[0].gradient())
    rows = {each["name"]: each for each in content["rows"]}
    assert rows["load on x"]["share"] == pytest.approx(-rows["stop.clearance"]["share"], rel=1e-6)
    assert rows["load on x"]["move"] == pytest.approx(rows["load on x"]["share"] * content["at"], rel=1e-12)
