"""Which runs would tell effects apart: asked, class by class, of the problem that found them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sindyjoint.diagnosis.effort import Effort
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
    effort = Effort(problem.policy.advice_work, problem.policy.advice_seconds, say)
    found: list[Advice] = []
    with effort.clock:
        for step in classes:
            found += problem.separating_runs(step, rankings[step.effect], effort)
    status = STOPPED if effort.stopped else COMPLETE
    return tuple(found), AdviceSearch(status, effort.tried, effort.planned, effort.stopped)
