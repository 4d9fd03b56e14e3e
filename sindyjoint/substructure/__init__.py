"""A structure, its joints cut open: what sensors and joint angles answer to the drive and to the joints' moments.

M·q̈ + C·q̇ + K·q = b·f − E·m: the moments m of the joints are loads on the joint angles θ = Eᵀ·q, which are
coordinates of their own; what remains is linear whatever the joints are (substructuring with the interface forces as
unknowns: de Klerk, Rixen and Voormeeren, AIAA Journal 46(5), 2008; D'Ambrogio and Fregolent, Mechanical Systems and
Signal Processing 45, 2014). At each frequency the dynamic stiffness K − ω²M + iωC is solved as it is; no modes are
left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from sindyjoint.hooks import fetched
from sindyjoint.mechanics.rig_test import BASE, ORDER, Sensor, load_row, sensor_rows
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array, Complex

__getattr__ = fetched(
    __name__,
    {
        "forced": "frequency_response",
        "harmonic_balance": "Balance",
        "joint_curves": "MEASURES loop_measures model_curve",
        "modes": "mode_over_amplitude slip_amplitudes",
        "spectra": "steady_states",
        "recovery": "held_spectra held_warnings recover update_structure with_numbers",
        "simulated.segment_parts": "slow_lines",
        "simulated.segments": "SegmentedRun",
        "steady_response": "coefficients complex_amplitudes steady",
        "states": "joint_states joints_seen worth_of_sensors",
        "unseen": "find_slow",
    },
)


@dataclass(frozen=True, eq=False)
class Transfer:
    """Frequency responses of a structure with open joints to its drive and to unit moments of its joints.

    Parameters
    ----------
    sensors : ndarray, shape (w, sensors, 1 + joints)
        Of every sensor, in its quantity: to the drive, then to the moment of each joint.
    angles : ndarray, shape (w, joints, 1 + joints)
        Of every joint angle, rad.
    coordinates : ndarray, shape (w, n, 1 + joints)
        Of every coordinate of the structure, without the motion of the base.
    """

    sensors: Complex
    angles: Complex
    coordinates: Complex

    @property
    def design(self) -> Complex:
        """Of the channels, the drive first: A of y = A·(f, m), shape (w, 1 + sensors, 1 + joints)."""
        drive = np.broadcast_to(
            np.eye(1, self.sensors.shape[2]), (len(self.sensors), 1, self.sensors.shape[2])
        )
        return np.concatenate([drive, self.sensors], axis=1)


def open_joints(structure: Structure, at: str, sensors: Sequence[Sensor], angular: Array) -> Transfer:
    """Return the frequency responses of a structure with open joints.

    Parameters
    ----------
    structure : Structure
    at : str
        Point of the force, or ``"base"``.
    sensors : sequence of Sensor
    angular : ndarray, shape (w,)
        Angular frequencies above zero, rad/s.
    """
    joints = structure.n_joints
    loads = np.zeros((len(structure.mass), 1 + joints))
    loads[:, 0] = load_row(structure, at)
    loads[:joints, 1:] = -np.eye(joints)
    coordinates = _answers(structure, angular, loads)
    shown = sensed(structure, at, sensors, angular, coordinates)
    return Transfer(shown, coordinates[:, :joints], coordinates)


def sensed(
    structure: Structure, at: str, sensors: Sequence[Sensor], angular: Array, coordinates: Complex
) -> Complex:
    """Return what sensors show, each in its quantity, of answers to the drive and then to others.

    Parameters
    ----------
    structure, at, sensors
        As of :func:`open_joints`.
    angular : ndarray, shape (w,)
        rad/s.
    coordinates : ndarray of complex, shape (w, n, k)

    Returns
    -------
    ndarray, shape (w, sensors, k)
    """
    rows, w = sensor_rows(structure, sensors), angular[:, None]
    powers = np.array([ORDER[sensor.quantity] for sensor in sensors])
    turned = (1j * w) ** powers
    shown = np.einsum("sn,wnk->wsk", rows, coordinates) * turned[:, :, None]
    if at == BASE:
        # Sensors are on what the base carries: they show its motion, too; the drive is its acceleration.
        assert structure.base is not None
        with np.errstate(divide="ignore", invalid="ignore"):
            shown[:, :, 0] += rows @ structure.base * np.where(w > 0, turned / -(w**2), powers == 2)
    return shown


LINES = 64  # of a spectrum, solved at a time


def _answers(structure: Structure, angular: Array, loads: Array) -> Complex:
    """Return what an open structure answers to unit loads, (K − ω²M + iωC)⁻¹·b, shapes (n, k) to (w, n, k)."""
    answers = np.empty((angular.size, *loads.shape), dtype=np.complex128)
    for low in range(0, angular.size, LINES):
        w = angular[low : low + LINES, None, None]
        stiffness = structure.stiffness - w**2 * structure.mass + 1j * w * structure.damping
        answers[low : low + LINES] = np.linalg.solve(
            stiffness, np.broadcast_to(loads, (w.size, *loads.shape))
        )
    return answers


def static_moments(structure: Structure, at: str, drive: float) -> Array | None:
    """Return the mean moments that equilibrium demands under a constant drive, shape (joints,); None where it does not.

    Where the open structure can move freely along its shapes N, K·N = 0, the loads do no work on them:
    Nᵀ(b·f − E·m) = 0. A chain has as many such shapes as joints and all mean moments follow; a joint beside another
    path of the load leaves them open.
    """
    joints = structure.n_joints
    values, shapes = np.linalg.eigh(structure.stiffness)
    free = shapes[:, values < 1e-12 * values[-1]]
    on_joints = free[:joints].T
    if np.linalg.matrix_rank(on_joints, 1e-9) < joints:
        return None
    return np.linalg.lstsq(on_joints, free.T @ load_row(structure, at) * drive, rcond=None)[0]


# Jumps of a mode are expected up to so many times the RMS motion of the sensors.
LARGEST = 3.0


class Ends(NamedTuple):
    """What the ends of a record add to the amplitudes.

    Parameters
    ----------
    channels : ndarray of complex, shape (1 + sensors, h)
    angles : ndarray of complex, shape (joints, h)
        Of the joints, less what a drift and a bend of the record are: those are the slow part's.
    unknowns : int
        Jumps that were found.
    errors : ndarray of complex, shape (h, 2·joints, 2·modes)
        Independent errors of what is recovered, by one standard deviation each, of all harmonics at once.
    """

    channels: Complex
    angles: Complex
    unknowns: int
    errors: Complex


def expected_jumps(sensors: Sequence[Sensor], amplitudes: Complex, angular: Array, modes: Array) -> Array:
    """Return by how much deflections, m, and then velocities, m/s, of modes may jump, shape (2·modes,).

    From what the sensors show, shape (sensors, h). At ω below its own angular frequency ω₀ a mode follows its load as
    if it were static, and inertia loads it as ω²: of that motion (ω/ω₀)² is its own.
    """
    moved = np.array(
        [
            np.abs(series) / angular ** ORDER[sensor.quantity]
            for sensor, series in zip(sensors, amplitudes, strict=True)
        ]
    )
    share = np.minimum(1.0, angular / np.maximum(modes[:, None], angular[0])) ** 4
    return LARGEST * np.concatenate(
        [np.sqrt(np.max(share @ (moved * angular**order).T ** 2, axis=1)) for order in (0, 1)]
    )


def only_displacement(sensors: Sequence[Sensor]) -> bool:
    """Return whether every sensor shows displacement."""
    return all(ORDER[sensor.quantity] == 0 for sensor in sensors)


def jump_columns(
    structure: Structure,
    sensors: Sequence[Sensor],
    angular: Array,
    length: float,
    amplitudes: Complex,
) -> tuple[Complex, Complex]:
    """Return what jumps of each mode's deflection and velocity add, each as large as it is expected to be at most.

    Over a record of length T the series of a rate is (ẋ)_k = iω·x_k + (2/T)·[x] with the jump [x] = x(T) − x(0). So the
    linear rest with open joints answers at each harmonic

        (K + iωC − ω²M)·q_k = b·f_k − E·m_k − (2/T)·((iωM + C)·[q] + M·[q̇])

    exactly, whatever the motion is at the ends (the transient term of frequency-domain identification: Pintelon and
    Schoukens, System Identification, 2nd ed., 2012, section 6.3). The jumps are the same at all harmonics: a few
    numbers, those of the modes within the band and well above it. No mode jumps by much more than the sensors move.

    Parameters
    ----------
    structure : Structure
    sensors : sequence of Sensor
    angular : ndarray, shape (h,)
    length : float
        Of the record, s.
    amplitudes : ndarray of complex, shape (sensors, h)
        Of the sensors.

    Returns
    -------
    channels : ndarray, shape (h, 1 + sensors, 2·modes)
    angles : ndarray, shape (h, joints, 2·modes)
    """
    joints = structure.n_joints
    squared, shapes = eigh(structure.stiffness, structure.mass)
    # Modes up to so many times the highest frequency: the static part of those above is left out.
    kept = squared <= (10.0 * angular[-1]) ** 2
    squared, shapes = squared[kept], shapes[:, kept]
    shapes = shapes / np.abs(np.array([*structure.points.values()]) @ shapes).max(axis=0)
    w, scale = angular[:, None, None], 2.0 / length
    rows = np.vstack([sensor_rows(structure, sensors), np.eye(joints, len(structure.mass))])
    # Loads and what is shown may be exchanged: the structure is symmetric.
    answers = _answers(structure, angular, rows.T).swapaxes(1, 2)
    by_rate = answers @ (structure.mass @ shapes)
    by_deflection = 1j * w * by_rate + answers @ (structure.damping @ shapes)
    moved: Complex = np.asarray(
        -scale * np.concatenate([by_deflection, by_rate], axis=2), dtype=np.complex128
    )
    shown, turned = moved[:, : len(sensors)], moved[:, len(sensors) :]
    at, powers = rows[: len(sensors)] @ shapes, np.array([[ORDER[sensor.quantity]] for sensor in sensors])
    # Of a rate and of an acceleration the jumps themselves are a part.
    parts = ((powers > 0) * (1j * w) ** (powers - 1.0) * at, (powers > 1) * (1j * w) ** (powers - 2.0) * at)
    channels = np.zeros((angular.size, 1 + len(sensors), shown.shape[2]), dtype=complex)
    channels[:, 1:] = (1j * w) ** powers * shown + scale * np.concatenate(parts, axis=2)
    # A jump of the angle is a drift, (2/T)·i/ω of the series; one of its rate a bend, (2/T)/ω².
    of_angle = shapes[:joints]
    smooth = np.concatenate([1j / w * of_angle, 1 / w**2 * of_angle], axis=2) * scale
    if only_displacement(sensors):
        smooth *= 0  # These sensors show them.
    sizes = expected_jumps(sensors, amplitudes, angular, np.sqrt(np.maximum(squared, 0)))
    shown_channels: Complex = np.asarray(channels * sizes, dtype=np.complex128)
    angles: Complex = (turned - smooth) * sizes
    return shown_channels, angles


def find_ends(
    columns: tuple[Complex, Complex],
    design: Complex,
    estimator: Complex,
    states: Complex,
    weight: Array,
    amplitudes: Complex,
) -> Ends:
    """Return what the ends add, the jumps found by least squares.

    Parameters
    ----------
    columns : tuple of ndarray
        Of :func:`jump_columns`.
    design, estimator : ndarray, shapes (h, channels, unknowns), (h, unknowns, channels)
        How the channels follow drive and moments, and these the channels.
    states : ndarray, shape (h, 2·joints, channels)
        How what is recovered follows the channels.
    weight : ndarray, shape (h, channels)
    amplitudes : ndarray of complex, shape (channels, h)
    """
    channels, angles = columns
    left = channels - design @ (estimator @ channels)
    target = amplitudes.T[:, :, None] - design @ (estimator @ amplitudes.T[:, :, None])
    rows = (left * weight[:, :, None]).reshape(-1, left.shape[2])
    said = (target * weight[:, :, None]).ravel()
    rows, said = np.vstack([rows.real, rows.imag]), np.concatenate([said.real, said.imag])
    unknowns = rows.shape[1]
    factor: Array = np.asarray(np.linalg.qr(np.column_stack([rows, said]), mode="r"))
    shown = np.vstack([factor[:, :unknowns], np.eye(unknowns)])
    jumps = np.linalg.lstsq(shown, np.concatenate([factor[:, unknowns], np.zeros(unknowns)]), rcond=None)[0]
    # How many of them the channels tell, and not what was expected.
    _, singular, turned = np.linalg.svd(factor[:unknowns, :unknowns])
    told = float(np.sum(singular**2 / (1 + singular**2)))
    spread = turned.T / np.sqrt(1 + singular**2)
    added = -states @ channels
    added[:, : angles.shape[1]] += angles
    return Ends((channels @ jumps).T, (angles @ jumps).T, round(told), added @ spread)
