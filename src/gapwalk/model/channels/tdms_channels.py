"""Channels of a TDMS file of LabVIEW, read by npTDMS; their times follow from the increments of their waveforms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile, ColumnHead


class TdmsChannels(ChannelFile):
    """A TDMS file; channels of a group with the same increment and length have one time."""

    words, endings, begins = "a TDMS file of LabVIEW", (".tdms",), (b"TDSm",)
    module = "nptdms"

    def __init__(self, path: str) -> None:
        import nptdms

        self._file: Any = nptdms.TdmsFile.open(path)
        self._places: list[Any] = []
        heads: list[ColumnHead] = []
        channels = [(group.name, each) for group in self._file.groups() for each in group.channels()]
        clocks = {(name, _clock(each)) for name, each in channels}
        for name, each in channels:
            clock = _clock(each)
            rates = sum(group == name for group, _ in clocks)
            label = f"{name} at {clock[0]:g} s" if rates > 1 and clock else name
            kind = np.dtype(each.dtype) if each.dtype is not None else np.dtype("O")
            problem = "" if kind.kind in "fiub" else "holds texts or times of day"
            unit = str(each.properties.get("unit_string", each.properties.get("NI_UnitDescription", "")))
            if clock and not any(head.group == label and head.is_time for head in heads):
                heads.append(ColumnHead.channel("time", "s", label, clock[2], time=True))
                self._places.append(clock)
            heads.append(ColumnHead.channel(each.name, unit, label, len(each), problem))
            self._places.append(each)
        self.heads = tuple(heads)

    def read(self, place: int) -> NDArray[Any]:
        """See `ChannelFile.read`."""
        held = self._places[place]
        if isinstance(held, tuple):
            step, begin, count = held
            return begin + step * np.arange(count)
        return np.asarray(held[:])

    def close(self) -> None:
        """See `ChannelFile.close`."""
        self._file.close()


def _clock(channel: Any) -> tuple[float, float, int] | tuple[()]:
    """Return the step of time of a channel, its begin, and its length; empty if the file does not say it."""
    step = float(channel.properties.get("wf_increment", 0.0) or 0.0)
    return (step, float(channel.properties.get("wf_start_offset", 0.0)), len(channel)) if step > 0.0 else ()
