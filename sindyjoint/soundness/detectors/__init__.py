"""One detector for each fault of channels, whether the record is of a joint or of a structure: what each looks at."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sindyjoint.inputs import Source
from sindyjoint.limits import SOUNDNESS
from sindyjoint.measurement.runs import white_noise
from sindyjoint.mechanics.rig_test import DRIVE, RigTest
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.record import Campaign, Run
from sindyjoint.soundness import Spans

Mask = NDArray[np.bool_]


def spans_of(marked: Mask) -> Spans:
    """Return the runs of marked samples, from inclusive to exclusive.

    Examples
    --------
    >>> spans_of(np.array([False, True, True, False, True]))
    ((1, 3), (4, 5))
    """
    change = np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return tuple((int(a), int(b)) for a, b in zip(starts, stops, strict=True))


def marked_of(spans: Iterable[tuple[int, int]], size: int) -> Mask:
    """Return the samples of spans.

    Examples
    --------
    >>> marked_of([(1, 3)], 4).tolist()
    [False, True, True, False]
    """
    marked = np.zeros(size, dtype=bool)
    for start, stop in spans:
        marked[max(start, 0) : stop] = True
    return marked


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of a record.

    Parameters
    ----------
    name : str
    values : ndarray, shape (n,)
    jumps : bool
        Whether it jumps within its range where friction does: an acceleration.
    """

    name: str
    values: Array
    jumps: bool = False

    @cached_property
    def range(self) -> float:
        """Difference of the largest and the smallest value."""
        return float(np.ptp(self.values))

    @cached_property
    def constant(self) -> bool:
        """Whether it never changes beyond rounding."""
        return self.range <= 1e-12 * float(np.abs(self.values).max(initial=0.0))

    @cached_property
    def std(self) -> float:
        """Standard deviation."""
        return float(np.std(self.values))

    @cached_property
    def amplitude(self) -> float:
        """Half the range of the middle 98 % of the samples: the amplitude without spikes."""
        low, high = np.quantile(self.values, [0.01, 0.99])
        return 0.5 * float(high - low)

    @cached_property
    def levels(self) -> tuple[Array, NDArray[np.intp]]:
        """Values that occur, ascending, and how often each does."""
        ordered = np.sort(self.values)
        starts = np.flatnonzero(np.concatenate([[True], np.diff(ordered) > 1e-9 * max(self.range, 1e-300)]))
        return ordered[starts], np.diff(np.append(starts, ordered.size))

    @cached_property
    def step(self) -> float:
        """Smallest difference of two values that occur: the resolution of a quantised channel."""
        levels = self.levels[0]
        return float(np.diff(levels).min()) if levels.size > 1 else 0.0

    @cached_property
    def noise(self) -> float:
        """RMS of the noise from sample to sample, whose median ignores steps and spikes."""
        return white_noise(self.values)

    @cached_property
    def quantised(self) -> bool:
        """Whether noise is not far above the resolution, so that neighbours may well be equal."""
        return self.noise <= SOUNDNESS.outstanding * self.step


