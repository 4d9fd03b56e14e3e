"""A verification: a model against measured response, on a terminal, as pictures, as a page, as files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from rich.markup import escape

from sindyjoint.judgement.headlines import judge_verification
from sindyjoint.reporting.equation import mathml, model_table
from sindyjoint.reporting.figure import (
    spread,
)
from sindyjoint.reporting.page import Blocks, Page, capital, markup, section
from sindyjoint.reporting.results.verification_pictures import KINDS, response_payload, thinned
from sindyjoint.reporting.style import (
    prefixed,
    pretty_unit,
    shortened,
)
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    milliseconds,
    print_table,
    short_number,
    tabulate,
)
from sindyjoint.reporting.view import View
from sindyjoint.response.verification import RunVerification, Verification
from sindyjoint.text import in_words_of_origin, percent, quantities, rounded, spelled
from sindyjoint.trust import Trust
from sindyjoint.workflows.refine import RefinedModel, number_labels

# Units that take a prefix; others ("mm", "kip", "inch") are printed as the campaign declares them.
PREFIXED = ("rad", "m", "N", "N*m", "V", "A")
NUMBERS = "Numbers of the model before and after the refinement, with one standard error."
SEEN = {True: "seen", False: "not seen", None: "unknown"}


def in_its_unit(run: RunVerification) -> str:
    """Return the RMS error of a run in the unit of its channel, with a prefix."""
    if run.rmse is None:
        return DASH
    whole = 1.0, pretty_unit(run.rmse_unit)
    factor, unit = prefixed(run.rmse, run.rmse_unit) if run.rmse_unit in PREFIXED else whole
    return f"{short_number(run.rmse * factor)} {unit}".rstrip()


class VerificationView(
    View[Verification, Verification],
    results=(Verification,),
    data=Verification,
    records_key="runs",
    kind="Verification",
    folder="verification",
    kinds=KINDS,
    record_file="verification.json",
    judged_by=("states", "response", "workflows"),
    question="What is the result?",
    renamed={"kind": "subject_kind"},
):
    """A verification."""

    def kept(self, data: Verification) -> Verification:
        """Return it with no more samples than a picture shows."""
        return thinned(data)

    def tables(self, result: Verification) -> tuple[TextTable, ...]:
        """Return the runs and the models' terms."""
        load = quantities(result.model.joint.motion).moment
        columns: dict[str, Callable[[RunVerification], str]] = {
            "Run": lambda run: run.name,
            "Simulated by": lambda run: run.drive,
            "Response error": lambda run: percent(run.response_nrmse),
            "RMSE": in_its_unit,
            "Noise floor": lambda run: percent(run.noise_floor),
            f"{load} error": lambda run: percent(run.moment_nrmse),
            "Amplitude": lambda run: percent(run.amplitude_rms_error),
            "Period": lambda run: milliseconds(run.mean_period_difference),
            "Seen by the fit": lambda run: DASH if run.drive == "pulse" else SEEN[run.seen],
        }
        what = "Errors relative to the RMS of what was measured."
        caption = in_words_of_origin(self.simulated(result), what)
        others = tuple(
            replace(model_table(model), name=f"terms-{number}", title=f"Coefficients of {model.joint.name}.")
            for number, model in enumerate(result.beside, 2)
        )
        return tabulate("runs", caption, result.runs, columns), model_table(result.model), *others

    def page(self, result: Verification, data: Verification, show: Blocks, folder: Path | None) -> Page:
        """Return verdict and equations, runs, responses, decay, models."""
        passed, virtual = result.verdict == "passed", self.simulated(result)
        load = quantities(result.model.joint.motion).moment
        errors = [run.beyond_noise for run in spread(data.runs)]
        caption = self.figures(data)["cycles"].caption
        if len(result.runs) > 1:
            caption = f"Worst of the runs: {caption[:1].lower()}{caption[1:]}"
        said = f"The model {'gives the measured' if passed else 'misses the'} response."
        badge = "confirmed" if passed else "refuted"
        models = (result.model, *result.beside)
        found = (
            show.verdict(in_words_of_origin(virtual, said), badge, result.verdict),
            *(show.equation(markup(mathml(model))) for model in models),
        )
        facts = [
            (f"{load} error", percent(result.moment_nrmse), "relative RMS"),
            ("Amplitude", percent(result.amplitude_rms_error), "RMS difference, of the first amplitude"),
            ("Period", milliseconds(result.mean_period_difference), "mean difference"),
        ]
        runs, *others = self.tables(result)
        failures = [f"{run.name}: {run.failure}." for run in result.runs if run.failure]
        seen = "virtual test" if virtual else "measured"
        hero = self.hero(show, data, "cycles", errors.index(max(errors)), caption)
        return Page(
            f"{result.model.joint.name} against {result.subject}",
            f"Model against {'rig' if result.kind == 'rig' else 'runs'}: {result.subject}",
            result.model.joint.name,
            (
                show.answers(self.headline(result), self.question, hero, found),
                show.facts(facts),
                show.warnings(self.warnings(result)),
            ),
            (
                section("runs", "Runs", "Runs", show.table(runs), show.items(failures)),
                section(
                    "response",
                    f"Simulated over {'the virtual test' if virtual else 'measured'}",
                    "Response",
                    show.curves(f"{capital(seen)} and simulated response over time"),
                    show.pictures("response", "cycles", "error"),
                ),
                section(
                    "decay",
                    "Amplitude, period and energy",
                    "Decay",
                    show.pictures("envelope", "period", "energy"),
                ),
                section("model", "The model", "Model", *list(map(show.table, others))),
            ),
            {"loops": response_payload(result.runs, virtual)},
        )

    def files(self, result: Verification, data: Verification) -> dict[str, str]:
        """Return the models."""
        others = {f"model-{n}.json": each.to_json() + "\n" for n, each in enumerate(result.beside, 2)}
        return {"model.json": result.model.to_json() + "\n", **others}

    def headline(self, result: Verification) -> Trust:
        """Return whether the model gives the response."""
        return result.trust or judge_verification(result, self.simulated(result), None)

    def about(self, result: Verification) -> str:
        """Return what is compared with what, and the verdict."""
        where = "the rig" if result.kind == "rig" else "the runs of"
        virtual = " (simulated, not measured)" if self.simulated(result) else ""
        compared = f"{escape(result.model.joint.name)} against {where} {escape(result.subject)}{virtual}"
        return f"{compared}: [bold]{result.verdict}[/]"

    def show_result(self, result: Verification, console: Console) -> None:
        """Print equation and figures."""
        # The rates of internal states stand below.
        lines = [line for model in (result.model, *result.beside) for line in model.equation().split("; ")]
        console.print("\n".join(f"  {escape(line)}" for line in lines) + "\n")
        runs = self.tables(result)[0]
        rows = tuple((shortened(name), *others) for name, *others in runs.rows)
        print_table(replace(runs, rows=rows).headed(), console, "llr")
        console.print(f"\n{escape(result.reason)}")

    def warnings(self, result: Verification) -> list[str]:
        """Return those that no light above them holds."""
        held = "".join(light.sentence for light in self.headline(result).question)
        return [text for text in result.warnings if text not in held]

    def details(self, result: Verification) -> Iterator[str]:
        """Yield how each run was simulated and judged."""
        columns: dict[str, Callable[[RunVerification], str]] = {
            "run": lambda run: run.name,
            "simulated by": lambda run: run.drive,
            "samples": lambda run: str(run.measured.size),
            "error": lambda run: short_number(run.response_nrmse),
            "noise": lambda run: short_number(run.noise_floor),
            "beyond noise": lambda run: short_number(run.beyond_noise),
            "tolerated": lambda run: f"{result.tolerance:g}",
            "band drawn": lambda run: DASH if run.band is None else str(run.band.draws),
            "failed": lambda run: DASH if run.band is None else str(run.band.failed),
        }
        yield from aligned(tabulate("runs", "", result.runs, columns))


class RefinementView(VerificationView, results=(RefinedModel,), folder="refinement"):
    """A model refined on a campaign: its numbers before and after, and what a verification shows."""

    def tables(self, result: Verification) -> tuple[TextTable, ...]:
        """Return the numbers before and after in addition to runs and terms."""
        tables = super().tables(result)
        if not isinstance(result, RefinedModel) or result.before is None:
            return tables
        old, new = result.before, result.model
        numbers = zip(
            number_labels(new), old.numbers, old.number_errors, new.numbers, new.number_errors, strict=True
        )
        rows = tuple(
            (spelled(name), rounded(a, b), rounded(c, d), pretty_unit(unit))
            for (name, unit), a, b, c, d in numbers
        )
        return *tables, TextTable("numbers", NUMBERS, ("Number", "Before", "After", "Unit"), rows)

    def show_result(self, result: Verification, console: Console) -> None:
        """Print the numbers before and after, then what a verification prints."""
        print_table(self.tables(result)[-1].headed(), console, "lrrl")
        console.print("")
        super().show_result(result, console)
