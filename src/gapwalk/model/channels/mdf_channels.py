"""Channels of an MDF file of a measuring computer (ASAM MDF 3 and 4), read by asammdf."""

from __future__ import annotations

from functools import partial
from typing import Any

from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile


class MdfChannels(ChannelFile):
    """An MDF file; the channels of one group have the time of its master channel."""

    words, endings = "an MDF file of a measuring computer", (".mf4", ".mdf")
    module = "asammdf"
    begins = (b"MDF     ", b"UnFinMF ")

    def open(self, path: str) -> None:
        """See `ChannelFile.open`."""
        import asammdf

        file = self.file = asammdf.MDF(path)
        for number, group in enumerate(file.groups):
            label, count = f"group {number + 1}" if file.groups[1:] else "", int(group.channel_group.cycles_nr)
            for place, each in enumerate(group.channels):
                unit = each.unit or getattr(each.conversion, "unit", "") or ""
                read, is_time = partial(self._samples, number, place), False
                if file.masters_db.get(number) == place:
                    read, is_time = partial(file.get_master, number), unit in ("", "s")
                self.add(read, each.name, "s" if is_time else unit, label, count, time=is_time)

    def _samples(self, group: int, index: int) -> NDArray[Any]:
        return self.file.get(group=group, index=index, samples_only=True)[0]
