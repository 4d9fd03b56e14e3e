"""What is known of a run's source: its file and hash, the units its columns stand in, and the noise of its sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sindyjoint.errors import InputError


@dataclass(frozen=True)
class ColumnUnit:
    """The unit of a column, as the manifest declares it and as the file states it.

    Parameters
    ----------
    channel : str
        ``"moment"``, ``"angle"``, ``"rate"`` or ``"time"``.
    column : str
        Name of the column.
    declared, stated : str
    named : bool
        Whether the file states it by the ending of the column's name only (``"angle_mrad"``), which may mean another
        thing.
    """

    channel: str
    column: str
    declared: str
    stated: str
    named: bool = False


@dataclass(frozen=True)
class FileUnit:
    """In what unit a channel's values stand in their file.

    Parameters
    ----------
    channel : str
        ``"moment"``, ``"angle"`` or ``"rate"``.
    unit : str
        As declared; before the gain, such as ``"V"``.
    factor : float
        What one of it is in SI, gain included.
    column : str
        Name of the column; empty where it has none.
    stated : bool
        Whether the file states a unit of its own.
    """

    channel: str
    unit: str
    factor: float
    column: str = ""
    stated: bool = False


@dataclass(frozen=True)
class Source:
    """Where a run came from, for provenance.

    Parameters
    ----------
    path : str
        Name of the file.
    sha256 : str
        Of its bytes.
    units : tuple of ColumnUnit
        Units that the file states, where they are not written as declared.
    """

    path: str
    sha256: str
    units: tuple[ColumnUnit, ...] = ()


@dataclass(frozen=True)
class LongRecord:
    """Where the whole of a run lies that is too long for memory; the run itself then holds its first segment.

    Parameters
    ----------
    manifest : str
        The campaign's file.
    index : int
        Of the run in it.
    edges : tuple of int
        Rows of its file at which it is cut into segments.
    """

    manifest: str
    index: int
    edges: tuple[int, ...]

    @property
    def n_stretches(self) -> int:
        """Number of segments."""
        return len(self.edges) - 1


@dataclass(frozen=True)
class SensorNoise:
    """RMS noise of single samples as a data sheet or a calibration gives it; None where nothing is declared.

    Parameters
    ----------
    moment, angle, rate, acceleration : float, optional
        N·m, rad, rad/s, rad/s² (N, m, m/s, m/s²).
    """

    moment: float | None = None
    angle: float | None = None
    rate: float | None = None
    acceleration: float | None = None

    def __post_init__(self) -> None:
        for name in ("moment", "angle", "rate", "acceleration"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"noise of the {name} is {value!r}; expected a finite number above zero")

    def scaled(self, factor: float) -> SensorNoise:
        """Return the noise of all channels times a factor, as that of a mean of samples is."""
        values = (self.moment, self.angle, self.rate, self.acceleration)
        return SensorNoise(*(None if value is None else factor * value for value in values))
