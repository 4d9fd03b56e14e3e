"""Runs whose excitation repeats though they are no sinusoid: the periods of a multisine are averaged into one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array, convolve
from sindyjoint.record import Run
from sindyjoint.states.policy import POLICY
from sindyjoint.states.record import ForceStates


def repetition(run: Run) -> int | None:
    """Return the number of samples after which a run repeats itself, or None where it does not.

    The shortest lag at which angle and moment both come back within 15 % of their RMS, for at least three periods,
    and no farther away with each of them. Only whole numbers of samples are found, as signal generators make them.

    Parameters
    ----------
    run : Run
    """
    late = run.n_samples // POLICY.fewest_repetitions
    if late < POLICY.shortest_repetition:
        return None
    angle, moment = (signal - np.mean(signal) for signal in (run.angle, run.moment))
    if not np.any(moment) or not np.any(angle):
        return None
    likeness = np.minimum(_autocorrelation(angle), _autocorrelation(moment))
    near = likeness[POLICY.shortest_repetition : late + 1]
    passing = np.flatnonzero(near > 1 - POLICY.same_segment**2)
    if not passing.size:
        return None
    top = int(passing[0])
    while top + 1 < near.size and near[top + 1] > near[top]:
        top += 1
    lag = POLICY.shortest_repetition + top
    alike = all(
        np.std(late_part[lag:] - late_part[:-lag]) <= POLICY.same_segment * np.sqrt(2) * np.std(late_part)
        for late_part in (angle[run.n_samples // 4 :], moment[run.n_samples // 4 :])
    )
    if not alike or _departs(angle, lag) or _departs(moment, lag):
        return None
    wasted = run.n_samples % lag
    return lag if wasted <= POLICY.most_wasted * run.n_samples else None


def _departs(signal: Array, lag: int) -> bool:
    """Return whether a signal is farther away after two periods than after one: it only nearly repeats.

    What repeats differs by its noise, as much after two periods as after one. Lines whose frequencies have no common
    period differ by a growing phase, twice as much; their mean period does not close, and holds no noise.
    """
    late = signal[max(signal.size // 4, signal.size - 3 * lag) :]
    first, second, third = late[: -2 * lag], late[lag:-lag], late[2 * lag :]
    one = float(np.sqrt(np.mean((second - first) ** 2 + (third - second) ** 2) / 2))
    two = float(np.sqrt(np.mean((third - first) ** 2)))
    return two > max(POLICY.departing * one, POLICY.departing_share * float(np.std(signal)))


def mean_period(run: Run, period: int) -> tuple[Run, int]:
    """Return one mean period of a run that repeats, and the first sample of the periods that it is the mean of.

    A first period that differs more from the others than these differ among themselves is left out.

    Parameters
    ----------
    run : Run
    period : int
        Samples.
    """
    count = run.n_samples // period
    stacks = {
        name: getattr(run, name)[: count * period].reshape(count, period)
        for name in ("angle", "moment", "rate")
        if getattr(run, name) is not None
    }
    angle = stacks["angle"]
    away = np.sqrt(np.mean((angle[:-1] - angle[-1]) ** 2, axis=1))
    skipped = (
        1 if count > POLICY.fewest_repetitions - 1 and away[0] > POLICY.transient * np.median(away[1:]) else 0
    )
    valid: NDArray[np.bool_] | None = None
    if run.valid is None:
        mean = {name: stack[skipped:].mean(axis=0) for name, stack in stacks.items()}
    else:
        weight = run.valid[: count * period].reshape(count, period)[skipped:].astype(float)
        valid = np.asarray(weight.any(axis=0))
        # An instant that is valid in no period keeps what was interpolated.
        weight[:, ~valid] = 1.0
        mean = {name: np.average(stack[skipped:], axis=0, weights=weight) for name, stack in stacks.items()}
    # An input that changes from period to period is no part of what repeats: its mean over them is.
    inputs = {
        name: values[: count * period].reshape(count, period)[skipped:].mean(axis=0)
        for name, values in run.inputs.items()
    }
    fewer = 1 / float(np.sqrt(count - skipped))
    noise, fusion = run.noise.scaled(fewer), run.fusion and run.fusion.scaled(fewer)
    found = replace(run, source=None, noise=noise, valid=valid, inputs=inputs, fusion=fusion, **mean)
    return found, skipped * period


def mean_slope(signal: Array, sample_rate: float, states: ForceStates) -> tuple[float, float, float, float]:
    """Return slope per RMS, its standard error, the duration and the slope itself, from means of whole periods."""
    assert states.frequency is not None
    start = int(round(states.dropped * sample_rate))
    part = signal[start : start + states.n_samples]
    edges = np.round(np.arange(0, part.size + 1, sample_rate / states.frequency)).astype(int)
    edges = edges[edges <= part.size]
    means = np.add.reduceat(part[: edges[-1]], edges[:-1]) / np.diff(edges)
    if means.size < 4:
        return 0.0, np.inf, 0.0, 0.0
    time = (edges[:-1] + edges[1:]) / 2 / sample_rate
    centred = time - time.mean()
    spread = centred @ centred
    slope = float(centred @ means / spread)
    residual = means - means.mean() - slope * centred
    error = float(np.sqrt(residual @ residual / max(means.size - 2, 1) / spread)) + 1e-12 * float(
        np.std(part)
    )
    rms = float(np.std(part))
    return slope / rms, error / rms, part.size / sample_rate, slope


def _autocorrelation(signal: Array) -> Array:
    """Return the normalised correlation of a signal with itself at every lag, each over the samples that overlap."""
    n = signal.size
    product = convolve(signal, signal[::-1], mode="full")[n - 1 :]
    square = np.cumsum(signal**2)
    head, tail = square[::-1], square[-1] - np.concatenate([[0.0], square[:-1]])
    return product / np.maximum(np.sqrt(head * tail), 1e-300)
