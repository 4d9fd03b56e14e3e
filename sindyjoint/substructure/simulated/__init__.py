"""A run of a structure with models in its joints, simulated under its measured drive: residuals in units of noise.

The drive was measured with noise, too. To first order its errors δ change what the sensors show by S·δ, S from the
balance itself, and the residual has the covariance V + S·D·Sᵀ, V of the sensors and D of the drive: the residuals are
whitened with that (errors in variables: Fuller, Measurement Error Models, 1987, section 3.2). The structure itself is
not trusted at any frequency: what beam theory leaves out grows with the square of the frequency, and so does the share
of the stiffness that V holds besides, harmonic by harmonic.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import scipy

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array, Complex, solve_factored
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.simulated.segment_parts import Channels
from sindyjoint.substructure.states import lines
from sindyjoint.substructure.steady_response import (
    Condensed,
    Factors,
    Steady,
    coefficients,
    complex_amplitudes,
    condense,
    steady,
)

# Harmonics of the balance, at least, or as multiples of the highest one of the drive: with 41 of a sine the twentieth
# is off by half of itself near a lightly damped mode.
BALANCED, BALANCED_ABOVE = 81, 10


@dataclass(frozen=True, eq=False)
class Answer:
    """What a structure answers in one run.

    Parameters
    ----------
    balance : Steady
    angles : ndarray, shape (size,)
        Coefficients of the joints' angles.
    shown : ndarray of complex, shape (sensors, R)
    """

    balance: Steady
    angles: Array
    shown: Complex

    @cached_property
    def factors(self) -> Factors:
        """Of the derivatives of the balance by the angles."""
        return scipy.linalg.lu_factor(self.balance.residual(self.angles)[1], check_finite=False)

    def moved(self, out: Array) -> Array:
        """Return how the angles move where the balance is out by so much, to first order."""
        return -solve_factored(self.factors, out)


@dataclass(frozen=True, eq=False)
class SteadyRun:
    """A run whose drive repeats.

    Parameters
    ----------
    test : RigTest
        Its sensors.
    name : str
    omega : float
        rad/s.
    drive : ndarray of complex, shape (H + 1,)
    drive_error : ndarray, shape (H + 1,)
        Standard error of real and imaginary part; zero where there is no drive.
    measured : ndarray of complex, shape (sensors, R)
    sigma : ndarray, shape (sensors, R)
        Standard error of real and imaginary part.
    start : ndarray, shape (size,)
        Coefficients of the angles from which the balance is sought: those recovered, before others are known.
    nearby : Answer, optional
        Whose derivatives serve a motion near it.
    factor : ndarray, shape (rows, rows), optional
        L of the covariance L·Lᵀ of the residuals; without it they are those of the sensors alone.
    """

    test: RigTest
    name: str
    omega: float
    drive: Complex
    drive_error: Array
    measured: Complex
    sigma: Array
    start: Array
    nearby: Answer | None = None
    factor: Array | None = None

    @classmethod
    def of(cls, test: RigTest, recovery: Recovery) -> Self:
        """Return a run as it was recovered."""
        spectra, joints = recovery.spectra, test.structure.n_joints
        count = spectra.amplitudes.shape[1]
        error = np.sqrt(spectra.variance)
        size = np.abs(spectra.amplitudes[0])
        driven = lines(size, error[0])
        # The count of harmonics follows strong lines of the drive: one of noise would make it thirty times as large.
        strong = driven & (size > 0.01 * size.max())
        top = int(np.flatnonzero(strong)[-1]) + 1 if strong.any() else 1
        # Harmonics that are compared, at least, or as multiples of the highest one of the drive.
        compared = min(count, max(20, 2 * top))
        harmonics = max(BALANCED, BALANCED_ABOVE * top)
        drive, drive_error = np.zeros(harmonics + 1, dtype=complex), np.zeros(harmonics + 1)
        # Force cells do not see a constant well: where there seems to be one, it is as uncertain as it is large.
        drive[0], drive_error[0] = spectra.mean[0], np.hypot(spectra.mean[0], error[0, 0] / np.sqrt(2))
        orders = 1 + np.flatnonzero(driven[:harmonics])
        drive[orders], drive_error[orders] = spectra.amplitudes[0, orders - 1], error[0, orders - 1]
        angles = np.zeros((joints, harmonics + 1), dtype=complex)
        known = min(count, harmonics)
        angles[:, 1 : known + 1] = recovery.values[:joints, :known]
        return cls(
            test, recovery.run.name, 2 * np.pi * spectra.frequency, drive, drive_error,
            spectra.amplitudes[1:, :compared], error[1:, :compared], coefficients(angles).ravel(),
        )  # fmt: skip

    @property
    def rows(self) -> int:
        """Number of its residuals."""
        return 2 * self.measured.size

    def condensed(self, structure: Structure) -> Condensed:
        """Return a structure at the harmonics of the run."""
        return condense(structure, self.test.at, self.test.sensors, self.omega, self.drive.size - 1)

    def balance(
        self,
        structure: Structure,
        laws: Sequence[Any],
        condensed: Condensed | None = None,
        pulse: float = 1.0,
    ) -> Steady:
        """Return the balance of a structure with laws in its joints under a multiple of the measured drive."""
        drive = pulse * self.drive
        return steady(structure, laws, self.test.at, self.test.sensors, self.omega, drive, condensed)

    def answer(self, balance: Steady) -> Answer:
        """Return the steady motion near where the search for it begins.

        Raises
        ------
        SimulationError
            Where none is found.
        """
        angles = balance.solve(self.start, None if self.nearby is None else self.nearby.factors)
        return Answer(balance, angles, self.seen(balance.shown(angles)))

    def seen(self, shown: Complex) -> Complex:
        """Return the harmonics that are compared."""
        return shown[:, : self.measured.shape[1]]

    def recorded(self, shown: Complex, channels: Channels) -> Complex:
        """Return what sensors with a gain and a delay record."""
        orders = np.arange(1, shown.shape[1] + 1)
        return np.asarray(channels.gain * shown * np.exp(-1j * orders * self.omega * channels.delay))

    def residual(self, shown: Complex) -> Array:
        """Return simulated less measured in standard errors, shape (rows,)."""
        values = in_parts((shown - self.measured) / self.sigma)
        if self.factor is None:
            return values
        return np.asarray(scipy.linalg.solve_triangular(self.factor, values, lower=True, check_finite=False))

    def moved(self, answer: Answer, other: Steady, exactly: bool = True) -> Complex:
        """Return what the sensors show of another structure nearby, to first order, shape (sensors, R).

        The balance of the other one is out by r at the angles of this one, which move by −J⁻¹·r; J is that of a motion
        nearby where it need not be exact.
        """
        out, _ = other.residual(answer.angles, slopes=False)
        of = answer if exactly or self.nearby is None else self.nearby
        if not exactly:
            out = out - answer.balance.residual(answer.angles, slopes=False)[0]
        return self.seen(other.shown(answer.angles + of.moved(out)))

    def begun_at(self, answer: Answer, structure: Structure) -> Self:
        """Return the run with a motion near which others are sought, of a structure, and residuals whitened there."""
        columns = [*self._drive_errors(answer), *self._structure_errors(answer, structure)]
        spread = np.array([in_parts(self.seen(each) / self.sigma) for each in columns]).reshape(-1, self.rows)
        factor = np.asarray(np.linalg.cholesky(np.eye(self.rows) + spread.T @ spread))
        return replace(self, start=answer.angles, nearby=answer, factor=factor)

    def _drive_errors(self, answer: Answer) -> Iterator[Complex]:
        """Yield what the sensors show of a standard error of each line of the drive."""
        steps = np.diag(self.drive_error.astype(complex))
        # A mean has no imaginary part.
        for step in (*steps, *(1j * steps[1:])):
            if step.any():
                yield answer.balance.shown(answer.moved(-answer.balance.load(step)), step)

    def _structure_errors(self, answer: Answer, structure: Structure) -> Iterator[Complex]:
        """Yield what the sensors show of what is not trusted of stiffness, and of loss, at each harmonic."""
        first = 2 * np.pi * float(structure.frequencies(1, locked=True)[0])
        # Share of the stiffness that is not trusted at the structure's first frequency; it grows with the frequency's
        # square. A simulation by steps of 0.25 ms is 0.7e-5 softer at 4 Hz.
        elastic = structure.stiffness[:, :] * 3e-5
        for changed in (
            replace(structure, stiffness=structure.stiffness + elastic),
            replace(structure, loss=structure.loss + elastic),
        ):
            other = replace(answer.balance, condensed=self.condensed(changed))
            yield from self._by_harmonic(answer, other, first)

    def _by_harmonic(self, answer: Answer, other: Steady, first: float) -> Iterator[Complex]:
        """Yield what the sensors show where one harmonic alone is that of another structure."""
        balance = answer.balance
        off = (
            (other.condensed.linear - balance.condensed.linear) @ answer.angles
            - other.load(self.drive)
            + balance.load(self.drive)
        )
        joints, width = len(balance.laws), 2 * balance.drive.size - 1
        compared = np.arange(1, self.measured.shape[1] + 1)
        # Coefficients of each harmonic alone, its cosine and its sine.
        alone = (np.arange(width)[:, None] + 1) // 2 == compared
        moved = answer.moved((off.reshape(joints, width, 1) * alone).reshape(joints * width, -1))
        direct = other.shown(answer.angles) - balance.shown(answer.angles)
        none = np.zeros_like(self.drive)
        for column, order in enumerate(compared):
            shown = balance.shown(moved[:, column], none)
            shown[:, order - 1] += direct[:, order - 1]
            yield shown * (order * self.omega / first) ** 2

    def angles(self, answer: Answer) -> Complex:
        """Return the amplitudes of the joints' angles, the mean first, shape (joints, H + 1)."""
        return complex_amplitudes(answer.angles, len(answer.balance.laws))


def in_parts(values: Complex) -> Array:
    """Return real parts, then imaginary parts, as one vector."""
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def series(amplitudes: Complex, omega: float, time: Array) -> Array:
    """Return Re Σ a_h·exp(i·h·ω·t), h from 1, shape (rows, samples)."""
    out = np.zeros((len(amplitudes), time.size))
    turn = np.exp(1j * omega * time)
    power = np.ones_like(turn)
    for column in amplitudes.T:
        power = power * turn
        out += np.real(column[:, None] * power)
    return out
