"""LabVIEW's TDMS by npTDMS."""

from __future__ import annotations

import io
import logging
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.limits import check_bytes
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
    return TdmsBlocks(path, io.BytesIO(data)).whole()


@contextmanager
def _tdms(path: Path) -> Iterator[None]:
    """Report bad bytes in one sentence; npTDMS would write lines of its own about them to stderr."""
    from nptdms.log import log_manager

    level = log_manager.log_level
    log_manager.set_level(logging.CRITICAL)
    try:
        with foreign(path, "TDMS"):
            yield
    finally:
        log_manager.set_level(level)


def _increment(path: Path, channel: Any) -> float:
    """Return the sampling interval of a channel, s; zero where it states none."""
    given = channel.properties.get("wf_increment", 0.0)
    if isinstance(given, str | bool) or not np.isfinite(np.float64(given)) or given < 0:
        raise InputError(
            f"{path}: the sampling interval of channel {channel.name!r:.60} is {given!r:.40}; expected seconds"
        )
    return float(given)


class TdmsBlocks(Blocks):
    """Segments of the channels of a TDMS file."""

    def __init__(self, path: Path, data: io.BytesIO | None = None):
        try:
            import nptdms
        except ImportError as error:
            raise missing_extra(path, "npTDMS", error) from error
        self.path = path
        with _tdms(path):
            # Opened here: of a file that it refuses npTDMS would leave its own open.
            stream = path.open("rb") if data is None else data
            weakref.finalize(self, stream.close)
            self._file = nptdms.TdmsFile.open(stream)
            # npTDMS makes do with what is there of a file whose writing was cut short.
            if self._file.file_status.incomplete_final_segment:
                raise InputError(f"{path}: its last segment is incomplete; the file is truncated")
            channels = [(f"{g.name}/{c.name}", c) for g in self._file.groups() for c in g.channels()]
            self._channels = [channel for _, channel in channels]
            self._steps = [_increment(path, c) for c in self._channels]
            check_bytes(path, 8 * sum(len(channel) for channel in self._channels) if data is not None else 0)
        names = tuple(name for name, _ in channels)
        self.aliases = short_names(names, "/")
        clocked = any(self._steps) and "time" not in names and "time" not in self.aliases
        self.names = (*names, "time") if clocked else names
        self.rows = max((len(channel) for channel in self._channels), default=0)

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns; ``time`` is made from the sampling interval, as long as the first of them."""
        asked = [position for position in wanted if position < len(self._channels)]
        steps = {self._steps[position] for position in asked} or set(self._steps)
        if len(asked) < len(wanted) and (len(steps) != 1 or 0.0 in steps):
            raise InputError(
                f"{self.path}: its channels have no common sampling interval; declare [channels] rate"
            )
        rows = len(self._channels[asked[0]]) if asked else self.rows
        with _tdms(self.path):
            return [
                np.asarray(self._channels[position].read_data(start, stop - start))
                if position < len(self._channels)
                else np.arange(start, min(stop, rows)) * next(iter(steps))
                for position in wanted
            ]
