"""Channels of an MDF file of a measuring computer (ASAM MDF 3 and 4), read by asammdf."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from gapwalk.model.channels.channel_file import ChannelFile, ColumnHead


class MdfChannels(ChannelFile):
    """An MDF file; the channels of one group have the time of its master channel."""

    words, endings = "an MDF file of a measuring computer", (".mf4", ".mdf")
    module = "asammdf"
    begins = (b"MDF     ", b"UnFinMF ")

    def __init__(self, path: str) -> None:
        import asammdf

        self._file = asammdf.MDF(path)
        self._places: list[tuple[int, int]] = []
        heads: list[ColumnHead] = []
        several = len(self._file.groups) > 1
        for number, group in enumerate(self._file.groups):
            label, count = f"group {number + 1}" if several else "", int(group.channel_group.cycles_nr)
            master = self._file.masters_db.get(number)
            for place, each in enumerate(group.channels):
                unit = each.unit or getattr(each.conversion, "unit", "") or ""
                is_time = place == master and (not unit or unit == "s")
                heads.append(ColumnHead.channel(each.name, "s" if is_time else unit, label, count, time=is_time))
                self._places.append((number, place))
        self.heads = tuple(heads)

    def read(self, place: int) -> NDArray[Any]:
        """See `ChannelFile.read`."""
        group, index = self._places[place]
        if self._file.masters_db.get(group) == index:
            return self._file.get_master(group)
        return self._file.get(group=group, index=index, samples_only=True)[0]

    def close(self) -> None:
        """See `ChannelFile.close`."""
        self._file.close()
