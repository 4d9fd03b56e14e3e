"""Synthetic replicate of a periodic run: one period of the model's motion, through the same harmonic processing.

The processing keeps the harmonics that exceed the noise and drops the others. The replicate keeps the same harmonics
as the measured run, not those that another draw of the noise would have kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.bias.policy import POLICY
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.excitation import repeated
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import simulate, transfer_moment
from sindyjoint.numeric import Array
from sindyjoint.record import Run
from sindyjoint.response.run import span_of
from sindyjoint.states import ForceStates, Harmonics
from sindyjoint.states.harmonics import significant_harmonics
from sindyjoint.states.mask import moving_mask
from sindyjoint.states.periodic import BAND_SHARE
from sindyjoint.states.policy import POLICY as STATES

Complex = NDArray[np.complex128]

LEAST_POINTS = 256  # per period: a mask of one sample less than a real run has does not matter then
LEAST_DRIVE_POINTS = 512
# Periods that are simulated at a time, how often at most, and by how much the last two may differ, relative to the RMS.
PERIODS, ROUNDS, SETTLED = 4, 6, 3e-4


@dataclass(frozen=True, eq=False)
class PeriodicReplicate:
    """One period of a run of the model, as the processing pipeline sees it.

    Parameters
    ----------
    run : str
    driven : {"moment", "angle"}
        What was prescribed.
    angular : float
        Angular frequency of the excitation, rad/s.
    moment : ndarray, shape (n,)
        At the sensor, free of noise, N·m.
    kept : tuple of Harmonics
        Of the angle and, where it was measured, of the rate.
    coefficients : tuple of ndarray
        The replicate's complex amplitudes of these harmonics, shifted by the mean noise of a kept harmonic.
    mean, mean_error : float
        Of the angle, rad.
    slowest : float
        Rate below which a sample counts as reversal, rad/s.
    guard : int
        Samples of this grid.
    weight : float
        Samples of the run per sample of the replicate.
    motion : ndarray, shape (n, 3)
        Angle, rate and acceleration with every harmonic.
    completed : bool
        Whether the run's states hold the model's harmonics in addition to those kept.
    """

    run: str
    driven: str
    angular: float
    moment: Array
    kept: tuple[Harmonics, ...]
    coefficients: tuple[Complex, ...]
    mean: float
    mean_error: float
    slowest: float
    guard: int
    weight: float
    motion: Array
    completed: bool

    def noise(self, rng: np.random.Generator) -> tuple[float, tuple[Complex, ...]]:
        """Draw the noise of the mean and of every kept harmonic."""
        drawn = (rng.normal(size=(2, part.orders.size)) for part in self.kept)
        return self.mean_error * rng.normal(), tuple(
            part.standard_error * (d[0] + 1j * d[1]) for part, d in zip(self.kept, drawn, strict=True)
        )

    def beyond(self, kept: tuple[Harmonics, ...]) -> Array:
        """Return angle, rate and acceleration without the kept harmonics, shape (n, 3)."""
        n = self.moment.size
        values = tuple(
            np.fft.rfft(signal)[part.orders] * 2 / n
            for signal, part in zip(self.motion.T[: len(kept)], kept, strict=True)
        )
        return self.motion - np.column_stack(
            _sum_motion(values, kept, self.angular, n, float(self.motion[:, 0].mean()))
        )

    def rows(
        self, noise: tuple[float, tuple[Complex, ...]] | None = None, sign: float = 1.0
    ) -> tuple[Array, Array]:
        """Return moving (θ, θ̇, θ̈), shape (m, 3), and the moment, shape (m,), under noise times a sign."""
        n = self.moment.size
        mean, values = self.mean, self.coefficients
        if noise is not None:
            mean = mean + sign * noise[0]
            values = tuple(c + sign * e for c, e in zip(values, noise[1], strict=True))
        angle, rate, acceleration = _sum_motion(values, self.kept, self.angular, n, mean)
        # The cycle has no ends: a guard that begins before its first sample covers its last ones.
        moving = moving_mask(np.tile(rate, 3), self.slowest, self.guard)[n : 2 * n]
        motion = np.column_stack([angle, rate, acceleration])
        if self.completed:
            motion += self.beyond(self.kept)
        return motion[moving], self.moment[moving]


def _sum_motion(
    values: tuple[Complex, ...], kept: tuple[Harmonics, ...], angular: float, n: int, mean: float
) -> tuple[Array, Array, Array]:
    """Return angle, rate and acceleration of the kept harmonics of the angle, or of angle and rate."""
    orders = kept[-1].orders
    rate, acceleration = (
        series(values[-1] * (1j * angular * orders) ** order, orders, n)
        for order in ((1, 2) if len(kept) == 1 else (0, 1))
    )
    return series(values[0], kept[0].orders, n, mean), rate, acceleration


def series(values: Complex, orders: NDArray[np.intp], n: int, mean: float = 0.0) -> Array:
    """Return mean + Re Σ values·exp(i·orders·φ) at n equal steps of one period."""
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    spectrum[0] = mean * n
    spectrum[orders] = values * n / 2
    return np.fft.irfft(spectrum, n)


def amplitudes(signal: Array, sample_rate: float, frequency: float, most: int) -> tuple[float, Complex]:
    """Return mean and complex amplitudes of the harmonics 1 to ``most`` over whole periods."""
    mean = float(np.mean(signal))
    turn = np.exp(-2j * np.pi * frequency / sample_rate * np.arange(signal.size))
    wave, centred, found = np.ones_like(turn), signal - mean, np.empty(most, dtype=complex)
    for order in range(most):
        wave = wave * turn
        found[order] = wave @ centred
    return mean, (2 / signal.size * found).astype(complex)


def kept_shift(ratio: Array) -> Array:
    """Return the mean noise of an amplitude, along it and in standard errors, given that it passed as significant.

    With r = |a + noise| Rice distributed, E[cos·r − a | r > 2.5]; a is the true amplitude in standard errors.
    """
    from scipy.special import ive

    a = np.minimum(np.abs(ratio), STATES.harmonic_significance + 10.0)[:, None]
    r = STATES.harmonic_significance + (np.arange(160) + 0.5) / 16
    r = np.maximum(r, r + a - STATES.harmonic_significance - 5.0)
    density = r * np.exp(-((r - a) ** 2) / 2) * ive(0, r * a)
    along = r * ive(1, r * a) / ive(0, r * a) - a
    total = density.sum(axis=1)
    return np.where(
        np.abs(ratio) > STATES.harmonic_significance + 5, 0.0, (along * density).sum(axis=1) / total
    )


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The harmonics of a measured run: of the moment, and of the angle where they were kept."""

    mean: float
    moment: Complex
    moment_error: float
    angle: Complex  # from order 1 to the highest kept one, zero where not kept
    mean_angle: float

    @classmethod
    def of(cls, run: Run, state: ForceStates) -> Spectrum:
        """Return the harmonics of a run over the span of its states."""
        frequency = _frequency(state)
        span = span_of(run, state)
        per = run.sample_rate / frequency
        highest = int(state.series[0].orders[-1])
        most = max(1, min(2 * highest + 4, int(0.4 * per)))
        mean, moment = amplitudes(run.moment[span], run.sample_rate, frequency, most)
        mean_angle, angle = amplitudes(state.angle, run.sample_rate, frequency, highest)
        kept = np.zeros(highest, dtype=bool)
        kept[state.series[0].orders - 1] = True
        error = state.noise.moment * np.sqrt(2 / state.n_samples)
        return cls(mean, moment, error, np.where(kept, angle, 0.0), mean_angle)


