"""A check of the data: every channel with what was found marked on it; of a campaign, of a stopped result too."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.headlines import judge_check
from sindyjoint.record import Campaign
from sindyjoint.reporting.equation import terms_csv
from sindyjoint.reporting.figure import Kind
from sindyjoint.reporting.page import Blocks, Page, Provenance, provenance, section, sentence
from sindyjoint.reporting.results.check_pictures import (
    RUNS_PER_FIGURE,
    CheckData,
    gather_check,
    kinds_of_check,
)
from sindyjoint.reporting.results.diagnosis import DiagnosisView
from sindyjoint.reporting.style import pretty_unit, shortened
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    csv_text,
    findings_table,
    json_text,
    terminal_table,
)
from sindyjoint.reporting.view import View
from sindyjoint.soundness.check import Check, Checked, RigCheck
from sindyjoint.soundness.finding import Soundness
from sindyjoint.text import quantities, spelled
from sindyjoint.trust import Trust

BADGES = {"sound": "confirmed", "doubtful": "undecided", "unsound": "refuted"}
HEADLINES = {
    "sound": "Nothing was found that stands against a model of these data.",
    "doubtful": "A model can be made of these data; some of its coefficients are biased.",
    "unsound": "No model is made of these data as they are.",
}
CSV_COLUMNS = ("id", "run", "channel", "severity", "masked", "extent", "effect", "remedy")
# A terminal of 80 columns, less the other columns.
EXTENT = 34


class CheckView(
    View[Any, CheckData],
    results=(Check, RigCheck, CheckData),
    data=CheckData,
    kind="Check",
    folder="check",
    record_file="check.json",
    judged_by=("soundness",),
    question="What was found?",
):
    """A check of the data, or a result that stopped at it."""

    def drawn_from(self, result: Any) -> CheckData:
        """Return the runs."""
        return gather_check(_check_of(result))

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
        """Return the findings, their channels in the words of the joint's kind of motion."""
        label, findings = _check_of(result).words.label, _check_of(result).soundness.findings
        return (findings_table([replace(f, channel=f.channel and label(f.channel)) for f in findings]),)

    def page(self, result: Any, data: CheckData, show: Blocks, folder: Path | None) -> Page:
        """Return the verdict, every finding, and every channel."""
        check = _check_of(result)
        found, (table,) = check.soundness.findings, self.tables(result)
        count = {s: str(sum(f.severity == s for f in found)) for s in ("stops", "biases", "note")}
        facts = [
            ("Runs", str(len(check.recorded)), f"{sum(len(r.traces) for r in data.runs)} channels"),
            ("Stop", count["stops"], "no model is made"),
            ("Bias", count["biases"], "coefficients are shifted"),
            ("Notes", count["note"], "good to know"),
        ]
        verdict = check.soundness.verdict
        # Where what stops a model is accepted, the work goes on; the lights say what that is.
        stands = "doubtful" if verdict == "unsound" and not check.stopping else verdict
        said = (show.verdict(HEADLINES[stands], BADGES[verdict], verdict),)
        why = sentence(check.reason)
        if why and result is not check:
            why += f" So there is no {type(result).__name__.lower()}."
        what = "structure" if isinstance(check, RigCheck) else "joint"
        return Page(
            f"{check.name}: are its data sound?",
            f"Are the data of this {what} sound?",
            check.name,
            (
                show.answers(self.headline(result), self.question, self._worst(result, data, show), said),
                show.paragraph(why, "reason"),
                show.facts(facts),
                show.warnings(check.warnings),
            ),
            (
                section(
                    "findings",
                    "What was found",
                    "Findings",
                    show.table(table) if table.rows else show.paragraph("Nothing."),
                ),
                section("channels", "Every channel of every run", "Channels", show.pictures()),
            ),
        )

    def _worst(self, result: Any, data: CheckData, show: Blocks) -> str:
        """Return the channels of the run with the severest finding."""
        named = [f.run for f in _check_of(result).soundness.findings if f.run is not None]
        names = [run.run for run in data.runs]
        figure, panel = divmod(names.index(named[0]) if named and named[0] in names else 0, RUNS_PER_FIGURE)
        # Small here, below at the size at which a finding is seen.
        return self.hero(show, data, list(self.figures(data))[figure], panel, again=True)

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
            texts["diagnosis.json"] = json_text(DiagnosisView().to_dict(result))
        return texts

    def headline(self, result: Any) -> Trust:
        """Return whether a model can be made of the data."""
        return judge_check(_check_of(result))

    def about(self, result: Any) -> str:
        """Return the joint and the verdict."""
        check = _check_of(result)
        virtual = " (simulated)" if check.simulated else ""
        name = escape(check.name)
        return f"{name}{virtual}: the data are [bold]{check.soundness.verdict}[/]"

    def show_result(self, result: Any, console: Console) -> None:
        """Print a line for each finding, and what stops a model."""
        check, (table,) = _check_of(result), self.tables(result)
        rows = tuple(
            (severity, id, shortened(where, 26), textwrap.shorten(extent, EXTENT, placeholder="…"))
            for id, where, severity, extent, _ in table.rows
        )
        if rows:
            shown = replace(table, columns=("severity", "finding", "where", "extent"), rows=rows)
            console.print(terminal_table(shown, "l"))
            # What a kind of fault does and what to do about it, once.
            for words in dict.fromkeys(
                f"{spelled(f.id)}: {f.effect}; {f.remedy}" for f in check.soundness.findings
            ):
                console.print(f"- {escape(words)}")
        else:
            console.print("  nothing")
        if check.stopping:
            console.print(f"[bold]stopped[/]: {escape(check.reason)}")

    def warnings(self, result: Any) -> Sequence[str]:
        """Return those of the check."""
        return _check_of(result).warnings


