"""Where model and measurement disagree, which effect that is, and how much smaller the gap is with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.discovery.catalogue import Catalogue
from sindyjoint.discovery.dimensions import unit_for
from sindyjoint.discovery.model import JointModel
from sindyjoint.discrepancy.budget import make_budget
from sindyjoint.discrepancy.drift import ChannelDrift, find_drift, without_drift
from sindyjoint.discrepancy.effects import Effect, load_effects
from sindyjoint.discrepancy.gap import gap_runs
from sindyjoint.discrepancy.naming import TEMPER, FittedEffect, Problem, Ranking, fit_effects, rank
from sindyjoint.discrepancy.pairs import hidden_pair
from sindyjoint.discrepancy.places import where
from sindyjoint.discrepancy.repair import Repaired, refit, whole_model
from sindyjoint.parallel import spread
from sindyjoint.record import Campaign
from sindyjoint.states import campaign_states
from sindyjoint.workflows.advice import advise
from sindyjoint.workflows.diagnosis import Diagnosis, Gap, Step
from sindyjoint.workflows.diagnosis_add import BELIEF, Added, add_effect
from sindyjoint.workflows.diagnosis_gap import gap_of, noise_floor
from sindyjoint.workflows.diagnosis_runs import run_gaps
from sindyjoint.workflows.diagnosis_start import (
    RATE_SHARE,
    Work,
    applicable,
    cut_up,
    first_model,
    is_free,
    kept_out,
    one_after_another,
)
from sindyjoint.workflows.diagnosis_verdict import humble, judge, outside_share, unexplained_share
from sindyjoint.workflows.discover import the_campaign
from sindyjoint.workflows.free_decay import polished
from sindyjoint.workflows.gap_response import processing_error
from sindyjoint.workflows.limits import limits

MAX_EFFECTS = 4
# An effect that helps the moment but makes the simulated response worse by this factor stands in for something else.
WORSE_RESPONSE = 1.5
LITTLE_HELP = 0.7
# Where nothing repeats, an effect must win this share of a gap on what it never saw to be added.
LEAST_GAIN = 0.05
MOST_REFUSALS = 2


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
        from sindyjoint.workflows.hidden import hidden_campaign

        say("simulating a virtual test with something hidden in it")
        campaign, hidden = hidden_campaign(random_state)
    campaign = kept_out(the_campaign(campaign, random_state), hold_out)
    say("force states")
    states = campaign_states(campaign, rate_share=RATE_SHARE)
    whole = campaign.identification_runs
    states = one_after_another(campaign, states)
    runs, parts, groups = cut_up(whole, states, RATE_SHARE)
    candidates = applicable(campaign, effects, parts)
    # In segments, drifts of the channels are effects like others.
    drift = find_drift(whole, states) if len(parts) == len(states) else None
    start = first_model(campaign, parts, model, base)
    work = Work.build(campaign, runs, parts, groups, start)
    initial_work = work
    problem = Problem.build(work.rows, work.model)
    steps: list[Step] = []
    say("the gap")
    initial = gap_of(work, work.model, ())
    before = initial
    if drift is not None:
        work = _undrifted(work, drift)
        after = gap_of(work, work.model, ())
        steps.append(_drift_step(drift, before, after, campaign.joint.motion))
        before = after
    straight, drifted = work, initial.moment**2 - before.moment**2
    repaired, steps, work = _loop(work, candidates, max_effects, steps, before, say)
    say("advice")
    final = steps[-1].gap_after if steps else initial
    noise = noise_floor(initial_work)
    if is_free(campaign):
        repaired = polished(campaign, work.states, work.rows, repaired)
    last = Problem.build(work.rows, work.model, repaired.effects)
    left = unexplained_share(problem, last, initial, final, noise)
    outside = outside_share(Problem.build(straight.rows, straight.model), last, repaired.effects)
    verdict, reason = judge(problem, steps, 0.0 if drift is not None else left, outside)
    steps = humble(steps, verdict, outside)
    advice = advise(work.rows, work.states, work.model, repaired.effects, steps, candidates)
    joint = tuple(e for e in repaired.effects if e.effect.enters != "time shift")
    moments = Problem.build(initial_work.moment_rows(), initial_work.model)
    processing = processing_error(initial_work.campaign, initial_work.runs, initial_work.model)
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
            processing,
            drifted,
        ),
        where=where(moments, campaign.joint.motion) if verdict != "nothing_missing" else (),
        steps=tuple(steps),
        advice=advice,
        warnings=tuple(limits(campaign, states)),
        model=repaired.model,
        effects=repaired.effects,
        whole=whole_model(replace(repaired, effects=joint), work.rows),
        hidden=hidden,
        before=run_gaps(initial_work.moment_rows(), initial_work.model),
        after=run_gaps(work.moment_rows(), repaired.model, repaired.effects) if steps else (),
    )


def _loop(
    work: Work,
    candidates: Sequence[Effect],
    most: int,
    steps: list[Step],
    before: Gap,
    say: Callable[[str], None],
) -> tuple[Repaired, list[Step], Work]:
    """Add effects until the gap is noise, nothing explains it, or the count is reached."""
    found: list[FittedEffect] = []
    repaired = Repaired(work.model, ())
    steps = list(steps)
    refused: set[str] = set()
    while True:
        problem = Problem.build(work.rows, work.model, found)
        if len(steps) >= most:
            break
        open_ones = [e for e in candidates if e.id not in refused]
        ranking, paired = _ranked(work, problem, open_ones, found, say, len(steps) + 2 <= most)
        if ranking is None or 1 - ranking.nothing < BELIEF:
            break
        best = ranking.fitted[0]
        say(f"adding {best.effect.name}")
        added = add_effect(work, found, best, candidates)
        after = gap_of(added.work, added.repaired.model, added.effects)
        if not paired and _harms(before, after) and len(refused) < MOST_REFUSALS:
            refused.add(best.effect.id)
            continue
        if not paired and _idle(problem, before, after):
            break
        work, found, repaired = added.work, list(added.effects), added.repaired
        steps = _renamed(steps, added)
        steps.append(_step(ranking, found, repaired, before, after))
        before = after
    return replace(repaired, effects=tuple(found)), steps, work


def _harms(before: Gap, after: Gap) -> bool:
    """Return whether an effect wins little of the moment and loses much of the simulated response."""
    return after.response > WORSE_RESPONSE * before.response and after.moment > LITTLE_HELP * before.moment


def _idle(problem: Problem, before: Gap, after: Gap) -> bool:
    """Return whether an effect wins nothing on runs it never saw, where repetition has not measured the noise."""
    if all(run.folded for run in problem.runs):
        return False
    pairs = zip(
        (after.moment, after.weighted, after.response), (before.moment, before.weighted, before.response), strict=True
    )
    return not any(later < (1 - LEAST_GAIN) * earlier for later, earlier in pairs)


def _ranked(
    work: Work,
    problem: Problem,
    candidates: Sequence[Effect],
    found: Sequence[FittedEffect],
    say: Callable[[str], None],
    pairs: bool,
) -> tuple[Ranking | None, bool]:
    """Return the candidates in order, and whether the first of them was put there by a second beside it."""
    taken = {each.effect.id for each in found}
    open_ones = [effect for effect in candidates if effect.id not in taken]
    say(f"trying {len(open_ones)} effects")
    fitted = fit_effects(problem, open_ones)
    if not fitted:
        return None, False
    pair = hidden_pair(problem, fitted) if pairs else None
    if pair is not None:
        first, second = pair
        say(f"trying them beside {second.effect.name}")
        both = Problem.build(work.rows, work.model, [*found, second])
        beside = rank(both, fit_effects(both, [f.effect for f in fitted if f is not second]))
        if beside.fitted[0].effect.id == first.effect.id:
            return beside, True
    return rank(problem, fitted), False


def _renamed(steps: Sequence[Step], added: Added) -> list[Step]:
    """Return earlier steps under the names that they have beside the effect just added; a dropped one goes."""
    later: list[Step] = []
    for step in steps:
        if step.effect not in added.again:
            later.append(step)
        elif (ranking := added.again[step.effect]) is not None:
            later.append(_step(ranking, added.effects, added.repaired, step.gap_before, step.gap_after))
    return later


def _step(
    ranking: Ranking, found: Sequence[FittedEffect], repaired: Repaired, before: Gap, after: Gap
) -> Step:
    best = ranking.fitted[0]
    now = next((f for f in found if f.effect.id == best.effect.id), best)
    others = [
        (f.effect.id, p)
        for f, p in zip(ranking.fitted[1:], ranking.probabilities[1:], strict=True)
        if p > 1e-4
    ]
    return Step(
        effect=best.effect.id,
        family=best.effect.family,
        members=tuple(f.effect.id for f in ranking.members()),
        probability=ranking.probabilities[0],
        rivals=tuple(others[:6]),
        parameters=now.parameters,
        terms_dropped=repaired.dropped,
        gap_before=before,
        gap_after=after,
        units=now.variant.units(repaired.model.joint.motion),
    )


def _drift_step(drift: ChannelDrift, before: Gap, after: Gap, motion: str) -> Step:
    slope = float(np.median(list(drift.slopes.values())))
    # A slope of so many standard errors, tempered as likelihoods of effects are.
    belief = float(1 / (1 + np.exp(-0.5 * drift.significance**2 / TEMPER)))
    unit = "N*m/s" if drift.effect == "moment_drift" else "rad/s"
    units = {"slope": unit if motion == "rotation" else unit_for(unit, motion)}
    return Step(drift.effect, "run", (drift.effect,), belief, (), {"slope": slope}, (), before, after, units)


def _undrifted(work: Work, drift: ChannelDrift) -> Work:
    """Return the work with the drifting channel put right."""
    runs = tuple(without_drift(run, drift) for run in work.runs)
    campaign = work.campaign.with_runs((*runs, *work.campaign.validation_runs))
    states = campaign_states(campaign, rate_share=RATE_SHARE)
    model = refit(gap_runs(states, work.model, work.groups), work.model, ()).model
    return Work.build(campaign, runs, states, work.groups, model)
