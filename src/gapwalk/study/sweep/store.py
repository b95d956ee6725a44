"""Sweeps in files: stretch by stretch while they are driven, and read back."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from types import TracebackType
from typing import Any

import numpy as np

from gapwalk.errors import ModelError, StoreError
from gapwalk.study.store.arrays import pack_arrays, unpack_arrays
from gapwalk.study.store.chunk_store import open_chunks, read_chunks
from gapwalk.study.store.plain import plain_system, system_of
from gapwalk.study.store.trust import undamaged
from gapwalk.study.sweep.driver import Driver
from gapwalk.study.sweep.options import SweepOptions
from gapwalk.study.sweep.record import BLOCK, Sweep, stretches_of
from gapwalk.study.sweep.stretch import Stretch
from gapwalk.study.sweep.transient import Patience

_KIND = "sweep"


class SweepStore:
    """The file of a sweep that is being driven.

    Parameters
    ----------
    path
        The file. If it holds a part of the same sweep, that is gone on with.
    driver
        What drives the sweep.

    Raises
    ------
    StoreError
        If the file is of another sweep, or of another kind, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], driver: Driver) -> None:
        self._count = stretches_of(driver.options.steps)
        self._store = open_chunks(path, plain_sweep(driver))

    def known(self) -> Iterator[Stretch]:
        """The stretches that are in the file, one by one; a StoreError if it is damaged."""
        with undamaged(self._store):
            yield from unpacked(self._store.known(), self._count)

    def add(self, stretch: Stretch) -> None:
        """Write a stretch; a StoreError if that cannot be done."""
        self._store.add(stretch.lane * self._count + stretch.number, pack(stretch))

    def __enter__(self) -> SweepStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._store.close()


def load_sweep(path: str | os.PathLike[str]) -> Sweep:
    """Load a sweep from its file; it may still be driven, or may have been killed.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    StoreError
        If there is no such file, it holds no sweep, or it is damaged.
    """
    about, chunks = read_chunks(path)
    if about.get("kind") != _KIND:
        raise StoreError(
            f"{os.fspath(path)} holds no sweep, but the results of a job of the kind {about.get('kind')!r}"
        )
    with undamaged(path):
        driver = driver_of(about)
        driver.take(unpacked(chunks.items(), stretches_of(driver.options.steps)))
        return driver.sweep()


def plain_sweep(driver: Driver) -> dict[str, Any]:
    """What a sweep is to do, in plain JSON values; the number of workers changes nothing of it."""
    options = {name: value for name, value in asdict(driver.options).items() if name != "workers"}
    return {
        "kind": _KIND,
        "system": plain_system(driver.system.at({driver.parameter: float(driver.values[0])})),
        "parameter": driver.parameter,
        "to": [float(driver.values[0]), float(driver.values[-1])],
        "options": options,
        "block": BLOCK,
    }


def driver_of(about: dict[str, Any]) -> Driver:
    """The driver of a sweep from these values; any of LookupError, TypeError and ValueError if it is none."""
    options = dict(about["options"])
    starts = options["starts"]
    options["starts"] = starts if isinstance(starts, int) else tuple(tuple(map(float, start)) for start in starts)
    options["patience"] = Patience(**options["patience"])
    if about["block"] != BLOCK:
        raise ModelError(f"its stretches have {about['block']} values, and {BLOCK} are expected")
    low, high = about["to"]
    return Driver(system_of(about["system"]), str(about["parameter"]), (low, high), SweepOptions(**options))


def pack(stretch: Stretch) -> bytes:
    """The bytes of a stretch; its numbers are kept bit for bit."""
    return pack_arrays(
        {
            "place": np.array([stretch.lane, stretch.number]),
            "sections": stretch.sections,
            "transients": stretch.transients,
            "settled": stretch.settled,
            "regimes": np.array(stretch.regimes, dtype=str),
            "note": np.array(stretch.note),
        }
    )


def unpack(data: bytes) -> Stretch:
    """The stretch of these bytes; any of LookupError, TypeError and ValueError if they are none."""
    parts = unpack_arrays(data)
    lane, number = parts["place"].tolist()
    regimes = tuple(parts["regimes"].tolist())
    return Stretch(lane, number, parts["sections"], parts["transients"], parts["settled"], regimes, str(parts["note"]))


def unpacked(chunks: Iterable[tuple[int, bytes]], count: int) -> Iterator[Stretch]:
    """The stretches of a file from their bytes, by their places; errors as `unpack`."""
    for place, data in chunks:
        stretch = unpack(data)
        if stretch.lane * count + stretch.number != place:
            raise ValueError("a stretch stands in the place of another")
        yield stretch
