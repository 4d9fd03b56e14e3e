"""Force states of a steady periodic run: harmonics of the excitation frequency, differentiated exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.limits import STATES
from sindyjoint.numeric import SAME, Array, kept
from sindyjoint.record import Run
from sindyjoint.states.floor import scatter_of
from sindyjoint.states.harmonics import (
    HarmonicBasis,
    local_noise,
    refine_frequency,
    significant_harmonics,
    unsteady_periods,
)
from sindyjoint.states.record import ForceStates, Harmonics, NoiseFloor, moving_mask, rate_limit

REPLICATES = 8
# Harmonics above this share of the sampling rate are never used: anti-alias filters live there.
BAND_SHARE = 0.4
# Largest number of harmonics tried. A stick–slip angle has decayed below any real noise long before.
MAXIMUM_HARMONICS = 120


def periodic_states(
    run: Run,
    bandwidth: float | None = None,
    rate_share: float | None = None,
) -> ForceStates:
    """Return the force states of a single-frequency run.

    The angle is the least-squares Fourier series over whole steady periods, cut where its harmonics sink into
    the noise; rate and acceleration are its exact derivatives. Samples of moment and inputs are kept as measured.

    Parameters
    ----------
    run : Run
        With ``frequency`` set.
    bandwidth : float, optional
        Highest harmonic frequency tried, Hz. Default: 0.4 of the sampling rate.
    rate_share : float
        Share of the peak rate below which samples count as reversal. Default: 0.05.

    Raises
    ------
    InputError
        If the run has no frequency or fewer than three steady periods.
    """
    if run.frequency is None:
        raise InputError(f"{run.label}: no frequency; the periodic method needs one, use method='broadband'")
    found = _found_motion(run, bandwidth)
    frequency, start, stop, made = found.frequency, found.start, found.stop, found.motion
    guard = reversal_guard(run.sample_rate, frequency, found.highest)
    slowest = rate_limit(
        made.motion[1], made.rate_noise, STATES.periodic_rate_share if rate_share is None else rate_share
    )
    moving = moving_mask(made.motion[1], slowest, guard)
    if run.valid is not None:
        moving &= run.valid[start:stop]
    moment = run.moment[start:stop]
    inputs = {name: values[start:stop] for name, values in run.inputs.items()}
    powers = (made.motion[0] ** 2, made.motion[0] ** 3)
    changing = (*made.motion, *powers, *_moved_law(inputs, made.motion))
    repeated = repeat_noise(moment, run.sample_rate, frequency, moving, changing)
    moment_noise = max(repeated, run.noise.moment or 0.0)
    # That of one sensor is not the noise of the angle of several.
    declared = (run.noise.angle or 0.0) if run.fusion is None else 0.0
    return ForceStates(
        run=run.name,
        frequency=frequency,
        level=run.level,
        sample_rate=run.sample_rate,
        time=np.arange(stop - start) / run.sample_rate + start / run.sample_rate,
        angle=made.motion[0],
        rate=made.motion[1],
        acceleration=made.motion[2],
        moment=moment,
        moving=moving,
        block=np.repeat(np.arange(found.edges.size - 1), np.diff(found.edges)),
        replicate=made.replicate,
        noise=NoiseFloor(
            moment_noise,
            max(found.noise, declared),
            made.rate_noise,
            made.acceleration_noise,
            source="periods",
        ),
        method="periodic",
        bandwidth=found.highest,
        dropped=start / run.sample_rate,
        slowest=slowest,
        guard=guard,
        series=made.series,
        inputs=inputs,
        fusion=run.fusion,
    )


class _Found(NamedTuple):
    """What the whole steady periods of a run show, whichever of their samples count as motion."""

    frequency: float
    start: int
    stop: int
    edges: NDArray[np.intp]
    motion: _Motion
    highest: float
    noise: float


# A diagnosis counts more of the samples as motion than a discovery.
@kept
def _found_motion(run: Run, bandwidth: float | None) -> _Found:
    assert run.frequency is not None
    frequency = refine_frequency(run.angle, run.sample_rate, run.frequency)
    start, stop, periods = steady_span(run, frequency)
    time = np.arange(stop - start) / run.sample_rate
    edges = cut_blocks(periods, run.sample_rate / frequency, time.size)
    angle = _Series.fit(run.angle[start:stop], time, run.sample_rate, frequency, bandwidth)
    rate = None
    if run.rate is not None:
        rate = _Series.fit(run.rate[start:stop], time, run.sample_rate, frequency, bandwidth)
    motion = _Motion.of(angle, rate, edges, frequency)
    return _Found(frequency, start, stop, edges, motion, angle.highest, angle.noise)


def kept_harmonics(states: ForceStates, highest: int | None = None) -> HarmonicBasis:
    """Return the harmonics that the angle of a periodic run was reduced to, or those up to an order, at its samples."""
    assert states.frequency is not None
    orders = states.series[0].orders
    kept = orders if highest is None else orders[orders <= highest]
    return HarmonicBasis.build(states.time - states.time[0], states.frequency, kept)


def reversal_guard(sample_rate: float, frequency: float, highest: float) -> int:
    """Return the samples left out on either side of a reversal; the motion has harmonics up to ``highest`` Hz."""
    per = sample_rate / frequency
    # Of ten samples per period two on either side of each reversal would leave none.
    least = 2 if per >= STATES.coarse_period else 1
    guard = max(least, int(np.ceil(STATES.periodic_guard * sample_rate / highest)))
    # Displacement-driven runs have one harmonic; half its period would leave no samples.
    return min(guard, max(least, int(STATES.periodic_guard_limit * per)))


def steady_span(run: Run, frequency: float) -> tuple[int, int, int]:
    """Return first and last sample of the whole steady periods of a run, and their number.

    Raises
    ------
    InputError
        If there are fewer than three.
    """
    per = run.sample_rate / frequency
    before, after = unsteady_periods(run.angle, run.sample_rate, frequency)
    start = int(round(before * per))
    # One part in a thousand of a period may be missing at the end: rounding of the record's length.
    periods = int(np.floor((run.n_samples - start) / per + 1e-3)) - after
    if periods < STATES.fewest:
        raise InputError(
            f"{run.label}: {periods} steady period(s) of {frequency:g} Hz; the periodic method needs "
            f"{STATES.fewest}, use method='broadband' or a longer record"
        )
    return start, min(start + int(round(periods * per)), run.n_samples), periods


@dataclass(frozen=True, eq=False)
class _Series:
    """A channel as the Fourier series of the harmonics that exceed its noise."""

    signal: Array
    basis: HarmonicBasis
    orders: NDArray[np.intp]
    standard_error: Array  # of one coefficient of each kept harmonic
    noise: float  # RMS of single samples about the series

    @classmethod
    def fit(
        cls,
        signal: Array,
        time: Array,
        sample_rate: float,
        frequency: float,
        bandwidth: float | None,
    ) -> _Series:
        n = signal.size
        top = BAND_SHARE * sample_rate if bandwidth is None else min(bandwidth, 0.49 * sample_rate)
        count = int(np.clip(top / frequency, 1, min(MAXIMUM_HARMONICS, (n - 8) // 4)))
        orders = np.arange(1, count + 1)
        full = HarmonicBasis.build(time, frequency, orders)
        mean, a, b = full.fit(signal)
        residual = signal - full.series(mean, a, b)
        variance = local_noise(residual, sample_rate, full.angular / (2 * np.pi), 0.5 * frequency)
        standard_error = np.sqrt(2 * variance / n)
        keep = significant_harmonics(np.hypot(a, b), standard_error)
        noise = float(np.sqrt(residual @ residual / max(n - 2 * count - 1, 1)))
        return cls(signal, full.take(keep), orders[keep], standard_error[keep], noise)

    @property
    def highest(self) -> float:
        """Frequency of the highest kept harmonic, Hz."""
        return float(self.basis.angular[-1]) / (2 * np.pi)

    @property
    def harmonics(self) -> Harmonics:
        """The kept harmonics without the samples."""
        return Harmonics(self.orders, self.standard_error)

    def motion(self, rows: slice = slice(None)) -> tuple[Array, Array, Array]:
        """Return the series and its first two derivatives, estimated from and given at ``rows``."""
        basis = self.basis.rows(rows)
        mean, a, b = basis.fit(self.signal[rows])
        return basis.series(mean, a, b), basis.derivative(a, b), basis.second_derivative(a, b)

    def replicates(self, edges: NDArray[np.intp]) -> tuple[Array, Array, Array]:
        """Return series and derivatives estimated from each block separately."""
        parts = [self.motion(slice(low, high)) for low, high in zip(edges[:-1], edges[1:], strict=True)]
        series, first, second = (np.concatenate(column) for column in zip(*parts, strict=True))
        return series, first, second


class _Motion(NamedTuple):
    """Angle, rate and acceleration of a run, the same from each single block, and how sure they are."""

    motion: tuple[Array, Array, Array]
    replicate: tuple[Array, Array, Array]
    rate_noise: float
    acceleration_noise: float
    series: tuple[Harmonics, ...]

    @classmethod
    def of(cls, angle: _Series, rate: _Series | None, edges: NDArray[np.intp], frequency: float) -> _Motion:
        """Return the motion of the series of an angle, and of its rate where that was measured, too."""
        whole, parts = angle.motion(), angle.replicates(edges)
        if rate is None:
            known, first = angle.harmonics, 1
            series: tuple[Harmonics, ...] = (known,)
        else:
            whole, parts = (whole[0], *rate.motion()[:2]), (parts[0], *rate.replicates(edges)[:2])
            known, first = rate.harmonics, 0
            series = (angle.harmonics, known)
        noise, faster = (known.derivative_noise(frequency, order) for order in (first, first + 1))
        return cls(whole, parts, noise, faster, series)


def cut_blocks(periods: int, per: float, n: int) -> NDArray[np.intp]:
    """Return sample indices that cut the record into at most eight blocks of whole periods."""
    blocks = min(REPLICATES, periods)
    edges = np.round(np.round(np.linspace(0, periods, blocks + 1)) * per).astype(np.intp)
    edges[-1] = n
    return edges


def _moved_law(inputs: Mapping[str, Array], motion: tuple[Array, Array, Array]) -> tuple[Array, ...]:
    """Return what inputs that move within a run add to the moment: its elastic, viscous and dry parts in proportion."""
    angle, rate, _ = motion
    parts = (np.ones(angle.size), angle, rate, np.sign(rate))
    return tuple(values * part for values in inputs.values() if np.ptp(values) > 0 for part in parts)


def repeat_noise(
    moment: Array,
    sample_rate: float,
    frequency: float,
    where: NDArray[np.bool_],
    motion: Sequence[Array],
) -> float:
    """Return the RMS of what a moment does not repeat from one period to a later one, per sample.

    The lag is the whole number of periods, up to half the record, that is nearest to a whole number of samples. What
    the ``motion`` has moved on by the remainder makes of the moment, and what inputs of the law that need not repeat
    make of it, is taken out; see :func:`scatter_of`. Only samples marked in ``where`` are compared, so a friction step
    that falls between samples is not taken for noise.
    """
    per = sample_rate / frequency
    lags = np.arange(1, max(2, int(moment.size / per) // 2 + 1))
    distance = np.abs(lags * per - np.round(lags * per))
    lag = int(round(lags[int(np.argmin(np.round(distance, 3)))] * per))
    both = where[:-lag] & where[lag:]
    if not np.any(both):
        return 0.0
    columns = np.column_stack([np.ones_like(moment), *motion])
    change = (columns[lag:] - columns[:-lag])[both]
    change[:, 0] = 1.0  # a drift
    used = np.max(np.abs(change), axis=0) > SAME * np.max(np.abs(columns), axis=0)
    found = scatter_of([(change[:, used], (moment[lag:] - moment[:-lag])[both])])
    return 0.0 if found is None else found
