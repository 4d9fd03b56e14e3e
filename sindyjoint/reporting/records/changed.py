"""``changed.json``: two tests of one joint."""

from __future__ import annotations

from typing import Literal

from sindyjoint.reporting.records.parts import Known, Maybe, Part, Version


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
