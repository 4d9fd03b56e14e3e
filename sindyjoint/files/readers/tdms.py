"""LabVIEW's TDMS by npTDMS."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.readers.table import Table, foreign, missing_extra, short_names


def read_tdms(path: Path, data: bytes) -> Table:
    """Return the channels of a TDMS file, called ``group/channel``, or ``channel`` where that is unique.

    Where the channels carry LabVIEW's sampling interval, ``time`` is made from it.

    Raises
    ------
    InputError
        For bytes that are no TDMS file.
    MissingExtraError
        Without npTDMS.
    """
    try:
        import nptdms
    except ImportError as error:
        raise missing_extra(path, "npTDMS", error) from error
    names, columns, intervals = [], [], []
    with foreign(path, "TDMS"):
        file = nptdms.TdmsFile.read(io.BytesIO(data))
        # npTDMS makes do with what is there of a file whose writing was cut short.
        if file.file_status.incomplete_final_segment:
            raise InputError(f"{path}: its last segment is incomplete; the file is truncated")
        for group in file.groups():
            for channel in group.channels():
                names.append(f"{group.name}/{channel.name}")
                columns.append(np.asarray(channel[:]))
                intervals.append(float(channel.properties.get("wf_increment", 0.0)))
    aliases = short_names(tuple(names), "/")
    clocked = any(intervals) and "time" not in names and "time" not in aliases

    def load(wanted: Sequence[int]) -> list[NDArray]:
        channels = [position for position in wanted if position < len(columns)]
        if len(channels) < len(wanted):
            steps = {intervals[position] for position in channels} or set(intervals)
            if len(steps) != 1 or 0.0 in steps:
                raise InputError(
                    f"{path}: its channels have no common sampling interval; declare [channels] rate"
                )
            size = columns[channels[0]].size if channels else max(column.size for column in columns)
            clock = np.arange(size) * steps.pop()
        return [columns[position] if position < len(columns) else clock for position in wanted]

    return Table(path, (*names, "time") if clocked else tuple(names), load, aliases=aliases)
