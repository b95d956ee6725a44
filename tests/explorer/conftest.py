"""A workspace with model files that are walked in a moment, and a server of it that tests ask without a network."""

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import pytest
from starlette.testclient import TestClient

from gapwalk.explorer.server_state import Session
from gapwalk.explorer.web_app import application
from tests import models
from tests.waiting import until

T = TypeVar("T")

ORIGIN = "http://127.0.0.1"

STOP = models.STOP + models.response(0.9)
CLUTCH = Path(__file__).parents[2] / "examples" / "clutch.toml"


@pytest.fixture(autouse=True, scope="package")
def _kept_between_modules() -> Iterator[None]:
    """All modules of this folder use one browser, and one process that computes for pages: each takes a second."""
    from tests.explorer.browser import browser_kept
    from tests.explorer.serving import engine_kept

    with browser_kept(), engine_kept():
        yield


@pytest.fixture(scope="session")
def session(tmp_path_factory) -> Iterator[Session]:
    """What the server keeps; each test takes a model file of its own (`model`)."""
    session = Session(tmp_path_factory.mktemp("workspace"))
    yield session
    session.close()


@pytest.fixture
def model(session, request) -> str:
    """The name of a model file in the workspace, a new one for each test."""
    name = f"{request.node.name.partition('[')[0]}.toml"
    (session.workspace.root / name).write_text(STOP, encoding="utf-8")
    return name


@pytest.fixture
def client(session) -> TestClient:
    """A page of the server."""
    return TestClient(application(session), base_url=ORIGIN)


@pytest.fixture
def do(client) -> Callable[..., dict[str, Any]]:
    """Do something with a file, wait for its end, and return how the result has come out."""

    def do(file: str, **action: Any) -> dict[str, Any]:
        answer = client.post("/api/act", json={"file": file, **action})
        assert answer.status_code == 200, answer.text
        return wait(client, file, answer.json()["key"])

    return do


def run_apart(work: Coroutine[Any, Any, T]) -> T:
    """Run asynchronous work in a thread of its own: the loop of the browser that is kept holds that of the tests."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()


def result_of(client: TestClient, file: str, key: str) -> dict[str, Any]:
    """How a result has come out so far; the file is not read anew."""
    (found,) = [each for each in about(client, file)["results"] if each["key"] == key]
    return found


def about(client: TestClient, file: str) -> dict[str, Any]:
    """What a page is told of a file."""
    answer = client.get("/api/about", params={"file": file})
    assert answer.status_code == 200, answer.text
    return answer.json()


def wait(client: TestClient, file: str, key: str, *states: str) -> dict[str, Any]:
    """Wait until a result is in one of some states; by default, until it is over."""
    states = states or ("done", "stopped", "failed")
    return until(
        lambda: (found := result_of(client, file, key))["state"] in states and found, f"{key} is one of {states}"
    )
