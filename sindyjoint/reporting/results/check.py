"""A check of the data: what was found, on a terminal, as a page, as files; of a result that it stopped, too."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.headlines import judge_check
from sindyjoint.reporting.figures.check import CheckData, gather_check, kinds_of_check
from sindyjoint.reporting.figures.kind import Kind
from sindyjoint.reporting.provenance import Provenance, provenance
from sindyjoint.reporting.results.diagnosis import DiagnosisView
from sindyjoint.reporting.style import shortened
from sindyjoint.reporting.tables import findings_table, terms_csv
from sindyjoint.reporting.text_table import DASH, TextTable, csv_text, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.soundness.check import Check, Checked, RigCheck
from sindyjoint.soundness.finding import Finding, Soundness

if TYPE_CHECKING:
    from rich.console import Console

    from sindyjoint.trust import Trust

BADGES = {"sound": "confirmed", "doubtful": "undecided", "unsound": "refuted"}
HEADLINES = {
    "sound": "Nothing was found that stands against a model of these data.",
    "doubtful": "A model can be made of these data; some of its coefficients are biased.",
    "unsound": "No model is made of these data as they are.",
}
ACCEPTED = "The data are unsound; what stops a model is accepted."
LEFT_OUT = "A model can be made of these data; the samples at fault are left out."
CSV_COLUMNS = ("id", "run", "channel", "severity", "masked", "extent", "effect", "remedy")
# A terminal of 80 columns, less the other columns.
EXTENT = 34


class CheckView(View[Any, CheckData]):
    """A check of the data, or a result that stopped at it."""

    results = (Check, RigCheck, CheckData)
    data = CheckData
    kind = "Check"
    folder = "check"
    template = "check.html.j2"
    record_file = "check.json"
    judged_by = ("soundness",)
    question = "What was found?"

    def gather(self, result: Any) -> CheckData:
        """Return what is saved, so that a figure drawn again later is the same to the last byte."""
        if isinstance(result, CheckData):
            return result
        data: CheckData = self.restore(self.save(gather_check(_check_of(result))))
        return data

    def simulated(self, result: Any) -> bool:
        """Return whether the campaign is a virtual test."""
        return not isinstance(result, CheckData) and _check_of(result).simulated

    def figures(self, data: CheckData) -> Mapping[str, Kind]:
        """Return as many figures as the runs take."""
        return kinds_of_check(data)

    def to_dict(self, result: Any) -> dict[str, Any]:
        """Return what ``sindyjoint check --json`` prints."""
        return _check_of(result).to_dict()

    def tables(self, result: Any) -> tuple[TextTable, ...]:
        """Return the findings."""
        return (findings_table(_in_words(_check_of(result))),)

    def lead(self, result: Any, data: CheckData) -> tuple[str, int]:
        """Return the channels of the run with the severest finding."""
        named = [f.run for f in _check_of(result).soundness.findings if f.run is not None]
        names = [run.run for run in data.runs]
        worst = names.index(named[0]) if named and named[0] in names else 0
        for kind, made in self.figures(data).items():
            panels = len(made.panels(data))
            if worst < panels:
                return kind, worst
            worst -= panels
        return "channels", 0

    def content(self, result: Any, data: CheckData, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        check = _check_of(result)
        soundness = check.soundness
        counts = {s: sum(f.severity == s for f in soundness.findings) for s in ("stops", "biases", "note")}
        return {
            "title": f"{check.name}: are its data sound?",
            "check": check,
            "asked": f"Are the data of this {'structure' if isinstance(check, RigCheck) else 'joint'} sound?",
            "badge": BADGES[soundness.verdict],
            "lead_caption": self.figures(data)["channels"].caption,
            "headline": _headline(soundness),
            "stopped": "" if result is check else type(result).__name__.lower(),
            "facts": [
                ("Runs", str(len(check.recorded)), f"{sum(len(r.traces) for r in data.runs)} channels"),
                ("Stop", str(counts["stops"]), "no model is made"),
                ("Bias", str(counts["biases"]), "coefficients are shifted"),
                ("Notes", str(counts["note"]), "good to know"),
            ],
        }

    def origin(self, result: Any, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return the origin of the campaign's runs, too."""
        return provenance(getattr(_check_of(result), "campaign", None), seed, command_line, files)

    def files(self, result: Any, data: CheckData) -> dict[str, str]:
        """Return the findings as a table; of a result that was stopped, what it writes else, so that none is stale."""
        check = _check_of(result)
        rows = [[getattr(f, name) for name in CSV_COLUMNS] for f in check.soundness.findings]
        texts = {"findings.csv": csv_text(CSV_COLUMNS, rows)}
        if result is not check:
            texts["model.json"] = result.model.to_json() + "\n"
        if isinstance(result, Discovery):
            texts["terms.csv"] = terms_csv(result.model)
        if isinstance(result, Diagnosis):
            record = DiagnosisView().to_dict(result)
            texts["diagnosis.json"] = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        return texts

    def headline(self, result: Any) -> Trust:
        """Return whether a model can be made of the data."""
        return judge_check(_check_of(result))

    def about(self, result: Any) -> str:
        """Return the joint and the verdict."""
        from rich.markup import escape

        check = _check_of(result)
        virtual = " (simulated)" if check.simulated else ""
        name = escape(check.name)
        return f"{name}{virtual}: the data are [bold]{check.soundness.verdict}[/]"

    def show_result(self, result: Any, console: Console) -> None:
        """Print a line for each finding."""
        from rich.markup import escape

        check = _check_of(result)
        findings = _in_words(check)
        if not findings:
            console.print("  nothing")
        else:
            rows = [
                (
                    f.severity,
                    f.id,
                    shortened(f.run or "all runs", 14),
                    shortened(f.channel or DASH, 12),
                    textwrap.shorten(f.extent, EXTENT, placeholder="…"),
                )
                for f in findings
            ]
            console.print(terminal_table(("severity", "finding", "run", "channel", "extent"), rows, "l"))
        for warning in check.warnings:
            console.print(f"- {escape(warning)}")
        if check.stopping:
            console.print(f"\n[bold]stopped[/]: {escape(check.reason)}")


def _check_of(result: Any) -> Checked:
    """Return a check, or that at which a result stopped."""
    return result if isinstance(result, Checked) else result.stopped


def _headline(soundness: Soundness) -> str:
    if soundness.verdict == "unsound" and not soundness.stopping:
        return ACCEPTED
    biases = [f for f in soundness.findings if f.severity == "biases"]
    if soundness.verdict == "doubtful" and all(f.masked for f in biases):
        return LEFT_OUT
    return HEADLINES[soundness.verdict]


def _in_words(check: Checked) -> tuple[Finding, ...]:
    """Return the findings with their channels in the words of the joint's kind of motion."""
    from dataclasses import replace

    words = check.words
    return tuple(
        f if f.channel is None else replace(f, channel=words.label(f.channel))
        for f in check.soundness.findings
    )


def wrap_findings(soundness: Soundness) -> Iterator[str]:
    """Yield each finding in full, as lines: what ``--verbose`` adds."""
    for f in soundness.findings:
        where = " of ".join(part for part in (f.channel, f.run) if part) or "all runs"
        text = f"{f.severity}: {f.id} ({where}): {f.extent}; {f.effect}; {f.remedy}"
        yield from textwrap.wrap(text, 110, subsequent_indent="  ")
