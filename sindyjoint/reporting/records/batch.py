"""``batch.json`` and the record of each of its joints."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from sindyjoint.reporting.records.discovery import DiscoveryRecord
from sindyjoint.reporting.records.parts import Joint, Known, Maybe, Part, Version


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
