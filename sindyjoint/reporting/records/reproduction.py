"""``reproduction.json`` and ``reproduce --json``: the paper's tables and pulse."""

from __future__ import annotations

from sindyjoint.reporting.records.parts import Known, Maybe, Part, Version
from sindyjoint.reporting.records.verification import VerificationRecord


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
