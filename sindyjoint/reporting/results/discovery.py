"""A discovery: which terms the joint's equation has, on a terminal, as a page, as files."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.equation.model import INERTIA
from sindyjoint.errors import InputError
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.over_inputs import OverInput
from sindyjoint.paper import DOI, TITLE
from sindyjoint.reporting.data import ReportData, gather
from sindyjoint.reporting.equation import mathml, symbol_html
from sindyjoint.reporting.figures.discovery import KINDS
from sindyjoint.reporting.interactive import loops_payload, map_payload
from sindyjoint.reporting.page import markup
from sindyjoint.reporting.provenance import Provenance, provenance
from sindyjoint.reporting.results.discovery_page import NO_INERTIA, key_facts, run_rows, step_rows
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.tables import share_text, term_rows, terms_csv
from sindyjoint.reporting.text_table import (
    TextTable,
    aligned,
    natural_width,
    print_whole,
    short_number,
    terminal,
    terminal_table,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.text import quantities, rounded
from sindyjoint.trust import Trust

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from sindyjoint.states import ForceStates

HEADLINES = {
    "confirmed": "The paper’s five terms describe this joint.",
    "refuted": "The paper’s five terms, as they stand, do not describe this joint.",
    "undecided": "These data do not decide whether the paper’s five terms describe this joint.",
}
NO_MODEL = "No set of terms passed: these data give no model of this joint."
WITHOUT_TIME = "not applicable, the samples have no time"
# Steps of a path shown on either side of the chosen one.
NEIGHBOURS = 3


class DiscoveryView(View[Discovery, ReportData]):
    """A discovery; its data are gathered into small arrays, and its page is made of only these."""

    results = (Discovery, ReportData)
    data = ReportData
    records_key = "terms"
    kind = "ReportData"
    folder = "discovery"
    kinds = KINDS
    template = "discovery.html.j2"
    judged_by = FINDING

    def gather(self, result: Discovery | ReportData) -> ReportData:
        """Return what is saved, so that a figure drawn again later is the same to the last byte."""
        return result if isinstance(result, ReportData) else self.restore(self.save(gather(result)))

    def save(self, data: ReportData) -> dict[str, Any]:
        """Return the data with the version of their layout."""
        return {"schema": 1, **super().save(data)}

    def restore(self, record: Mapping[str, Any]) -> ReportData:
        """Return data of matching shapes."""
        read: ReportData = super().restore(record)
        cells = (read.surface.n, read.surface.n)
        shapes = [read.surface.moment.shape, read.surface.count.shape, read.residual_map.moment.shape]
        if not read.loops or any(shape != cells for shape in shapes) or read.upper.shape != read.lower.shape:
            raise InputError("not a saved ReportData: expected loops and a square map")
        return read

    def tables(self, result: Discovery | ReportData) -> tuple[TextTable, ...]:
        """Return the terms."""
        rows = tuple(
            (row.name, row.symbol, row.value, row.unit, row.interval, share_text(row.share))
            for row in term_rows(result.model)
        )
        columns = ("term", "", "coefficient", "unit", "95 % interval", "share")
        over = result.over_inputs if isinstance(result, Discovery) else result.over
        return (TextTable("terms", "Terms", columns, rows), *(over_table(each) for each in over))

    def content(
        self, result: Discovery | ReportData, data: ReportData, folder: Path | None
    ) -> dict[str, Any]:
        """Return what the page shows."""
        return {
            "title": f"{data.model.joint.name}: terms of the joint",
            "headline": HEADLINES[data.verdict] if data.model.terms else NO_MODEL,
            "paper_title": TITLE,
            "paper_doi": DOI,
            "facts": key_facts(data),
            "equation": markup(mathml(data.model)),
            "equation_text": data.model.equation(),
            "equation_latex": data.model.latex(),
            "terms": term_rows(data.model),
            "over": [over_table(each) for each in data.over],
            "over_reasons": [
                f"{row.symbol}: {row.answer} ({row.reason})"
                for each in data.over
                for row in each.coefficients
                if row.answer
            ],
            "symbols": [markup(symbol_html(term.symbol)) for term in data.model.terms],
            "runs": run_rows(data),
            "steps": step_rows(data),
            "motion": data.model.joint.motion,
            "quantities": quantities(data.model.joint.motion),
            "payload": {"map": map_payload(data), "loops": loops_payload(data)},
        }

    def origin(self, result: Discovery, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return the origin of the campaign's runs, too."""
        return provenance(result.campaign, result.regressor.random_state, command_line, files)

    def files(self, result: Discovery, data: ReportData) -> dict[str, str]:
        """Return the model and its terms."""
        return {"model.json": result.model.to_json() + "\n", "terms.csv": terms_csv(result.model)}

    def headline(self, result: Discovery | ReportData) -> Trust:
        """Return that of the discovery."""
        return result.trust

    def about(self, result: Discovery) -> str:
        """Return the joint and its runs, and the question of the paper's terms where that leads."""
        from rich.markup import escape

        model, fitted = result.model, result.model.fitted
        simulated = " (simulated)" if fitted.simulated else ""
        at = f" at {', '.join(f'{f:g}' for f in fitted.frequencies)} Hz" if fitted.frequencies else ""
        title = f"[bold]{escape(model.joint.name + simulated)}[/]"
        line = f"{title}: {fitted.runs} run(s){at}, {fitted.samples} moving samples"
        return f"{line}\n{_paper_lines(result)}" if result.leads_with_paper else line

    def show(self, result: Discovery) -> None:
        """Print the question of the paper's terms in the end where it does not lead."""
        super().show(result)
        if not result.leads_with_paper:
            terminal().print(_paper_lines(result))

    def show_result(self, result: Discovery, console: Console) -> None:
        """Print equation, terms, fit and warnings."""
        from rich.markup import escape

        model = result.model
        if not result.found:
            console.print(f"  no model: {escape(result.reason)}")
        else:
            console.print(f"  {escape(model.equation())}\n")
            print_whole(_terms(self.tables(result)[0], console), console)
            what = quantities(model.joint.motion).moment.lower()
            console.print(f"\nshare: unique share of the RMS {what}, which no other term can take over")
            for each in self.tables(result)[1:]:
                console.print(f"\n[bold]{escape(each.title)}[/]")
                print_whole(
                    terminal_table(each.columns, each.rows, "ll" + "r" * (len(each.columns) - 3) + "l"),
                    console,
                )
        _show_fit(result, console)
        if result.warnings:
            console.print("\n[bold]What to know before using it[/]")
        for warning in result.warnings:
            console.print(f"- {escape(warning)}")

    def details(self, result: Discovery) -> Iterator[str]:
        """Yield states, the path round the choice, and what each term carries."""
        model = result.model
        load = quantities(model.joint.motion).moment.lower()
        yield from state_lines(result.states, model.joint.motion)
        if result.skew is not None and not result.skew.at_limit:
            late, error = 1e3 * result.skew.time, 1e3 * result.skew.standard_error
            yield f"the {load} {'lags' if late >= 0 else 'leads'} by {abs(late):.4f} ms ± {error:.4f} ms"
        path, chosen = result.selection.path, result.selection.chosen
        yield f"{len(result.regressor.terms_)} candidates; {len(path)} models on the path"
        first, last = (
            (0, len(path)) if chosen is None else (max(0, chosen - NEIGHBOURS), chosen + NEIGHBOURS + 1)
        )
        rows = [("", "terms", "residual", "held out", "threshold", "least |t| over groups")]
        for index, step in enumerate(path[first:last], first):
            least = float(np.min(step.group_t_ratios)) if step.group_t_ratios.size else float("inf")
            rows.append(
                (
                    "chosen" if index == chosen else "",
                    str(step.size),
                    f"{step.fit.residual_rms:.4g}",
                    short_number(step.held_out_rms),
                    f"{step.threshold:.2e}",
                    short_number(least),
                )
            )
        yield from aligned(rows)
        fitted = model.fitted
        yield (
            f"{load} {fitted.moment_rms:.4g} RMS, residual {fitted.residual_rms:.4g}, of which the data cannot repeat "
            + (f"{fitted.noise_floor:.4g}" if math.isfinite(fitted.noise_floor) else "an unknown part")
        )
        yield from _shares(result)


