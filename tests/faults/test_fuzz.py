"""Readers given nonsense that resembles sense: whatever comes, an error of gapwalk's own, or none.

The same few examples in each ordinary run; ``make fuzz`` tries others, as many of each as GAPWALK_FUZZ says.
"""

import copy
import json
import os
import random
import sqlite3
import struct
import tomllib
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from starlette.testclient import TestClient

import gapwalk as gw
from gapwalk.errors import GapwalkError, StoreError
from gapwalk.explorer.server_state import Session
from gapwalk.explorer.web_app import application
from gapwalk.model.model_source import Source, parse_source
from gapwalk.model.units import QuantityKind, read_quantity
from gapwalk.studies.set_values import parse_changes
from gapwalk.studies.study_file import check_studies
from tests.explorer.conftest import ORIGIN, STOP
from tests.faults.bad_input import MODELS
from tests.results.tampering import change_sealed
from tests.studies.diagrams import loop_file
from tests.studies.jobs import MODELS as JOBS
from tests.studies.jobs import result_file
from tests.studies.studies import stop_study
from tests.studies.sweeps import FOLDS
from tests.studies.sweeps import options as sweep_options

MORE = int(os.environ.get("GAPWALK_FUZZ", "0"))
GOOD = {**MODELS, **JOBS}


def budget(count: int) -> settings:
    return settings(
        max_examples=MORE or count,
        derandomize=not MORE,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large],
    )


def told(call: Callable[[], object], kind: type[Exception] = GapwalkError, nothing: str = "nothing") -> str:
    """What an error of the right kind says; any other goes on and fails the test."""
    try:
        call()
    except kind as error:
        return str(error).strip()
    return nothing


