"""Server of the explorer: on the loopback address, or on another one with a token.

Method: docs/numerics/explorer.md
"""

from __future__ import annotations

import asyncio
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path

import uvicorn

from gapwalk.errors import ModelError
from gapwalk.explorer.engine import Engine
from gapwalk.explorer.exploration import Exploration
from gapwalk.explorer.request_guard import is_loopback, new_token
from gapwalk.explorer.session import Session
from gapwalk.explorer.web_app import application
from gapwalk.explorer.workspace import Workspace

_GRACE = 1  # seconds that open connections have when the server ends


def serve(
    file: Path | None,
    host: str = "127.0.0.1",
    port: int = 0,
    *,
    browser: bool = True,
    engine: Engine | None = None,
) -> None:
    """Serve the explorer until Ctrl-C.

    Parameters
    ----------
    file
        The model or result to show first, or a folder; its folder is the workspace. None: the current folder.
    host
        Address to listen on. If it is not loopback, every request needs a token, which the printed address contains.
    port
        The port; 0 for a free one.
    browser
        True to open the page.
    engine
        The process that computes; by default a new one.

    Raises
    ------
    ModelError
        If there is no such file, it cannot be opened, or the server cannot listen there.
    """
    root, name = _workspace(file)
    if name:
        Exploration(Workspace(root), name)  # errors of the file are reported here, not on a page
    with _listen(host, port) as listener:
        token = "" if is_loopback(host) else new_token()
        session = Session(root, name, engine)
        address = f"http://{_shown(host)}:{listener.getsockname()[1]}/{f'?token={token}' if token else ''}"
        config = uvicorn.Config(
            application(session, token), log_level="warning", timeout_graceful_shutdown=_GRACE, server_header=False
        )

        def tell() -> None:
            print(f"the explorer of {session.workspace.root} is at\n    {address}", flush=True)
            print("Ctrl-C ends it; results are stored", flush=True)
            if browser:
                webbrowser.open(address)

        asyncio.run(_Server(config, tell, session.events.close).serve(sockets=[listener]))


class _Server(uvicorn.Server):
    """A server that announces its address once it answers, and closes the streams of pages when it ends.

    Parameters
    ----------
    config
        As in `uvicorn.Server`.
    tell
        Function that is called once it listens.
    close
        Function that is called when it ends, before it waits for open requests: streams of events have no end.
    """

    def __init__(self, config: uvicorn.Config, tell: Callable[[], object], close: Callable[[], object]) -> None:
        super().__init__(config)
        self._tell, self._close = tell, close

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start to listen, and report the address."""
        await super().startup(sockets)
        if self.started:
            self._tell()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the streams of pages, and end."""
        self._close()
        await super().shutdown(sockets)


def _workspace(file: Path | None) -> tuple[Path, str]:
    """Return the folder, and the name of the file in it; empty for none."""
    path = Path() if file is None else file
    if path.is_dir():
        return path, ""
    if not path.exists():
        raise ModelError(f"there is no file {path}; `gapwalk new FILE` writes a model to begin with")
    return path.parent, path.name


def _listen(host: str, port: int) -> socket.socket:
    if not 0 <= port <= 65535:
        raise ModelError(f"the port is {port}; it must lie between 0 (any that is free) and 65535")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise ModelError(f"{host} is not an address to listen on: {error.strerror}") from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise ModelError(f"cannot listen on {host}, port {port}: {error.strerror}; try --port 0") from None
    return listener


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
