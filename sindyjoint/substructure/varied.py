"""How a solution of harmonic balance depends on the numbers of the joints' models, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array
from sindyjoint.substructure.harmonic_balance import Balance
from sindyjoint.substructure.joint_curves import varied_laws


@dataclass(frozen=True, eq=False)
class Varied:
    """The laws of all joints with one number of a model smaller and larger, for each number.

    Parameters
    ----------
    laws : sequence of (laws, laws, float)
        Each with a law per joint, and the step between the middle and either of them.
    covariance : ndarray, shape (k, k)
        Of the numbers.
    """

    laws: Sequence[tuple[tuple[Any, ...], tuple[Any, ...], float]]
    covariance: Array

    @classmethod
    def of(cls, laws: Sequence[Any], models: Sequence[JointModel | None]) -> Varied | None:
        """Return the variations of joints by their models, one model for joints that share it; None without any.

        Parameters
        ----------
        laws : sequence of Law
            Of each joint.
        models : sequence of JointModel or None
            Of each joint; None where its law is taken as known.
        """
        found = []
        blocks: list[Array] = []
        for model in {id(m): m for m in models if m is not None}.values():
            varied = varied_laws(model)
            for low, high, step in varied:
                ends = (
                    tuple(end if m is model else law for m, law in zip(models, laws, strict=True))
                    for end in (low, high)
                )
                found.append((*ends, step))
            places = np.flatnonzero(model.number_errors > 0)
            blocks.append(model.covariance_matrix[np.ix_(places, places)])
        if not found:
            return None
        from scipy.linalg import block_diag

        return cls(found, block_diag(*blocks))  # type: ignore[arg-type]

    def changes(
        self, balance: Balance, unknowns: Array, omega: float, force: float = 0.0, growth: float = 0.0
    ) -> Array:
        """Return the derivatives of the residual by the numbers, shape (size, k)."""
        columns = []
        for low, high, step in self.laws:
            ends = [
                balance.with_laws(laws).residual(unknowns, omega, force, growth, slopes=False)[0]
                for laws in (low, high)
            ]
            columns.append((ends[1] - ends[0]) / (2 * step))
        return np.array(columns).T

    def errors(self, slopes: Array) -> Array:
        """Return standard errors of quantities by their derivatives, shape (..., k) → (...)."""
        variance = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
