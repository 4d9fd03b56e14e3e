"""The curves of a structure with joints as one record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sindyjoint.numeric import Array, finite
from sindyjoint.record import Motion
from sindyjoint.shown import Shown
from sindyjoint.substructure.forced import ForcedResponse
from sindyjoint.substructure.modes import ModeCurve


@dataclass(frozen=True, eq=False, repr=False)
class StructureCurves(Shown):
    """The result of :func:`sindyjoint.curves` for a rig.

    Parameters
    ----------
    name : str
        Of the rig.
    at, point : str
        Where the force acts, and whose deflection the response is.
    joints : tuple of str
    tested : ndarray, shape (joints,)
        Largest angle that each joint's model was fitted to, rad (m); not finite for a joint without a model.
    sliding, locked : ndarray, shape (modes,)
        Natural frequencies with the joints' stiffness at zero, and with locked joints, Hz.
    modes : tuple of ModeCurve
    levels : tuple of ForcedResponse
    harmonics : int
        That were balanced, at most.
    simulated : bool
        True: what is shown follows from a model.
    warnings : tuple of str
    motion : {"rotation", "translation"}
        Of the joints.
    """

    name: str
    at: str
    point: str
    joints: tuple[str, ...]
    tested: Array
    sliding: Array
    locked: Array
    modes: tuple[ModeCurve, ...]
    levels: tuple[ForcedResponse, ...]
    harmonics: int
    simulated: bool = True
    warnings: tuple[str, ...] = ()
    motion: Motion = "rotation"

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "schema": 1,
            "rig": self.name,
            "motion": self.motion,
            "at": self.at,
            "point": self.point,
            "harmonics": self.harmonics,
            "joints": [
                {"name": name, "tested_angle": finite(angle)}
                for name, angle in zip(self.joints, self.tested, strict=True)
            ],
            "frequencies": {"sliding": self.sliding.tolist(), "locked": self.locked.tolist()},
            "modes": [_mode_record(mode) for mode in self.modes],
            "levels": [_level_record(level) for level in self.levels],
            "warnings": list(self.warnings),
        }


def _mode_record(mode: ModeCurve) -> dict[str, Any]:
    names = ("amplitude", "frequency", "damping", "frequency_error", "damping_error", "force", "tested")
    return {
        "number": mode.number,
        "point": mode.point,
        "slips": list(map(finite, mode.slips)),
        **{name: getattr(mode, name).tolist() for name in names},
        "angle": mode.angle.tolist(),
    }


def _level_record(level: ForcedResponse) -> dict[str, Any]:
    frequency, amplitude = level.peak
    edge = float(np.exp(1.96 * level.peak_error))
    names = ("frequency", "amplitude", "phase", "stable", "tested", "frequency_error", "log_error")
    return {
        "force": level.force,
        "peak": {
            "frequency": frequency,
            "amplitude": amplitude,
            "interval95": [amplitude / edge, amplitude * edge],
        },
        "folds": level.folds,
        **{name: getattr(level, name).tolist() for name in names},
        "angle": level.angle.tolist(),
    }
