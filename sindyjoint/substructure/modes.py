"""Modes of a structure with joints over their amplitude: backbone and damping."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.linalg import eigh

from sindyjoint.described import same
from sindyjoint.errors import InputError
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array, Booleans
from sindyjoint.substructure.continuation import (
    FREQUENCY_SHARE,
    STEP,
    Scale,
    Solution,
    System,
    follow,
    traced,
)
from sindyjoint.substructure.harmonic_balance import Balance
from sindyjoint.substructure.joint_curves import Varied


@dataclass(frozen=True, eq=False)
class ModeCurve:
    """A mode over its amplitude.

    Parameters
    ----------
    number : int
        From 1.
    point : str
        Whose deflection its amplitude is.
    amplitude : ndarray, shape (n,)
        Of the first harmonic, m.
    frequency, damping : ndarray, shape (n,)
        Hz, and ratio to critical damping.
    angle : ndarray, shape (joints, n)
        Half of the peak-to-peak angle of each joint, rad.
    frequency_error, damping_error : ndarray, shape (n,)
        Standard errors at that amplitude.
    force : ndarray, shape (n,)
        That keeps it up, in phase with the velocity at the point: F = ξ·Ω·(Qᴴ·M·Q)/a, N.
    slips : ndarray, shape (joints,)
        Amplitude at which each joint begins to slip while all others stick, m; not finite where the mode does not
        load a joint.
    tested : ndarray of bool, shape (n,)
        Whether every joint stays within the angle that its model was fitted to.
    harmonics : int
        That were balanced, at most.
    """

    WRITTEN: ClassVar = same(
        *(
            "number",
            "point",
            "slips",
            "amplitude",
            "frequency",
            "damping",
            "frequency_error",
            "damping_error",
            "force",
        ),
        *("tested", "angle"),
    )
    number: int
    point: str
    amplitude: Array
    frequency: Array
    damping: Array
    angle: Array
    frequency_error: Array
    damping_error: Array
    force: Array
    slips: Array
    tested: Booleans
    harmonics: int


def mode_over_amplitude(
    balance: Balance,
    number: int,
    point: str,
    limits: Array,
    *,
    refine: bool = False,
    varied: Varied | None = None,
    tested: Array | float = np.inf,
) -> ModeCurve:
    """Follow a mode from small amplitude to where a joint reaches its limit: the extended periodic motion concept.

    The periodic motion of M·q̈ + C·q̇ + K·q + M_T = ξ·M·q̇₁ at an amplitude, ξ such that nothing is lost; the damping
    ratio is ξ/(2Ω) (Krack, Computers & Structures 154, 2015). Of the rate its first harmonic alone is driven, as by a
    sine: else modes that the harmonics meet are driven as well.

    Parameters
    ----------
    balance : Balance
        Driven at the point.
    number : int
        Of the mode, from 1.
    point : str
        Its name, for the record.
    limits : ndarray, shape (joints,)
        Angle of each joint at which the curve ends, rad.
    refine : bool
        Whether each point is balanced with as many harmonics as it needs, beyond those of the balance.
    varied : Varied, optional
        For the errors of the curve.
    tested : float or ndarray, shape (joints,)
        Angle of each joint up to which its model was tested, rad.

    Raises
    ------
    SimulationError
        Where no periodic motion is found.
    """

    def full(y: Array) -> Array:
        return np.concatenate([y[:-3], [np.exp(y[-1]), 0.0]])

    def curve(balance: Balance) -> tuple[System, Scale]:
        def system(y: Array) -> tuple[Array, Array]:
            x, omega, growth = full(y), y[-3], y[-2]
            step = STEP * omega
            residual, jacobian = balance.residual(x, omega, 0.0, growth)
            ahead, _ = balance.residual(x, omega + step, 0.0, growth, slopes=False)
            more = (balance.linear(omega, growth + step) - balance.linear(omega, growth)) @ x
            columns = [(ahead - residual) / step, more / step, jacobian[:, -2] * x[-2]]
            return residual, np.column_stack([jacobian[:, :-2], *columns])

        def scale(y: Array) -> Array:
            sizes = sizes_of_unknowns(balance, number, float(np.exp(y[-1])))[:-2]
            return np.concatenate([sizes, [FREQUENCY_SHARE * y[-3], FREQUENCY_SHARE * y[-3], 1.0]])

        return system, scale

    slips = slip_amplitudes(balance, number)
    system, scale = curve(balance)
    # Steps along the curve so short that the onset of slip is seen where it is.
    solutions = follow(system, [_first_motion(balance, number, slips, limits)], scale, longest=0.07)
    points = traced(curve, balance, solutions, full, limits, refine)
    omega, growth, log_amplitude = (
        np.array([p.unknowns[place] for *_, p in points]) for place in (-3, -2, -1)
    )
    angle = np.array([own.peak_angles(x) for own, x, _ in points]).T
    errors = np.array([[0.0, 0.0] if varied is None else _errors(own, x, p, varied) for own, x, p in points])
    return ModeCurve(
        number, point, np.exp(log_amplitude), omega / (2 * np.pi), growth / (2 * omega), angle,
        errors[:, 0], errors[:, 1], np.array([_force(own, x, p) for own, x, p in points]), slips,
        np.all(angle <= np.reshape(tested, (-1, 1)), axis=0), max(own.harmonics for own, *_ in points),
    )  # fmt: skip


def _errors(balance: Balance, unknowns: Array, solution: Solution, varied: Varied) -> Array:
    """Return the standard errors of frequency, Hz, and damping ratio at the amplitude of a solution."""
    y = solution.unknowns
    same_amplitude = np.zeros(y.size)
    same_amplitude[-1] = 1.0
    moved = solution.shifted(
        varied.slopes(
            lambda laws: replace(balance, laws=laws).residual(unknowns, y[-3], 0.0, y[-2], slopes=False)[0]
        ),
        same_amplitude,
    )
    damping = moved[-2] / (2 * y[-3]) - y[-2] / (2 * y[-3] ** 2) * moved[-3]
    return varied.errors(np.array([moved[-3] / (2 * np.pi), damping]))


def _force(balance: Balance, unknowns: Array, solution: Solution) -> float:
    """Return the force that supplies what a vibration loses, N: π·F·a = π·ξ·Ω·(Qᴴ·M·Q) per cycle."""
    omega, growth = solution.unknowns[-3], solution.unknowns[-2]
    shape = balance.first_harmonic(unknowns, omega, growth)
    return float(growth * omega * (shape.conj() @ balance.mass @ shape).real / unknowns[-2])


def point_of_mode(structure: Structure, number: int, preferred: str) -> str:
    """Return the point by which a mode is followed: the preferred one unless it is near a node.

    Near means that with locked joints another point moves more than three times as far.
    """
    free = slice(structure.n_joints, None)
    _, shapes = eigh(structure.stiffness[free, free], structure.mass[free, free])
    if not 1 <= number <= shapes.shape[1]:
        raise InputError(f"mode {number} was asked for; the structure has {shapes.shape[1]} modes")
    moves = {name: abs(float(row[free] @ shapes[:, number - 1])) for name, row in structure.points.items()}
    structure.point(preferred)
    farthest = max(moves, key=lambda name: moves[name])
    return preferred if 3 * moves[preferred] > moves[farthest] else farthest


def locked_mode(balance: Balance, number: int) -> tuple[float, Array]:
    """Return ω, rad/s, and shape of a mode with all joints stuck, unit deflection at the point.

    Raises
    ------
    InputError
        If the reduced structure has no such mode.
    """
    joints = len(balance.laws)
    shape = np.zeros(len(balance.mass))
    if not 1 <= number <= shape.size - joints:
        raise InputError(
            f"mode {number} was asked for; the structure is known by {shape.size - joints} modes"
        )
    values, shapes = eigh(balance.stiffness[joints:, joints:], balance.mass[joints:, joints:])
    shape[joints:] = shapes[:, number - 1] / shapes[0, number - 1]
    return float(np.sqrt(values[number - 1])), shape


def tangent_mode(balance: Balance, number: int) -> tuple[float, Array]:
    """Return ω and shape of a mode with the joints' stiffness at zero and no friction, unit deflection at the point."""
    joints = len(balance.laws)
    stiffness = balance.stiffness.copy()
    stiffness[np.arange(joints), np.arange(joints)] += balance.tangents
    values, shapes = eigh(stiffness, balance.mass)
    return float(np.sqrt(max(values[number - 1], 0.0))), shapes[:, number - 1] / shapes[joints, number - 1]


