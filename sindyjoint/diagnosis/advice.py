"""Which runs would tell effects apart: asked, class by class, of the problem that found them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.problem import Problem, Say
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.diagnosis.result import COMPLETE, NOT_NEEDED, STOPPED, Advice, AdviceSearch, Step


def advise(
    problem: Problem,
    steps: Sequence[Step],
    rankings: Mapping[str, Ranking[Any]],
    say: Say = lambda stage: None,
) -> tuple[tuple[Advice, ...], AdviceSearch]:
    """Return the runs that separate the class of each step that has rivals in it, and how far the search went."""
    classes = [step for step in steps if len(step.members) > 1 and step.effect in rankings]
    if not classes:
        return (), AdviceSearch(NOT_NEEDED)
    search = Portion(problem.policy.advice_work, problem.policy.advice_seconds)
    found, tried, planned = list[Advice](), 0, 0
    for step in classes:
        advice, some, of = problem.separating_runs(step, rankings[step.effect], search, say)
        found, tried, planned = [*found, *advice], tried + some, planned + of
    return tuple(found), AdviceSearch(STOPPED if search.stopped else COMPLETE, tried, planned, search.stopped)
