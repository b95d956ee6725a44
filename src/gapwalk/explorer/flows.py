"""The one thread of the server that computes; of several clicks only the last one is answered."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TypeVar

import numpy as np

from gapwalk.errors import GapwalkError
from gapwalk.flow.motion import integrate
from gapwalk.model.system import System

T = TypeVar("T")

_TABS = 1000  # whose last click is remembered


class SupersededError(Exception):
    """A newer click of the same tab has made an answer useless."""


def _warm(system: System) -> None:
    from scipy import signal  # the windows of spectra: a second

    del signal
    with suppress(GapwalkError):
        integrate(system, np.zeros(2 * system.size))


class Flows:
    """Does what needs a compiled flow, one call after the other: side by side none would be done sooner."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="gapwalk-flows")
        self._last: dict[str, int] = {}
        self._guard = threading.Lock()
        self._behind = asyncio.Lock()

    def warm(self, system: System) -> None:
        """Load and compile what the first click on an orbit of a system would have to wait for."""
        self._thread.submit(_warm, system)

    async def do(self, call: Callable[[], T]) -> T:
        """What a call returns."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, call)

    async def do_behind(self, parts: Iterable[Callable[[], object]]) -> None:
        """Do what can wait, part by part; a click that comes in between waits for one part at most."""
        async with self._behind:
            for part in parts:
                await self.do(part)

    async def do_last(self, tab: str, parts: list[Callable[[], T]]) -> list[T]:
        """What some calls return, one after the other, unless the same tab asks for something newer in between.

        Raises
        ------
        SupersededError
            If it did.
        """
        with self._guard:
            number = self._last.get(tab, 0) + 1
            if len(self._last) > _TABS:
                self._last.clear()
            self._last[tab] = number
        found = []
        for part in parts:
            found.append(await self.do(lambda part=part: self._unless_old(tab, number, part)))
        return found

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _unless_old(self, tab: str, number: int, part: Callable[[], T]) -> T:
        if self._last.get(tab) != number:
            raise SupersededError
        return part()
