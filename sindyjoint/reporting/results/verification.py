"""A verification: a model against measured response, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.judgement.headlines import judge_verification
from sindyjoint.reporting.equation import mathml
from sindyjoint.reporting.figures.kind import spread
from sindyjoint.reporting.figures.verification import KINDS, thinned
from sindyjoint.reporting.interactive import response_payload
from sindyjoint.reporting.page import markup
from sindyjoint.reporting.style import prefixed, pretty_unit, shortened
from sindyjoint.reporting.tables import model_table
from sindyjoint.reporting.text_table import (
    DASH,
    TextTable,
    aligned,
    milliseconds,
    print_whole,
    short_number,
    terminal_table,
)
from sindyjoint.reporting.view import View
from sindyjoint.response.verification import RunVerification, Verification
from sindyjoint.text import in_words_of_origin, percent, quantities, rounded, spelled
from sindyjoint.workflows.refine import RefinedModel, number_labels

if TYPE_CHECKING:
    from rich.console import Console

    from sindyjoint.trust import Trust

# Units that take a prefix; others ("mm", "kip", "inch") are printed as the campaign declares them.
PREFIXED = ("rad", "m", "N", "N*m", "V", "A")
NUMBERS = "Numbers of the model before and after the refinement, with one standard error."
SEEN = {True: "seen", False: "not seen", None: "unknown"}


def in_its_unit(run: RunVerification) -> str:
    """Return the RMS error of a run in the unit of its channel, with a prefix."""
    if run.rmse is None:
        return DASH
    factor, unit = (
        prefixed(run.rmse, run.rmse_unit) if run.rmse_unit in PREFIXED else (1.0, pretty_unit(run.rmse_unit))
    )
    return f"{short_number(run.rmse * factor)} {unit}".rstrip()


class VerificationView(View[Verification, Verification]):
    """A verification."""

    results = (Verification,)
    data = Verification
    records_key = "runs"
    kind = "Verification"
    folder = "verification"
    kinds = KINDS
    template = "verification.html.j2"
    record_file = "verification.json"
    judged_by = ("states", "response", "workflows")
    question = "What is the result?"
    # "kind" marks what the file holds.
    renamed = {"kind": "subject_kind"}  # noqa: RUF012

    def kept(self, data: Verification) -> Verification:
        """Return it with no more samples than a picture shows."""
        return thinned(data)

    def tables(self, result: Verification) -> tuple[TextTable, ...]:
        """Return the runs and the model's terms."""
        load = quantities(result.model.joint.motion).moment
        rows = tuple(
            (
                run.name,
                run.drive,
                percent(run.response_nrmse),
                in_its_unit(run),
                percent(run.noise_floor),
                percent(run.moment_nrmse),
                percent(run.amplitude_rms_error),
                milliseconds(run.mean_period_difference),
                DASH if run.drive == "pulse" else SEEN[run.seen],
            )
            for run in result.runs
        )
        columns = (
            "Run",
            "Simulated by",
            "Response error",
            "RMSE",
            "Noise floor",
            f"{load} error",
            "Amplitude",
            "Period",
            "Seen by the fit",
        )
        caption = in_words_of_origin(
            self.simulated(result), "Errors relative to the RMS of what was measured."
        )
        others = tuple(
            replace(model_table(model), name=f"terms-{number}", title=f"Coefficients of {model.joint.name}.")
            for number, model in enumerate(result.beside, 2)
        )
        return TextTable("runs", caption, columns, rows), model_table(result.model), *others

    def lead(self, result: Verification, data: Verification) -> tuple[str, int]:
        """Return the first cycles of the run with the largest error, of those that are drawn."""
        errors = [run.beyond_noise for run in spread(data.runs)]
        return "cycles", errors.index(max(errors))

    def content(self, result: Verification, data: Verification, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        passed = result.verdict == "passed"
        load = quantities(result.model.joint.motion).moment
        return {
            "title": f"{result.model.joint.name} against {result.subject}",
            "headline": in_words_of_origin(
                self.simulated(result),
                f"The model {'gives the measured' if passed else 'misses the'} response.",
            ),
            "facts": [
                (
                    "Response error",
                    percent(result.response_nrmse),
                    f"noise floor {percent(result.noise_floor)}",
                ),
                ("Tolerated", percent(result.tolerance), "beyond the noise"),
                (f"{load} error", percent(result.moment_nrmse), "relative RMS"),
                (
                    "Amplitude",
                    percent(result.amplitude_rms_error),
                    "RMS difference, of the first amplitude",
                ),
                ("Period", milliseconds(result.mean_period_difference), "mean difference"),
            ],
            "failures": [f"{run.name}: {run.failure}." for run in result.runs if run.failure],
            "equations": [markup(mathml(model)) for model in (result.model, *result.beside)],
            "payload": {"loops": response_payload(result.runs, self.simulated(result))},
        }

    def files(self, result: Verification, data: Verification) -> dict[str, str]:
        """Return the models."""
        others = {f"model-{n}.json": each.to_json() + "\n" for n, each in enumerate(result.beside, 2)}
        return {"model.json": result.model.to_json() + "\n", **others}

    def headline(self, result: Verification) -> Trust:
        """Return whether the model gives the response."""
        return result.trust or judge_verification(result, self.simulated(result), None)

    def about(self, result: Verification) -> str:
        """Return what is compared with what, and the verdict."""
        from rich.markup import escape

        where = "the rig" if result.kind == "rig" else "the runs of"
        virtual = " (simulated, not measured)" if self.simulated(result) else ""
        compared = f"{escape(result.model.joint.name)} against {where} {escape(result.subject)}{virtual}"
        return f"{compared}: [bold]{result.verdict}[/]"

    def show_result(self, result: Verification, console: Console) -> None:
        """Print equation, figures and warnings."""
        from rich.markup import escape

        # The rates of internal states stand below.
        lines = [line for model in (result.model, *result.beside) for line in model.equation().split("; ")]
        console.print("\n".join(f"  {escape(line)}" for line in lines) + "\n")
        load = quantities(result.model.joint.motion).moment.lower()
        columns = (
            "run", "simulated by", "response NRMSE", "RMSE", "noise", f"{load} NRMSE", "amplitude", "period",
            "seen by fit",
        )  # fmt: skip
        rows = [(shortened(name), *others) for name, *others in self.tables(result)[0].rows]
        print_whole(terminal_table(columns, rows, "llr"), console)
        console.print(f"\n{escape(result.reason)}")
        for warning in result.warnings:
            console.print(f"- {escape(warning)}")

    def details(self, result: Verification) -> Iterator[str]:
        """Yield how each run was simulated and judged."""
        rows = [
            (
                "run",
                "simulated by",
                "samples",
                "error",
                "noise",
                "beyond noise",
                "tolerated",
                "band drawn",
                "failed",
            )
        ]
        for run in result.runs:
            rows.append(
                (
                    run.name,
                    run.drive,
                    str(run.measured.size),
                    short_number(run.response_nrmse),
                    short_number(run.noise_floor),
                    short_number(run.beyond_noise),
                    f"{result.tolerance:g}",
                    DASH if run.band is None else str(run.band.draws),
                    DASH if run.band is None else str(run.band.failed),
                )
            )
        yield from aligned(rows)


class RefinementView(VerificationView):
    """A model refined on a campaign: its numbers before and after, and what a verification shows."""

    results = (RefinedModel,)
    folder = "refinement"

    def tables(self, result: Verification) -> tuple[TextTable, ...]:
        """Return the numbers before and after in addition to runs and terms."""
        tables = super().tables(result)
        if not isinstance(result, RefinedModel) or result.before is None:
            return tables
        old, new = result.before, result.model
        rows = tuple(
            (spelled(name), rounded(a, b), rounded(c, d), pretty_unit(unit))
            for (name, unit), a, b, c, d in zip(
                number_labels(new),
                old.numbers,
                old.number_errors,
                new.numbers,
                new.number_errors,
                strict=True,
            )
        )
        return *tables, TextTable("numbers", NUMBERS, ("Number", "Before", "After", "Unit"), rows)

    def show_result(self, result: Verification, console: Console) -> None:
        """Print the numbers before and after, then what a verification prints."""
        print_whole(
            terminal_table(("number", "before", "after", "unit"), self.tables(result)[-1].rows, "lrrl"),
            console,
        )
        console.print("")
        super().show_result(result, console)
