"""``check.json``: the soundness of the data."""

from __future__ import annotations

from sindyjoint.reporting.records.parts import Part, Severity, Sound, Version


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
