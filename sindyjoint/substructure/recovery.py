"""Angles and moments of cut-open joints from the sensors of the structure, harmonic by harmonic.

The measured drive and the sensors y are a linear function of what is unknown, the drive f and the joints' moments m:
y = A·(f, m) + noise, A of the structure with open joints. Weighted least squares, W the inverse of the noise
variances: (f, m) = (AᴴWA)⁻¹AᴴW·y with covariance (AᴴWA)⁻¹; the joint angles follow from both, θ = G·(f, m). What the
sensors show beyond the unknowns tells whether the structure is the one described.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from sindyjoint.errors import InputError
from sindyjoint.limits import SOUNDNESS, STATES, SUBSTRUCTURE
from sindyjoint.measurement import signal_end
from sindyjoint.mechanics.rig_test import RigRun, RigTest
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array, Complex
from sindyjoint.substructure import (
    Ends,
    Transfer,
    find_ends,
    jump_columns,
    only_displacement,
    open_joints,
)
from sindyjoint.substructure.spectra import Spectra, between_harmonics, channel_spectra, strongest
from sindyjoint.substructure.steady_response import condense
from sindyjoint.text import list_some


@dataclass(frozen=True, eq=False)
class Recovery:
    """What was recovered of one run.

    Parameters
    ----------
    run : RigRun
    spectra : Spectra
        Of drive and sensors.
    transfer : Transfer
    estimator : ndarray, shape (h, 1 + joints, channels)
        P of (f, m) = P·y.
    states : ndarray, shape (h, 2·joints, channels)
        What gives the joints' angles and then their moments from the channels.
    misfit : float
        Weighted sum of squares of what is left of the channels.
    degrees : int
        Its degrees of freedom.
    ends : Ends or None
        What the ends of a record that does not repeat add; None of a run that does.
    """

    run: RigRun
    spectra: Spectra
    transfer: Transfer
    estimator: Complex
    states: Complex
    misfit: float
    degrees: int
    ends: Ends | None = None

    def rows(self, joint: int) -> list[int]:
        """Return the rows of a joint's angle and of its moment among what was recovered."""
        return [joint, self.transfer.angles.shape[1] + joint]

    @property
    def freed(self) -> Spectra:
        """The spectra without what the ends add."""
        if self.ends is None:
            return self.spectra
        amplitudes = self.spectra.amplitudes - self.ends.channels
        return replace(self.spectra, amplitudes=amplitudes, blocks=amplitudes[None])

    @property
    def values(self) -> Complex:
        """Amplitudes of the joints' angles, rad, and then of their moments, N·m, shape (2·joints, h)."""
        return self._with_ends(np.einsum("hkc,ch->kh", self.states, self.freed.amplitudes))

    @property
    def blocks(self) -> Complex:
        """The same from each block, shape (blocks, 2·joints, h)."""
        return self._with_ends(np.einsum("hkc,bch->bkh", self.states, self.freed.blocks))

    def _with_ends(self, values: Complex) -> Complex:
        if self.ends is not None:
            values[..., : len(self.ends.angles), :] += self.ends.angles
        return values

    @property
    def covariance(self) -> Complex:
        """Covariance of these of a real part (and of an imaginary one), shape (h, 2·joints, 2·joints).

        By the noise of the sensors, which is another at each harmonic.
        """
        return np.einsum("hkc,ch,hlc->hkl", self.states, self.spectra.variance, self.states.conj())

    @property
    def of_ends(self) -> Complex:
        """What errors of the ends, of one standard deviation each, add to these, shape (h, 2·joints, errors)."""
        return np.zeros((*self.states.shape[:2], 0), dtype=complex) if self.ends is None else self.ends.errors

    @property
    def noise(self) -> Array:
        """Standard error of a real part by the noise of the sensors alone, shape (2·joints, h)."""
        return np.sqrt(np.einsum("hkk->kh", self.covariance).real)

    @cached_property
    def standard_error(self) -> Array:
        """Of a real part, shape (2·joints, h)."""
        return np.sqrt(self.noise**2 + np.sum(np.abs(self.of_ends) ** 2, axis=2).T / 2)

    @property
    def coordinates(self) -> Complex:
        """Amplitudes of every coordinate of the structure, shape (n, h)."""
        loads = np.einsum("hkc,ch->hk", self.estimator, self.freed.amplitudes)
        return np.einsum("hnk,hk->nh", self.transfer.coordinates, loads)


