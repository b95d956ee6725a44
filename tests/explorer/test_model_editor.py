"""The model editor without a page: checks of a text, its numbers, its response, and files that stay the user's own."""

import asyncio
import io
import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import gapwalk as gw
from gapwalk.errors import ModelError
from gapwalk.explorer.live_process import Asked, Known, LiveAnswers, answers
from gapwalk.explorer.model_editor import checked_text, numbers_of, save_text, start_text, starts, text_of
from gapwalk.explorer.workspace_folder import Workspace
from gapwalk.model.model_file import check_model
from gapwalk.model.model_source import parse_source, value_spans
from gapwalk.studies import live_response, read_studies
from tests.explorer.conftest import STOP, run_apart
from tests.studies.test_complete_response import TRAIN

EXAMPLES = Path(__file__).parents[2] / "examples"
STARTS = [each["name"] for each in starts()]


def example(name: str) -> str:
    return (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")


def response(text: str, known: Known | None = None) -> list[dict]:
    """The title of a live response, moved points if there are any, the points one by one, and why it ends."""
    title, *more = [each for each in answers(Asked(1, text), known) if each.get("of") == "response"]
    points = [
        {"x": x, "y": y, "look": look}
        for each in more
        for x, y, look in zip(*(each.get(name, ()) for name in ("x", "y", "looks")), strict=True)
    ]
    return [title["title"], *(each for each in more if "moved" in each), *points, more[-1]]


def checked(text: str) -> dict:
    return checked_text(text, "model.toml", "")


@pytest.mark.parametrize("name", STARTS)
def test_each_beginning_has_no_errors_and_is_drawn(name) -> None:
    found = checked(start_text(name))
    assert found["problems"] == []
    assert found["machine"]
    assert found["plans"]
    assert found["title"]


def changed_by(text: str, number: dict, digits: str) -> dict[str, float]:
    """The parameters that differ from those of a text after the digits of one number were replaced."""
    other = text[: number["begin"]] + digits + text[number["end"] :]
    (first, _), (second, _) = (check_model(parse_source(each)) for each in (text, other))
    assert first is not None
    assert second is not None
    before, after = first.system.parameters, second.system.parameters
    return {name: after[name] for name in before if after[name] != before[name]}


# what a number of a train changes besides itself: its drag torque is taken by the reaction, for example
@pytest.mark.parametrize("name", [*STARTS, "train", "hysteresis"])
def test_a_slider_changes_the_parameter_after_which_it_is_named_and_no_other(name) -> None:
    text = start_text(name) if name in STARTS else example(name)
    numbers = checked(text)["numbers"]
    assert len(numbers) >= 5
    assert len({each["name"] for each in numbers}) == len(numbers)
    for number in numbers:
        digits = repr(number["value"] * 0.9 + (number["value"] == 0.0) * 0.01)
        assert [*changed_by(text, number, digits)] == [number["name"]], number
        assert float(text[number["begin"] : number["end"]]) == number["value"]
        assert number["line"] == text.count("\n", 0, number["begin"]) + 1


def test_numbers_with_units_are_named_with_them_and_the_unit_is_no_digit() -> None:
    text = example("idle")
    numbers = {each["name"]: each for each in checked(text)["numbers"]}
    assert numbers["clutch.damping"]["words"] == "damping of clutch [N m s/rad]"
    assert numbers["mesh.stiffness"]["words"] == "stiffness of mesh [N m/rad]"  # as written, not as in results
    clearance = numbers["mesh.clearance"]
    assert (clearance["words"], clearance["value"], clearance["unit"]) == ("clearance of mesh [deg]", 0.1, "deg")
    assert text[clearance["begin"] - 1 : clearance["end"] + 5] == '"0.1 deg"'


@pytest.mark.parametrize(
    "value", ["1_000.0", "0x1F", "true", "inf", '"2 3 deg"', "'''1.0'''", "[1.0]", '"rigid"', '"deg 1"']
)
def test_other_values_are_no_numbers_of_a_slider(value) -> None:
    assert list(numbers_of(parse_source(f"frequency = {value}\n"), None)) == []


def test_places_of_values_are_those_of_toml_whatever_stands_around_them() -> None:
    text = 'a = [ 1.5, # one\n  {b = "x#y", c.d = -2e-3 } ]  # two\n[t]\n"k.e" = \'z\'   \n[[s]]\nv = 0.25# three\n'
    found = {path: text[begin:end] for path, (begin, end) in value_spans(text).items()}
    assert found == {
        ("a", 0): "1.5",
        ("a", 1, "b"): '"x#y"',
        ("a", 1, "c", "d"): "-2e-3",
        ("t", "k.e"): "'z'",
        ("s", 0, "v"): "0.25",
    }


def test_errors_have_their_lines_and_what_is_right_so_far_is_shown() -> None:
    wrong = STOP.replace("side =", "sdie =")
    (problem,) = [each for each in checked(wrong)["problems"] if "sdie" in each["text"]]
    assert problem["line"] == 1 + wrong[: wrong.index("sdie")].count("\n")
    assert problem["text"].endswith("did you mean side?")
    unfinished = STOP.replace('kind = "response"', 'kind = "respnse"')
    found = checked(unfinished)
    assert [each["text"] for each in found["problems"]]
    assert found["machine"]  # the system is right already
    assert found["system"]
    assert checked("x = ")["problems"][0]["line"] == 1
    assert checked("x = ")["numbers"] is None
    assert "need a text editor" in checked("#" * 60_000)["problems"][0]["text"]


def test_the_response_is_that_of_an_exact_walk_to_a_hundredth(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_response, "LONGEST", 600.0)  # on a busy machine it is stopped before its end
    first, *points, last = response(STOP)
    assert last["end"] == ""
    assert (first["across"], first["up"]) == ("excitation frequency Ω", "amplitude of x (half the peak to peak)")
    (study,) = read_studies(io.StringIO(STOP))
    options = study.options
    exact = gw.follow(gw.find_orbit(study.system, start="rest"), "frequency", options.end)
    most = max(exact.measure("half.x"))
    assert max(each["y"] for each in points) == pytest.approx(most, rel=0.02)
    for each in points[:: len(points) // 7]:
        orbit = gw.find_orbit(study.system.at({"frequency": each["x"]}), start="settle")
        if each["look"] == "stable" and orbit.measure("half.x") == pytest.approx(each["y"], rel=0.3):
            assert orbit.measure("half.x") == pytest.approx(each["y"], rel=0.01, abs=0.01 * most)
    assert min(each["x"] for each in points) == pytest.approx(min(first["range"]))
    assert max(each["x"] for each in points) == pytest.approx(max(first["range"]))


BACK = """
title = "A response that turns back"
coordinates = ["x"]
stiffness = [[1.0]]
damping = [[0.05]]
contact = [{ name = "stop", deflection = { x = 1.0 }, clearance = 1.0, stiffness = 20.0 }]
harmonic = [{ amplitude = 0.3, acts_on = { x = 1.0 } }]
study = { kind = "response", parameter = "frequency", from = 0.8, to = 3.5, measure = "half.x" }
"""


def test_folds_that_hold_a_walk_back_leave_nothing_of_the_range_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_response, "_BEHIND", 2)
    _, *points, last = response(BACK)
    assert last["end"] == ""
    settled = [each for each in points if each["look"] == "settled"]
    walked = points[: -len(settled)]
    assert settled[0]["x"] > max(each["x"] for each in walked) > walked[-1]["x"]
    assert settled[-1]["x"] == 3.5
    for each in settled[-3:]:  # where nothing touches the stop
        assert each["y"] == pytest.approx(0.3 / abs(1.0 - each["x"] ** 2 + 0.05j * each["x"]), rel=0.01)


def test_the_points_of_the_last_walk_are_moved_to_other_numbers_at_once() -> None:
    last, wide = Known(), BACK.replace("amplitude = 0.3", "amplitude = 0.31")
    assert not [each for each in response(BACK, last) if "moved" in each]
    found = list(response(wide, last))
    (news,) = (each["moved"] for each in found if "moved" in each)
    rest = next(each["marks"] for each in found if "marks" in each)
    changes = [pair for pair in pairwise(news["looks"]) if pair[0] != pair[1]]
    assert changes
    assert all("neutral" in pair for pair in changes)  # where stability changes between two points is not known
    free = [(x, y) for x, y in zip(news["x"], news["y"], strict=True) if y < 0.95]
    assert len(free) > 10
    for x, y in free:  # where nothing touches the stop
        assert y == pytest.approx(0.31 / abs(1.0 - x**2 + 0.05j * x), rel=0.01)
    (study,) = read_studies(io.StringIO(wide))
    exact = gw.follow(gw.find_orbit(study.system, start="rest"), "frequency", 3.5)
    upper, lower = (each.value for each in exact.special("fold"))
    coarse, whole = ([x for kind, x, _ in each if kind == "fold"] for each in (news["marks"], rest))
    assert whole == pytest.approx([upper, lower], rel=1e-5)
    assert coarse == pytest.approx([upper, lower], rel=0.05)  # the lower one is a corner, beside a graze
    assert coarse[0] == pytest.approx(upper, rel=1e-5)
    other = wide.replace("stiffness = 20.0", 'stiffness = 20.0, side = "positive"')  # another structure
    assert not [each for each in response(other, last) if "moved" in each]


LOCUS = (
    BACK[: BACK.index("study =")]
    + """
[study]
kind = "locus"
of = "fold"
parameter = "frequency"
from = 0.8
to = 3.5
near = 3.0
second = { parameter = "harmonic1.amplitude", from = 0.28, to = 0.32, at = 0.3 }
"""
)


def test_the_loci_of_a_study_are_those_of_the_study_and_move_with_the_numbers() -> None:
    known: Known = {}
    for text, is_moved in ((LOCUS, False), (LOCUS.replace("clearance = 1.0", "clearance = 1.01"), True)):
        title, *news, last = [
            each for each in answers(Asked(1, text, kinds=("locus",)), known) if each.get("of") == "locus"
        ]
        assert title["title"]["up"] == "amplitude of harmonic 1"
        assert last["end"] == ""
        (study,) = read_studies(io.StringIO(text))
        (own,) = gw.run(study).map.loci
        found = [each for each in (*news, last) if "x" in each]
        assert found[-1]["x"][:-1] == pytest.approx(own.values[:, 0].tolist(), abs=1e-9)
        assert found[-1]["y"][:-1] == pytest.approx(own.values[:, 1].tolist(), abs=1e-9)
        moved = [each["moved"] for each in news if "moved" in each]
        assert bool(moved) is is_moved
        for each in moved:  # the place of a fold at the same amplitude
            x, y = (np.array(each[name][:-1], dtype=float) for name in ("x", "y"))
            order, inside = np.argsort(own.values[:, 1]), (y > 0.285) & (y < 0.315)
            assert inside.sum() > 10
            exact = np.interp(y[inside], *own.values[order][:, ::-1].T)
            assert x[inside] == pytest.approx(exact, abs=2e-4)


def test_a_train_that_rattles_without_period_has_its_settled_response_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("an orbit is looked for where none is")

    monkeypatch.setattr(live_response, "find_orbit", refuse)
    monkeypatch.setattr(live_response, "LONGEST", 600.0)
    text = TRAIN.replace('from = "1100 rpm"', 'from = "900 rpm"').replace('"1050 rpm"', '"880 rpm"')
    first, *points, last = response(text)
    assert last["end"] == ""
    assert {each["look"] for each in points} == {"settled"}
    assert [points[0]["x"], points[-1]["x"]] == first["range"] == [900.0, 880.0]
    depth = np.array([each["y"] for each in points])  # deg: the teeth are left, and hit again
    assert np.all((depth > 0.12) & (depth < 1.0))


def test_a_response_without_time_is_not_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_response, "LONGEST", 0.0)
    _, *points, last = response(BACK)
    assert points
    assert "before the end of the range" in last["end"]


