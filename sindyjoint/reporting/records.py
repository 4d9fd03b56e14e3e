"""What the result files and ``--json`` hold, as pydantic models, of which ``sindyjoint schema`` prints the JSON Schema.

They describe; the results themselves write. A test validates what every command writes against them. Numbers that are
not known are null.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Known = Annotated[float, Field(allow_inf_nan=False)]
Maybe = Known | None
Version = Annotated[Literal[1], Field(alias="schema")]
Severity = Literal["stops", "biases", "note"]
Sound = Literal["sound", "doubtful", "unsound"]
Joint = Literal["rotation", "translation"]


class Part(BaseModel):
    """Anything in a result file: it has no other keys than these."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)


class SoundnessPart(Part):
    """What the check of the data found, in short."""

    verdict: Sound
    ids: list[str]
    accepted: list[str]


class FindingPart(Part):
    """One fault of the data."""

    id: str
    run: str | None
    channel: str | None
    severity: Severity
    extent: str
    effect: str
    remedy: str


class CheckRecord(Part):
    """``check.json``: are the data sound."""

    schema_: Version
    verdict: Sound
    findings: list[FindingPart]


# ---- discovery


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
    """One of the reasons to trust a model, or not to."""

    colour: Literal["good", "fair", "poor"]
    sentence: str


class NextPart(Part):
    """A command, or an action on the bench, and what it is for."""

    do: str
    to: str


class TrustPart(Part):
    """Whether to trust the model, and what to do next."""

    answer: Literal["good", "fair", "poor"]
    lights: dict[str, LightPart]
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


# ---- verification


class CyclesPart(Part):
    """Half-cycles of a response: s, the unit of the response, s."""

    time: list[Known]
    amplitude: list[Known]
    period: list[Known]


class BothCycles(Part):
    """Half-cycles of the measured and of the simulated response."""

    measured: CyclesPart | None
    simulated: CyclesPart | None


class BothEnergies(Part):
    """Energy dissipated in each cycle, J."""

    measured: list[Known]
    simulated: list[Known]


class VerifiedRun(Part):
    """A run against its simulation; ``--json`` has the first five keys, ``verification.json`` all."""

    name: str
    response_nrmse: Maybe
    moment_nrmse: Maybe
    rmse: Maybe
    rmse_unit: str
    drive: Literal["moment", "windows", "motion", "free run", "pulse"] | None = None
    channel: Literal["angle", "moment", "displacement", "force"] | None = None
    noise_floor: Maybe = None
    amplitude_rms_error: Maybe = None
    mean_period_difference: Maybe = None
    failure: str | None = None
    cycles: BothCycles | None = None
    energy_per_cycle: BothEnergies | None = None


class SubjectPart(Part):
    """What the model was compared with."""

    kind: Literal["rig", "campaign"]
    name: str


class VerificationRecord(Part):
    """``verify --json`` and ``verification.json``, which has subject, reason and tolerance, too."""

    schema_: Version
    verdict: Literal["passed", "failed"]
    response_nrmse: Maybe
    moment_nrmse: Maybe
    noise_floor: Maybe
    amplitude_rms_error: Maybe
    mean_period_difference: Maybe
    free_run: int | None
    runs: list[VerifiedRun]
    warnings: list[str]
    soundness: SoundnessPart | None = None
    subject: SubjectPart | None = None
    reason: str | None = None
    tolerance: Maybe = None


# ---- diagnosis


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
    """An effect that was named and added; parameters in SI."""

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
    """``diagnose --json`` and ``diagnosis.json``, which also tells what a virtual test had hidden."""

    schema_: Annotated[Literal[2], Field(alias="schema")]
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


# ---- a rig, an export


class FrequenciesPart(Part):
    """Natural frequencies, Hz."""

    slipping: list[Known]
    locked: list[Known]


class PointPart(Part):
    """A point of the structure, m."""

    name: str
    peak: Known


class RigJoint(Part):
    """A joint of the structure: rad, s, J."""

    name: str
    peak_angle: Known
    locked_share: Known
    last_slip: Known
    dissipated: Known


class RigRecord(Part):
    """``rig --json`` and ``rig.json``: a structure in motion."""

    schema_: Version
    rig: str
    frequencies: FrequenciesPart
    duration: Known
    points: list[PointPart]
    joints: list[RigJoint]
    beams_dissipated: Known
    warnings: list[str]


class SimulatedRunPart(Part):
    """A run that was made."""

    name: str
    frequency: Maybe
    level: str | None
    samples: int


class SimulationRecord(Part):
    """``simulate --json``: a virtual test."""

    schema_: Version
    manifest: str
    joint: str
    runs: list[SimulatedRunPart]
