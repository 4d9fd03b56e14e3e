"""Small pieces of numerics that several folders need and none owns."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from math import comb
from typing import Any, Literal, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integers = NDArray[np.intp]
Booleans = NDArray[np.bool_]
Made = TypeVar("Made")
#: Where random numbers come from, as SPEC 7 of scientific Python has it: what ``numpy.random.default_rng`` takes.
RNG = int | Sequence[int] | np.random.SeedSequence | np.random.BitGenerator | np.random.Generator | None

#: Share below which a number is rounding beside another.
ROUNDING = 1e-9
#: Step of the differences by which slopes are taken, relative to what is varied.
DIFFERENCE = 1e-4
#: The same where a simulation, or an internal state, lies between.
COARSE_DIFFERENCE = 1e-3
#: Relative difference up to which two rates, or the ends of two iterations, are one.
SAME = 1e-6
#: Rows worked on at once, so that they stay in the cache.
BLOCK = 4096
#: Median of a squared normal deviate.
MEDIAN_SQUARE = 0.454936


def finite(value: float) -> float | None:
    """Return a number that JSON can hold, or None.

    Examples
    --------
    >>> finite(0.5), finite(float("nan"))
    (0.5, None)
    """
    return float(value) if np.isfinite(value) else None


def seed_of(rng: RNG) -> int:
    """Return one seed, for several uses that shall draw alike.

    Examples
    --------
    >>> seed_of(3), seed_of(np.random.default_rng(0)) == seed_of(np.random.default_rng(0))
    (3, True)
    """
    return rng if isinstance(rng, int) else int(np.random.default_rng(rng).integers(2**32))


def kept(function: Callable[..., Made]) -> Callable[..., Made]:
    """Keep what a function makes of its first argument as long as that is there, by the other ones.

    Neither what it makes nor the others may hold the first, or be what it was made of.
    """
    known: WeakKeyDictionary[Any, dict[tuple[Any, ...], Made]] = WeakKeyDictionary()

    @wraps(function)
    def once(of: Any, *others: Any, **named: Any) -> Made:
        made = known.setdefault(of, {})
        key = (*others, *named.items())
        if key not in made:
            made[key] = function(of, *others, **named)
        return made[key]

    return once


def rms(values: ArrayLike) -> float:
    """Root mean square; infinite for what has run away."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(np.square(np.asarray(values, dtype=np.float64)))))


def rising_zero(place: Array, values: Array, middle: float) -> float | None:
    """Return the place nearest to a middle where values rise through zero, between two of them; None where none does.

    Examples
    --------
    >>> place = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    >>> rising_zero(place, np.array([-1.0, 1.0, 0.5, -0.5, 0.5]), 0.2), rising_zero(place, -place, 0.0)
    (1.5, None)
    """
    rising = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
    zeros = place[rising] - values[rising] * np.diff(place)[rising] / np.diff(values)[rising]
    return float(zeros[np.argmin(np.abs(zeros - middle))]) if zeros.size else None


def chunks(count: int, size: int) -> Iterator[slice]:
    """Yield slices that cut ``count`` items into runs of ``size``; the last one may be shorter.

    Examples
    --------
    >>> list(chunks(5, 2))
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def norms_of(columns: Array) -> Array:
    """Return the norms of columns; one for a column of zeros."""
    norms = np.linalg.norm(columns, axis=0)
    return np.where(norms == 0, 1.0, norms)


def scaled_least_squares(columns: Array, target: Array, rcond: float | None = None) -> Array:
    """Return least-squares coefficients, solved with columns and target of unit norm.

    Columns of very different units then count alike in the decision what is singular; of several solutions the one of
    least norm in these units is returned, and a column of zeros gets no coefficient.

    Parameters
    ----------
    columns : ndarray, shape (n, p)
    target : ndarray, shape (n,)
    rcond : float, optional
        Least singular value relative to the largest. Default: that of :func:`numpy.linalg.lstsq`.

    Returns
    -------
    ndarray, shape (p,)
    """
    matrix = np.column_stack([columns, target])
    norms = norms_of(matrix)
    matrix = matrix / norms
    return np.linalg.lstsq(matrix[:, :-1], matrix[:, -1], rcond=rcond)[0] * norms[-1] / norms[:-1]


def partials(function: Callable[..., Array], at: Sequence[Array], share: float = 1e-6) -> list[Array]:
    """Return the derivatives of a function of samples by each of its arguments: central differences.

    Parameters
    ----------
    function : callable
    at : sequence of ndarray, shape (n,)
        Its arguments.
    share : float
        Step, of the largest value of an argument.

    Examples
    --------
    >>> [float(slope[0].round(6)) for slope in partials(lambda x, y: x * y, [np.array([2.0]), np.array([3.0])])]
    [3.0, 2.0]
    """
    found = []
    for place, values in enumerate(at):
        step = share * max(float(np.abs(values).max()), 1e-9)
        high, low = list(at), list(at)
        high[place], low[place] = values + step, values - step
        found.append((function(*high) - function(*low)) / (2 * step))
    return found


def line_spectrum(signal: ArrayLike) -> Array:
    """Return the amplitude spectrum of a signal less its mean, under Hann's window, shape (n // 2 + 1,)."""
    values = np.asarray(signal, dtype=np.float64)
    return np.abs(np.fft.rfft((values - values.mean()) * np.hanning(values.size)))


