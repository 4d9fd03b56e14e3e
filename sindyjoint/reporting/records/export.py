"""``export --json``: the files of another program, and what it does not hold."""

from __future__ import annotations

from sindyjoint.reporting.records.parts import Maybe, Part, Version


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
