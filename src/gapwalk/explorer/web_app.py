"""The web application: the page, and the requests that it sends, answered in JSON."""

from __future__ import annotations

import asyncio
import hmac
import json
import os
import re
import secrets
import socket
import webbrowser
from base64 import urlsafe_b64encode
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, MutableMapping
from contextlib import asynccontextmanager, suppress
from functools import partial
from hashlib import blake2b
from importlib.resources import files
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import quote

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.cache_folder import trusted
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.explorer.answer_view import AnswerView, drawn_on_paper
from gapwalk.explorer.diagram_lines import MEASURE, quantity
from gapwalk.explorer.engine import Engine
from gapwalk.explorer.model_editor import about, checks, edit
from gapwalk.explorer.motion_panels import (
    GradientWork,
    Quantities,
    SupersededError,
    check_signal,
    curve_of,
    details_of,
    panels_of,
)
from gapwalk.explorer.opened_file import Exploration
from gapwalk.explorer.page_requests import Place
from gapwalk.explorer.progress_stream import Events
from gapwalk.explorer.request_tasks import orbit_at
from gapwalk.explorer.saved_page import HeardRequests
from gapwalk.explorer.script import script_of
from gapwalk.explorer.server_state import Session
from gapwalk.explorer.what_next import next_of
from gapwalk.explorer.workspace_folder import Workspace, model_file
from gapwalk.meanings import page_colors
from gapwalk.studies.export import table_of

# Checks of every request: only pages of this server may send requests, and only small ones.

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


_PAGE = files("gapwalk.explorer") / "page"
_NAME = 200  # longest name of a quantity in a request


def application(
    session: Session, token: str = "", *, once: str = "", is_local: bool = True
) -> Callable[..., Awaitable[None]]:
    """Return the guarded application of a session; `token`, `once` and `is_local` are those of `Guard`."""
    api = _Api(session)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        session.close()

    routes = [
        Route("/", api.page),
        Route("/plotly.js", api.plotly),
        Route("/api/files", api.files),
        Route("/api/about", api.about),
        Route("/api/curve", api.curve),
        Route("/api/motion", api.motion),
        Route("/api/details", api.details),
        Route("/api/answer", api.answer),
        Route("/api/picture", api.picture),
        Route("/api/gradient", api.gradient),
        Route("/api/next", api.next),
        Route("/api/events", api.events),
        Route("/api/export/{what}", api.export),
        Route("/api/act", api.act, methods=["POST"]),
        Route("/api/job/{word}", api.job, methods=["POST"]),
        Route("/api/result/{word}", api.result, methods=["POST"]),
        Route("/api/edit/{word}", api.edit, methods=["POST"]),
        *HeardRequests(session).routes(),
        Route("/colours.css", _colours),
        Mount("/static", StaticFiles(directory=str(_PAGE))),
    ]
    errors = {TooLargeError: 413, SupersededError: 409, GapwalkError: 400}
    handlers = {kind: partial(_sentence, status=status) for kind, status in errors.items()}
    app = Starlette(routes=routes, lifespan=lifespan, exception_handlers=handlers)
    return Guard(app, token, once=once, is_local=is_local)


async def _colours(_: Request) -> Response:
    """Return what the colours of lines, symbols and areas are, as a style sheet."""
    return Response(page_colors(), media_type="text/css")


async def _sentence(_: Request, error: Exception, *, status: int) -> Response:
    """Answer an error with its message."""
    return _Json({"error": str(error)}, status)


class _Json(JSONResponse):
    """JSON in ASCII, so that any file name can be sent, even one with lone surrogates."""

    def render(self, content: Any) -> bytes:
        return self.line(content)

    @staticmethod
    def line(content: Any) -> bytes:
        """Return content as one line."""
        return json.dumps(content, allow_nan=False, separators=(",", ":")).encode("ascii") + b"\n"


class _Stream(StreamingResponse):
    """The stream of events for one page; it gives its place back however it ends."""

    def __init__(self, events: Events, page: asyncio.Event) -> None:
        super().__init__(events.listen(page), media_type="text/event-stream", headers={"cache-control": "no-store"})
        self._leave = lambda: events.leave(page)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._leave()