@pytest.mark.parametrize("name", ["gear", "drivetrain", "idle", "mesh", "rub"])
def test_beginnings_have_a_response_without_a_compiled_flow(name, monkeypatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("this would take seconds after each change of the structure")

    monkeypatch.setattr("gapwalk.flow.flow.Flow.__init__", refuse)
    first, *points, last = response(example(name))
    assert len(points) > 15
    assert set(first) == {"across", "up", "axes", "range"}
    assert isinstance(last["end"], str)


def test_the_response_of_a_rigid_stop_goes_on_beyond_grazes() -> None:
    *_, before, last = response(BACK.replace("stiffness = 20.0", 'stiffness = "rigid", restitution = 0.75'))
    assert last["end"] == ""
    assert before["x"] == pytest.approx(3.5)


@pytest.mark.parametrize("name", ["den_hartog", "belt"])
def test_friction_has_a_response_too(name) -> None:
    *_, before, last = response(example(name))
    assert before["y"] > 0.0
    assert last["end"] == ""


def test_what_has_no_response_is_said() -> None:
    said, _ = answers(Asked(1, example("impact_damper")))
    assert 'kind = "response"' in said["end"]
    assert said["failed"]


@pytest.mark.slow
def test_a_walk_that_nobody_waits_for_is_given_up_and_the_next_one_comes_at_once() -> None:
    live = LiveAnswers()
    long = STOP.replace("[study]", "[study]\nperiod = 1")

    async def both() -> list[dict]:
        abandoned = live.of(long, "", "")
        await anext(abandoned)
        await abandoned.aclose()
        return [news async for news in live.of(STOP, "", "")]

    try:
        news = run_apart(both())
        process = live._process
        assert process is not None
        assert news[0]["title"]["across"]
        assert news[-1]["end"] == ""
        assert sum(len(each.get("x", ())) for each in news) > 20
        again = run_apart(both())  # in another loop, by the same process
        assert again[-1]["end"] == ""
        assert live._process is process
    finally:
        live.close()
    assert not process.is_alive()


@pytest.mark.slow
def test_a_change_ends_the_computation_of_exact_shares_at_once() -> None:
    live = LiveAnswers()
    many = STOP.replace("[study]", '[[study]]\nname = "first"') + (
        '\n[[study]]\nname = "many"\nkind = "shares"\nparameter = "frequency"\nfrom = 0.7\nto = 1.9\n'
        "starts = 100000\nbox = { x = [-2, 2] }\n"
    )

    async def both() -> object:
        abandoned = live.of(many, "", "", ("shares",))
        while "coarse" not in await anext(abandoned):
            pass
        process = live._process
        await asyncio.sleep(1.0)
        await abandoned.aclose()
        assert [news async for news in live.of(STOP, "", "")][-1]["end"] == ""
        return process

    try:
        assert run_apart(both()) is live._process  # which keeps what it knows
    finally:
        live.close()


@pytest.mark.slow
def test_long_work_that_nobody_waits_for_is_ended_and_the_next_text_is_answered() -> None:
    live = LiveAnswers()
    train = example("train")  # whose motions settle after minutes

    async def both() -> list[dict]:
        abandoned = live.of(train, "", "", ("shares",))
        while "coarse" not in await anext(abandoned):
            pass
        await asyncio.sleep(0.5)
        await abandoned.aclose()
        return [news async for news in live.of(STOP, "", "")]

    try:
        assert run_apart(both())[-1]["end"] == ""
    finally:
        live.close()


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return Workspace(tmp_path)


def test_a_text_is_saved_as_it_is_with_its_comments_line_ends_and_mark(workspace) -> None:
    own = "# mine\r\na = 1 # not a model\r\n"
    file = workspace.root / "own.toml"
    file.write_bytes(b"\xef\xbb\xbf" + own.encode())
    found = text_of(workspace, "own.toml")
    assert found["text"] == own.replace("\r\n", "\n")
    saved = save_text(workspace, "own.toml", found["text"] + "b = 2\n", found["stamp"])
    assert file.read_bytes() == b"\xef\xbb\xbf" + (own + "b = 2\r\n").encode()
    assert set(saved) == {"stamp"}
    assert text_of(workspace, "own.toml")["stamp"] == saved["stamp"]
    assert [each.name for each in workspace.root.iterdir()] == ["own.toml"]


def test_nothing_of_others_is_overwritten_without_a_word(workspace) -> None:
    assert set(save_text(workspace, "new.toml", "a = 1\n", "")) == {"stamp"}
    stamp = text_of(workspace, "new.toml")["stamp"]
    assert "already" in save_text(workspace, "new.toml", "a = 2\n", "")["conflict"]
    (workspace.root / "new.toml").write_text("a = 33\n", encoding="utf-8")
    assert "changed meanwhile" in save_text(workspace, "new.toml", "a = 2\n", stamp)["conflict"]
    assert (workspace.root / "new.toml").read_text(encoding="utf-8") == "a = 33\n"
    assert set(save_text(workspace, "new.toml", "a = 2\n", "*")) == {"stamp"}
    assert (workspace.root / "new.toml").read_text(encoding="utf-8") == "a = 2\n"


@pytest.mark.parametrize(
    "name", ["../x.toml", "x.gapwalk", "x.txt", "", ".x.toml", "sub/x.toml", "x.toml\0", "/x.toml"]
)
def test_only_model_files_in_the_folder_are_written(workspace, name) -> None:
    (workspace.root / "sub").mkdir()
    with pytest.raises(ModelError, match=r"\.toml|workspace|name of a file|neither"):
        save_text(workspace, name, "a = 1\n", "")
    assert [each.name for each in workspace.root.rglob("*")] == ["sub"]


def test_the_server_answers_the_editor(client, session, model) -> None:
    names = [each["name"] for each in client.post("/api/edit/starts", json={}).json()["starts"]]
    assert names == STARTS
    text = client.post("/api/edit/start", json={"start": "stop"}).json()["text"]
    assert text == start_text("stop")
    opened = client.post("/api/edit/open", json={"file": model}).json()
    assert opened["text"] == STOP
    lines = client.post("/api/edit/check", json={"file": model, "text": STOP}).text.splitlines()
    found, first, *_, last = (json.loads(line) for line in lines)
    assert found["problems"] == []
    assert first["title"]["across"] == "excitation frequency Ω"
    assert last["end"] == ""
    assert len(client.post("/api/edit/check", json={"text": "a = 1\n"}).text.splitlines()) == 1  # no response of that
    saved = client.post("/api/edit/save", json={"file": model, "text": f"{STOP}# mine\n", "stamp": opened["stamp"]})
    assert re.fullmatch(r"\d+-\d+", saved.json()["stamp"])
    assert (session.workspace.root / model).read_text(encoding="utf-8").endswith("# mine\n")
    refused = client.post("/api/edit/nonsense", json={})
    assert refused.status_code == 400
    assert "starts, start, open, save and check" in refused.json()["error"]
    assert client.post("/api/edit/save", json={"file": "../x.toml", "text": "a = 1"}).status_code == 400
    assert "no machine 'x' to begin with" in client.post("/api/edit/start", json={"start": "x"}).json()["error"]
