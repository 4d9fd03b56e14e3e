"""Channels that drift within a run: what a mean period would take for an offset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.repair import refit
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.diagnosis.verdict import grows
from sindyjoint.equation.dimensions import unit_for
from sindyjoint.record import Run
from sindyjoint.states import ForceStates, campaign_states
from sindyjoint.states.floor import mean_slope
from sindyjoint.states.policy import POLICY as STATES

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any


@dataclass(frozen=True)
class ChannelDrift:
    """A channel whose mean moves along the runs while the other's does not.

    Parameters
    ----------
    effect : {"moment_drift", "angle_drift"}
    slopes : dict of str to float
        Per run, N·m/s or rad/s.
    significance : float
        Median over runs of slope over standard error.
    """

    effect: str
    slopes: dict[str, float]
    significance: float


def find_drift(
    runs: Sequence[Run], states: Sequence[ForceStates], policy: DiagnosisPolicy = CAMPAIGN
) -> ChannelDrift | None:
    """Return the drifting channel of periodic runs, if one drifts in most of them.

    The mean of each whole period is regressed on time; a drift is a significant slope that moves the channel by a
    notable share of its RMS over the run, in the median run.
    """
    periodic = [(r, s) for r, s in zip(runs, states, strict=True) if s.method == "periodic" and s.frequency]
    if not periodic:
        return None
    found = {}
    for name, signal in (("moment_drift", "moment"), ("angle_drift", "angle")):
        fits = {run.name: mean_slope(getattr(run, signal), run.sample_rate, s) for run, s in periodic}
        ratio = float(np.median([abs(f[0]) / f[1] for f in fits.values()]))
        moved = float(np.median([abs(f[0]) * f[2] for f in fits.values()]))
        if ratio > policy.stands_out and moved > policy.trivial_share:
            found[name] = ChannelDrift(name, {k: f[3] for k, f in fits.items()}, ratio)
    # A moment and an angle that move together are the joint's own creep.
    return next(iter(found.values())) if len(found) == 1 else None


def without_drift_found(problem: Problem) -> tuple[Problem, tuple[Step, ...]]:
    """Return the problem with a drifting channel put right, and the step that this is."""
    work, policy = problem.work, problem.policy
    if problem.drift is None:
        return problem, ()
    drift = _with_kept_runs(problem.drift, work.campaign.validation_runs, work.kept_states)
    runs = tuple(_without_drift(run, drift) for run in work.runs)
    campaign = work.campaign.with_runs(tuple(_without_drift(run, drift) for run in work.campaign.runs))
    states = campaign_states(campaign, rate_share=STATES.passing_rate_share)
    own = gap_runs(states, work.model, work.groups, policy)
    repaired = refit(own, work.model, problem.found)
    later = Work.build(campaign, runs, states, work.groups, repaired.model, repaired.effects, policy)
    straight = replace(problem, work=later, repaired=repaired, drift=drift)
    if grows(problem.gap, straight.gap):
        return problem, ()
    return straight, (_drift_step(drift, problem.gap, straight.gap, campaign.joint.motion, policy),)


def _with_kept_runs(drift: ChannelDrift, runs: Sequence[Run], states: Sequence[ForceStates]) -> ChannelDrift:
    """Return a drift with the slopes of runs kept out of the fit, too: their means give them, and no model."""
    signal = drift.effect.removesuffix("_drift")
    own = {
        run.name: mean_slope(getattr(run, signal), run.sample_rate, s)[3]
        for run, s in zip(runs, states, strict=True)
        if s.method == "periodic" and s.frequency
    }
    return replace(drift, slopes={**drift.slopes, **own})


def _without_drift(run: Run, drift: ChannelDrift) -> Run:
    """Return the run with its drifting channel put right; the drift is zero at the first sample."""
    ramp = drift.slopes.get(run.name, 0.0) * run.time
    if drift.effect == "moment_drift":
        return replace(run, moment=run.moment - ramp)
    return replace(run, angle=run.angle - ramp)


def _drift_step(drift: ChannelDrift, before: Gap, after: Gap, motion: str, policy: DiagnosisPolicy) -> Step:
    """Return the step that a drifting channel put right is."""
    slope = float(np.median(list(drift.slopes.values())))
    belief = float(1 / (1 + np.exp(-0.5 * drift.significance**2)))
    unit = "N*m/s" if drift.effect == "moment_drift" else "rad/s"
    units = {"slope": unit if motion == "rotation" else unit_for(unit, motion)}
    return Step(drift.effect, "run", (drift.effect,), belief, (), {"slope": slope}, (), before, after, units)
