"""The mean cycle of a steady run by one Fourier transform per channel, and the floor between its harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.profile import Profile

Complex = NDArray[np.complex128]
# A factor for each run, or one for all.
Gains = Array | float
POINTS = 128
MOST_HARMONICS = 40
# Share of a run that counts as steady, from its end.
STEADY = 0.6


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One channel over whole steady periods.

    Parameters
    ----------
    bins : ndarray of complex, shape (m,)
        Fourier coefficients; the fundamental is bin ``periods``.
    periods : int
    floor : float
        Median modulus of the coefficients between the harmonics.
    """

    bins: Complex
    periods: int
    floor: float

    @cached_property
    def harmonics(self) -> Complex:
        """Coefficients of mean and harmonics, those below the floor left out, shape (h + 1,)."""
        found = self.bins[:: self.periods][: MOST_HARMONICS + 1].copy()
        low = np.abs(found) < 4 * self.floor
        low[:2] = False
        found[low] = 0
        return found


@dataclass(frozen=True, eq=False)
class Cycles:
    """The mean cycles of some runs.

    Parameters
    ----------
    names : tuple of str
    frequency : ndarray, shape (r,)
        Hz.
    moment, angle : ndarray of complex, shape (r, h + 1)
        Coefficients of mean and harmonics.
    inputs : ndarray, shape (r, POINTS, k)
        Mean cycles of the declared inputs.
    """

    names: tuple[str, ...]
    frequency: Array
    moment: Complex
    angle: Complex
    inputs: Array
    repeats: ClassVar[bool] = True

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def lines(self) -> Array:
        """Frequencies of the harmonics, Hz, shape (r, h + 1)."""
        return np.outer(self.frequency, np.arange(self.moment.shape[1]))

    def take(self, index: Sequence[int]) -> Cycles:
        """Return some of the runs."""
        rows = list(index)
        names = tuple(self.names[i] for i in rows)
        return Cycles(names, self.frequency[rows], self.moment[rows], self.angle[rows], self.inputs[rows])

    def scaled(self, moment: Gains = 1.0, angle: Gains = 1.0) -> Cycles:
        """Return the runs with their moments and angles times factors, one for each run or one for all."""
        return replace(
            self,
            moment=self.moment * np.reshape(moment, (-1, 1)),
            angle=self.angle * np.reshape(angle, (-1, 1)),
        )

    def load(self) -> Array:
        """Return the moment over one cycle, shape (r, POINTS)."""
        return synthesise(self.moment)

    def motion(self, angle: Complex | None = None) -> tuple[Array, Array, Array]:
        """Return angle, rate and acceleration over one cycle, each shape (r, POINTS).

        Parameters
        ----------
        angle : ndarray of complex, optional
            Harmonics to take instead of the measured ones.
        """
        harmonics = self.angle if angle is None else angle
        turn = 2j * np.pi * self.lines
        return synthesise(harmonics), synthesise(harmonics * turn), synthesise(harmonics * turn**2)


def synthesise(harmonics: Complex) -> Array:
    """Return cycles of series, shape (r, POINTS)."""
    padded = np.zeros((len(harmonics), POINTS // 2 + 1), dtype=complex)
    padded[:, : harmonics.shape[1]] = harmonics
    return np.fft.irfft(padded, POINTS, axis=1) * POINTS


def spectrum_of(values: Array, per: float, first: int) -> Spectrum | None:
    """Return the Fourier coefficients over the whole periods that end a signal, or None for fewer than three.

    Parameters
    ----------
    values : ndarray, shape (n,)
    per : float
        Samples per period.
    first : int
        Sample before which the signal is not steady.
    """
    whole = int((values.size - first) / per)
    counts = np.arange(max(3, whole - 8), whole + 1)
    if not counts.size or whole < 3:
        return None
    # The number of periods that is nearest to a whole number of samples.
    periods = int(counts[np.argmin(np.abs(counts * per - np.round(counts * per)) - 1e-3 * counts / whole)])
    size = int(round(periods * per))
    bins = np.fft.rfft(values[-size:]) / size
    between = np.ones(bins.size, dtype=bool)
    for near in range(-(periods // 4), periods // 4 + 1):
        between[max(0, near) :: periods] = False
        if near < 0:
            between[periods + near :: periods] = False
    floor = float(np.median(np.abs(bins[between]))) if between.any() else 0.0
    return Spectrum(bins, periods, floor)


def spectra_of(profile: Profile) -> dict[str, Spectrum]:
    """Return the spectra of the channels of a run that has a frequency; empty for any other."""
    per = profile.samples_per_period
    if per is None or per < 6:
        return {}
    first = int((1 - STEADY) * profile.run.n_samples)
    made = {c.name: spectrum_of(c.values, per, first) for c in profile.channels}
    return {name: spectrum for name, spectrum in made.items() if spectrum is not None}


def cycles_of(profiles: Sequence[Profile], spectra: Sequence[dict[str, Spectrum]]) -> Cycles:
    """Return the mean cycles of the runs that have a frequency and both channels."""
    both = [
        (p, s)
        for p, s in zip(profiles, spectra, strict=True)
        if p.frequency and {"moment", "angle"} <= set(s)
    ]
    moment, angle = (
        np.array([_padded(s[name].harmonics) for _, s in both]).reshape(-1, MOST_HARMONICS + 1)
        for name in ("moment", "angle")
    )
    inputs = [np.reshape(_input_cycles(p), (-1, POINTS)).T for p, _ in both]
    return Cycles(
        tuple(p.run.name for p, _ in both),
        np.array([p.frequency or 0.0 for p, _ in both]),
        moment,
        angle,
        np.array(inputs).reshape(len(both), POINTS, -1) if both else np.zeros((0, POINTS, 0)),
    )


def _input_cycles(profile: Profile) -> list[Array]:
    """Return the mean cycles of the inputs of a run, over the same periods as those of its channels."""
    per, first = profile.samples_per_period or 0.0, int((1 - STEADY) * profile.run.n_samples)
    found = []
    for values in profile.run.inputs.values():
        spectrum = None if np.ptp(values) == 0 else spectrum_of(values, per, first)
        if spectrum is None:
            found.append(np.full(POINTS, np.mean(values)))
            continue
        kept = spectrum.bins[:: spectrum.periods]
        found.append(synthesise(_padded(kept[: MOST_HARMONICS + 1])[None])[0])
    return found


def _padded(harmonics: Complex) -> Complex:
    return np.concatenate([harmonics, np.zeros(MOST_HARMONICS + 1 - harmonics.size, dtype=complex)])
