"""What only the law shows that motion and moment of some runs have in common: runs side by side, its least squares."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sindyjoint.limits import SOUNDNESS
from sindyjoint.numeric import ROUNDING, Array, rms
from sindyjoint.soundness.detectors import Record
from sindyjoint.states import ForceStates

Complex = NDArray[np.complex128]
# Samples of a mean cycle, its harmonics, and the share of a run, from its end, that counts as steady.
POINTS, MOST_HARMONICS, STEADY = 128, 40, 0.6
# Samples of a run that does not repeat, evenly spread.
SAMPLES = 2_400
MOTION = ("angle", "rate", "acceleration")
# The signals of each channel.
PARTS = {"moment": ("moment",), "angle": MOTION}


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

    def take(self, index: Sequence[int]) -> Self:
        """Return some of the runs."""
        rows = list(index)
        arrays = {name: each[rows] for name, each in vars(self).items() if isinstance(each, np.ndarray)}
        return replace(self, names=tuple(self.names[i] for i in rows), **arrays)

    def scaled(self, channel: str, factors: Array | float) -> Self:
        """Return the runs with a channel, ``"moment"`` or ``"angle"``, times a factor for each run or one for all."""
        by = np.reshape(np.broadcast_to(factors, len(self)), (-1, 1))
        size = np.abs(by[:, 0]) * self.size if channel == "moment" else self.size
        return replace(self, size=size, **{n: by * getattr(self, n) for n in PARTS[channel]})

    def filtered(self, channel: str, response: Complex) -> Self:
        """Return mean cycles whose channel has passed a filter of a response, shape as that of :attr:`lines`."""
        signals: dict[str, Any] = {
            n: np.fft.irfft(np.fft.rfft(getattr(self, n)) * response, POINTS) for n in PARTS[channel]
        }
        return replace(self, **signals)

    def advanced(self, time: float) -> Self:
        """Return the runs with the moment earlier by a time, s; to its square, of runs that do not repeat."""
        if self.frequency is not None:
            return self.filtered("moment", np.exp(2j * np.pi * self.lines * time))
        rate = self.rate - time * self.acceleration
        return replace(self, angle=self.angle - time * (self.rate + rate) / 2, rate=rate)

    @property
    def lines(self) -> Array:
        """Frequencies of the harmonics of mean cycles, Hz, shape (r, POINTS // 2 + 1)."""
        return np.outer(self.cycle, np.arange(POINTS // 2 + 1))

    @property
    def cycle(self) -> Array:
        """Frequencies of mean cycles, Hz; none of runs that do not repeat."""
        return np.zeros(0) if self.frequency is None else self.frequency


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
    moment, angle, rate, acceleration = np.fft.irfft(series, POINTS, norm="forward")
    place = np.tile(np.arange(POINTS) / POINTS, (len(names), 1))
    return Motions(
        tuple(names), angle, rate, acceleration, moment, inputs, place, frequency, np.std(moment, axis=1)
    )


def mean_cycles(records: Sequence[Record]) -> Motions:
    """Return the mean cycles of the runs that have a frequency and both channels."""
    some = [
        r
        for r in records
        if {"moment", "angle"} <= {c.name for c in r.alive}
        and 6 <= r.samples_per_period < np.inf
        and _steady(r.clock, r)[1]
    ]
    series = np.array([[_harmonics(r.channels[n], r) for r in some] for n in ("moment", "angle")])
    inputs = np.array([[_harmonics(x, r) for x in r.run.inputs.values()] for r in some if r.run])
    count = inputs.shape[1] if some else 0
    return cycles_of(
        [r.name for r in some],
        np.array([r.frequency for r in some], dtype=float),
        series.reshape(2, len(some), MOST_HARMONICS + 1),
        np.fft.irfft(inputs.reshape(len(some), count, MOST_HARMONICS + 1), POINTS, norm="forward").transpose(
            0, 2, 1
        ),
    )


def _steady(values: Array, record: Record) -> tuple[Complex, int]:
    """Return the Fourier coefficients over whole periods at the end of a channel, and how many periods these are."""
    per = record.samples_per_period
    whole = int(STEADY * values.size / per)
    counts = np.arange(max(SOUNDNESS.fewest, whole - 8), whole + 1)
    if not counts.size:
        return np.zeros(0, dtype=complex), 0
    # The number of periods that is nearest to a whole number of samples.
    periods = int(counts[np.argmin(np.abs(counts * per - np.round(counts * per)) - 1e-3 * counts / whole)])
    size = round(periods * per)
    return np.fft.rfft(values[-size:]) / size, periods


def _harmonics(values: Array, record: Record) -> Complex:
    """Return mean and harmonics of a channel, those left out that are below the floor between them."""
    bins, periods = _steady(values, record)
    between = np.abs((np.arange(bins.size) + periods // 2) % periods - periods // 2) > periods // 4
    floor = float(np.median(np.abs(bins[between]))) if between.any() else 0.0
    found = np.zeros(MOST_HARMONICS + 1, dtype=complex)
    kept = bins[::periods][: MOST_HARMONICS + 1]
    found[: kept.size] = np.where(np.abs(kept) < SOUNDNESS.outstanding * floor, 0, kept)
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


@dataclass(frozen=True)
class Scale:
    """Usual angle and rate of a campaign, and least and largest inputs, by which the columns are scaled."""

    angle: float
    rate: float
    inputs: tuple[tuple[float, float], ...] = ()


def scale_of(runs: Motions) -> Scale:
    """Return the scale of a campaign: medians, so that one run in another unit does not set it."""
    swing = np.abs(runs.angle - runs.angle.mean(axis=1, keepdims=True)).max(axis=1)
    return Scale(
        float(np.median(swing)) or 1.0,
        float(np.median(np.abs(runs.rate).max(axis=1))) or 1.0,
        tuple((float(values.min()), float(values.max())) for values in np.moveaxis(runs.inputs, 2, 0)),
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of some runs, each run's moment scaled to an RMS of one; rows of standstill are zero.

    Parameters
    ----------
    columns : ndarray, shape (r, n, p)
    target : ndarray, shape (r, n)
    """

    columns: Array
    target: Array

    @cached_property
    def products(self) -> Array:
        """Products of [columns | target] of each run, shape (r, p + 1, p + 1)."""
        both = np.concatenate([self.columns, self.target[:, :, None]], axis=2)
        return np.asarray(both.transpose(0, 2, 1) @ both) / self.target.shape[1]

    def left_by(self, law: Array, run: int = 0) -> float:
        """Return the RMS that a law leaves of a run, in parts of its moment's."""
        return rms(self.target[run] - self.columns[run] @ law)


def rows_of(runs: Motions, scale: Scale, inertia: float | None) -> Rows:
    """Return the moving rows of runs under a flexible law.

    Powers of the angle up to the fifth, viscous, quadratic and angle-dependent damping, friction with its dependence on
    the angle; of runs that do not repeat also damping that differs between the directions, and stiffness that depends
    on the rate, which a few mean cycles could not tell from the gain of a run. Each of the paper's coefficients may
    depend on each input, friction also on the size of one that changes its sign, as of a load.
    """
    a, v = runs.angle / scale.angle, runs.rate / scale.rate
    sign = np.sign(v)
    # A power beyond the second takes a hundred times as long as a product.
    plain = [np.ones_like(a), a, a**2, a**2 * a, v, sign]
    ends = [*zip(np.moveaxis(runs.inputs, 2, 0), scale.inputs, strict=True)]
    built = [
        *plain,
        *(a**2 * a**2 * a, v * np.abs(v), a * v, a**2 * v, np.abs(a) * sign, a * sign),
        *((np.abs(v), a * v**2) if runs.frequency is None else ()),
        *(c * (x - low) / (high - low) for x, (low, high) in ends if high > low for c in plain),
        *(sign * np.abs(x) / max(-low, high) for x, (low, high) in ends if low < 0 < high),
        *((runs.acceleration * scale.angle / scale.rate**2,) if inertia is None else ()),
    ]
    moving = np.abs(runs.rate) > SOUNDNESS.minor_share * np.abs(runs.rate).max(axis=1, keepdims=True)
    weight = moving / np.where(runs.size == 0, 1.0, runs.size)[:, None]
    load = runs.moment - (inertia or 0.0) * runs.acceleration
    return Rows(np.stack(built, axis=2) * weight[:, :, None], load * weight)


def solve(products: Array) -> tuple[Array, Any]:
    """Return coefficients and residual mean square, over the runs, of the law of some runs' products."""
    return solved(products.sum(axis=0), len(products))


def solved(pooled: Array, runs: int) -> tuple[Array, Any]:
    """Return the same of the products of some runs together, shape (..., p + 1, p + 1): (..., p) and (...)."""
    gram, right, square = pooled[..., :-1, :-1], pooled[..., :-1, -1:], pooled[..., -1, -1]
    law = inverted(gram) @ right
    left = square - ((2 * right - gram @ law) * law).sum(axis=(-2, -1))
    return law[..., 0], np.maximum(left, 0.0) / runs


def inverted(gram: Array) -> Array:
    """Return the inverses of products of columns, shape (..., p, p), scaled to unit norm and with a ridge."""
    norms = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300))
    scale = norms[..., :, None] * norms[..., None, :]
    return np.asarray(np.linalg.inv(gram / scale + ROUNDING * np.eye(norms.shape[-1])) / scale)


def misfit(runs: Motions, inertia: float | None, scale: Scale | None = None) -> float:
    """Return the RMS that one law leaves of runs, in parts of their moments'."""
    return float(np.sqrt(solve(rows_of(runs, scale or scale_of(runs), inertia).products)[1]))


def least(left: Callable[[float], float], grid: Array) -> tuple[float, float]:
    """Return where a function of one number is least, between the places of a grid, and its value there.

    Examples
    --------
    >>> round(least(lambda x: (x - 0.3) ** 2, np.linspace(-1, 1, 7))[0], 2)
    0.3
    """
    known = {x: left(x) for x in grid.tolist()}
    for _ in range(6):
        places = sorted(known)
        at = places.index(min(places, key=known.__getitem__))
        beside = (*places[max(at - 1, 0) : at], *places[at + 1 : at + 2])
        known |= {middle: left(middle) for middle in ((places[at] + other) / 2 for other in beside)}
    best = min(known, key=known.__getitem__)
    return best, known[best]
