"""Server of the explorer: on the loopback address, or on another one; each request needs the token that is printed.

Method: docs/numerics/explorer.md
"""

from __future__ import annotations

import asyncio
import socket
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path

import uvicorn

from gapwalk.errors import ModelError
from gapwalk.explorer.engine import Engine
from gapwalk.explorer.exploration import Exploration
from gapwalk.explorer.request_guard import is_loopback, kept_token, new_token
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
    """Serve the explorer until Ctrl-C."""
    root, name = _workspace(file)
    if name:
        Exploration(Workspace(root), name)  # errors of the file are reported here, not on a page
    with _listen(host, port) as listener:
        bound, port = listener.getsockname()[:2]
        session, is_local = Session(root, name, engine), is_loopback(bound)
        once = new_token() if browser else ""
        token = kept_token(session.workspace.root, port) if is_local else new_token()
        places = [f"http://{_shown(each)}:{port}/?token=" for each in _reachable(host, bound)]
        config = uvicorn.Config(
            application(session, token, once=once, is_local=is_local),
            log_level="warning",
            timeout_graceful_shutdown=_GRACE,
            server_header=False,
        )

        def tell() -> None:
            print(f"the explorer of {session.workspace.root} is at", flush=True)
            for place in places:
                print(f"    {place}{token}", flush=True)
            print("Ctrl-C ends it; results are stored", flush=True)
            if browser:
                webbrowser.open(places[-1] + once)

        asyncio.run(_Server(config, tell, session.events.close).serve(sockets=[listener]))


class _Server(uvicorn.Server):
    """A server that announces its address once it answers, and closes the streams of pages when it ends."""

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


def _reachable(host: str, bound: str) -> list[str]:
    """Return the addresses at which a server answers; one that listens everywhere in the network and here."""
    if not ip_address(bound).is_unspecified:
        return [host]
    family, far, near = (
        (socket.AF_INET6, "2001:db8::1", "::1") if ":" in bound else (socket.AF_INET, "192.0.2.1", "127.0.0.1")
    )
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((far, 9))  # nothing is sent: the system only chooses the address from which it would be
        return list(dict.fromkeys((probe.getsockname()[0], near)))
    return [near]


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
