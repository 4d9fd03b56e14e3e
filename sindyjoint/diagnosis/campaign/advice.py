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
from sindyjoint.diagnosis.campaign.ranking import FittedEffect, Problem, fit_effect, rank, refine_effect
from sindyjoint.diagnosis.campaign.rows import gap_runs
from sindyjoint.diagnosis.campaign.run_rows import GapRun
from sindyjoint.diagnosis.campaign.start import RATE_SHARE
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.result import Advice, Step
from sindyjoint.equation.model import JointModel
from sindyjoint.parallel import side_by_side
from sindyjoint.states import ForceStates

MOST_RUNS = 2
ENOUGH = 0.95  # expected confidence at which a run by a moment is as good as any
# Nats; a margin after which no second run is asked for: rivals can bend further than is tried here.
CLEAR = 20.0
CLOSER_LOOK = 3  # runs in which the rivals are fitted anew
# Less gain than this is none: of confidence, and of margin in nats.
LITTLE, LITTLE_MARGIN = 0.02, 0.3
MOST_NATS = 30.0
NO_RUN = "none: no prescribed angle that was tried separates them"
READ_ZEROS = "none: no motion separates them; read both channels with the joint unloaded and at rest"


def advise(
    rows: Sequence[GapRun],
    states: Sequence[ForceStates],
    model: JointModel,
    found: Sequence[FittedEffect],
    steps: Sequence[Step],
    candidates: Sequence[Effect],
) -> tuple[Advice, ...]:
    """Return, for each name that has rivals in its class, up to two runs that separate the class best.

    Where no run does, the advice says so: its frequency and level are zero.
    """
    known = {effect.id: effect for effect in candidates}
    advice: list[Advice] = []
    for step in steps:
        rivals = [known[m] for m in step.members if m != step.effect and m in known]
        mine = next((f for f in found if f.effect.id == step.effect), None)
        if mine is None or not rivals:
            continue
        others = [f for f in found if f is not mine and f.effect.enters != "time shift"]
        weights = {step.effect: step.probability, **dict(step.rivals)}
        advice += _Rivals.build(rows, states, model, mine, rivals, others, weights).advice()
    return tuple(advice)


