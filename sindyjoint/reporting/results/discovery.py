"""A discovery: which terms the joint's equation has, on a terminal, as a page, as files."""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from sindyjoint.discovery.delay import ChannelDelay
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.over_inputs import OverInput
from sindyjoint.paper import DOI, TITLE
from sindyjoint.reporting.equation import model_table, terms_csv
from sindyjoint.reporting.mathml import mathml
from sindyjoint.reporting.page import Blocks, Page, markup, number, section, sentence
from sindyjoint.reporting.results.discovery_data import ReportData, gather
from sindyjoint.reporting.results.discovery_states import loops_payload, map_payload
from sindyjoint.reporting.results.discovery_terms import KINDS
from sindyjoint.reporting.style import prefixed, pretty_unit
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    escape,
    natural_width,
    short_number,
    tabulate,
    terminal_table,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.states import ForceStates
from sindyjoint.text import quantities, rounded, spelled

# Of a joint whose inertia is not declared, and is no term of the model.
NO_INERTIA = "its load is too small on these runs to be told from the other terms"


def key_facts(model: JointModel) -> list[tuple[str, str, str]]:
    """Return how well a model fits, its inertia, and what was tested: (label, value, explanation)."""
    fitted, q = model.fitted, quantities(model.joint.motion)
    factor, unit = _residual_scale(model)
    explained = 1 - (fitted.residual_rms / fitted.moment_rms) ** 2 if fitted.moment_rms > 0 else math.nan
    floor = (
        f"{fitted.noise_floor * factor:.3g} {unit}" if math.isfinite(fitted.noise_floor) else "not measured"
    )
    frequencies = ", ".join(f"{f:.4g}" for f in fitted.frequencies)
    if fitted.quasi_static:
        inertia = (f"{q.inertia}, damping, frequency", "not applicable", "the samples have no time")
    elif model.joint.inertia is None and INERTIA not in model:
        inertia = (q.inertia, "not found", NO_INERTIA)
    else:
        known = "declared" if model.joint.inertia is not None else "identified"
        known += ": negative, which is impossible" if model.inertia < 0 else ""
        known += ": the moment is that of the joint alone" if model.inertia == 0 else ""
        inertia = (q.inertia, f"{model.inertia:.4g} {pretty_unit(q.inertia_unit)}", known)
    return [
        (
            f"{q.moment} explained",
            f"{100 * explained:.2f} %" if model.terms else "none",
            "of the mean square, where it moves",
        ),
        ("Residual", f"{fitted.residual_rms * factor:.3g} {unit} RMS", f"noise floor {floor}"),
        inertia,
        (
            "Tested",
            f"{fitted.runs} run{'s' if fitted.runs != 1 else ''}",
            f"{frequencies} Hz" if frequencies else "without time" if fitted.quasi_static else "aperiodic",
        ),
        (
            "Moving samples",
            f"{fitted.samples:,}".replace(",", "\u202f"),
            f"{100 * fitted.moving_fraction:.0f} % of all; the others stick or reverse",
        ),
    ]


HEADLINES = {
    "confirmed": "The paper’s five terms describe this joint.",
    "refuted": "The paper’s five terms, as they stand, do not describe this joint.",
    "undecided": "These data do not decide whether the paper’s five terms describe this joint.",
}
NO_MODEL = "No set of terms passed: these data give no model of this joint."


def _tables(result: Discovery | ReportData) -> tuple[TextTable, ...]:
    """Return the terms, and the law over each input."""
    return (
        model_table(result.model),
        *map(over_table, result.over_inputs if isinstance(result, Discovery) else result.over),
    )


