"""Harmonic balance of a structure with joints, with exact sticking.

The linear rest is condensed onto the joints and the driven point, harmonic by harmonic: what remains unknown are the
Fourier coefficients of the joints' angles and the first harmonic of the point's deflection. Coulomb friction is
set-valued; its coefficients Λ are what the balance of the joint leaves for it, and they must be the projection of
λ(τ) + ε·dθ/dτ onto the friction interval [−F, F]: the dynamic Lagrangian frequency–time method (Nacivet, Pierre,
Thouverez & Jézéquel, J. Sound and Vibration 265, 2003) with the projection written as one equation, solved by Newton's
method. No regularisation: where a joint sticks its rate is zero up to the harmonics that are kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.mechanics.structure import Structure, craig_bampton, with_coordinate
from sindyjoint.numeric import Array, Complex, Integers
from sindyjoint.substructure.spectra import (
    analysis,
    by_harmonic,
    period_moment,
    rates,
    real_blocks,
    synthesis,
)

SAMPLES_PER_HARMONIC = 8
# ε as a multiple of the stiffness of a joint and of what it carries: from 3 on Newton's method finds its way along the
# modes of the four-panel wing in few steps; from 100 on the harmonics that are left out count for more.
HOLD = 3.0
# A joint that never slips could stand anywhere in its friction interval; this small share of its angle in what is
# projected lets it stand at zero, and turns the phase at which others reverse by as much, rad.
CENTRING = 1e-6


@dataclass(frozen=True, eq=False)
class Balance:
    """The balance of all harmonics; unknowns are (2H + 1) coefficients of each joint's angle, then cos and sin of w.

    Parameters
    ----------
    mass, damping, stiffness : ndarray, shape (n, n)
        Reduced: joint angles first, then the deflection of the driven point; damping as in a simulation, viscous.
    laws : tuple of Law
    output : ndarray, shape (n,)
        Row of the point whose deflection is reported.
    harmonics : int
    tangents : ndarray, shape (joints,)
        Stiffness of each joint at zero, N·m/rad.
    hold : ndarray, shape (joints,)
        ε of the projection, N·m/rad; the solution does not depend on it as harmonics are added.
    """

    mass: Array
    damping: Array
    stiffness: Array
    laws: tuple[Any, ...]
    output: Array
    harmonics: int
    tangents: Array
    hold: Array

    @classmethod
    def of(
        cls,
        structure: Structure,
        at: str,
        point: str | None = None,
        *,
        modes: int = 12,
        harmonics: int = 21,
        mode: int = 1,
    ) -> Self:
        """Return the balance of a structure driven at a point.

        Parameters
        ----------
        structure : Structure
        at, point : str
            Where the force acts, and where the deflection is reported. Default of the second: the first.
        modes : int
            Fixed-interface modes that are kept.
        harmonics : int
        mode : int
            Near whose frequency the motion is, from 1.

        Raises
        ------
        InputError
            For a structure without joints.
        """
        if not structure.n_joints:
            raise InputError(
                "the structure has no joint: its response is linear; expected at least one joint"
            )
        reduced = craig_bampton(with_coordinate(structure, at), [at, point or at], modes)
        joints = np.arange(structure.n_joints)
        tangents = structure.tangent_stiffness()
        near = 2 * np.pi * structure.frequencies(mode)[-1]
        hold = HOLD * (np.abs(tangents) + near**2 * reduced.mass[joints, joints])
        laws = tuple(hinge.law for hinge in structure.hinges)
        return cls(
            reduced.mass, reduced.damping, reduced.stiffness, laws, reduced.point(point or at), harmonics, tangents,
            hold,
        )  # fmt: skip

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.laws) * (2 * self.harmonics + 1) + 2

    def padded(self, unknowns: Array, harmonics: int) -> Array:
        """Return unknowns of so many harmonics, and what may follow them, as of this balance: further ones are zero."""
        joints, width = len(self.laws), 2 * harmonics + 1
        wider = np.zeros((joints, 2 * self.harmonics + 1))
        wider[:, :width] = unknowns[: joints * width].reshape(joints, width)
        return np.concatenate([wider.ravel(), unknowns[joints * width :]])

    def peak_angles(self, unknowns: Array) -> Array:
        """Return half of the peak-to-peak angle of each joint, rad, shape (joints,)."""
        to_time = over_a_period(self.harmonics)[0]
        return np.asarray(np.ptp(unknowns[:-2].reshape(len(self.laws), -1) @ to_time.T, axis=1) / 2)

    def _dynamic(self, omega: float, growth: float, orders: NDArray[Any]) -> Complex:
        """Return D_h = K − (hΩ)²·M + i·h·Ω·(C − ξ·M), ξ in the first harmonic alone, shape (orders, n, n)."""
        h = orders[:, None, None]
        damping = self.damping - growth * (h == 1) * self.mass
        return self.stiffness - (h * omega) ** 2 * self.mass + 1j * h * omega * damping

    def linear(self, omega: float, growth: float = 0.0) -> Array:
        """Return the linear rest condensed onto the unknowns, shape (size, size).

        Parameters
        ----------
        omega : float
            rad/s.
        growth : float
            ξ, 1/s: negative damping of the first harmonic, proportional to mass, that holds a free vibration at its
            amplitude.
        """
        joints = len(self.laws)
        dynamic = self._dynamic(omega, growth, np.arange(self.harmonics + 1))
        matrix = by_harmonic(_condensed(dynamic, slice(0, joints), slice(joints, None)), spare=2)
        # The first harmonic, in which the force acts, keeps the point.
        first = _condensed(dynamic[1:2], slice(0, joints + 1), slice(joints + 1, None))[0]
        matrix[np.ix_(self.first, self.first)] = real_blocks(first)
        return matrix

    @cached_property
    def first(self) -> Integers:
        """Places of the first harmonic of joints and point among the unknowns, cos and sin side by side."""
        rows = np.arange(len(self.laws)) * (2 * self.harmonics + 1)
        return np.append(np.ravel(rows[:, None] + [1, 2]), [self.size - 2, self.size - 1])

    def first_harmonic(self, unknowns: Array, omega: float, growth: float = 0.0) -> Complex:
        """Return the complex amplitudes of all freedoms in the first harmonic, shape (n,)."""
        kept = len(self.laws) + 1
        held = unknowns[self.first[::2]] - 1j * unknowns[self.first[1::2]]
        dynamic = self._dynamic(omega, growth, np.ones(1))[0]
        inner = -np.linalg.solve(dynamic[kept:, kept:], dynamic[kept:, :kept] @ held)
        return np.concatenate([held, inner])

    def deflection(self, unknowns: Array, omega: float) -> complex:
        """Return the complex amplitude of the reported point's first harmonic, m."""
        return complex(self.output @ self.first_harmonic(unknowns, omega))

    def residual(
        self, unknowns: Array, omega: float, force: float = 0.0, growth: float = 0.0, slopes: bool = True
    ) -> tuple[Array, Array]:
        """Return what is out of balance, and its derivatives by the unknowns.

        Parameters
        ----------
        unknowns : ndarray, shape (size,)
        omega : float
            Ω, rad/s.
        force : float
            F of the force F·cos Ωt at the point, N.
        growth : float
            ξ, 1/s.
        slopes : bool
            Whether the derivatives are asked for.

        Returns
        -------
        ndarray, shape (size,); ndarray, shape (size, size)
            N·m, and N in the last two.
        """
        jacobian = self.linear(omega, growth)
        out = jacobian @ unknowns
        out[-2] -= force
        angles = unknowns[:-2].reshape(len(self.laws), -1)
        add_joint_moments(out, jacobian, angles, self.laws, omega, self.hold, slopes)
        return out, jacobian


