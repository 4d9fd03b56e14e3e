"""A diagnosis, of a campaign or of a structure: what is missing, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from sindyjoint.diagnosis.falling import reported_together
from sindyjoint.diagnosis.result import NOT_SOUGHT, Advice, Diagnosis, Gap, RecordGap, Step
from sindyjoint.judgement.headlines import judge_diagnosis
from sindyjoint.reporting.equation import model_table
from sindyjoint.reporting.figure import Kind
from sindyjoint.reporting.mathml import effect_mathml, mathml
from sindyjoint.reporting.page import Blocks, Page, markup, number, section, sentence
from sindyjoint.reporting.results.diagnosis_pictures import CAMPAIGN_KINDS, STRUCTURE_KINDS, thinned
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    print_table,
    tabulate,
    terminal_table,
)
from sindyjoint.reporting.view import View
from sindyjoint.text import in_words_of, percent, quantities, spelled
from sindyjoint.trust import Trust

PARTS = ("state", "history", "run", "processing", "noise")
VERDICTS = {
    "named": ("confirmed", "What was missing has a name, and the gap shrank when it was added."),
    "ambiguous": (
        "undecided",
        "Something is missing, and these runs do not decide which of several effects it is.",
    ),
    "partly_named": ("undecided", "A part of what was missing has a name; the rest is unexplained."),
    "unknown": ("refuted", "Something is missing that none of the known effects explains."),
    "undecided": ("undecided", "The data do not decide whether anything is missing."),
    "nothing_missing": ("confirmed", "Nothing is missing: the residual is noise."),
}


class DiagnosisView(
    View[Diagnosis, Diagnosis],
    data=Diagnosis,
    kind="Diagnosis",
    folder="diagnosis",
    formerly={"StructureDiagnosis": {"source": "structure"}},
    record_file="diagnosis.json",
    question="What is missing?",
    judged_by=("states", "response", "diagnosis campaign", "diagnosis structure"),
    unsaved={"effects": (), "whole": None, "test": None, "soundness": None, "stopped": None},
):
    """The diagnosis of a campaign or of a structure."""

    def kinds_of(self, data: Diagnosis) -> Mapping[str, Kind]:
        """Return the figures of a campaign, or those of a structure."""
        return STRUCTURE_KINDS if data.source == "structure" else CAMPAIGN_KINDS

    def judges_of(self, result: Diagnosis) -> tuple[str, ...]:
        """Return the policies that decided it; a structure has no force states."""
        other = {"campaign": ("diagnosis structure",), "structure": ("states", "diagnosis campaign")}
        return tuple(name for name in self.judged_by if name not in other[result.source])

    def kept(self, data: Diagnosis) -> Diagnosis:
        """Return it with the model that ``model.json`` holds, and no more samples than a picture shows."""
        records = tuple(map(thinned, data.records))
        return replace(data, model=data.whole or data.model, records=records)

    def tables(self, result: Diagnosis) -> tuple[TextTable, ...]:
        """Return the gap by step, the parameters of the effects, and the model's terms."""
        motion = result.model.joint.motion
        moment = quantities(motion).moment
        columns = ("Step", f"{moment} gap", "Response gap", "Probability", "Indistinguishable from")
        caption = "Gap between model and measurement, relative RMS, after each named effect."
        parameters = tuple(
            (spelled(step.effect, motion), name, number(value, 4), parameter_unit(step, name) or DASH)
            for step in result.steps
            for name, value in step.parameters.items()
        )
        return (
            TextTable("steps", caption, columns, _step_rows(result)),
            TextTable(
                "parameters",
                "Parameters of the effects, SI.",
                ("Effect", "Parameter", "Value", "Unit"),
                parameters,
            ),
            model_table(result.whole or result.model),
        )

    def records(self, result: Diagnosis) -> list[dict[str, Any]]:
        """Return the gaps of the model alone, after each step, and of the noise, as shares."""
        rows: list[tuple[str, Gap, float]] = [("model alone", result.initial, float("nan"))]
        rows += [(step.effect, step.gap_after, step.probability) for step in result.steps]
        rows.append(("noise floor", result.noise_floor, float("nan")))
        return [
            {"step": name, "moment_gap": gap.moment, "response_gap": gap.response, "probability": probability}
            for name, gap, probability in rows
        ]

    def page(self, result: Diagnosis, data: Diagnosis, show: Blocks, folder: Path | None) -> Page:
        """Return what is missing, the gap step by step, where it lies, and the model."""
        badge, headline = VERDICTS[result.verdict]
        motion = result.model.joint.motion
        others = [e for e in result.moments if e.name not in result.element_ids]
        lines = [mathml(result.whole or result.model, [in_words_of(motion, e.effect.name) for e in others])]
        lines += [effect_mathml(effect, motion) for effect in others]
        found = (
            show.verdict(headline, badge, result.verdict.replace("_", " ")),
            show.equation(markup("".join(lines))),
        )
        steps, parameters, terms = self.tables(result)
        hidden = markup("Hidden in this virtual test was: <b>{}</b>.").format(
            spelled(result.hidden or "", motion)
        )
        name = result.model.joint.name
        return Page(
            f"{name}: what its model lacks",
            "What the model of this joint lacks",
            f"{name} in {result.rig}" if result.in_place else name,
            (
                show.answers(self.headline(result), self.question, self.hero(show, data, "gap"), found),
                show.paragraph(hidden if result.hidden else ""),
                show.warnings(result.warnings),
            ),
            (
                section(
                    "steps",
                    "The gap, step by step",
                    "Steps",
                    show.table(steps),
                    show.pictures("maps", "overlay", "cycles", "envelope", "rivals"),
                    show.table(parameters) if parameters.rows else "",
                    show.items(list(map(sentence, _notes(result)))),
                ),
                section(
                    "where",
                    "Where the first gap lies",
                    "Where",
                    show.items([sentence(region.words) for region in result.where]),
                    show.pictures("where", "budget"),
                ),
                section(
                    "model", "The model, estimated together with the effects", "Model", show.table(terms)
                ),
            ),
        )

    def files(self, result: Diagnosis, data: Diagnosis) -> dict[str, str]:
        """Return the model with what the effects add to the joint's law, and what belongs to the test."""
        return {"model.json": (result.whole or result.model).to_json() + "\n"}

    def headline(self, result: Diagnosis) -> Trust:
        """Return whether to believe the diagnosis."""
        return result.trust or judge_diagnosis(result, self.simulated(result))

    def about(self, result: Diagnosis) -> str:
        """Return the joint and the verdict."""
        virtual = " (simulated)" if self.simulated(result) else ""
        return f"{escape(result.model.joint.name)}{virtual}: [bold]{result.verdict.replace('_', ' ')}[/]"

    def show_result(self, result: Diagnosis, console: Console) -> None:
        """Print gap by step, the parameters of the effects, where the gap lies, advice."""
        steps, parameters, _ = self.tables(result)
        console.print(terminal_table(steps.headed("", *steps.headed().columns[1:]), "lrrrl", wraps=True))
        if parameters.rows:
            console.print()
            print_table(parameters.headed(), console, "llrl")
        budget = result.budget
        if budget.total > 0:
            parts = ", ".join(
                f"{name} {percent(round(getattr(budget, name) / budget.total, 2))}" for name in PARTS
            )
            console.print(f"\nthe first gap in mean square: {parts}")
        for words in (*(region.words for region in result.where), *_notes(result)):
            console.print(f"- {escape(words)}")
        if result.hidden is not None:
            hidden = spelled(result.hidden, result.model.joint.motion)
            console.print(f"\nhidden in this virtual test was: [bold]{hidden}[/]")

    def details(self, result: Diagnosis) -> Iterator[str]:
        """Yield the rivals of each step, the budget in numbers, and the gap of each record."""
        for step in result.steps:
            rows = ((step.effect, step.probability), *step.rivals)
            written = tuple((name, f"{p:.3g}") for name, p in rows)
            yield from aligned(TextTable("rivals", "", (f"step {step.effect}", "probability"), written))
        parts = ", ".join(f"{name} {getattr(result.budget, name):.3g}" for name in PARTS)
        yield f"mean square of the first gap: {parts}"
        columns: dict[str, Callable[[RecordGap], str]] = {
            "record": lambda record: record.name,
            "samples": lambda record: str(record.time.size),
            "noise": lambda record: f"{record.noise:.2e} m",
            "kept out from": lambda record: f"{record.held_from:.3g} s",
            "gap before": lambda record: percent(record.gap_before),
            "gap after": lambda record: percent(record.gap_after),
            "noise floor": lambda record: percent(record.noise_floor),
        }
        if result.records:
            yield from aligned(tabulate("records", "", result.records, columns))


