"""Force states of a run that does not repeat: one smoothing kernel and its derivatives, or differences along a path."""

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.limits import STATES
from sindyjoint.measurement import WIDEST, channel_noise
from sindyjoint.measurement.runs import white_noise
from sindyjoint.numeric import Array, Booleans, Integers, convolve, filtered_inputs, smoothing_kernels
from sindyjoint.record import Run
from sindyjoint.states.record import ForceStates, NoiseFloor, moving_mask, rate_limit, within

BLOCKS = 32


def dwells(rate: Array) -> bool:
    """Return whether the joint sticks at zero rate instead of passing through it.

    Passing at a constant acceleration it spends a third as long within 5 % of the peak rate as within 15 %; a joint
    that sticks spends most of that time (0.5 to 0.9, measured on simulated joints).
    """
    peak = np.max(np.abs(rate))
    if peak == 0:
        return True
    slow = np.abs(rate) / peak
    return bool(np.count_nonzero(slow < 0.05) > STATES.dwelling * np.count_nonzero(slow < 0.15))


def _measure_reversal_spacing(rate: Array) -> float:
    """Return the median number of samples between sign changes of the rate that are not due to its noise."""
    strong = np.flatnonzero(np.abs(rate) > 0.05 * np.max(np.abs(rate)))
    sign = np.sign(rate[strong])
    change = strong[1:][sign[1:] != sign[:-1]]
    return float(np.median(np.diff(change))) if change.size > 1 else float(rate.size)


def broadband_states(run: Run, bandwidth: float | None = None, repeated: bool = False) -> ForceStates:
    """Return the force states of a run that does not repeat.

    Angle, rate and acceleration are convolutions of the measured angle (or, for the last two, of the measured
    rate) with one zero-phase kernel and its derivatives; the ends that the kernel does not cover are dropped.

    Parameters
    ----------
    run : Run
    bandwidth : float, optional
        Cut-off of the kernel, Hz. Default: where the angle falls to its noise, or a fifth above where it does not
        fade but ends there, so that the kernel passes its last lines.
    repeated : bool
        The run is one period of a motion that repeats: its end is followed by its beginning, and nothing is dropped.

    Raises
    ------
    InputError
        If the record is too short for the kernel.
    """
    cutoff, kernels = _kernels_for(run, bandwidth)
    low, first, _ = kernels
    edge = 0 if repeated else low.size // 2
    released = not repeated and _released(run)
    angle, rate, acceleration = _smooth_motion(run, kernels, repeated, released)
    sticks, noise = dwells(rate), _noise_floor(run, kernels)
    share, guard_periods = (
        (STATES.minor_share, STATES.periodic_guard)
        if sticks
        else (STATES.passing_rate_share, STATES.passing_guard)
    )
    slowest = rate_limit(rate, noise.rate, share)
    # Which way the joint is about to go is known from its first motion on.
    begin = int(np.argmax(np.abs(rate) > slowest)) if released else edge
    if released:
        angle, rate, acceleration = angle[begin:], rate[begin:], acceleration[begin:]
    middle = slice(begin, run.n_samples - edge)
    guard = min(
        int(np.ceil(guard_periods * run.sample_rate / cutoff)),
        int(STATES.broadband_guard_limit * _measure_reversal_spacing(rate)),
    )
    moving = moving_mask(rate, slowest, guard)
    if run.valid is not None:
        # What the kernel weighs most reaches half a period of the cut-off to either side.
        reach = int(np.ceil(0.5 * run.sample_rate / cutoff))
        moving &= within(run.valid, reach)[middle]
    return ForceStates(
        run=run.name,
        frequency=run.frequency,
        level=run.level,
        sample_rate=run.sample_rate,
        time=run.time[middle],
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        moment=run.moment[middle],
        moving=moving,
        block=_blocks(moving, int(np.ceil(run.sample_rate / cutoff))),
        replicate=None,
        noise=noise,
        method="broadband",
        bandwidth=cutoff,
        dropped=middle.start / run.sample_rate,
        repeated=repeated,
        rate_measured=run.rate is not None,
        slowest=slowest,
        guard=guard,
        lead=None if repeated or released else _lead(run.angle, low, first),
        inputs=filtered_inputs(run.inputs, middle, cutoff, run.sample_rate, repeated),
        fusion=run.fusion,
    )


