"""JSON records of exports, and of two tests of one joint."""

from __future__ import annotations

from typing import Literal

from sindyjoint.reporting.records import Known, Maybe, Part, Version

# ---- export


class FidelityPart(Part):
    """How the target holds a term; errors as shares of the RMS moment of the test."""

    term: str
    symbol: str
    representation: str
    carried: bool
    error: Maybe
    largest_error: Maybe


class ExportRecord(Part):
    """``export --json``: the files, and what the target does not hold."""

    schema_: Version
    target: str
    files: list[str]
    fidelity: list[FidelityPart]
    not_carried: list[str]
    notes: list[str]


# ---- two tests of one joint


class ShiftPart(Part):
    """A coefficient before and after, SI; ``change`` is relative to the value before."""

    id: str
    symbol: str
    name: str
    unit: str
    before: Maybe
    after: Maybe
    interval_before: tuple[Maybe, Maybe]
    interval_after: tuple[Maybe, Maybe]
    change: Maybe
    interval: tuple[Maybe, Maybe]
    p_value: Maybe
    answer: Literal[
        "changed", "changed within margin", "the same within margin", "cannot tell", "not compared"
    ]


class ChangeRecord(Part):
    """``changed --json`` and ``changed.json``."""

    schema_: Version
    joint: str
    before: str
    after: str
    changed: bool
    sentence: str
    margin: Known
    coefficients: list[ShiftPart]
    warnings: list[str]
