"""Limits of a plan: which runs are thought of, how far they go, and when there are enough of them."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class PlanningPolicy:
    """Limits that decide which runs are planned; the meaning of each is in its metadata."""

    joints: int = limit(12, "joints drawn from the range over which a plan is averaged")
    spread: float = limit(
        0.2, "share by which a coefficient of a rough idea may differ where no range is given for it"
    )
    model_errors: float = limit(
        3.0, "standard errors by which a coefficient of a model may differ where no range is given for it"
    )
    limit_share: float = limit(
        0.98,
        "share of a limit of the actuator that is used",
        source="the corners of the range are simulated, joints between them are not",
    )
    most_runs: int = limit(40, "most runs of a plan that is given the duration of a run")
    complete: float = limit(
        0.95,
        "share of the joints of which a discovery takes every term that matters, before a test is stopped",
    )
    frequencies: int = limit(5, "frequencies of the band among which is chosen")
    levels: tuple[float, ...] = limit(
        (1.0, 0.84, 0.68, 0.53, 0.38),
        "levels among which is chosen, as shares of the highest that is allowed; the plain grid has every second one",
    )
    fewest_frequencies: int = limit(
        3, "different frequencies of a plan", source="terms are held out by frequency when they are selected"
    )
    fewest_levels: int = limit(
        2,
        "different levels at each of these",
        source="terms of angle and rate are nearly collinear along one sine",
    )
    settled: float = limit(3e-3, "RMS change from period to period, relative, below which a motion is steady")


POLICY = PlanningPolicy()
