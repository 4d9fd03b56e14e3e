"""``discover --json``: the equation that was found, and its evidence."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict

from sindyjoint.reporting.records.parts import Joint, Known, Maybe, Part, SoundnessPart, Version


class DiscoveredJoint(Part):
    """The joint; its inertia as declared or identified, kg·m² (kg)."""

    name: str
    motion: Joint
    inertia: Maybe


class DiscoveredTerm(Part):
    """A term of the equation, SI.

    ``bias`` is what was removed from the coefficient; ``calibration`` by how much one standard uncertainty of a
    channel's gain moves it, where some are declared.
    """

    id: str
    symbol: str
    coefficient: Known
    unit: str
    standard_error: Known
    interval95: tuple[Known, Known]
    bias: Maybe
    calibration: dict[str, Known] = {}


class CoefficientOverPart(Part):
    """A coefficient at values of an input, SI, and what the levels of the input say of it."""

    id: str
    symbol: str
    unit: str
    values: list[Known]
    errors: list[Known]
    intervals: list[tuple[Known, Known]]
    levels: list[Known]
    estimates: list[Known]
    level_errors: list[Known]
    answer: str
    reason: str
    bound: Maybe


class OverInputPart(Part):
    """The law over a declared input; ``values`` are in its declared unit."""

    name: str
    label: str
    unit: str
    values: list[Known]
    coefficients: list[CoefficientOverPart]


class Dependence(Part):
    """A term of the paper of which the coefficient depends on an input."""

    term: str
    input: str


class PaperTermSet(Part):
    """Whether these are exactly the five terms of the paper, at each level of the inputs."""

    verdict: Literal["confirmed", "refuted", "undecided"]
    missing: list[str]
    extra: list[str]
    reason: str
    dependences: list[Dependence] = []


class FitPart(Part):
    """The fit, N·m (N)."""

    moment_rms: Known
    residual_rms: Known
    noise_floor: Maybe
    moving_fraction: Maybe
    samples: int
    runs: int


class LightPart(Part):
    """One of the reasons to trust a model, or not to, with the figures that it rests on."""

    model_config = ConfigDict(extra="allow")

    colour: Literal["good", "fair", "poor"]
    sentence: str


class NextPart(Part):
    """A command, or an action on the bench, and what it is for."""

    do: str
    to: str


class TrustPart(Part):
    """Whether to trust the model, and what to do next."""

    answer: Literal["good", "fair", "poor"]
    data: LightPart
    explained: LightPart | None = None
    predicts: LightPart | None = None
    determined: LightPart | None = None
    question: dict[str, LightPart] = {}
    next: list[NextPart]


class DiscoveryRecord(Part):
    """``discover --json``: which terms, with what coefficients and evidence."""

    schema_: Version
    joint: DiscoveredJoint
    terms: list[DiscoveredTerm]
    trust: TrustPart
    paper_term_set: PaperTermSet
    fit: FitPart
    over_inputs: list[OverInputPart] = []
    warnings: list[str]
    soundness: SoundnessPart
