"""The time axis: is it uniform, what is its rate, how a channel is moved along it, which frequency it holds."""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.units import COUNTS
from sindyjoint.numeric import Array, line_spectrum
from sindyjoint.policy import SHARED
from sindyjoint.record import MINIMUM_SAMPLES, Motion

IRREGULARITY = 0.01
# Across a longer gap, in sampling steps, interpolation would invent data.
LONGEST_GAP = 5.0
# Half the length of the delay filter, in samples, and its Kaiser window: together flat within 2e-6 up to 0.43
# of the sampling rate (Kaiser 1974: transition width (A − 8) / 2.285 / length, with A = 120 dB).
HALF_LENGTH = 32
KAISER_BETA = 12.0
# A line stands out of its surroundings; white noise does so in 1 of 200 runs of 3 periods, 1 of 3000 of 25.
CONTRAST = 6.0
# Of a run whose courses are compared.
PARTS = 6


def check_order(time: Array, where: str, row: Callable[[int], str]) -> None:
    """Refuse time stamps that run backwards or stand still.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time stamps, s.
    where : str
        File and column, for the message.
    row : callable
        Names the sample of an index.

    Raises
    ------
    InputError
        Naming the first row at fault.
    """
    if time.size < 2:
        raise InputError(f"{where}: {time.size} time stamp(s); expected a record")
    steps = np.diff(time)
    for bad, what in ((steps < 0, "time runs backwards"), (steps == 0, "duplicate time stamp")):
        faults = np.flatnonzero(bad)
        if faults.size:
            at = int(faults[0]) + 1
            raise InputError(
                f"{where}: {what} in {row(at)} ({time[at]:.9g} s after {time[at - 1]:.9g} s); "
                "repair the stamps, or declare [channels] rate instead of time"
            )


def uniform_rate(time: Array, where: str, row: Callable[[int], str]) -> float:
    """Return the sampling rate of uniform time stamps, Hz.

    Uniform means that every step is within 1 % of the median step, or that the stamps are a uniform grid
    rounded to their printed digits.

    Raises
    ------
    InputError
        Naming the row with the largest irregularity, and offering to resample.
    """
    steps = np.diff(time)
    index = np.arange(time.size)
    slope, start = np.polyfit(index, time, 1)
    off_grid = np.abs(time - (start + slope * index))
    deviation = np.abs(steps / np.median(steps) - 1)
    even = deviation.max() <= IRREGULARITY and off_grid.max() <= slope
    # A rounded stamp is off by half a digit; the fitted line may add as much on a short record. Digits as
    # coarse as the step cannot distinguish rounding from a lost sample.
    digit = _resolution(time)
    rounded = digit <= 0.25 * slope and off_grid.max() <= digit
    if not (even or rounded):
        worst, limit = (deviation, IRREGULARITY) if deviation.max() > IRREGULARITY else (off_grid[1:], 0.0)
        # One displaced stamp spoils the steps on both of its sides alike: name the first of them.
        at = int(np.argmax(worst > max(limit, 0.999 * worst.max()))) + 1
        raise InputError(
            f"{where}: sampling is irregular beyond 1 %, most in {row(at)} (step {steps[at - 1]:.6g} s, "
            f"median {np.median(steps):.6g} s); set [channels] resample = true, or declare rate"
        )
    # Nine digits: as fine as printed stamps are.
    return float(f"{1 / slope if rounded else (time.size - 1) / (time[-1] - time[0]):.9g}")


def with_lost_samples(
    time: Array, signals: dict[str, Array]
) -> tuple[dict[str, Array], float, NDArray[np.bool_]] | None:
    """Return the samples on the whole grid of a recorder that lost some: its stamps go on, by whole steps.

    Straight lines run across what is missing.

    Returns
    -------
    signals : dict of ndarray, shape (m,)
    rate : float
        Hz.
    present : ndarray of bool, shape (m,)
        False at samples that were lost. ``None`` where the stamps are on no grid, most of it is missing, or nothing.
    """
    steps = np.diff(time)
    if not steps.size or np.any(steps <= 0):
        return None
    places = np.concatenate([[0], np.cumsum(np.round(steps / np.median(steps)))]).astype(np.int64)
    if np.any(np.diff(places) < 1) or places[-1] + 1 > 2 * time.size or places[-1] + 1 == time.size:
        return None
    slope, start = np.polyfit(places, time, 1)
    digit = _resolution(time)
    off_grid = float(np.abs(time - (start + slope * places)).max())
    if off_grid > max(IRREGULARITY * slope, digit if digit <= 0.25 * slope else 0.0):
        return None
    grid = np.arange(places[-1] + 1)
    present = np.zeros(grid.size, dtype=bool)
    present[places] = True
    filled = {name: np.interp(grid, places, values) for name, values in signals.items()}
    return filled, float(f"{1 / slope:.9g}"), present


def bridged(values: Array) -> Array:
    """Return values with straight lines across those that are no numbers."""
    at, present = np.arange(values.size), np.isfinite(values)
    return values if present.all() else np.interp(at, at[present], values[present])