def recover(test: RigTest, run: RigRun, spectra: Spectra | None = None) -> Recovery:
    """Recover angles and moments of the joints in a run.

    Parameters
    ----------
    test : RigTest
    run : RigRun
    spectra : Spectra, optional
        Of the run, where they are known already.

    Raises
    ------
    InputError
        With fewer sensors than joints.
    """
    if spectra is not None:
        return _recovered(test, run, spectra)
    by = test.structure, test.at, test.sensors, test.drive_noise
    if by not in run._kept:
        run._kept[by] = _recovered(test, run)
    return run._kept[by]


def _recovered(test: RigTest, run: RigRun, spectra: Spectra | None = None) -> Recovery:
    joints = test.structure.n_joints
    if len(test.sensors) < joints:
        raise InputError(
            f"{len(test.sensors)} sensor(s) for {joints} joints; expected at least one sensor for each joint"
        )
    declared = declared_noise(test)
    if spectra is None:
        spectra = channel_spectra(run, declared, _shown_band(test, run))
        if spectra.repeats and vibrates_freely(test, run, spectra):
            spectra = channel_spectra(_whole_periods(run, spectra), declared, _shown_band(test, run))
    transfer = open_joints(test.structure, test.at, test.sensors, spectra.angular)
    design, sigma, values = transfer.design, np.sqrt(spectra.variance.T), spectra.amplitudes.T
    estimator, _, left = solved(design, sigma, values)
    of_moments = np.eye(1 + joints)[None, 1:].repeat(len(left), axis=0)
    states = np.concatenate([transfer.angles, of_moments], axis=1) @ estimator
    ends = None
    if not spectra.repeats:
        sensors = spectra.amplitudes[1:]
        columns = jump_columns(test.structure, test.sensors, spectra.angular, 1 / spectra.frequency, sensors)
        ends = find_ends(columns, design, estimator, states, 1 / sigma, spectra.amplitudes)
        left = solved(design, sigma, values - ends.channels.T)[2]
    degrees = 2 * spectra.angular.size * (len(test.sensors) - joints)
    misfit = float(np.sum(np.abs(left) ** 2))
    if ends is not None:
        degrees -= ends.unknowns
        if not np.isfinite(declared).any() and 0 < misfit < degrees:
            # The signals do not end within the band, and what was taken for noise is more than sensors disagree by.
            spectra = replace(spectra, variance=spectra.variance * misfit / degrees)
            misfit = float(degrees)
    return Recovery(run, spectra, transfer, estimator, states, misfit, degrees, ends)


def _whole_periods(run: RigRun, spectra: Spectra) -> RigRun:
    """Return a run as a record that does not repeat, which ends where it begins but for its free vibration.

    Where it did not, its mean moments would not be those of equilibrium.
    """
    period = run.sample_rate / spectra.frequency
    count = 1 + round(int((run.drive.size - 1) / period) * period)
    return replace(run, frequency=None, drive=run.drive[:count], responses=run.responses[:, :count])


def vibrates_freely(test: RigTest, run: RigRun, spectra: Spectra) -> bool:
    """Return whether what a run that should repeat has between its harmonics is motion of the structure.

    Noise of the sensors contradicts the structure by as many of its parts as there are sensors beyond joints; a free
    vibration that has not died out does not. The whole record is then taken as it is.
    """
    free, followed = len(test.sensors) - test.structure.n_joints, 1 + test.structure.n_joints
    angular, sigma, values = between_harmonics(run, spectra, HARMONICS)
    rms = np.sqrt(
        np.sum(np.abs(values[:, 1:]) ** 2, axis=0) / np.sum(np.abs(spectra.amplitudes[1:]) ** 2, axis=1)
    )
    if not free or rms.max() < STATES.accuracy:
        return False
    left = solved(open_joints(test.structure, test.at, test.sensors, angular).design, sigma, values)[2]
    share = np.sum(np.abs(left) ** 2) / np.sum(np.abs(values / sigma) ** 2)
    least = scipy.stats.beta.ppf(SOUNDNESS.false_alarm, angular.size * free, angular.size * followed)
    return bool(share < least)


