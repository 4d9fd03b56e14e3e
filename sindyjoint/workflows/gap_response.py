"""The response gap: a model with effects simulated from the measured drive, beside the measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.discovery.model import JointModel
from sindyjoint.discovery.skew import shifted
from sindyjoint.discrepancy.gap import gap_runs
from sindyjoint.discrepancy.naming import FittedEffect, Problem
from sindyjoint.discrepancy.repair import Instant, angle_drift, corrections, law_of
from sindyjoint.errors import SindyJointError
from sindyjoint.record import Campaign, Run
from sindyjoint.states import ForceStates, force_states
from sindyjoint.states.rows import group_labels
from sindyjoint.workflows.diagnosis_start import cut_up, one_after_another
from sindyjoint.workflows.model_law import model_law
from sindyjoint.workflows.response import SimulatedRun, simulate_run

# What is left of the moment beside its sinusoid, over its noise, where the motion and not the moment was the drive.
PURE = 1.5


def simulated(
    run: Run, states: ForceStates, model: JointModel, effects: Sequence[FittedEffect]
) -> SimulatedRun | None:
    """Return a run beside its simulation with the channel errors that were found put right; None where it failed."""
    shift, zero, _ = corrections(effects)
    motion = prescribed(states)
    if shift and not motion:
        # The states were moved to meet the late moment; here the moment is moved, so they go back to their own time.
        run = replace(run, moment=np.interp(run.time + shift, run.time, run.moment), source=None)
        states = shifted(states, -shift)
    if zero:
        run = replace(run, angle=run.angle - zero, source=None)
        states = replace(states, angle=states.angle - zero)
    # What repeats is as it is in its middle; elsewhere time runs on.
    steady, middle = states.method == "periodic", float(np.mean(states.time))
    if drift := angle_drift(effects):
        run = replace(run, angle=run.angle - drift * (middle if steady else run.time), source=None)
        states = replace(states, angle=states.angle - drift * (middle if steady else states.time))
    instant = Instant(middle if steady else float(states.time[0]), states.began, not steady)
    law = law_of(model, effects, model_law, states.frequency or 0.0, instant)
    try:
        return simulate_run(law, run, states, drive="motion" if motion else None)
    except SindyJointError:
        # Snap-through, or a law that no simulation can follow: the gap says so by having no figure.
        return None


def prescribed(states: ForceStates) -> bool:
    """Return whether a run's motion was its drive: a sinusoid of the angle alone, but not of the moment.

    A joint that answers to a sinusoidal moment moves with the harmonics of its friction and its stiffness.
    """
    if states.method != "periodic" or states.frequency is None or states.bandwidth > 1.5 * states.frequency:
        return False
    phase = 2 * np.pi * states.frequency * states.time
    basis = np.column_stack([np.ones(phase.size), np.cos(phase), np.sin(phase)])
    left = states.moment - basis @ np.linalg.lstsq(basis, states.moment, rcond=None)[0]
    floor = max(states.noise.moment, 1e-3 * float(np.std(states.moment)))
    return bool(np.std(left) > PURE * floor)


def response_gap(
    campaign: Campaign,
    runs: Sequence[Run],
    states: Sequence[ForceStates],
    model: JointModel,
    effects: Sequence[FittedEffect],
) -> float:
    """Return the relative RMS of measured less simulated response, over validation runs or else all runs.

    The angle where the moment drives, the moment where the motion does. Runs that the model cannot follow (it snaps
    through, say) are left out; NaN if it can follow none.
    """
    kept = campaign.validation_runs
    if kept:
        whole = one_after_another(campaign, [force_states(run) for run in kept])
        runs, states, _ = cut_up(kept, whole)
    gap = own = 0.0
    for run, state in zip(runs, states, strict=True):
        result = simulated(run, state, model, effects)
        if result is None:
            continue
        if result.simulated_angle is not None:
            measured, other = result.angle, result.simulated_angle
        elif result.drive == "motion":
            measured, other = result.moment, result.simulated_moment
        else:
            continue
        gap += float(np.mean((measured - other) ** 2))
        own += float(np.mean((measured - np.mean(measured)) ** 2))
    return float(np.sqrt(gap / own)) if own > 0 else float("nan")


def processing_error(campaign: Campaign, runs: Sequence[Run], model: JointModel, most: int = 4) -> float:
    """Return what the chain leaves of the model's own simulation: mean square over that of the moment.

    The measured moment drives the model; its angle, with no noise of its own, goes through the same processing.
    """
    chosen = [runs[i] for i in np.unique(np.linspace(0, len(runs) - 1, min(most, len(runs))).astype(int))]
    made = []
    for run in chosen:
        result = simulated(run, force_states(run), model, ())
        if result is None or result.simulated_angle is None:
            return 0.0
        made.append(replace(run, moment=result.moment, angle=result.simulated_angle, rate=None, source=None))
    try:
        states = [force_states(run) for run in made]
    except SindyJointError:
        return 0.0
    rows = gap_runs(states, model, group_labels(states))
    problem = Problem.build(rows, model)
    excess = max(problem.chi_square / problem.degrees - 1.0, 0.0)
    noise = float(np.mean(np.concatenate([r.sigma**2 for r in rows])))
    return excess * noise / model.fitted.moment_rms**2
