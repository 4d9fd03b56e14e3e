"""A batch: all joints in one table, what stands out and the trends, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.batch.record import CAMPAIGNS
from sindyjoint.batch.summary import Batch
from sindyjoint.reporting.figures.batch import DIAMONDS, KELVIN, KINDS
from sindyjoint.reporting.provenance import Provenance, provenance
from sindyjoint.reporting.style import pretty_unit, shortened
from sindyjoint.reporting.tables import superscripted
from sindyjoint.reporting.text_table import (
    DASH,
    TextTable,
    aligned,
    csv_text,
    fitting_blocks,
    print_whole,
    terminal,
    terminal_table,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.text import percent, rounded, spelled

if TYPE_CHECKING:
    from sindyjoint.batch.record import CampaignRecord
    from sindyjoint.reporting.figures.kind import Kind

# Characters of a name on a terminal.
NAME = 24
STATUS = {"found": "found", "none": "no model", "broken": "broken"}


class BatchView(View[Batch, Batch]):
    """A batch."""

    results = (Batch,)
    data = Batch
    records_key = "campaigns"
    kind = "Batch"
    folder = "batch"
    kinds = KINDS
    template = "batch.html.j2"
    record_file = "batch.json"
    judged_by = (*FINDING, "batch")

    def kinds_of(self, data: Batch) -> Mapping[str, Kind]:
        """Return the figures; of signs that no joint has, the caption says nothing."""
        kinds = dict(self.kinds)
        if not any(scatter.outliers for scatter in data.population.scatters):
            kinds["joints"] = replace(kinds["joints"], caption=kinds["joints"].caption.removesuffix(DIAMONDS))
        return kinds

    def kept(self, data: Batch) -> Batch:
        """Return it without the result of each campaign, which lies in the folder of the campaign."""
        return replace(
            data, records=tuple(replace(record, result=None, earlier=None) for record in data.records)
        )

    def simulated(self, result: Batch) -> bool:
        """Return whether all campaigns that were worked on are virtual tests."""
        texts = [" ".join((record.result or {}).get("warnings", ())) for record in result.records]
        return bool(texts) and all("simulated" in text and "not measured" in text for text in texts)

    def tables(self, result: Batch) -> tuple[TextTable, ...]:
        """Return all joints, their scatter and the trends."""
        return _joints(result), _scatter(result), _trends(result)

    def content(self, result: Batch, data: Batch, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows; rows are linked to the pages of the campaigns."""
        joints = _joints(result)
        significant = sum(t.significant for t in result.population.trends)
        return {
            "title": headline(result),
            "headline": headline(result),
            "facts": [
                ("Campaigns", str(len(result.records)), f"{result.found} with a model"),
                ("Stand out", str(len({d.id for d in result.differences})), "see the list below"),
                (
                    "Trends",
                    str(significant),
                    f"of {len(result.population.trends)} looked for, at 5 % over all",
                ),
            ],
            "columns": list(zip(joints.columns, joints.is_text, strict=True)),
            "marked": any(scatter.outliers for scatter in result.population.scatters),
            "rows": [
                (_link(record, folder), row) for record, row in zip(result.records, joints.rows, strict=True)
            ],
        }

    def origin(self, result: Batch, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return the manifests that were read."""
        manifests = [Path(record.manifest) for record in result.records]
        return provenance(None, seed, command_line, [*files, *filter(Path.is_file, manifests)])

    def files(self, result: Batch, data: Batch) -> dict[str, str]:
        """Return one line per campaign."""
        return {"batch.csv": batch_csv(result)}

    def show(self, result: Batch) -> None:
        """Print the table, what stands out and the trends."""
        joints, console = _joints(result), terminal()
        shown = [tuple(shortened(cell, NAME) for cell in row) for row in joints.rows]
        for columns, rows in fitting_blocks(joints.columns, shown, console.width):
            align = "".join("l" if column in ("campaign", "joint") else "r" for column in columns)
            print_whole(terminal_table(columns, rows, align, ruled=True), console)
            print()
        virtual = ", all of them simulated" if self.simulated(result) else ""
        print(f"{headline(result)}{virtual}")
        for difference in result.differences:
            print(f"- {difference.id}: {difference.text}")
        for trend in result.population.trends:
            if trend.significant:
                name = spelled(trend.coefficient, result.motion)
                print(
                    f"- trend: {name} changes by {100 * trend.change:+.1f} % over the range "
                    f"of the {trend.covariate} (p = {trend.p_adjusted:.2g})"
                )
        for note in result.notes:
            print(f"- note: {note}")

    def details(self, result: Batch) -> Iterator[str]:
        """Yield how each campaign ended."""
        rows = [("campaign", "status", "terms", "reason")]
        for record in result.records:
            terms = " ".join(term["id"] for term in (record.result or {}).get("terms", ()))
            rows.append((record.id, record.status, terms, record.reason))
        yield from aligned(rows)


def batch_csv(result: Batch) -> str:
    """Return one line per campaign as CSV: numbers in full, SI."""
    labels = list(dict.fromkeys(key for r in result.records for key in r.joint.get("labels", {})))
    numbers = [name for term in result.common for name in (term, f"{term}_standard_error", f"{term}_score")]
    head = ["campaign", "manifest", "status", "joint", "motion", "serial", "temperature_K", *labels]
    head += [
        "terms",
        "paper_term_set",
        "moment_rms",
        "residual_rms",
        "noise_floor",
        *numbers,
        "stands_out",
        "reason",
    ]
    scores = {s.coefficient: s.scores for s in result.population.scatters}
    reasons: dict[str, list[str]] = {}
    for difference in result.differences:
        reasons.setdefault(difference.id, []).append(difference.text)
    rows = []
    for i, record in enumerate(result.records):
        joint, found = record.joint, record.result or {}
        fit = found.get("fit", {})
        row = [record.id, record.manifest, record.status]
        row += [_cell(joint.get(key)) for key in ("name", "motion", "serial", "temperature")]
        row += [_cell(joint.get("labels", {}).get(label)) for label in labels]
        row += [" ".join(record.terms), found.get("paper_term_set", {}).get("verdict", "")]
        row += [_cell(fit.get(key)) for key in ("moment_rms", "residual_rms", "noise_floor")]
        for term in result.common:
            row += [_cell(float(x[i])) for x in (result.values[term], result.errors[term], scores[term])]
        rows.append([*row, "; ".join(reasons.get(record.id, [])), record.reason])
    return csv_text(head, rows)


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return repr(value) if isinstance(value, float) else str(value)


def _joints(result: Batch) -> TextTable:
    """Return the table that people read."""
    units = [f"{spelled(term, result.motion)} ({pretty_unit(result.units[term])})" for term in result.common]
    temperature = any(record.joint.get("temperature") for record in result.records)
    serial = any(record.joint.get("serial") for record in result.records)
    head = [
        "campaign",
        "joint",
        *(["serial"] if serial else []),
        *(["°C"] if temperature else []),
        "",
        "residual",
        "floor",
        *units,
    ]
    outlying = {(i, s.coefficient) for s in result.population.scatters for i in s.outliers}
    rows = []
    for i, record in enumerate(result.records):
        row = [record.id, record.joint.get("name", DASH)]
        row += [record.joint.get("serial") or DASH] if serial else []
        if temperature:
            kelvin = record.joint.get("temperature")
            row.append(f"{kelvin - KELVIN:.4g}".replace("-", "−") if kelvin else DASH)
        row.append(STATUS[record.status])
        row += _shares_of_fit(record)
        for term in result.common:
            value, error = float(result.values[term][i]), float(result.errors[term][i])
            text = superscripted(rounded(value, error)) if np.isfinite(value) else DASH
            row.append(f"{text} !" if (i, term) in outlying else text)
        rows.append(tuple(row))
    return TextTable("joints", "All joints", tuple(head), tuple(rows))


def _shares_of_fit(record: CampaignRecord) -> tuple[str, str]:
    """Return residual and noise floor of a campaign's model, of the RMS that was explained."""
    fit = (record.result or {}).get("fit", {})
    whole = fit.get("moment_rms")
    if not whole:
        return DASH, DASH
    residual, floor = (fit.get(name) for name in ("residual_rms", "noise_floor"))
    shares = [DASH if value is None else percent(value / whole) for value in (residual, floor)]
    return shares[0], "unknown" if floor is None and residual is not None else shares[1]


def _scatter(result: Batch) -> TextTable:
    """Return the scatter of each common coefficient over the joints."""
    rows: list[tuple[str, ...]] = []
    for s in result.population.scatters:
        share = s.spread / abs(s.mean) if s.mean else float("nan")
        rows.append(
            (
                f"{spelled(s.coefficient, result.motion)} ({pretty_unit(result.units[s.coefficient])})",
                superscripted(rounded(s.mean, s.mean_error))
                if np.isfinite(s.mean_error)
                else f"{s.mean:.4g}",
                f"{100 * share:.1f} %" if np.isfinite(share) else DASH,
                DASH if s.next_joint95 is None else "{:.4g} … {:.4g}".format(*s.next_joint95),
                ", ".join(result.records[i].id for i in s.outliers) or "none",
            )
        )
    columns = ("term", "mean of the joints", "spread between joints", "next joint, 95 %", "stand out")
    caption = (
        "Between joints, beyond the errors of the single estimates; next joint: where the coefficient of one that was "
        "not tested lies in 95 of 100 cases."
    )
    return TextTable("scatter", caption, columns, tuple(rows))


def _trends(result: Batch) -> TextTable:
    """Return the trends, the surest first."""
    rows: list[tuple[str, ...]] = []
    for t in sorted(result.population.trends, key=lambda t: t.p_value):
        step = pretty_unit(result.covariate_units.get(t.covariate, "step"))
        per = f"{pretty_unit(result.units[t.coefficient])} per {step}"
        rows.append(
            (
                f"{spelled(t.coefficient, result.motion)} with {t.covariate}",
                f"{superscripted(rounded(t.slope, t.slope_error))} {per}",
                f"{100 * t.change:+.1f} %".replace("-", "−") if np.isfinite(t.change) else DASH,
                f"{t.p_value:.2g}",
                f"{t.p_adjusted:.2g}",
                "yes" if t.significant else "not seen",
            )
        )
    columns = ("trend", "slope", "over the range", "p", "p over all", "at 5 %")
    caption = "Robust weighted lines; p over all corrects for the number of trends looked for."
    return TextTable("trends", caption, columns, tuple(rows))


def headline(result: Batch) -> str:
    """Return how many campaigns there are and how they ended."""
    parts = [f"{len(result.records)} campaigns: {result.found} with a model"]
    parts += [f"{result.none} without"] if result.none else []
    parts += [f"{result.broken} broken"] if result.broken else []
    parts += [f"{result.kept} of them done before"] if result.kept else []
    return ", ".join(parts)


def _link(record: CampaignRecord, folder: Path | None) -> str:
    """Return where the page of a campaign lies, from this one; nothing where there is none of this result."""
    from urllib.parse import quote

    page = f"{CAMPAIGNS}/{record.id}/report.html"
    there = folder is not None and record.status != "broken" and (folder / page).is_file()
    return quote(page) if there else ""