def _check_of(result: Any) -> Checked:
    """Return a check, or that at which a result stopped."""
    return result if isinstance(result, Checked) else result.stopped


def wrap_findings(soundness: Soundness) -> Iterator[str]:
    """Yield each finding in full, as lines: what ``--verbose`` adds."""
    for f in soundness.findings:
        where = " of ".join(part for part in (f.channel, f.run) if part) or "all runs"
        text = f"{f.severity}: {f.id} ({where}): {f.extent}; {f.effect}; {f.remedy}"
        yield from textwrap.wrap(text, 110, subsequent_indent="  ")


class CampaignView(View[Campaign, None], results=(Campaign,)):
    """A campaign: what its runs hold; its picture and its page are those of its check."""

    def tables(self, result: Campaign) -> tuple[TextTable, ...]:
        """Return the runs."""
        q = quantities(result.joint.motion)
        columns = ("run", "samples", "rate", "frequency", "largest motion", f"largest {q.moment.lower()}")
        rows = tuple(
            (
                run.name,
                str(run.n_samples),
                f"{run.sample_rate:g} {f'/{q.angle_unit} of path' if run.quasi_static else 'Hz'}",
                DASH if run.frequency is None else f"{run.frequency:g} Hz",
                f"{np.abs(run.angle).max():.3e} {q.angle_unit}",
                f"{np.abs(run.moment).max():.3g} {pretty_unit(q.moment_unit)}",
            )
            for run in result.runs
        )
        return (TextTable("runs", "Runs", columns, rows),)

    def records(self, result: Campaign) -> list[dict[str, Any]]:
        """Return the runs, numbers in SI units."""
        return [
            {
                "run": run.name,
                "samples": run.n_samples,
                "sample_rate": run.sample_rate,
                "frequency": np.nan if run.frequency is None else run.frequency,
                "level": run.level,
                "use": run.use,
                "largest_angle": float(np.abs(run.angle).max()),
                "largest_moment": float(np.abs(run.moment).max()),
            }
            for run in result.runs
        ]

    def about(self, result: Campaign) -> str:
        """Return the joint, and how many runs there are."""
        virtual = " (simulated)" if result.simulated else ""
        return f"{escape(result.joint.name)}{virtual}: {len(result.runs)} run(s)"

    def warnings(self, result: Campaign) -> tuple[str, ...]:
        """Return nothing: what stands against a campaign its check says."""
        return ()

    def details(self, result: Campaign) -> Iterator[str]:
        """Yield a line per run."""
        yield from aligned(*self.tables(result))
