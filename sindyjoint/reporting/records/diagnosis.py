"""``diagnosis.json``: what a model lacks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from sindyjoint.reporting.records.discovery import TrustPart
from sindyjoint.reporting.records.parts import Known, Maybe, Part, SoundnessPart


class GapPart(Part):
    """Relative RMS gaps."""

    moment: Maybe
    response: Maybe


class GapsPart(Part):
    """Gap of the model alone, with the effects, of the noise, by uncertain numbers, and what stays beyond the noise."""

    initial: GapPart
    final: GapPart
    noise_floor: GapPart
    uncertainty: GapPart | None = None
    remainder: GapPart


class BudgetPart(Part):
    """Parts of the first gap, mean squares relative to that of the moment."""

    state: Maybe
    history: Maybe
    run: Maybe
    processing: Maybe
    noise: Maybe


class PlacePart(Part):
    """Where the gap lies."""

    axis: str
    range: str | list[Known]
    share: Known
    words: str


class RivalPart(Part):
    """Another effect, and its probability."""

    effect: str
    probability: Known


class StepPart(Part):
    """An effect that was named and added; parameters in SI. Gaps are those of all steps of ``together``, if any."""

    effect: str
    class_: Annotated[list[str], Field(alias="class")]
    family: str
    probability: Known
    rivals: list[RivalPart]
    parameters: dict[str, Known]
    units: dict[str, str]
    terms_dropped: list[str]
    gap_before: GapPart
    gap_after: GapPart
    together: list[str] | None = None


class AdvisedRun(Part):
    """A run to make: Hz, rad (m)."""

    frequency: Maybe
    level: Maybe
    waveform: str


class AdvicePart(Part):
    """What would tell rivals apart."""

    separates: list[str]
    run: AdvisedRun
    expected_confidence: Maybe


class AdviceSearchPart(Part):
    """How far the search for runs that tell rivals apart went."""

    status: Literal["not_sought", "not_needed", "complete", "stopped"]
    tried: int
    planned: int


class InPlaceKind(Part):
    """Numbers of a kind of joint: value and standard error by name."""

    terms: dict[str, list[Known]]
    elements: dict[str, dict[str, list[Known]]]


class InPlacePart(Part):
    """Of a diagnosis from the runs of a structure: models by kind of joint, and the structure's numbers."""

    lead: str
    kinds: dict[str, InPlaceKind]
    structure: list[dict[str, str | float]]


class DiagnosisRecord(Part):
    """``diagnose --json`` and ``diagnosis.json``, which also holds what a virtual test had hidden."""

    schema_: Annotated[Literal[2], Field(alias="schema")]
    trust: TrustPart | None = None
    verdict: Literal["named", "ambiguous", "partly_named", "unknown", "undecided", "nothing_missing"]
    reason: str
    gap: GapsPart
    budget: BudgetPart
    where: list[PlacePart]
    steps: list[StepPart]
    advice: list[AdvicePart]
    advice_search: AdviceSearchPart
    warnings: list[str]
    soundness: SoundnessPart | None = None
    in_place: InPlacePart | None = None
    hidden: str | None = None
