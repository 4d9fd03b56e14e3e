"""What sensors measured and how well: noise of a channel by its spectrum, differences or steps, or as declared."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from sindyjoint.hooks import fetched
from sindyjoint.limits import MEASUREMENT
from sindyjoint.numeric import ROUNDING, Array, kept, without_line
from sindyjoint.record import Run

__getattr__ = fetched(
    __name__,
    {
        "runs": "along_path measured_run reversals travelled white_noise with_channels",
        "sensors": "averaged disagreement fuse integrated_twice sensor_noise",
    },
)


# Widest kernel as a share of the sampling rate; with its roll-off it ends below half of it.
WIDEST = 0.38
# Where, below a signal's end, it is asked whether it was cut there.
JUST_BELOW = 0.9
# And, in parts of that end, where a filter that cuts there does not yet fall.
BEFORE = (0.5, 0.7)
SEGMENTS = 16


@dataclass(frozen=True)
class SignalEnd:
    """Where a signal ends in its spectrum, and the noise beyond.

    Parameters
    ----------
    bandwidth : float
        Hz, at most 0.38 of the sampling rate.
    noise : float
        RMS of white noise of the floor's density over the whole band, in the unit of the signal.
    abrupt : bool
        Whether the signal is far above its floor just below: it does not fade, but was cut there.
    flat : bool
        Whether the floor is one: it does not fall as the skirt of a filter or of the signal does.
    """

    bandwidth: float
    noise: float
    abrupt: bool
    flat: bool

    @property
    def cutoff(self) -> float:
        """Cut-off of a kernel for the signal, Hz: where it fades; or a fifth above where it was cut.

        A kernel falls from 0.8 to 1.2 of its cut-off, and must pass what is far above its floor just below its end, as
        a multisine's last line is.
        """
        return 1.2 * self.bandwidth if self.abrupt else self.bandwidth


def signal_end(
    signal: Array,
    sample_rate: float,
    noise: float | None = None,
    rising: Callable[[Array], Array] | None = None,
) -> SignalEnd:
    """Return the frequency at which a signal first falls to its noise floor, and that noise.

    The floor is the median spectral density over the top third of the band. Going up from the strongest line, the
    signal ends where the running median of its density falls below four times the floor; single lines above it
    (mains, a mode of the sensor) do not count. Beyond that frequency a derivative gains more noise than signal.

    Parameters
    ----------
    signal : ndarray, shape (n,)
    sample_rate : float
        Hz.
    noise : float, optional
        RMS of white noise, where the floor is known otherwise.
    rising : callable, optional
        Density of further noise over the frequency, as of what was differentiated.
    """
    segment = int(min(signal.size, max(256, signal.size // 24)))
    frequency, density = scipy.signal.welch(
        signal, sample_rate, window="blackmanharris", nperseg=segment, detrend=without_line
    )
    top = density[2 * density.size // 3 :]
    floor = float(np.median(top)) if noise is None else 2 * noise**2 / sample_rate
    smooth = scipy.ndimage.median_filter(density, max(5, density.size // 60) | 1, mode="nearest")
    peak = int(np.argmax(density))
    further = np.zeros_like(density) if rising is None else rising(frequency)
    sunk = np.flatnonzero((smooth <= MEASUREMENT.outstanding * (floor + further))[peak:])
    edge = float(frequency[peak + sunk[0]]) if sunk.size else float(frequency[-1])
    lowest = 8 * sample_rate / signal.size
    just_below = float(np.interp(JUST_BELOW * edge, frequency, smooth))
    return SignalEnd(
        bandwidth=float(np.clip(edge, lowest, WIDEST * sample_rate)),
        noise=float(np.sqrt(floor * sample_rate / 2)),
        abrupt=just_below > MEASUREMENT.cut_off_abruptly * floor,
        flat=_is_flat(signal, sample_rate, segment),
    )


def _is_flat(signal: Array, sample_rate: float, segment: int) -> bool:
    """Return whether the top third of a spectrum does not fall like a skirt.

    Of second differences, whose gain 2 − 2cos(2πf/f_s) is divided out: what a strong slow signal leaks through the
    window is level, too, and would be taken for a floor.
    """
    frequency, density = scipy.signal.welch(
        np.diff(signal, 2), sample_rate, window="blackmanharris", nperseg=min(segment, signal.size - 2)
    )
    top = slice(2 * density.size // 3, None)
    level = density[top] / (2 - 2 * np.cos(2 * np.pi * frequency[top] / sample_rate)) ** 2
    lower, upper = (float(np.median(half)) for half in np.array_split(level, 2))
    return lower <= MEASUREMENT.skirt * upper


def quantisation_step(signal: Array) -> float:
    """Return the step of which all differences between the values of a channel are multiples; zero without one."""
    steps = np.diff(np.unique(signal))
    steps = steps[steps > ROUNDING * np.max(np.abs(signal))]
    if not steps.size:
        return 0.0
    multiples = steps / steps.min()
    off = np.abs(multiples - np.round(multiples))
    # A difference may miss a multiple of the quantisation step by a fiftieth of it.
    return float(steps.min()) if np.quantile(off, 0.95) < 0.02 else 0.0


def difference_noise(signal: Array, lag: int = 1, order: int = 1) -> float:
    """Return the RMS of the white noise of a smooth signal with steps.

    Second differences of white noise have variance 6σ², at any lag, and second differences of these 70σ² (``order``
    2); their median absolute value ignores steps and turning points (1.4826·MAD is σ for Gaussian noise). Of a
    quantised signal each difference stands for all values within half a quantisation step.
    """
    differences = signal
    for _ in range(order):
        differences = differences[2 * lag :] - 2 * differences[lag:-lag] + differences[: -2 * lag]
    away = np.abs(differences - np.median(differences))
    step = quantisation_step(signal)
    middle = float(np.median(away))
    # Noise of eight quantisation steps is no longer coarse.
    if step > 0 and middle < 8 * step:
        count = np.bincount(np.minimum(np.round(away / step), 32).astype(int))
        share = np.append(0.0, np.cumsum(count) / away.size)
        middle = step * float(np.interp(0.5, share, np.append(0.0, np.arange(count.size) + 0.5)))
    return float(1.4826 * middle / np.sqrt(6.0 if order == 1 else 70.0))


def moment_noise(moment: Array, sample_rate: float, declared: float | None = None) -> tuple[float, bool]:
    """Return the RMS of the moment's noise, N·m, and whether it was measured.

    The smaller of two estimates, by differences and by the spectrum, and no less than quantisation, q/√12.
    Differences ignore friction steps but take a moment that changes from sample to sample for noise; the top of the
    spectrum ignores such a moment while it is band-limited, but holds the tail of friction steps. Either is measured
    where it is white: differences that grow with their lag are of the signal, a spectrum that falls is a skirt.

    Parameters
    ----------
    moment : ndarray, shape (n,)
        N·m.
    sample_rate : float
        Hz.
    declared : float, optional
        N·m; taken as it is.
    """
    if declared is not None:
        return declared, True
    if np.ptp(moment) == 0:
        return 0.0, True  # not a channel: the moment of a free decay
    end = signal_end(moment, sample_rate)
    by_differences = difference_noise(moment)
    noise = min(by_differences, end.noise)
    rounding = quantisation_step(moment) / np.sqrt(12.0)
    if rounding >= noise:
        return rounding, True
    white = difference_noise(moment, 2, 2) <= MEASUREMENT.clearly * difference_noise(moment, 1, 2)
    flat = end.flat and end.noise <= MEASUREMENT.contradicts * noise
    return noise, flat or (by_differences == noise and white)


def motion_noise(signal: Array, sample_rate: float, declared: float | None = None) -> tuple[float, bool]:
    """Return the RMS of the noise of an angle or a rate, in its unit, and whether it was measured.

    By the spectrum, and no less than quantisation; differences cannot separate noise from a smooth motion.
    """
    if declared is not None:
        return declared, True
    end = signal_end(signal, sample_rate)
    rounding = quantisation_step(signal) / np.sqrt(12.0)
    return (rounding, True) if rounding >= end.noise else (end.noise, end.flat)


def noise_before_filter(channel: Array, other: Array, sample_rate: float) -> float | None:
    """Return the RMS of a channel's noise where a filter cut it, over the whole band; None where none did.

    A signal that ends abruptly, as a multisine does at its last line, is in both channels up to its end. What is in one
    of them only is noise, or the tail of steps, and where it ends abruptly an anti-alias filter cut it: what lies
    beyond, if it is level, is the stop band of a Chebyshev or elliptic one, and no floor. The floor is the density
    before the filter begins to fall.
    """
    end = signal_end(channel, sample_rate)
    if not (end.abrupt and end.flat) or np.ptp(channel) == 0 or np.ptp(other) == 0:
        return None
    segment = int(np.clip(channel.size // SEGMENTS, 16, 512))
    settings: dict[str, Any] = dict(window="blackmanharris", nperseg=segment, detrend=without_line)
    with np.errstate(invalid="ignore", divide="ignore"):
        frequency, shared = scipy.signal.coherence(channel, other, sample_rate, **settings)
    density = scipy.signal.welch(channel, sample_rate, **settings)[1]
    below = (frequency > BEFORE[0] * end.bandwidth) & (frequency < JUST_BELOW * end.bandwidth)
    below &= np.isfinite(shared)
    # By power: between the lines of a multisine there is noise, too, but not what ends.
    if not below.any() or np.average(shared[below], weights=density[below]) >= MEASUREMENT.shared_below_end:
        return None
    before = density[below & (frequency < BEFORE[1] * end.bandwidth)]
    # Within the lobe of a tone, or on its slope, there is no level of noise to be read.
    # Densities within a decade are level.
    if before.size < 6 or np.ptp(np.log10(np.quantile(before, (0.1, 0.9)))) > 1:
        return None
    return float(np.sqrt(np.median(before) * sample_rate / 2))


def coherent_to_the_top(first: Array, second: Array, sample_rate: float) -> bool:
    """Return whether two channels share the top third of their band: what they share is signal and no noise."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return False
    # Short segments: the coherence of a few of them is high by chance.
    segment = int(np.clip(first.size // SEGMENTS, 16, 256))
    with np.errstate(invalid="ignore", divide="ignore"):
        _, shared = scipy.signal.coherence(
            first, second, sample_rate, window="blackmanharris", nperseg=segment, detrend=without_line
        )
    top = shared[2 * shared.size // 3 :]
    known = top[np.isfinite(top)]
    return bool(known.size and np.median(known) > MEASUREMENT.mostly)


@dataclass(frozen=True)
class ChannelNoise:
    """Where the motion of a run ends in its spectrum, and the noise of its channels.

    Parameters
    ----------
    end : SignalEnd
        Of the angle, or of what an accelerometer's run fuses it from.
    moment, angle, rate : float
        RMS of a single sample, N·m, rad, rad/s; the rate's is zero where no rate was measured.
    moment_known, angle_known, rate_known : bool
        Whether the noise was measured or declared.
    source : {"declared", "spectrum", "coherent"}
        What showed that of the moment. Where both channels still hold one signal at the end of their spectra, the noise
        is less than what is there.
    """

    end: SignalEnd
    moment: float
    moment_known: bool
    angle: float
    angle_known: bool
    rate: float = 0.0
    rate_known: bool = True
    source: str = "spectrum"


# Runs whose motion was moved in time, and what they were made of: an interpolated channel does not show its noise.
_made_of: WeakKeyDictionary[Run, Run] = WeakKeyDictionary()


@kept
def channel_noise(run: Run) -> ChannelNoise:
    """Return the noise of a run's channels; a diagnosis asks for the states of the same run many times."""
    if run in _made_of:
        return channel_noise(_made_of[run])
    sample_rate, declared = run.sample_rate, run.noise
    if run.fusion is not None:
        # Where the noise of the angle falls with the fourth power of frequency, the sensors show where they end.
        sensors = [each for each in (run.fusion.acceleration, run.fusion.angle) if each is not None]
        end = max((signal_end(each, sample_rate) for each in sensors), key=lambda each: each.bandwidth)
        return ChannelNoise(end, *moment_noise(run.moment, sample_rate, declared.moment), 0.0, True)
    filtered_angle = noise_before_filter(run.angle, run.moment, sample_rate)
    filtered_moment = noise_before_filter(run.moment, run.angle, sample_rate)
    shared = coherent_to_the_top(run.angle, run.moment, sample_rate)
    of_angle = filtered_angle if declared.angle is None else declared.angle
    of_moment = filtered_moment if declared.moment is None else declared.moment
    angle, angle_known = motion_noise(run.angle, sample_rate, of_angle)
    moment, moment_known = moment_noise(run.moment, sample_rate, of_moment)
    rate, rate_known = (0.0, True) if run.rate is None else motion_noise(run.rate, sample_rate, declared.rate)
    return ChannelNoise(
        end=signal_end(run.angle, sample_rate, filtered_angle),
        moment=moment,
        moment_known=moment_known,
        angle=angle,
        angle_known=angle_known,
        rate=rate,
        rate_known=rate_known,
        source="declared" if declared.moment is not None else "coherent" if shared else "spectrum",
    )


def interpolated(run: Run, of: Run) -> Run:
    """Return a run whose channels were interpolated, with the noise of the one that was measured."""
    _made_of[run] = of
    return run