@dataclass(frozen=True, eq=False)
class Periods:
    """A channel period by period.

    Parameters
    ----------
    mean : ndarray, shape (p,)
    line : ndarray of complex, shape (p,)
        Amplitude and phase of the main line against a clock of the run's frequency.
    """

    mean: Array
    line: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Record:
    """A run as the detectors see it.

    Parameters
    ----------
    name : str
    sample_rate : float
        Hz.
    declared : float or None
        Frequency at which it repeats, Hz.
    channels : mapping of str to ndarray, shape (n,)
        Of a joint moment and angle, of a structure drive and sensors, SI.
    jumpy : frozenset of str
        Accelerations.
    source : Source or None
    run : Run or None
        Of a joint; None of a structure.
    quasi_static : bool
    lost : mapping of str or None to ndarray of bool, shape (n,)
        Samples that were never recorded, or were left out before; those of None in all channels.
    """

    name: str
    sample_rate: float
    declared: float | None
    channels: Mapping[str, Array]
    jumpy: frozenset[str] = frozenset()
    source: Source | None = None
    run: Run | None = None
    quasi_static: bool = False
    lost: Mapping[str | None, Mask] = field(default_factory=dict)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return self.clock.size

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.n_samples / self.sample_rate

    @property
    def driven_by(self) -> str:
        """The channel whose phase is the record's: what moves a joint, and what drives a structure."""
        return DRIVE if self.run is None else "angle"

    @property
    def clock(self) -> Array:
        """The values of that channel."""
        return self.channels[self.driven_by]

    @cached_property
    def _every(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, values, name in self.jumpy) for name, values in self.channels.items())

    @cached_property
    def alive(self) -> tuple[Channel, ...]:
        """Channels that vary."""
        return tuple(c for c in self._every if not c.constant)

    @cached_property
    def dead(self) -> tuple[Channel, ...]:
        """Channels that never change."""
        return tuple(c for c in self._every if c.constant)

    def channel(self, name: str) -> Channel | None:
        """Return a channel that varies, or None."""
        return next((c for c in self.alive if c.name == name), None)

    @cached_property
    def main(self) -> float:
        """Frequency of the strongest line, Hz."""
        return main_frequency(self.clock, self.sample_rate, between_bins=True)

    @cached_property
    def frequency(self) -> float | None:
        """Declared excitation frequency, or the strongest line of a joint's run that repeats with it, Hz."""
        angle = self.channel("angle")
        if self.declared is not None or angle is None:
            return self.declared
        per = self.sample_rate / self.main if self.main > 0 else 0.0
        if not (per >= 8 and angle.values.size >= SOUNDNESS.fewest * per):
            return None
        line = np.abs(cut_periods(angle.values, per).line)
        late = line[line.size // 3 :]
        steady = late.size > 1 and np.ptp(late) <= SOUNDNESS.minor_share * np.median(late)
        carried = np.median(late) / np.sqrt(2) >= (1 - SOUNDNESS.large_part) * angle.std
        return self.main if steady and carried else None

    @cached_property
    def order(self) -> int:
        """The strongest line of a structure's drive, in multiples of the frequency at which it repeats; else 1."""
        if self.run is not None or self.declared is None:
            return 1
        return max(1, round(self.main / self.declared))

    @cached_property
    def samples_per_period(self) -> float:
        """Sampling rate over frequency; infinite where nothing repeats."""
        return np.inf if self.frequency is None else self.sample_rate / self.frequency

    @cached_property
    def periods(self) -> dict[str, Periods]:
        """Channels that vary, period by period; empty of a run that does not repeat or has too few periods."""
        per = self.samples_per_period
        if per < 4 or self.n_samples < SOUNDNESS.fewest * per:
            return {}
        return {c.name: cut_periods(c.values, per, self.order) for c in self.alive}

    def at(self, period: float) -> int:
        """Return the sample at which a period begins."""
        return int(np.clip(round(period * self.samples_per_period), 0, self.n_samples))

    def short(self, spans: Spans) -> bool:
        """Return whether what is missing can be put in: from other periods, or across gaps short against the motion."""
        if sum(b - a for a, b in spans) > SOUNDNESS.large_part * self.n_samples:
            return False
        fastest = max(main_frequency(c.values, self.sample_rate, between_bins=True) for c in self.alive)
        longest = SOUNDNESS.minor_share * self.sample_rate / max(fastest, 1e-9)
        return self.declared is not None or max(b - a for a, b in spans) <= longest


def record_of(run: Run) -> Record:
    """Return a run of a joint as the detectors see it."""
    return Record(
        run.name, run.sample_rate, run.frequency, run.channels, frozenset(["acceleration"]), run.source, run,
        run.quasi_static, {} if run.valid is None else {None: ~run.valid},
    )  # fmt: skip


def records_of(measured: Campaign | RigTest) -> list[Record]:
    """Return the runs of a campaign, or of a structure's test, as the detectors see them."""
    if not isinstance(measured, RigTest):
        return [record_of(run) for run in measured.runs]
    jumpy = frozenset(s.name for s in measured.sensors if s.quantity == "acceleration")
    names = measured.channels
    return [
        Record(
            run.name, run.sample_rate, run.frequency, dict(zip(names, run.signals, strict=True)), jumpy, run.source,
            lost={} if run.lost is None else dict(zip(names, run.lost, strict=True)),
        )
        for run in measured.runs
    ]  # fmt: skip


def cut_periods(signal: Array, per: float, order: int = 1) -> Periods:
    """Return mean and fundamental, or another harmonic, of every whole period of a signal.

    The integrals over a period, ∫x dt and ∫x·exp(−iωt) dt, end between samples; their running sums are interpolated
    there, so a period need not be a whole number of samples.

    Parameters
    ----------
    signal : ndarray, shape (n,)
    per : float
        Samples per period.
    order : int
        Of the harmonic.
    """
    n = signal.size
    edges = np.arange(int(n / per) + 1) * per
    centre = float(np.mean(signal))
    shifted = signal - centre
    turn = shifted * np.exp(-2j * np.pi * order * np.arange(n) / per)
    grid = np.arange(n + 1)

    def integrals(values: Array) -> Array:
        return np.asarray(np.diff(np.interp(edges, grid, np.concatenate([[0.0], np.cumsum(values)]))))

    line: NDArray[np.complex128] = np.asarray(integrals(turn.real) + 1j * integrals(turn.imag), dtype=complex)
    return Periods(integrals(shifted) / per + centre, 2 * line / per)
