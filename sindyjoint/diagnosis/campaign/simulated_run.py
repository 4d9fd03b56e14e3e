"""A measured run beside the simulation of a model with effects, with the channel errors that were found put right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, Instant, law_of
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.record import Run
from sindyjoint.response.run import SimulatedRun, simulate_run
from sindyjoint.states import ForceStates


def simulated(
    run: Run,
    states: ForceStates,
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy = CAMPAIGN,
) -> SimulatedRun | None:
    """Return a run beside its simulation with the channel errors that were found put right; None where it failed."""
    found = Corrections.of(effects)
    shift, zero, drift = found.shift, found.zero, found.drift
    motion = prescribed(states, policy)
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
    instant = Instant(middle if steady else float(states.time[0]), states.began, not steady)
    law = law_of(model, effects, states.frequency or 0.0, instant)
    try:
        return simulate_run(law, run, states, drive="motion" if motion else None)
    except SindyJointError:
        # Snap-through, or a law that no simulation can follow: the gap says so by having no figure.
        return None


def prescribed(states: ForceStates, policy: DiagnosisPolicy = CAMPAIGN) -> bool:
    """Return whether a run's motion was its drive: a sinusoid of the angle alone, but not of the moment.

    A joint that answers to a sinusoidal moment moves with the harmonics of its friction and its stiffness.
    """
    if states.method != "periodic" or states.frequency is None or states.bandwidth > 1.5 * states.frequency:
        return False
    phase = 2 * np.pi * states.frequency * states.time
    basis = np.column_stack([np.ones(phase.size), np.cos(phase), np.sin(phase)])
    residual = states.moment - basis @ np.linalg.lstsq(basis, states.moment, rcond=None)[0]
    floor = max(states.noise.moment, 1e-3 * float(np.std(states.moment)))
    return bool(np.std(residual) > policy.pure * floor)