NUMBERS = st.sampled_from(
    [0, -1, 1, 2, 3, 0.5, 1e-300, 1e300, -1e300, 5e-324, 2**63, -(10**30), float("nan"), float("inf"), 10**400]
)
TEXTS = st.sampled_from(
    ["", " ", "x", "q1", "frequency", "3 deg", "0.14 kg m^2", "1e999 N m", "\0", "é", "a.b.c", "../x", "rest", "x'" * 9]
) | st.text(max_size=8)
VALUES = st.recursive(
    NUMBERS | TEXTS | st.booleans() | st.none(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=6,
)


def places(data: Any, path: tuple = ()) -> list[tuple]:
    """The paths of everything in nested tables and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    found = []
    for key, value in items:
        found += [(*path, key), *places(value, (*path, key))]
    return found


def mutate(data: Any, draw: Any) -> None:
    """Change one place of nested tables: leave it out, give it another value or name, or repeat it."""
    path = draw(st.sampled_from(places(data)))
    table = data
    for key in path[:-1]:
        table = table[key]
    how = draw(st.sampled_from(["value", "value", "delete", "rename", "double", "other"]))
    if how == "delete":
        del table[path[-1]]
    elif how == "rename" and isinstance(table, dict):
        table[draw(TEXTS)] = table.pop(path[-1])
    elif how == "double" and isinstance(table, list):
        table.append(copy.deepcopy(table[path[-1]]))
    elif how == "other":
        other = data
        for key in draw(st.sampled_from(places(data))):
            other = other[key]
        table[path[-1]] = copy.deepcopy(other)
    else:
        table[path[-1]] = draw(VALUES)


@given(st.data())
@budget(40)
def test_model_files_with_things_changed(data) -> None:
    text = GOOD[data.draw(st.sampled_from(sorted(GOOD)))]
    tables = tomllib.loads(text)
    for _ in range(data.draw(st.integers(1, 3))):
        if places(tables):
            mutate(tables, data.draw)
    assert told(lambda: check_studies(Source("m.toml", text, tables)))


@given(st.sampled_from(sorted(GOOD)), st.randoms(use_true_random=False))
@budget(30)
def test_model_files_with_letters_changed(name, chance) -> None:
    text = list(GOOD[name])
    for _ in range(chance.randint(1, 6)):
        place = chance.randrange(len(text))
        text[place] = chance.choice(
            ["", "\n", "[", "]", "=", '"', "'", "-", "9", ".", "e", "{", "#", "\0", text[place] * 2]
        )
    assert told(lambda: check_studies(parse_source("".join(text), "m.toml")))


@given(
    TEXTS | st.text(alphabet="0123456789.eE+-*/^() kgNmsradegHzrpm°²,_'", max_size=20), st.sampled_from(QuantityKind)
)
@budget(60)
def test_texts_of_units(text, kind) -> None:
    assert told(lambda: read_quantity(text, kind), ValueError)  # to which a model file adds its line


@given(st.text(alphabet="study.stopclearance=frequency[]{}\"'-1e9,naif\n\0", max_size=30), VALUES)
@budget(15)
def test_changes(text, value) -> None:
    for change in (text, f"stop.clearance={value}", f"study.walk={value}", f"study.to={value}"):
        assert told(lambda text=change: check_studies(parse_source(MODELS["stop"], "m.toml"), parse_changes([text])))


@pytest.fixture(scope="module")
def records(tmp_path_factory) -> list[Path]:
    """Good records, as text and as MAT files."""
    folder = tmp_path_factory.mktemp("records")
    time, acceleration = np.arange(30) * 0.1, np.sin(np.arange(30))
    rows = "".join(f"{t},{a}\n" for t, a in zip(time, acceleration, strict=True))
    (folder / "a.csv").write_text("time,acceleration\n" + rows)
    for name, compressed in (("b.mat", False), ("c.mat", True)):
        savemat(folder / name, {"time": time, "acceleration": acceleration}, do_compression=compressed)
    return sorted(folder.glob("?.*"))


@given(st.integers(0, 2), st.randoms(use_true_random=False))
@budget(40)
def test_records(records, which, chance) -> None:
    path = records[which]
    damaged = path.with_name(f"damaged{path.suffix}")
    damaged.write_bytes(_damaged(path.read_bytes(), chance))
    assert damaged.name in told(lambda: gw.measure.read_measurement(damaged), nothing=damaged.name)


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> dict[str, bytes]:
    """Small result files of several kinds."""
    folder = tmp_path_factory.mktemp("results")
    for name in ("settle", "regimes"):
        (folder / name).write_bytes(result_file(name))
    (folder / "diagram").write_bytes(loop_file())
    gw.run(stop_study(largest_step=0.1), folder / "response")
    gw.sweep(*FOLDS, **sweep_options(steps=4, ways="up"), output=folder / "sweep")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


RESULTS = ("response", "diagram", "settle", "regimes", "sweep")


@given(st.sampled_from(RESULTS), st.randoms(use_true_random=False))
@budget(20)
def test_result_files_with_bytes_changed(tmp_path_factory, results, name, chance) -> None:
    path = tmp_path_factory.getbasetemp() / f"{name}.gapwalk"
    path.write_bytes(_damaged(results[name], chance))
    _load(path)


@given(st.data())
@budget(60)
def test_result_files_with_values_changed(tmp_path_factory, results, data) -> None:
    """What a faulty program writes: checksums hide nothing here."""
    name = data.draw(st.sampled_from(RESULTS))
    path = tmp_path_factory.getbasetemp() / f"{name}.gapwalk"
    path.write_bytes(results[name])
    with closing(sqlite3.connect(path)) as connection:
        rows = connection.execute("SELECT name, number, head FROM part WHERE name <> 'seal'").fetchall()
    part, number, head = data.draw(st.sampled_from(rows))
    column = data.draw(st.sampled_from(["head", "head", "head", "arrays", "name", "number"]))
    value = data.draw(st.sampled_from([None, 0, -1, 2**62, 1e308, "", "x", "[]", "{}", "null", b"", b"\0" * 64]))
    if column == "head" and data.draw(st.integers(0, 4)):
        plain = json.loads(head)
        if places(plain):
            mutate(plain, data.draw)
        value = json.dumps(plain)
    with suppress(AssertionError, AttributeError, TypeError, struct.error, sqlite3.IntegrityError):  # no checksum of it
        change_sealed(path, f"UPDATE part SET {column} = ? WHERE name = ? AND number = ?", value, part, number)
    _load(path)


def _load(path: Path) -> None:
    assert path.name in told(lambda: gw.open_result(path), StoreError, nothing=path.name)


def _damaged(content: bytes, chance: random.Random) -> bytes:
    """Some bits turned, or a piece left out, cut off, or doubled."""
    damaged = bytearray(content)
    how = chance.choice(["bits", "bits", "cut", "hole", "double"])
    first, last = sorted(chance.randrange(len(damaged)) for _ in range(2))
    if how == "cut":
        del damaged[first:]
    elif how == "hole":
        damaged[first:last] = bytes(last - first)
    elif how == "double":
        damaged[first:first] = damaged[first:last]
    for _ in range(chance.choice((1, 30)) if how == "bits" else 0):
        damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
    return bytes(damaged)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A page of a server whose jobs are not done: only requests are tried."""
    desk = Session(tmp_path_factory.mktemp("fuzzed"))
    (desk.workspace.root / "model.toml").write_text(STOP, encoding="utf-8")
    desk.jobs.add = lambda *_, **__: None
    yield TestClient(application(desk), base_url=ORIGIN)
    desk.close()


PATHS = [
    "about",
    "curve",
    "motion",
    "details",
    "export/table",
    "export/model",
    "export/script",
    "export/x",
    "files",
    "x",
]
FIELDS = ["file", "result", "x", "y", "branch", "point", "special", "from", "signal", "tab", "parameter", "to"]


@given(
    st.sampled_from(PATHS),
    st.dictionaries(st.sampled_from(FIELDS), TEXTS | NUMBERS.map(str), max_size=8),
    st.booleans(),
)
@budget(30)
def test_requests_to_read(page, path, query, knows) -> None:
    answer = page.get(f"/api/{path}", params=query | ({"file": "model.toml"} if knows else {}))
    assert answer.status_code in (200, 400, 404, 405, 409)


@given(
    st.sampled_from(["act", "job/stop", "job/pause", "job/resume", "job/x"]),
    VALUES,
    st.dictionaries(
        st.sampled_from(["do", "start", "values", "parameter", "to", "low", "high", "study", "result", *FIELDS[:2]]),
        VALUES,
        max_size=6,
    ),
    st.binary(max_size=12),
)
@budget(20)
def test_requests_to_act(page, path, anything, fields, raw) -> None:
    headers = {"content-type": "application/json"}
    for body in (_json(anything), _json({"file": "model.toml", "do": "compute"} | fields), raw):
        answer = page.post(f"/api/{path}", content=body, headers=headers)
        assert answer.status_code in (200, 400, 409, 413)


@given(
    st.dictionaries(
        st.sampled_from(["host", "origin", "cookie", "content-type", "content-length", "sec-fetch-site", "x"]),
        st.text(alphabet=st.characters(min_codepoint=33, max_codepoint=126), max_size=30),
        max_size=4,
    ),
    st.sampled_from(["GET", "POST", "PUT", "HEAD", "OPTIONS", "X"]),
    st.text(max_size=10),
)
@budget(30)
def test_headers_and_paths(page, headers, method, path) -> None:
    answer = page.request(method, f"/{quote(path)}", headers=headers)
    assert answer.status_code < 500


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()
