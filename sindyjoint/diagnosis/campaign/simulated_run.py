"""A measured run beside the simulation of a model with effects, with the channel errors that were found put right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.clock import STEP_SAMPLES, spend
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, law_of
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics.stickslip import STEPS_PER_SAMPLE
from sindyjoint.numeric import Array, delayed
from sindyjoint.record import Run
from sindyjoint.response.drive import Drive, choose_drive, prescribed
from sindyjoint.response.run import SUBSTEPS, SimulatedRun, simulate_run
from sindyjoint.states import ForceStates


def simulated(
    run: Run,
    states: ForceStates,
    model: JointModel,
    effects: Sequence[FittedEffect],
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
    spend(STEP_SAMPLES * states.n_samples)
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
    if drift:
        run = replace(run, angle=run.angle - drift * _drifting_time(states, run.time), source=None)
        states = replace(states, angle=states.angle - drift * _drifting_time(states, states.time))
    law = law_of(model, effects, states)
    try:
        drive: Drive = "motion" if motion else choose_drive(law, states)
        if by not in (None, drive):
            return None
        most = STEPS_PER_SAMPLE * states.n_samples
        return simulate_run(
            law, run, states, drive=drive, substeps=substeps, response_only=response_only, most_steps=most
        )
    except SindyJointError:
        # Snap-through, or a law that no simulation can follow: the gap says so by having no figure.
        return None


def as_recorded(
    angle: Array, time: Array, sample_rate: float, states: ForceStates, effects: Sequence[FittedEffect]
) -> Array:
    """Return a simulated angle with the errors of the channels back in it, as states moved to meet the moment have it.

    ``time`` is that of its samples in the run, s.
    """
    found = Corrections.of(effects)
    seen = angle + found.zero + found.drift * _drifting_time(states, time)
    return delayed(seen, found.shift * sample_rate) if found.shift else seen


def _drifting_time(states: ForceStates, time: Array) -> Array | float:
    """Return the time by which a channel has drifted, s: what repeats is as it is in its middle."""
    return float(np.mean(states.time)) if states.method == "periodic" else time
