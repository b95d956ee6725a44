"""Requests of the model editor on the page, by their word; `gapwalk.explorer.web_app` answers them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

from gapwalk.errors import ModelError
from gapwalk.explorer.model_editor import checked_text, save_text, start_text, starts, text_of
from gapwalk.explorer.session import Session

WORDS = ("starts", "start", "open", "save")


async def edit(session: Session, word: str, body: dict[str, Any]) -> dict[str, Any]:
    """Answer a request: what to begin with, the text of a beginning or of a file, or a text to save."""
    workspace, name = session.workspace, str(body.get("file", ""))
    if word == "starts":
        session.live.warm_behind()
        return {"starts": await asyncio.to_thread(starts)}
    if word == "start":
        return {"text": start_text(str(body.get("start", "")))}
    if word == "open":
        session.live.warm_behind()
        return await asyncio.to_thread(text_of, workspace, name)
    if word == "save":
        text, stamp = str(body.get("text", "")), str(body.get("stamp", ""))
        found = await asyncio.to_thread(save_text, workspace, name, text, stamp)
        session.events.changed()
        return found
    raise ModelError(f"{word[:40]!r} is nothing to do with a text; there are {', '.join(WORDS)} and check")


async def checks(session: Session, body: dict[str, Any]) -> AsyncIterator[dict[str, Any]]:
    """Yield what `checked_text` finds, and then, of a text without problems, its response as it grows."""
    root = str(session.workspace.root)
    name = str(session.workspace.root / (str(body.get("file", "")) or "model.toml"))
    text = str(body.get("text", ""))
    found = await asyncio.to_thread(checked_text, text, name, root)
    yield found
    if not found["problems"]:
        async for news in session.live.of(text, name, root):
            yield news