def on_clock(time: Array, own: Array, values: Array, where: str, row: Callable[[int], str]) -> Array:
    """Return values that were sampled on a clock of their own at the instants of another one, by cubic splines.

    Parameters
    ----------
    time : ndarray, shape (n,)
    own : ndarray, shape (m,)
        Instants of the values, in the same unit.
    values : ndarray, shape (m,)
    where, row
        As of :func:`check_order`.

    Returns
    -------
    ndarray, shape (n,)
        NaN where there are no values.

    Raises
    ------
    InputError
        For a clock that runs backwards, and where the two have hardly a time in common.
    """
    if own.size == time.size and np.abs(own - time).max() <= IRREGULARITY * np.median(np.diff(time)):
        return values
    own = bridged(own)
    check_order(own, where, row)
    slack = IRREGULARITY * np.median(np.diff(own))
    known = np.interp(time, own, np.isfinite(values)) > 1 - IRREGULARITY
    inside = known & (time > own[0] - slack) & (time < own[-1] + slack)
    if np.count_nonzero(inside) < MINIMUM_SAMPLES:
        raise InputError(
            f"{where}: runs from {own[0]:g} to {own[-1]:g} and that of the other channels from {time[0]:g} to "
            f"{time[-1]:g}: set both clocks to one zero"
        )
    return np.where(inside, scipy.interpolate.CubicSpline(own, bridged(values))(time), np.nan)


def step_of(present: NDArray[np.bool_]) -> int:
    """Return by how many rows the samples of a slower channel lie apart, where they do evenly; else one.

    Examples
    --------
    >>> step_of(np.arange(80) % 2 == 1), step_of(np.arange(80) < 60)
    (2, 1)
    """
    steps = np.diff(np.flatnonzero(present))
    even = steps.size >= MINIMUM_SAMPLES and np.all(steps == steps[0])
    return int(steps[0]) if even else 1


def unwound(values: Array, unit: str, one: float = 0.0) -> Array:
    """Return a motion that does not leap by whole turns, as degrees from 0 to 360 do, or a counter that is full.

    Where they leap, their middle is put within half a turn of zero, so that runs that begin on either side agree.

    Parameters
    ----------
    values : ndarray, shape (n,)
    unit : str
        Counts are full at a power of two.
    one : float
        What one of the unit is, rad; zero where the motion has no turns.

    Examples
    --------
    >>> unwound(np.array([1.0, 0.0, 359.0, 358.0, 1.0]), "deg", np.pi / 180).tolist()
    [1.0, 0.0, -1.0, -2.0, 1.0]
    """
    turn = 2 * np.pi / abs(one) if one else 0.0
    if unit in COUNTS:
        turn = 2.0 ** np.ceil(np.log2(np.ptp(values) + 1))
    steps = np.diff(values) / turn if turn else np.empty(0)
    leaps = steps[np.abs(steps) > SHARED.mostly]
    # What is no whole turn is a spike.
    whole = np.all(np.abs(leaps - np.round(leaps)) < SHARED.minor_share)
    if not (leaps.size and whole):
        return values
    values = np.unwrap(values, period=turn)
    return np.asarray(values - turn * np.round(np.median(values) / turn))


def longest_part(present: NDArray[np.bool_], gap: int) -> slice:
    """Return the longest part of a record without a gap of so many samples, from its first to its last sample.

    Examples
    --------
    >>> longest_part(np.array([0, 1, 0, 0, 1, 1, 0, 1, 0], dtype=bool), 2)
    slice(4, 8, None)
    """
    known = np.flatnonzero(present)
    parts = np.split(known, np.flatnonzero(np.diff(known) > gap) + 1)
    longest = max(parts, key=len)
    return slice(int(longest[0]), int(longest[-1]) + 1)


def _resolution(time: Array) -> float:
    """Return the step between neighbouring values that the stamps could have taken, s."""
    for digits in range(10):
        scaled = time * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-6 * np.maximum(1.0, np.abs(scaled) * 1e-6)):
            return 10.0**-digits
    single = time.astype(np.float32)
    if np.array_equal(single, time):
        return float(np.spacing(np.abs(single).max()))
    return 0.0


def resampled(
    time: Array, signals: dict[str, Array], where: str, row: Callable[[int], str]
) -> tuple[dict[str, Array], float]:
    """Interpolate irregular samples by cubic splines onto a uniform grid of the median step.

    Returns
    -------
    signals : dict of ndarray, shape (m,)
    rate : float
        Hz.

    Raises
    ------
    InputError
        For a gap too long to be bridged.
    """
    steps = np.diff(time)
    step = float(np.median(steps))
    at = int(np.argmax(steps))
    if steps[at] > LONGEST_GAP * step:
        raise InputError(
            f"{where}: a gap of {steps[at]:.6g} s before {row(at + 1)} is too long to interpolate "
            f"(median step {step:.6g} s); make two runs of it"
        )
    grid = time[0] + step * np.arange(int(np.floor((time[-1] - time[0]) / step * (1 + 1e-12))) + 1)
    return {
        name: scipy.interpolate.CubicSpline(time, values)(grid) for name, values in signals.items()
    }, float(f"{1 / step:.9g}")


