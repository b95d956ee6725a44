"""How large a picture is where it will be seen, and its letters with it: in a column, on a page, on a slide."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from typing import Any, Literal, TypeVar

from gapwalk.errors import ModelError

Drawer = TypeVar("Drawer", bound=Callable[..., Any])

SizeName = Literal["screen", "column", "page", "slide"]
"""What a size can be called."""


@dataclass(frozen=True, slots=True)
class Size:
    """Where a picture goes.

    Parameters
    ----------
    width
        In mm; None: as wide as the picture itself wants.
    scale
        Of letters, lines and symbols; 1 is 9.5 points for the numbers along the axes.
    tall
        By how much it is taller, for its width, than on a screen.
    """

    width: float | None = None
    scale: float = 1.0
    tall: float = 1.0


SIZES: dict[str, Size] = {
    "screen": Size(),
    "column": Size(85.0, 8.0 / 9.5, 1.5),
    "page": Size(175.0, 8.5 / 9.5),
    "slide": Size(250.0, 16.0 / 9.5, 0.95),
}
"""A column of a journal, its whole page, and a slide of 13.3 x 7.5 inches below its title."""

CARD = Size(115.0, 8.0 / 9.5, 1.05)
"""The small picture on the card of a notebook."""

_INCH = 25.4  # mm
_ROOMY = 160.0  # mm, at the letters of a screen, from which labels need not be broken
_now: ContextVar[Size] = ContextVar("gapwalk_size", default=SIZES["screen"])


@contextmanager
def sized(size: SizeName | None) -> Iterator[None]:
    """Draw all pictures at a size, as in ``with gw.plot.sized("column"): branch.plot()``.

    Parameters
    ----------
    size
        ``"column"`` (85 mm wide, numbers of 8 points), ``"page"`` (175 mm, 8.5 points), ``"slide"`` (250 mm, 16 points)
        or ``"screen"``. None changes nothing.

    Raises
    ------
    ModelError
        For any other size.
    """
    if size is not None and size not in SIZES:
        raise ModelError(f'there is no size {size!r}; there are {", ".join(SIZES)}: write size="column"')
    with drawn_at(_now.get() if size is None else SIZES[size]):
        yield


@contextmanager
def drawn_at(size: Size) -> Iterator[None]:
    """The same for any size."""
    token = _now.set(size)
    try:
        yield
    finally:
        _now.reset(token)


def takes_size(draw: Drawer) -> Drawer:
    """The same function, which takes `size` as well; see `sized`."""

    @wraps(draw)
    def drawn(*arguments: Any, size: SizeName | None = None, **options: Any) -> Any:
        with sized(size):
            return draw(*arguments, **options)

    return drawn  # pyright: ignore[reportReturnType]  # it takes one keyword more


def points(length: float) -> float:
    """A length in points at the present size: of letters, lines or symbols."""
    return length * _now.get().scale


def broken(label: str) -> str:
    """The label of an upright axis, in two lines where a sheet has little room: parted at a comma or bracket."""
    size = _now.get()
    if size.width is None or size.width / size.scale > _ROOMY:
        return label
    places = [at for mark in (" (", ", ") if (at := label.find(mark, 8)) > 0]
    return label if not places else f"{label[: min(places)].rstrip()}\n{label[min(places) :].lstrip(', ')}"


def sheet_size(width: float, height: float) -> tuple[float, float]:
    """Width and height of a sheet in inches at the present size, of those that a screen would have."""
    size = _now.get()
    if size.width is None:
        return width * size.scale, height * size.scale
    wide = size.width / _INCH
    return wide, height / width * wide * size.tall
