"""The web application: the page, and the requests that it sends, answered in JSON."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.errors import GapwalkError, ModelError
from gapwalk.explorer.answer_view import AnswerView
from gapwalk.explorer.axis_quantities import MEASURE, quantity
from gapwalk.explorer.curve_data import Quantities, curve_of
from gapwalk.explorer.edit_requests import checks, edit
from gapwalk.explorer.gradient_panel import GradientWork
from gapwalk.explorer.heard_requests import HeardRequests
from gapwalk.explorer.motion_panels import SupersededError, check_signal, details_of, panels_of
from gapwalk.explorer.next_view import next_of
from gapwalk.explorer.plan import Place, orbit_at
from gapwalk.explorer.progress_stream import Events
from gapwalk.explorer.request_guard import Guard, TooLargeError
from gapwalk.explorer.script import script_of
from gapwalk.explorer.session import Session
from gapwalk.explorer.workspace import model_file
from gapwalk.studies.formats.csv_format import table_of

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
        Mount("/static", StaticFiles(directory=str(_PAGE))),
    ]
    errors = {TooLargeError: 413, SupersededError: 409, GapwalkError: 400}
    handlers = {kind: partial(_sentence, status=status) for kind, status in errors.items()}
    app = Starlette(routes=routes, lifespan=lifespan, exception_handlers=handlers)
    return Guard(app, token, once=once, is_local=is_local)


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
        return _Json(await asyncio.to_thread(self.session.about, name))

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
        pictures, number = self._answer_of(request).pictures(), _count(request, "number")
        if number >= len(pictures):
            raise ModelError(f"the answer has {len(pictures)} pictures, none of the number {number}; reload the page")
        found: list[dict[str, str]] = []
        await self.session.flows.do_behind([lambda: found.append(pictures[number].content())])
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
        raise ModelError(f"{word[:40]!r} is nothing to do with a result; there are change and clean")

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
        if what == "table":
            text = await self.session.flows.do(lambda: table_of(result, next(iter(result.tables()))))
            return _file(text, f"{stem}.csv", "text/csv")
        if what == "result":
            return FileResponse(entry.path, filename=entry.path.name, media_type="application/vnd.sqlite3")
        raise ModelError(f"there is no {what[:40]!r} to export; there are table, script, model and result")

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
        raise ModelError("the request is no JSON") from None
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
