"""Which runs would tell effects apart: each rival in turn is taken for true, and the others are fitted to it.

The rivals are laid along motions that nobody has measured yet, beside those that were. What the others cannot follow is
put into the same probabilities by which effects are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.designs import BY_MOMENT, Design, designs, expected_states
from sindyjoint.diagnosis.campaign.regression import (
    FittedEffect,
    GapRegression,
    fit_effect,
    rank_effects,
    refine_effect,
)
from sindyjoint.diagnosis.campaign.rows import gap_runs
from sindyjoint.diagnosis.campaign.run_rows import GapRun
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Advice, Step
from sindyjoint.equation.model import JointModel
from sindyjoint.parallel import side_by_side
from sindyjoint.text import in_words_of

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
        self.before = [self._evidence([], index, finely=True) for index in range(len(self.members))]

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
        before, margin = self.expected([], finely=True)
        policy, motion = self.policy, self.model.joint.motion
        for _ in range(policy.most_runs):
            best = self._best(added)
            if best is None or (
                best[0] < before + policy.little_confidence and best[1] < margin + policy.little_margin
            ):
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

    def _best(self, added: Sequence[GapRun]) -> tuple[float, float, Design, GapRun] | None:
        """Return the run with the highest expected confidence, by a moment where that drove before and suffices."""
        runs = designs(self.states, self.policy)
        moments = [each for each in runs if each.waveform == BY_MOMENT]
        best = self._best_of(moments, added) if moments else None
        if best is not None and best[0] >= self.policy.enough:
            return best
        other = self._best_of([each for each in runs if each.waveform != BY_MOMENT], added)
        found = [each for each in (best, other) if each is not None]
        return max(found, key=lambda each: each[:2]) if found else None

    def _best_of(
        self, runs: Sequence[Design], added: Sequence[GapRun]
    ) -> tuple[float, float, Design, GapRun] | None:
        """Return the best of some runs: coarsely of all, the best few with the rivals fitted anew."""
        coarse = side_by_side(_coarse, runs, [self, tuple(added)])
        tried = [each for each in coarse if each is not None]
        tried.sort(key=lambda each: each[:2], reverse=True)
        again = side_by_side(_fine, [each[2:] for each in tried[:FINE]], [self, tuple(added)])
        return max(again, key=lambda each: each[:2]) if again else None

    def expected(self, added: Sequence[GapRun], finely: bool) -> tuple[float, float]:
        """Return expected confidence and margin with some runs more.

        The confidence is the probability that the true member would have, on average over which of them is true:
        today's odds times what the runs add to the evidence. The margin, in nats, goes on where it saturates.
        """
        confidence = margin = 0.0
        for index, weight in enumerate(self.weights):
            gained = self._evidence(added, index, finely) - self.before[index]
            logarithms = np.log(self.weights) + gained
            odds = np.exp(logarithms - logarithms.max())
            confidence += weight * float(odds[index] / odds.sum())
            others = np.delete(logarithms, index)
            margin += weight * float(np.clip(logarithms[index] - others.max(), -MOST_NATS, MOST_NATS))
        # Ties of the confidence are decided by the margin.
        return round(confidence, 3), margin

    def _evidence(self, added: Sequence[GapRun], index: int, finely: bool) -> NDArray[np.float64]:
        """Return the logarithm of each member's probability if one of them is true."""
        true = self.members[index]
        problem = _as_if([*self.rows, *added], self.model, self.others, true, self.policy)
        fitted = []
        for each in self.members:
            if each is not true and finely:
                # As a rival of the campaign with these runs it is free to take any other form of its own.
                each = max(
                    refine_effect(problem, each), fit_effect(problem, each.effect), key=lambda f: f.gain
                )
            gain, coefficients = problem.gain(each.variant, each.values)
            fitted.append(replace(each, gain=gain, coefficients=coefficients))
        ranking = rank_effects(problem, fitted)
        probability = {f.name: p for f, p in zip(ranking.fitted, ranking.probabilities, strict=True)}
        return np.array([np.log(max(probability[each.name], 1e-300)) for each in self.members])


def _coarse(
    rivals: _Rivals, added: Sequence[GapRun], design: Design
) -> tuple[float, float, Design, GapRun] | None:
    """Return what is expected of a run, the rivals as they were fitted; None where it has no rows."""
    expected = expected_states(design, rivals.states, rivals.policy.rate_share)
    (row,) = gap_runs([expected], rivals.model, ["advised"], rivals.policy)
    return (*rivals.expected([*added, row], finely=False), design, row) if row.target.size else None


def _fine(
    rivals: _Rivals, added: Sequence[GapRun], run: tuple[Design, GapRun]
) -> tuple[float, float, Design, GapRun]:
    """Return the same with the rivals fitted anew."""
    design, row = run
    return (*rivals.expected([*added, row], finely=True), design, row)


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
