"""Which runs would tell effects apart: each rival in turn is taken for true, and the others are fitted to it.

The rivals are laid along motions that nobody has measured yet, beside those that were. What the others cannot follow is
put into the same probabilities by which effects are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.designs import BY_MOMENT, Design, designs, expected_states
from sindyjoint.diagnosis.campaign.regression import GapRegression, fit_effect, rank_effects, refine_effect
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Advice, Step
from sindyjoint.equation.model import JointModel
from sindyjoint.parallel import side_by_side
from sindyjoint.text import in_words_of

# How rivals are laid along a run that nobody measured: as found, from there refined, or searched anew as well.
Rivals = Literal["as found", "refined", "searched"]
# Expected confidence, expected margin, the run, its rows.
Promise = tuple[float, float, Design, GapRun]
FINE = 3  # runs in which the rivals are fitted anew
MOST_NATS = 30.0  # a margin is counted up to this: beyond, its mean would rest on one rival
NO_RUN = "none: no prescribed angle that was tried separates them"
READ_ZEROS = "none: no motion separates them; read both channels with the joint unloaded and at rest"


def separating_runs(
    work: Work, found: Sequence[FittedEffect], step: Step, rivals: Sequence[Effect]
) -> tuple[Advice, ...]:
    """Return up to two runs that separate the class of a named effect best.

    Where no run does, the advice says so: its frequency and level are zero.
    """
    mine = next((f for f in found if f.name == step.effect), None)
    if mine is None or not rivals:
        return ()
    others = [f for f in found if f is not mine and not f.shifts]
    return tuple(_Rivals.build(work, mine, rivals, others, step).advice())


class _Rivals:
    """The members of a class as each would have made the measured campaign."""

    def __init__(
        self,
        work: Work,
        others: Sequence[FittedEffect],
        members: Sequence[FittedEffect],
        weights: Sequence[float],
    ) -> None:
        self.rows, self.states, self.model, self.policy = work.rows, work.states, work.model, work.policy
        self.others, self.members = tuple(others), tuple(members)
        self.weights = np.asarray(weights) / np.sum(weights)
        everyone = range(len(self.members))
        # Each rival in the shape in which it comes nearest to each of the others, as far as was measured.
        self.shapes: list[list[FittedEffect]] = []
        problems = [self._problem([], index) for index in everyone]
        self.shapes = [self._fitted(problems[index], index, "searched") for index in everyone]
        self.before = [self._evidence(problems[index], self.shapes[index]) for index in everyone]

    @classmethod
    def build(
        cls,
        work: Work,
        mine: FittedEffect,
        rivals: Sequence[Effect],
        others: Sequence[FittedEffect],
        step: Step,
    ) -> _Rivals:
        """Fit the rivals to what the effect that was named adds to the moment."""
        problem = _as_if(work.rows, work.model, others, mine, work.policy)
        members = [mine, *(fit_effect(problem, rival) for rival in rivals)]
        known = {step.effect: step.probability, **dict(step.rivals)}
        return cls(work, others, members, [max(known.get(each.name, 0.0), 1e-3) for each in members])

    def advice(self) -> list[Advice]:
        """Return runs until the expected confidence suffices, the best first."""
        names = tuple(each.name for each in self.members)
        added: list[GapRun] = []
        advice: list[Advice] = []
        before, margin = self._judged(self.before)
        policy, motion = self.policy, self.model.joint.motion
        for _ in range(policy.most_runs):
            least = (before + policy.little_confidence, margin + policy.little_margin)
            best = self._best(added, least)
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
        return [Advice(names, 0.0, 0.0, READ_ZEROS if channels else in_words_of(motion, NO_RUN), before)]

    def _best(self, added: Sequence[GapRun], least: tuple[float, float]) -> Promise | None:
        """Return the run with the highest expected confidence, by a moment where that drove before and suffices.

        None where no run reaches one of two least values, of confidence and margin.
        """
        runs = designs(self.states, self.policy)
        moments = self._promises([each for each in runs if each.waveform == BY_MOMENT], added)
        enough = self.policy.enough
        best = self._surest([each for each in moments if each[0] >= enough], added, least)
        if best is not None and best[0] >= enough:
            return best
        moments = [each for each in moments if each[0] < enough]
        others = self._promises([each for each in runs if each.waveform != BY_MOMENT], added)
        return self._surest([*moments, *others], added, least, best)

    def _promises(self, runs: Sequence[Design], added: Sequence[GapRun]) -> list[Promise]:
        """Return the few runs that promise most with rivals as they are, and what they keep with rivals refined."""
        if not runs:
            return []
        coarse = side_by_side(_coarse, runs, [self, tuple(added)])
        tried = [each for each in coarse if each is not None]
        tried.sort(key=lambda each: each[:2], reverse=True)
        return side_by_side(_fine, [each[2:] for each in tried[:FINE]], [self, tuple(added)])

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
            evidence = side_by_side(_searched, range(len(self.members)), [self, (*added, each[3])])
            kept = (*self._judged(evidence), *each[2:])
            best = kept if best is None or kept[:2] > best[:2] else best
        return best

    def expected(self, added: Sequence[GapRun], rivals: Rivals) -> tuple[float, float]:
        """Return expected confidence and margin with some runs more.

        The confidence is the probability that the true member would have, on average over which of them is true:
        today's odds times what the runs add to the evidence. The margin, in nats, goes on where it saturates.
        """
        return self._judged([self.evidence(added, index, rivals) for index in range(len(self.members))])

    def _judged(self, evidence: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
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
        if rivals == "as found":
            return rival
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


def _coarse(rivals: _Rivals, added: Sequence[GapRun], design: Design) -> Promise | None:
    """Return what is expected of a run, the rivals as they were fitted; None where it has no rows."""
    expected = expected_states(design, rivals.states, rivals.policy.rate_share)
    (row,) = gap_runs([expected], rivals.model, ["advised"], rivals.policy)
    return (*rivals.expected([*added, row], "as found"), design, row) if row.target.size else None


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
