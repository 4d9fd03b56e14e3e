"""Limits of a plan: which runs are thought of, how far they go, and when there are enough of them."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


@dataclass(frozen=True)
class PlanningPolicy(SharedPolicy):
    """Limits that decide which runs are planned; the meaning of each is in its metadata."""

    joints: int = limit(12, "joints drawn from the range over which a plan is averaged")
    limit_share: float = limit(
        0.98,
        "share of a limit of the actuator that is used",
        source="the corners of the range are simulated, joints between them are not",
    )
    most_runs: int = limit(40, "most runs of a plan that is given the duration of a run")
    frequencies: int = limit(5, "frequencies of the band among which is chosen")
    levels: tuple[float, ...] = limit(
        (1.0, 0.84, 0.68, 0.53, 0.38),
        "levels among which is chosen, as shares of the highest that is allowed; the plain grid has every second one",
    )
    fewest_levels: int = limit(
        2,
        "different levels at each of these",
        source="terms of angle and rate are nearly collinear along one sine",
    )


POLICY = PlanningPolicy()
