"""A verification: response, decay and energy of each run, on a terminal, as pictures, as a page, as files."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from sindyjoint.judgement.headlines import judge_verification
from sindyjoint.reporting.equation import model_table
from sindyjoint.reporting.figure import (
    Curve,
    Kind,
    Panel,
    Scale,
    by_name,
    plot,
    scaled,
    short_numbers,
    spread,
    time_label,
)
from sindyjoint.reporting.mathml import mathml
from sindyjoint.reporting.page import Blocks, Page, capital, markup, section
from sindyjoint.reporting.style import INK, MUTED, PALETTE, Axes, amount, plain, pretty_unit, shortened
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    escape,
    milliseconds,
    short_number,
    tabulate,
)
from sindyjoint.reporting.view import View
from sindyjoint.response.oscillations import hilbert_envelope
from sindyjoint.response.verification import RunVerification, Verification
from sindyjoint.text import in_words_of_origin, percent, quantities, rounded, spelled
from sindyjoint.trust import Trust
from sindyjoint.workflows.verify import RefinedModel

T = TypeVar("T")
CYCLES_SHOWN = 6
UNITS = {
    "angle": "rad", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2", "moment": "N*m", "force": "N",
}  # fmt: skip
# More samples of a response than these no picture shows, and no screen.
KEPT_SAMPLES, RESPONSE_SAMPLES = 6000, 3000
MEASURED: Any = {"color": PALETTE[0], "label": "measured"}
SIMULATED: Any = {"color": INK, "label": "simulated"}
MARKS: Any = {"ls": "none", "ms": 2.5}


def thinned(result: Verification) -> Verification:
    """Return a verification with no more samples than a picture shows."""
    runs = (
        replace(
            every(run, run.time.size, "time", "measured", "simulated"),
            band=run.band and every(run.band, run.time.size, "low", "high"),
        )
        for run in result.runs
    )
    return replace(result, runs=tuple(runs))


def every(record: T, size: int, *names: str) -> T:
    """Return a record whose fields of so many samples, those that it has, hold no more than a picture shows."""
    known = {name: values for name in names if (values := getattr(record, name)) is not None}
    step = -(-size // KEPT_SAMPLES)
    return replace(record, **{name: values[::step] for name, values in known.items()})  # type: ignore[type-var]


def _scale(run: RunVerification, name: str = "") -> Scale:
    return scaled(name or run.channel.capitalize(), run.measured, UNITS[run.channel])


def _time(run: RunVerification) -> str:
    return time_label(run.drive == "path", "translation" if run.channel == "force" else "rotation")


def response(run: RunVerification, ax: Axes, zoom: bool = False) -> None:
    """Draw measured and simulated response over time; zoomed, only the first cycles."""
    kept = slice(_first_cycles(run) if zoom else None)
    time = run.time[kept]
    curves: list[Curve] = [(time, run.measured[kept], MEASURED | {"lw": 1.6})]
    if run.simulated is not None:
        curves.append((time, run.simulated[kept], SIMULATED | {"lw": 0.8, "ls": (0, (4, 1.5))}))
    if run.band is not None:
        look = {"color": PALETTE[1], "alpha": 0.35, "lw": 0, "label": "95 % of the model"}
        ends = run.band.low[kept], run.band.high[kept]
        curves.append((time, ends, look | {"rasterized": time.size > 4000}))
    title, legend = ("", "above") if zoom else (run.name, "none")
    plot(ax, _time(run), _scale(run), curves, title, legend=legend, columns=2)


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
        curves += [
            {
                "label": label,
                "run": f"{run.name}, {label}",
                "group": run.name,
                "x": short_numbers(run.time[::step]),
                "y": short_numbers(signal[::step] * scale.factor),
                "model": [],
                "axis": scale.to_dict(),
            }
            for label, signal in signals.items()
            if signal is not None
        ]
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


def amplitude(run: RunVerification, ax: Axes) -> None:
    """Draw the amplitude of each half-cycle, as a mark, and the envelope by Hilbert's transform as a line."""
    # At either end the transform extrapolates: over one period here, over two of the period.
    curves = _by_half_cycle(run, 1, lambda s: (s.amplitude_time, s.amplitude), lambda height, _: height)
    plot(ax, _time(run), _scale(run, "Amplitude"), curves, columns=2, yscale="log")


def period(run: RunVerification, ax: Axes) -> None:
    """Draw the period from each turning point to the next but one as a mark, and Hilbert's as a line."""
    curves = _by_half_cycle(run, 2, lambda s: (s.time[1:-1], 1e3 * s.period), lambda _, f: 1e3 / f)
    plot(ax, _time(run), "Period (ms)", curves, columns=2)