@lru_cache(maxsize=16)
def over_a_period(harmonics: int) -> tuple[Array, Array, Array, Array]:
    """Return what makes samples of coefficients, coefficients of samples, and samples of d/dτ of coefficients.

    And coefficients of means from each sample to the next: either step lowers harmonic h by cos(πh/n).
    """
    samples = SAMPLES_PER_HARMONIC * (harmonics + 1)
    to_coefficients = analysis(harmonics, samples)
    lowered = np.cos(np.pi * ((np.arange(2 * harmonics + 1) + 1) // 2) / samples) ** 2
    of_means = (to_coefficients + np.roll(to_coefficients, -1, axis=1)) / (2 * lowered[:, None])
    return synthesis(harmonics, samples), to_coefficients, rates(harmonics, samples), of_means


def add_joint_moments(
    out: Array,
    jacobian: Array,
    angles: Array,
    laws: Sequence[Any],
    omega: float,
    hold: Array,
    slopes: bool = True,
) -> None:
    """Add what the joints transfer to the balance of the linear rest, in place; the joints' angles come first.

    Parameters
    ----------
    out, jacobian : ndarray
        What is out of balance, N·m, and its derivatives by the unknowns.
    angles : ndarray, shape (joints, 2H + 1)
        Coefficients of each joint's angle.
    laws : sequence of Law
        Of each joint.
    omega : float
        rad/s.
    hold : ndarray, shape (joints,)
        ε of the projection, N·m/rad.
    slopes : bool
        Whether the derivatives are wanted.

    Raises
    ------
    InputError
        For negative friction.
    """
    width = angles.shape[1]
    to_time, to_coefficients, to_rate, onto = over_a_period(width // 2)
    by = (to_time, omega * to_rate) if slopes else None
    for j, (law, angle) in enumerate(zip(laws, angles, strict=True)):
        own = slice(j * width, (j + 1) * width)
        motion = to_time @ angle, omega * (to_rate @ angle)
        (middle, friction), (d_middle, d_friction) = period_moment(law, motion, by, 2 * np.pi / omega)
        out[own] += to_coefficients @ middle
        if friction.min() < 0:
            raise InputError(
                "a joint has negative friction: its sticking is not determined; expected M_F ≥ 0"
            )
        # What the balance leaves for the friction is −out; in time, and moved on by the rate, it is projected.
        moved = to_time @ -out[own] + hold[j] * (to_rate @ angle + CENTRING * (to_time @ angle))
        mean, by_ends, by_limit = _clipped_means(moved, (friction + np.roll(friction, -1)) / 2)
        out[own] += onto @ mean
        if not slopes:
            continue
        jacobian[own, own] += to_coefficients @ d_middle
        weights = onto * by_ends[0] + np.roll(onto * by_ends[1], 1, axis=1)
        jacobian[own] -= (weights @ to_time) @ jacobian[own]
        jacobian[own, own] += hold[j] * (weights @ (to_rate + CENTRING * to_time))
        if d_friction.any():
            between = (d_friction + np.roll(d_friction, -1, axis=0)) / 2
            jacobian[own, own] += onto @ (by_limit[:, None] * between)


def _clipped_means(values: Array, limit: Array) -> tuple[Array, tuple[Array, Array], Array]:
    """Return the mean of clip(x, −F, F) from each sample of a period to the next, x running straight, and its slopes.

    Samples alone would tell neither where between two of them a joint sticks nor, where it slips back within one step,
    which way to go: the balance would have a corner at every sample.

    Parameters
    ----------
    values : ndarray, shape (n,)
    limit : ndarray, shape (n,)
        F from each sample to the next, not negative.

    Returns
    -------
    ndarray, shape (n,); two ndarray, shape (n,); ndarray, shape (n,)
        The mean, and its derivatives by the samples at both ends and by F.
    """
    ahead = np.roll(values, -1)
    span = ahead - values
    short = np.abs(span) <= 1e-9 * (np.abs(values) + np.abs(ahead) + limit)
    over = np.where(short, 1.0, span)
    here, there = (np.clip(x, -limit, limit) for x in (values, ahead))
    beyond = [np.maximum(np.abs(x) - limit, 0.0) for x in (values, ahead)]
    # The integral of clip is x²/2 up to F and F·|x| − F²/2 beyond.
    areas = [c * c / 2 + limit * far for c, far in zip((here, there), beyond, strict=True)]
    mean = np.where(short, (here + there) / 2, (areas[1] - areas[0]) / over)
    inside = np.where(np.abs(values) < limit, 0.5, 0.0)
    by_ends = np.where(short, inside, (mean - here) / over), np.where(short, inside, (there - mean) / over)
    by_limit = np.where(short, (1 - 2 * inside) * np.sign(values), (beyond[1] - beyond[0]) / over)
    return mean, by_ends, by_limit


def _condensed(dynamic: Complex, kept: slice, inner: slice) -> Complex:
    """Condense dynamic stiffnesses of several orders onto the kept freedoms."""
    solved = np.linalg.solve(dynamic[:, inner, inner], dynamic[:, inner, kept])
    return np.asarray(dynamic[:, kept, kept] - dynamic[:, kept, inner] @ solved)
