"""A verification: response, decay and energy of each run, on a terminal, as pictures, as a page, as files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from sindyjoint.judgement.headlines import judge_verification
from sindyjoint.reporting.equation import model_table
from sindyjoint.reporting.figure import (
    Axes,
    Kind,
    Panel,
    Scale,
    by_name,
    scaled,
    short_numbers,
    spread,
    time_label,
)
from sindyjoint.reporting.mathml import mathml
from sindyjoint.reporting.page import Blocks, Page, capital, markup, section
from sindyjoint.reporting.style import (
    INK,
    MUTED,
    PALETTE,
    legend_above,
    plain,
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
from sindyjoint.response.oscillations import hilbert_envelope
from sindyjoint.response.verification import Band, RunVerification, Verification
from sindyjoint.text import in_words_of_origin, percent, quantities, rounded, spelled
from sindyjoint.trust import Trust
from sindyjoint.workflows.refine import RefinedModel, number_labels

CYCLES_SHOWN = 6
UNITS = {
    "angle": "rad", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2", "moment": "N*m", "force": "N",
}  # fmt: skip
# More samples of a response than these no picture shows, and no screen.
KEPT_SAMPLES, RESPONSE_SAMPLES = 6000, 3000


def thinned(result: Verification) -> Verification:
    """Return a verification with no more samples than a picture shows."""
    return replace(result, runs=tuple(_thinned(run) for run in result.runs))


def _thinned(run: RunVerification) -> RunVerification:
    step = -(-run.time.size // KEPT_SAMPLES)
    band = run.band and Band(run.band.low[::step], run.band.high[::step], run.band.draws, run.band.failed)
    simulated = None if run.simulated is None else run.simulated[::step]
    return replace(run, time=run.time[::step], measured=run.measured[::step], simulated=simulated, band=band)


def _scale(run: RunVerification, name: str = "") -> Scale:
    return scaled(name or run.channel.capitalize(), run.measured, UNITS[run.channel])


def _time(run: RunVerification) -> str:
    return time_label(run.drive == "path", "translation" if run.channel == "force" else "rotation")


def response(run: RunVerification, ax: Axes, zoom: bool = False) -> Axes:
    """Draw measured and simulated response over time; zoomed, only the first cycles."""
    scale, kept = _scale(run), slice(_first_cycles(run) if zoom else None)
    time = run.time[kept]
    ax.plot(time, run.measured[kept] * scale.factor, color=PALETTE[0], lw=1.6, label="measured")
    if run.simulated is not None:
        look: Any = {"color": INK, "lw": 0.8, "ls": (0, (4, 1.5)), "label": "simulated"}
        ax.plot(time, run.simulated[kept] * scale.factor, **look)
    if run.band is not None:
        ax.fill_between(
            time, run.band.low[kept] * scale.factor, run.band.high[kept] * scale.factor, color=PALETTE[1],
            alpha=0.35, lw=0, label="95 % of the model", rasterized=time.size > 4000,
        )  # fmt: skip
    ax.set(xlabel=_time(run), ylabel=scale.label)
    if zoom:
        legend_above(ax, 2, columns=2)
    else:
        ax.set_title(plain(shortened(run.name)))
    return ax


def _first_cycles(run: RunVerification) -> int:
    oscillation = run.oscillations[0]
    if oscillation is None:
        return max(2, run.time.size // 10)
    rate = 1 / (run.time[1] - run.time[0])
    return min(run.time.size, int(CYCLES_SHOWN * float(np.median(oscillation.period)) * rate))


def response_payload(runs: Sequence[RunVerification], virtual: bool = False) -> dict[str, Any]:
    """Return the response over time, of the runs (of a virtual test) and as simulated, for zooming, run by run."""
    curves = []
    for run in runs:
        scale, step = _scale(run), -(-run.time.size // RESPONSE_SAMPLES)
        signals = {"virtual test" if virtual else "measured": run.measured, "simulated": run.simulated}
        for label, signal in signals.items():
            if signal is not None:
                curves.append(
                    {
                        "label": label,
                        "run": f"{run.name}, {label}",
                        "group": run.name,
                        "x": short_numbers(run.time[::step]),
                        "y": short_numbers(signal[::step] * scale.factor),
                        "model": [],
                        "axis": scale.to_dict(),
                    }
                )
    path = bool(runs) and runs[0].drive == "path"
    length = "m" if path and runs[0].channel == "force" else "rad"
    across = Scale("Travelled path", length, symbol="s") if path else Scale("Time", "s", symbol="t")
    return {
        "x": across.to_dict(),
        "y": Scale("Response", "").to_dict(),
        "palette": (PALETTE[0], PALETTE[1], INK),
        "each": True,
        "runs": curves,
    }


def amplitude(run: RunVerification, ax: Axes) -> Axes:
    """Draw the amplitude of each half-cycle, as a mark, and the envelope by Hilbert's transform as a line."""
    scale = _scale(run, "Amplitude")
    # At either end the transform extrapolates: over one period here, over two below.
    _draw_by_half_cycle(
        run,
        ax,
        1,
        lambda s: (s.amplitude_time, s.amplitude * scale.factor),
        lambda height, _: height * scale.factor,
    )
    ax.set(yscale="log", ylabel=scale.label)
    legend_above(ax, 1, columns=2)
    return ax