def advanced(signal: Array, samples: float) -> Array:
    """Return x(t + τ) on the instants of x(t), by a windowed-sinc fractional delay filter.

    Band-limited interpolation with a Kaiser window (Laakso et al. 1996, "Splitting the unit delay", Eq. 20).

    Parameters
    ----------
    signal : ndarray, shape (n,)
    samples : float
        τ in samples, of either sign.

    Returns
    -------
    ndarray, shape (n − 2·margin(samples),)
        The samples ``margin`` from either end, where the filter has all it needs.
    """
    whole = int(np.round(samples))
    taps = np.arange(-HALF_LENGTH, HALF_LENGTH + 1)
    distance = taps - (samples - whole)
    # The window is centred on the sinc, a fraction of a sample off the middle tap.
    shape = np.clip(1 - (distance / (HALF_LENGTH + 0.5)) ** 2, 0, None)
    kernel = np.sinc(distance) * np.i0(KAISER_BETA * np.sqrt(shape)) / np.i0(KAISER_BETA)
    kernel /= kernel.sum()
    lost = margin(samples)
    reach = signal[lost + whole - HALF_LENGTH : signal.size - lost + whole + HALF_LENGTH]
    return np.convolve(reach, kernel[::-1], mode="valid")


def margin(samples: float) -> int:
    """Return how many samples :func:`advanced` loses at either end."""
    return HALF_LENGTH + abs(int(np.round(samples)))


def decays(values: Array) -> bool:
    """Return whether a motion swings and dies out: its range falls from part to part, to half at least."""
    if values.size < MINIMUM_SAMPLES:
        return False
    ranges = np.array([np.ptp(part) for part in np.array_split(values, PARTS)])
    middle, early = values[-values.size // PARTS :].mean(), values[: values.size // 2]
    # What moves to a stop falls likewise, and does not swing about it.
    swings = np.count_nonzero(np.diff(np.sign(early - middle))) >= SHARED.fewest
    # What has died out goes on in noise: the last parts may grow by as little as that.
    return bool(swings and np.all(np.diff(ranges) <= ranges[0] / 50) and ranges[-1] < ranges[0] / 2)


def check_frequency(
    angle: Array,
    moment: Array | None,
    rate: float,
    frequency: float,
    where: str,
    motion: Motion = "rotation",
) -> None:
    """Refuse a declared frequency that the data do not hold.

    The frequency is there when its line stands out of its surroundings and is no mere harmonic: at least a
    quarter of the largest line of the angle, or half of the largest of the moment (a joint that sticks shows
    it in the moment only).

    Parameters
    ----------
    angle : ndarray, shape (n,)
    moment : ndarray, shape (n,), or None
        None for a declared constant.
    rate : float
        Sampling rate, Hz.
    frequency : float
        Declared, Hz.
    where : str
        File, for the message.
    motion : {"rotation", "translation"}
        Names the channel in the message.

    Raises
    ------
    InputError
        Naming the largest line that is there instead.
    """
    if angle.size * frequency / rate < SHARED.fewest:
        return
    share, contrast, largest = _measure_line(angle, rate, frequency)
    # A harmonic of the true frequency stays below these parts of the largest line: a square wave's third has 1/3.
    if share >= 0.25 and contrast >= CONTRAST:
        return
    if moment is not None:
        share, contrast, _ = _measure_line(moment, rate, frequency)
        if share >= 0.5 and contrast >= CONTRAST:
            return
    channel = "angle" if motion == "rotation" else "displacement"
    raise InputError(
        f"{where}: the declared frequency {frequency:g} Hz is absent from the data; the largest line of the "
        f"{channel} is at {largest:.3g} Hz; correct frequency, or leave it out for an aperiodic run"
    )


def without_drift(signal: Array, degree: int) -> Array:
    """Return a signal without a polynomial: slow drift is no line, and no excitation."""
    abscissa = np.linspace(-1, 1, signal.size)
    return np.asarray(signal - np.polyval(np.polyfit(abscissa, signal, degree), abscissa))


def _measure_line(signal: Array, rate: float, frequency: float) -> tuple[float, float, float]:
    """Return the line's share of the largest line, its contrast, and the largest line's frequency, Hz."""
    n = signal.size
    amplitude = line_spectrum(without_drift(signal, 3))
    frequencies = np.fft.rfftfreq(n, 1 / rate)
    lines = np.where(frequencies >= 2 * rate / n, amplitude, 0.0)
    tolerance = max(2 * rate / n, 0.02 * frequency)
    distance = np.abs(frequencies - frequency)
    height = float(lines[distance <= tolerance].max(initial=0.0))
    # Far enough to leave the main lobe, near enough to see the same noise.
    around = amplitude[(distance > 2 * tolerance) & (distance <= max(frequency / 2, 8 * rate / n))]
    floor = float(np.median(around)) if around.size else 0.0
    largest = int(np.argmax(lines))
    tall = float(lines[largest])
    return (
        height / tall if tall > 0 else 0.0,
        height / floor if floor > 0 else np.inf,
        float(frequencies[largest]),
    )
