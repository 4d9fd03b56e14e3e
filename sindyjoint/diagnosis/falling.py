"""Steps of a diagnosis as they are reported: each of them makes the held-out gap smaller, alone or with others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.diagnosis.result import Gap, Step


def grows(before: Gap, after: Gap) -> bool:
    """Return whether a gap of the moment grows, or that of the response where no moment is measured.

    Where the response falls to a fraction of what it was, the moment may grow: that of a free motion is its inertia's.
    """
    if before.moment == before.moment and after.moment == after.moment:
        falls = after.response <= CAMPAIGN.little_help * before.response
        return after.moment > before.moment and not falls
    return after.response > before.response


def with_falling_gaps(steps: Sequence[Step], initial: Gap) -> tuple[Step, ...]:
    """Return steps none of which makes the gap larger: those that help only together have one gap, before and after.

    A displacement that is counted from the joint's own zero, say, fits worse until the law is there that has its middle
    at that zero. Such steps name each other, and share the gap before the first and after the last of them; where it
    grows at the end, with the step before.
    """
    groups: list[list[Step]] = []
    before, pending = initial, list[Step]()
    for step in steps:
        pending.append(step)
        if not grows(before, step.gap_after):
            groups.append(pending)
            before, pending = step.gap_after, []
    while pending and groups:
        pending = [*groups.pop(), *pending]
        before = groups[-1][-1].gap_after if groups else initial
        if not grows(before, pending[-1].gap_after):
            groups.append(pending)
            pending = []
    if pending:
        groups.append(pending)
    return tuple(_joined(groups, initial))


def _joined(groups: Sequence[Sequence[Step]], initial: Gap) -> Iterator[Step]:
    before, needless = initial, frozenset[str]()
    for group in groups:
        after = group[-1].gap_after
        names = tuple(step.effect for step in group) if len(group) > 1 else ()
        for step in group:
            # Effects that are fitted together all have the terms that no longer count: the first one states them.
            first = tuple(term for term in step.terms_dropped if term not in needless)
            needless |= set(first)
            yield replace(step, gap_before=before, gap_after=after, together=names, terms_dropped=first)
        before = after


def reported_together(steps: Sequence[Step]) -> list[tuple[Step, ...]]:
    """Return the steps in groups that share a gap, in their order."""
    groups: list[tuple[Step, ...]] = []
    for step in steps:
        if step.together and groups and groups[-1][-1].together == step.together:
            groups[-1] = (*groups[-1], step)
        else:
            groups.append((step,))
    return groups


def without_help(steps: Sequence[Step], least: float) -> tuple[Step, ...]:
    """Return the steps that take away less than a share of either gap: they may stand in for something else."""
    groups = reported_together(steps)
    return tuple(
        s for group in groups if not _helps(group[0].gap_before, group[-1].gap_after, least) for s in group
    )


def _helps(before: Gap, after: Gap, least: float) -> bool:
    pairs = (before.moment, after.moment), (before.response, after.response)
    return any(not last > (1 - least) * first for first, last in pairs if first == first)
