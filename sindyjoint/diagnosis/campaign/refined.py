"""Laws fitted to the simulated response of a campaign: which form an element has, and its numbers.

A mean period rounds off the corners of a slider, as smoothing does, and noise hides harmonics of the angle: numbers
fitted along the measured motion are those of rounded corners, and one form of an element looks like another, or like
itself with something beside. The simulated response has the corners where the joint has them.
"""

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign import reference_scales
from sindyjoint.diagnosis.campaign.measure import CampaignEvidence, score_of
from sindyjoint.diagnosis.campaign.numbers import is_element, with_numbers
from sindyjoint.diagnosis.campaign.regression import FARTHEST, GapRegression, wrong_signs
from sindyjoint.diagnosis.campaign.repair import Repaired, refine_effect, refit, simulated, without
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.evidence import Ranking, Score, rank
from sindyjoint.diagnosis.problem import Say
from sindyjoint.equation.formula import formula_text
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import SindyJointError
from sindyjoint.limits import EVIDENCE
from sindyjoint.numeric import Array, kept
from sindyjoint.record import Campaign
from sindyjoint.response import corrected, simulated_gap
from sindyjoint.response.refinement import Refinement, fit_nearby, refine
from sindyjoint.states import campaign_states, one_after_another

# Samples along which forms of an element are simulated; share of a sum of squares that fits win after a few steps, that
# the last of them wins, of so many samples a tenth of a nat, and that the noise of a drive makes alike.
SIMULATED, UNFINISHED, FINISHED, OF_DRIVE = 20_000, 0.005, 1e-5, 0.0025

# Both import this module: the problem of a campaign, and what a search of it found.
Problem = Any
Found = Any


def on_response(work: Work, repaired: Repaired) -> Repaired:
    """Return model and effects with all numbers, those within effects too, fitted to the simulated motion.

    As they are where an effect is none of the law, or the motion cannot be simulated.
    """
    law = _law(repaired)
    result = None if law is None else _refinement(work, law)
    if result is None or not result.refined:
        return repaired
    later = with_numbers(repaired, result.model.numbers, np.array(result.model.covariance))
    return replace(later, residual=result.residual)


# The same law is asked for its gap, its verdict, and beside each effect more.
@kept
def _refinement(work: Work, law: JointModel) -> Refinement | None:
    """Return a law fitted to the simulated motion; None where that fails."""
    with suppress(SindyJointError):
        # Whether runs kept for validation go on so is asked of the gap.
        return refine(law, work.campaign.with_runs(work.runs), states=work.states)
    return None


def _law(repaired: Repaired) -> JointModel | None:
    """Return the law of a model with all effects as elements, whose numbers are all free; None where one is none."""
    model, effects = repaired.model, repaired.effects
    if not all(each.is_term or is_element(each) for each in effects):
        return None
    elements = tuple(each.element(model.joint.motion) for each in effects)
    return replace(model, elements=elements, covariance=())


def simplest(work: Work, repaired: Repaired) -> Repaired:
    """Return the same less the terms that do not stand out of their errors, the least sure first."""
    found, dropped = on_response(work, repaired), list[str]()
    while found.residual is not None and len(found.model.terms) > 1:
        sure = {t.id: abs(t.coefficient) / max(t.standard_error, 1e-300) for t in found.model.terms}
        weakest = min(sure, key=sure.__getitem__)
        fewer = Repaired(without(found.model, {weakest}), found.effects)
        if sure[weakest] >= EVIDENCE.significant or (later := on_response(work, fewer)).residual is None:
            break
        found, dropped = later, [*dropped, weakest]
    return replace(found, dropped=tuple(dropped))


def score_on_response(repaired: Repaired, unit: float) -> Score:
    """Return the score of a simulated motion, whose noise has ``unit`` times the variance that it was known to have."""
    assert repaired.residual is not None
    rows = repaired.residual.size
    numbers = len(repaired.model.terms) + sum(e.variant.degrees for e in repaired.effects)
    chi_square = float(repaired.residual @ repaired.residual)
    total = -0.5 * (chi_square / unit + numbers * np.log(rows))
    return Score(np.array([total]), np.array([chi_square]), 0.0, 1.0)


