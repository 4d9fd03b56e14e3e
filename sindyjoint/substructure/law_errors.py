"""What the noise of the sensors makes of the coefficients of a law, the slow parts of its angles being free.

Coefficients c and unknowns u of the slow parts solve one weighted least squares of rows A·(c, u) ≈ M. An error of the
recovered amplitudes, δθ of the angle and δM of the moment at each harmonic, is an error of the rows,
e(t) = Re Σ (δM − (∂M/∂θ + iω·∂M/∂θ̇)·δθ)·exp(iωt), and of the coefficients, δc = (AᵀA)⁻¹Aᵀ·e, of which the first
entries. With the covariance of the amplitudes known, that of the coefficients follows: the slow parts are marginalised,
and noise that angle and moment share is in it (propagation of errors through least squares whose weights are not those
of the noise: the sandwich of Huber, Proc. 5th Berkeley Symposium 1, 1967).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.states.record import ForceStates
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.states import kept_of, slow_orders
from sindyjoint.substructure.unseen import LawRows

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Source(NamedTuple):
    """What the rows of a joint in a run were made of."""

    recovery: Recovery
    joint: int
    states: ForceStates


@dataclass(frozen=True, eq=False)
class LawErrors:
    """How the coefficients of a law follow errors of what was recovered.

    Parameters
    ----------
    sources : tuple of Source
    slopes : tuple of ndarray of complex, each of shape (k, h, 2)
        δc = Re Σ slopes·(δθ, δM) over the harmonics of each joint in each run.
    excess : float
        Mean square of what is left of the rows, of what noise makes of it; at least one.
    """

    sources: tuple[Source, ...]
    slopes: tuple[Complex, ...]
    excess: float

    @property
    def covariance(self) -> Array:
        """Of the coefficients, shape (k, k). Joints of one run share its sensors, and their errors go together."""
        k = len(self.slopes[0])
        total = np.zeros((k, k))
        for recovery in {id(s.recovery): s.recovery for s in self.sources}.values():
            joints = recovery.transfer.angles.shape[1]
            gathered = np.zeros((k, recovery.values.shape[1], 2 * joints), dtype=complex)
            for source, slope in zip(self.sources, self.slopes, strict=True):
                if source.recovery is recovery:
                    gathered[:, :, [source.joint, joints + source.joint]] += slope
            total += np.einsum(
                "khi,hij,lhj->kl", gathered, recovery.covariance, gathered.conj(), optimize=True
            ).real
        return total * self.excess

    def change(self, others: Sequence[Recovery]) -> Array:
        """Return by how much the coefficients change where the same runs are recovered otherwise, shape (k,)."""
        total = np.zeros(len(self.slopes[0]))
        for source, slope, other in zip(self.sources, self.slopes, others, strict=True):
            rows = _rows(source.recovery, source.joint)
            difference = (other.values - source.recovery.values)[rows]
            total += np.einsum("khi,ih->k", slope, difference).real
        return total


def law_errors(rows: LawRows, sources: Sequence[Source]) -> LawErrors:
    """Return how the coefficients of a law follow errors of the recovered amplitudes.

    Parameters
    ----------
    rows : LawRows
        Of the law.
    sources : sequence of Source
        Of its runs, in their order.
    """
    k, width = rows.coefficients.size, rows.columns.shape[1]
    counts = np.concatenate([np.zeros(k), rows.said])
    scale = np.sqrt(np.sum(rows.columns**2, axis=0) + counts**2)
    scale[scale == 0] = 1.0
    scaled = rows.columns / scale
    inverse = np.linalg.pinv(scaled.T @ scaled + np.diag((counts / scale) ** 2), rcond=1e-14, hermitian=True)
    first = inverse[:k] / scale[:k, None] / scale
    slopes, expected, left = [], 0.0, 0.0
    starts = np.cumsum([0, *(kept.size for kept in rows.kept)])
    unknowns = k + np.cumsum([0, *(values.size for values in rows.unknowns)])
    assert unknowns[-1] == width
    for index, source in enumerate(sources):
        root = np.sqrt(rows.weights[index])
        of_rows = first @ rows.columns[starts[index] : starts[index + 1]].T * root
        errors = _row_errors(source, rows.kept[index], rows.slopes[index])
        slope = np.einsum("kn,nhi->khi", of_rows, errors)
        slow = np.flatnonzero(slow_orders(source.recovery, source.joint))
        # Behind the mean stand cosines and sines of the slow harmonics, as the sensors show them.
        place = unknowns[index] + 1 + np.arange(slow.size)
        said = first * counts**2
        slope[:, slow, 0] += said[:, place] + 1j * said[:, place + slow.size]
        slopes.append(slope)
        expected += root**2 * _expected(source, errors)
        left += root**2 * float(np.sum(rows.residual[index] ** 2))
    return LawErrors(tuple(sources), tuple(slopes), max(1.0, left / expected))


def _rows(recovery: Recovery, joint: int) -> list[int]:
    return [joint, recovery.transfer.angles.shape[1] + joint]


def _row_errors(source: Source, kept: NDArray[np.intp], slopes: tuple[Array, Array]) -> Complex:
    """Return the error of each row by errors of angle and moment at each harmonic, shape (n, h, 2)."""
    state, recovery = source.states, source.recovery
    angular = recovery.spectra.angular
    spin = np.exp(1j * np.outer((state.time - state.time[0])[kept], angular))
    of_angle, of_moment = kept_of(recovery, source.joint)
    of_angle = of_angle & ~slow_orders(recovery, source.joint)
    by_angle = -(slopes[0][:, None] + 1j * angular * slopes[1][:, None]) * spin * of_angle
    return np.stack([by_angle, spin * of_moment], axis=-1)


def _expected(source: Source, errors: Complex) -> float:
    """Return the sum of squares of the rows that the noise makes; the moment is that of single blocks."""
    covariance = source.recovery.covariance[:, _rows(source.recovery, source.joint)]
    covariance = covariance[:, :, _rows(source.recovery, source.joint)].copy()
    covariance[:, 1, 1] *= source.states.block[-1] + 1
    return float(np.einsum("nhi,hij,nhj->", errors, covariance, errors.conj(), optimize=True).real)
