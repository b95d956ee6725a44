"""Pictures of an answer on the page: those of `gapwalk.plot`, in a form that the page and a saved file can hold."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from gapwalk.plot.picture import lay_out, picture_of, png_bytes, sheet_bytes
from gapwalk.plot.style import in_style

_DPI = 110  # of pictures of surfaces, whose facets would be megabytes as vectors


@dataclass(frozen=True)
class AnswerPicture:
    """Picture of a record, which is drawn when it is asked for."""

    text: str  #: What it shows, in words.
    record: Any  #: The record.
    form: Literal["svg", "png"] = "svg"  #: ``svg``, or ``png`` for surfaces.
    options: Mapping[str, Any] = field(default_factory=dict)  #: Options of its drawing.

    def content(self) -> dict[str, str]:
        """Draw it; return its words, its form and its content as a text: that of an SVG, or of a PNG in base64."""
        figure = picture_of(self.record, **self.options)
        if self.form == "svg":
            content = sheet_bytes(figure, "svg").decode()
        else:
            lay_out(figure)
            with in_style():
                content = base64.b64encode(png_bytes(figure, _DPI)).decode()
        return {"text": self.text, "form": self.form, "content": content}