def ranked_on_response(
    work: Work, now: Repaired, candidates: Sequence[Effect], refused: Collection[str]
) -> Ranking[FittedEffect] | None:
    """Return the effects that lead by half-cycles in the order of their simulated motions."""
    if now.residual is None:
        return None
    known = {*refused, *now.model.ids, *(each.name for each in now.effects)}
    free = [e for e in candidates if e.id not in known and e.enters == "moment"]
    ev = CampaignEvidence(work.plain, now.model, free, now.effects, work.policy.sticking_share)
    search = ev.search()
    alone = search.chosen(())
    leading = search.with_numbers(search.extended(alone), alone.score.total)
    begun = [begun_with(work, now, ev.fitted(each)) for each in leading]
    # The three that lead after a few steps are fitted to the simulated motion to the end.
    nearby = sorted(((_nearby(work, each)[0], i) for i, each in enumerate(begun)))[:3]
    least, done = float(now.residual @ now.residual) + 2 * np.log(EVIDENCE.chance), list[Repaired]()
    for misfit, i in nearby:
        if misfit < least and (fitted := on_response(work, begun[i])).residual is not None:
            # What a few steps leave clearly behind that end is not fitted to its own.
            least = min(least, work.policy.clearly**2 * float(fitted.residual @ fitted.residual))
            done.append(fitted)
    if not done:
        return None
    unit = min(mean_square(each) for each in (now, *done))
    scored = [(each.effects[-1], score_on_response(each, unit)) for each in done]
    scored.sort(key=lambda pair: pair[0].variant.degrees)
    return rank(scored, score_on_response(now, unit), work.policy.rival_nats)


def forms_on_response(
    work: Work, others: list[FittedEffect], near: Sequence[FittedEffect]
) -> tuple[Ranking[FittedEffect], float] | None:
    """Return the forms of some effects in the order of what a fit leaves of the simulated response, and the least.

    Smoothing takes more off the corners of a law than what tells one form of hysteresis from another, and so does what
    noise hides of the harmonics of an angle. The least is per sample, in units of the noise. None where something
    beside is none of the law, or no form can be simulated.
    """
    share = min(1.0, SIMULATED / sum(s.n_samples for s in work.states))
    short = replace(work, states=tuple(s.part(0.0, share) for s in work.states))
    samples = sum(s.n_samples for s in short.states)
    forms = [form for each in near for form in _forms(work, others, each)]
    effects = [[*others, form] for form in forms] + [others]
    laws = [refit(work.plain, work.model, each, drops=False) for each in effects]
    ends = [_nearby(short, each) for each in laws]
    left = np.array([misfit for misfit, _ in ends])
    if not np.isfinite(left[:-1].min(initial=np.inf)):
        return None
    sure = all(s.method == "periodic" for s in work.states)
    # Further steps may put what is near in front, and what the rows prefer.
    for i in {0, *np.flatnonzero(left[:-1] < (1 + UNFINISHED) * left[:-1].min()).tolist()} if sure else ():
        left[i], _ = _nearby(short, laws[i], ends[i][1], FINISHED)
    numbers = np.array([form.variant.degrees for form in forms] + [0])
    totals = -0.5 * (np.minimum(left / left.min(), FARTHEST) * samples + numbers * np.log(samples))
    if not sure:  # the noise of a drive that does not repeat is in the response
        totals[0] = max(totals)
        totals = np.minimum(totals + 0.5 * OF_DRIVE * samples, totals[0])
    *scores, alone = (Score(np.array([total]), np.array([samples]), 0.0, 1.0) for total in totals)
    plainest = sorted(range(len(forms)), key=lambda i: (numbers[i], left[i]))
    order = rank([(forms[i], scores[i]) for i in plainest], alone, work.policy.rival_nats)
    return order, float(left[:-1].min()) / samples


def _forms(work: Work, others: list[FittedEffect], fitted: FittedEffect) -> list[FittedEffect]:
    """Return an effect in all forms that the catalogue has of it, each with its numbers by the rows."""
    beside, forms = GapRegression.build(work.plain, work.model, others, work.policy), [fitted]
    for variant in fitted.effect.variants:
        if variant != fitted.variant:
            middle = np.sqrt(np.prod(variant.bounds(beside.reference), axis=1))
            start = FittedEffect(fitted.effect, variant, middle, np.ones(len(variant.columns)), 0.0)
            forms.append(refine_effect(beside, start))
    return [form for form in forms if not wrong_signs(form.variant, form.coefficients)]


def begun_with(work: Work, now: Repaired, effects: Sequence[FittedEffect]) -> Repaired:
    """Return a model with further effects, all coefficients by half-cycles: where a fit of the motion begins."""
    return refit(work.plain, now.model, (*now.effects, *effects), drops=False)


def _nearby(work: Work, repaired: Repaired, *further: Any) -> tuple[float, Array | None]:
    """Return what a few steps leave of the simulated response and where they end; infinite where that fails."""
    law = _law(repaired)
    with suppress(SindyJointError):
        if law is not None:
            return fit_nearby(law, work.runs, work.states, *further)
    return np.inf, None