def declared_noise(test: RigTest) -> Array:
    """Return the noise of single samples of drive and sensors as declared, NaN where it was not."""
    return np.array([test.drive_noise or np.nan, *(s.noise or np.nan for s in test.sensors)], dtype=float)


def _shown_band(test: RigTest, run: RigRun) -> float:
    """Return the frequency up to which displacements show anything, Hz; beyond it moments are their noise times ω²."""
    if run.frequency is not None or not only_displacement(test.sensors):
        return np.inf
    return max(signal_end(signal, run.sample_rate).bandwidth for signal in run.responses)


def solved(design: Complex, sigma: Array, values: Complex) -> tuple[Complex, Complex, Complex]:
    """Return the weighted least-squares solution of y = A·u, line by line.

    Parameters
    ----------
    design : ndarray of complex, shape (h, channels, unknowns)
        A.
    sigma : ndarray, shape (h, channels)
        Standard error of a real part.
    values : ndarray of complex, shape (h, channels)
        y.

    Returns
    -------
    ndarray, shapes (h, unknowns, channels), (h, unknowns), (h, channels)
        P of u = P·y, u, and what is left of y in its standard errors.
    """
    weighted = design / sigma[:, :, None]
    norms = np.linalg.norm(weighted, axis=1, keepdims=True)
    norms[norms == 0] = 1.0
    # Directions of the unknowns that sensors do not show are not solved for.
    estimator = np.linalg.pinv(weighted / norms, rcond=1e-10) / sigma[:, None, :] / norms.swapaxes(1, 2)
    unknowns = np.einsum("hkc,hc->hk", estimator, values)
    return estimator, unknowns, (values - np.einsum("hck,hk->hc", design, unknowns)) / sigma


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


def left_held(test: RigTest, spectra: Spectra, angular: Array) -> Complex:
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
    left = [left_held(test, spectra, spectra.angular) for spectra in held]
    # Of each harmonic the drive is eliminated.
    misfits = [float(np.sum(np.abs(each) ** 2)) / (2 * len(each) * len(test.sensors)) for each in left]
    return tuple(
        f"run {run.name!r} updates the structure, and with joints that stick its sensors are "
        f"{np.sqrt(misfit):.1f} times their noise off: the joints slip in it; drive it less"
        for run, misfit in zip(test.update_runs, misfits, strict=True)
        if misfit > SUBSTRUCTURE.contradicts
    )


def unsettled_warnings(recoveries: Sequence[Recovery]) -> tuple[str, ...]:
    """Say which runs should repeat and do not, for the structure still vibrates freely."""
    names = [repr(e.run.name) for e in recoveries if e.run.frequency is not None and not e.spectra.repeats]
    words = (
        f"{list_some(names, 'runs')}: the structure still vibrates freely, so each is taken as a record that does not "
        "repeat; settle longer before recording"
    )
    return (words,) if names else ()


def stated_numbers(test: RigTest) -> Update:
    """Return a test's uncertain numbers as they are stated."""
    prior = np.array([number.uncertainty for number in test.uncertain], dtype=float)
    return Update(
        tuple(number.name for number in test.uncertain), prior, np.zeros(prior.size), np.diag(prior**2)
    )


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
    stated = stated_numbers(test)
    spectra = [strongest(recovery.freed, HARMONICS) for recovery in recoveries]
    stuck = [strongest(each, HARMONICS) for each in held]

    def left(change: Array) -> Array:
        changed = with_numbers(test, change)
        designs = (open_joints(changed.structure, changed.at, changed.sensors, w).design for _, w in spectra)
        parts = [
            solved(design, np.sqrt(kept.variance.T), kept.amplitudes.T)[2].ravel()
            for design, (kept, _) in zip(designs, spectra, strict=True)
        ]
        parts += [left_held(changed, kept, angular).ravel() for kept, angular in stuck]
        values = np.concatenate(parts)
        return np.concatenate([values.real, values.imag, change / stated.prior])

    found = scipy.optimize.least_squares(left, stated.change, x_scale=stated.prior, xtol=1e-6, ftol=1e-6)
    covariance = np.asarray(np.linalg.inv(found.jac.T @ found.jac), dtype=np.float64)
    return replace(stated, change=found.x, covariance=covariance)