class _Api:
    """Handlers of the requests of the page."""

    def __init__(self, session: Session) -> None:
        self.session = session

    async def page(self, _: Request) -> Response:
        """Return the page."""
        return FileResponse(str(_PAGE / "index.html"), headers={"cache-control": "no-cache"})

    async def plotly(self, _: Request) -> Response:
        """Return Plotly's JavaScript, from its Python package."""
        path = Path(str(files("plotly") / "package_data" / "plotly.min.js"))
        return FileResponse(path, media_type="text/javascript", headers={"cache-control": "max-age=86400"})

    async def files(self, _: Request) -> Response:
        """Return the files of the workspace, and the one to show first."""
        workspace = self.session.workspace
        return _Json({"folder": workspace.root.name, "files": workspace.files(), "first": self.session.first})

    async def about(self, request: Request) -> Response:
        """Return the description of a file."""
        name = _text(request, "file")
        return _Json(await asyncio.to_thread(about, self.session, name))

    async def curve(self, request: Request) -> Response:
        """Return a branch, or a settled motion, as arrays."""
        exploration = self.session.exploration(_text(request, "file"))
        entry = exploration.entry(_text(request, "result"))
        branch, first = _count(request, "branch"), _count(request, "from")
        x, y = _text(request, "x"), _text(request, "y")
        with exploration.guard:
            settled, lines = entry.settled(), entry.lines()
        if settled is not None:
            if settled.orbit is None:
                return _Json({"settled": None})
            orbit = settled.orbit
            place = await self.session.flows.do(lambda: [quantity(orbit, x), quantity(orbit, y)])
            return _Json({"settled": place})
        if branch >= len(lines):
            return _Json({"gone": True})  # the two directions of a walk have become one branch
        line = lines[branch]
        wanted = Quantities(line, (x, y), first)
        await self.session.flows.do_behind(wanted.parts())
        found = await asyncio.to_thread(curve_of, wanted)
        return _Json({**found, "name": line.name, "period": line.period})

    async def motion(self, request: Request) -> Response:
        """Return the motion at a place; of several requests of a tab only the last one is answered."""
        return await self._of_motion(request, panels_of, "")

    async def details(self, request: Request) -> Response:
        """Return spectrum and section of the motion at a place; only the last request of a tab is answered."""
        return await self._of_motion(request, details_of, "/details")

    async def answer(self, request: Request) -> Response:
        """Return the sentences and curves of a result, if it is an answer."""
        return _Json(await self.session.flows.do(self._answer_of(request).content))

    async def picture(self, request: Request) -> Response:
        """Return a picture of an answer by its number; a click on a point waits for one picture at most."""
        wholes, number = self._answer_of(request).picture.wholes, _count(request, "number")
        if number >= len(wholes):
            raise ModelError(
                f"the answer has {len(wholes)} pictures, but none with the number {number}; reload the page"
            )
        found: list[dict[str, str]] = []
        await self.session.flows.do_behind([lambda: found.append(drawn_on_paper(wholes[number]))])
        return _Json(found[0])

    def _answer_of(self, request: Request) -> AnswerView:
        entry = self.session.exploration(_text(request, "file")).entry(_text(request, "result"))
        view = entry.answer
        if view is None:
            raise ModelError(f"{entry.title} is no answer; its branches are in the diagram")
        return view

    async def gradient(self, request: Request) -> Response:
        """Return the gradient of a special point; of several requests of a tab only the last one is answered."""
        exploration, place, _ = self._asked(request)
        _, special = exploration.special(place)
        work = GradientWork(special)
        await self.session.flows.do_last_in_parts(f"{_text(request, 'tab')}/gradient", work.parts())
        return _Json(work.content())

    async def next(self, request: Request) -> Response:
        """Return the meaning of a point for the machine, and the next steps from there."""
        exploration, place, _ = self._asked(request)
        tab = f"{_text(request, 'tab')}/next"
        return _Json(await self.session.flows.do_last(tab, lambda: next_of(exploration, place)))

    async def _of_motion(self, request: Request, compute: Callable[..., dict[str, Any]], what: str) -> Response:
        exploration, place, signal = self._asked(request)
        motion = exploration.motion(place)
        name = check_signal(motion.system, signal)
        found = await self.session.flows.do_last(_text(request, "tab") + what, lambda: compute(motion, name))
        return _Json(found)

    async def events(self, _: Request) -> Response:
        """Return a stream of changes."""
        page = self.session.events.join()
        return _Stream(self.session.events, page)

    async def act(self, request: Request) -> Response:
        """Start a job."""
        body = await _body(request)
        name = str(body.pop("file", ""))
        entry = await asyncio.to_thread(self.session.act, name, body)
        return _Json({"key": entry.key, "title": entry.title})

    async def job(self, request: Request) -> Response:
        """Stop, pause, continue or resume a job."""
        body, word = await _body(request), request.path_params["word"]
        name, key = str(body.get("file", "")), str(body.get("result", ""))
        entry = self.session.exploration(name).entry(key)
        acts: dict[str, Callable[[], None]] = {
            "stop": lambda: self.session.jobs.stop(entry),
            "pause": lambda: self.session.jobs.pause(entry),
            "continue": lambda: self.session.jobs.resume(entry),
            "resume": lambda: self.session.resume(name, key),
        }
        if word not in acts:
            raise ModelError(f"{word[:40]!r} is not an action on a job; the actions are {', '.join(acts)}")
        acts[word]()
        return _Json({"state": entry.state.value})

    async def result(self, request: Request) -> Response:
        """Change the look of a result, or remove those that were deleted."""
        body, word = await _body(request), request.path_params["word"]
        name, key = str(body.pop("file", "")), str(body.pop("result", ""))
        if word == "change":
            return _Json({"before": await asyncio.to_thread(self.session.change, name, key, body)})
        if word == "clean":
            return _Json({"removed": await asyncio.to_thread(self.session.clean, name)})
        raise ModelError(f"{word[:40]!r} is not an action on a result; the actions are change and clean")

    async def edit(self, request: Request) -> Response:
        """Answer the model editor; a check is a stream of lines of JSON, because the response of the text grows."""
        body, word = await _body(request), request.path_params["word"]
        if word != "check":
            return _Json(await edit(self.session, word, body))

        async def lines() -> AsyncIterator[bytes]:
            async for news in checks(self.session, body):
                yield _Json.line(news)

        return StreamingResponse(lines(), media_type="application/x-ndjson", headers={"cache-control": "no-store"})

    async def export(self, request: Request) -> Response:
        """Return a table, a script, a model file or the result file."""
        exploration, what = self.session.exploration(_text(request, "file")), request.path_params["what"]
        entry = exploration.entry(_text(request, "result"))
        stem = entry.key or exploration.file.stem
        if what == "script":
            return _file(script_of(exploration, entry), f"{stem}.py", "text/x-python")
        if what == "model":
            return await self._model(request, stem)
        if entry.result is None:
            raise ModelError(f"{entry.title} is {entry.state}; wait for its end, or stop it")
        result = entry.result
        if what in ("table", "bands"):
            name = what if what in result.tables() else next(iter(result.tables()))
            text = await self.session.flows.do(lambda: table_of(result, name))
            return _file(text, f"{stem}-bands.csv" if name == "bands" else f"{stem}.csv", "text/csv")
        if what == "result":
            return FileResponse(entry.path, filename=entry.path.name, media_type="application/vnd.sqlite3")
        raise ModelError(f"there is no {what[:40]!r} to export; write table, bands, script, model or result")

    async def _model(self, request: Request, stem: str) -> Response:
        exploration, place, _ = self._asked(request)
        parameter, to = _text(request, "parameter"), _number(request, "to")
        orbit, study = orbit_at(place, exploration), exploration.origin(place)
        measure = _text(request, "y").removeprefix(MEASURE)
        measure = (
            measure
            if "." in measure and measure not in orbit.system.parameters
            else shown_measure(orbit.system, study.options)
        )
        text = model_file(
            study.text, str(exploration.file), str(exploration.workspace.root), orbit, parameter, to, measure
        )
        return _file(text, f"{stem}.toml", "application/toml")

    def _asked(self, request: Request) -> tuple[Any, Place, str]:
        """Return exploration, place and signal of a request."""
        exploration = self.session.exploration(_text(request, "file"))
        entry = exploration.entry(_text(request, "result"))
        numbers = {
            name: int(value)
            for name in ("branch", "point", "special")
            if _is_count(value := request.query_params.get(name, ""))
        }
        return exploration, Place(result=entry.key, **numbers), _text(request, "signal")


