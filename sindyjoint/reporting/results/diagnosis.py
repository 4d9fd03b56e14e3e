"""A diagnosis, of a campaign or of a structure: what is missing, on a terminal, as a page, as files."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.result import NOT_SOUGHT, Advice, Diagnosis, Gap, RecordGap
from sindyjoint.diagnosis.verdict import reported_together
from sindyjoint.judgement.headlines import judge_diagnosis
from sindyjoint.reporting.equation import model_table
from sindyjoint.reporting.mathml import effect_mathml, mathml
from sindyjoint.reporting.page import Blocks, Page, markup, number, section, sentence
from sindyjoint.reporting.results.diagnosis_pictures import CAMPAIGN_KINDS, PARTS, STRUCTURE_KINDS
from sindyjoint.reporting.results.verification import every
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.tables import DASH, Console, TextTable, aligned, escape, tabulate
from sindyjoint.reporting.view import View
from sindyjoint.text import in_words_of, percent, quantities, spelled

VERDICTS = {
    "named": ("confirmed", "What was missing has a name, and the gap shrank when it was added."),
    "ambiguous": (
        "undecided",
        "Something is missing, and these runs do not decide which of several effects it is.",
    ),
    "partly_named": ("undecided", "A part of what was missing has a name; the rest is unexplained."),
    "unknown": ("refuted", "Something is missing that none of the known effects explains."),
    "undecided": ("undecided", "The data do not decide whether anything is missing."),
    "nothing_missing": ("confirmed", "Nothing is missing that these runs show."),
}


def _tables(result: Diagnosis) -> tuple[TextTable, ...]:
    """Return the gap by step, the parameters of the effects, and the model's terms."""
    motion = result.model.joint.motion
    columns = (
        "Step", f"{quantities(motion).moment} gap", "Response gap", "Probability", "Indistinguishable from",
    )  # fmt: skip
    parameters = [(step, name, value) for step in result.steps for name, value in step.parameters.items()]
    # Of a free motion no moment is measured; without an effect none has a probability.
    told = [said for said in zip(columns, *_step_rows(result), strict=True) if {*said[1:]} - {"", DASH}]
    columns, *rows = zip(*told, strict=True)
    return (
        TextTable(
            "steps",
            "Gap between model and measurement, relative RMS, after each named effect.",
            columns,
            tuple(rows),
        ),
        tabulate(
            "parameters",
            "Parameters of the effects, SI.",
            parameters,
            {
                "Effect": lambda one: spelled(one[0].effect, motion),
                "Parameter": lambda one: one[1],
                "Value": lambda one: number(one[2], 4),
                "Unit": lambda one: (
                    pretty_unit(unit) if (unit := one[0].units.get(one[1], "1")) != "1" else DASH
                ),
            },
        ),
        model_table(result.whole or result.model),
    )


def _rows(result: Diagnosis) -> list[dict[str, Any]]:
    """Return the gaps of the model alone, after each step, and of the noise, as shares."""
    return [
        {"step": name, "moment_gap": gap.moment, "response_gap": gap.response, "probability": probability}
        for name, gap, probability in (
            ("model alone", result.initial, np.nan),
            *((step.effect, step.gap_after, step.probability) for step in result.steps),
            ("noise floor", result.noise_floor, np.nan),
        )
    ]


def _page(result: Diagnosis, data: Diagnosis, show: Blocks) -> Page:
    """Return what is missing, the gap step by step, where it lies, and the model."""
    badge, headline = VERDICTS[result.verdict]
    motion, name = result.model.joint.motion, result.model.joint.name
    others = [e for e in result.moments if e.name not in result.element_ids]
    lines = [mathml(result.whole or result.model, [in_words_of(motion, e.effect.name) for e in others])]
    lines += [effect_mathml(effect, motion) for effect in others]
    steps, parameters, terms = _tables(result)
    hidden = markup("Hidden in this virtual test was: <b>{}</b>.").format(
        spelled(result.hidden or "", motion)
    )
    return Page(
        f"{name}: what its model lacks",
        "What the model of this joint lacks",
        f"{name} in {result.rig}" if result.in_place else name,
        show.hero("gap"),
        (
            show.verdict(headline, badge, result.verdict.replace("_", " ")),
            show.equation(markup("".join(lines))),
        ),
        (show.paragraph(hidden if result.hidden else ""), show.warnings(result.warnings)),
        (
            section(
                "steps",
                "The gap, step by step",
                "Steps",
                show.table(steps),
                show.pictures("maps", "overlay", "cycles", "envelope", "rivals"),
                show.tables(parameters),
                show.items(list(map(sentence, _notes(result)))),
            ),
            section(
                "where",
                "Where the first gap lies",
                "Where",
                show.items([sentence(region.words) for region in result.where]),
                show.pictures("where", "budget"),
            ),
            section("model", "The model, estimated together with the effects", "Model", show.table(terms)),
        ),
    )


def _printed(result: Diagnosis, console: Console) -> Iterator[Any]:
    """Yield gap by step, the parameters of the effects, where the gap lies, advice."""
    steps, parameters, _ = _tables(result)
    yield steps.headed("", *steps.headed().columns[1:], wraps=True)
    if parameters.rows:
        yield from ("", parameters.headed())
    budget = result.budget
    if budget.total > 0:
        parts = ", ".join(
            f"{name} {percent(round(getattr(budget, name) / budget.total, 2))}" for name in PARTS
        )
        yield f"\nthe first gap in mean square: {parts}"
    yield from (f"- {escape(text)}" for text in (*(region.words for region in result.where), *_notes(result)))
    if result.hidden is not None:
        yield f"\nhidden in this virtual test was: [bold]{spelled(result.hidden, result.model.joint.motion)}[/]"


