"""Which runs would tell effects apart: asked, class by class, of the problem that found them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sindyjoint.diagnosis.problem import Problem
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.diagnosis.result import Advice, Step


def advise(
    problem: Problem, steps: Sequence[Step], rankings: Mapping[str, Ranking[Any]]
) -> tuple[Advice, ...]:
    """Return the runs that separate the class of each step that has rivals in it."""
    return tuple(
        advice
        for step in steps
        if len(step.members) > 1 and step.effect in rankings
        for advice in problem.separating_runs(step, rankings[step.effect])
    )