def _notes(result: Diagnosis) -> list[str]:
    """Return which terms no longer count, and advice that is no next step."""
    motion = result.model.joint.motion
    needless = [spelled(term, motion) for step in result.steps for term in step.terms_dropped]
    notes = [f"no longer needed beside the effects: {', '.join(needless)}"] if needless else []
    notes += [
        advice_words(each, f"{each.level:.3g} {result.level_unit}", motion)
        for place, each in enumerate(result.advice)
        if place or not each.frequency
    ]
    if any(len(step.members) > 1 for step in result.steps) and result.search.status == NOT_SOUGHT:
        notes.append("runs that would tell rivals apart have not been sought")
    return notes


def advice_words(advice: Advice, level: str, motion: str) -> str:
    """Return in a sentence which run to make, at a level in its unit, or that none would help."""
    *first, last = (spelled(name, motion) for name in advice.separates)
    apart = f"to tell {', '.join(first)} and {last} apart"
    if not advice.frequency:
        return f"{apart}: {advice.waveform.removeprefix('none: ')}"
    run = f"a {advice.waveform}, at f = {advice.frequency:.4g} Hz with a peak of {level}"
    return f"{apart}: {run}; the true one should then have a probability of {advice.expected_confidence:.2f}"


def parameter_unit(step: Step, name: str) -> str:
    """Return the unit of a parameter for people; nothing for a plain number."""
    unit = step.units.get(name, "1")
    return "" if unit == "1" else pretty_unit(unit)


