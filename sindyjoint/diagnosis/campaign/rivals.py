"""Which runs would tell effects apart: each rival in turn is taken for true, and the others are fitted to it.

The rivals are laid along motions that nobody has measured yet, beside those that were. What the others cannot follow is
put into the same probabilities by which effects are named. A run's promise with the rivals as they are costs little,
and all runs are held against each other by it; the best are looked at with the rivals refined, and in the end searched
anew. The search ends early where its effort is spent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.candidates import fit_effect, refine_effect, trials_of
from sindyjoint.diagnosis.campaign.designs import BY_MOMENT, Design, designs, expected_states, within
from sindyjoint.diagnosis.campaign.predicted_evidence import CoarseRows
from sindyjoint.diagnosis.campaign.regression import GapRegression, rank_effects, shortened
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effort import Effort
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Advice, Step
from sindyjoint.equation.model import JointModel
from sindyjoint.mechanics.excitation import Actuator
from sindyjoint.parallel import side_by_side
from sindyjoint.text import in_words_of

T = TypeVar("T")
R = TypeVar("R")

# How rivals are laid along a run that nobody measured: refined from what is known, or searched anew as well.
Rivals = Literal["refined", "searched"]
# Expected confidence, expected margin, the run, its rows.
Promise = tuple[float, float, Design, GapRun]
COARSE = 5_000.0  # samples that a trial on one run costs: its motion, its rows
REFINING = 0.25  # work of refining rivals in parts of that of searching them
FINE = 3  # runs in which the rivals are fitted anew
MOST_NATS = 30.0  # a margin is counted up to this: beyond, its mean would rest on one rival
PORTION = 15  # runs between two looks at the clock
NO_RUN = "none: no prescribed angle that was tried separates them"
NOT_WITHIN = (
    "none: no run that was tried is within the limits of the actuator, at the frequencies and angles tested"
)
NO_FREQUENCY = "none: runs are tried about the frequencies of those that were made, and these declare none"
READ_ZEROS = "none: no motion separates them; read both channels with the joint unloaded and at rest"


class Spent(Exception):
    """The effort of the search is used up."""


def separating_runs(
    work: Work,
    found: Sequence[FittedEffect],
    step: Step,
    rivals: Sequence[FittedEffect],
    effort: Effort,
    actuator: Actuator | None = None,
) -> tuple[Advice, ...]:
    """Return up to two runs that separate the class of a named effect best, as far as the effort goes.

    ``rivals`` are the other members of the class, each as the data have it: what it would do where nothing was measured
    is what the data say of it, and not what comes nearest to the effect that was named.
    With an actuator: of those that it can make.
    Where no run does, the advice says so: its frequency and level are zero. With an actuator it is then the runs along
    which the rivals, as they are, differ most: what the data hold for true of them may still change with these.
    """
    mine = next((f for f in found if f.name == step.effect), None)
    if mine is None or not rivals:
        return ()
    runs = designs(work.states, work.policy, actuator)
    if actuator is not None:
        runs = tuple(each for each in runs if within(each, actuator, work.model))
    motion = work.model.joint.motion
    if not runs:
        channels = any(each.effect.enters != "moment" for each in (mine, *rivals))
        none = READ_ZEROS if channels else NO_FREQUENCY if actuator is None else NOT_WITHIN
        return (Advice(step.members, 0.0, 0.0, in_words_of(motion, none), step.probability),)
    effort.planned += len(runs)
    others = [f for f in found if f is not mine and not f.shifts]
    rows = shortened(work.rows)
    rivals = _affordable(rows, mine, rivals, effort, work.policy)
    search = _Rivals(rows, work, others, mine, runs, effort, actuator is not None)
    try:
        search.fit(rivals, step)
    except Spent:
        return ()
    return tuple(search.advice())


def _affordable(
    rows: Sequence[GapRun],
    mine: FittedEffect,
    rivals: Sequence[FittedEffect],
    effort: Effort,
    policy: DiagnosisPolicy,
) -> Sequence[FittedEffect]:
    """Return the likeliest rivals, as many as one round of the search can hold against each other; at least one."""
    for count in range(min(len(rivals), policy.most_rivals - 1), 1, -1):
        every = (mine, *rivals[:count])
        pairs = sum(trials_of(rows, each.effect) for each in every) * count
        # Fitted to each other, refined on a few runs, and searched anew on about as many.
        if 3 * pairs <= effort.work:
            return rivals[:count]
    return rivals[:1]


class _Rivals:
    """The members of a class as each would have made the measured campaign."""

    def __init__(
        self,
        rows: Sequence[GapRun],
        work: Work,
        others: Sequence[FittedEffect],
        mine: FittedEffect,
        runs: Sequence[Design],
        effort: Effort,
        in_any_case: bool = False,
    ) -> None:
        self.in_any_case = in_any_case
        self.rows, self.states, self.model, self.policy = tuple(rows), work.states, work.model, work.policy
        self.others, self.runs = tuple(others), tuple(runs)
        self.members: tuple[FittedEffect, ...] = (mine,)
        self._effort = [effort]
        # Each rival in the shape in which it comes nearest to each of the others, as far as was measured.
        self.shapes: list[list[FittedEffect]] = []
        # The runs that promise most with the rivals as they are.
        self.first: tuple[Design, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        # Other processes do not keep account.
        return {**vars(self), "_effort": []}

    def fit(self, rivals: Sequence[FittedEffect], step: Step) -> None:
        """Fit each member of the class to each other."""
        self.members = (self.members[0], *rivals)
        known = {step.effect: step.probability, **dict(step.rivals)}
        weights = np.array([max(known.get(each.name, 0.0), 1e-3) for each in self.members])
        self.weights = weights / weights.sum()
        self.pairs = sum(trials_of(self.rows, each.effect) for each in self.members) / len(self.members)
        self.pairs *= len(self.members) - 1
        everyone = range(len(self.members))
        shapes = self._counted(
            "search", everyone, self.pairs, _shapes, [self], "fitting rivals to each other"
        )
        self.before = [self._evidence(self._problem([], index), shapes[index]) for index in everyone]
        self.shapes = shapes
        self.coarse = CoarseRows.build(self.rows, self.model, self.others, self.members, self.policy)

    def _counted(
        self,
        kind: str,
        tasks: Sequence[T],
        work: float,
        function: Callable[..., R],
        shared: Sequence[Any],
        stage: str,
        portion: int = 0,
    ) -> list[R]:
        """Return the results of tasks of so much work each, a portion of them at a time; Spent where it is too much."""
        effort, results = self._effort[0], list[R]()
        portion = portion or len(self.members)
        for first in range(0, len(tasks), portion):
            some = tasks[first : first + portion]
            effort.report(stage, {kind: work * (len(tasks) - first)})
            if not effort.allows(kind, work * len(some)):
                raise Spent
            results += side_by_side(function, some, shared)
        return results

    def advice(self) -> list[Advice]:
        """Return runs until the expected confidence suffices, the best first."""
        names = tuple(each.name for each in self.members)
        added: list[GapRun] = []
        advice: list[Advice] = []
        before, margin = self.judged(self.before)
        policy, motion = self.policy, self.model.joint.motion
        for _ in range(policy.most_runs):
            least = (before + policy.little_confidence, margin + policy.little_margin)
            try:
                best = self._best(added, least)
            except Spent:
                return advice
            if best is None or (best[0] < least[0] and best[1] < least[1]):
                break
            before, margin, design, row = best
            added.append(row)
            advice.append(
                Advice(names, design.frequency, design.level, in_words_of(motion, design.waveform), before)
            )
            # Rivals can bend further than is tried here: a margin, not a confidence, is enough.
            if margin >= policy.clear:
                break
        if advice:
            return advice
        channels = any(each.effect.enters != "moment" for each in self.members)
        if self.in_any_case and self.first and not channels:
            return [
                Advice(names, each.frequency, each.level, in_words_of(motion, each.waveform), before)
                for each in self.first[: policy.most_runs]
            ]
        return [Advice(names, 0.0, 0.0, READ_ZEROS if channels else in_words_of(motion, NO_RUN), before)]

    def _best(self, added: Sequence[GapRun], least: tuple[float, float]) -> Promise | None:
        """Return the run with the highest expected confidence, by a moment where that drove before and suffices.

        None where no run reaches one of two least values, of confidence and margin.
        """
        runs = self.runs
        moments = self._promises([each for each in runs if each.waveform == BY_MOMENT], added)
        enough = self.policy.enough
        best = self._surest([each for each in moments if each[0] >= enough], added, least)
        if best is not None and best[0] >= enough:
            return best
        moments = [each for each in moments if each[0] < enough]
        try:
            others = self._promises([each for each in runs if each.waveform != BY_MOMENT], added)
        except Spent:
            if best is None:
                raise
            return best
        return self._surest([*moments, *others], added, least, best)

    def _promises(self, runs: Sequence[Design], added: Sequence[GapRun]) -> list[Promise]:
        """Return the few runs that promise most with rivals as they are, and what they keep with rivals refined."""
        if not runs:
            return []
        effort, coarse = self._effort[0], []
        for first in range(0, len(runs), PORTION):
            some = runs[first : first + PORTION]
            stage = f"advice: {effort.tried} of {effort.planned} runs tried"
            if added:
                stage = f"advice: a further run, {first} of {len(runs)} tried"
            coarse += self._counted(
                "run", some, COARSE * len(self.members) ** 2, _coarse, [self, tuple(added)], stage, PORTION
            )
            effort.tried += 0 if added else len(some)
        tried = [each for each in coarse if each is not None]
        tried.sort(key=lambda each: each[:2], reverse=True)
        best = [each[2:] for each in tried[:FINE]]
        if not added:
            # Of each waveform one: of its neighbours the next best says the same.
            waves = {each[0].waveform: each[0] for each in reversed([each[2:] for each in tried])}
            self.first = tuple(each for each, _ in (t[2:] for t in tried) if waves[each.waveform] is each)
        stage = "advice: the rivals refined on the best runs"
        work = REFINING * len(self.members) * self.pairs
        return self._counted("refinement", best, work, _fine, [self, tuple(added)], stage, 1)

    def _surest(
        self,
        promises: Sequence[Promise],
        added: Sequence[GapRun],
        least: tuple[float, float],
        best: Promise | None = None,
    ) -> Promise | None:
        """Return the best of some runs, and of one that is known already, the rivals searched anew.

        Rivals that are fitted further leave less of a promise: once a run keeps more than the others promise, it is the
        best of them.
        """
        for each in sorted(promises, key=lambda each: each[:2], reverse=True):
            if best is not None and each[:2] <= best[:2]:
                break
            if each[0] < least[0] and each[1] < least[1]:
                continue
            everyone, given = range(len(self.members)), [self, (*added, each[3])]
            stage = "advice: the rivals searched anew on the best runs"
            try:
                evidence = self._counted("search", everyone, self.pairs, _searched, given, stage)
            except Spent:
                # What is known already is known as well as ever.
                return best
            kept = (*self.judged(evidence), *each[2:])
            best = kept if best is None or kept[:2] > best[:2] else best
        return best

    def expected(self, added: Sequence[GapRun], rivals: Rivals) -> tuple[float, float]:
        """Return expected confidence and margin with some runs more.

        The confidence is the probability that the true member would have, on average over which of them is true:
        today's odds times what the runs add to the evidence. The margin, in nats, goes on where it saturates.
        """
        return self.judged([self.evidence(added, index, rivals) for index in range(len(self.members))])

    def judged(self, evidence: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
        """Return confidence and margin from the evidence with each member in turn taken for true."""
        confidence = margin = 0.0
        for index, weight in enumerate(self.weights):
            logarithms = np.log(self.weights) + evidence[index] - self.before[index]
            odds = np.exp(logarithms - logarithms.max())
            confidence += weight * float(odds[index] / odds.sum())
            others = np.delete(logarithms, index)
            margin += weight * float(np.clip(logarithms[index] - others.max(), -MOST_NATS, MOST_NATS))
        # Ties of the confidence are decided by the margin.
        return round(confidence, 3), margin

    def nearest_to(self, index: int) -> list[FittedEffect]:
        """Return the members as they come nearest to one of them along what was measured."""
        return self._fitted(self._problem([], index), index, "searched")

    def _problem(self, added: Sequence[GapRun], index: int) -> GapRegression:
        """Return the regression of the campaign and some runs more, one of the members taken for true."""
        return _as_if([*self.rows, *added], self.model, self.others, self.members[index], self.policy)

    def _fitted(self, problem: GapRegression, index: int, rivals: Rivals) -> list[FittedEffect]:
        """Return the members as they come nearest to one of them."""
        return [
            each if each is self.members[index] else self._nearest(problem, each, place, index, rivals)
            for place, each in enumerate(self.members)
        ]

    def _nearest(
        self, problem: GapRegression, rival: FittedEffect, place: int, index: int, rivals: Rivals
    ) -> FittedEffect:
        known = [rival, self.shapes[index][place]] if len(self.shapes) > index else [rival]
        nearest = refine_effect(problem, max(known, key=lambda f: problem.gain(f.variant, f.values)[0]))
        if rivals == "refined":
            return nearest
        # As a rival of the campaign with these runs it is free to take any other form of its own.
        return max(nearest, fit_effect(problem, rival.effect), key=lambda f: f.gain)

    def evidence(self, added: Sequence[GapRun], index: int, rivals: Rivals) -> NDArray[np.float64]:
        """Return the logarithm of each member's probability if one of them is true."""
        problem = self._problem(added, index)
        return self._evidence(problem, self._fitted(problem, index, rivals))

    def _evidence(self, problem: GapRegression, members: Sequence[FittedEffect]) -> NDArray[np.float64]:
        fitted = []
        for each in members:
            gain, coefficients = problem.gain(each.variant, each.values)
            fitted.append(replace(each, gain=gain, coefficients=coefficients))
        ranking = rank_effects(problem, fitted)
        probability = {f.name: p for f, p in zip(ranking.fitted, ranking.probabilities, strict=True)}
        return np.array([np.log(max(probability[each.name], 1e-300)) for each in members])


