"""Steady response of a structure with joints to a drive that repeats: harmonic balance of all joints, exact sticking.

M·q̈ + C·q̇ + K·q + m(θ, θ̇, z) = b·f with the joint angles θ among the coordinates. At every harmonic of the drive the
coordinates between the joints are condensed, S_h·θ_h + m_h = g_h·f_h, S_h being the dynamic stiffness at the joints; no
mode is left out. Where the structure can move freely with its joints open S_0 vanishes: the law alone then gives
the mean angle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.rig_test import Sensor, load_row
from sindyjoint.mechanics.structure import Structure, tangent_of
from sindyjoint.numeric import SAME, Array, Complex, solve_factored
from sindyjoint.substructure import sensed
from sindyjoint.substructure.harmonic_balance import HOLD, add_joint_moments
from sindyjoint.substructure.spectra import by_harmonic

Factors = tuple[Array, NDArray[np.int32]]


@dataclass(frozen=True, eq=False)
class Condensed:
    """A structure at the harmonics 0 to H of a drive, its joint angles held.

    Parameters
    ----------
    stiffness : ndarray, shape (H + 1, joints, joints)
        S_h.
    load : ndarray, shape (H + 1, joints)
        g_h.
    from_drive : ndarray, shape (H + 1, sensors)
        What each sensor answers to the drive.
    from_angles : ndarray, shape (H + 1, sensors, joints)
        What each sensor answers to the angles.
    """

    stiffness: Complex
    load: Complex
    from_drive: Complex
    from_angles: Complex

    @cached_property
    def linear(self) -> Array:
        """S_h on the real coefficients of all angles, shape (size, size)."""
        return by_harmonic(self.stiffness)


def condense(structure: Structure, at: str, sensors: Sequence[Sensor], omega: float, count: int) -> Condensed:
    """Return a structure at the harmonics 0 to `count` of `omega`, rad/s, of a drive `at` a point or the base."""
    j, load = structure.n_joints, load_row(structure, at)
    w = omega * np.arange(count + 1.0)[:, None, None]
    dynamic = structure.stiffness - w**2 * structure.mass + 1j * w * structure.damping
    right = np.concatenate(
        [np.broadcast_to(load[j:, None], (count + 1, load.size - j, 1)), -dynamic[:, j:, :j]], axis=2
    )
    inner = np.linalg.solve(dynamic[:, j:, j:], right)
    condensed = dynamic[:, :j, :j] + dynamic[:, :j, j:] @ inner[:, :, 1:]
    carried = load[:j] - (dynamic[:, :j, j:] @ inner[:, :, :1])[..., 0]
    held = np.broadcast_to(np.eye(j, 1 + j, 1), (count + 1, j, 1 + j))
    shown = sensed(structure, at, sensors, w[:, 0, 0], np.concatenate([held, inner], axis=1))
    return Condensed(condensed, carried, shown[:, :, 0], shown[:, :, 1:])


@dataclass(frozen=True, eq=False)
class Steady:
    """The balance of a structure's joints under one periodic drive.

    Parameters
    ----------
    condensed : Condensed
    laws : tuple of Law
    omega : float
        rad/s.
    drive : ndarray of complex, shape (H + 1,)
        Amplitudes of the drive, the mean first.
    hold : ndarray, shape (joints,)
        ε of the projection of friction, N·m/rad; see :mod:`sindyjoint.substructure.harmonic_balance`.
    """

    condensed: Condensed
    laws: tuple[Any, ...]
    omega: float
    drive: Complex
    hold: Array

    def load(self, drive: Complex) -> Array:
        """Return the loads of a drive on the joints as coefficients, shape (size,)."""
        return np.ravel(coefficients(self.condensed.load.T * drive))

    def residual(self, angles: Array, slopes: bool = True) -> tuple[Array, Array]:
        """Return what is out of balance, N·m, and its derivatives by the coefficients of the angles, shape (size,)."""
        linear = self.condensed.linear
        out, jacobian = linear @ angles - self.load(self.drive), linear.copy() if slopes else linear
        each = angles.reshape(len(self.laws), -1)
        add_joint_moments(out, jacobian, each, self.laws, self.omega, self.hold, slopes)
        return out, jacobian

    def solve(self, start: Array, factors: Factors | None = None) -> Array:
        """Return the coefficients of the angles in balance.

        With the factors of a balance nearby steps are taken with these as long as they lead on, which needs no further
        derivatives; else by Newton's method. A step that makes the balance worse is halved a few times.

        Raises
        ------
        SimulationError
            Where no balance is found from the start.
        """
        size = SAME * (float(np.abs(self.load(self.drive)).max()) + 1e-300)
        angles, balanced = (start, False) if factors is None else self._by_chords(start, factors, size)
        if balanced:
            return angles
        out, _ = self.residual(angles, slopes=False)
        # Newton steps, from a motion that was recovered and from one nearby.
        for _ in range(40 if factors is None else 6):
            worst = float(np.abs(out).max())
            if not np.isfinite(worst):
                break
            if worst <= size:
                return angles
            step = -np.linalg.solve(self.residual(angles)[1], out)
            # Derivatives cost twenty times what the balance itself does: only steps that are taken need them.
            # A Newton step that makes the balance worse is halved three times before it is taken nevertheless.
            for halving in range(4):
                trial = angles + step / 2**halving
                found, _ = self.residual(trial, slopes=False)
                if float(np.linalg.norm(found)) < float(np.linalg.norm(out)):
                    break
            angles, out = trial, found
        raise SimulationError(
            "no periodic motion of the joints is found near the one that was recovered", time=0.0
        )

    def _by_chords(self, angles: Array, factors: Factors, size: float) -> tuple[Array, bool]:
        """Return angles nearer to the balance, and whether they are in it."""
        before = np.inf
        # Steps with the derivatives of a balance nearby, each of which leaves less than this share of the one before.
        for _ in range(30):
            out, _ = self.residual(angles, slopes=False)
            worst = float(np.abs(out).max())
            if worst <= size:
                return angles, True
            if not worst < 0.6 * before:
                break
            before, angles = worst, angles - solve_factored(factors, out)
        return angles, False

    def shown(self, angles: Array, drive: Complex | None = None) -> Complex:
        """Return what every sensor shows at the harmonics 1 to H, shape (sensors, H)."""
        drive = self.drive if drive is None else drive
        amplitudes = complex_amplitudes(angles, len(self.laws))
        whole = self.condensed.from_drive * drive[:, None] + np.einsum(
            "hsj,jh->hs", self.condensed.from_angles, amplitudes
        )
        return whole[1:].T


def steady(
    structure: Structure,
    laws: Sequence[Any],
    at: str,
    sensors: Sequence[Sensor],
    omega: float,
    drive: Complex,
    condensed: Condensed | None = None,
) -> Steady:
    """Return the balance of a structure with laws in its joints under a drive of amplitudes 0 to H."""
    joints = np.arange(structure.n_joints)
    condensed = condensed or condense(structure, at, sensors, omega, drive.size - 1)
    tangents = np.array([tangent_of(law) for law in laws])
    main = int(np.argmax(np.abs(drive[1:]))) + 1
    hold = HOLD * (np.abs(tangents) + (main * omega) ** 2 * structure.mass[joints, joints])
    return Steady(condensed, tuple(laws), omega, drive, hold)


def coefficients(amplitudes: Complex) -> Array:
    """Return complex amplitudes of orders 0 to H as real coefficients, shape (n, H + 1) → (n, 2H + 1)."""
    values = np.empty((amplitudes.shape[0], 2 * amplitudes.shape[1] - 1))
    values[:, 0] = amplitudes[:, 0].real
    values[:, 1::2], values[:, 2::2] = amplitudes[:, 1:].real, -amplitudes[:, 1:].imag
    return values


def complex_amplitudes(values: Array, count: int) -> Complex:
    """Return real coefficients of some signals as complex amplitudes of orders 0 to H, shape (count, H + 1)."""
    rows = values.reshape(count, -1)
    return np.concatenate([rows[:, :1].astype(complex), rows[:, 1::2] - 1j * rows[:, 2::2]], axis=1)
