"""What was found of the joints inside an assembled structure from its sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.equation.model import JointModel
from sindyjoint.judgement.joint_laws import JointLaw
from sindyjoint.judgement.rig_refinement import RigRefinement
from sindyjoint.judgement.verdict import undecided_by_data
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import Array
from sindyjoint.soundness.check import RigCheck
from sindyjoint.soundness.finding import Soundness
from sindyjoint.substructure.policy import POLICY as LIMITS
from sindyjoint.substructure.recovery import Recovery, Update, UpdatedNumber, recover, with_numbers
from sindyjoint.substructure.states import JointSeen


@dataclass(frozen=True)
class SensorWorth:
    """What a sensor is worth.

    Parameters
    ----------
    name : str
    worth : tuple of float
        By what factor the error of each joint's moment grows without it; infinite where that is no longer determined.
    """

    name: str
    worth: tuple[Maybe, ...]


@dataclass(frozen=True, eq=False, repr=False)
class RigDiscovery(Shown):
    """The result of :func:`~sindyjoint.discover_rig`.

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
    refinement : RigRefinement, optional
        Of the laws on the simulated response, where it was asked for.
    soundness : Soundness
        Of the data.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "rig": "test.name",
        "laws": "laws",
        "joints": "seen",
        **same("sensors", "structure", "misfit", "refinement", "warnings", "soundness"),
    }
    test: RigTest
    laws: tuple[JointLaw, ...]
    update: Update | None
    recoveries: tuple[Recovery, ...]
    seen: tuple[JointSeen, ...]
    worth: Array
    warnings: tuple[str, ...]
    refinement: RigRefinement | None = None
    soundness: Soundness = Soundness()

    @property
    def found(self) -> bool:
        """Whether every kind of joint has a model."""
        return all(law.found for law in self.laws)

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.test.simulated

    @property
    def misfit(self) -> Maybe:
        """What is left of the sensors, in their noise; NaN where there are no more sensors than joints."""
        degrees = sum(recovery.degrees for recovery in self.recoveries)
        return float(np.sqrt(sum(r.misfit for r in self.recoveries) / degrees)) if degrees else float("nan")

    @property
    def sensors(self) -> tuple[SensorWorth, ...]:
        """What each sensor is worth."""
        return tuple(
            SensorWorth(s.name, tuple(column))
            for s, column in zip(self.test.sensors, self.worth.T, strict=True)
        )

    @property
    def structure(self) -> tuple[UpdatedNumber, ...]:
        """The structure's uncertain numbers."""
        return () if self.update is None else self.update.numbers


def misfit_warnings(recoveries: Sequence[Recovery]) -> tuple[str, ...]:
    """Say where sensors and structure disagree, or that nothing shows whether they do."""
    misfit, degrees = sum(r.misfit for r in recoveries), sum(r.degrees for r in recoveries)
    if not degrees:
        return (
            "there are as many sensors as joints: nothing shows whether the structure is the one described",
        )
    if misfit <= LIMITS.disagrees * degrees:
        return ()
    return (
        f"what is left of the sensors is {np.sqrt(misfit / degrees):.1f} times their noise: the structure is not quite "
        "the one described; state how uncertain its stiffness and mass are, so that they are updated",
    )


def with_refinement(found: RigDiscovery, result: RigRefinement) -> RigDiscovery:
    """Return a discovery in a structure with refined laws, and the structure's numbers as the refinement has them."""
    if not result.refined:
        unsure = (
            found if any(each.spectra.repeats for each in found.recoveries) else with_narrow_intervals(found)
        )
        return replace(unsure, refinement=result)
    test, recoveries = found.test, found.recoveries
    if result.update is not None:
        test = with_numbers(described(found), result.update.change)
        recoveries = tuple(recover(test, each.run, each.spectra) for each in recoveries)
    laws = tuple(_with_model(law, result.models[law.kind], result.notes) for law in found.laws)
    return replace(
        found, test=test, recoveries=recoveries, laws=laws, update=result.update, refinement=result
    )


NARROW = (
    "no run repeats: intervals by regression hold the noise of the sensors, and not what the ends of the records and "
    "the band of the sensors do to the states; refine on the simulated response"
)


def with_narrow_intervals(found: RigDiscovery) -> RigDiscovery:
    """Return a discovery of runs that do not repeat with a warning that intervals by regression are too narrow."""
    return replace(found, warnings=(*found.warnings, NARROW))


def described(found: RigDiscovery) -> RigTest:
    """Return the test with the structure as its file describes it, before any update of its numbers."""
    return found.test if found.update is None else with_numbers(found.test, -found.update.change)


def _with_model(law: JointLaw, model: JointModel, notes: Sequence[str]) -> JointLaw:
    assert law.discovery is not None
    warnings = (*law.discovery.warnings, *notes)
    return replace(law, discovery=replace(law.discovery, model=model, warnings=warnings))


def of_data(found: RigDiscovery, checked: RigCheck) -> RigDiscovery:
    """Return a discovery that says what was found of its data, its verdicts no surer than these allow."""
    faults = checked.undecided_by()
    laws = tuple(
        law
        if law.discovery is None
        else replace(
            law,
            discovery=replace(
                law.discovery,
                verdict=undecided_by_data(law.discovery.verdict, faults),
                soundness=checked.soundness,
            ),
        )
        for law in found.laws
    )
    warnings = (*checked.warnings, *found.warnings)
    return replace(found, laws=laws, soundness=checked.soundness, warnings=warnings)
