"""Free motion as rows: what a moment changes of the motion from one reversal to the next.

In a decay no moment is measured, and a small dissipation hides in the noise of the acceleration; in the motion itself
it adds up. Along the measured motion an error r of the moment moves the simulated state x = (δ, δ̇) by

    I·δ̈ + ∂M/∂θ̇·δ̇ + ∂M/∂θ·δ = r,    x(end) = Φ(end, start)·x(start) + ∫ Φ(end, s)·(0, 1/I)·r(s) ds

with the transition matrix Φ of the linearised model. The integral over one half-cycle is an energy and a timing: two
rows. Within it noise of the angle cancels exactly, since the integrand is a total derivative of it; only the states at
its two ends are uncertain, and neighbouring half-cycles share one of them. This is multiple shooting (Bock 1983),
linearised; the integrands are the test functions of a weak form.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.numeric import Array

SERIES = 1e-4  # sinh q/q by its series, which then errs by q⁴/120


@dataclass(frozen=True, eq=False)
class HalfCycles:
    """The rows of a free run.

    Parameters
    ----------
    starts : ndarray of int, shape (half_cycles,)
        First sample of each half-cycle.
    integrand : ndarray, shape (m, 2)
        What a moment at each sample does to angle and (scaled) rate at the end of its half-cycle.
    """

    starts: NDArray[np.intp]
    integrand: Array
    _factor: Array = field(repr=False)

    @classmethod
    def build(
        cls, rate: Array, step: float, slopes: tuple[Array, Array], inertia: float, limit: float,
        noise: tuple[float, float], policy: DiagnosisPolicy = CAMPAIGN,
    ) -> HalfCycles | None:  # fmt: skip
        """Return the rows of a run, or None where it has too few of them.

        Parameters
        ----------
        rate : ndarray, shape (m,)
            rad/s, every ``step`` s.
        step : float
            s.
        slopes : (ndarray, ndarray), each of shape (m,)
            ∂M/∂θ, N·m/rad, and ∂M/∂θ̇, N·m·s/rad.
        inertia : float
            kg·m².
        limit : float
            A rate below it has no sign, rad/s.
        noise : (float, float)
            Standard errors of angle, rad, and rate, rad/s, at a sample.
        policy : DiagnosisPolicy
        """
        ends = reversals(rate, limit)
        if ends.size < policy.fewest_half_cycles:
            return None
        starts = np.concatenate([[0], ends])
        angular = np.pi / (step * float(np.median(np.diff(ends))))
        onward = transition_steps(slopes, inertia, step, angular)
        transitions = np.empty((rate.size, 2, 2))
        ahead = np.eye(2)
        last = set((starts[1:] - 1).tolist())
        for k in range(rate.size - 1, -1, -1):
            ahead = (np.eye(2) if k in last else ahead) @ onward[k]
            transitions[k] = ahead
        # The rate of the state is in units of ω, so that both of its numbers are angles.
        integrand = transitions[:, :, 1] * step / (inertia * angular)
        return cls(
            starts,
            integrand,
            _covariance_factor(transitions[starts], np.array([noise[0], noise[1] / angular])),
        )

    @property
    def size(self) -> int:
        """Number of rows."""
        return 2 * self.starts.size

    def plain(self, moments: Array) -> Array:
        """Return what moments, shape (m,) or (m, k), change of angle and scaled rate at the ends of half-cycles."""
        columns = moments.reshape(moments.shape[0], -1)
        parts = [np.add.reduceat(w[:, None] * columns, self.starts) for w in self.integrand.T]
        return np.stack(parts, axis=1).reshape(self.size, *moments.shape[1:])

    def white(self, moments: Array) -> Array:
        """Return the same in units of independent noise."""
        rows = self.plain(moments)
        solution, _ = scipy.linalg.lapack.dtbtrs(self._factor, rows, uplo="L")
        return solution.reshape(rows.shape)


def reversals(rate: Array, limit: float) -> NDArray[np.intp]:
    """Return the first samples after the rate has changed its sign for good: it passed ``limit`` on both sides."""
    sign = np.where(np.abs(rate) > limit, np.sign(rate), 0)
    fast = np.flatnonzero(sign)
    turns = np.flatnonzero(np.diff(sign[fast]))
    before, after = fast[turns], fast[turns + 1]
    return np.array(
        [a + 1 + int(np.argmin(np.abs(rate[a + 1 : b + 1]))) for a, b in zip(before, after, strict=True)],
        dtype=np.intp,
    )


def _covariance_factor(transition: Array, noise: Array) -> Array:
    """Return the banded Cholesky factor of the rows' covariance: each is e(end) − Φ·e(start) of errors e."""
    spread = np.diag(noise**2)
    own = spread + transition @ spread @ transition.transpose(0, 2, 1)
    shared = -transition[1:] @ spread
    banded = np.zeros((4, 2 * transition.shape[0]))
    banded[0] = np.array([own[:, 0, 0], own[:, 1, 1]]).T.ravel()
    banded[1, 0::2] = own[:, 1, 0]
    banded[2, 0:-2:2], banded[1, 1:-2:2] = shared[:, 0, 0], shared[:, 0, 1]
    banded[3, 0:-2:2], banded[2, 1:-2:2] = shared[:, 1, 0], shared[:, 1, 1]
    return scipy.linalg.cholesky_banded(banded, lower=True, check_finite=False)


def transition_steps(slopes: tuple[Array, Array], inertia: float, step: float, angular: float) -> Array:
    """Return exp(A) of the linearised state equation over one step at each sample, shape (m, 2, 2).

    With h half the trace of A and q² = h² − det A, exp(A) = eʰ·(cosh q·1 + sinh q/q·(A − h·1)).
    """
    stiffness, damping = slopes
    change = np.zeros((stiffness.size, 2, 2))
    change[:, 0, 1] = angular * step
    change[:, 1, 0] = -stiffness / (inertia * angular) * step
    change[:, 1, 1] = -damping / inertia * step
    half = 0.5 * change[:, 1, 1]
    square = half**2 + change[:, 0, 1] * change[:, 1, 0]
    q = np.sqrt(square.astype(complex))
    # Where the slope of friction is steep cosh q alone would overflow.
    rising, falling = np.exp(half + q), np.exp(half - q)
    small = np.abs(q) < SERIES
    series = np.exp(half) * (1 + square / 6)
    even = 0.5 * (rising + falling).real
    odd = np.where(small, series, (0.5 * (rising - falling) / np.where(small, 1.0, q)).real)
    identity = np.eye(2)
    shifted: Array = change - half[:, None, None] * identity
    return even[:, None, None] * identity + odd[:, None, None] * shifted
