"""The structure's own uncertain numbers, updated by what its sensors show beyond the joints.

With more sensors than joints the channels overdetermine drive and moments, and what is left of them at each harmonic,
weighted with its noise, depends on the structure's numbers p (relative changes of a beam's stiffness, a mass, a loss):
r(p) → min Σ|r|² + Σ(p/σ)², σ as the file states them. Gauss–Newton; the posterior covariance is (JᵀJ + diag σ⁻²)⁻¹
(Tarantola, Inverse Problem Theory, SIAM 2005, section 3.2). The joints' moments are eliminated at every step, so no law
is needed (variable projection: Golub and Pereyra 1973). Of runs whose joints stick the drive alone is eliminated, and
the structure shows as a linear one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array
from sindyjoint.substructure.policy import POLICY as LIMITS
from sindyjoint.substructure.recovery import Recovery, declared_noise, solve_channels
from sindyjoint.substructure.simulated.steady import condense
from sindyjoint.substructure.spectra import Spectra, channel_spectra, strongest

HARMONICS = 24  # of each run, the strongest


@dataclass(frozen=True)
class UpdatedNumber:
    """A number of the structure, relative.

    Parameters
    ----------
    name : str
    stated : float
        Standard uncertainty as stated.
    change : float
        By how much it was changed.
    standard_error : float
        To what it is known then.
    """

    name: str
    stated: float
    change: float
    standard_error: float


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

    @property
    def numbers(self) -> tuple[UpdatedNumber, ...]:
        """Number by number."""
        columns = (self.prior, self.change, self.standard_error)
        return tuple(map(UpdatedNumber, self.names, *(column.tolist() for column in columns)))


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


def held_spectra(test: RigTest) -> tuple[Spectra, ...]:
    """Return the spectra of the runs whose joints stick."""
    return tuple(channel_spectra(run, declared_noise(test)) for run in test.update_runs)


def left_held(test: RigTest, spectra: Spectra, angular: Array) -> NDArray[np.complex128]:
    """Return what a structure whose joints stick leaves of the channels, in standard errors, shape (h, channels).

    Parameters
    ----------
    test : RigTest
    spectra : Spectra
        Of some harmonics.
    angular : ndarray, shape (h,)
        Their angular frequencies, rad/s.
    """
    first = 2 * np.pi * spectra.frequency
    orders = np.round(angular / first).astype(np.intp)
    shown = condense(test.structure, test.at, test.sensors, first, int(orders[-1])).from_drive[orders]
    weight = 1 / np.sqrt(spectra.variance.T)
    design = np.hstack([np.ones((orders.size, 1)), shown]) * weight
    values = spectra.amplitudes.T * weight
    drive = np.sum(design.conj() * values, axis=1) / np.sum(np.abs(design) ** 2, axis=1)
    return np.asarray(values - design * drive[:, None])


def held_warnings(test: RigTest, held: Sequence[Spectra]) -> tuple[str, ...]:
    """Say of which runs a structure whose joints stick explains the sensors less well than to their noise."""
    words = []
    for run, spectra in zip(test.update_runs, held, strict=True):
        left = left_held(test, spectra, spectra.angular)
        # Of each harmonic the drive is eliminated.
        misfit = float(np.sum(np.abs(left) ** 2)) / (2 * len(left) * len(test.sensors))
        if misfit > LIMITS.disagrees:
            words.append(
                f"run {run.name!r} updates the structure, and with joints that stick its sensors are "
                f"{np.sqrt(misfit):.1f} times their noise off: the joints slip in it; drive it less"
            )
    return tuple(words)


def update_structure(
    test: RigTest, recoveries: Sequence[Recovery], held: Sequence[Spectra] = ()
) -> Update | None:
    """Return the update of a test's uncertain numbers; None where it has none.

    Parameters
    ----------
    test : RigTest
    recoveries : sequence of Recovery
        Of its runs, with the structure as the file describes it.
    held : sequence of Spectra
        Of runs whose joints stick.
    """
    if not test.uncertain:
        return None
    prior = np.array([number.uncertainty for number in test.uncertain])
    spectra = [strongest(recovery.freed, HARMONICS) for recovery in recoveries]
    stuck = [strongest(each, HARMONICS) for each in held]

    from scipy.optimize import least_squares

    def left(change: Array) -> Array:
        changed = with_numbers(test, change)
        parts = [solve_channels(changed, kept, angular).left.ravel() for kept, angular in spectra]
        parts += [left_held(changed, kept, angular).ravel() for kept, angular in stuck]
        values = np.concatenate(parts)
        return np.concatenate([values.real, values.imag, change / prior])

    found = least_squares(left, np.zeros(prior.size), x_scale=prior, xtol=1e-6, ftol=1e-6)
    covariance = np.asarray(np.linalg.inv(found.jac.T @ found.jac), dtype=np.float64)
    return Update(tuple(number.name for number in test.uncertain), prior, found.x, covariance)