def period(run: RunVerification, ax: Axes) -> Axes:
    """Draw the period from each turning point to the next but one as a mark, and Hilbert's as a line."""
    _draw_by_half_cycle(
        run, ax, 2, lambda s: (s.time[1:-1], 1e3 * s.period), lambda _, frequency: 1e3 / frequency
    )
    ax.set_ylabel("Period (ms)")
    legend_above(ax, 1, columns=2)
    return ax


def _draw_by_half_cycle(
    run: RunVerification,
    ax: Axes,
    cut: int,
    marks: Callable[[Any], tuple[Any, Any]],
    line: Callable[[Any, Any], Any],
) -> None:
    """Draw values by half-cycle as marks, and those of Hilbert's transform as a line, its ends cut off."""
    rate = 1 / (run.time[1] - run.time[0])
    signals = zip(("measured", "simulated"), run.oscillations, (run.measured, run.simulated), strict=True)
    for (label, oscillation, signal), color, marker in zip(signals, (PALETTE[0], INK), "ox", strict=True):
        if oscillation is not None and signal is not None:
            time, values = marks(oscillation)
            ax.plot(time + run.time[0], values, color=color, ls="none", marker=marker, ms=2.5, label=label)
            kept = slice(*(cut * int(float(np.median(oscillation.period)) * rate) * side for side in (1, -1)))
            ax.plot(run.time[kept], line(*hilbert_envelope(signal, rate))[kept], color=color, lw=0.7)
    ax.set_xlabel(_time(run))


def error(run: RunVerification, ax: Axes) -> Axes:
    """Draw the residual, simulation less measurement."""
    assert run.simulated is not None
    residual = run.simulated - run.measured
    scale = scaled("Simulated − measured", residual, UNITS[run.channel])
    ax.plot(run.time, residual * scale.factor, color=MUTED, lw=0.4, rasterized=residual.size > 4000)
    ax.set(ylabel=scale.label, xlabel=_time(run))
    return ax


def energy(run: RunVerification, ax: Axes) -> Axes:
    """Draw the energy dissipated in each cycle."""
    assert run.energy is not None
    scale = scaled("Dissipated per cycle", run.energy, "J")
    known = run.energy > 1e-4 * float(np.abs(run.energy).max())
    cycles = np.arange(1, run.energy.shape[1] + 1)
    looks = (PALETTE[0], "o", "measured"), (INK, "x", "simulated")
    for values, seen, (color, marker, label) in zip(run.energy, known, looks, strict=True):
        shown = values[seen] * scale.factor
        ax.plot(cycles[seen], shown, color=color, ls="none", marker=marker, ms=2.5, label=label)
    if known.any() and run.energy[known].max() > 5 * run.energy[known].min():
        ax.set_yscale("log")
    ax.set(ylabel=scale.label, xlabel="Cycle")
    legend_above(ax, 1, columns=2)
    return ax


def _of_runs(draw: Callable[[Any, Axes], Axes], has: Callable[[Any], bool]) -> Callable[[Any], list[Panel]]:
    """Return panels that draw one run each."""

    def panels(result: Any) -> list[Panel]:
        shown = spread([run for run in result.runs if has(run)])
        return [partial(_of_run, draw=draw, run=run, named=len(result.runs) > 1) for run in shown]

    return panels


def _of_run(result: Any, ax: Axes, draw: Callable[[Any, Axes], Axes], run: Any, named: bool) -> Axes:
    draw(run, ax)
    if named:
        ax.set_title(plain(shortened(run.name)))
    return ax


KINDS = by_name(
    Kind(
        "response",
        "Response",
        "Measured and simulated response over time, with the band that the uncertainty of the coefficients allows.",
        _of_runs(response, lambda run: True),
        wide=True,
    ),
    Kind(
        "cycles",
        "First cycles",
        "The first cycles of the measured and the simulated response.",
        _of_runs(partial(response, zoom=True), lambda run: True),
    ),
    Kind(
        "envelope",
        "Envelope",
        "Amplitude of every half-cycle, measured and simulated, with the envelope by Hilbert's transform.",
        _of_runs(amplitude, lambda run: any(run.oscillations)),
    ),
    Kind(
        "period",
        "Period",
        "Period of every cycle, measured and simulated.",
        _of_runs(period, lambda run: any(run.oscillations)),
    ),
    Kind(
        "error",
        "Error",
        "Simulated less measured response over time.",
        _of_runs(error, lambda run: run.simulated is not None),
        wide=True,
    ),
    Kind(
        "energy",
        "Energy",
        "Energy dissipated in every cycle, measured and simulated.",
        _of_runs(energy, lambda run: run.energy is not None),
    ),
)


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


class RefinementView(VerificationView, folder="refinement"):
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
