"""Tells pages that something has changed: server-sent events, four a second at most."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.explorer.news import SECONDS

_PAGES = 16  # that listen at once
_LOOK = 1.0  # seconds between two looks at the files, which others change
_ALIVE = 15.0  # seconds after which a word is sent in any case, so that a page that has gone is noticed


class Events:
    """The pages that listen.

    Parameters
    ----------
    state
        What to tell them: called when something has changed.
    """

    def __init__(self, state: Callable[[], Any]) -> None:
        self._state = state
        self._loop: asyncio.AbstractEventLoop | None = None
        self._pages: set[asyncio.Event] = set()
        self.closing = False

    def changed(self) -> None:
        """Say, from any thread, that something has changed."""
        loop = self._loop
        if loop is not None and not loop.is_closed():
            loop.call_soon_threadsafe(self._wake)

    def join(self) -> asyncio.Event:
        """A place for one page more, taken at once: of several pages that come together, none too many gets one.

        Raises
        ------
        ModelError
            If there is none.
        """
        if len(self._pages) >= _PAGES:
            raise ModelError(f"{_PAGES} pages are open on this server; close some of them")
        self._loop = asyncio.get_running_loop()
        page = asyncio.Event()
        self._pages.add(page)
        return page

    def leave(self, page: asyncio.Event) -> None:
        """Give its place back."""
        self._pages.discard(page)

    async def listen(self, page: asyncio.Event) -> AsyncIterator[str]:
        """The events for one page, until it goes."""
        told, told_at = None, 0.0
        while not self.closing:
            state = json.dumps(await asyncio.to_thread(self._state))
            if state != told:
                yield f"data: {state}\n\n"
                told, told_at = state, time.monotonic()
            elif time.monotonic() - told_at > _ALIVE:  # a word in between shows whether the page is still there
                yield ": alive\n\n"
                told_at = time.monotonic()
            await asyncio.sleep(SECONDS)
            with suppress(TimeoutError):
                await asyncio.wait_for(page.wait(), _LOOK)
            page.clear()

    def close(self) -> None:
        """Let all pages go."""
        self.closing = True
        self.changed()

    def _wake(self) -> None:
        for news in self._pages:
            news.set()