def _page(result: Discovery | ReportData, data: ReportData, show: Blocks) -> Page:
    """Return the equation, its terms, the map, loops, residual, why these terms, and the runs."""
    model, q = data.model, quantities(data.model.joint.motion)
    found, name = bool(model.terms), model.joint.name
    none = show.verdict(NO_MODEL, "undecided", "no model")
    source = markup(" The five terms are those of <cite>{}</cite>, doi:{}.").format(TITLE, DOI)
    paper = (
        show.verdict(HEADLINES[data.verdict], data.verdict, data.verdict) if found else none,
        show.paragraph(markup("{}").format(sentence(data.verdict_reason)) + source, "reason"),
    )
    texts = show.copyable(model.equation()), show.copyable(model.latex())
    terms, *over = _tables(data)
    reasons = [
        f"{row.symbol}: {row.answer} ({row.reason})"
        for each in data.over
        for row in each.coefficients
        if row.answer
    ]
    candidates = ", ".join(spelled(each, model.joint.motion) for each in data.candidates)
    cells = "virtual test cells" if model.fitted.simulated else "measured cells"
    return Page(
        f"{name}: terms of the joint",
        "Joint identification",
        name,
        show.pictures("fit"),
        (show.equation(markup(mathml(model))) if found or data.paper else none,),
        (show.facts(key_facts(data.model)),),
        (
            section(
                "terms",
                "Terms",
                "Terms",
                show.table(terms) if found else show.paragraph(f"None: {data.selection_reason}."),
                show.folded("The equation as text and LaTeX", texts) if found else "",
                show.warnings(data.warnings),
            ),
            section(
                "inputs",
                "Over the inputs",
                "",
                show.tables(*over),
                show.folded("What the levels say of each coefficient", [show.items(reasons)])
                if reasons
                else "",
                show.pictures("inputs"),
            ),
            section("map", "Force–state map", "Map", show.turning_map(cells, found), show.pictures("map")),
            section(
                "loops",
                "Loops, with the model over them",
                "Loops",
                show.curves(f"{q.moment}–{q.angle.lower()} loops", found),
                show.pictures("loops"),
            ),
            section("residual", "Residual", "Residual", show.pictures("residual")),
            section(
                "choice",
                "Why these terms",
                "Choice",
                show.paragraph(sentence(data.selection_reason)),
                show.pictures("path", "coefficients", "covariance"),
                show.folded("Every model of the path", [show.table(path_table(data))]) if data.path else "",
                show.folded(f"All {len(data.candidates)} candidates", [show.paragraph(f"{candidates}.")]),
            ),
            section("runs", "Runs", "Runs", show.table(runs_table(data))),
        ),
        {"map": map_payload(data), "loops": loops_payload(data)},
        paper if data.paper else (),
    )


def _about(result: Discovery) -> str:
    """Return the joint and its runs, and the question of the paper's terms where that leads."""
    fitted, verdict = result.model.fitted, result.verdict
    frequencies = ", ".join(dict.fromkeys(f"{frequency:.4g}" for frequency in fitted.frequencies))
    paper = f"\n\n[bold]paper's term set {verdict.verdict}[/]: {escape(verdict.reason)}"
    name = escape(result.model.joint.name + " (simulated)" * fitted.simulated)
    return (
        f"[bold]{name}[/]: {fitted.runs} run(s){f' at {frequencies} Hz' * bool(frequencies)}, {fitted.samples} moving "
        f"samples, {100 * fitted.moving_fraction:.0f} % of all{paper * result.leads_with_paper}"
    )


def _printed(result: Discovery, console: Console) -> list[Any]:
    """Return equation, terms and fit."""
    model, (terms, *over) = result.model, _tables(result)
    what = quantities(model.joint.motion).moment.lower()
    law = [
        f"  {escape(model.equation())}\n",
        _fitting(terms.headed(ruled=True), console),
        f"\nshare: unique share of the RMS {what}, which no other term can take over",
        *(part for each in over for part in (f"\n[bold]{escape(each.title)}[/]", each)),
    ]
    return [
        *(law if result.found else [f"  no model: {escape(result.reason)}"]),
        # What was tested stands in the first line.
        *(
            escape(f"{label[:1].lower()}{label[1:]} {value}, {note}")
            for label, value, note in key_facts(model)[:-2]
        ),
        *([] if result.skew is None else [_delay_words(result.skew, model.joint.motion)]),
        *["\n[bold]What to know before using it[/]"] * bool(result.warnings),
    ]


