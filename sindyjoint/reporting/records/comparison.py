"""``comparison.json``: whether the same equation holds at every frequency."""

from __future__ import annotations

from typing import Literal

from sindyjoint.reporting.records.discovery import TrustPart
from sindyjoint.reporting.records.parts import Joint, Known, Maybe, Part, SoundnessPart, Version


class ChosenTermPart(Part):
    """A term in one of the compared models, SI."""

    id: str
    coefficient: Known
    standard_error: Maybe
    interval95: tuple[Maybe, Maybe]


class SizeScorePart(Part):
    """The model of one size on a path; errors relative to the RMS moment."""

    size: int
    terms: list[str]
    residual: Maybe
    held_out: Maybe


class ChoicePart(Part):
    """What one method, frequency or library leads to."""

    name: str
    terms: list[ChosenTermPart]
    reason: str
    candidates: int
    seconds: Maybe
    held_out: Maybe
    response: Maybe
    not_simulated: str
    path: list[SizeScorePart]
    offers_paper_terms: bool
    wanted: list[str]
    dependences: list[tuple[str, str]]
    not_given: list[str]
    residual: Maybe = None


class FoldPart(Part):
    """Runs that were predicted by a model found without them."""

    left_out: list[str]
    runs: list[str]
    kept: list[str]
    coefficients: list[Maybe]
    moment_error: Maybe


class FoldsPart(Part):
    """All folds of a cross-validation."""

    folds: list[FoldPart]


class FrequencyTestPart(Part):
    """What estimates at several frequencies say about a coefficient."""

    name: str
    frequencies: list[Maybe]
    estimates: list[Maybe]
    standard_errors: list[Maybe]
    mean: Maybe
    mean_error: Maybe
    q: Maybe
    degrees: int
    p_homogeneity: Maybe
    i_squared: Maybe
    tau: Maybe
    slope: Maybe
    slope_error: Maybe
    p_trend: Maybe
    change: Maybe
    change_bound: Maybe
    margin: Maybe
    answer: str
    reason: str


class GivenModelPart(Part):
    """A model that was there before, held against the same runs."""

    terms: list[str]
    elements: list[str]
    residual: Maybe
    response: Maybe
    seen: bool


class ComparisonRecord(Part):
    """``compare --json`` and ``comparison.json``: methods, frequencies and libraries against terms."""

    schema_: Version
    trust: TrustPart | None = None
    kind: Literal["Comparison"]
    agreement: str
    joint: str
    motion: Joint
    simulated: bool
    ids: list[str]
    units: dict[str, str]
    methods: list[ChoicePart]
    frequencies: list[ChoicePart]
    parts: Literal["frequency", "level", "run"] = "frequency"
    libraries: list[ChoicePart]
    inclusion: list[Maybe]
    sets: list[tuple[list[str], Known]]
    left_out: dict[str, FoldsPart]
    tests: list[FrequencyTestPart]
    bias: dict[str, Maybe]
    model: ChoicePart
    undetermined: list[str]
    warnings: list[str]
    seconds: dict[str, Maybe]
    soundness: SoundnessPart
    noise_floor: Maybe = None
    given: GivenModelPart | None = None