class _Rivals:
    """The members of a class as each would have made the measured campaign."""

    def __init__(
        self,
        rows: Sequence[GapRun],
        states: Sequence[ForceStates],
        model: JointModel,
        others: Sequence[FittedEffect],
        members: Sequence[FittedEffect],
        weights: Sequence[float],
    ) -> None:
        self.rows, self.states, self.model, self.others = tuple(rows), tuple(states), model, tuple(others)
        self.members = tuple(members)
        self.weights = np.asarray(weights) / np.sum(weights)
        self.before = [self._evidence([], index, closely=True) for index in range(len(self.members))]

    @classmethod
    def build(
        cls,
        rows: Sequence[GapRun],
        states: Sequence[ForceStates],
        model: JointModel,
        mine: FittedEffect,
        rivals: Sequence[Effect],
        others: Sequence[FittedEffect],
        weights: dict[str, float],
    ) -> _Rivals:
        """Fit the rivals to what the effect that was named adds to the moment."""
        problem = _as_if(rows, model, others, mine)
        members = [mine, *(fit_effect(problem, rival) for rival in rivals)]
        share = [max(weights.get(each.effect.id, 0.0), 1e-3) for each in members]
        return cls(rows, states, model, others, members, share)

    def advice(self) -> list[Advice]:
        """Return runs until the expected confidence suffices, the best first."""
        names = tuple(each.effect.id for each in self.members)
        added: list[GapRun] = []
        advice: list[Advice] = []
        before, margin = self.expected([], closely=True)
        for _ in range(MOST_RUNS):
            best = self._best(added)
            if best is None or (best[0] < before + LITTLE and best[1] < margin + LITTLE_MARGIN):
                break
            before, margin, design, row = best
            added.append(row)
            advice.append(Advice(names, design.frequency, design.level, design.waveform, before))
            if margin >= CLEAR:
                break
        if advice:
            return advice
        channels = any(each.effect.enters != "moment" for each in self.members)
        return [Advice(names, 0.0, 0.0, READ_ZEROS if channels else NO_RUN, before)]

    def _best(self, added: Sequence[GapRun]) -> tuple[float, float, Design, GapRun] | None:
        """Return the run with the highest expected confidence, by a moment where that drove before and suffices."""
        runs = designs(self.states)
        moments = [each for each in runs if each.waveform == BY_MOMENT]
        best = self._best_of(moments, added) if moments else None
        if best is not None and best[0] >= ENOUGH:
            return best
        other = self._best_of([each for each in runs if each.waveform != BY_MOMENT], added)
        found = [each for each in (best, other) if each is not None]
        return max(found, key=lambda each: each[:2]) if found else None

    def _best_of(
        self, runs: Sequence[Design], added: Sequence[GapRun]
    ) -> tuple[float, float, Design, GapRun] | None:
        """Return the best of some runs: all at a glance, the best few with the rivals fitted anew."""
        glanced = side_by_side(_glanced, runs, [self, tuple(added)])
        tried = [each for each in glanced if each is not None]
        tried.sort(key=lambda each: each[:2], reverse=True)
        again = side_by_side(_looked, [each[2:] for each in tried[:CLOSER_LOOK]], [self, tuple(added)])
        return max(again, key=lambda each: each[:2]) if again else None

    def expected(self, added: Sequence[GapRun], closely: bool) -> tuple[float, float]:
        """Return expected confidence and margin with some runs more.

        The confidence is the probability that the true member would have, on average over which of them is true:
        today's odds times what the runs add to the evidence. The margin, in nats, goes on where it saturates.
        """
        confidence = margin = 0.0
        for index, weight in enumerate(self.weights):
            gained = self._evidence(added, index, closely) - self.before[index]
            logarithms = np.log(self.weights) + gained
            odds = np.exp(logarithms - logarithms.max())
            confidence += weight * float(odds[index] / odds.sum())
            others = np.delete(logarithms, index)
            margin += weight * float(np.clip(logarithms[index] - others.max(), -MOST_NATS, MOST_NATS))
        # Ties of the confidence are decided by the margin.
        return round(confidence, 3), margin

    def _evidence(self, added: Sequence[GapRun], index: int, closely: bool) -> NDArray[np.float64]:
        """Return the logarithm of each member's probability if one of them is true."""
        true = self.members[index]
        problem = _as_if([*self.rows, *added], self.model, self.others, true)
        fitted = []
        for each in self.members:
            if each is not true and closely:
                # As a rival of the campaign with these runs it is free to take any other form of its own.
                each = max(
                    refine_effect(problem, each), fit_effect(problem, each.effect), key=lambda f: f.gain
                )
            gain, coefficients = problem.gain(each.variant, each.values)
            fitted.append(replace(each, gain=gain, coefficients=coefficients))
        ranking = rank(problem, fitted)
        places = {f.effect.id: p for f, p in zip(ranking.fitted, ranking.probabilities, strict=True)}
        return np.array([np.log(max(places[each.effect.id], 1e-300)) for each in self.members])


def _glanced(
    rivals: _Rivals, added: Sequence[GapRun], design: Design
) -> tuple[float, float, Design, GapRun] | None:
    """Return what is expected of a run, the rivals as they were fitted; None where it has no rows."""
    expected = expected_states(design, rivals.states, RATE_SHARE)
    (row,) = gap_runs([expected], rivals.model, ["advised"])
    return (*rivals.expected([*added, row], closely=False), design, row) if row.target.size else None


def _looked(
    rivals: _Rivals, added: Sequence[GapRun], run: tuple[Design, GapRun]
) -> tuple[float, float, Design, GapRun]:
    """Return the same with the rivals fitted anew."""
    design, row = run
    return (*rivals.expected([*added, row], closely=True), design, row)


def _as_if(
    rows: Sequence[GapRun], model: JointModel, others: Sequence[FittedEffect], true: FittedEffect
) -> Problem:
    """Return the problem of runs whose gap is what an effect adds, without noise."""
    made = [
        replace(run, target=true.variant.along(run.motion, true.values) @ true.coefficients) for run in rows
    ]
    return Problem.build(made, model, others)