def _details(result: Discovery) -> Iterator[str]:
    """Yield states, the path round the choice, and what each term carries."""
    fitted = result.model.fitted
    load = quantities(result.model.joint.motion).moment.lower()
    yield from state_lines(result.states, result.model.joint.motion)
    path, chosen = result.selection.path, result.selection.chosen
    yield f"{len(result.regressor.terms_)} candidates; {len(path)} models on the path"
    near = range(len(path)) if chosen is None else range(chosen - 3, chosen + 4)
    yield from aligned(
        tabulate(
            "path",
            "",
            [i for i in near if 0 <= i < len(path)],
            {
                "": lambda i: "chosen" if i == chosen else "",
                "terms": lambda i: str(path[i].size),
                "residual": lambda i: f"{path[i].fit.residual_rms:.4g}",
                "held out": lambda i: short_number(path[i].held_out_rms),
                "threshold": lambda i: f"{path[i].threshold:.2e}",
                "least |t| over groups": lambda i: short_number(
                    np.min(path[i].group_t_ratios, initial=np.inf)
                ),
            },
        )
    )
    yield (
        f"{load} {fitted.moment_rms:.4g} RMS, residual {fitted.residual_rms:.4g}, of which the data cannot repeat "
        + (f"{fitted.noise_floor:.4g}" if math.isfinite(fitted.noise_floor) else "an unknown part")
    )
    yield from aligned(
        tabulate(
            "shares",
            "",
            [(term, abs(term.coefficient) or 1.0) for term in result.model.terms],
            {
                "term": lambda one: one[0].id,
                "unique share": lambda one: f"{100 * one[0].unique_share:.2f} %",
                "relative error": lambda one: f"{100 * (one[0].standard_error / one[1]):.3f} %",
            },
        )
    )


def over_table(over: OverInput) -> TextTable:
    """Return the law at three values of an input, and whether each coefficient depends on it."""

    def at(place: int) -> Callable[[Any], str]:
        return lambda row: rounded(row.values[place], row.errors[place])

    return tabulate(
        f"over_{over.name}",
        f"The law over {over.label}: coefficients at the least, the reference and the largest value, with one standard "
        "error; with levels apart: what fits to the runs of each level say.",
        over.coefficients,
        {
            "": lambda row: row.symbol,
            "unit": lambda row: pretty_unit(row.unit),
            **{pretty_unit(heading): at(place) for place, heading in enumerate(over.headings)},
            "with levels apart": lambda row: over.dependence(row) or DASH,
        },
        text=("unit",),
    )


def runs_table(data: ReportData) -> TextTable:
    """Return one row for each run."""
    factor, unit = _residual_scale(data.model)
    return tabulate(
        "runs",
        "Residual of moving samples and noise of single samples.",
        data.loops,
        {
            "Run": lambda loop: loop.run,
            "Frequency (Hz)": lambda loop: number(loop.frequency, 4),
            "Level": lambda loop: loop.level or "",
            "States": lambda loop: loop.method,
            "Samples": lambda loop: str(loop.samples),
            "Moving": lambda loop: f"{100 * loop.moving_fraction:.0f} %",
            f"Noise ({unit})": lambda loop: number(loop.moment_noise * factor),
            f"Residual ({unit})": lambda loop: number(loop.residual_rms * factor),
        },
        text=("Run", "Level"),
    )