def without_line(segments: Array) -> Array:
    """Return segments less their least-squares line each, shape (..., n): Welch's ``detrend``.

    As ``"linear"`` is, which solves a least-squares problem for each segment in four times the time.
    """
    size = segments.shape[-1]
    place = np.arange(size) - (size - 1) / 2
    centred = segments - np.mean(segments, axis=-1, keepdims=True)
    slope = centred @ place / (place @ place)
    return np.asarray(centred - slope[..., None] * place)


def noise_by_differences(signal: ArrayLike, order: int) -> float:
    """Return the RMS of white noise on a signal that is slow beside its rate, steps and spikes apart.

    Differences of an order n hold C(2n, n) times the variance of white noise, and the less of a slow signal the larger
    n; their median absolute value ignores a few (1.4826 times it is σ for Gaussian noise).
    """
    differences = np.diff(np.asarray(signal, dtype=np.float64), order)
    return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(comb(2 * order, order)))


def main_frequency(signal: ArrayLike, sample_rate: float, between_bins: bool = False) -> float:
    """Return the frequency of the strongest line of a signal's spectrum, Hz, without zero frequency.

    Parameters
    ----------
    signal : array_like, shape (n,)
    sample_rate : float
        Hz.
    between_bins : bool
        Place the line between bins by a parabola through the logarithm of the three about it.
    """
    size, spectrum = np.size(signal), line_spectrum(signal)
    if not between_bins:
        return float((np.argmax(spectrum[1:]) + 1) * sample_rate / size)
    peak = int(np.argmax(spectrum[1:-1])) + 1
    before, middle, after = np.log(spectrum[peak - 1 : peak + 2] + np.finfo(float).tiny)
    curvature = before - 2 * middle + after
    shift = 0.5 * (before - after) / curvature if curvature < 0 else 0.0
    return float((peak + shift) * sample_rate / size)


def delayed(signal: Array, samples: float) -> Array:
    """Return a signal that comes so many samples later, by cubic splines; at its ends its first and last value goes on.

    All samples move by the same: with f the part of a sample, s(i − f) is a weighted sum of four spline coefficients,
    Σ_k β³(f + k) c(i + k), k = −2 … 1.
    """
    whole = int(np.floor(samples))
    part = samples - whole
    # Over twelve samples a cubic spline forgets how the signal went on.
    margin = 12 + abs(whole) + 2
    # (c(i − 1) + 4 c(i) + c(i + 1)) / 6 is the signal; at the ends the coefficients go on as in a mirror.
    held = 6 * np.pad(signal, margin, mode="edge")
    middle = np.full(held.size, 4.0)
    held[[0, -1]], middle[[0, -1]] = held[[0, -1]] / 2, 2.0
    coefficients = scipy.linalg.lapack.dptsv(middle, np.ones(held.size - 1), held)[2]
    weights = [
        (1 - part) ** 3,
        4 - 6 * part**2 + 3 * part**3,
        1 + 3 * part + 3 * part**2 - 3 * part**3,
        part**3,
    ]
    first = margin - whole + 1
    terms = (w / 6 * coefficients[first - k : first - k + signal.size] for k, w in enumerate(weights))
    return np.asarray(sum(terms))


def convolve(signal: Array, kernel: Array, mode: Literal["full", "valid"] = "valid") -> Array:
    """Return a convolution by Fourier transforms: at all samples, or where one lies within the other.

    As ``scipy.signal.fftconvolve``, with which all of SciPy's statistics is imported.
    """
    whole = signal.size + kernel.size - 1
    size = 1 << (whole - 1).bit_length()
    product = np.fft.irfft(np.fft.rfft(signal, size) * np.fft.rfft(kernel, size), size)[:whole]
    least, most = sorted((signal.size, kernel.size))
    return np.asarray(product if mode == "full" else product[least - 1 : most])


