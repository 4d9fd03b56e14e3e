"""A diagnosis from the first gap to the verdict, alike for a campaign and for a structure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from sindyjoint.diagnosis.advice import advise
from sindyjoint.diagnosis.loop import Progress, add_effects
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.problem import P, Say, Start
from sindyjoint.diagnosis.result import Diagnosis, Step
from sindyjoint.diagnosis.verdict import UNKNOWN, Gaps, Residual, discount, judge
from sindyjoint.text import percent, spelled


@dataclass(frozen=True, eq=False)
class Explained(Generic[P]):
    """What the search from one start came to.

    Parameters
    ----------
    straight : Problem
        The problem of that start, its channels put right.
    progress : Progress
    residual : Residual
    gaps : Gaps
    verdict, reason : str
    start : str
        What it began with, beside the model as it was given; empty where that was all.
    """

    straight: P
    progress: Progress[P]
    residual: Residual
    gaps: Gaps
    verdict: str
    reason: str
    start: str = ""

    @property
    def whole(self) -> bool:
        """Whether nothing remains to be explained."""
        return self.verdict in ("nothing_missing", "named", "ambiguous")

    def cost(self, policy: DiagnosisPolicy) -> float:
        """Return the mean logarithm of the final gaps, and what each number of the law costs."""
        figures = np.array([self.gaps.final.moment, self.gaps.final.response])
        known = figures[np.isfinite(figures)]
        misfit = float(np.mean(np.log(np.maximum(known, 1e-300))))
        return misfit + policy.number_cost * self.progress.problem.numbers


def explain_gap(first: P, most: int, say: Say, advised: bool = True) -> Diagnosis:
    """Add up to ``most`` effects that a model lacks, and return what that comes to; ``say`` hears each stage.

    Where the search from the model as it was given leaves something unexplained, it is made again from the best other
    start that the problem knows, and the better end is used. Unless ``advised``, no runs are sought that would
    tell rivals apart.
    """
    say("the gap")
    straight, steps = first.corrected()
    given = _explain(first, Start(straight, steps), most, say)
    best, note = given, ""
    if not given.whole:
        starts = first.other_starts(straight, given.progress.problem, say)
        start = min(starts, key=lambda each: each.problem.gap.moment, default=None)
        other = given if start is None else _explain(first, start, most, say)
        if other.cost(first.policy) < given.cost(first.policy):
            best = other
        note = _compare_starts(given, best)
    last = best.progress.problem.finished()
    steps = discount(best.progress.steps, best.verdict, best.residual, best.gaps, first.policy)
    final = best.gaps.final
    if last is not best.progress.problem:
        # The figures belong to the model that is handed on.
        final = last.gap
        steps = (*steps[:-1], *(replace(step, gap_after=final) for step in steps[-1:]))
    if advised:
        say("advice")
    found = {
        "verdict": best.verdict,
        "reason": best.reason,
        "initial": best.gaps.initial,
        "final": final,
        "noise_floor": best.gaps.floor,
        "budget": best.straight.budget(first, last),
        "where": first.places() if best.verdict != "nothing_missing" else (),
        "steps": steps,
        "advice": advise(last, steps, best.progress.rankings) if advised else (),
    }
    result = last.diagnosis(first, found)
    return replace(result, warnings=(note, *result.warnings)) if note else result


def _explain(first: P, start: Start[P], most: int, say: Say) -> Explained[P]:
    """Return what the search from one start comes to."""
    initial, straight = first.initial_gap, start.problem
    before = start.steps[-1].gap_after if start.steps else initial
    progress = add_effects(Progress(straight, before, start.steps), most + start.free, say)
    final = progress.steps[-1].gap_after if progress.steps else straight.gap
    gaps = Gaps(initial, final, first.noise_floor)
    residual = progress.problem.residual(start.before or straight)
    verdict, reason = judge(progress.steps, residual, gaps, first.policy)
    return Explained(start.before or straight, progress, residual, gaps, verdict, reason, start.words)


def _compare_starts(given: Explained[P], best: Explained[P]) -> str:
    """Return how the search ended from the model as it was given, where another start is used."""
    if best is given:
        return ""
    (_, used, _), (_, other, _) = best.gaps.figures(), given.gaps.figures()
    names = ", ".join(_name(step) for step in given.progress.steps) or "no effect"
    return (
        f"the search started from {best.start}, which ends with a gap of {percent(used)}; from the model as it was "
        f"given it ends with {percent(other)} ({given.verdict.replace('_', ' ')}: {names})"
    )


def _name(step: Step) -> str:
    return UNKNOWN if step.effect == UNKNOWN else spelled(step.effect)
