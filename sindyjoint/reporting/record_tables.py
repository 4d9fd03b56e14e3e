"""What the result files of many joints, of a comparison and of the paper's tables hold; see ``records``."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from sindyjoint.reporting.records import (
    DiscoveryRecord,
    Joint,
    Known,
    Maybe,
    Part,
    SoundnessPart,
    VerificationRecord,
    Version,
)

# ---- a comparison


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


# ---- many joints


class DeclaredJoint(Part):
    """The joint as its campaign declares it; empty for a campaign that could not be read."""

    name: str | None = None
    motion: Joint | None = None
    inertia: Maybe = None
    temperature: Maybe = None
    serial: str | None = None
    labels: dict[str, str] = {}
    inputs: dict[str, Known] = {}
    input_units: dict[str, str] = {}


class JointRecord(Part):
    """``record.json`` of a campaign in a batch."""

    schema_: Annotated[int, Field(alias="schema")]
    id: str
    manifest: str
    status: Literal["found", "none", "broken"]
    reason: str
    joint: DeclaredJoint
    result: DiscoveryRecord | None
    inputs: str
    outputs: dict[str, str]
    extras: list[str]
    earlier: dict[str, Any] | None
    checksum: str


class CommonPart(Part):
    """A coefficient that joints have in common, SI."""

    value: Maybe
    standard_error: Maybe


class BatchCampaign(Part):
    """What became of a campaign."""

    id: str
    manifest: str
    status: Literal["found", "none", "broken"]
    reason: str
    joint: DeclaredJoint
    terms: list[str]
    common_coefficients: dict[str, CommonPart]


class CommonTerm(Part):
    """A term that joints have in common."""

    id: str
    unit: str


class OutlierPart(Part):
    """A joint that stands out."""

    id: str
    score: Maybe
    p: Maybe


class ScatterPart(Part):
    """How a coefficient scatters over the joints."""

    term: str
    mean: Maybe
    mean_error: Maybe
    spread: Maybe
    next_joint95: tuple[Known, Known] | None
    about_trend_with: str | None
    outliers: list[OutlierPart]


class TrendPart(Part):
    """A coefficient's change with something that is known of every joint."""

    term: str
    covariate: str
    slope: Maybe
    standard_error: Maybe
    relative_change: Maybe
    p: Maybe
    p_adjusted: Maybe
    significant: bool
    joints: int


class DifferencePart(Part):
    """Why a campaign stands out."""

    id: str
    kind: Literal["outlier", "terms", "none", "broken"]
    text: str


class BatchRecord(Part):
    """``batch --json`` and ``batch.json``: many joints.

    Standard errors of single joints are without calibration; ``calibration`` is by what share of itself one standard
    uncertainty of a channel's gain moves a coefficient of all joints, by term and channel.
    """

    schema_: Version
    campaigns: list[BatchCampaign]
    found: int
    none: int
    broken: int
    calibration: dict[str, dict[str, Known]] = {}
    common_terms: list[CommonTerm]
    scatter: list[ScatterPart]
    trends: list[TrendPart]
    differences: list[DifferencePart]
    notes: list[str]


# ---- the paper


class ReproducedTerm(Part):
    """A column of a table of the paper, SI."""

    id: str
    symbol: str
    unit: str
    identified: list[Maybe]
    standard_errors: list[Maybe]
    paper: list[Known]
    average: Maybe
    paper_average: Known
    deviation: Maybe
    paper_deviation: Known
    largest_error_in_paper_deviations: Maybe
    paper_procedure: Maybe


class SurfacePart(Part):
    """RMS residual of the force–state surface, N·m."""

    ours: Maybe
    paper: Maybe


class ReproducedTable(Part):
    """A table of the paper."""

    table: int
    joint: str
    frequencies: list[Known]
    terms: list[ReproducedTerm]
    surface_rms: SurfacePart


class PaperPulse(Part):
    """What the paper reports of its pulse."""

    amplitude_rms_error: Known
    mean_period_difference: Known


class PulsePart(Part):
    """The pulse of the paper's section 5; s, share."""

    plain: VerificationRecord
    richer: VerificationRecord
    paper: PaperPulse
    locked_at: Maybe
    stuck_share: Maybe


class TrendOfTable(Part):
    """Whether a printed parameter depends on the frequency."""

    slope: Maybe
    p_trend: Maybe
    change: Maybe
    change_bound: Maybe
    answer: str
    reason: str


class PrintedTable(Part):
    """One parameter of a printed table, recomputed from its rows."""

    table: int
    joint: str
    term: str
    symbol: str
    unit: str
    rows: list[Known]
    average: Known
    deviation: Known
    sample_deviation: Known
    printed_average: Known
    printed_deviation: Known
    average_follows: bool
    deviation_follows: bool
    detectable: Maybe
    frequency: TrendOfTable


class ReproductionRecord(Part):
    """``reproduce --json`` and ``reproduction.json``: tables and figures of the paper."""

    schema_: Version
    tables: list[ReproducedTable]
    pulse: PulsePart
    printed_tables: list[PrintedTable]
    statements: list[str]


class PrintedTablesRecord(Part):
    """``reproduce tables --json``."""

    schema_: Version
    printed_tables: list[PrintedTable]
    findings: list[str]
