"""Motion and moment of some runs, side by side: mean cycles of steady runs, samples of runs that do not repeat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.record import Record
from sindyjoint.states.record import ForceStates

Complex = NDArray[np.complex128]
# Samples of a mean cycle, its harmonics, and the share of a run, from its end, that counts as steady.
POINTS, MOST_HARMONICS, STEADY = 128, 40, 0.6
# Samples of a run that does not repeat, evenly spread.
SAMPLES = 2_400
MOTION = ("angle", "rate", "acceleration")


@dataclass(frozen=True, eq=False)
class Motions:
    """Motion and moment of some runs.

    Parameters
    ----------
    names : tuple of str
    angle, rate, acceleration, moment : ndarray, shape (r, n)
    inputs : ndarray, shape (r, n, k)
        Declared inputs along the motion.
    place : ndarray, shape (r, n)
        Where in its run a sample lies, from 0 to 1.
    frequency : ndarray, shape (r,), or None
        Of mean cycles, Hz; None of runs that do not repeat.
    size : ndarray, shape (r,)
        Standard deviation of each moment, by which misfits are measured.
    """

    names: tuple[str, ...]
    angle: Array
    rate: Array
    acceleration: Array
    moment: Array
    inputs: Array
    place: Array
    frequency: Array | None
    size: Array

    def __len__(self) -> int:
        return len(self.names)

    def take(self, index: Sequence[int]) -> Motions:
        """Return some of the runs."""
        rows = list(index)
        arrays = {n: getattr(self, n)[rows] for n in (*MOTION, "moment", "inputs", "place", "size")}
        frequency = None if self.frequency is None else self.frequency[rows]
        return Motions(names=tuple(self.names[i] for i in rows), frequency=frequency, **arrays)

    def scaled(self, channel: str, factors: Array | float) -> Motions:
        """Return the runs with a channel, ``"moment"`` or ``"angle"``, times a factor for each run or one for all."""
        by = np.reshape(np.broadcast_to(factors, len(self)), (-1, 1))
        size = np.abs(by[:, 0]) * self.size if channel == "moment" else self.size
        return replace(self, size=size, **{n: by * getattr(self, n) for n in _parts(channel)})

    def filtered(self, channel: str, response: Complex) -> Motions:
        """Return mean cycles whose channel has passed a filter of a response, shape as that of :attr:`lines`."""
        signals: dict[str, Any] = {
            n: np.fft.irfft(np.fft.rfft(getattr(self, n)) * response, POINTS) for n in _parts(channel)
        }
        return replace(self, **signals)

    @property
    def lines(self) -> Array:
        """Frequencies of the harmonics of mean cycles, Hz, shape (r, POINTS // 2 + 1)."""
        return np.outer(self.cycle, np.arange(POINTS // 2 + 1))

    @property
    def cycle(self) -> Array:
        """Frequencies of mean cycles, Hz; none of runs that do not repeat."""
        return np.zeros(0) if self.frequency is None else self.frequency


def _parts(channel: str) -> tuple[str, ...]:
    return ("moment",) if channel == "moment" else MOTION


def cycles_of(names: Sequence[str], frequency: Array, harmonics: Complex, inputs: Array) -> Motions:
    """Return mean cycles of the coefficients of their series.

    Parameters
    ----------
    names : sequence of str
    frequency : ndarray, shape (r,)
        Hz.
    harmonics : ndarray of complex, shape (2, r, h)
        Of moment and angle: mean and harmonics.
    inputs : ndarray, shape (r, POINTS, k)
    """
    turn = 2j * np.pi * np.outer(frequency, np.arange(harmonics.shape[2]))
    series = [harmonics[0], harmonics[1], harmonics[1] * turn, harmonics[1] * turn**2]
    moment, angle, rate, acceleration = (_cycle(each) for each in series)
    place = np.tile(np.arange(POINTS) / POINTS, (len(names), 1))
    size = np.std(moment, axis=1)
    return Motions(tuple(names), angle, rate, acceleration, moment, inputs, place, frequency, size)


def _cycle(series: Complex) -> Array:
    return np.asarray(np.fft.irfft(series, POINTS) * POINTS)


def mean_cycles(records: Sequence[Record]) -> Motions:
    """Return the mean cycles of the runs that have a frequency and both channels."""
    known = [r for r in records if r.frequency and {"moment", "angle"} <= {c.name for c in r.alive}]
    some = [r for r in known if r.samples_per_period >= 6 and _steady(r.clock, r)[1]]
    series = np.array([[_harmonics(r.channels[n], r) for r in some] for n in ("moment", "angle")])
    inputs = np.array([[_harmonics(x, r) for x in r.run.inputs.values()] for r in some if r.run])
    count = inputs.shape[1] if some else 0
    return cycles_of(
        [r.name for r in some],
        np.array([r.frequency for r in some], dtype=float),
        series.reshape(2, len(some), MOST_HARMONICS + 1),
        _cycle(inputs.reshape(len(some), count, MOST_HARMONICS + 1)).transpose(0, 2, 1),
    )


def _steady(values: Array, record: Record) -> tuple[Complex, int]:
    """Return the Fourier coefficients over whole periods at the end of a channel, and how many periods these are."""
    per = record.samples_per_period
    whole = int(STEADY * values.size / per)
    counts = np.arange(max(POLICY.fewest, whole - 8), whole + 1)
    if not counts.size:
        return np.zeros(0, dtype=complex), 0
    # The number of periods that is nearest to a whole number of samples.
    periods = int(counts[np.argmin(np.abs(counts * per - np.round(counts * per)) - 1e-3 * counts / whole)])
    size = round(periods * per)
    return np.fft.rfft(values[-size:]) / size, periods


def _harmonics(values: Array, record: Record) -> Complex:
    """Return mean and harmonics of a channel, those left out that are below the floor between them."""
    bins, periods = _steady(values, record)
    away = np.abs((np.arange(bins.size) + periods // 2) % periods - periods // 2)
    between = away > periods // 4
    floor = float(np.median(np.abs(bins[between]))) if between.any() else 0.0
    found = np.zeros(MOST_HARMONICS + 1, dtype=complex)
    kept = bins[::periods][: MOST_HARMONICS + 1]
    found[: kept.size] = np.where(np.abs(kept) < POLICY.outstanding * floor, 0, kept)
    found[:2] = kept[:2]
    return found


def samples_of(states: Sequence[ForceStates]) -> Motions:
    """Return samples of force states while the joint moves; a run in which it hardly does is left out."""
    some = [s for s in states if np.count_nonzero(s.moving) >= POINTS]
    moving = [np.flatnonzero(s.moving) for s in some]
    kept = [every[np.linspace(0, every.size - 1, SAMPLES).astype(int)] for every in moving]

    def taken(values: Sequence[Array]) -> Array:
        return np.array([x[k] for x, k in zip(values, kept, strict=True)]).reshape(len(some), SAMPLES)

    signals = {n: taken([getattr(s, n) for s in some]) for n in (*MOTION, "moment")}
    inputs = [taken([s.inputs[n] for s in some]) for n in (some[0].inputs if some else ())]
    return Motions(
        names=tuple(s.run for s in some),
        inputs=np.array(inputs).reshape(-1, len(some), SAMPLES).transpose(1, 2, 0),
        place=taken([np.arange(s.n_samples) / s.n_samples for s in some]),
        frequency=None,
        size=np.std(signals["moment"], axis=1),
        **signals,
    )
