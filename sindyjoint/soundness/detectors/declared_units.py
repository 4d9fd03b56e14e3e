"""Units that the files deny: what the manifest declares against what a header or a row of units states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from sindyjoint.files.units import unit_ratio
from sindyjoint.inputs import ColumnUnit
from sindyjoint.record import Campaign
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words


def find_unit_mismatches(campaign: Campaign, words: Words) -> Iterator[Finding]:
    """Yield the channels whose declared unit is not the one that their file states, or that of the other runs."""
    yield from _find_unequal(campaign, words)
    for run in campaign.runs:
        for unit in () if run.source is None else run.source.units:
            ratio = denial(unit)
            if ratio is None:
                continue
            factor = (
                "is no such quantity" if ratio == 0 else f"makes every value {1 / ratio:.4g} times what it is"
            )
            yield Finding(
                "unit_mismatch",
                run.name,
                unit.channel,
                "stops",
                f"column {unit.column!r} is declared in {unit.declared!r}, the file states {unit.stated!r}: "
                f"that {factor}",
                "c1 and the inertia are wrong by that factor and its square"
                if unit.channel == "time"
                else "k1, c1 and M_F are wrong by that factor"
                if unit.channel == "moment"
                else "k1 and c1 are wrong by that factor, k3 by its cube",
                f"declare unit = {unit.stated!r} for the {words.of(unit.channel)}, or correct the file",
            )


def _find_unequal(campaign: Campaign, words: Words) -> Iterator[Finding]:
    """Yield runs in which a column that no file gives a unit is declared in another than in most runs."""
    columns: dict[tuple[str, str], dict[str, str]] = {}
    for run in campaign.runs:
        for unit in run.file_units:
            if unit.column and not unit.stated:
                columns.setdefault((unit.channel, unit.column), {})[run.name] = unit.unit
    for (channel, column), declared in columns.items():
        usual, count = Counter(declared.values()).most_common(1)[0]
        for run_name, own in declared.items():
            ratio = unit_ratio(own, usual)
            if not ratio or abs(ratio - 1) < POLICY.same_unit:
                continue
            yield Finding(
                "unit_mismatch",
                run_name,
                channel,
                "biases",
                f"column {column!r} is declared in {own!r} here and in {usual!r} in {count} of {len(declared)} runs, "
                f"and no file states which: {ratio:.4g} between them",
                "the coefficients are those of two scales",
                f"declare one unit for the {words.of(channel)} of all runs",
            )


def denial(unit: ColumnUnit) -> float | None:
    """Return the stated unit in declared ones where they differ, zero for another quantity, or None."""
    ratio = unit_ratio(unit.stated, unit.declared)
    if ratio is None or abs(ratio - 1) < POLICY.same_unit:
        return None
    # The ending of a name may mean another thing ("force_in"): it denies only a unit of the same quantity.
    return None if ratio == 0 and unit.named else ratio
