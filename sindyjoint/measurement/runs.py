"""Runs of what was measured: with an accelerometer among the sensors, or in order without time.

Quasi-static samples have an order and no time, and the path that the joint travels takes its place. A law without rate
answers to the angle, to the direction in which it moves and to where it has turned. With the travelled path s = ∫|dθ|
in the place of time the joint moves at unit speed, dθ/ds = ±1: hysteretic elements follow it as they follow a motion in
time, and sign(dθ/ds) is the side of the friction. Where the joint stands still the path does not grow, and there is no
sample.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError
from sindyjoint.inputs import signals_of
from sindyjoint.limits import MEASUREMENT
from sindyjoint.measurement.sensors import fuse
from sindyjoint.numeric import Array, Booleans, Integers
from sindyjoint.record import MEASURED_ANGLE, MEASURED_RATE, MINIMUM_SAMPLES, Run, checked_signal
from sindyjoint.rig import SensorNoise


def measured_run(name: str, signals: Mapping[str, ArrayLike], sample_rate: float, **options: Any) -> Run:
    """Return a run of moment, angle, rate and acceleration, as far as measured.

    With an acceleration the angle is that of all sensors of the motion.

    Parameters
    ----------
    name : str
    signals : mapping of str to array_like, shape (n,)
        ``"moment"``, N·m, and ``"angle"``, ``"rate"`` or ``"acceleration"``, rad, rad/s, rad/s².
    sample_rate : float
        Hz.
    **options
        Further fields of the run.

    Raises
    ------
    InputError
        For signals that cannot be used.
    """
    known: dict[str, Any] = {
        key: checked_signal(key, signals[key], name)
        for key in ("moment", "angle", "rate", "acceleration")
        if key in signals
    }
    if "acceleration" not in known:
        return Run(name, sample_rate=sample_rate, **known, **options)
    sizes = {key: values.size for key, values in known.items()}
    if len(set(sizes.values())) > 1 or min(sizes.values()) < MINIMUM_SAMPLES:
        listed = ", ".join(f"{key} has {size} samples" for key, size in sizes.items())
        raise InputError(
            f"run {name!r}: {listed}; expected equal lengths of at least {MINIMUM_SAMPLES} samples"
        )
    moment, angle, fusion = fuse(
        **known, sample_rate=sample_rate, frequency=options.get("frequency"), declared=options.get("noise")
    )
    return Run(name, moment, angle, sample_rate, fusion=fusion, **options)


def with_channels(run: Run, signals: Mapping[str, Any]) -> Run:
    """Return a run with other values of its ``channels``, the angle of several sensors fused anew."""
    if run.fusion is None:
        return replace(run, **signals)
    sensors = run.channels | dict(signals)
    moment, angle, fusion = fuse(
        sensors["moment"] + run.fusion.constant, sensors["acceleration"], run.sample_rate,
        sensors.get(MEASURED_ANGLE), sensors.get(MEASURED_RATE), run.frequency, run.noise,
    )  # fmt: skip
    return replace(run, moment=moment, angle=angle, fusion=fusion)


def travelled_run(
    name: str,
    moment: ArrayLike,
    angle: ArrayLike,
    inputs: Mapping[str, Any],
    noise: SensorNoise = SensorNoise(),
    **known: Any,
) -> Run:
    """Return a run of quasi-static samples, in their order, at even steps of the path that they travel.

    Parameters
    ----------
    name : str
    moment, angle : array_like, shape (n,)
    inputs : mapping of str to array_like, shape (n,), or float
    noise : SensorNoise
        Of single samples.
    **known
        Of :class:`Run`: level, use, ...

    Raises
    ------
    InputError
        For signals that cannot be used, and a joint that does not move.
    """
    moment, angle = checked_signal("moment", moment, name), checked_signal("angle", angle, name)
    if moment.size != angle.size or angle.size < MINIMUM_SAMPLES:
        raise InputError(
            f"run {name!r}: {moment.size} moments and {angle.size} angles; expected equal lengths, at least "
            f"{MINIMUM_SAMPLES}"
        )
    try:
        path = along_path(moment, angle, signals_of(name, inputs, angle.size))
    except InputError as error:
        raise InputError(f"run {name!r}: {error}") from error
    return Run(
        name,
        path.moment,
        path.angle,
        1 / path.step,
        valid=path.valid,
        noise=noise.scaled(path.averaged**-0.5),
        inputs=path.inputs,
        quasi_static=True,
        **known,
    )


@dataclass(frozen=True, eq=False)
class Path:
    """Mean samples of even steps of the travelled path.

    Parameters
    ----------
    step : float
        rad (m).
    angle, moment : ndarray, shape (n,)
        Mean angle of the samples of each step, or its middle where ``valid`` is false, rad (m), and moment there, N·m
        (N).
    valid : ndarray of bool, shape (n,)
        False where no sample is nearest, and at reversals.
    averaged : float
        Measured samples in one of these, on the average.
    inputs : mapping of str to ndarray, shape (n,)
    """

    step: float
    angle: Array
    moment: Array
    valid: Booleans
    averaged: float
    inputs: Mapping[str, Array] = field(default_factory=dict)


def white_noise(values: Array, place: Array | None = None, branch: Array | None = None) -> float:
    """Return the RMS of white noise on a slow signal, by its third differences.

    Zero where these are no noise, of which 77 % change sign from one to the next.

    Parameters
    ----------
    values : ndarray, shape (n,)
    place : ndarray, shape (n,), optional
        Of the samples, ascending, where they are not at even steps: differences are then divided ones.
    branch : ndarray, shape (n,), optional
        No difference is taken from one branch to the next.
    """
    x = sliding_window_view(np.arange(4) if place is None else place, 4)
    apart = x[:, :, None] - x[:, None, :] + np.eye(4)
    weight = 1 / apart.prod(axis=2)
    third = np.sum(weight * sliding_window_view(values, 4), axis=1) / np.linalg.norm(weight, axis=1)
    if branch is not None:
        third = third[branch[3:] == branch[:-3]]
    sign = np.sign(third[third != 0])
    if sign.size < 8 or np.mean(sign[1:] != sign[:-1]) < MEASUREMENT.noise_changes:
        return 0.0
    # Their median ignores a few steps and spikes; 1.4826 times it is σ for Gaussian noise.
    return float(1.4826 * np.median(np.abs(third)))


def reversals(angle: Array, threshold: float) -> Integers:
    """Return the samples at which a motion turns by more than a threshold, first and last sample among them.

    Parameters
    ----------
    angle : ndarray, shape (n,)
    threshold : float
        By how much the joint must come back before an extreme counts as one.
    """
    turns, low, high, direction = [0], 0, 0, 0
    for i, value in enumerate(angle.tolist()):
        if value > angle[high]:
            high = i
        if value < angle[low]:
            low = i
        if direction >= 0 and angle[high] - value > threshold:
            if direction > 0:
                turns.append(high)
            direction, low = -1, i
            high = i
        elif direction <= 0 and value - angle[low] > threshold:
            if direction < 0:
                turns.append(low)
            direction, high = 1, i
            low = i
    last = high if direction > 0 else low
    if direction and last > turns[-1]:
        turns.append(last)
    return np.array(turns, dtype=np.intp)


def travelled(angle: Array) -> tuple[Array, Array, Array]:
    """Return the travelled path at each sample of a motion, and its reversals: the path there, and the angle.

    Between reversals the angle is the monotone sequence nearest to the measured one (isotonic regression): noise does
    not count as travel.

    Raises
    ------
    InputError
        Where nothing moves.
    """
    steps, noise = np.abs(np.diff(angle)), white_noise(angle)
    threshold = max(
        MEASUREMENT.stands_out * noise, MEASUREMENT.clearly * float(steps[steps > 0].min(initial=np.inf))
    )
    turns = reversals(angle, threshold if np.isfinite(threshold) else 0.0)
    if turns.size < 2:
        raise InputError("the joint does not move beyond its noise; expected a path that it travels")
    angles = np.array([_turning_angle(angle, int(at), noise, at in (0, turns[-1])) for at in turns])
    corners = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angles)))])
    path = np.empty(turns[-1] + 1)
    for i, (start, stop) in enumerate(zip(turns[:-1], turns[1:], strict=True)):
        line = scipy.optimize.isotonic_regression(
            angle[start : stop + 1], increasing=bool(angles[i + 1] > angles[i])
        ).x
        path[start : stop + 1] = corners[i] + np.abs(np.clip(line, *sorted(angles[i : i + 2])) - angles[i])
    return path, corners, angles


def _turning_angle(angle: Array, at: int, noise: float, end: bool) -> float:
    """Return the angle of a reversal, or of an end of the record, by a parabola.

    It goes through the samples that noise does not separate from the extreme one, whose own value holds the noise.
    """
    far = np.abs(angle - angle[at]) > MEASUREMENT.stands_out * noise
    start = at - int(np.argmax(np.append(far[:at][::-1], True)))
    stop = at + int(np.argmax(np.append(far[at + 1 :], True))) + 1
    # A parabola through a reversal takes five samples.
    if stop - start < 5:
        return float(angle[at])
    curve = np.polynomial.Polynomial.fit(np.arange(start, stop), angle[start:stop], 2)
    if end:
        return float(curve(at))
    values = curve(np.arange(start, stop))
    return float(values.max() if angle[at] >= np.median(angle[start:stop]) else values.min())


def along_path(moment: ArrayLike, angle: ArrayLike, inputs: Mapping[str, ArrayLike] | None = None) -> Path:
    """Return the samples of a quasi-static run, averaged over even steps of the path that it travels.

    Each branch, from one reversal to the next, has a whole number of steps; a reversal is the last sample of one and
    the first of the next.

    Parameters
    ----------
    moment, angle : array_like, shape (n,)
        N·m and rad (N and m), in the order in which they were measured.
    inputs : mapping of str to array_like, shape (n,), or float
        Of the law.

    Raises
    ------
    InputError
        Where nothing moves, or samples are too few.
    """
    measured = np.asarray(angle, dtype=np.float64)
    path, corners, angles = travelled(measured)
    count = path.size
    # A path has 64 steps at least, where there are as many samples.
    # Two measured samples in a step on the average, unless there are too many.
    steps = int(np.clip(count // 2, min(count, 64), 20_000))
    grid, along, branch = _branches(corners, angles, float(path[-1]) / steps)
    found, members = np.unique(np.searchsorted((grid[1:] + grid[:-1]) / 2, path), return_inverse=True)
    size, number = np.bincount(members), np.arange(grid.size)

    def mean(values: ArrayLike) -> Array:
        """Return the mean of the samples nearest to each step; a straight line across steps without one."""
        own = np.bincount(members, np.asarray(values, dtype=np.float64)[:count]) / size
        return np.interp(number, found, own)

    first, last = (np.searchsorted(branch, branch, side=side) for side in ("left", "right"))
    # A row near a reversal holds samples of both branches, and a branch of less than three others has no curvature.
    inner = (number >= first + 2) & (number < last - 2) & (last - first >= 7)
    # The samples of a step lie about another place than its middle, and the law is not straight between them.
    off, step = mean(path - grid[found[members]]), float(path[-1]) / steps
    spread = mean((path - grid[found[members]]) ** 2) - off**2
    means, valid = mean(moment), np.isin(number, found) & inner
    bent = _curvatures((grid + off) / step, means, np.where(inner, branch, -1 - branch)) / step**2
    onwards = np.sign(np.diff(angles))[branch]
    return Path(
        step,
        along + np.where(valid, onwards * off, 0.0),
        means - 0.5 * bent * spread,
        valid,
        float(np.mean(size)),
        {name: mean(np.broadcast_to(values, measured.shape)) for name, values in (inputs or {}).items()},
    )


def _curvatures(place: Array, values: Array, branch: Integers) -> Array:
    """Return the curvature at each place of the parabola through the values about it on the same branch."""
    near = np.clip(np.arange(place.size)[:, None] + np.arange(-3, 4), 0, place.size - 1)
    away = place[near] - place[:, None]
    same = branch[near] == branch[:, None]
    powers = np.stack([np.ones_like(away), away, away**2], axis=2) * same[:, :, None]
    return 2 * np.asarray(
        np.einsum("nj,nj->n", np.linalg.pinv(powers, rcond=1e-6)[:, 2], same * values[near])
    )


def _branches(corners: Array, angles: Array, step: float) -> tuple[Array, Array, Integers]:
    """Return path and angle at the steps of all branches, and the number of the branch of each."""
    counts = np.maximum(np.rint(np.diff(corners) / step).astype(np.intp), 1) + 1

    def spaced(ends: Array) -> Array:
        each = zip(ends[:-1], ends[1:], counts, strict=True)
        return np.concatenate([np.linspace(low, high, n) for low, high, n in each])

    return spaced(corners), spaced(angles), np.repeat(np.arange(counts.size), counts)