def _text(request: Request, name: str) -> str:
    text = request.query_params.get(name, "")
    if len(text) > _NAME:
        raise ModelError(f"{name} is longer than {_NAME} letters")
    return text


def _count(request: Request, name: str) -> int:
    text = request.query_params.get(name, "") or "0"
    if not _is_count(text):
        raise ModelError(f"{name} is {text[:20]!r}; it must be a number from 0")
    return int(text)


def _is_count(text: str) -> bool:
    """Return True if a text is a number from 0; ``isdigit`` accepts others too, such as ²."""
    return text.isascii() and text.isdigit() and len(text) < 10


def _number(request: Request, name: str) -> float:
    try:
        return float(request.query_params.get(name, ""))
    except ValueError:
        raise ModelError(f"{name} must be a number, as in 0.5") from None


async def _body(request: Request) -> dict[str, Any]:
    try:
        body = json.loads(await request.body())
    except (ValueError, RecursionError):
        raise ModelError("the request is not JSON") from None
    if not isinstance(body, dict):
        raise ModelError("the request must be a JSON object")
    return body


def _file(text: str, name: str, kind: str) -> Response:
    text = text.encode("utf-8", "replace").decode("utf-8")
    return PlainTextResponse(
        text,
        media_type=kind,
        headers={"content-disposition": f"attachment; filename*=utf-8''{quote(name, errors='replace')}"},
    )


# Server of the explorer: on the loopback address, or on another one; each request needs the token that is printed.
#
# Method: docs/numerics/explorer.md

_GRACE = 1  # seconds that open connections have when the server ends


def serve(
    file: Path | None, host: str = "127.0.0.1", port: int = 0, *, browser: bool = True, engine: Engine | None = None
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

        session.live.warm_behind()  # the first page asks for a quick response
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