def _by_half_cycle(
    run: RunVerification,
    cut: int,
    marks: Callable[[Any], tuple[Any, Any]],
    line: Callable[[Any, Any], Any],
) -> list[Curve]:
    """Return values by half-cycle as marks, and those of Hilbert's transform as a line, its ends cut off."""
    rate, curves = 1 / (run.time[1] - run.time[0]), []
    looks = MEASURED | MARKS | {"marker": "o"}, SIMULATED | MARKS | {"marker": "x"}
    for oscillation, signal, look in zip(run.oscillations, (run.measured, run.simulated), looks, strict=True):
        if oscillation is not None and signal is not None:
            time, values = marks(oscillation)
            kept = slice(*(cut * int(float(np.median(oscillation.period)) * rate) * side for side in (1, -1)))
            curves.append((time + run.time[0], values, look))
            course = line(*hilbert_envelope(signal, rate))[kept]
            curves.append((run.time[kept], course, {"color": look["color"], "lw": 0.7}))
    return curves


def error(run: RunVerification, ax: Axes) -> None:
    """Draw the residual, simulation less measurement."""
    assert run.simulated is not None
    residual = run.simulated - run.measured
    curve = run.time, residual, {"color": MUTED, "lw": 0.4, "rasterized": residual.size > 4000}
    plot(ax, _time(run), scaled("Simulated − measured", residual, UNITS[run.channel]), [curve])


def energy(run: RunVerification, ax: Axes) -> None:
    """Draw the energy dissipated in each cycle."""
    assert run.energy is not None
    known = run.energy > 1e-4 * float(np.abs(run.energy).max())
    looks = MEASURED | MARKS | {"marker": "o"}, SIMULATED | MARKS | {"marker": "x"}
    curves = [
        (np.flatnonzero(seen) + 1, values[seen], look)
        for values, seen, look in zip(run.energy, known, looks, strict=True)
    ]
    wide = known.any() and run.energy[known].max() > 5 * run.energy[known].min()
    up = scaled("Dissipated per cycle", run.energy, "J")
    plot(ax, "Cycle", up, curves, columns=2, yscale="log" if wide else "linear")


def _of_runs(draw: Callable[[Any, Axes], None], has: Callable[[Any], object]) -> Callable[[Any], list[Panel]]:
    """Return panels that draw one run each, named where there are several."""

    def panel(result: Any, ax: Axes, run: Any) -> None:
        draw(run, ax)
        if len(result.runs) > 1:
            ax.set_title(plain(shortened(run.name)))

    return lambda result: [
        partial(panel, run=run) for run in spread([run for run in result.runs if has(run)])
    ]


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
SEEN = {True: "seen", False: "not seen", None: "unknown"}


def in_its_unit(run: RunVerification) -> str:
    """Return the RMS error of a run in the unit of its channel, with a prefix."""
    if run.rmse is None:
        return DASH
    if run.rmse_unit in PREFIXED:
        return amount(run.rmse, run.rmse_unit, 4)
    return f"{short_number(run.rmse)} {pretty_unit(run.rmse_unit)}".rstrip()


def _tables(result: Verification) -> tuple[TextTable, ...]:
    """Return the runs and the models' terms."""
    load = quantities(result.model.joint.motion).moment
    return (
        tabulate(
            "runs",
            in_words_of_origin(
                VERIFICATION.simulated(result), "Errors relative to the RMS of what was measured."
            ),
            result.runs,
            {
                "Run": lambda run: run.name,
                "Simulated by": lambda run: run.drive,
                "Response error": lambda run: percent(run.response_nrmse),
                "RMSE": in_its_unit,
                "Noise floor": lambda run: percent(run.noise_floor),
                f"{load} error": lambda run: percent(run.moment_nrmse),
                "Amplitude": lambda run: percent(run.amplitude_rms_error),
                "Period": lambda run: milliseconds(run.mean_period_difference),
                "Seen by the fit": lambda run: DASH if run.drive == "pulse" else SEEN[run.seen],
            },
        ),
        model_table(result.model),
        *(
            replace(model_table(model), name=f"terms-{place}", title=f"Coefficients of {model.joint.name}.")
            for place, model in enumerate(result.beside, 2)
        ),
    )


def _trust(result: Verification) -> Trust:
    """Return whether the model gives the response."""
    return result.trust or judge_verification(result, VERIFICATION.simulated(result), None)