def _frequency(state: ForceStates) -> float:
    assert state.frequency is not None
    return state.frequency


def estimate_exciter_inertia(spectra: Sequence[Spectrum], states: Sequence[ForceStates]) -> float:
    """Return the inertia between a smooth exciter and the sensor, kg·m² (kg); zero where none is detected.

    An exciter whose moment is smooth drives inertia J and joint: M + J·θ̈ at the sensor has few harmonics, though M has
    the friction's steps. J = −Σ|M|² / Re Σ θ̈*·M over kept harmonics beyond the first.
    """
    accelerations, moments = [], []
    for spectrum, state in zip(spectra, states, strict=True):
        orders = state.series[0].orders[1:]
        orders = orders[orders <= spectrum.moment.size]
        speed = 2 * np.pi * _frequency(state) * orders
        accelerations.append(-(speed**2) * spectrum.angle[orders - 1])
        moments.append(spectrum.moment[orders - 1])
    x, y = np.concatenate(accelerations), np.concatenate(moments)
    both, size = -float(np.real(np.vdot(x, y))), float(np.linalg.norm(x) * np.linalg.norm(y))
    least = (
        max(POLICY.inertia_correlation, POLICY.inertia_significance / np.sqrt(2 * x.size)) if x.size else 1.0
    )
    return float(np.linalg.norm(y)) ** 2 / both if size > 0 and both > least * size else 0.0


def make_periodic_replicate(
    law: Law, state: ForceStates, spectrum: Spectrum, exciter_inertia: float
) -> PeriodicReplicate:
    """Return the synthetic replicate of a periodic run.

    Parameters
    ----------
    law : Law
    state : ForceStates
        Of the run, by the periodic method.
    spectrum : Spectrum
    exciter_inertia : float
        Inertia between exciter and sensor, see :func:`estimate_exciter_inertia`.

    Raises
    ------
    SimulationError
        If the law has no finite moment along the measured motion.
    """
    frequency = _frequency(state)
    per = state.sample_rate / frequency
    finer = int(np.ceil(LEAST_POINTS / per))
    n = round(per) * finer
    orders = state.series[0].orders
    moved = _simulate_driven(law, state, spectrum, exciter_inertia, n)
    if moved is None:
        angle = series(spectrum.angle[orders - 1], orders, n, spectrum.mean_angle)
        speed = 2j * np.pi * frequency * orders
        rate, acceleration = (series(spectrum.angle[orders - 1] * speed**k, orders, n) for k in (1, 2))
        moment, _ = transfer_moment(law, angle, rate, n * frequency, acceleration=acceleration)
    else:
        angle, rate, acceleration, moment = moved
    coefficients = tuple(
        _shift_kept(np.fft.rfft(signal)[part.orders] * 2 / n, part, moved is not None)
        for signal, part in zip((angle, rate), state.series, strict=False)
    )
    return PeriodicReplicate(
        run=state.run,
        driven="angle" if moved is None else "moment",
        angular=2 * np.pi * frequency,
        moment=moment,
        kept=state.series,
        coefficients=coefficients,
        mean=float(angle.mean()),
        mean_error=state.noise.angle / np.sqrt(state.n_samples),
        slowest=state.slowest,
        guard=state.guard * finer,
        weight=state.n_samples / n,
        motion=np.column_stack([angle, rate, acceleration]),
        completed=state.completed,
    )


