"""Checks of every request: only pages of this server may send requests, and only small ones."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from ipaddress import ip_address
from typing import Any

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Send

MAX_BODY = 64_000
"""Largest size of a request, in bytes."""

_COOKIE = "gapwalk-token"
_HEADERS = {
    "content-security-policy": (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
}


def is_loopback(host: str) -> bool:
    """Return True if an address can be reached only from this machine."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(24)


class Guard:
    """Application that refuses requests which a page of this server would not send.

    - The name of the host must be this machine's loopback, so that no foreign name that points here is served
      (DNS rebinding). Where a token is set, the token says who may ask instead.
    - The origin, if the browser sends one, must be this server itself.
    - Requests that change something must be JSON: a form of a foreign page cannot send it without a preflight request.
    - Bodies are small.

    Parameters
    ----------
    app
        The guarded application.
    token
        If it is not empty, each request must carry it: once in the address (``?token=...``), then in a cookie.
    """

    def __init__(self, app: Callable[..., Awaitable[None]], token: str = "") -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: MutableMapping[str, Any], receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        request = HTTPConnection(scope)
        problem, brings_token = self._problem(scope, request.headers), False
        if not problem and self._token:
            brings_token = self._is_token(request.query_params.get("token", ""))
            if not brings_token and not self._is_token(request.cookies.get(_COOKIE, "")):
                problem = (403, "this page needs its token; open the address that the command printed")
        if problem:
            status, sentence = problem
            await PlainTextResponse(sentence, status)(scope, receive, send)
            return

        async def send_guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(_HEADERS)
                if brings_token:
                    headers.append("set-cookie", f"{_COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/")
            await send(message)

        await self._app(scope, _bounded(receive), send_guarded)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())

    def _problem(self, scope: Mapping[str, Any], headers: Mapping[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if not self._token and not is_loopback(_name_of(host)):
            return 421, "this server answers to 127.0.0.1 and localhost only"
        origin = headers.get("origin")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return 403, "a page of another origin may not ask this server"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return 403, "a page of another site may not ask this server"
        if scope["method"] not in ("GET", "HEAD", "POST"):
            return 405, "only GET and POST are answered"
        if scope["method"] == "POST":
            if headers.get("content-type", "").partition(";")[0].strip() != "application/json":
                return 415, "send JSON (content-type: application/json)"
            length = headers.get("content-length", "0")
            if not (length.isascii() and length.isdigit()) or int(length[:9]) > MAX_BODY:
                return 413, f"the request is larger than {MAX_BODY} bytes"
        return None


class TooLargeError(Exception):
    """A request body that exceeds the limit."""


def _bounded(receive: Receive) -> Receive:
    """Return the same messages; raise an error once their bodies exceed the limit, whatever the stated length."""
    total = 0

    async def bounded() -> MutableMapping[str, Any]:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > MAX_BODY:
            raise TooLargeError(f"the request is larger than {MAX_BODY} bytes")
        return message

    return bounded


def _name_of(host: str) -> str:
    """Return the name in a Host header without its port."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.rpartition(":")[0] if ":" in host else host