def path_table(data: ReportData) -> TextTable:
    """Return the models of the path, the chosen one marked, with what each has beyond the next smaller one."""
    factor, unit = _residual_scale(data.model)
    terms = [*(step.terms for step in data.path), ()]

    def beyond(i: int, j: int) -> str:
        return ", ".join(spelled(term, data.model.joint.motion) for term in terms[i] if term not in terms[j])

    return tabulate(
        "path",
        "From the largest model to the smallest. Adds: what it has beyond the next smaller one.",
        range(len(data.path)),
        {
            "Terms": lambda i: f"{len(terms[i])}{' (chosen)' if i == data.chosen else ''}",
            "Adds": lambda i: beyond(i, i + 1),
            "Instead of": lambda i: beyond(i + 1, i),
            f"Residual ({unit})": lambda i: number(data.path[i].residual_rms * factor, 4),
            f"Held out ({unit})": lambda i: number(data.path[i].held_out_rms * factor, 4),
            "Weakest share": lambda i: number(data.path[i].threshold, 2),
            "Least t": lambda i: number(data.path[i].least_t, 3),
        },
        marked=data.chosen,
    )


def _residual_scale(model: JointModel) -> tuple[float, str]:
    return prefixed(model.fitted.residual_rms, quantities(model.joint.motion).moment_unit)


def _fitting(terms: TextTable, console: Console) -> TextTable:
    """Return the terms for a terminal; on a narrow screen without the interval: the uncertainty says as much."""
    heads = ("term", "", "coefficient", "unit", "95 % interval", "share")
    whole = terms.take("term", "symbol", "value", "unit", "95 % interval", "unique share").headed(*heads)
    fits = not sys.stdout.isatty() or natural_width(terminal_table(whole), console) <= console.width
    return whole if fits else whole.take(*heads[:4], heads[5])


def _delay_words(delay: ChannelDelay, motion: str) -> str:
    """Return by how much one channel lags the other, or that this is not determined."""
    load, path = (name.lower() for name in (quantities(motion).moment, quantities(motion).angle))
    if delay.at_limit:
        return f"the delay between {load} and {path} is not determined within {1e3 * abs(delay.time):.0f} ms"
    if not delay.significant:
        size = rounded(1e3 * delay.time, 1e3 * delay.standard_error)
        return f"no delay seen between {load} and {path}: {size} ms"
    size = rounded(1e3 * abs(delay.time), 1e3 * delay.standard_error)
    return f"the {load} {'lags' if delay.time >= 0 else 'leads'} the {path} by {size} ms"


def state_lines(states: Sequence[ForceStates], motion: str = "rotation") -> Iterator[str]:
    """Yield a line per run: its samples, how its rate was made, how much of it moves, and its noise."""
    q = quantities(motion)
    load = pretty_unit(q.moment_unit)
    return aligned(
        tabulate(
            "states",
            "",
            states,
            {
                "run": lambda state: state.run,
                "samples": lambda state: str(state.n_samples),
                "rate": lambda state: f"{state.sample_rate:.4g} Hz",
                "states": lambda state: f"{state.method}, completed" if state.completed else state.method,
                "band": lambda state: f"{state.bandwidth:.3g} Hz",
                "moving": lambda state: f"{100 * state.moving.mean():.1f} %",
                "noise of the motion": lambda state: f"{state.noise.angle:.2e} {q.angle_unit}",
                f"noise of the {q.moment.lower()}": lambda state: (
                    f"{state.noise.moment:.2e} {load}" if state.noise.measured else "unknown"
                ),
            },
        )
    )


#: Its data are gathered into small arrays, and its page is made of only these.
DISCOVERY = View(
    about=_about,
    data=ReportData,
    rows="terms",
    kind="ReportData",
    marks={"schema": 1},
    folder="discovery",
    kinds=KINDS,
    judged_by=lambda result: FINDING,
    drawn_from=gather,
    simulated=lambda result: result.model.fitted.simulated,
    seed=lambda result, given: result.regressor.random_state,
    headline=lambda result: result.trust,
    tables=_tables,
    page=_page,
    files=lambda result, data: {
        "model.json": result.model.to_json() + "\n",
        "terms.csv": terms_csv(result.model),
    },
    printed=_printed,
    details=_details,
)
