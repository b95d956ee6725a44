"""The explorer's server in the process of the tests, whose process that computes is kept from one module to the next.

It starts in no time, where the command loads all modules in two new processes. What the command does is tested with
`served` (`tests/explorer/browser.py`).
"""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import uvicorn

from gapwalk.explorer.engine import Engine
from gapwalk.explorer.server_state import Session
from gapwalk.explorer.web_app import _listen, _Server, _workspace, application
from tests.waiting import PATIENCE

_TOKEN = "that-of-the-tests"


class _KeptEngine(Engine):
    """A process that computes, and stays when the session that uses it is closed."""

    def close(self) -> None:
        """Do nothing: the next session goes on with it."""

    def end(self) -> None:
        """End the process."""
        super().close()


_kept: list[_KeptEngine] = []


@contextmanager
def engine_kept() -> Iterator[None]:
    """Keep the process that computes, once there is one, until the end."""
    try:
        yield
    finally:
        while _kept:
            _kept.pop().end()


def _engine() -> _KeptEngine:
    if not _kept:
        _kept.append(_KeptEngine())
    return _kept[0]


@contextmanager
def serving(file: Path) -> Iterator[str]:
    """The address of an explorer of a file or of a folder, as `gapwalk explore` serves it."""
    session = Session(*_workspace(file), _engine())
    listening = threading.Event()
    with _listen("127.0.0.1", 0) as listener:
        config = uvicorn.Config(application(session, _TOKEN), log_level="warning", timeout_graceful_shutdown=1)
        server = _Server(config, listening.set, session.events.close)
        thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[listener])), name="explorer")
        thread.start()
        try:
            assert listening.wait(PATIENCE)
            yield f"http://127.0.0.1:{listener.getsockname()[1]}/?token={_TOKEN}"
        finally:
            server.should_exit = True
            thread.join()
            session.close()
