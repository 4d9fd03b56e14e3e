"""Whether a run holds the excitation frequency that its manifest declares."""

from __future__ import annotations

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.numeric import Array, line_spectrum
from sindyjoint.record import Motion

# Fewer periods do not part neighbouring lines.
FEWEST_PERIODS = 3
# A line stands out of its surroundings; white noise does so in 1 of 200 runs of 3 periods, 1 of 3000 of 25.
CONTRAST = 6.0
# A harmonic of the true frequency stays below these parts of the largest line: a square wave's third has 1/3.
ANGLE_SHARE = 0.25
MOMENT_SHARE = 0.5


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
    if angle.size * frequency / rate < FEWEST_PERIODS:
        return
    share, contrast, largest = _measure_line(angle, rate, frequency)
    if share >= ANGLE_SHARE and contrast >= CONTRAST:
        return
    if moment is not None:
        share, contrast, _ = _measure_line(moment, rate, frequency)
        if share >= MOMENT_SHARE and contrast >= CONTRAST:
            return
    channel = "angle" if motion == "rotation" else "displacement"
    raise InputError(
        f"{where}: the declared frequency {frequency:g} Hz is absent from the data; the largest line of the "
        f"{channel} is at {largest:.3g} Hz; correct frequency, or leave it out for an aperiodic run"
    )


def _measure_line(signal: Array, rate: float, frequency: float) -> tuple[float, float, float]:
    """Return the line's share of the largest line, its contrast, and the largest line's frequency, Hz."""
    n = signal.size
    abscissa = np.linspace(-1, 1, n)
    # Slow drift is no line.
    steady = signal - np.polyval(np.polyfit(abscissa, signal, 3), abscissa)
    amplitude = line_spectrum(steady)
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
