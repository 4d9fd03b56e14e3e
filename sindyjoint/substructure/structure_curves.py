"""The curves of a structure with joints as one record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sindyjoint.described import Maybe, same
from sindyjoint.numeric import Array
from sindyjoint.record import Motion
from sindyjoint.shown import Shown
from sindyjoint.substructure.forced import ForcedResponse
from sindyjoint.substructure.modes import ModeCurve


@dataclass(frozen=True)
class JointRange:
    """A joint of the rig, and the angle up to which its model was tested.

    Parameters
    ----------
    name : str
    tested_angle : float
        rad (m); not finite for a joint without a model.
    """

    name: str
    tested_angle: Maybe


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

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "rig": "name",
        **same("motion", "at", "point", "harmonics"),
        "joints": "ranges",
        "frequencies": same("sliding", "locked"),
        **same("modes", "levels", "warnings"),
    }
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

    @property
    def ranges(self) -> tuple[JointRange, ...]:
        """The joints of the rig."""
        return tuple(map(JointRange, self.joints, self.tested.tolist()))
