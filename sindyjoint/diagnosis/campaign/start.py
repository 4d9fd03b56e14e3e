"""What a diagnosis starts from: the campaign as rows, the model fitted to it, the effects that it can show.

Channels that drift within a run are put right first: a mean period would take that for an offset.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.change import (
    MEMBER,
    changes,
    replicates,
    segments,
    without_processing,
)
from sindyjoint.diagnosis.campaign.gap_rows import gap_runs
from sindyjoint.diagnosis.campaign.repair import Repaired, about_zero, model_errors, refit, refit_nonlinear
from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect, effects_of
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.diagnosis.verdict import grows
from sindyjoint.equation.candidates import is_rate_free, rate_free
from sindyjoint.equation.catalogue import as_catalogue
from sindyjoint.equation.formula import unit_for
from sindyjoint.equation.model import Fitted, JointModel
from sindyjoint.equation.test_record import Drift, TestNuisances
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.limits import STATES
from sindyjoint.record import Campaign, Run
from sindyjoint.response import corrected
from sindyjoint.states import (
    ForceStates,
    campaign_states,
    group_labels,
    mean_slope,
    moment_floor,
    one_after_another,
    regression_rows,
    states_of,
    transfer_noise,
)

# Rows of all runs that are searched; more of them hardly change what is found.
SEARCHED = 6000


@dataclass(frozen=True, eq=False)
class Work:
    """A campaign on its way through the search: runs, states and rows as corrected so far.

    ``rows`` are weighted by noise and by what the model leaves beyond it, ``plain`` ones by noise alone.
    """

    campaign: Campaign
    runs: tuple[Run, ...]
    states: tuple[ForceStates, ...]
    groups: tuple[str, ...]
    model: JointModel
    rows: tuple[GapRun, ...]
    plain: tuple[GapRun, ...]
    policy: DiagnosisPolicy = CAMPAIGN

    @classmethod
    def build(
        cls,
        campaign: Campaign,
        runs: Sequence[Run],
        states: Sequence[ForceStates],
        groups: Sequence[str],
        model: JointModel,
        effects: Sequence[FittedEffect] = (),
        policy: DiagnosisPolicy = CAMPAIGN,
    ) -> "Work":
        """Return the work with the rows that its states, and the model with its effects, make."""
        free = campaign.moves_freely
        rows = gap_runs(states, model, groups, policy, free=free)
        own = replicates(runs, states, rows, model, effects, policy)

        def right(rows: tuple[GapRun, ...]) -> tuple[GapRun, ...]:
            return without_processing(rows, states, own, model, effects)

        beyond = model_errors(right(rows), model, effects)
        plain = rows
        if sum(row.target.size for row in plain) > SEARCHED:
            plain = gap_runs(states, model, groups, policy, free=free, most=SEARCHED)
        if any(beyond):
            rows = gap_runs(states, model, groups, policy, errors=beyond, free=free)
        rows, plain = (
            tuple(about_zero(row, model, effects) for row in right(each)) for each in (rows, plain)
        )
        return cls(campaign, tuple(runs), tuple(states), tuple(groups), model, rows, plain, policy)

    def again(
        self,
        model: JointModel,
        effects: Sequence[FittedEffect] = (),
        states: Sequence[ForceStates] | None = None,
    ) -> "Work":
        """Return the work with another model, effects and, where channels were put right, states."""
        states = self.states if states is None else states
        return Work.build(self.campaign, self.runs, states, self.groups, model, effects, self.policy)

    def moment_rows(self) -> tuple[GapRun, ...]:
        """Return rows that are moments of the joint, in free motion too."""
        if not self.campaign.moves_freely:
            return self.rows
        return gap_runs(self.states, self.model, self.groups, self.policy)

    @cached_property
    def kept_states(self) -> tuple[ForceStates, ...]:
        """States of the runs kept for validation, as measured."""
        kept = self.campaign.validation_runs
        states = states_of(self.campaign, kept, rate_share=STATES.passing_rate_share)
        return one_after_another(self.campaign, states)

    @property
    def noise(self) -> dict[str, float]:
        """Noise per run, N·m: of a single sample of the transfer moment, of runs that do not repeat of the sensor."""
        return {
            s.run: transfer_noise(s, self.model.inertia) if s.method == "periodic" else s.noise.moment
            for s in self.states
        }


def kept_out(campaign: Campaign, names: Sequence[str]) -> Campaign:
    """Return the campaign with some runs marked as kept for validation.

    UnknownNameError names one it lacks; InputError, where no other is left.
    """
    known = [run.name for run in campaign.runs]
    for name in names:
        if name not in known:
            raise UnknownNameError(f"hold_out names run {name!r}; the campaign has {', '.join(known)}")
    if set(names) == set(known):
        raise InputError("every run is kept out; expected at least one run to identify from")
    if not names:
        return campaign
    return campaign.with_runs(
        tuple(replace(r, use="validate") if r.name in names else r for r in campaign.runs)
    )


def applicable(
    campaign: Campaign, effects: Sequence[Effect], states: Sequence[ForceStates]
) -> tuple[Effect, ...]:
    """Return the effects that the campaign can show.

    In free motion there is no moment to compare with: the inertia only sets the scale of everything, and a time delay
    between the channels has no meaning. Samples without time show what does without rate. Where every run is one mean
    period, nothing is seen of what changes within it.
    """
    if campaign.quasi_static:
        return tuple(
            replace(effect, variants=variants)
            for effect in effects
            if effect.enters in ("moment", "angle zero")
            and (variants := tuple(v for v in effect.variants if is_rate_free(v)))
        )
    timed = any(s.method != "periodic" or MEMBER in s.run for s in states)
    kept = []
    for effect in effects:
        variants = tuple(v for v in effect.variants if timed or not v.uses & {"time", "elapsed"})
        if variants:
            kept.append(replace(effect, variants=variants))
    if not campaign.moves_freely:
        return tuple(kept)
    return tuple(e for e in kept if e.id != "inertia_error" and e.enters != "time shift")


def cut_up(
    runs: Sequence[Run],
    states: Sequence[ForceStates],
    policy: DiagnosisPolicy = CAMPAIGN,
) -> tuple[tuple[Run, ...], tuple[ForceStates, ...], tuple[str, ...]]:
    """Return runs, states and group labels of the segments of runs that change in time; whole runs otherwise."""
    labels = group_labels(states)
    if not changes(runs, states, policy):
        return tuple(runs), tuple(states), tuple(labels)
    parts = [segments(run, s, policy) for run, s in zip(runs, states, strict=True)]
    return (
        tuple(each.run for part in parts for each in part),
        tuple(each.states for part in parts for each in part),
        tuple(label for label, part in zip(labels, parts, strict=True) for _ in part),
    )


def first_model(
    campaign: Campaign,
    states: Sequence[ForceStates],
    model: JointModel | None,
    base: Any,
    policy: DiagnosisPolicy = CAMPAIGN,
    known: Sequence[Effect] = (),
) -> Repaired:
    """Return the model to start from, fitted to the campaign; its elements become effects, with their ranges."""
    from sindyjoint.discovery.regression import TermRegression

    inertia = campaign.joint.inertia
    rows = regression_rows(states, inertia, with_inputs=False)
    if model is None:
        catalogue = rate_free(as_catalogue(base)) if campaign.quasi_static else as_catalogue(base)
        fitted = (
            TermRegression(catalogue, threshold=0.0, motion=campaign.joint.motion)
            .fit(**rows.fit_arguments())
            .model_
        )
    else:
        fitted = model
    count = np.array([np.count_nonzero(s.moving) for s in states], dtype=float)
    data = Fitted(
        moment_rms=float(np.sqrt(np.mean(rows.y**2))),
        residual_rms=fitted.fitted.residual_rms,
        noise_floor=moment_floor(states, inertia).moment,
        moving_fraction=float(count.sum() / sum(s.n_samples for s in states)),
        samples=int(count.sum()),
        runs=len(states),
        angle=float(np.abs(rows.X[:, 0]).max()),
        rate=float(np.abs(rows.X[:, 1]).max()),
        frequencies=tuple(sorted({round(s.frequency, 6) for s in states if s.frequency is not None})),
        simulated=campaign.simulated,
        mean_known=campaign.mean_known,
        quasi_static=campaign.quasi_static,
    )
    effects = effects_of(fitted, known)
    start = Repaired(
        replace(fitted, joint=campaign.joint, fitted=data, inputs=campaign.inputs).without_elements(), effects
    )
    # The rows' own noise needs the slopes of a law, and the law is fitted best under that noise: twice is enough.
    # No term of a model that was given is dropped before anything is found.
    for _ in range(2):
        own = gap_runs(states, start.model, group_labels(states), policy)
        later = refit_nonlinear(own, start.model, start.effects, policy) if effects else ()
        start = refit(own, start.model, later, drops=False)
    return start


# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any


@dataclass(frozen=True)
class ChannelDrift:
    """A channel whose mean moves along the runs while the other's does not.

    Parameters
    ----------
    drift : Drift
    significance : float
        Median over runs of slope over standard error.
    """

    drift: Drift
    significance: float


def find_drift(
    runs: Sequence[Run], states: Sequence[ForceStates], policy: DiagnosisPolicy = CAMPAIGN
) -> ChannelDrift | None:
    """Return the drifting channel of periodic runs, if one drifts in most of them.

    The mean of each whole period is regressed on time; a drift is a significant slope that moves the channel by a
    notable share of its RMS over the run, in the median run.
    """
    found = []
    for channel in ("moment_drift", "angle_drift"):
        fits = _slopes(channel, runs, states)
        if not fits:
            return None
        ratio = float(np.median([abs(f[0]) / f[1] for f in fits.values()]))
        moved = float(np.median([abs(f[0]) * f[2] for f in fits.values()]))
        if ratio > policy.stands_out and moved > policy.trivial_share:
            found.append(ChannelDrift(Drift(channel, {k: f[3] for k, f in fits.items()}), ratio))
    # A moment and an angle that move together are the joint's own creep.
    return found[0] if len(found) == 1 else None


def _slopes(
    channel: str, runs: Sequence[Run], states: Sequence[ForceStates]
) -> dict[str, tuple[float, float, float, float]]:
    """Return what :func:`mean_slope` says of a channel that may drift, by periodic run."""
    signal = channel.removesuffix("_drift")
    return {
        run.name: mean_slope(getattr(run, signal), run.sample_rate, s)
        for run, s in zip(runs, states, strict=True)
        if s.method == "periodic" and s.frequency
    }


def without_drift_found(problem: Problem) -> tuple[Problem, tuple[Step, ...]]:
    """Return the problem with a drifting channel put right, and the step that this is."""
    work, policy, found = problem.work, problem.policy, problem.drift
    if found is None:
        return problem, ()
    # Of runs kept out of the fit the means give the drift, too, and no model.
    kept = _slopes(found.drift.channel, work.campaign.validation_runs, work.kept_states)
    slopes = {**found.drift.slopes, **{name: fit[3] for name, fit in kept.items()}}
    drift = ChannelDrift(Drift(found.drift.channel, slopes), found.significance)
    campaign = corrected(TestNuisances("", drift=drift.drift), work.campaign)
    states = campaign_states(campaign, rate_share=STATES.passing_rate_share)
    own = gap_runs(states, work.model, work.groups, policy)
    repaired = refit(own, work.model, problem.found)
    runs = campaign.identification_runs
    later = Work.build(campaign, runs, states, work.groups, repaired.model, repaired.effects, policy)
    straight = replace(problem, work=later, repaired=repaired, drift=drift)
    if grows(problem.gap, straight.gap):
        return problem, ()
    return straight, (_drift_step(drift, problem.gap, straight.gap, campaign.joint.motion),)


def belief_in(ratio: float) -> float:
    """Return the probability that a number of so many standard errors is not zero."""
    return float(1 / (1 + np.exp(-0.5 * min(ratio**2, 1e3))))


def _drift_step(found: ChannelDrift, before: Gap, after: Gap, motion: str) -> Step:
    """Return the step that a drifting channel put right is."""
    name = found.drift.channel
    slope = float(np.median(list(found.drift.slopes.values())))
    unit = "N*m/s" if name == "moment_drift" else "rad/s"
    units = {"slope": unit if motion == "rotation" else unit_for(unit, motion)}
    belief = belief_in(found.significance)
    return Step(name, "run", (name,), belief, (), {"slope": slope}, (), before, after, units)
