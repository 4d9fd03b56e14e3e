"""What every detector needs of a run: its channels with noise and resolution, and its course from period to period."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array, main_frequency
from sindyjoint.record import Run
from sindyjoint.soundness.policy import POLICY


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of a run.

    Parameters
    ----------
    name : str
        ``"moment"``, ``"angle"``, ``"rate"``, or a sensor of a run with an accelerometer.
    values : ndarray, shape (n,)
    """

    name: str
    values: Array

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
        """RMS of the noise from sample to sample, by third differences: their median ignores steps and spikes.

        Zero where they are no noise: those of white noise change sign from one to the next in 77 % of all cases, those
        of a smooth signal hardly ever.
        """
        third = np.diff(self.values, 3)
        sign = np.sign(third[third != 0])
        if sign.size < 8 or np.mean(sign[1:] != sign[:-1]) < POLICY.noise_changes:
            return 0.0
        return float(1.4826 * np.median(np.abs(third)) / np.sqrt(20.0))

    @cached_property
    def quantised(self) -> bool:
        """Whether noise is not far above the resolution, so that neighbours may well be equal."""
        return self.noise <= POLICY.resolved_noise * self.step


@dataclass(frozen=True, eq=False)
class Periods:
    """A channel period by period.

    Parameters
    ----------
    mean : ndarray, shape (p,)
    line : ndarray of complex, shape (p,)
        Amplitude and phase of the fundamental against a clock of the run's frequency.
    """

    mean: Array
    line: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Profile:
    """A run as the detectors see it.

    Parameters
    ----------
    run : Run
    channels : tuple of Channel
        Those that vary; a constant one is in ``dead``.
    dead : tuple of Channel
    """

    run: Run
    channels: tuple[Channel, ...]
    dead: tuple[Channel, ...] = ()

    def channel(self, name: str) -> Channel | None:
        """Return a channel that varies, or None."""
        return next((c for c in self.channels if c.name == name), None)

    @cached_property
    def frequency(self) -> float | None:
        """Declared excitation frequency, or the strongest line of a run that repeats with it, Hz."""
        if self.run.frequency is not None:
            return self.run.frequency
        angle = self.channel("angle")
        if angle is None:
            return None
        with np.errstate(all="ignore"):
            frequency = main_frequency(angle.values, self.run.sample_rate, between_bins=True)
        ratio = self.run.sample_rate / frequency if frequency > 0 else 0.0
        count = angle.values.size / ratio if ratio > 0 else 0.0
        if not (ratio >= 8 and count >= POLICY.fewest_periods):
            return None
        line = cut_periods(angle.values, ratio).line
        late = np.abs(line[line.size // 3 :])
        steady = late.size > 1 and np.ptp(late) <= POLICY.same_amplitude * np.median(late)
        carried = np.median(late) / np.sqrt(2) >= POLICY.main_line * angle.std
        return frequency if steady and carried else None

    @cached_property
    def samples_per_period(self) -> float | None:
        """Sampling rate over frequency."""
        return None if self.frequency is None else self.run.sample_rate / self.frequency

    @cached_property
    def periods(self) -> dict[str, Periods]:
        """Channels period by period; empty for a run without frequency or with too few periods."""
        per = self.samples_per_period
        if per is None or per < 4 or self.run.n_samples / per < POLICY.fewest_periods:
            return {}
        return {c.name: cut_periods(c.values, per) for c in self.channels}

    def at(self, period: float) -> int:
        """Return the sample at which a period begins."""
        return int(np.clip(round(period * (self.samples_per_period or 1.0)), 0, self.run.n_samples))


def profile_of(run: Run) -> Profile:
    """Return the profile of a run."""
    channels = [Channel(name, values) for name, values in run.channels.items()]
    alive = tuple(c for c in channels if not c.constant)
    return Profile(run, alive, tuple(c for c in channels if c.constant))


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
        running = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(np.diff(np.interp(edges, grid, running)))

    line: NDArray[np.complex128] = np.asarray(integrals(turn.real) + 1j * integrals(turn.imag), dtype=complex)
    return Periods(integrals(shifted) / per + centre, 2 * line / per)
