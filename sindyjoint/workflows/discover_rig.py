"""The law of the joints inside an assembled structure, from the sensors of the structure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.rig_test_file import load_rig_test
from sindyjoint.shown import Shown
from sindyjoint.substructure.observability import JointSeen, joints_seen, worth_of_sensors
from sindyjoint.substructure.recovery import Recovery, recover
from sindyjoint.substructure.update import Update, update_structure, with_numbers
from sindyjoint.workflows.joint_laws import JointLaw, find_laws, with_uncertain_structure

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class RigDiscovery(Shown):
    """The result of :func:`discover_rig`.

    Parameters
    ----------
    test : RigTest
        With the structure's numbers as they were updated.
    laws : tuple of JointLaw
    update : Update or None
        Of the structure's uncertain numbers; None where none is stated.
    recoveries : tuple of Recovery
    seen : tuple of JointSeen
        How well each joint is shown.
    worth : ndarray, shape (joints, sensors)
        By what factor the error of each joint's moment grows without each sensor.
    warnings : tuple of str
    """

    test: RigTest
    laws: tuple[JointLaw, ...]
    update: Update | None
    recoveries: tuple[Recovery, ...]
    seen: tuple[JointSeen, ...]
    worth: Array
    warnings: tuple[str, ...]

    @property
    def found(self) -> bool:
        """Whether every kind of joint has a model."""
        return all(law.found for law in self.laws)

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.test.simulated

    @property
    def misfit(self) -> float:
        """What is left of the sensors, in their noise; NaN where there are no more sensors than joints."""
        degrees = sum(recovery.degrees for recovery in self.recoveries)
        return float(np.sqrt(sum(r.misfit for r in self.recoveries) / degrees)) if degrees else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        update = self.update
        return {
            "schema": 1,
            "rig": self.test.name,
            "laws": [
                {
                    "kind": law.kind,
                    "joints": list(law.joints),
                    "found": law.found,
                    "reason": law.reason,
                    "alike": law.alike,
                    "discovery": None if law.discovery is None else law.discovery.to_dict(),
                }
                for law in self.laws
            ],
            "joints": [
                {
                    "name": each.joint,
                    "largest_angle": each.largest_angle,
                    "angle_error": each.angle_error,
                    "moment_error": each.moment_error,
                    "together": list(each.together),
                }
                for each in self.seen
            ],
            "sensors": [
                {"name": sensor.name, "worth": [float(w) if np.isfinite(w) else None for w in column]}
                for sensor, column in zip(self.test.sensors, self.worth.T, strict=True)
            ],
            "structure": []
            if update is None
            else [
                {"name": name, "stated": stated, "change": change, "standard_error": error}
                for name, stated, change, error in zip(
                    update.names, update.prior.tolist(), update.change.tolist(), update.standard_error.tolist(),
                    strict=True,
                )
            ],
            "misfit": self.misfit if np.isfinite(self.misfit) else None,
            "warnings": list(self.warnings),
        }  # fmt: skip


def discover_rig(
    rig: RigTest | str | Path,
    library: Any = "extended",
    *,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> RigDiscovery:
    """Find the law of the joints in an assembled structure from its sensors.

    Parameters
    ----------
    rig : RigTest, str or Path
        Or a ``rig.toml`` with sensors and runs.
    library
        Candidate terms, as for :func:`~sindyjoint.discover`.
    progress : callable, optional
    **options
        Parameters of :class:`~sindyjoint.JointRegressor`: forced, forbidden, random_state, ...

    Returns
    -------
    RigDiscovery

    Raises
    ------
    InputError
        For a file that cannot be used, too few sensors, or runs that are too short.
    """
    say = progress or (lambda stage: None)
    test = rig if isinstance(rig, RigTest) else load_rig_test(rig)
    runs = test.identification_runs
    if not runs:
        raise InputError("no run is for identification; expected at least one [[run]] with use = 'identify'")
    say("recovering angles and moments of the joints")
    recoveries = tuple(recover(test, run) for run in runs)
    update = update_structure(test, recoveries)
    if update is not None:
        say("updating the structure's numbers")
        test = with_numbers(test, update.change)
        recoveries = tuple(recover(test, each.run, each.spectra) for each in recoveries)
    laws = find_laws(test, recoveries, say, library=library, **options)
    if update is not None:
        say("what the structure's numbers leave uncertain")
        laws = tuple(with_uncertain_structure(law, test, update) for law in laws)
    seen = joints_seen(test, recoveries)
    words = [each.words for each in seen if each.words]
    differ = [law.alike for law in laws if "differ" in law.alike]
    warnings = (*_warnings(recoveries), *words, *differ)
    return RigDiscovery(test, laws, update, recoveries, seen, worth_of_sensors(test, recoveries), warnings)


# Weighted squares per degree of freedom beyond which sensors and structure disagree: noise alone makes 1.
DISAGREES = 2.0


def _warnings(recoveries: Sequence[Recovery]) -> tuple[str, ...]:
    misfit, degrees = sum(r.misfit for r in recoveries), sum(r.degrees for r in recoveries)
    if not degrees:
        return (
            "there are as many sensors as joints: nothing shows whether the structure is the one described",
        )
    if misfit <= DISAGREES * degrees:
        return ()
    return (
        f"what is left of the sensors is {np.sqrt(misfit / degrees):.1f} times their noise: the structure is not quite "
        "the one described; state how uncertain its stiffness and mass are, so that they are updated",
    )
