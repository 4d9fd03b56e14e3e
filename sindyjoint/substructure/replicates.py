"""Synthetic replicates of recovered runs: the model's moment along the recovered motion, with the recovery's noise.

Angle and moment of a joint come from the same sensors, so their errors are not independent: each harmonic's noise is
drawn from the joint covariance of both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.laws import Law
from sindyjoint.numeric import Array
from sindyjoint.states.harmonics import HarmonicBasis
from sindyjoint.states.mask import moving_mask
from sindyjoint.states.record import ForceStates
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.states import kept_of, record_motion, record_series, slow_orders

Complex = NDArray[np.complex128]

POINTS = 512  # of a period with few harmonics; with more, so many for each
POINTS_PER_HARMONIC = 8


@dataclass(frozen=True, eq=False)
class RecoveredReplicate:
    """One period of a recovered run with a known law.

    Parameters
    ----------
    angle : ndarray of complex, shape (h,)
        Amplitudes of the angle of the states, its slow part among them.
    root : ndarray of complex, shape (h, 2, 2)
        Square root of the covariance of both.
    kept : tuple of two ndarray of bool, shape (h,)
    mean, slowest : float
    guard : int
        In samples of the replicate.
    weight : float
    law : Law
    basis : HarmonicBasis
        Of all orders over a period.
    """

    angle: Complex
    root: Complex
    kept: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    mean: float
    slowest: float
    guard: int
    weight: float
    law: Law
    basis: HarmonicBasis
    driven: str = "angle"

    def noise(self, rng: np.random.Generator) -> Complex:
        """Draw the noise of angle and moment at every harmonic, shape (h, 2)."""
        drawn = rng.normal(size=(*self.root.shape[:2], 2))
        return np.einsum("hkl,hl->hk", self.root, drawn[..., 0] + 1j * drawn[..., 1])

    def rows(self, noise: Complex | None = None, sign: float = 1.0) -> tuple[Array, Array]:
        """Return moving (θ, θ̇, θ̈), shape (m, 3), and the moment, shape (m,), under noise times a sign."""
        true = self._motion(self.angle)
        shown, more = true, np.zeros(true.shape[0])
        if noise is not None:
            shown = self._motion(self.angle + sign * noise[:, 0] * self.kept[0])
            added = sign * noise[:, 1] * self.kept[1]
            more = self.basis.series(0.0, added.real, -added.imag)
        n = shown.shape[0]
        moving = moving_mask(np.tile(shown[:, 1], 3), self.slowest, self.guard)[n : 2 * n]
        state = np.zeros((self.law.n_states, n))
        moment = self.law.moment(true[:, 0], true[:, 1], np.sign(true[:, 1]), state) + more
        return shown[moving], moment[moving]

    def _motion(self, amplitudes: Complex) -> Array:
        a, b = amplitudes.real, -amplitudes.imag
        return np.column_stack(
            [
                self.basis.series(self.mean, a, b),
                self.basis.derivative(a, b),
                self.basis.second_derivative(a, b),
            ]
        )


@dataclass(frozen=True, eq=False)
class RecordReplicate:
    """A recovered record that does not repeat, with a known law; parameters as of :class:`RecoveredReplicate`.

    The motion is that of the states, their slow part among it.
    """

    state: ForceStates
    angular: Array
    root: Complex
    kept: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    weight: float
    law: Law
    driven: str = "angle"

    noise = RecoveredReplicate.noise

    def rows(self, noise: Complex | None = None, sign: float = 1.0) -> tuple[Array, Array]:
        """Return moving (θ, θ̇, θ̈), shape (m, 3), and the moment, shape (m,), under noise times a sign."""
        state = self.state
        shown = np.column_stack([state.angle, state.rate, state.acceleration])
        still = np.zeros((self.law.n_states, state.n_samples))
        moment = self.law.moment(state.angle, state.rate, np.sign(state.rate), still)
        if noise is not None:
            of_angle, of_moment = sign * noise.T * np.array(self.kept)
            shown = shown + np.column_stack(record_motion(of_angle, self.angular, state.n_samples))
            moment = moment + record_series(of_moment, state.n_samples)
        return shown[state.moving], moment[state.moving]


def recovered_replicate(
    recovery: Recovery, joint: int, state: ForceStates, law: Law, weight: float = 1.0
) -> RecoveredReplicate | RecordReplicate:
    """Return the synthetic replicate of a joint's recovered states under a law.

    Parameters
    ----------
    recovery : Recovery
    joint : int
    state : ForceStates
        As they were made of it.
    law : Law
    weight : float
        What a row of the run counts.
    """
    joints = recovery.transfer.angles.shape[1]
    rows = [joint, joints + joint]
    covariance = recovery.covariance[:, rows][:, :, rows]
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    kept = kept_of(recovery, joint)
    # The law has told the slow harmonics: their noise is not that of the sensors any more.
    kept = (kept[0] & ~slow_orders(recovery, joint), kept[1])
    spectra = recovery.spectra
    if not spectra.repeats:
        return RecordReplicate(state, spectra.angular, root, kept, weight, law)
    n = max(POINTS, POINTS_PER_HARMONIC * int(np.flatnonzero(kept[0] | kept[1])[-1] + 1))
    per = state.sample_rate / spectra.frequency
    orders = np.arange(1, spectra.angular.size + 1)
    mean, a, b = HarmonicBasis.build(state.time - state.time[0], spectra.frequency, orders).fit(state.angle)
    time = np.arange(n) / (n * spectra.frequency)
    return RecoveredReplicate(
        a - 1j * b, root, kept, mean, state.slowest,
        max(1, round(state.guard * n / per)), weight * state.n_samples / n, law,
        HarmonicBasis.build(time, spectra.frequency, orders),
    )  # fmt: skip
