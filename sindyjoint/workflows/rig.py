"""A rig in motion: its frequencies, its transient, and how much each joint dissipates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import as_model
from sindyjoint.mechanics.pulse_test import hinges
from sindyjoint.mechanics.rigs import Rig, load_rig
from sindyjoint.mechanics.transient import Response
from sindyjoint.numeric import Array
from sindyjoint.response.verify_rig import PLACEHOLDERS, PlacedModels, joint_range_warnings
from sindyjoint.shown import Shown

MODES = 4


@dataclass(frozen=True, eq=False, repr=False)
class RigMotion(Shown):
    """The result of :func:`rig_motion`.

    Parameters
    ----------
    rig : Rig
    slipping, locked : ndarray, shape (modes,)
        Natural frequencies with the joints' tangent stiffness at standstill, and with locked joints, Hz.
    response : Response
    warnings : tuple of str
    """

    rig: Rig
    slipping: Array
    locked: Array
    response: Response
    warnings: tuple[str, ...] = ()

    @property
    def heat(self) -> dict[str, float]:
        """Energy dissipated in each joint and in the beams, J."""
        response = self.response
        joints = dict(zip(response.joints, response.joint_dissipation.tolist(), strict=True))
        return {**joints, "beams": response.beam_dissipation}

    @property
    def last_slips(self) -> Array:
        """Time at which each joint slips for the last time, s; zero for one that never does."""
        moving = ~self.response.stuck
        return np.array([self.response.time[row].max(initial=0.0) for row in moving])

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        response = self.response
        return {
            "schema": 1,
            "rig": self.rig.name,
            "frequencies": {"slipping": self.slipping.tolist(), "locked": self.locked.tolist()},
            "duration": float(response.time[-1]),
            "points": [
                {"name": name, "peak": float(np.abs(values).max())} for name, values in response.displacement.items()
            ],
            "joints": [
                {
                    "name": name,
                    "peak_angle": float(np.abs(angle).max()),
                    "locked_share": float(stuck.mean()),
                    "last_slip": float(last),
                    "dissipated": float(heat),
                }
                for name, angle, stuck, last, heat in zip(
                    response.joints, response.angle, response.stuck, self.last_slips, response.joint_dissipation,
                    strict=True,
                )
            ],
            "beams_dissipated": response.beam_dissipation,
            "warnings": list(self.warnings),
        }  # fmt: skip


def rig_motion(
    rig: Rig | str | Path,
    model: JointModel | str | Path | None = None,
    *,
    progress: Callable[[str], None] | None = None,
) -> RigMotion:
    """Simulate a rig under the pulse that its file describes.

    Parameters
    ----------
    rig : Rig, str or Path
        The name of a shipped rig, or a TOML file.
    model : JointModel, str or Path, optional
        Replaces the joints that bear its name, or that the rig gives as ``law = "model"``.
    progress : callable, optional

    Returns
    -------
    RigMotion

    Raises
    ------
    InputError
        For a rig or a model that cannot be read, or a rig that needs a model where none is given.
    SimulationError
        When a joint passes its softening limit; carries the time.

    Examples
    --------
    >>> motion = rig_motion("pulse-rig")
    >>> bool(motion.slipping[0] < motion.locked[0])
    True
    """
    say = progress or (lambda stage: None)
    say("reading the rig")
    made = rig if isinstance(rig, Rig) else load_rig(rig, PLACEHOLDERS)
    known = None if model is None else as_model(model)
    placed = PlacedModels.in_rig(made, [] if known is None else [known])
    made = placed.rig
    say("frequencies")
    structure = made.structure()
    slipping, locked = structure.frequencies(MODES), structure.frequencies(MODES, locked=True)
    say(f"simulating {made.duration:g} s")
    response = made.respond()
    modelled = {h.name for h, stands in zip(hinges(made), placed.models, strict=True) if stands is not None}
    warnings = () if known is None else tuple(joint_range_warnings(known, response, modelled))
    return RigMotion(made, slipping, locked, response, warnings)
