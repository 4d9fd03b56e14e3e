"""A diagnosis from the first gap to the verdict, alike for a campaign and for a structure."""

from __future__ import annotations

from sindyjoint.diagnosis.advice import advise
from sindyjoint.diagnosis.loop import Progress, add_effects
from sindyjoint.diagnosis.problem import P, Say
from sindyjoint.diagnosis.result import Advice, Diagnosis
from sindyjoint.diagnosis.verdict import discount, judge


def explain_gap(first: P, most: int, say: Say, advised: bool = True) -> Diagnosis:
    """Add up to ``most`` effects that a model lacks, and return what that comes to; ``say`` hears each stage.

    Unless ``advised``, no runs are sought that would tell rivals apart.
    """
    say("the gap")
    initial = first.initial_gap
    straight, steps = first.corrected()
    before = steps[-1].gap_after if steps else initial
    progress = add_effects(Progress(straight, before, steps), most, say)
    residual = progress.problem.residual(straight)
    last = progress.problem.finished()
    verdict, reason = judge(progress.steps, residual, first.policy)
    steps = discount(progress.steps, verdict, residual.outside, first.policy)
    budget = straight.budget(first, last)
    places = first.places() if verdict != "nothing_missing" else ()
    advice: tuple[Advice, ...] = ()
    if advised:
        say("advice")
        advice = advise(last, steps, progress.rankings)
    found = {
        "verdict": verdict,
        "reason": reason,
        "initial": initial,
        "final": steps[-1].gap_after if steps else first.gap,
        "noise_floor": first.noise_floor,
        "budget": budget,
        "where": places,
        "steps": steps,
        "advice": advice,
    }
    return last.diagnosis(first, found)
