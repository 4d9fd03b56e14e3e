"""A structure with its joints cut open: what sensors and joint angles answer to the drive and to the joints' moments.

M·q̈ + C·q̇ + K·q = b·f − E·m: the moments m of the joints are loads on the joint angles θ = Eᵀ·q, which are
coordinates of their own; what remains is linear whatever the joints are (substructuring with the interface forces as
unknowns: de Klerk, Rixen and Voormeeren, AIAA Journal 46(5), 2008; D'Ambrogio and Fregolent, Mechanical Systems and
Signal Processing 45, 2014). At each frequency the dynamic stiffness K − ω²M + iωC is solved as it is; no modes are
left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rig_test import BASE, ORDER, Sensor, load_row, sensor_rows
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array

Complex = NDArray[np.complex128]


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
    w = angular[:, None, None]
    stiffness = structure.stiffness - w**2 * structure.mass + 1j * w * structure.damping
    broad = np.broadcast_to(loads, (angular.size, *loads.shape))
    coordinates = np.asarray(np.linalg.solve(stiffness, broad), dtype=np.complex128)
    shown = np.einsum("sn,wnk->wsk", sensor_rows(structure, sensors), coordinates)
    if at == BASE:
        # Sensors are on what the base carries: they show its motion, too.
        assert structure.base is not None
        shown[:, :, 0] += (sensor_rows(structure, sensors) @ structure.base) / -(angular[:, None] ** 2)
    powers = np.array([ORDER[sensor.quantity] for sensor in sensors])
    return Transfer(shown * ((1j * w) ** powers[:, None]), coordinates[:, :joints], coordinates)


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
