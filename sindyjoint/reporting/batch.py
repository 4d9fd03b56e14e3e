"""A batch for people: its table as CSV and on a terminal, its page, its folder."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.files.atomic import output_folder
from sindyjoint.reporting.page import inline_svg, markup, render
from sindyjoint.reporting.provenance import provenance
from sindyjoint.reporting.style import figure_bytes, pretty_unit
from sindyjoint.reporting.tables import csv_text, superscripted
from sindyjoint.text import rounded, spelled
from sindyjoint.workflows.batch import CAMPAIGNS

if TYPE_CHECKING:
    from sindyjoint.batch.record import CampaignRecord
    from sindyjoint.batch.summary import Batch
    from sindyjoint.workflows.discover import Discovery

WIDTH = 100
DASH = "–"
KELVIN = 273.15
STATUS = {"found": "found", "none": "no model", "broken": "broken"}


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


def joint_rows(result: Batch) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return headings and rows of the table that people read."""
    units = [f"{spelled(term)} ({pretty_unit(result.units[term])})" for term in result.common]
    temperature = any(record.joint.get("temperature") for record in result.records)
    serial = any(record.joint.get("serial") for record in result.records)
    head = [
        "campaign",
        "joint",
        *(["serial"] if serial else []),
        *(["°C"] if temperature else []),
        "",
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
        for term in result.common:
            value, error = float(result.values[term][i]), float(result.errors[term][i])
            text = superscripted(rounded(value, error)) if np.isfinite(value) else DASH
            row.append(f"{text} !" if (i, term) in outlying else text)
        rows.append(tuple(row))
    return tuple(head), rows


def scatter_rows(result: Batch) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return headings and rows of the scatter of each common coefficient over the joints."""
    rows: list[tuple[str, ...]] = []
    for s in result.population.scatters:
        share = s.spread / abs(s.mean) if s.mean else float("nan")
        rows.append(
            (
                f"{spelled(s.coefficient)} ({pretty_unit(result.units[s.coefficient])})",
                superscripted(rounded(s.mean, s.mean_error))
                if np.isfinite(s.mean_error)
                else f"{s.mean:.4g}",
                f"{100 * share:.1f} %" if np.isfinite(share) else DASH,
                ", ".join(result.records[i].id for i in s.outliers) or "none",
            )
        )
    return ("term", "mean of the joints", "spread between joints", "stand out"), rows


def trend_rows(result: Batch) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return headings and rows of the trends, the surest first."""
    rows: list[tuple[str, ...]] = []
    for t in sorted(result.population.trends, key=lambda t: t.p_value):
        per = f"{pretty_unit(result.units[t.coefficient])} per {'K' if t.covariate == 'temperature' else 'step'}"
        rows.append(
            (
                f"{spelled(t.coefficient)} with {t.covariate}",
                f"{superscripted(rounded(t.slope, t.slope_error))} {per}",
                f"{100 * t.change:+.1f} %".replace("-", "−") if np.isfinite(t.change) else DASH,
                f"{t.p_value:.2g}",
                f"{t.p_adjusted:.2g}",
                "yes" if t.significant else "not seen",
            )
        )
    return ("trend", "slope", "over the range", "p", "p over all", "at 5 %"), rows


def show_batch(result: Batch) -> None:
    """Print the table, what stands out and the trends."""
    from rich import box
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

    console = Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    head, rows = joint_rows(result)
    for heading in head:
        table.add_column(heading, no_wrap=True, justify="left" if heading in head[:2] else "right")
    for row in rows:
        # Names are a person's own: Text keeps square brackets from being markup.
        table.add_row(*(Text(cell) for cell in row))
    needed = Measurement.get(console, console.options.update(max_width=10_000), table).maximum
    # A number that is cut off is a wrong number: the table is as wide as it is.
    Console(width=max(console.width, needed), highlight=False).print(table)
    print(f"\n{headline(result)}")
    for difference in result.differences:
        print(f"- {difference.id}: {difference.text}")
    for trend in result.population.trends:
        if trend.significant:
            print(
                f"- trend: {spelled(trend.coefficient)} changes by {100 * trend.change:+.1f} % over the range of the "
                f"{trend.covariate} (p = {trend.p_adjusted:.2g})"
            )
    for note in result.notes:
        print(f"- note: {note}")


def headline(result: Batch) -> str:
    """Return how many campaigns there are and how they ended."""
    parts = [f"{len(result.records)} campaigns: {result.count('found')} with a model"]
    parts += [f"{result.count('none')} without"] if result.count("none") else []
    parts += [f"{result.count('broken')} broken"] if result.count("broken") else []
    parts += [f"{result.kept} of them done before"] if result.kept else []
    return ", ".join(parts)


def write_batch(
    result: Batch,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
) -> Path:
    """Write batch.csv, batch.json, report.html and figures beside the campaigns' own folders, all of them or none.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    from sindyjoint.reporting.figures import draw, drawable
    from sindyjoint.reporting.saved import DATA_FILE, saved_text

    pictures = {kind: figure_bytes(draw(kind, result), "svg") for kind in drawable(result)}
    target = Path(folder)
    page = batch_page(result, target, pictures, command_line, seed)
    with output_folder(target) as stage:
        (stage / "figures").mkdir()
        for kind, svg in pictures.items():
            (stage / "figures" / f"{kind}.svg").write_bytes(svg)
        texts = {
            DATA_FILE: saved_text(result),
            "batch.csv": batch_csv(result),
            "batch.json": json.dumps(result.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n",
            "report.html": page,
        }
        for name, text in texts.items():
            (stage / name).write_text(text, encoding="utf-8", newline="\n")
    return target


def batch_page(
    result: Batch,
    folder: Path,
    pictures: dict[str, bytes],
    command_line: str | Sequence[str] | None,
    seed: object,
) -> str:
    """Return the page over all campaigns as one HTML text."""
    from sindyjoint.reporting.figures import kinds_of

    kinds = kinds_of(result)
    head, rows = joint_rows(result)
    links = [_link(record, folder) for record in result.records]
    significant = sum(t.significant for t in result.population.trends)
    return render(
        "batch.html.j2",
        title=headline(result),
        origin=provenance(None, seed, command_line),
        result=result,
        headline=headline(result),
        facts=[
            ("Campaigns", str(len(result.records)), f"{result.count('found')} with a model"),
            ("Stand out", str(len({d.id for d in result.differences})), "see the list below"),
            ("Trends", str(significant), f"of {len(result.population.trends)} looked for, at 5 % over all"),
        ],
        columns=head,
        rows=[(link, row) for link, row in zip(links, rows, strict=True)],
        scatter=scatter_rows(result),
        trends=trend_rows(result),
        kinds=kinds,
        pictures={kind: markup(inline_svg(svg, kind, kinds[kind].title)) for kind, svg in pictures.items()},
    )


def _link(record: CampaignRecord, folder: Path) -> str:
    """Return where a campaign's own page lies, from this one; nothing where there is none of this result."""
    from urllib.parse import quote

    place = f"{CAMPAIGNS}/{record.id}/report.html"
    return quote(place) if record.status != "broken" and (folder / place).is_file() else ""


@dataclass(frozen=True)
class CampaignFiles:
    """Writes more about each campaign of a batch into its folder; for ``batch(write=...)``.

    Parameters
    ----------
    reports : bool
        What ``sindyjoint discover --out`` writes.
    diagnose : bool
        What ``sindyjoint diagnose --out`` writes, in the folder ``diagnosis``.
    """

    reports: bool = True
    diagnose: bool = False

    @property
    def extras(self) -> tuple[str, ...]:
        """Names of what is written."""
        return ("reports",) * self.reports + ("diagnosis",) * self.diagnose

    def __call__(self, result: Discovery, folder: Path) -> None:
        """Write what is wanted about a result."""
        from sindyjoint.reporting.output import write_discovery

        if self.reports:
            write_discovery(result, folder)
        if self.diagnose and result.found:
            from sindyjoint.reporting.diagnosis import write_diagnosis
            from sindyjoint.workflows.diagnose import diagnose

            try:
                write_diagnosis(diagnose(result.campaign, result.model), folder / "diagnosis")
            except InputError as error:
                # The joint is discovered all the same.
                (folder / "diagnosis").mkdir(exist_ok=True)
                (folder / "diagnosis" / "impossible.txt").write_text(f"{error}\n", encoding="utf-8")