def slip_amplitudes(balance: Balance, number: int) -> Array:
    """Return the deflection of the point at which each joint begins to slip in a mode, all others stuck, m.

    In the mode φ of stuck joints a joint holds the moment (K − ω²·M)·φ of its row; it slips where that is its friction.
    """
    joints = len(balance.laws)
    omega, shape = locked_mode(balance, number)
    held = ((balance.stiffness - omega**2 * balance.mass) @ shape)[:joints]
    friction = np.array([law.friction_interval(0.0, 0.0)[1] for law in balance.laws])
    with np.errstate(divide="ignore"):
        return np.asarray(friction / np.abs(held))


def _first_motion(balance: Balance, number: int, slips: Array, limits: Array) -> Array:
    """Return angles, Ω, ξ and ln a where a mode begins: all joints stuck, or all moving as their stiffness says."""
    angles = np.zeros(balance.size - 2)
    if slips.min() > 0:
        omega, shape = locked_mode(balance, number)
        # A curve begins at half of the amplitude at which the first joint slips.
        begin = 0.5 * float(slips.min())
    else:
        omega, shape = tangent_mode(balance, number)
        joints = len(balance.laws)
        # Where none slips, at a fiftieth of the angles at which it ends.
        begin = 0.02 * float(np.min(limits / np.maximum(np.abs(shape[:joints]), 1e-12)))
        angles[1 :: 2 * balance.harmonics + 1] = shape[:joints] * begin
    growth = float(shape @ balance.damping @ shape / (shape @ balance.mass @ shape))
    return np.concatenate([angles, [omega, growth, np.log(begin)]])


def sizes_of_unknowns(balance: Balance, number: int, deflection: float) -> Array:
    """Return the size of each unknown at an amplitude of the point: angles as in a mode with sliding joints."""
    shape = np.abs(tangent_mode(balance, number)[1][: len(balance.laws)])
    sizes = np.repeat(np.maximum(shape, 1e-3 * shape.max()), 2 * balance.harmonics + 1) * deflection
    return np.append(sizes, [deflection, deflection])
