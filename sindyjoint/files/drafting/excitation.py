"""How a run was excited: at which frequency, at which level."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.files.spectrum import FEWEST_PERIODS, check_frequency
from sindyjoint.numeric import Array, main_frequency

# Share of its power by which a motion may change from one period to the next.
REPEATS = 0.03
# Of a run whose courses are compared.
PARTS = 6
# Amplitudes within this factor are one level.
SAME_LEVEL = 1.15
# Below this, a thousandth of the unit reads better.
SMALL = 0.1
_HERTZ = re.compile(r"(\d+(?:[.,p]\d+)?)\s*[hH]z")
_LEVEL_WORD = re.compile(
    r"(?:^|[^a-z])(low|lo|mid|medium|high|hi|small|large|max|min|full|half)(?![a-z])", re.IGNORECASE
)
_LEVEL_SIZE = re.compile(
    r"(\d+(?:[.,p]\d+)?)\s*(Nm|N|kN|mm|in|inch|deg|mrad|rad|um|lb|lbf|V|percent|pct)(?![a-zA-Z])"
)


def find_frequency(angle: Array, moment: Array, rate: float, name: str) -> float | None:
    """Return the frequency of a sinusoidal excitation, Hz; None for an aperiodic run.

    A frequency in the file's name counts where the spectrum agrees; a frequency of the spectrum is rounded to what its
    resolution can show.
    """
    abscissa = np.linspace(-1, 1, angle.size)
    # Slow drift is no excitation.
    signals = [x - np.polyval(np.polyfit(abscissa, x, 3), abscissa) for x in (angle, moment)]
    signals = [x for x in signals if np.ptp(x) > 0]
    # A free decay has a frequency of its own, and none that drives it.
    if not signals or decays(angle):
        return None
    found = main_frequency(signals[0], rate, between_bins=True)
    named = _HERTZ.search(name)
    if named:
        stated = float(re.sub("[,p]", ".", named[1]))
        if _holds(stated, angle, moment, rate) and stated * angle.size / rate >= FEWEST_PERIODS:
            return stated
    periods = found * angle.size / rate
    if periods < FEWEST_PERIODS or rate < 10 * found or _change(signals[0], rate, found) > REPEATS:
        return None
    return _rounded(found, 0.05 * found / periods) if _holds(found, angle, moment, rate) else None


def find_course(angle: Array, rate: float | None, frequency: float | None) -> str:
    """Return what kind of run a motion is: ``"3 Hz"``, ``"free decay"``, ``"sweep"`` or ``"aperiodic"``.

    Examples
    --------
    >>> time = np.arange(4000) / 500
    >>> find_course(np.exp(-time / 3) * np.cos(20 * time), 500.0, None)
    'free decay'
    >>> find_course(np.sin(10 * time + 5 * time**2), 500.0, None)
    'sweep'
    """
    if frequency is not None:
        return f"{frequency:g} Hz"
    if rate is None:
        return "quasi-static"
    if decays(angle):
        return "free decay"
    found = np.array([main_frequency(part - part.mean(), rate, between_bins=True) for part in _parts(angle)])
    turns = np.diff(found) if found[-1] > found[0] else -np.diff(found)
    enough = found.min() * angle.size / rate / PARTS > 1
    return "sweep" if enough and np.all(turns > 0) and np.ptp(found) > found.min() / 2 else "aperiodic"


def decays(values: Array) -> bool:
    """Return whether a motion swings and dies out: its range falls from part to part, to half at least."""
    ranges = np.array([np.ptp(part) for part in _parts(values)])
    middle, early = values[-values.size // PARTS :].mean(), values[: values.size // 2]
    # What moves to a stop falls likewise, and does not swing about it.
    swings = np.count_nonzero(np.diff(np.sign(early - middle))) >= FEWEST_PERIODS
    # What has died out goes on in noise: the last parts may grow by as little as that.
    return bool(swings and np.all(np.diff(ranges) <= ranges[0] / 50) and ranges[-1] < ranges[0] / 2)


def _parts(values: Array) -> list[Array]:
    return np.array_split(values, PARTS)


def _holds(frequency: float, angle: Array, moment: Array, rate: float) -> bool:
    """Return whether a campaign with this frequency would be accepted."""
    try:
        check_frequency(angle, None if np.ptp(moment) == 0 else moment, rate, frequency, "")
    except InputError:
        return False
    return rate >= 10 * frequency


def _change(signal: Array, rate: float, frequency: float) -> float:
    """Return the power of what changes from one period to the next, relative to that of the signal."""
    at = np.arange(signal.size)
    later = at + rate / frequency
    inside = later <= at[-1]
    return float(np.mean((np.interp(later[inside], at, signal) - signal[inside]) ** 2) / (2 * np.var(signal)))


def _rounded(value: float, error: float) -> float:
    """Return a value to the fewest digits that lie within its error."""
    return next(
        (float(f"{value:.{n}g}") for n in range(1, 8) if abs(float(f"{value:.{n}g}") - value) <= error), value
    )


def name_levels(names: Sequence[str], peaks: Sequence[float], unit: str) -> list[str]:
    """Return a label for the level of each run: the word or size in its file's name, or its amplitude.

    Parameters
    ----------
    names : sequence of str
        Of the files.
    peaks : sequence of float
        Largest deflections of the joint, in the unit.
    unit : str

    Examples
    --------
    >>> name_levels(["3Hz-low", "4Hz_0.5in", "c", "d"], [0.001, 0.002, 0.0031, 0.003], "rad")
    ['low', '0.5 in', '3 mrad', '3 mrad']
    """
    if unit in ("rad", "m") and max(peaks) < SMALL:
        peaks, unit = [1e3 * peak for peak in peaks], f"m{unit}"
    written = [_written_level(name) for name in names]
    order = sorted(range(len(names)), key=lambda i: peaks[i])
    labels = [""] * len(names)
    lowest = 0.0
    for i in order:
        if not (lowest and peaks[i] <= SAME_LEVEL * lowest):
            lowest = peaks[i]
        labels[i] = written[i] or f"{lowest:.2g} {unit}"
    return labels


def _written_level(name: str) -> str:
    stem = _HERTZ.sub(" ", name)
    word = _LEVEL_WORD.search(stem)
    if word:
        return word[1].lower()
    size = _LEVEL_SIZE.search(stem)
    return f"{re.sub('[,p]', '.', size[1])} {size[2]}" if size else ""
