"""What segments of a run are made of: their time step, moves of a state, lines compared or projected out."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from sindyjoint.errors import InputError
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import BASE, RigTest, sensor_rows
from sindyjoint.mechanics.structure import Structure
from sindyjoint.mechanics.transient import State
from sindyjoint.mechanics.virtual_rig import OVERSAMPLING
from sindyjoint.numeric import Array, rms

# What the time step may take of a frequency so many times the first one with joints that stick.
SLOW, HARMONIC = 1e-3, 10
# Samples of the drive for one of the record that may do, before `OVERSAMPLING` times as many are simulated.
COARSER = (2, 4)


class Channels(NamedTuple):
    """What drive and sensors of a run may be besides as they were recorded.

    Parameters
    ----------
    pulse : float
        By which the measured drive is multiplied.
    gain : float
        Of all sensors.
    delay : float
        Of all sensors, s.
    """

    pulse: float = 1.0
    gain: float = 1.0
    delay: float = 0.0


RECORDED = Channels()


def pace_of(structure: Structure, rate: float) -> tuple[int, int]:
    """Return how many samples of the drive one of the record needs, and steps of the simulation one of the drive.

    The midpoint rule is slow by (ωh)²/12 of a frequency (Hughes, The Finite Element Method, 1987, section 9.1).
    """
    omega = 2 * np.pi * HARMONIC * float(structure.frequencies(1, locked=True)[0])
    needed = omega / rate / np.sqrt(12 * SLOW)
    finer = next((each for each in COARSER if each >= needed), OVERSAMPLING)
    return finer, int(np.ceil(needed / finer))


def slow_lines(samples: int, highest: float) -> Array:
    """Return the functions of the cosine transform up to a share of the rate, orthonormal, shape (samples, lines)."""
    return np.asarray(scipy.fft.idct(np.eye(samples, int(2 * highest * samples)), norm="ortho", axis=0))


def kept(samples: int) -> int:
    """Return how many coefficients of the cosine transform of a segment lie in the band that is compared."""
    return int(2 * SUBSTRUCTURE.band * samples)


def carried(test: RigTest) -> Array:
    """Return what every sensor shows of the motion of a shaken base itself, shape (sensors,)."""
    if test.at != BASE:
        return np.zeros(len(test.sensors))
    if any(sensor.quantity != "acceleration" for sensor in test.sensors):
        raise InputError("on a shaken base runs that do not repeat are simulated for accelerometers only")
    assert test.structure.base is not None
    return np.asarray(sensor_rows(test.structure, test.sensors) @ test.structure.base)


def moves_of(reduced: Structure, motion: State, top: float) -> tuple[State, ...]:
    """Return moves of a state, of the RMS of a motion: angle and rate of each mode up to a frequency, Hz."""
    joints = np.arange(reduced.n_joints)
    stiffness = reduced.stiffness.copy()
    stiffness[joints, joints] += reduced.tangent_stiffness()
    squared, shapes = scipy.linalg.eigh(stiffness, reduced.mass)
    shapes = shapes[:, : max(1, np.count_nonzero(squared < (2 * np.pi * top) ** 2))]
    still, none = np.zeros(len(shapes)), np.zeros_like(motion[2][0])
    moves: list[State] = []
    for shape in shapes.T:
        angle, rate = (rms(part @ (reduced.mass @ shape)) for part in motion[:2])
        moves += [(angle * shape, still, none), (still, rate * shape, none)]
    return tuple(moves)


def moved(state: State, shift: Sequence[float] | Array, moves: Sequence[State]) -> State:
    """Return a state moved by multiples of some moves."""
    q, v, z = (
        part + sum(s * move[i] for s, move in zip(shift, moves, strict=True)) for i, part in enumerate(state)
    )
    return q, v, z
