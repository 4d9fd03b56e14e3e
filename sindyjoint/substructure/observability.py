"""How well the sensors of a structure show each joint: from the covariance of what was recovered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sindyjoint.described import same
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import Array
from sindyjoint.substructure.policy import POLICY
from sindyjoint.substructure.recovery import Recovery, solve_channels
from sindyjoint.substructure.spectra import strongest
from sindyjoint.substructure.states import kept_of, record_series, strongest_line

# Harmonics of each run from which the worth of sensors is computed.
HARMONICS = 8
UNSEEN = 1e6  # factor of a variance that leaves a sensor out


@dataclass(frozen=True)
class JointSeen:
    """How well a joint is shown.

    Parameters
    ----------
    joint : str
    largest_angle : float
        Recovered: √2 of its RMS, rad (m).
    angle_error, moment_error : float
        Standard error of the strongest harmonic, relative, of the run that shows it best.
    together : tuple of str
        Joints from whose moments the sensors cannot tell its own.
    """

    WRITTEN: ClassVar = {"name": "joint", **same("largest_angle", "angle_error", "moment_error", "together")}
    joint: str
    largest_angle: float
    angle_error: float
    moment_error: float
    together: tuple[str, ...]

    @property
    def words(self) -> str:
        """What there is to say of it; empty where it is well shown."""
        if self.together:
            others = ", ".join(map(repr, self.together))
            return f"joint {self.joint!r} shows only together with {others}: add a sensor between them"
        if self.moment_error > POLICY.not_shown:
            return (
                f"the moment of joint {self.joint!r} is known to {100 * self.moment_error:.0f} % only: add a sensor "
                "near it, or drive it harder"
            )
        return ""


def joints_seen(test: RigTest, recoveries: Sequence[Recovery]) -> tuple[JointSeen, ...]:
    """Return how well each joint is shown by the runs together.

    Parameters
    ----------
    test : RigTest
    recoveries : sequence of Recovery
    """
    joints = test.structure.n_joints
    names = [hinge.name for hinge in test.structure.hinges]
    errors, peaks, correlations = [], [], []
    for recovery in recoveries:
        size = np.abs(recovery.values)
        main = np.array([strongest_line(*pair) for pair in zip(size, recovery.standard_error, strict=True)])
        at = np.arange(2 * joints)
        errors.append(recovery.standard_error[at, main] / np.maximum(size[at, main], 1e-300))
        peaks.append([_peak(recovery, joint) for joint in range(joints)])
        of_moments = recovery.covariance[int(np.median(main[joints:]))][joints:, joints:]
        scale = np.sqrt(np.diag(of_moments).real)
        correlations.append(np.abs(of_moments) / np.outer(scale, scale))
    best, common = np.min(errors, axis=0), np.min(correlations, axis=0)
    hidden = best[joints:] > POLICY.not_shown
    return tuple(
        JointSeen(            names[j], float(np.max(peaks, axis=0)[j]), float(best[j]), float(best[joints + j]),
            tuple(names[k] for k in range(joints) if k != j and common[j, k] > POLICY.together and hidden[j]),
        )
        for j in range(joints)
    )  # fmt: skip


def _peak(recovery: Recovery, joint: int) -> float:
    """Return the largest angle of a joint over the series of its harmonics that stand out of their noise, rad."""
    amplitudes = np.where(kept_of(recovery, joint), recovery.values[joint], 0.0)
    return float(np.abs(record_series(amplitudes, 4 * amplitudes.size)).max())


def worth_of_sensors(test: RigTest, recoveries: Sequence[Recovery]) -> Array:
    """Return by what factor the error of each joint's moment grows without each sensor, shape (joints, sensors).

    Of the strongest harmonics of all runs together; infinite where the joint is no longer determined.
    """
    joints, sensors = test.structure.n_joints, len(test.sensors)
    with_all, without = np.zeros(joints), np.zeros((joints, sensors))
    for recovery in recoveries:
        spectra, angular = strongest(recovery.freed, HARMONICS)

        def information(variance: Array, spectra=spectra, angular=angular) -> Array:
            estimator = solve_channels(test, replace(spectra, variance=variance), angular).estimator[:, 1:]
            return np.sum(1 / np.einsum("hkc,ch->hk", np.abs(estimator) ** 2, variance), axis=0)

        with_all += information(spectra.variance)
        for sensor in range(sensors):
            blind = spectra.variance.copy()
            blind[1 + sensor] *= UNSEEN
            without[:, sensor] += information(blind)
    factor = np.sqrt(with_all[:, None] / without)
    return np.where(factor > np.sqrt(UNSEEN) / 30, np.inf, factor)