def over_table(over: OverInput) -> TextTable:
    """Return the law at three values of an input, and whether each coefficient depends on it."""
    rows = tuple(
        (
            row.symbol,
            pretty_unit(row.unit),
            *(rounded(value, error) for value, error in zip(row.values, row.errors, strict=True)),
            over.dependence(row) or "–",
        )
        for row in over.coefficients
    )
    columns = ("", "unit", *map(pretty_unit, over.headings), "with levels apart")
    return TextTable(f"over_{over.name}", f"The law over {over.label}", columns, rows, text=("unit",))


def _paper_lines(result: Discovery) -> str:
    """Return whether the joint has the paper's five terms, with markup."""
    from rich.markup import escape

    line = f"\n[bold]paper's term set {result.verdict.verdict}[/]: {escape(result.verdict.reason)}"
    if result.leads_with_paper:
        return line
    return f"{line}\n  the five terms of {TITLE}, doi:{DOI}; --paper puts this first"


def _terms(table: TextTable, console: Console) -> Table:
    """Return the terms for a terminal; on a narrow screen without the interval: the uncertainty says as much."""
    whole = terminal_table(table.columns, table.rows, "llrlrr", ruled=True)
    if not sys.stdout.isatty() or natural_width(whole, console) <= console.width:
        return whole
    columns, *rows = ((*row[:4], *row[5:]) for row in (table.columns, *table.rows))
    return terminal_table(columns, rows, "llrlr", ruled=True)