def _step_rows(result: Diagnosis) -> tuple[tuple[str, ...], ...]:
    """Return the gap of the model alone, after each step, and the noise floor."""
    rows: list[tuple[str, ...]] = [("model alone", *_gap(result.initial), "", "")]
    motion = result.model.joint.motion
    for group in reported_together(result.steps):
        for step in group:
            others = ", ".join(spelled(member, motion) for member in step.members if member != step.effect)
            named = (
                f"+ {spelled(step.effect, motion)}{' (helps only with the next)' * (step is not group[-1])}"
            )
            gap = _gap(step.gap_after) if step is group[-1] else (DASH, DASH)
            rows.append((named, *gap, f"{step.probability:.2f}", others or DASH))
    floor, first = result.noise_floor, result.initial
    pairs = (floor.moment, first.moment), (floor.response, first.response)
    # A floor that could not be measured is unknown, where there is a gap beside it.
    shown = (percent(x) if np.isfinite(x) else "unknown" if np.isfinite(gap) else DASH for x, gap in pairs)
    rows.append(("noise floor", *shown, "", ""))
    unsure = result.uncertainty.moment, result.uncertainty.response
    if any(unsure):
        rows.append(
            ("uncertainty of numbers and drive", *(percent(x) if x else DASH for x in unsure), "", "")
        )
    return tuple(rows)


def _gap(gap: Gap) -> tuple[str, str]:
    return percent(gap.moment), percent(gap.response)