def _shift_kept(values: Complex, kept: Harmonics, simulated: bool) -> Complex:
    """Return amplitudes shifted by the mean noise of a kept harmonic; measured ones hold it already."""
    if not simulated:
        return values
    size = np.maximum(np.abs(values), 1e-300)
    shift = kept.standard_error * kept_shift(size / np.maximum(kept.standard_error, 1e-300))
    shift[kept.orders == 1] = 0.0  # the first harmonic is kept in any case
    return values * (1 + shift / size)


def _simulate_driven(
    law: Law, state: ForceStates, spectrum: Spectrum, exciter_inertia: float, n: int
) -> tuple[Array, Array, Array, Array] | None:
    """Return angle, rate, acceleration and moment of the last of some periods under the run's drive, if it works.

    The drive M + J·θ̈ must have fewer harmonics than the angle: where the motion was prescribed it has more, and the
    friction's steps cannot be distinguished from it.
    """
    frequency = _frequency(state)
    highest = spectrum.angle.size
    count = min(highest, spectrum.moment.size)
    speed = 2 * np.pi * frequency * np.arange(1, count + 1)
    known = spectrum.angle[:count] != 0
    drive = spectrum.moment[:count] - exciter_inertia * speed**2 * spectrum.angle[:count]
    error = np.full(count, spectrum.moment_error)
    if exciter_inertia > 0:
        angle_error = np.interp(
            np.arange(1, count + 1), state.series[0].orders, state.series[0].standard_error
        )
        error = np.hypot(error, exciter_inertia * speed**2 * angle_error)
    keep = significant_harmonics(np.abs(drive), error) & (known | (exciter_inertia == 0))
    orders = np.flatnonzero(keep) + 1
    if not law.inertia > 0 or not orders.size:
        return None
    # Where sampling cuts the angle's harmonics, and not the noise, their number means nothing.
    if orders[-1] >= highest and highest + 1 < _sampled_orders(state):
        return None
    points = max(n, LEAST_DRIVE_POINTS)
    excitation = repeated(series(drive[keep], orders, points, spectrum.mean), 1 / frequency)
    initial = (float(state.angle[0]), float(state.rate[0]))
    try:
        for _ in range(ROUNDS):
            motion = simulate(
                law, excitation, PERIODS / frequency, n * frequency, beam_inertia=exciter_inertia, initial=initial,
                limits=None, rtol=1e-6,
            )  # fmt: skip
            last, before = motion.angle[-n:], motion.angle[-2 * n : -n]
            if np.sqrt(np.mean((last - before) ** 2)) < SETTLED * np.std(last):
                break
            initial = (float(last[0]), float(motion.rate[-n]))
    except SimulationError:
        return None
    if not _matches_measured(np.fft.rfft(last) * 2 / n, state, spectrum):
        return None
    return last, motion.rate[-n:], motion.acceleration[-n:], motion.moment[-n:]


def _sampled_orders(state: ForceStates) -> int:
    """Return the number of harmonics of the excitation that the sampling rate can show."""
    return int(BAND_SHARE * state.sample_rate / _frequency(state))


def _matches_measured(replicate: Complex, state: ForceStates, spectrum: Spectrum) -> bool:
    """Return whether a replicate's harmonics match those measured, within their errors and those of the model."""
    most = min(2 * spectrum.angle.size + 2, replicate.size - 1, max(2, _sampled_orders(state)))
    orders = np.arange(2, most + 1)
    measured = np.zeros(most, dtype=complex)
    measured[: spectrum.angle.size] = spectrum.angle[:most]
    error = np.interp(orders, state.series[0].orders, state.series[0].standard_error)
    # A harmonic that was not kept is known only to have been below the limit.
    error = np.where(measured[1:] == 0, STATES.harmonic_significance / np.sqrt(2), 1.0) * error
    weight = orders**4
    off = float(weight @ np.abs(replicate[2 : most + 1] - measured[1:]) ** 2)
    allowed = float(
        weight @ (2 * error**2 + POLICY.harmonic_model_error * np.abs(replicate[2 : most + 1]) ** 2)
    )
    first = abs(replicate[1] - spectrum.angle[0]) <= POLICY.fundamental_difference * abs(spectrum.angle[0])
    return first and off <= POLICY.likeness * allowed
