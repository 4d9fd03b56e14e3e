"""Excitations, moments, forces or angles as functions of time, and what drives a joint in a test.

Every excitation is a piecewise cubic on a uniform grid, so a measured noisy moment and a pure tone go through
the same few multiplications of the compiled integrators.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import comb, inf
from typing import Literal, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError, UnknownNameError, refuse
from sindyjoint.numeric import Array

Interpolation = Literal["cubic", "linear", "hold"]

#: Pieces per period of a pure tone: the spline is then within 1e-8 of the sine.
TONE_PIECES = 256


@dataclass(frozen=True, eq=False)
class Excitation:
    """A piecewise cubic function of time, from time zero.

    Parameters
    ----------
    pieces : ndarray, shape (n, 4)
        Coefficients of 1, u, u², u³ in each piece, u running from 0 to 1.
    step : float
        Length of a piece, s.
    periodic : bool
        Whether the pieces repeat; otherwise the value stays that of the last piece's end.
    smooth : bool
        Whether the slope is continuous over the joints of the pieces; integrators stop there when it is not.
    scale : float
        Factor on the whole.
    ramp : float
        The whole is faded in over this time, s, with the smooth step r²(3 − 2r).
    """

    pieces: Array
    step: float
    periodic: bool = False
    smooth: bool = True
    scale: float = 1.0
    ramp: float = 0.0

    def __call__(self, time: ArrayLike) -> Array:
        """Return the value at the times, s."""
        return self.derivative(time, 0)

    @cached_property
    def integrated(self) -> tuple[Array, Array, float]:
        """The pieces at their scale, the integral up to the beginning of each, and their length."""
        c = self.pieces * self.scale
        whole = np.concatenate([[0.0], np.cumsum(c @ [1, 1 / 2, 1 / 3, 1 / 4])]) * self.step
        return c, whole, float(self.step)

    def derivative(self, time: ArrayLike, order: int = 1) -> Array:
        """Return the value (order 0), first or second derivative at the times, ramp included."""
        t = np.asarray(time, dtype=np.float64)
        u = t / self.step
        if self.periodic:
            u = np.mod(u, len(self.pieces))
        piece = np.clip(np.floor(u), 0, len(self.pieces) - 1).astype(int)
        inside = self.periodic | (u <= len(self.pieces))
        u = np.minimum(u - piece, 1.0)
        c0, c1, c2, c3 = np.moveaxis(self.pieces[piece], -1, 0) * self.scale
        values = [
            c0 + u * (c1 + u * (c2 + u * c3)),
            inside * (c1 + u * (2 * c2 + 3 * u * c3)) / self.step,
            inside * (2 * c2 + 6 * u * c3) / self.step**2,
        ]
        if not self.ramp:
            return values[order]
        r = np.clip(t / self.ramp, 0, 1)
        fade = [r * r * (3 - 2 * r), 6 * r * (1 - r) / self.ramp, (r < 1) * (6 - 12 * r) / self.ramp**2]
        return np.asarray(sum(comb(order, k) * values[order - k] * fade[k] for k in range(order + 1)))

    def mean(self, start: ArrayLike, stop: ArrayLike) -> Array:
        """Return the exact mean over each time from `start` to `stop`, for an excitation without ramp or period."""
        if self.periodic or self.ramp:
            raise InputError(
                "means are known of excitations without a period and without a ramp; sample it first"
            )
        c, whole, _ = self.integrated
        last = c[-1].sum()

        def integral(t: ArrayLike) -> Array:
            u = np.maximum(np.asarray(t, dtype=np.float64) / self.step, 0.0)
            piece = np.minimum(np.floor(u), len(c) - 1).astype(int)
            r = np.minimum(u - piece, 1.0)
            c0, c1, c2, c3 = np.moveaxis(c[piece], -1, 0)
            part = r * (c0 + r * (c1 / 2 + r * (c2 / 3 + r * c3 / 4))) * self.step
            return whole[piece] + part + last * np.maximum(u - len(c), 0.0) * self.step

        return (integral(stop) - integral(start)) / (np.asarray(stop) - np.asarray(start))

    def scaled(self, factor: float) -> Self:
        """Return the same excitation times a factor."""
        return replace(self, scale=self.scale * factor)


def _check_positive(**values: float) -> None:
    refuse((not 0 < v < inf, f"{name} is {v!r}; expected a positive number") for name, v in values.items())


def _spline_pieces(values: Array, periodic: bool) -> Array:
    """Return the pieces of the C² spline through values at distance one, periodic or with no knot beside the ends.

    Its slopes are those with d(i − 1) + 4 d(i) + d(i + 1) = 3 (y(i + 1) − y(i − 1)).
    """
    if periodic:
        once = values[:-1]
        right = 3 * (np.roll(once, -1) - np.roll(once, 1))
        factor = 4 + 2 * np.cos(2 * np.pi * np.arange(once.size // 2 + 1) / once.size)
        slopes = np.fft.irfft(np.fft.rfft(right) / factor, once.size)
        return _hermite_pieces(values, np.append(slopes, slopes[0]))
    right = np.empty(values.size)
    right[1:-1] = 3 * (values[2:] - values[:-2])
    right[0] = (4 * values[1] + values[2] - 5 * values[0]) / 2
    right[-1] = (5 * values[-1] - 4 * values[-2] - values[-3]) / 2
    lower, middle, upper = np.ones(values.size - 1), np.full(values.size, 4.0), np.ones(values.size - 1)
    middle[[0, -1]], upper[0], lower[-1] = 1.0, 2.0, 2.0
    return _hermite_pieces(values, scipy.linalg.lapack.dgtsv(lower, middle, upper, right)[3])


def _hermite_pieces(y: Array, d: Array) -> Array:
    """Return the cubics of values and slopes at distance one, shape (n - 1, 4)."""
    rise = y[1:] - y[:-1]
    return np.stack([y[:-1], d[:-1], 3 * rise - 2 * d[:-1] - d[1:], d[:-1] + d[1:] - 2 * rise], axis=1)


def harmonic(amplitude: float, frequency: float, phase: float = 0.0) -> Excitation:
    """Return amplitude · sin(2π·frequency·t + phase).

    Parameters
    ----------
    amplitude : float
        N·m, N, rad or m.
    frequency : float
        Hz.
    phase : float
        rad.

    Raises
    ------
    InputError
        When the frequency is not positive or the amplitude not finite.
    """
    _check_positive(frequency=frequency)
    if not np.isfinite(amplitude):
        raise InputError(f"amplitude is {amplitude!r}; expected a finite number")
    # Hermite pieces with the exact slopes: no spline to solve, and continuous slope.
    w = 2 * np.pi / TONE_PIECES
    angles = phase + w * np.arange(TONE_PIECES + 1)
    pieces = _hermite_pieces(np.sin(angles), w * np.cos(angles))
    return Excitation(pieces, 1 / (frequency * TONE_PIECES), periodic=True, scale=float(amplitude))


def _in_a_row(values: ArrayLike, what: str) -> Array:
    y = np.asarray(values, dtype=np.float64)
    if y.ndim != 1 or y.size < 4 or not np.all(np.isfinite(y)):
        raise InputError(f"{what} of shape {y.shape}; expected at least four finite values in a row")
    return y


def sampled(values: ArrayLike, sample_rate: float, interpolation: Interpolation = "cubic") -> Excitation:
    """Return an excitation through samples, for instance a measured noisy moment.

    Parameters
    ----------
    values : array_like, shape (n,)
    sample_rate : float
        Hz.
    interpolation : {"cubic", "linear", "hold"}
        A C² spline, straight lines, or steps.

    Raises
    ------
    InputError
        For fewer than four samples, values that are not finite or an unknown interpolation.
    """
    y = _in_a_row(values, "sampled excitation")
    _check_positive(sample_rate=sample_rate)
    zero = np.zeros(y.size - 1)
    if interpolation == "cubic":
        pieces = _spline_pieces(y, periodic=False)
    elif interpolation == "linear":
        pieces = np.stack([y[:-1], np.diff(y), zero, zero], axis=1)
    elif interpolation == "hold":
        pieces = np.stack([y, *[np.zeros(y.size)] * 3], axis=1)
    else:
        raise InputError(f"interpolation is {interpolation!r}; expected 'cubic', 'linear' or 'hold'")
    return Excitation(pieces, 1 / sample_rate, smooth=interpolation == "cubic")


def repeated(values: ArrayLike, period: float) -> Excitation:
    """Return the excitation that repeats one period, given at equal distances from its beginning.

    Parameters
    ----------
    values : array_like, shape (n,)
        A C² spline goes through them and from the last one to the first.
    period : float
        s.

    Raises
    ------
    InputError
        For fewer than four values, values that are not finite, or a period that is not positive.
    """
    y = _in_a_row(values, "one period")
    _check_positive(period=period)
    return Excitation(_spline_pieces(np.append(y, y[0]), periodic=True), period / y.size, periodic=True)


def pulse(
    amplitude: float, duration: float, shape: Literal["rectangular", "half-sine"] = "rectangular"
) -> Excitation:
    """Return a pulse that starts at time zero and is zero after `duration` seconds."""
    _check_positive(duration=duration)
    if shape == "rectangular":
        return Excitation(np.array([[1.0, 0, 0, 0], [0.0, 0, 0, 0]]), duration, smooth=False, scale=amplitude)
    if shape == "half-sine":
        half = harmonic(1.0, 1 / (2 * duration))
        pieces = np.vstack([half.pieces[: TONE_PIECES // 2], np.zeros((1, 4))])
        return Excitation(pieces, half.step, smooth=False, scale=amplitude)
    raise InputError(f"pulse shape is {shape!r}; expected 'rectangular' or 'half-sine'")


Drive = Literal["moment", "angle"]

SINE = "sine"
#: Waveforms by the amplitudes of sin(n·2πft); all are scaled to their peak.
TONES: dict[str, dict[int, float]] = {
    SINE: {1: 1.0},
    "two-tone-3": {1: 1.0, 3: 0.8},
    "two-tone-5": {1: 1.0, 5: 0.5},
    "triangle": {n: (-1.0) ** (n // 2) / n**2 for n in (1, 3, 5, 7, 9)},
    # The signs with the lowest peak.
    "multisine": {1: 1.0, 2: 1.0, 3: 1.0, 4: -1.0, 5: 1.0},
    # A sine whose frequency goes from f to 5f and back in each period, sin(3x − 2 sin x) with x = 2πft, as its series
    # of amplitudes J₃₋ₙ(2) − J₃₊ₙ(2) (Abramowitz and Stegun 9.1.42), to 2e-3 of its peak.
    "sweep": {1: 0.31884, 2: 0.56969, 3: 0.22269, 4: -0.5769, 5: 0.35281, 6: -0.12895, 7: 0.034, 8: -0.00704},
}  # fmt: skip
POINTS = 2520  # of a period through which the spline of a sum of tones goes


@dataclass(frozen=True)
class Actuator:
    """What drives the joint, and how far it can go.

    Parameters
    ----------
    drive : {"moment", "angle"}
        What it prescribes.
    band : (float, float)
        Hz.
    moment, angle, rate : float
        Largest moment (N·m), angle (rad) and rate (rad/s) on either side of zero.
    duration : float
        Of a run, s, where more is known of it than that it lasts as long as those that were made.
    """

    drive: Drive = "moment"
    band: tuple[float, float] = (2.0, 8.0)
    moment: float = inf
    angle: float = inf
    rate: float = inf
    duration: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.band
        limits = [(name, getattr(self, name)) for name in ("moment", "angle", "rate")]
        refuse(
            [
                (
                    self.drive not in ("moment", "angle"),
                    f"drive is {self.drive!r}; expected 'moment' or 'angle'",
                ),
                (
                    not 0 < low <= high < inf,
                    f"band is {low:g} to {high:g} Hz; expected two ascending positive frequencies",
                ),
                *(
                    (not v > 0, f"limit of the {name} is {v!r}; expected a positive number")
                    for name, v in limits
                ),
            ]
        )


def driven_at(waveform: str) -> tuple[float, float]:
    """Return the lowest and the highest frequency at which a waveform drives, as multiples of its own."""
    return float(min(TONES[waveform])), float(max(TONES[waveform]))


# The joints of a plan are driven alike, one after the other.
@lru_cache(maxsize=8)
def tones(waveform: str, level: float, frequency: float, phase: float = 0.0) -> Excitation:
    """Return a waveform of some peak, from ``phase`` (rad) of its cycle on.

    Raises
    ------
    UnknownNameError
        For a waveform that is not among :data:`TONES`.
    """
    if waveform == SINE:
        return harmonic(level, frequency, phase)
    if waveform not in TONES:
        raise UnknownNameError(f"waveform {waveform!r}; expected one of {', '.join(TONES)}")
    angle = phase + 2 * np.pi * np.arange(POINTS) / POINTS
    shape = sum(a * np.sin(n * angle) for n, a in TONES[waveform].items())
    return repeated(level / _peak(waveform) * np.asarray(shape), 1 / frequency)


@lru_cache
def _peak(waveform: str) -> float:
    phase = 2 * np.pi * np.arange(20 * POINTS) / (20 * POINTS)
    return float(np.max(np.abs(sum(a * np.sin(n * phase) for n, a in TONES[waveform].items()))))
