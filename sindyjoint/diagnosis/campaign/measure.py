"""A campaign as evidence: whitened rows with columns of all effects; of a free motion, what each law simulates.

Of a free motion no moment is measured, and every law is fitted to the motion that it simulates. Energies and timings
of half-cycles are linear in what is missing, and say where a fit of each effect begins; which of them the motion goes
on by, phase by phase over all its cycles, its simulation says, where half-cycles say nothing too.
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from sindyjoint.clock import spend
from sindyjoint.diagnosis.campaign import GapRun, reference_scales
from sindyjoint.diagnosis.campaign.numbers import is_element, with_numbers
from sindyjoint.diagnosis.campaign.regression import FARTHEST, GapRegression, wrong_signs
from sindyjoint.diagnosis.campaign.repair import (
    Repaired,
    all_columns,
    refine_effect,
    refit,
    simulated,
    sticks,
    without,
)
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.setup import JoinedMotions
from sindyjoint.diagnosis.evidence import GROUPS, Evidence, Ranking, Rotated, Score, rank
from sindyjoint.diagnosis.evidence.search import Candidate, Chosen, Search
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.errors import SindyJointError
from sindyjoint.limits import EVIDENCE
from sindyjoint.numeric import Array, kept, main_frequency
from sindyjoint.response.refinement import Refinement, misfit_nearby, refine

# Points of a grid of nonlinear parameters, by their number; trials of a refinement, per parameter.
GRID, TRIALS = {1: (13,), 2: (7, 5), 3: (5, 3, 3)}, 30
# Samples along which forms of an element are simulated; share of a sum of squares that most fits win after a few steps.
SIMULATED, UNFINISHED = 20_000, 0.0025
# The term of a model that may not push.
FRICTION = "coulomb_friction"


@dataclass(eq=False)
class CampaignEvidence:
    """The rows of a campaign, and the columns along its motions.

    Parameters
    ----------
    runs : sequence of GapRun
    model : JointModel
    effects : sequence of Effect
        Candidates.
    beside : sequence of FittedEffect
        Whose columns are there in any case, as the model's terms are.
    sticking : float
        Share of the motion beyond which a slider that sticks is no slider.
    """

    runs: Sequence[GapRun]
    model: JointModel
    effects: Sequence[Effect]
    beside: Sequence[FittedEffect] = ()
    sticking: float = CAMPAIGN.sticking_share

    def __post_init__(self) -> None:
        runs = self.runs
        size = float(np.sqrt(np.mean(np.concatenate([run.target for run in runs]) ** 2)))
        segments = -(-GROUPS // len(runs))
        self.rotated = [Rotated(run, *_along(run), size, segments) for run in runs]
        self._ends = np.cumsum([run.target.size for run in runs])[:-1]
        labels = np.concatenate([1000 * i + each.segment for i, each in enumerate(self.rotated)])
        self.evidence = Evidence(
            self.whitened(np.concatenate([run.target for run in runs])),
            np.unique(labels, return_inverse=True)[1],
            np.concatenate([each.spread for each in self.rotated]),
        )
        self.base = self.evidence.add(
            self.whitened(np.vstack([all_columns(run, self.model, self.beside) for run in runs]))
        )
        self.reference: Reference = reference_scales(runs)
        self.motions = JoinedMotions.of([run.motion for run in runs])
        self.rough = JoinedMotions.of([run.motion.rough() for run in runs])
        self.by_id = {effect.id: effect for effect in self.effects}

    def whitened(self, rows: Array) -> Array:
        """Return stacked rows of all runs, whitened and rotated."""
        parts = np.split(rows, self._ends)
        return np.concatenate([turn(part) for turn, part in zip(self.rotated, parts, strict=True)])

    def column(self, variant: Variant, values: Array, rough: bool = False) -> Array | None:
        """Return a variant's whitened columns, or None where its states cannot be followed."""
        motions = self.rough if rough else self.motions
        plain = variant.along(motions, values)
        if not np.all(np.abs(plain) < FARTHEST):
            return None
        return self.whitened(plain)

    def candidates(self) -> list[Candidate]:
        """Return all effects on the grids of their nonlinear parameters."""
        found = []
        for effect in self.effects:
            for form, variant in enumerate(effect.variants):
                points = self._grid(variant)
                spend(float(len(points) * self.rough.angle.size))
                for values in points:
                    if sticks(variant, values, self.runs, self.sticking):
                        continue
                    columns = self.column(variant, values, rough=True)
                    if columns is None or not self._independent(columns):
                        continue
                    column, mix = mixed(columns, self._residual, self._basis)
                    signs = [each.positive for each in variant.columns]
                    if len(mix) > 1 and any(
                        sign and part <= 0 for sign, part in zip(signs, mix, strict=True)
                    ):
                        continue
                    (place,) = self.evidence.add(column)
                    found.append(
                        Candidate(
                            effect.id, form, values, place, len(mix) > 1 or signs[0],
                            effect.enters != "moment", bool(variant.states), mix,
                        )
                    )  # fmt: skip
        return found

    @cached_property
    def _basis(self) -> Array:
        """An orthonormal basis of the columns that are there in any case."""
        left, singular, _ = np.linalg.svd(self.evidence.columns[:, self.base], full_matrices=False)
        return np.asarray(left[:, singular > 1e-9 * singular[0]])

    @cached_property
    def _residual(self) -> Array:
        return np.asarray(self.evidence.target - self._basis @ (self._basis.T @ self.evidence.target))

    def _independent(self, columns: Array) -> bool:
        """Return whether columns are outside the span of the model's terms."""
        norm = np.linalg.norm(columns)
        outside = columns - self._basis @ (self._basis.T @ columns)
        return bool(norm > 0 and np.linalg.norm(outside) > 1e-5 * norm)

    def _grid(self, variant: Variant) -> Array:
        bounds = variant.bounds(self.reference)
        if not len(bounds):
            return np.empty((1, 0))
        axes = [
            np.geomspace(low, high, count)
            for (low, high), count in zip(bounds, GRID.get(len(bounds), (4,) * len(bounds)), strict=True)
        ]
        return np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(bounds), -1).T

    def refine(self, candidate: Candidate, beside: Sequence[int], size: float) -> Candidate:
        """Return a candidate with the nonlinear parameters that explain most beside some columns."""
        variant = self.by_id[candidate.name].variants[candidate.form]
        bounds = np.log(variant.bounds(self.reference)).T
        weight = np.sqrt(1 / (1 + size**2 * self.evidence.spread))
        basis, _ = np.linalg.qr(self.evidence.columns[:, list(beside)] * weight[:, None])
        target = self.evidence.target * weight
        residual = target - basis @ (basis.T @ target)
        slow = self.motions.angle.size > 60_000

        def loss(point: Array) -> float:
            columns = self.column(variant, np.exp(np.clip(point, *bounds)), rough=slow)
            if columns is None:
                return 0.0
            column = mixed(columns * weight[:, None], residual, basis)[0][:, 0]
            column = column - basis @ (basis.T @ column)
            return -float((column @ residual) ** 2 / max(float(column @ column), 1e-300))

        start = np.clip(np.log(candidate.values), *bounds)
        count = np.array(GRID.get(start.size, (4,) * start.size))
        step = 0.5 * (bounds[1] - bounds[0]) / np.maximum(count - 1, 1)
        simplex = np.vstack([start, start + np.diag(np.where(start + step < bounds[1], step, -step))])
        options = dict(initial_simplex=simplex, xatol=3e-3, fatol=0.05, maxfev=TRIALS * start.size)
        spend(float(TRIALS * start.size * self.motions.angle.size))
        found = scipy.optimize.minimize(loss, start, method="Nelder-Mead", options=options)
        values = np.exp(np.clip(found.x, *bounds))
        columns = self.column(variant, values)
        if columns is None or sticks(variant, values, self.runs, self.sticking):
            return candidate
        mix = mixed(columns * weight[:, None], residual, basis)[1]
        (place,) = self.evidence.add(columns @ np.array(mix)[:, None])
        return replace(candidate, values=values, place=place, mix=mix)

    def search(self, before: float = 0.0) -> Search:
        """Return the search over sets of the candidates; ``before``: what corrections have won already, nats."""
        sure = all(run.folded or run.half_cycles is not None for run in self.runs)
        friction = [
            place for place, term in zip(self.base, self.model.terms, strict=False) if term.id == FRICTION
        ]
        return Search(self.evidence, self.base, self.candidates(), self.refine, before, sure, friction)

    def fitted(self, found: Chosen) -> list[FittedEffect]:
        """Return the members of a set as effects with their numbers."""
        places = [*self.base, *(m.place for m in found.members)]
        solved = self.evidence.fit(places, found.score.size)[len(self.base) :]
        effects = []
        for value, each in zip(solved, found.members, strict=True):
            effect = self.by_id[each.name]
            variant = effect.variants[each.form]
            effects.append(FittedEffect(effect, variant, each.values, value * np.array(each.mix), 0.0))
        return effects