def _blocks(moving: Booleans, cell: int) -> Integers:
    """Return the block of each sample: equal times, or as many moving samples where one block would hold them all.

    No block of moving samples is shorter than the ``cell`` over which what the kernel passes of the noise is alike.
    """
    blocks = np.arange(moving.size) * BLOCKS // moving.size
    if np.unique(blocks[moving]).size < 2:
        count = int(moving.sum())
        most = int(np.clip(count // cell, 2, BLOCKS))
        blocks = np.minimum(np.cumsum(moving) * most // max(count, 1), most - 1)
    return blocks


def _kernels_for(run: Run, bandwidth: float | None) -> tuple[float, tuple[Array, Array, Array]]:
    """Return the cut-off of the smoothing kernels, Hz, and the kernels; a short record has a higher one."""
    end = channel_noise(run).end
    highest = bandwidth or end.cutoff
    cutoff = float(np.clip(highest, 1e-6, WIDEST * run.sample_rate))
    kernels = smoothing_kernels(cutoff, run.sample_rate)
    if run.n_samples < 4 * kernels[0].size:
        cutoff = min(WIDEST * run.sample_rate, 72 * run.sample_rate / run.n_samples)
        kernels = smoothing_kernels(cutoff, run.sample_rate)
        least = 3 * kernels[0].size
        if run.n_samples < least:
            raise InputError(
                f"{run.label}: {run.n_samples} samples are too few to differentiate; expected at least {least}"
            )
    return cutoff, kernels


def _released(run: Run) -> bool:
    """Return whether a free motion begins at rest, aside from where it ends.

    Its first tenth is a parabola's, or its first half a cubic's, where samples are few: damping bends it.
    """
    if np.ptp(run.moment) > 0 or run.rate is not None or run.valid is not None:
        return False
    away = run.angle - np.mean(run.angle[-run.n_samples // 8 :])
    # Samples in which a motion that is released leaves these parts of its height, at least.
    fewest = 6
    for part, degree in ((0.1, 2), (0.5, 3)):
        height = float(np.mean(away[:fewest])) if degree == 2 else float(away[0])
        gone = np.flatnonzero(np.abs(away - height) > part * abs(height))
        count = int(gone[0]) if gone.size else 0
        if count >= fewest:
            fit, covariance = np.polyfit(np.linspace(0, 1, count), away[:count], degree, cov=True)
            return bool(abs(fit[-2]) < max(0.005 * abs(height), 3 * np.sqrt(covariance[-2, -2])))
    return False


def _smooth_motion(
    run: Run, kernels: tuple[Array, Array, Array], repeated: bool, released: bool
) -> tuple[Array, Array, Array]:
    """Return angle, rate and acceleration of a run by convolution.

    What is released from rest is continued to before its start by its mirror image, which keeps its acceleration.
    """
    low, first, second = kernels
    half = low.size // 2

    def smooth(signal: Array, kernel: Array) -> Array:
        if repeated:
            signal = np.concatenate([signal[-half:], signal, signal[:half]])
        elif released:
            signal = np.concatenate([signal[half:0:-1], signal])
        return convolve(signal, kernel)

    angle = smooth(run.angle - run.angle[0], low) + run.angle[0]
    if run.rate is not None:
        return angle, smooth(run.rate, low), smooth(run.rate, first)
    # Centred first: a large offset times the kernel's rounding would show in the second derivative.
    centred = run.angle - np.mean(run.angle)
    return angle, smooth(centred, first), smooth(centred, second)


def _noise_floor(run: Run, kernels: tuple[Array, Array, Array]) -> NoiseFloor:
    """Return the noise of the moment and of what the kernels make of the angle's, or of the measured rate's."""
    of = channel_noise(run)
    if run.fusion is not None:
        # That of the sensors, weighed by frequency, after the kernels.
        size = max(run.n_samples, kernels[0].size)
        density = run.fusion.white_noise(np.fft.rfftfreq(size, 1 / run.sample_rate)[1:], run.sample_rate)
        responses = (np.ones(1), *(np.abs(np.fft.rfft(kernel, size))[1:] for kernel in kernels[1:]))
        angle, rate, acceleration = (
            float(np.sqrt(np.mean((density * response) ** 2))) for response in responses
        )
        return NoiseFloor(of.moment, angle, rate, acceleration, measured=of.moment_known)
    low, first, second = (float(np.linalg.norm(kernel)) for kernel in kernels)
    if run.rate is None:
        rate, acceleration = of.angle * first, of.angle * second
    else:
        rate, acceleration = of.rate * low, of.rate * first
    known = of.angle_known and of.rate_known
    return NoiseFloor(
        of.moment, of.angle, rate, acceleration, of.moment_known, motion_measured=known, source=of.source
    )


def _lead(angle: Array, low: Array, first: Array) -> tuple[Array, Array]:
    """Return angle and rate at the samples that the kernel does not cover at the start of a record.

    The record is continued to before its start by its reflection in its first point, which keeps its slope.
    """
    half = low.size // 2
    known = angle[: 3 * half] - angle[0]
    padded = np.concatenate([-known[half:0:-1], known])
    smooth, rate = (convolve(padded, kernel)[:half] for kernel in (low, first))
    return smooth + angle[0], rate


def path_states(run: Run) -> ForceStates:
    """Return the force states of a quasi-static run: in the place of time is the path, and the rate is ±1.

    Nothing accelerates. The noise of a sample is that of its neighbours on the same branch: errors of the angle are in
    it, through the slope.

    Parameters
    ----------
    run : Run
        Of which ``quasi_static`` is set: means of even steps of the path.
    """
    # A step without motion is the reversal, between the last sample of one branch and the first of the next.
    change = np.diff(run.angle)
    after, before = np.append(change, 0.0), np.append(0.0, change)
    rate = np.sign(np.where(after != 0.0, after, before))
    moving = rate != 0.0
    if run.valid is not None:
        moving &= run.valid
    scatter = run.noise.moment
    if scatter is None:
        branch = np.cumsum(np.diff(np.sign(rate), prepend=0.0) != 0)[moving]
        path = np.cumsum(np.abs(before))
        scatter = white_noise(run.moment[moving], path[moving] / np.mean(np.abs(change)), branch)
    return ForceStates(
        run=run.name,
        frequency=None,
        level=run.level,
        sample_rate=run.sample_rate,
        time=run.time,
        angle=run.angle,
        rate=rate,
        acceleration=np.zeros(run.n_samples),
        moment=run.moment,
        moving=moving,
        block=np.arange(run.n_samples) * BLOCKS // run.n_samples,
        replicate=None,
        noise=NoiseFloor(
            scatter,
            run.noise.angle or 0.0,
            0.0,
            0.0,
            source="spectrum" if run.noise.moment is None else "declared",
        ),
        method="path",
        bandwidth=WIDEST * run.sample_rate,
        dropped=0.0,
        inputs=run.inputs,
    )
