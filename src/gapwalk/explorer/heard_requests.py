"""Requests of the page about what is heard: order maps of a run-up, its sound, and measured records to lay over it."""

from __future__ import annotations

import os
from typing import Any
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from gapwalk.attractors.order_tracking import Tracked
from gapwalk.attractors.sound import Sound
from gapwalk.errors import ModelError
from gapwalk.explorer.run_up_view import RunUpView
from gapwalk.explorer.session import Session
from gapwalk.explorer.workspace import RECORD
from gapwalk.files import open_file
from gapwalk.measurement.measured_run_up import is_run_up, read_run_up
from gapwalk.model.measured.measured_table import NamedFile

_HEADS = 20_000  # bytes of a CSV file in which its line of names is
_LISTED = 100  # records
_NAME = 300  # longest text of a request


class HeardRequests:
    """Handlers of these requests."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def routes(self) -> list[Route]:
        """Return their addresses."""
        return [
            Route("/api/heard", self.heard),
            Route("/api/sound", self.sound),
            Route("/api/wav", self.wav),
            Route("/api/records", self.records),
        ]

    async def heard(self, request: Request) -> Response:
        """Return the order maps of a signal of a run-up, with a measured record if one is named."""
        view, signal, name = self._view(request), _text(request, "signal"), _text(request, "record")
        return JSONResponse(await self.session.flows.do(lambda: self._heard(view, signal, name)))

    def _heard(self, view: RunUpView, signal: str, name: str) -> dict[str, Any]:
        record: Tracked | None = None
        if name:
            path = self.session.workspace.path(name, (RECORD,))
            record = read_run_up(path, view.system, signal)
        return view.heard(signal, record, name)

    async def sound(self, request: Request) -> Response:
        """Return the samples of a run-up in the unit of the signal, as little-endian numbers of 32 bits."""
        found = await self._sound(request)
        content = found.values.astype("<f4").tobytes()
        return Response(content, media_type="application/octet-stream", headers={"x-rate": str(found.rate)})

    async def wav(self, request: Request) -> Response:
        """Return the sound of a run-up as a WAV file."""
        found, scale = await self._sound(request), _text(request, "scale")
        try:
            full_scale = float(scale) if scale else None
        except ValueError:
            raise ModelError(f"scale is {scale[:20]!r}; it must be a number, as in 500") from None
        content = found.wav(full_scale)
        result = _text(request, "result") or os.path.splitext(_text(request, "file"))[0]
        name = quote(f"{result}-{found.signal}.wav".replace("'", "-dot").replace("/", "-"), errors="replace")
        return Response(
            content,
            media_type="audio/wav",
            headers={"content-disposition": f"attachment; filename*=utf-8''{name}"},
        )

    async def records(self, request: Request) -> Response:
        """Return the names of the CSV files in the folder that have columns of time and of the speed."""
        study = self.session.exploration(_text(request, "file")).described()
        system = None if study is None else study.system
        names = [] if system is None else [
            name for name in self.session.workspace.records() if is_run_up(self._heads(name), system)
        ]  # fmt: skip
        return JSONResponse({"records": names[:_LISTED]})

    def _heads(self, name: str) -> NamedFile:
        """Return a CSV file with its line of names, and what else stands at its beginning."""
        try:
            with open_file(self.session.workspace.path(name, (RECORD,))) as file:
                content = file.read(_HEADS)
        except (OSError, ValueError):
            content = b""
        return NamedFile(name, content[: content.rfind(b"\n") + 1])

    async def _sound(self, request: Request) -> Sound:
        view, signal = self._view(request), _text(request, "signal")
        return await self.session.flows.do(lambda: view.sound(signal))

    def _view(self, request: Request) -> RunUpView:
        entry = self.session.exploration(_text(request, "file")).entry(_text(request, "result"))
        if not isinstance(entry.answer, RunUpView):
            raise ModelError(f"{entry.title} is no run-up; only a run-up is heard over the speed")
        return entry.answer


def _text(request: Request, name: str) -> str:
    text = request.query_params.get(name, "")
    if len(text) > _NAME:
        raise ModelError(f"{name} is longer than {_NAME} letters")
    return text
