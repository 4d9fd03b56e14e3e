"""How noisy a pulse record is, measured from the record alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.response.oscillation import white_noise

# The late part of a record is explained window by window, each of so many main periods, by so many lines.
WINDOW_PERIODS = 3.0
MOST_LINES = 5
LONGEST = 200  # lags of the correlation


@dataclass(frozen=True)
class RecordNoise:
    """Noise of a record.

    Parameters
    ----------
    sigma : float
        RMS, m.
    length : float
        Samples that count as one: one for white noise, more where neighbours go together.
    """

    sigma: float
    length: float

    @property
    def weight(self) -> float:
        """What a residual is divided by so that its square sums to χ²."""
        return self.sigma * float(np.sqrt(self.length))


def record_noise(
    displacement: ArrayLike, sample_rate: float, policy: DiagnosisPolicy = STRUCTURE
) -> RecordNoise:
    """Return the noise of a record of free decay.

    In the late part of the record, window by window, a constant, a trend and the lines of the spectrum, with amplitudes
    that may change linearly, are taken away; the residual is noise. White noise by fourth differences is its lower
    bound. Its correlation says how many samples count as one.

    Parameters
    ----------
    displacement : array_like, shape (n,)
    sample_rate : float
        Hz.
    policy : DiagnosisPolicy

    Examples
    --------
    >>> t = np.arange(8000) / 1000
    >>> noise = np.random.default_rng(0).standard_normal(8000)
    >>> found = record_noise(np.exp(-0.1 * t) * np.sin(26 * t) + 0.01 * noise, 1000.0)
    >>> 0.0095 < found.sigma < 0.0105, found.length < 1.5
    (True, True)
    """
    values = np.asarray(displacement, dtype=np.float64)
    white = white_noise(values)
    frequency = main_frequency(values, sample_rate)
    late = values[-max(int(policy.late_share * values.size), min(values.size, 64)) :]
    width = int(WINDOW_PERIODS * sample_rate / frequency)
    count = late.size // max(width, 1)
    if count < 1 or width < 24:
        return RecordNoise(max(white, 1e-9 * float(np.std(values))), 1.0)
    width = late.size // count
    windows = late[-count * width :].reshape(count, width)
    lines = [_refined(windows, sample_rate, [], frequency, sample_rate / values.size)]
    while True:
        residual, used = _explained(windows, sample_rate, lines)
        extra = (
            _line(residual, sample_rate, policy)
            if len(lines) < MOST_LINES and used + 4 < width // 2
            else None
        )
        if extra is None or min(abs(extra - f) for f in lines) < 0.5 * sample_rate / width:
            break
        lines.append(_refined(windows, sample_rate, lines, extra, sample_rate / width))
    sigma = float(np.sqrt(np.sum(residual**2) / max(count * (width - used), 1)))
    least = max(white, 1e-9 * float(np.std(values)))
    return RecordNoise(max(sigma, least), _length(residual) if sigma > 0 else 1.0)


def _explained(windows: Array, sample_rate: float, lines: list[float]) -> tuple[Array, int]:
    """Return windows less what lines and a trend explain of them, and the numbers that took."""
    width = windows.shape[1]
    time = (np.arange(width) - (width - 1) / 2) / sample_rate
    ramp = time / time[-1]
    columns = [np.ones(width), ramp]
    for f in lines:
        phase = 2 * np.pi * f * time
        for wave in (np.cos(phase), np.sin(phase)):
            columns += [wave, ramp * wave]
    basis, _ = np.linalg.qr(np.array(columns).T)
    return windows - (windows @ basis) @ basis.T, len(columns)


def _refined(windows: Array, sample_rate: float, lines: list[float], guess: float, width: float) -> float:
    """Return the frequency within a resolution of a guess that leaves least, Hz."""
    from scipy.optimize import minimize_scalar

    def residual(frequency: float) -> float:
        return float(np.sum(_explained(windows, sample_rate, [*lines, frequency])[0] ** 2))

    found = minimize_scalar(
        residual, bounds=(max(guess - width, 0.1 * guess), guess + width), method="bounded"
    )
    return float(found.x) if residual(float(found.x)) < residual(guess) else guess


def _line(windows: Array, sample_rate: float, policy: DiagnosisPolicy) -> float | None:
    """Return the frequency of a line that stands out of the windows' mean spectrum, Hz."""
    from scipy.ndimage import median_filter

    power = np.mean(np.abs(np.fft.rfft(windows * np.hanning(windows.shape[1]), axis=1)) ** 2, axis=0)[1:]
    ground = median_filter(power, size=min(31, power.size | 1), mode="nearest")
    place = int(np.argmax(power / np.maximum(ground, 1e-300)))
    if power[place] < policy.line_ratio * ground[place] or power[place] <= 1e-20 * power.max():
        return None
    return float((place + 1) * sample_rate / windows.shape[1])


def _length(windows: Array) -> float:
    """Return 1 + 2·Σρ over the lags before the correlation first vanishes."""
    width = windows.shape[1]
    spectrum = np.mean(np.abs(np.fft.rfft(windows, 2 * width, axis=1)) ** 2, axis=0)
    correlation = np.fft.irfft(spectrum)[: min(width, LONGEST)] / (width - np.arange(min(width, LONGEST)))
    rho = correlation / correlation[0]
    end = np.flatnonzero(rho < 2 / np.sqrt(windows.size))
    return float(max(1.0, 1 + 2 * rho[1 : end[0] if end.size else rho.size].sum()))
