"""What a diagnosis comes to: named, ambiguous, unknown or nothing missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.budget import explained_by_state
from sindyjoint.diagnosis.campaign.outside import outside_probability
from sindyjoint.diagnosis.campaign.ranking import FittedEffect, Problem
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.text import spelled

# Named effects must account for all but this share of what repeats; else something unknown is there.
UNEXPLAINED = 0.15
# Where nothing repeats, what could be explained is itself an estimate.
UNEXPLAINED_BROADBAND = 0.3
# Beyond noise by less than this factor, the chain's own error is as good an explanation.
SIGNIFICANT_EXCESS = 1.25
SIGNIFICANT_GAP = 2.0
#: The name under which what is outside the catalogue stands among the rivals of a step, and its least probability.
UNKNOWN = "unknown"
LEAST_OUTSIDE = 0.005


def unexplained_share(problem: Problem, last: Problem, initial: Gap, final: Gap, noise: Gap) -> float:
    """Return the share of the gap beyond noise that the effects found leave, from 0 to 1.

    Where every run repeats, noise is known and all that repeats beyond it counts. Elsewhere only what a law without
    memory could still win, cross-validated, is known to be there.

    Parameters
    ----------
    problem, last : Problem
        Before the first effect and after the last one.
    initial, final, noise : Gap
    """
    if _repeats(problem):
        if last.chi_square <= SIGNIFICANT_EXCESS * last.degrees:
            return 0.0
        missing = max(problem.chi_square - problem.degrees, 1e-9)
        return float(np.clip((last.chi_square - last.degrees) / missing, 0.0, 1.0))
    beyond = initial.moment**2 - noise.moment**2
    if beyond <= 0 or final.moment <= SIGNIFICANT_GAP * noise.moment:
        return 0.0
    could = explained_by_state(last) * (final.moment**2 - noise.moment**2)
    return float(np.clip(could / beyond, 0.0, 1.0))


def _repeats(problem: Problem) -> bool:
    """Return whether all rows are means of periods, or swings, beyond whose noise everything counts."""
    return all(run.folded or run.swings is not None for run in problem.runs)


def outside_share(first: Problem, last: Problem, found: Sequence[FittedEffect]) -> float:
    """Return the probability that the effects found stand in for something outside the catalogue.

    Zero where none was found, and where runs do not repeat: what their noise is, is then known too roughly.
    """
    if not found or not all(run.folded for run in last.runs):
        return 0.0
    return outside_probability(first, last, found)


def judge(problem: Problem, steps: Sequence[Step], left: float, outside: float = 0.0) -> tuple[str, str]:
    """Return the verdict and its reason.

    Parameters
    ----------
    problem : Problem
    steps : sequence of Step
    left : float
        Share of the gap that the effects leave unexplained.
    outside : float
        Probability that they stand in for something outside the catalogue.
    """
    if left > (UNEXPLAINED if _repeats(problem) else UNEXPLAINED_BROADBAND):
        if steps:
            return (
                "unknown",
                f"the effects found leave {100 * left:.0f} % of the gap beyond noise unexplained",
            )
        return "unknown", f"no known effect explains the gap; {100 * left:.0f} % of it is more than noise"
    if not steps:
        return "nothing_missing", "what is left repeats no better than noise"
    if outside > 0.5:
        return "unknown", (
            "the effects found leave a rest that they would not leave if they were there, or are too many: something "
            f"outside the catalogue is there with a probability of {outside:.2f}"
        )
    if any(len(s.members) > 1 for s in steps):
        apart = "; ".join(" or ".join(spelled(m) for m in s.members) for s in steps if len(s.members) > 1)
        return "ambiguous", f"these runs cannot tell apart: {apart}"
    return "named", "found: " + ", then ".join(spelled(s.effect) for s in steps)


def humble(steps: Sequence[Step], verdict: str, outside: float = 0.0) -> list[Step]:
    """Give what is outside the catalogue its probability, taken from all names of each step.

    Where something unknown remains, no name may be near certain: it may stand in for what is not known.
    """
    if verdict == "unknown":
        outside = max(outside, 0.5)
    if outside < LEAST_OUTSIDE:
        return list(steps)
    inside = 1 - outside
    later = []
    for step in steps:
        rivals = [(name, inside * p) for name, p in step.rivals] + [(UNKNOWN, outside)]
        rivals.sort(key=lambda each: -each[1])
        later.append(replace(step, probability=inside * step.probability, rivals=tuple(rivals)))
    return later
