"""Checks of every request: only pages of this server may send requests, and only small ones."""

from __future__ import annotations

import hmac
import os
import re
import secrets
from base64 import urlsafe_b64encode
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from hashlib import blake2b
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Send

from gapwalk.flow.flow_cache import trusted

MAX_BODY = 64_000
"""Largest size of a request, in bytes."""

_SECRET = 32  # bytes of the file from which tokens are derived
_HOST = re.compile(r"(?:\[(?P<six>[0-9a-f:.]+)\]|(?P<name>[^\s:/@\[\]]+))(?::\d{0,5})?")  # as RFC 9110 writes it
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
    if host.lower().removesuffix(".") == "localhost":
        return True
    try:
        return ip_address(host.removesuffix(".")).is_loopback
    except ValueError:
        return False


def is_loopback_header(header: str) -> bool:
    """Return True if a Host header names the loopback of this machine, with or without a port."""
    found = _HOST.fullmatch(header.lower())
    if found is None or not (six := found["six"]):
        return found is not None and is_loopback(found["name"])
    return ":" in six and is_loopback(six)


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(24)


def kept_token(root: Path, port: int) -> str:
    """Return the token of a workspace at a port: the same at each start, so that an open page goes on after a restart.

    It is derived from random bytes in a file that only this user can read. If no folder can be trusted, it is random.
    """
    folder = trusted(None, "explorer")
    if folder is None:
        return new_token()
    file = folder / "secret"
    try:
        secret = file.read_bytes() if file.stat().st_mode & 0o077 == 0 else b""
    except OSError:
        secret = b""
    if len(secret) != _SECRET:
        secret, new = secrets.token_bytes(_SECRET), folder / f"secret-{secrets.token_hex(4)}"
        try:
            with open(os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "wb") as writing:
                writing.write(secret)
            os.replace(new, file)
        except OSError:  # the disk is full, or may not be written
            return new_token()
    digest = blake2b(f"{root}:{port}".encode("utf-8", "surrogateescape"), key=secret, digest_size=24).digest()
    return urlsafe_b64encode(digest).decode()


class Guard:
    """Application that refuses requests which a page of this server would not send.

    - Each must carry the token, so that no other user of the machine or of the network is answered.
    - On the loopback address, the name of the host must be that of the loopback, so that no foreign name that points
      here is served (DNS rebinding). On others the names of the machine are not known; the token alone decides.
    - The origin, if the browser sends one, must be this server itself.
    - Requests that change something must be JSON: a form of a foreign page cannot send it without a preflight request.
    - Bodies are small.
    """

    def __init__(
        self, app: Callable[..., Awaitable[None]], token: str = "", *, once: str = "", is_local: bool = True
    ) -> None:
        self._app, self._token, self._once, self._is_local = app, token, once, is_local
        # browsers send the cookies of an address to all of its ports: each explorer has a name of its own
        self._cookie = f"gapwalk-{blake2b(token.encode(), digest_size=4).hexdigest()}"

    async def __call__(self, scope: MutableMapping[str, Any], receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return
        request = HTTPConnection(scope)
        problem, brings_token = self._problem(scope, request.headers), False
        if not problem and self._token:
            given = request.query_params.get("token", "")
            brings_token = _equal(given, self._token) or (bool(self._once) and _equal(given, self._once))
            if brings_token and not _equal(given, self._token):
                self._once = ""
            if not brings_token and not _equal(request.cookies.get(self._cookie, ""), self._token):
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
                    headers.append("set-cookie", f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/")
            await send(message)

        await self._app(scope, _bounded(receive), send_guarded)

    def _problem(self, scope: Mapping[str, Any], headers: Mapping[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "").lower()
        if self._is_local and not is_loopback_header(host):
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
    """Return the same messages; raise an error once their bodies exceed the limit, whatever length is stated."""
    total = 0

    async def bounded() -> MutableMapping[str, Any]:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > MAX_BODY:
            raise TooLargeError(f"the request is larger than {MAX_BODY} bytes")
        return message

    return bounded


def _equal(given: str, token: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "surrogatepass"), token.encode())
