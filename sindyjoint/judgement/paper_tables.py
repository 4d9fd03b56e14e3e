"""Check of the paper's Tables 1 and 2: printed figures that do not follow from their rows."""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import ClassVar

import numpy as np

from sindyjoint.described import Described, Maybe, same
from sindyjoint.discovery.frequency import FrequencyTest, detectable_change, frequency_test
from sindyjoint.paper import FREQUENCIES, SYMBOLS, TABLES, TERMS, UNITS


@dataclass(frozen=True)
class TableCheck:
    """One parameter of one printed table.

    Parameters
    ----------
    table : int
    joint, term, symbol, unit : str
    rows : tuple of float
    average, deviation : float
        Recomputed; the deviation divided by the number of rows (ddof = 0).
    sample_deviation : float
        Divided by one less (ddof = 1): the scatter estimated from four values.
    printed_average, printed_deviation : float
    average_follows, deviation_follows : bool
        Whether the printed figure can follow from the printed rows, rounding of both allowed for.
    test : FrequencyTest
        Trend and equivalence; four bare numbers have no errors but their scatter.
    detectable : float
        Relative change over the band that a trend test on these four values would find in four of five cases.
    """

    WRITTEN: ClassVar = {
        **same(
            "table", "joint", "term", "symbol", "unit", "rows", "average", "deviation", "sample_deviation"
        ),
        **same("printed_average", "printed_deviation", "average_follows", "deviation_follows", "detectable"),
        "frequency": {
            name: f"test.{name}"
            for name in ("slope", "p_trend", "change", "change_bound", "answer", "reason")
        },
    }
    table: int
    joint: str
    term: str
    symbol: str
    unit: str
    rows: tuple[float, ...]
    average: float
    deviation: float
    sample_deviation: float
    printed_average: float
    printed_deviation: float
    average_follows: bool
    deviation_follows: bool
    test: FrequencyTest
    detectable: Maybe


@dataclass(frozen=True)
class PrintedTables(Described):
    """What ``reproduce tables --json`` prints.

    Parameters
    ----------
    printed_tables : tuple of TableCheck
    findings : tuple of str
    """

    SCHEMA: ClassVar = 1
    printed_tables: tuple[TableCheck, ...]
    findings: tuple[str, ...]


def half_unit(value: float) -> float:
    """Return half a unit in the last printed digit of a number.

    Examples
    --------
    >>> half_unit(6.153e3)
    0.5
    """
    # The tables print four digits.
    return 0.5 * 10.0 ** (Decimal(repr(value)).adjusted() - 3)


def check_tables() -> tuple[TableCheck, ...]:
    """Recompute what the tables print from their rows, and test each parameter for dependence on frequency."""
    checks = []
    for table in TABLES:
        for index, (term, symbol, unit) in enumerate(zip(TERMS, SYMBOLS, UNITS, strict=True)):
            rows = table.column(term)
            average, deviation = float(np.mean(rows)), float(np.std(rows))
            printed_average, printed_deviation = table.average[index], table.deviation[index]
            # Rounding the rows by half a unit each moves their mean, and their deviation, by as much at most.
            rounding = max(half_unit(value) for value in rows)
            test = frequency_test(term, FREQUENCIES, rows)
            checks.append(
                TableCheck(
                    table=table.number,
                    joint=table.joint,
                    term=term,
                    symbol=symbol,
                    unit=unit,
                    rows=rows,
                    average=average,
                    deviation=deviation,
                    sample_deviation=float(np.std(rows, ddof=1)),
                    printed_average=printed_average,
                    printed_deviation=printed_deviation,
                    average_follows=abs(average - printed_average) <= rounding + half_unit(printed_average),
                    deviation_follows=abs(deviation - printed_deviation)
                    <= rounding + half_unit(printed_deviation),
                    test=test,
                    detectable=detectable_change(test),
                )
            )
    return tuple(checks)


def table_findings(checks: Sequence[TableCheck]) -> tuple[str, ...]:
    """Report in sentences what the tables show and what they cannot."""
    sentences = []
    for check in checks:
        for what, printed, found, follows in (
            ("average", check.printed_average, check.average, check.average_follows),
            ("standard deviation", check.printed_deviation, check.deviation, check.deviation_follows),
        ):
            if not follows:
                sentences.append(
                    f"Table {check.table} prints {printed:.4g} as the {what} of {check.symbol}; its rows give "
                    f"{found:.4g}, and rounding does not explain the difference"
                )
    sentences.append(
        "the printed standard deviations divide by four (ddof = 0); as estimates of the scatter behind four values "
        f"they are {100 * np.sqrt(3 / 4):.0f} % of what dividing by three gives"
    )
    moved = [check for check in checks if check.test.answer == "depends on frequency"]
    same = [check for check in checks if check.test.answer == "independent within margin"]
    for check in moved:
        sentences.append(f"{check.joint}, {check.symbol}: {check.test.reason}")
    if moved:
        sentences.append(
            f"of {len(checks)} such tests at 5 %, {len(checks) * 0.05:.1f} find a trend by chance where there is none"
        )
    if same:
        names = ", ".join(f"{check.symbol} ({check.joint})" for check in same)
        sentences.append(
            f"a change over 3 to 6 Hz of more than {100 * same[0].test.margin:.0f} % is ruled out for {names} only"
        )
    least, most = min(c.detectable for c in checks), max(c.detectable for c in checks)
    sentences.append(
        "'no obvious trend' from four values is weak: a change over the band would have to be "
        f"{100 * least:.0f} % (at best) to {100 * most:.0f} % to be found in four of five such tables"
    )
    return tuple(sentences)
