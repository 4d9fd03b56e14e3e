"""A diagnosis, of a campaign or of a structure: what is missing, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.diagnosis.structure.result import StructureDiagnosis
from sindyjoint.reporting.equation import effect_mathml, mathml
from sindyjoint.reporting.figures import diagnosis, structure
from sindyjoint.reporting.page import markup, number
from sindyjoint.reporting.style import prefixed, pretty_unit
from sindyjoint.reporting.tables import model_table
from sindyjoint.reporting.text_table import DASH, TextTable, aligned, terminal, terminal_table
from sindyjoint.reporting.units import quantities
from sindyjoint.reporting.view import View
from sindyjoint.text import percent, spelled

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Advice, Gap, Step

PARTS = ("state", "history", "run", "processing", "noise")
VERDICTS = {
    "named": ("confirmed", "What was missing has a name, and the gap shrank when it was added."),
    "ambiguous": (
        "undecided",
        "Something is missing, and these runs do not decide which of several effects it is.",
    ),
    "unknown": ("refuted", "Something is missing that none of the known effects explains."),
    "undecided": ("undecided", "The data do not decide whether anything is missing."),
    "nothing_missing": ("confirmed", "Nothing is missing: the residual is noise."),
}


class DiagnosisView(View[Diagnosis, Diagnosis]):
    """The diagnosis of a campaign."""

    results = (Diagnosis,)
    data: ClassVar[type] = Diagnosis
    kind = "Diagnosis"
    kinds = diagnosis.KINDS
    template = "diagnosis.html.j2"
    record_file = "diagnosis.json"
    judged_by: ClassVar[tuple[str, ...]] = ("states", "response", "diagnosis campaign")
    unsaved: ClassVar[dict[str, Any]] = {
        "effects": (),
        "whole": None,
        "soundness": None,
        "stopped": None,
    }

    def kept(self, data: Any) -> Any:
        """Return it with the model that ``model.json`` holds."""
        return replace(data, model=data.whole or data.model)

    def level_unit(self, result: Diagnosis) -> str:
        """Return the unit of the level of an advised run."""
        return quantities(result.model.joint.motion).angle_unit

    def to_dict(self, result: Diagnosis) -> dict[str, Any]:
        """Return what ``--json`` prints, with the reason and what a virtual test had hidden."""
        return {**result.to_dict(), "reason": result.reason, "hidden": result.hidden}

    def tables(self, result: Diagnosis) -> tuple[TextTable, ...]:
        """Return the gap by step, the parameters of the effects, and the model's terms."""
        moment = quantities(result.model.joint.motion).moment
        columns = ("Step", f"{moment} gap", "Response gap", "Probability", "Indistinguishable from")
        caption = "Gap between model and measurement, relative RMS, after each named effect."
        parameters = tuple(
            (spelled(step.effect), name, number(value, 4), parameter_unit(step, name) or DASH)
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

    def content(self, result: Diagnosis, data: Diagnosis, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        badge, headline = VERDICTS[result.verdict]
        unit, motion = self.level_unit(result), result.model.joint.motion
        names = {"moment": quantities(motion).moment, "response": "Response"}
        gaps = [
            (
                f"{called} gap",
                f"{percent(getattr(result.initial, name))} → {percent(getattr(result.final, name))}",
                f"noise floor {percent(getattr(result.noise_floor, name))}",
            )
            for name, called in names.items()
            if np.isfinite(getattr(result.noise_floor, name))
        ]
        named = ", ".join(spelled(step.effect) for step in result.steps) or "none"
        lines = [mathml(result.whole or result.model, [e.effect.name for e in result.moments])]
        lines += [effect_mathml(effect, motion) for effect in result.moments]
        return {
            "title": f"{result.model.joint.name}: what its model lacks",
            "badge": badge,
            "headline": headline,
            "facts": [*gaps, ("Effects named", str(len(result.steps)), named)],
            "advices": [f"T{advice_words(a, _amount(a.level, unit))[1:]}." for a in result.advice],
            "equation": markup("".join(lines)),
        }

    def files(self, result: Diagnosis, data: Diagnosis) -> dict[str, str]:
        """Return the model with those effects as terms that are functions of only angle and rate."""
        return {"model.json": (result.whole or result.model).to_json() + "\n"}

    def show(self, result: Diagnosis) -> None:
        """Print verdict, gap by step, where it lies, advice and warnings."""
        from rich.markup import escape

        console = terminal()
        console.print(f"{escape(result.model.joint.name)}: [bold]{result.verdict.replace('_', ' ')}[/]")
        console.print(escape(result.reason) + "\n")
        gap = f"{quantities(result.model.joint.motion).moment.lower()} gap"
        columns = ("", gap, "response gap", "probability", "indistinguishable from")
        console.print(terminal_table(columns, _step_rows(result, dropped=False), "lrrrl", wraps=True))
        for step in result.steps:
            values = ", ".join(
                f"{name} = {value:.4g} {parameter_unit(step, name)}".rstrip()
                for name, value in step.parameters.items()
            )
            console.print(f"\n{spelled(step.effect)}: {escape(values)}{_dropped(step)}", soft_wrap=False)
        budget = result.budget
        if budget.total > 0:
            parts = ", ".join(
                f"{name} {percent(round(getattr(budget, name) / budget.total, 2))}" for name in PARTS
            )
            console.print(f"\nthe first gap in mean square: {parts}")
        for region in result.where:
            console.print(f"- {escape(region.words)}")
        for advice in result.advice:
            console.print(escape(advice_words(advice, f"{advice.level:.3g} {self.level_unit(result)}")))
        if result.hidden is not None:
            console.print(f"\nhidden in this virtual test was: [bold]{spelled(result.hidden)}[/]")
        for warning in result.warnings:
            console.print(f"- {escape(warning)}")

    def details(self, result: Diagnosis) -> Iterator[str]:
        """Yield the rivals of each step, and the budget in numbers."""
        for step in result.steps:
            rows = [(f"step {step.effect}", "probability"), *((n, f"{p:.3g}") for n, p in step.rivals)]
            yield from aligned([rows[0], (step.effect, f"{step.probability:.3g}"), *rows[1:]])
        parts = ", ".join(f"{name} {getattr(result.budget, name):.3g}" for name in PARTS)
        yield f"mean square of the first gap: {parts}"


class StructureView(DiagnosisView):
    """The diagnosis of a structure."""

    results = (StructureDiagnosis,)
    data = StructureDiagnosis
    kind = "StructureDiagnosis"
    kinds = structure.KINDS
    judged_by = ("response", "diagnosis structure")

    def kept(self, data: StructureDiagnosis) -> StructureDiagnosis:
        """Return its records with no more samples than a picture shows."""
        kept: StructureDiagnosis = super().kept(data)
        return replace(kept, records=tuple(map(structure.thinned, data.records)))

    def level_unit(self, result: Diagnosis) -> str:
        """Return the unit of a structure's displacement."""
        return "m"

    def details(self, result: Diagnosis) -> Iterator[str]:
        """Yield what a campaign's has, and the gap of each record."""
        yield from super().details(result)
        assert isinstance(result, StructureDiagnosis)
        yield from aligned(
            [
                ("record", "samples", "noise", "kept out from", "gap before", "gap after", "noise floor"),
                *(
                    (
                        record.name,
                        str(record.time.size),
                        f"{record.noise:.2e} m",
                        f"{record.held_from:.3g} s",
                        percent(record.gap_before),
                        percent(record.gap_after),
                        percent(record.noise_floor),
                    )
                    for record in result.records
                ),
            ]
        )


def advice_words(advice: Advice, level: str) -> str:
    """Return in a sentence which run to make, at a level in its unit, or that none would help."""
    *first, last = map(spelled, advice.separates)
    apart = f"to tell {', '.join(first)} and {last} apart"
    if not advice.frequency:
        return f"{apart}: {advice.waveform.removeprefix('none: ')}"
    run = f"a {advice.waveform}, at f = {advice.frequency:.4g} Hz with a peak of {level}"
    return f"{apart}: {run}; the true one should then have a probability of {advice.expected_confidence:.2f}"


def parameter_unit(step: Step, name: str) -> str:
    """Return the unit of a parameter for people; nothing for a plain number."""
    unit = step.units.get(name, "1")
    return "" if unit == "1" else pretty_unit(unit)


def _step_rows(result: Diagnosis, dropped: bool = True) -> tuple[tuple[str, ...], ...]:
    """Return the gap of the model alone, after each step, and the noise floor."""
    rows: list[tuple[str, ...]] = [("model alone", *_gap(result.initial), "", "")]
    for step in result.steps:
        others = ", ".join(spelled(member) for member in step.members if member != step.effect)
        named = f"+ {spelled(step.effect)}{_dropped(step) if dropped else ''}"
        rows.append((named, *_gap(step.gap_after), f"{step.probability:.2f}", others or DASH))
    return (*rows, ("noise floor", *_gap(result.noise_floor), "", ""))


def _dropped(step: Step) -> str:
    """Return which terms a step made needless, to stand behind its name."""
    return f"; no longer needed: {', '.join(map(spelled, step.terms_dropped))}" if step.terms_dropped else ""


def _gap(gap: Gap) -> tuple[str, str]:
    return percent(gap.moment), percent(gap.response)


def _amount(value: float, unit: str) -> str:
    factor, prefixed_unit = prefixed(value, unit)
    return f"{value * factor:.3g} {prefixed_unit}"