def _searched(rivals: _Rivals, added: Sequence[GapRun], index: int) -> NDArray[np.float64]:
    return rivals.evidence(added, index, "searched")


def _shapes(rivals: _Rivals, index: int) -> list[FittedEffect]:
    return rivals.nearest_to(index)


def _coarse(rivals: _Rivals, added: Sequence[GapRun], design: Design) -> Promise | None:
    """Return what is expected of a run, the rivals as they were fitted; None where it has no rows."""
    expected = expected_states(design, rivals.states, rivals.policy.rate_share)
    (row,) = gap_runs([expected], rivals.model, ["advised"], rivals.policy)
    if not row.target.size:
        return None
    evidence = rivals.coarse.evidence([*added, row], rivals.members)
    return (*rivals.judged(evidence), design, row)


def _fine(rivals: _Rivals, added: Sequence[GapRun], run: tuple[Design, GapRun]) -> Promise:
    """Return the same with the rivals refined from the shapes that they are known to take."""
    design, row = run
    return (*rivals.expected([*added, row], "refined"), design, row)


def _as_if(
    rows: Sequence[GapRun],
    model: JointModel,
    others: Sequence[FittedEffect],
    true: FittedEffect,
    policy: DiagnosisPolicy,
) -> GapRegression:
    """Return the regression of runs whose gap is what an effect adds, without noise."""
    made = [
        replace(run, target=true.variant.along(run.motion, true.values) @ true.coefficients) for run in rows
    ]
    return GapRegression.build(made, model, others, policy)
