"""A measured run beside the simulation of a model with effects, with the channel errors that were found put right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, law_of
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.record import Run
from sindyjoint.response.drive import Drive, choose_drive, prescribed
from sindyjoint.response.run import SUBSTEPS, SimulatedRun, simulate_run
from sindyjoint.states import ForceStates


def simulated(
    run: Run,
    states: ForceStates,
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy = CAMPAIGN,
    substeps: int = SUBSTEPS,
    response_only: bool = False,
    spurious: bool = False,
    by: Drive | None = None,
) -> SimulatedRun | None:
    """Return a run beside its simulation with the channel errors that were found put right; None where it failed.

    Of the response alone: under a moment the simulated moment is not filled where nothing needs it.
    With ``spurious`` a motion whose few harmonics may be noise was the drive, too. None also where the drive is
    another than it has to be.
    """
    found = Corrections.of(effects)
    shift, zero, drift = found.shift, found.zero, found.drift
    motion = prescribed(states, spurious, inertia=model.inertia)
    if shift and not motion:
        # The states were moved to meet the late moment; here the moment is moved, so they go back to their own time.
        run = replace(run, moment=np.interp(run.time + shift, run.time, run.moment), source=None)
        states = shifted(states, -shift)
    if zero:
        run = replace(run, angle=run.angle - zero, source=None)
        states = replace(states, angle=states.angle - zero)
    # What repeats is as it is in its middle; elsewhere time runs on.
    steady, middle = states.method == "periodic", float(np.mean(states.time))
    if drift:
        run = replace(run, angle=run.angle - drift * (middle if steady else run.time), source=None)
        states = replace(states, angle=states.angle - drift * (middle if steady else states.time))
    law = law_of(model, effects, states)
    try:
        drive: Drive = "motion" if motion else choose_drive(law, states)
        if by not in (None, drive):
            return None
        return simulate_run(law, run, states, drive=drive, substeps=substeps, response_only=response_only)
    except SindyJointError:
        # Snap-through, or a law that no simulation can follow: the gap says so by having no figure.
        return None