_RECORDS: dict[str, Callable[[RecordGap], str]] = {
    "record": lambda record: record.name,
    "samples": lambda record: str(record.time.size),
    "noise": lambda record: f"{record.noise:.2e} m",
    "kept out from": lambda record: f"{record.held_from:.3g} s",
    "gap before": lambda record: percent(record.gap_before),
    "gap after": lambda record: percent(record.gap_after),
    "noise floor": lambda record: percent(record.noise_floor),
}


def _details(result: Diagnosis) -> Iterator[str]:
    """Yield the rivals of each step, the budget in numbers, and the gap of each record."""
    for step in result.steps:
        rows = [(step.effect, step.probability), *step.rivals]
        shown = {f"step {step.effect}": lambda row: row[0], "probability": lambda row: f"{row[1]:.3g}"}
        yield from aligned(tabulate("rivals", "", rows, shown))
    parts = ", ".join(f"{name} {getattr(result.budget, name):.3g}" for name in PARTS)
    yield f"mean square of the first gap: {parts}"
    if result.records:
        yield from aligned(tabulate("records", "", result.records, _RECORDS))


def _notes(result: Diagnosis) -> list[str]:
    """Return which terms no longer count, and advice that is no next step."""
    motion = result.model.joint.motion
    needless = ", ".join(spelled(term, motion) for step in result.steps for term in step.terms_dropped)
    unsought = result.search.status == NOT_SOUGHT and any(len(step.members) > 1 for step in result.steps)
    return [
        *[f"no longer needed beside the effects: {needless}"] * bool(needless),
        *(
            advice_words(each, f"{each.level:.3g} {result.level_unit}", motion)
            for place, each in enumerate(result.advice)
            if place or not each.frequency
        ),
        *["runs that would tell rivals apart have not been sought"] * unsought,
    ]


def advice_words(advice: Advice, level: str, motion: str) -> str:
    """Return in a sentence which run to make, at a level in its unit, or that none would help."""
    *first, last = (spelled(name, motion) for name in advice.separates)
    apart = f"to tell {', '.join(first)} and {last} apart"
    if not advice.frequency:
        return f"{apart}: {advice.waveform.removeprefix('none: ')}"
    run = f"a {advice.waveform}, at f = {advice.frequency:.4g} Hz with a peak of {level}"
    return f"{apart}: {run}; the true one should then have a probability of {advice.expected_confidence:.2f}"


def _step_rows(result: Diagnosis) -> tuple[tuple[str, ...], ...]:
    """Return the gap of the model alone, after each step, and the noise floor."""
    rows: list[tuple[str, ...]] = [("model alone", *_gap(result.initial), "", "")]
    motion = result.model.joint.motion
    for group in reported_together(result.steps):
        for step in group:
            others = ", ".join(spelled(member, motion) for member in step.members if member != step.effect)
            early = step is not group[-1]
            named = f"+ {spelled(step.effect, motion)}{' (helps only with the next)' * early}"
            gap = (DASH, DASH) if early else _gap(step.gap_after)
            rows.append((named, *gap, f"{step.probability:.2f}", others or DASH))
    floor, first, unsure = result.noise_floor, result.initial, result.uncertainty
    pairs = (floor.moment, first.moment), (floor.response, first.response)
    # A floor that could not be measured is unknown, where there is a gap beside it.
    shown = (percent(x) if np.isfinite(x) else "unknown" if np.isfinite(gap) else DASH for x, gap in pairs)
    rows.append(("noise floor", *shown, "", ""))
    if unsure.moment or unsure.response:
        left = (percent(x) if x else DASH for x in (unsure.moment, unsure.response))
        rows.append(("uncertainty of numbers and drive", *left, "", ""))
    return tuple(rows)


def _gap(gap: Gap) -> tuple[str, str]:
    return percent(gap.moment), percent(gap.response)


DIAGNOSIS: View = View(
    about=lambda result: (
        f"{escape(result.model.joint.name)}{' (simulated)' * DIAGNOSIS.simulated(result)}: "
        f"[bold]{result.verdict.replace('_', ' ')}[/]"
    ),
    data=Diagnosis,
    kind="Diagnosis",
    folder="diagnosis",
    formerly={"StructureDiagnosis": {"source": "structure"}},
    record_file="diagnosis.json",
    question="What is missing?",
    # A structure has no force states.
    judged_by=lambda result: (
        *["states"] * (result.source != "structure"),
        "response",
        f"diagnosis {'structure' if result.source == 'structure' else 'campaign'}",
    ),
    unsaved={"effects": (), "whole": None, "test": None, "soundness": None, "stopped": None},
    kinds=lambda data: STRUCTURE_KINDS if data.source == "structure" else CAMPAIGN_KINDS,
    # With the model that model.json holds, and no more samples than a picture shows.
    kept=lambda data: replace(
        data,
        model=data.whole or data.model,
        records=tuple(every(r, r.time.size, "time", "measured", "before", "after") for r in data.records),
    ),
    headline=lambda result: result.trust or judge_diagnosis(result, DIAGNOSIS.simulated(result)),
    tables=_tables,
    rows=_rows,
    page=_page,
    # What the effects add to the joint's law, and what belongs to the test.
    files=lambda result, data: {"model.json": (result.whole or result.model).to_json() + "\n"},
    printed=_printed,
    details=_details,
)