def analytic(signal: Array) -> Complex:
    """Return a signal with its Hilbert transform as imaginary part."""
    spectrum = np.fft.fft(signal)
    spectrum[1 : (signal.size + 1) // 2] *= 2
    spectrum[signal.size // 2 + 1 :] = 0
    return np.asarray(np.fft.ifft(spectrum))


def root_of(covariance: Array) -> Array:
    """Return L with L·Lᵀ a covariance of numbers of any sizes, worked out in units of their standard errors.

    Coefficients of 1e0 and 1e9 in one matrix would lose its small part.
    """
    errors = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(errors, errors)
    values, vectors = np.linalg.eigh((correlation + correlation.T) / 2)
    return np.asarray(errors[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def solve_factored(factors: tuple[Array, NDArray[np.int32]], right: Array) -> Array:
    """Return A⁻¹·b of the factors of A that :func:`scipy.linalg.lu_factor` gives, shape as b.

    LAPACK counts pivots from one, and SciPy's wrapper raises them in place while it solves, with other threads running:
    two solutions by the same factors at once write beyond their arrays. So each has pivots of its own.
    """
    return np.asarray(scipy.linalg.lu_solve((factors[0], factors[1].copy()), right, check_finite=False))


def smoothing_kernels(cutoff: float, sample_rate: float) -> tuple[Array, Array, Array]:
    """Return a low-pass kernel and its first and second time derivatives, sampled.

    The kernel is h(t) = 2f_c·sinc(2f_c·t)·exp(−t²/2σ²): its response is flat, falls to one half at f_c as an error
    function and has no ripple. Convolving with dh/dt gives the derivative of the smoothed signal, with no phase and
    none of the loss that finite differences have (3 % of the rate at a tenth of the sampling rate).

    Parameters
    ----------
    cutoff : float
        Frequency of half amplitude, Hz.
    sample_rate : float
        Hz.

    Returns
    -------
    tuple of three ndarray, shape (2h + 1,)
        To be convolved with; units 1, 1/s and 1/s².
    """
    # The response falls over a tenth of the cut-off, as a standard deviation.
    sigma = 1 / (2 * np.pi * 0.1 * cutoff)
    half = int(np.ceil(5 * sigma * sample_rate))
    t = np.arange(-half, half + 1) / sample_rate
    w = 2 * np.pi * cutoff
    safe = np.where(t == 0, 1.0, t)
    s0 = np.where(t == 0, w, np.sin(w * t) / safe) / np.pi
    s1 = np.where(t == 0, 0.0, (w * np.cos(w * t) - np.pi * s0) / safe) / np.pi
    s2 = np.where(t == 0, -(w**3) / 3, (-(w**2) * np.sin(w * t) - 2 * np.pi * s1) / safe) / np.pi
    g = np.exp(-(t**2) / (2 * sigma**2)) / sample_rate
    g1, g2 = -t / sigma**2 * g, (t**2 / sigma**2 - 1) / sigma**2 * g
    # What sampling and the cut at five sigmas leave over: a constant has no derivative, a line has no second one.
    low, first, second = s0 * g, s1 * g + s0 * g1, s2 * g + 2 * s1 * g1 + s0 * g2
    return low / low.sum(), first - first.mean(), second - second.mean()


def filtered_inputs(
    inputs: Mapping[str, Array], kept: slice, cutoff: float, sample_rate: float, repeated: bool = False
) -> dict[str, Array]:
    """Return the inputs of a run at the samples that its states keep, low-passed as the angle is.

    A constant stays what it is. At the ends of the record the input goes on as it was, or comes back where the run is
    one period of what repeats.
    """
    found = {}
    for name, values in inputs.items():
        # Nearer to the sampling rate a kernel has too few samples to be one.
        if np.ptp(values) > 0 and cutoff < 0.4 * sample_rate:
            low = smoothing_kernels(cutoff, sample_rate)[0]
            half = min(low.size // 2, values.size - 1)
            low = low[low.size // 2 - half : low.size // 2 + half + 1]
            padded = np.pad(values - values[0], half, mode="wrap" if repeated else "edge")
            values = convolve(padded, low / low.sum()) + values[0]
        found[name] = values[kept]
    return found