def _show_fit(result: Discovery, console: Console) -> None:
    """Print the inertia, how well the model fits, and the delay between the channels."""
    model, fitted = result.model, result.model.fitted
    q = quantities(model.joint.motion)
    what, unit = q.moment.lower(), pretty_unit(q.moment_unit)
    if fitted.quasi_static:
        console.print(f"{q.inertia.lower()}, viscous damping, dependence on frequency: {WITHOUT_TIME}")
    elif model.joint.inertia is not None:
        console.print(f"{q.inertia.lower()} {model.joint.inertia:g} {pretty_unit(q.inertia_unit)}, declared")
    elif model.terms and INERTIA not in model:
        console.print(f"{q.inertia.lower()}: not declared; looked for and not found: {NO_INERTIA}")
    floor = f"{fitted.noise_floor:.3g} {unit}" if math.isfinite(fitted.noise_floor) else "unknown"
    console.print(
        f"{what} {fitted.moment_rms:.4g} {unit} RMS, residual {fitted.residual_rms:.3g} "
        f"({100 * (fitted.residual_rms / fitted.moment_rms if fitted.moment_rms else 0):.2f} %), "
        f"noise floor {floor}, moving {100 * fitted.moving_fraction:.0f} % of the time"
    )
    delay = result.skew
    if delay is not None:
        other = q.angle.lower()
        size = rounded(1e3 * abs(delay.time), 1e3 * delay.standard_error)
        console.print(
            f"the delay between {what} and {other} is not determined within {1e3 * abs(delay.time):.0f} ms"
            if delay.at_limit
            else f"the {what} {'lags' if delay.time >= 0 else 'leads'} the {other} by {size} ms"
        )


def state_lines(states: Sequence[ForceStates], motion: str = "rotation") -> Iterator[str]:
    """Yield a line per run: its samples, how its rate was made, how much of it moves, and its noise."""
    q = quantities(motion)
    angle, moment = q.angle_unit, pretty_unit(q.moment_unit)
    yield from aligned(
        [
            (
                "run",
                "samples",
                "rate",
                "states",
                "band",
                "moving",
                "noise of the motion",
                f"noise of the {q.moment.lower()}",
            ),
            *(
                (
                    state.run,
                    str(state.n_samples),
                    f"{state.sample_rate:.4g} Hz",
                    state.method,
                    f"{state.bandwidth:.3g} Hz",
                    f"{100 * state.moving.mean():.1f} %",
                    f"{state.noise.angle:.2e} {angle}",
                    f"{state.noise.moment:.2e} {moment}" if state.noise.measured else "unknown",
                )
                for state in states
            ),
        ]
    )


def _shares(result: Discovery) -> Iterator[str]:
    bias = {} if result.bias is None else dict(zip(result.bias.ids, result.bias.pooled, strict=True))
    rows = [("term", "unique share", "relative error", "bias taken out")]
    for term in result.model.terms:
        size = abs(term.coefficient) or 1.0
        out = f"{100 * (bias[term.id] / size):+.3f} %" if term.id in bias else "–"
        rows.append(
            (term.id, f"{100 * term.unique_share:.2f} %", f"{100 * (term.standard_error / size):.3f} %", out)
        )
    yield from aligned(rows)