def mean_square(repaired: Repaired) -> float:
    """Return what a simulated motion leaves, in units of the noise; infinite where it could not be simulated."""
    residual = repaired.residual
    return np.inf if residual is None else float(residual @ residual) / residual.size


def continuation_gap(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return what a fit to the first part of each run leaves there and misses of the rest, RMS relative to the motion.

    All numbers come from the first part; the simulation of the rest starts from the measured state where that part
    ends. A decay has no more than noise at its end, where any law goes on well. NaN where no run can be simulated.
    """
    share = work.policy.training_share
    parts = [(s.part(0.0, share), s.part(share, 1.0)) for s in work.states]
    if min(s.n_samples for pair in parts for s in pair) < 50:
        return float("nan")
    training = replace(work, states=tuple(first for first, _ in parts))
    fitted = on_response(training, Repaired(model, tuple(effects)))
    left = mean_square(fitted) if fitted.residual is not None else 1.0
    gap = own = 0.0
    for run, states, (_, rest) in zip(work.runs, work.states, parts, strict=True):
        result = simulated(run, rest, fitted.model, fitted.effects)
        if result is None or result.simulated_angle is None:
            continue
        missed = float(np.mean((result.angle - result.simulated_angle) ** 2))
        gap += share * left * states.noise.angle**2 + (1 - share) * missed
        own += float(np.var(states.angle))
    return float(np.sqrt(gap / own)) if own > 0 else float("nan")


def told_by_response(found: Found, given: Sequence[FittedEffect], say: Say) -> Found:
    """Return what was found with each element in the form that the simulated response shows, where others are near.

    Without it where the response is rather that of the others alone.
    """
    effects, rankings, work = [*found.effects], [*found.rankings], found.work
    if found.shifts or work.campaign.moves_freely:
        return found
    for ranking in found.rankings:
        first = ranking.fitted[0]
        if not is_element(first) or len(ranking.near) < 2:
            continue
        say("forms of an element on the simulated response")
        others = [each for each in effects if each.name != first.name]
        if (told := forms_on_response(work, [*given, *others], ranking.near)) is None:
            continue
        place = rankings.index(ranking)
        if others and told[0].nothing > 0.5:
            del rankings[place]
            effects = others
            continue
        rankings[place] = told[0]
        effects = [told[0].fitted[0] if each.name == first.name else each for each in effects]
    return replace(found, effects=effects, rankings=rankings)


def one_by_response(problem: Problem, found: Found, say: Say) -> Found:
    """Return, in the place of several effects, the one that alone leaves no more than noise of the simulated response.

    What the processing does to the column of one looks like an error of the inertia, and more beside it. Asked where
    runs repeat, elsewhere the noise of the drive is in the response; and of sets that are no law, which is what they
    are told by: a small effect of a joint beside a large one is seen by the rows alone.
    """
    work, given = problem.work, [each for each in problem.found if not each.shifts]
    several = len(found.effects) > 1 and not found.shifts and len(given) == len(problem.found)
    several = several and not all(each.is_term or is_element(each) for each in found.effects)
    if not several or any(s.method != "periodic" for s in work.states):
        return found
    say("single effects on the simulated response")
    ev = CampaignEvidence(work.plain, work.model, problem.candidates, given, work.policy.sticking_share)
    search = ev.search()
    alone = search.chosen(())
    sets = search.with_numbers(search.extended(alone), alone.score.total)
    leading = [f for each in sets if is_element(f := ev.fitted(each)[-1]) or f.is_term][:5]
    told = forms_on_response(work, given, leading)
    samples = min(SIMULATED, sum(s.n_samples for s in work.states))
    # Beyond what the noise of so many samples varies by.
    if told is None or told[1] > 1 + work.policy.significant * np.sqrt(2 / samples):
        return found
    best, score = told[0].fitted[0], score_of(work.plain, work.model, [*given, told[0].fitted[0]])
    misfit = found.misfit[0], float(score.chi_square.sum())
    return replace(
        found, work=work, effects=[best], rankings=[told[0]], misfit=misfit, total=score.total,
        rows=ev.evidence.target.size,
    )  # fmt: skip


def refined_problem(
    problem: Problem,
    usable: Campaign,
    test: TestNuisances,
    progress: Callable[[str], None] | None = None,
) -> tuple[Problem, tuple[str, ...]]:
    """Return a repaired campaign whose whole model is fitted to the simulated response, and notes on that.

    As it is where the response gap would grow by it. Of the forms that the catalogue has of an element, as of Bouc and
    Wen's law or of a gap, the one with the least misfit of the response is used, or the plainest of those that are
    alike; a note names the others.

    Parameters
    ----------
    problem : Problem
        The last one of a diagnosis.
    usable : Campaign
        Without the samples that the check of the data leaves out; channels as they were measured.
    test : TestNuisances
        What the diagnosis found of the test.
    progress : callable, optional
    """
    if not (problem.whole.terms or problem.whole.elements):
        return problem, ()
    (progress or (lambda stage: None))("refining on the simulated response")
    campaign = corrected(test, usable)
    states = one_after_another(campaign, campaign_states(campaign))
    tried = [
        (form, refine(form.whole, campaign, states=states, test=test))
        for form in (problem, *_in_other_forms(problem))
    ]
    # An element that would have to push the other way stands in for something else.
    done = [(form, each) for form, each in tried if each.refined and _as_signed(form.whole, each.model)]
    if not done:
        return problem, tried[0][1].notes
    least = min(each.misfit for _, each in done)
    # Forms of an element whose misfits, a χ², are within this of the least are not told apart: they are as probable
    # as one to twenty.
    alike = [(form, each) for form, each in done if each.misfit <= least + 6.0]
    best, refinement = min(alike, key=lambda pair: (_rank(pair[0]), pair[1].misfit))
    before, after = (simulated_gap(model, campaign, test) for model in (problem.whole, refinement.model))
    if not after <= (1 + problem.policy.trivial_share) * before:
        note = (
            f"the refinement on the simulated response is not used: the response gap would be {100 * after:.3f} % "
            f"where it is {100 * before:.3f} %"
        )
        return problem, (note,)
    others = [form for form, _ in alike if form is not best]
    return best.with_whole(refinement.model), (*refinement.notes, *_undetermined(best, others))


def _as_signed(before: JointModel, after: JointModel) -> bool:
    """Return whether the coefficients of all elements kept their signs."""
    pairs = zip(before.elements, after.elements, strict=True)
    return all(np.array_equal(np.sign(a.coefficients), np.sign(b.coefficients)) for a, b in pairs)


def _in_other_forms(problem: Problem) -> list[Problem]:
    """Return the problem with an element in another form, or range, of the catalogue's, fitted to the rows."""
    work, repaired, found = problem.work, problem.repaired, []
    reference = reference_scales(work.rows)
    for place, each in enumerate(repaired.effects):
        for other in each.effect.variants if is_element(each) else ():
            if other == each.variant or other.names != each.variant.names:
                continue
            effects = list(repaired.effects)
            values = np.clip(each.values, *other.bounds(reference).T)
            effects[place] = replace(each, variant=other, values=values, within=None)
            fitted = _fitted(problem, effects, place)
            if not wrong_signs(other, fitted.effects[place].coefficients):
                found.append(replace(problem, repaired=fitted, work=replace(work, model=fitted.model)))
    return found


def _fitted(problem: Problem, effects: Sequence[FittedEffect], place: int) -> Repaired:
    """Return the repaired model with another form of one of its effects, all numbers fitted to the rows."""
    work = problem.work
    model = problem.repaired.model
    adding = [e for e in effects if not e.shifts]
    others = [e for e in adding if e is not effects[place]]
    new = refine_effect(GapRegression.build(work.rows, model, others, work.policy), effects[place])
    later = refit(work.rows, model, [new if e is effects[place] else e for e in adding], drops=False)
    by_name = {e.name: e for e in (*effects, *later.effects)}
    return replace(later, effects=tuple(by_name[e.name] for e in effects), dropped=problem.repaired.dropped)


def _rank(problem: Problem) -> list[int]:
    """Return which form of its effect each element has: the catalogue begins with the plainest."""
    ranks = []
    for each in problem.found:
        forms = [_formulas(variant) for variant in each.effect.variants]
        mine = _formulas(each.variant)
        ranks.append(forms.index(mine) if mine in forms else len(forms))
    return ranks


def _undetermined(best: Problem, others: Sequence[Problem]) -> tuple[str, ...]:
    """Return a note for each element that has another form in a model that is as like the measurement."""
    notes = []
    for place, mine in enumerate(best.found):
        forms = dict.fromkeys(_formulas(each.found[place].variant) for each in others)
        forms.pop(_formulas(mine.variant), None)
        if forms:
            notes.append(
                f"these runs do not determine the form of {mine.effect.name}: {_formulas(mine.variant)} is used, and "
                f"{' or '.join(forms)} fits as well; its numbers hold for the form used"
            )
    return tuple(notes)


def _formulas(variant: Variant) -> str:
    parts = [
        *(column.formula for column in variant.columns),
        *(f"{s.name}' = {formula_text(s.rate)}" for s in variant.states),
    ]
    return ", ".join(parts)
