"""A diagnosis from the first gap to the verdict, alike for a campaign and for a structure."""

from __future__ import annotations

from sindyjoint.diagnosis.advice import advise
from sindyjoint.diagnosis.loop import Progress, add_effects
from sindyjoint.diagnosis.problem import P, Say
from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.diagnosis.verdict import Gaps, discount, judge


def explain_gap(first: P, most: int, say: Say) -> Diagnosis:
    """Add up to ``most`` effects that a model lacks, and return what that comes to; ``say`` hears each stage."""
    say("the gap")
    initial = first.initial_gap
    straight, steps = first.corrected()
    before = steps[-1].gap_after if steps else initial
    progress = add_effects(Progress(straight, before, steps), most, say)
    say("advice")
    residual = progress.problem.residual(straight)
    last = progress.problem.finished()
    final = progress.steps[-1].gap_after if progress.steps else first.gap
    gaps = Gaps(initial, final, first.noise_floor)
    verdict, reason = judge(progress.steps, residual, gaps, first.policy)
    steps = discount(progress.steps, verdict, residual, gaps, first.policy)
    found = {
        "verdict": verdict,
        "reason": reason,
        "initial": initial,
        "final": final,
        "noise_floor": gaps.floor,
        "budget": straight.budget(first, last),
        "where": first.places() if verdict != "nothing_missing" else (),
        "steps": steps,
        "advice": advise(last, steps, progress.rankings),
    }
    return last.diagnosis(first, found)