def _page(
    tables: Callable[[Any], tuple[TextTable, ...]],
    result: Verification,
    data: Verification,
    show: Blocks,
) -> Page:
    """Return verdict and equations, runs, responses, decay, models."""
    passed, virtual = result.verdict == "passed", VERIFICATION.simulated(result)
    load = quantities(result.model.joint.motion).moment
    errors = [run.beyond_noise for run in spread(data.runs)]
    caption = VERIFICATION.figures(data)["cycles"].caption
    if len(result.runs) > 1:
        caption = f"Worst of the runs: {caption[:1].lower()}{caption[1:]}"
    said = f"The model {'gives the measured' if passed else 'misses the'} response."
    facts = [
        (name, shown(value), of)
        for name, value, shown, of in (
            (f"{load} error", result.moment_nrmse, percent, "relative RMS"),
            ("Amplitude", result.amplitude_rms_error, percent, "RMS difference, of the first amplitude"),
            ("Period", result.mean_period_difference, milliseconds, "mean difference"),
        )
        if value is not None
    ]
    runs, *others = tables(result)
    seen = "virtual test" if virtual else "measured"
    return Page(
        f"{result.model.joint.name} against {result.subject}",
        f"Model against {'rig' if result.kind == 'rig' else 'runs'}: {result.subject}",
        result.model.joint.name,
        show.hero("cycles", errors.index(max(errors)), caption),
        (
            show.verdict(
                in_words_of_origin(virtual, said), "confirmed" if passed else "refuted", result.verdict
            ),
            *(show.equation(markup(mathml(model))) for model in (result.model, *result.beside)),
        ),
        (show.facts(facts), show.warnings(_warnings(result))),
        (
            section(
                "runs",
                "Runs",
                "Runs",
                show.table(runs),
                show.items([f"{run.name}: {run.failure}." for run in result.runs if run.failure]),
            ),
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
            section("model", "The model", "Model", *map(show.table, others)),
        ),
        {"loops": response_payload(result.runs, virtual)},
    )


def _about(result: Verification) -> str:
    """Return what is compared with what, and the verdict."""
    where = "the rig" if result.kind == "rig" else "the runs of"
    virtual = " (simulated, not measured)" if VERIFICATION.simulated(result) else ""
    compared = f"{escape(result.model.joint.name)} against {where} {escape(result.subject)}{virtual}"
    return f"{compared}: [bold]{result.verdict}[/]"


def _printed(result: Verification, console: Console) -> list[Any]:
    """Return equation and figures."""
    # The rates of internal states stand below.
    lines = [line for model in (result.model, *result.beside) for line in model.equation().split("; ")]
    runs = _tables(result)[0]
    rows = tuple((shortened(name), *others) for name, *others in runs.rows)
    equation = "\n".join(f"  {escape(line)}" for line in lines)
    return [f"{equation}\n", replace(runs, rows=rows).headed(), f"\n{escape(result.reason)}"]


def _warnings(result: Verification) -> list[str]:
    """Return those that no light above them holds."""
    held = "".join(light.sentence for light in _trust(result).question)
    return [text for text in result.warnings if text not in held]


_DETAILS: dict[str, Callable[[RunVerification], str]] = {
    "run": lambda run: run.name,
    "simulated by": lambda run: run.drive,
    "samples": lambda run: str(run.measured.size),
    "error": lambda run: short_number(run.response_nrmse),
    "noise": lambda run: short_number(run.noise_floor),
    "beyond noise": lambda run: short_number(run.beyond_noise),
    "band drawn": lambda run: DASH if run.band is None else str(run.band.draws),
    "failed": lambda run: DASH if run.band is None else str(run.band.failed),
}
VERIFICATION = View(
    about=_about,
    data=Verification,
    rows="runs",
    kind="Verification",
    folder="verification",
    kinds=KINDS,
    record_file="verification.json",
    judged_by=lambda result: ("states", "response"),
    question="What is the result?",
    renamed={"kind": "subject_kind"},
    kept=thinned,
    headline=_trust,
    tables=_tables,
    page=partial(_page, _tables),
    files=lambda result, data: {
        f"model{f'-{place}' * (place > 1)}.json": model.to_json() + "\n"
        for place, model in enumerate((result.model, *result.beside), 1)
    },
    printed=_printed,
    warnings=_warnings,
    details=lambda result: aligned(
        tabulate("runs", "", result.runs, _DETAILS | {"tolerated": lambda run: f"{result.tolerance:g}"})
    ),
)


def _with_numbers(result: Verification) -> tuple[TextTable, ...]:
    """Return the numbers before and after in addition to runs and terms."""
    if not isinstance(result, RefinedModel) or result.before is None:
        return _tables(result)
    return *_tables(result), tabulate(
        "numbers",
        "Numbers of the model before and after the refinement, with one standard error.",
        result.numbers,
        {
            "Number": lambda each: spelled(each.number),
            "Before": lambda each: rounded(*each.before),
            "After": lambda each: rounded(*each.after),
            "Unit": lambda each: pretty_unit(each.unit),
        },
    )


#: A model refined on a campaign: its numbers before and after, and what a verification shows.
REFINEMENT = replace(
    VERIFICATION,
    folder="refinement",
    tables=_with_numbers,
    page=partial(_page, _with_numbers),
    # The numbers before and after, then what a verification prints.
    printed=lambda result, console: (_with_numbers(result)[-1].headed(), "", *_printed(result, console)),
)
