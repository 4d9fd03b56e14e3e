"""``plan.json``: runs to be made, and the precision expected of them."""

from __future__ import annotations

from typing import Literal

from sindyjoint.reporting.records.parts import Known, Maybe, Part, Version


class PlannedRunPart(Part):
    """A run to be made; Hz, s, and the level in its unit."""

    drive: Literal["moment", "angle"]
    waveform: str
    frequency: Known
    level: Known
    unit: str
    duration: Known


class PredictedPart(Part):
    """What is expected of a coefficient; null where the runs do not determine it."""

    half_width95: Maybe
    unit: str
    band90: tuple[Maybe, Maybe]
    chosen: Known


class PlanStep(Part):
    """What is known after some of the runs, relative: median, below what 95 of 100 tests lie, and the grid's median."""

    runs: int
    seconds: Known
    widest: Maybe
    highest: Maybe
    complete: Known
    grid: Maybe


class PlanNow(Part):
    """How far the runs of a campaign have come."""

    runs: int
    seconds: Known
    widest: Maybe
    complete: Known
    missing: int
    reached: bool


class PlanApart(Part):
    """How surely effects are told apart: probability of the true one, before and after each run that separates them."""

    effects: list[str]
    before: Maybe
    after: list[Known]
    words: str


class PlanRecord(Part):
    """``plan --json`` and ``plan.json``: runs to be made, and what they and the plain grid are expected to show."""

    schema_: Version
    runs: list[PlannedRunPart]
    predicted: dict[str, PredictedPart]
    grid: dict[str, PredictedPart]
    undetermined: list[str]
    goal: Literal["widths", "frequency", "paper", "tell-apart"]
    goals: dict[str, float] = {}
    apart: PlanApart | None = None
    now: PlanNow | None = None
    curve: list[PlanStep]
    stop: str
    warnings: list[str]
