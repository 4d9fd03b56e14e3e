"""Which runs would tell effects apart: each rival in turn is taken for true, and the others are fitted to it.

Twice the odds' logarithm that a run is expected to add is what a rival cannot follow of the true effect in it, squared
and in units of noise (Atkinson and Fedorov 1975, Biometrika 62(1): T-optimality). A rival may move all that it has: the
terms of the model, its coefficients, and its nonlinear parameters to first order. The measured rows are the same for
every run that is tried: they are one triangular factor, under which that of the run is laid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sindyjoint.clock import Portion, spend
from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.designs import BY_MOMENT, Design, designs, expected_states, within
from sindyjoint.diagnosis.campaign.gap_rows import base_columns, gap_runs
from sindyjoint.diagnosis.campaign.regression import effect_rows, stack
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.problem import Say
from sindyjoint.diagnosis.result import Advice, Step
from sindyjoint.limits import STATES
from sindyjoint.mechanics.excitation import Actuator
from sindyjoint.numeric import Array
from sindyjoint.text import in_words_of

# Step of the differences, in the logarithm of a nonlinear parameter.
STEP = 0.02
NO_RUN = "none: no prescribed angle that was tried separates them"
NOT_WITHIN = (
    "none: no run that was tried is within the limits of the actuator, at the frequencies and angles tested"
)
NO_FREQUENCY = (
    "none: no run can be proposed, since the runs declare no frequency; record a sine at several levels"
)
READ_ZEROS = "none: no motion separates them; read both channels with the joint unloaded and at rest"


@dataclass(frozen=True)
class Promise:
    """What is expected of a run: the probability of the true member, averaged over which of them is true.

    Where that saturates the margin, in nats, goes on: the log-odds of the true one over the best of the others.
    """

    design: Design
    factor: Array
    confidence: float
    margin: float


def separating_runs(
    work: Work,
    found: Sequence[FittedEffect],
    step: Step,
    rivals: Sequence[FittedEffect],
    search: Portion,
    say: Say,
    actuator: Actuator | None = None,
) -> tuple[tuple[Advice, ...], int, int]:
    """Return up to two runs that separate the class of a named effect best, how many were tried, and of how many.

    ``rivals`` are the other members of the class, each as the data have it: what it would do where nothing was measured
    is what the data say of it, and not what comes nearest to the effect that was named.
    With an actuator: of those that it can make.
    Where no run does, the advice says so: its frequency and level are zero. With an actuator it is then the runs along
    which the rivals, as they are, differ most: what the data hold for true of them may still change with these.
    """
    mine = next((f for f in found if f.name == step.effect), None)
    if mine is None or not rivals:
        return (), 0, 0
    runs = designs(work.states, work.policy, actuator)
    if actuator is not None:
        runs = tuple(each for each in runs if within(each, actuator, work.model))
    members, motion = (mine, *rivals), work.model.joint.motion
    channels = any(each.effect.enters != "moment" for each in members)

    def without(words: str, confidence: float) -> tuple[Advice, ...]:
        return (Advice(step.members, 0.0, 0.0, in_words_of(motion, words), confidence),)

    if not runs:
        none = READ_ZEROS if channels else NO_FREQUENCY if actuator is None else NOT_WITHIN
        return without(none, step.probability), 0, 0
    others = tuple(f for f in found if f is not mine and not f.shifts)
    known = {step.effect: step.probability, **dict(step.rivals)}
    weights = np.array([max(known.get(each.name, 0.0), 1e-3) for each in members])
    apart = Rivals(work, others, members, weights / weights.sum())
    tried = [] if search.do(lambda: apart.factor, None, "") is None else _factors(apart, runs, search, say)
    if not tried:
        return (), len(tried), len(runs)
    chosen = _chosen(apart, tried, actuator is not None and not channels)
    names = tuple(each.name for each in members)
    advice = tuple(
        Advice(
            names,
            each.design.frequency,
            each.design.level,
            in_words_of(motion, each.design.waveform),
            each.confidence,
        )
        for each in chosen
    )
    none = READ_ZEROS if channels else NO_RUN
    return advice or without(none, apart.judged(())[0]), len(tried), len(runs)


def _chosen(apart: Rivals, tried: Sequence[tuple[Design, Array]], in_any_case: bool) -> list[Promise]:
    """Return runs until the expected margin suffices, the best first; or those that come nearest to separating."""
    policy, chosen = apart.work.policy, list[Promise]()
    confidence, margin = apart.judged(())
    first = best = apart.promises(tried, ())
    while len(chosen) < policy.most_runs and margin < policy.clear:
        least = (confidence + policy.little_confidence, margin + policy.little_margin)
        if best[0].confidence < least[0] and best[0].margin < least[1]:
            break
        chosen.append(best[0])
        confidence, margin = best[0].confidence, best[0].margin
        best = apart.promises(tried, [each.factor for each in chosen])
    if chosen or not in_any_case:
        return chosen
    # Of each waveform one: of its neighbours the next best says the same.
    waves = {each.design.waveform: replace(each, confidence=confidence) for each in reversed(first)}
    return [*waves.values()][::-1][: policy.most_runs]


def _factors(apart: Rivals, runs: Sequence[Design], search: Portion, say: Say) -> list[tuple[Design, Array]]:
    """Return the rows of the runs that can be tried, condensed."""
    tried = []
    for count, design in enumerate(runs):
        if count % 15 == 0:
            say(f"advice: {count} of {len(runs)} runs tried")

        def factor(design: Design = design) -> Array:
            return apart.factor_of(design)

        found = search.do(factor, None, "")
        if found is None:
            break
        tried.append((design, found))
    return tried


@dataclass(frozen=True, eq=False)
class Rivals:
    """The members of a class along a campaign.

    Parameters
    ----------
    work : Work
    others : tuple of FittedEffect
        Effects found beside them.
    members : tuple of FittedEffect
    weights : ndarray, shape (members,)
        Probability of each by what was measured.
    """

    work: Work
    others: tuple[FittedEffect, ...]
    members: tuple[FittedEffect, ...]
    weights: Array

    @cached_property
    def factor(self) -> Array:
        """The same products as the measured rows of all columns; triangular, shape (k, k)."""
        return self.condensed(self.work.rows)

    def condensed(self, runs: Sequence[GapRun]) -> Array:
        """Return the factor of whitened rows: the columns that are there in any case, then those of each member."""
        columns = [stack(runs, lambda run: base_columns(self.work.model, run))]
        columns += [effect_rows(runs, each) for each in self.others]
        columns += [
            part for each in self.members for part in (effect_rows(runs, each), self._slopes(runs, each))
        ]
        return np.asarray(np.linalg.qr(np.hstack(columns), mode="r"))

    def _slopes(self, runs: Sequence[GapRun], member: FittedEffect) -> Array:
        """Return the derivatives of a member's moment over the logarithms of its nonlinear parameters."""
        spend(sum(run.motion.angle.size for run in runs) * (1.0 + 2 * member.values.size))
        columns = [np.empty((sum(run.white_size for run in runs), 0))]
        for place in range(member.values.size):
            ends = []
            for step in (STEP, -STEP):
                values = member.values.copy()
                values[place] *= np.exp(step)
                ends.append(effect_rows(runs, replace(member, values=values)) @ member.coefficients)
            columns.append(((ends[0] - ends[1]) / (2 * STEP))[:, None])
        return np.nan_to_num(np.hstack(columns), posinf=0.0, neginf=0.0)

    def factor_of(self, design: Design) -> Array:
        """Return the factor of a run that nobody has made yet."""
        expected = expected_states(design, self.work.states, STATES.passing_rate_share)
        (row,) = gap_runs([expected], self.work.model, ["advised"], self.work.policy)
        return self.condensed([row]) if row.target.size else np.zeros_like(self.factor[:0])

    @property
    def places(self) -> tuple[int, list[tuple[slice, slice]]]:
        """How many columns are there in any case, and where each member's are: all, and those of its coefficients."""
        sizes = [(len(each.coefficients), each.values.size) for each in self.members]
        base = self.factor.shape[1] - sum(map(sum, sizes))
        ends = base + np.cumsum([0, *map(sum, sizes)])
        return base, [
            (slice(a, b), slice(a, a + own))
            for a, b, (own, _) in zip(ends[:-1], ends[1:], sizes, strict=True)
        ]

    def misfits(self, factors: Sequence[Array]) -> Array:
        """Return what each member (columns) cannot follow where another is true (rows), in units of its χ² by noise.

        Columns err by a share of what they explain; that no rival need follow.
        """
        rows, (base, places) = np.vstack([self.factor, *factors]), self.places
        found = np.zeros((len(self.members),) * 2)
        for i, (member, (_, own)) in enumerate(zip(self.members, places, strict=True)):
            target = rows[:, own] @ member.coefficients
            inflated = 1 + self.work.policy.column_error**2 * _left(rows[:, :base], target)
            for j, (columns, _) in enumerate(places):
                if j != i:
                    beside = np.hstack([rows[:, :base], rows[:, columns]])
                    found[i, j] = _left(beside, target) / inflated
        return found

    def judged(self, factors: Sequence[Array]) -> tuple[float, float]:
        """Return expected confidence and margin with some runs more."""
        more = np.maximum(self.misfits(factors) - self.misfits(()), 0.0)
        odds = np.log(self.weights) - 0.5 * more
        own = np.exp(np.diag(odds) - np.logaddexp.reduce(odds, axis=1))
        others = np.where(np.eye(len(odds), dtype=bool), -np.inf, odds).max(axis=1)
        most = self.work.policy.clear
        margin = np.clip(np.diag(odds) - others, -most, most)
        # Ties of the confidence are decided by the margin.
        return round(float(self.weights @ own), 3), float(self.weights @ margin)

    def promises(self, tried: Sequence[tuple[Design, Array]], added: Sequence[Array]) -> list[Promise]:
        """Return what is expected of runs, the best first: by a moment where that drove before and is enough."""
        found = [Promise(design, factor, *self.judged([*added, factor])) for design, factor in tried]
        enough = self.work.policy.confident

        def worth(each: Promise) -> tuple[bool, float, float]:
            by_moment = each.design.waveform == BY_MOMENT and each.confidence >= enough
            return by_moment, each.confidence, each.margin

        return sorted(found, key=worth, reverse=True)


def _left(columns: Array, target: Array) -> float:
    """Return the sum of squares of a target that columns do not explain."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns[:, size > 0] / size[size > 0]
    numbers = np.linalg.lstsq(scaled, target, rcond=1e-9)[0]
    return float(np.sum((target - scaled @ numbers) ** 2))
