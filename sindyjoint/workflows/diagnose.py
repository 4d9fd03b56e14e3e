"""Where model and measurement disagree, which effect that is, and how much smaller the gap is with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.advice import advise
from sindyjoint.diagnosis.campaign.budget import make_budget
from sindyjoint.diagnosis.campaign.drift import ChannelDrift, find_drift, without_drift
from sindyjoint.diagnosis.campaign.free_decay import polished
from sindyjoint.diagnosis.campaign.gap import gap_of, noise_floor
from sindyjoint.diagnosis.campaign.localisation import where
from sindyjoint.diagnosis.campaign.loop import add_effects
from sindyjoint.diagnosis.campaign.pictures import run_gaps
from sindyjoint.diagnosis.campaign.ranking import TEMPER, Problem
from sindyjoint.diagnosis.campaign.repair import refit, whole_model
from sindyjoint.diagnosis.campaign.response_gap import processing_error
from sindyjoint.diagnosis.campaign.rows import gap_runs
from sindyjoint.diagnosis.campaign.start import (
    RATE_SHARE,
    Work,
    applicable,
    cut_up,
    first_model,
    is_free,
    kept_out,
    one_after_another,
)
from sindyjoint.diagnosis.campaign.verdict import humble, judge, outside_share, unexplained_share
from sindyjoint.diagnosis.effects.catalogue import Effect, load_effects
from sindyjoint.diagnosis.result import Diagnosis, Gap, Step
from sindyjoint.equation.catalogue import Catalogue
from sindyjoint.equation.dimensions import unit_for
from sindyjoint.equation.model import JointModel
from sindyjoint.parallel import spread
from sindyjoint.record import Campaign
from sindyjoint.soundness.identifiability import limits
from sindyjoint.soundness.warnings import falling
from sindyjoint.states import campaign_states
from sindyjoint.workflows.discover import the_campaign

MAX_EFFECTS = 4


def diagnose(
    campaign: Campaign | str | Path | None = None,
    model: JointModel | None = None,
    *,
    base: str | Path | Catalogue | Sequence[str | Path | Catalogue] = "paper",
    library: Sequence[str | Path] = (),
    effects: Sequence[Effect] | None = None,
    max_effects: int = MAX_EFFECTS,
    hold_out: Sequence[str] = (),
    random_state: Any = None,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
) -> Diagnosis:
    """Find where a model and a campaign disagree, name what is missing, add it, and show the gap shrink.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, or None
        ``None``: a virtual test in which ``random_state`` hides an effect, revealed in the result.
    model : JointModel, optional
        Whose terms are the starting point; their coefficients are estimated anew. Default: the terms of ``base``.
    base : library or libraries
        Terms to start from where no model is given.
    library : sequence of str or Path
        Further TOML files of effects; an id that is shipped is replaced.
    effects : sequence of Effect, optional
        Candidates; default: all shipped ones and those of ``library``.
    max_effects : int
        Most effects that are added.
    hold_out : sequence of str
        Names of runs that are kept out of the fit, as if marked ``use = "validate"``.
    random_state : int, Generator or None
    progress : callable, optional
        Called with the name of each stage.
    jobs, workers, cluster
        Where candidates and runs to advise are tried, by default on threads of this process; see
        :func:`~sindyjoint.parallel.executor`. The result is the same to the last digit.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError, UnknownNameError
    """
    from sindyjoint.errors import InputError

    say = progress or (lambda stage: None)
    if max_effects < 1:
        raise InputError(f"max_effects is {max_effects}; at least 1 is wanted")
    known = load_effects(library) if effects is None else effects
    with spread(jobs, workers, cluster):
        return _diagnosed(campaign, model, base, known, max_effects, hold_out, random_state, say)


def _diagnosed(
    campaign: Campaign | str | Path | None,
    model: JointModel | None,
    base: str | Path | Catalogue | Sequence[str | Path | Catalogue],
    effects: Sequence[Effect],
    max_effects: int,
    hold_out: Sequence[str],
    random_state: Any,
    say: Callable[[str], None],
) -> Diagnosis:
    hidden = None
    if campaign is None:
        from sindyjoint.diagnosis.campaign.hidden import hidden_campaign

        say("simulating a virtual test with something hidden in it")
        campaign, hidden = hidden_campaign(random_state)
    campaign = kept_out(the_campaign(campaign, random_state), hold_out)
    say("force states")
    states = one_after_another(campaign, campaign_states(campaign, rate_share=RATE_SHARE))
    whole = campaign.identification_runs
    runs, parts, groups = cut_up(whole, states, RATE_SHARE)
    candidates = applicable(campaign, effects, parts)
    # In segments, drifts of the channels are effects like others.
    drift = find_drift(whole, states) if len(parts) == len(states) else None
    first = Work.build(campaign, runs, parts, groups, first_model(campaign, parts, model, base))
    say("the gap")
    initial = gap_of(first, first.model, ())
    straight, steps = (first, []) if drift is None else _undrifted(first, drift, initial)
    before = steps[-1].gap_after if steps else initial
    repaired, steps, work = add_effects(straight, candidates, max_effects, steps, before, say)
    say("advice")
    if is_free(campaign):
        repaired = polished(campaign, work.states, work.rows, repaired)
    final = steps[-1].gap_after if steps else initial
    noise = noise_floor(first)
    problem, last = (
        Problem.build(first.rows, first.model),
        Problem.build(work.rows, work.model, repaired.effects),
    )
    left = 0.0 if drift is not None else unexplained_share(problem, last, initial, final, noise)
    outside = outside_share(Problem.build(straight.rows, straight.model), last, repaired.effects)
    verdict, reason = judge(problem, steps, left, outside)
    steps = humble(steps, verdict, outside)
    joint = tuple(e for e in repaired.effects if e.effect.enters != "time shift")
    moments = Problem.build(first.moment_rows(), first.model)
    return Diagnosis(
        verdict=verdict,
        reason=reason,
        initial=initial,
        final=final,
        noise_floor=noise,
        budget=make_budget(
            Problem.build(straight.moment_rows(), straight.model),
            initial.moment**2,
            noise.moment**2,
            processing_error(first),
            initial.moment**2 - before.moment**2,
        ),
        where=where(moments, campaign.joint.motion) if verdict != "nothing_missing" else (),
        steps=tuple(steps),
        advice=advise(work.rows, work.states, work.model, repaired.effects, steps, candidates),
        warnings=(*limits(campaign, states), *falling(repaired.model)),
        model=repaired.model,
        effects=repaired.effects,
        whole=whole_model(replace(repaired, effects=joint), work.rows),
        hidden=hidden,
        before=run_gaps(first.moment_rows(), first.model),
        after=run_gaps(work.moment_rows(), repaired.model, repaired.effects) if steps else (),
    )


def _undrifted(work: Work, drift: ChannelDrift, before: Gap) -> tuple[Work, list[Step]]:
    """Return the work with the drifting channel put right, and the step that this is."""
    runs = tuple(without_drift(run, drift) for run in work.runs)
    campaign = work.campaign.with_runs((*runs, *work.campaign.validation_runs))
    states = campaign_states(campaign, rate_share=RATE_SHARE)
    model = refit(gap_runs(states, work.model, work.groups), work.model, ()).model
    later = Work.build(campaign, runs, states, work.groups, model)
    return later, [_drift_step(drift, before, gap_of(later, model, ()), campaign.joint.motion)]


def _drift_step(drift: ChannelDrift, before: Gap, after: Gap, motion: str) -> Step:
    slope = float(np.median(list(drift.slopes.values())))
    # A slope of so many standard errors, tempered as likelihoods of effects are.
    belief = float(1 / (1 + np.exp(-0.5 * drift.significance**2 / TEMPER)))
    unit = "N*m/s" if drift.effect == "moment_drift" else "rad/s"
    units = {"slope": unit if motion == "rotation" else unit_for(unit, motion)}
    return Step(drift.effect, "run", (drift.effect,), belief, (), {"slope": slope}, (), before, after, units)
