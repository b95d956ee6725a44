"""Channels of a TDMS file of LabVIEW, read by npTDMS; their times follow from the increments of their waveforms."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile


class TdmsChannels(ChannelFile):
    """A TDMS file; channels of a group with the same increment and length have one time."""

    words, endings, begins = "a TDMS file of LabVIEW", (".tdms",), (b"TDSm",)
    module = "nptdms"

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        import nptdms

        self.file = nptdms.TdmsFile.open(path)
        channels = [(group.name, each, _clock(each)) for group in self.file.groups() for each in group.channels()]
        clocks = {(name, clock) for name, _, clock in channels}
        for name, each, clock in channels:
            rates = sum(group == name for group, _ in clocks)
            label = f"{name} at {clock[0]:g} s" if rates > 1 and clock else name
            kind = np.dtype(each.dtype) if each.dtype is not None else np.dtype("O")
            problem = "" if kind.kind in "fiub" else "holds texts or times of day"
            unit = str(each.properties.get("unit_string", each.properties.get("NI_UnitDescription", "")))
            if clock and not any(head.group == label and head.is_time for head in self.heads):
                self.add(partial(_times, *clock), "time", "s", label, clock[2], time=True)
            self.add(partial(each.__getitem__, slice(None)), each.name, unit, label, len(each), problem)


def _times(step: float, begin: float, count: int) -> NDArray[Any]:
    return begin + step * np.arange(count)


def _clock(channel: Any) -> tuple[float, float, int] | tuple[()]:
    """Return the step of time of a channel, its begin, and its length; empty if the file does not say it."""
    step = float(channel.properties.get("wf_increment", 0.0) or 0.0)
    return (step, float(channel.properties.get("wf_start_offset", 0.0)), len(channel)) if step > 0.0 else ()
