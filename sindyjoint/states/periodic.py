"""Force states of a steady periodic run: harmonics of the excitation frequency, differentiated exactly."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.limits import STATES
from sindyjoint.numeric import SAME, Array, Booleans, Integers, kept
from sindyjoint.record import Run
from sindyjoint.states.floor import scatter_of
from sindyjoint.states.harmonics import (
    HarmonicBasis,
    fitted_motion,
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
        If it has fewer than three steady periods.
    """
    found = _found_motion(run, bandwidth)
    frequency, start, motion = found.frequency, found.start, found.motion
    angle, rate, acceleration = motion
    stop, rate_noise = start + angle.size, found.motion_noise[0]
    guard = reversal_guard(run.sample_rate, frequency, found.highest)
    slowest = rate_limit(rate, rate_noise, STATES.periodic_rate_share if rate_share is None else rate_share)
    moving = moving_mask(rate, slowest, guard)
    if run.valid is not None:
        moving &= run.valid[start:stop]
    moment = run.moment[start:stop]
    inputs = {name: values[start:stop] for name, values in run.inputs.items()}
    changing = (*motion, angle**2, angle**3, *_moved_law(inputs, angle, rate))
    repeated = repeat_noise(moment, run.sample_rate, frequency, moving, changing)
    # That of one sensor is not the noise of the angle of several.
    declared = (run.noise.angle or 0.0) if run.fusion is None else 0.0
    noise = NoiseFloor(
        max(repeated, run.noise.moment or 0.0),
        max(found.noise, declared),
        *found.motion_noise,
        source="periods",
    )
    return ForceStates(
        run=run.name,
        frequency=frequency,
        level=run.level,
        sample_rate=run.sample_rate,
        time=np.arange(angle.size) / run.sample_rate + start / run.sample_rate,
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        moment=moment,
        moving=moving,
        block=np.repeat(np.arange(found.edges.size - 1), np.diff(found.edges)),
        replicate=found.replicate,
        noise=noise,
        method="periodic",
        bandwidth=found.highest,
        dropped=start / run.sample_rate,
        slowest=slowest,
        guard=guard,
        series=found.series,
        inputs=inputs,
        fusion=run.fusion,
    )


class _Found(NamedTuple):
    """What the whole steady periods of a run show, whichever of their samples count as motion.

    Motion and noise are those of angle, rate and acceleration, and of the last two; the replicate is the motion from
    each single block.
    """

    frequency: float
    start: int
    edges: Integers
    motion: tuple[Array, Array, Array]
    replicate: tuple[Array, Array, Array]
    motion_noise: tuple[float, float]
    series: tuple[Harmonics, ...]
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
    signals = [signal[start:stop] for signal in (run.angle, run.rate) if signal is not None]
    fitted = [_fitted_series(signal, time, run.sample_rate, frequency, bandwidth) for signal in signals]
    bases, series, noises = zip(*fitted, strict=True)
    blocks = [slice(low, high) for low, high in zip(edges[:-1], edges[1:], strict=True)]
    angle, rate, acceleration = fitted_motion(bases, signals)
    first, second, third = np.hstack([fitted_motion(bases, signals, block) for block in blocks])
    # A measured rate is differentiated once less.
    order = 2 - len(signals)
    rate_noise, faster = (series[-1].derivative_noise(frequency, order + more) for more in (0, 1))
    return _Found(
        frequency, start, edges, (angle, rate, acceleration), (first, second, third), (rate_noise, faster), series,
        float(bases[0].angular[-1]) / (2 * np.pi), noises[0],
    )  # fmt: skip


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


def _fitted_series(
    signal: Array, time: Array, sample_rate: float, frequency: float, bandwidth: float | None
) -> tuple[HarmonicBasis, Harmonics, float]:
    """Return the harmonics of a channel that exceed its noise, and the RMS of single samples about all of them."""
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
    return full.take(keep), Harmonics(orders[keep], standard_error[keep]), noise


def cut_blocks(periods: int, per: float, n: int) -> Integers:
    """Return sample indices that cut the record into at most eight blocks of whole periods."""
    blocks = min(REPLICATES, periods)
    edges = np.round(np.round(np.linspace(0, periods, blocks + 1)) * per).astype(np.intp)
    edges[-1] = n
    return edges


def _moved_law(inputs: Mapping[str, Array], angle: Array, rate: Array) -> tuple[Array, ...]:
    """Return what inputs that move within a run add to the moment: its elastic, viscous and dry parts in proportion."""
    parts = (np.ones(angle.size), angle, rate, np.sign(rate))
    return tuple(values * part for values in inputs.values() if np.ptp(values) > 0 for part in parts)


def repeat_noise(
    moment: Array,
    sample_rate: float,
    frequency: float,
    where: Booleans,
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
