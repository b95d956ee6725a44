"""Tells pages that something has changed: server-sent events, four a second at most."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

from gapwalk.explorer.news import SECONDS

_PAGES = 16  # that listen at once
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

    def has_room(self) -> bool:
        """Whether one more page may listen."""
        return len(self._pages) < _PAGES

    async def listen(self) -> AsyncIterator[str]:
        """The events for one page, until it goes."""
        self._loop = asyncio.get_running_loop()
        news = asyncio.Event()
        self._pages.add(news)
        try:
            told = None
            while not self.closing:
                state = json.dumps(self._state())
                # a word in between shows whether the page is still there
                yield f"data: {state}\n\n" if state != told else ": alive\n\n"
                told = state
                await asyncio.sleep(SECONDS)
                try:
                    await asyncio.wait_for(news.wait(), _ALIVE)
                except TimeoutError:
                    continue
                news.clear()
        finally:
            self._pages.discard(news)

    def close(self) -> None:
        """Let all pages go."""
        self.closing = True
        self.changed()

    def _wake(self) -> None:
        for news in self._pages:
            news.set()