def score_of(runs: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect]) -> Score:
    """Return the score of a model with effects, delays aside, all coefficients fitted together."""
    ev = CampaignEvidence(runs, model, (), [each for each in effects if not each.shifts])
    return ev.evidence.score(ev.base)


def mixed(columns: Array, residual: Array, basis: Array) -> tuple[Array, tuple[float, ...]]:
    """Return the combination of columns, (n, k) → (n, 1), that explains most of a residual beside a basis."""
    if columns.shape[1] == 1:
        return columns, (1.0,)
    mix = np.linalg.lstsq(columns - basis @ (basis.T @ columns), residual, rcond=None)[0]
    return columns @ mix[:, None], tuple(mix.tolist())


def _along(run: GapRun) -> tuple[Array, bool]:
    """Return the place of each row along the motion, in periods, and whether the rows are one period."""
    motion = run.motion
    if run.folded:
        return motion.keep / motion.angle.size, True
    frequency = motion.frequency or main_frequency(motion.angle, 1 / motion.step)
    return motion.time[motion.keep] * (frequency or 1.0), False


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
    nearby = sorted(((_misfit_nearby(work, each), i) for i, each in enumerate(begun)))[:3]
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
    work: Work, others: list[FittedEffect], found: Ranking[FittedEffect]
) -> Ranking[FittedEffect]:
    """Return the forms of an element in the order of what a few steps of a fit leave of the simulated response.

    Smoothing takes more off the corners of a law than what tells one form of hysteresis from another. As it is where
    something beside is none of the law, or no form can be simulated.
    """
    share = min(1.0, SIMULATED / sum(s.n_samples for s in work.states))
    short = replace(work, states=tuple(s.part(0.0, share) for s in work.states))
    samples = sum(s.n_samples for s in short.states)
    forms = [form for each in found.fitted if is_element(each) for form in _forms(work, others, each)]
    effects = [[*others, form] for form in forms] + [others]
    laws = (refit(work.plain, work.model, each, drops=False) for each in effects)
    left = np.array([_misfit_nearby(short, each) for each in laws])
    least = left[:-1].min(initial=np.inf)
    if not np.isfinite(least):
        return found
    numbers = np.array([form.variant.degrees for form in forms] + [0])
    totals = -0.5 * (np.minimum(left / least, FARTHEST) * samples + numbers * np.log(samples))
    # What further steps may win, no form has lost; nor has the one that the rows prefer.
    totals[0] = max(totals)
    totals = np.minimum(totals + 0.5 * UNFINISHED * samples, totals[0])
    *scores, alone = (Score(np.array([total]), np.array([samples]), 0.0, 1.0) for total in totals)
    plainest = sorted(range(len(forms)), key=lambda i: (numbers[i], left[i]))
    return rank([(forms[i], scores[i]) for i in plainest], alone, work.policy.rival_nats)


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


def _misfit_nearby(work: Work, repaired: Repaired) -> float:
    law = _law(repaired)
    with suppress(SindyJointError):
        return np.inf if law is None else misfit_nearby(law, work.runs, work.states)
    return np.inf


def mean_square(repaired: Repaired) -> float:
    """Return what a simulated motion leaves, in units of the noise; infinite where it could not be simulated."""
    residual: Array | None = repaired.residual
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
