"""The structure's own uncertain numbers, updated by what its sensors show beyond the joints.

With more sensors than joints the channels overdetermine drive and moments, and what is left of them at each harmonic,
weighted with its noise, depends on the structure's numbers p (relative changes of a beam's stiffness, a mass, a loss):
r(p) → min Σ|r|² + Σ(p/σ)², σ as the file states them. Gauss–Newton; the posterior covariance is (JᵀJ + diag σ⁻²)⁻¹
(Tarantola, Inverse Problem Theory, SIAM 2005, section 3.2). The joints' moments are eliminated at every step, so no law
is needed (variable projection: Golub and Pereyra 1973).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array
from sindyjoint.substructure.recovery import Recovery, solve_channels
from sindyjoint.substructure.spectra import strongest

ROUNDS = 6
SETTLED = 0.01  # of a posterior standard error
HARMONICS = 24  # of each run, the strongest
STEP = 1e-4  # relative change by which numbers are varied


@dataclass(frozen=True, eq=False)
class Update:
    """The structure's numbers as the sensors show them.

    Parameters
    ----------
    names : tuple of str
    prior : ndarray, shape (k,)
        Relative standard uncertainty as stated.
    change : ndarray, shape (k,)
        Relative change of each.
    covariance : ndarray, shape (k, k)
    """

    names: tuple[str, ...]
    prior: Array
    change: Array
    covariance: Array

    @property
    def standard_error(self) -> Array:
        """Shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    def to_list(self) -> list[dict[str, Any]]:
        """Return the numbers as ``--json`` prints them."""
        rows = zip(
            self.names, self.prior.tolist(), self.change.tolist(), self.standard_error.tolist(), strict=True
        )
        return [
            {"name": name, "stated": stated, "change": change, "standard_error": error}
            for name, stated, change, error in rows
        ]


def with_numbers(test: RigTest, change: Array) -> RigTest:
    """Return a test whose structure's uncertain numbers are changed by relative amounts, shape (k,)."""
    structure = test.structure
    mass, stiffness, loss = (
        matrix + sum(p * getattr(number, name) for p, number in zip(change, test.uncertain, strict=True))
        for name, matrix in (
            ("mass", structure.mass), ("stiffness", structure.stiffness), ("loss", structure.loss),
        )
    )  # fmt: skip
    changed: Structure = replace(structure, mass=mass, stiffness=stiffness, loss=loss)
    return replace(test, structure=changed)


def update_structure(test: RigTest, recoveries: Sequence[Recovery]) -> Update | None:
    """Return the update of a test's uncertain numbers; None where it has none.

    Parameters
    ----------
    test : RigTest
    recoveries : sequence of Recovery
        Of its runs, with the structure as the file describes it.
    """
    if not test.uncertain:
        return None
    prior = np.array([number.uncertainty for number in test.uncertain])
    spectra = [strongest(recovery.freed, HARMONICS) for recovery in recoveries]

    def left(change: Array) -> Array:
        changed = with_numbers(test, change)
        parts = [solve_channels(changed, kept, angular).left.ravel() for kept, angular in spectra]
        values = np.concatenate(parts)
        return np.concatenate([values.real, values.imag, change / prior])

    change = np.zeros(prior.size)
    for _ in range(ROUNDS):
        now = left(change)
        jacobian = np.column_stack([(left(change + STEP * unit) - now) / STEP for unit in np.eye(prior.size)])
        covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)
        step = -covariance @ (jacobian.T @ now)
        change = change + step
        if np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(covariance))):
            break
    return Update(tuple(number.name for number in test.uncertain), prior, change, covariance)
