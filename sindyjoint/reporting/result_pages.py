"""The report pages of a verification and of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.reporting.diagnosis import advice_words, level_unit, parameter_unit
from sindyjoint.reporting.equation import effect_mathml, mathml
from sindyjoint.reporting.figures import kinds_of
from sindyjoint.reporting.page import inline_svg, markup, number, render
from sindyjoint.reporting.provenance import Provenance
from sindyjoint.reporting.style import INK, PALETTE, prefixed
from sindyjoint.reporting.tables import term_rows
from sindyjoint.reporting.units import quantities
from sindyjoint.text import percent, spelled

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Diagnosis, Gap
    from sindyjoint.response.verification import RunVerification, Verification

CHANNEL_UNITS = {"angle": "rad", "displacement": "m", "moment": "N*m", "force": "N"}
# What a screen shows of one curve.
DRAWN_SAMPLES = 3000

VERDICTS = {
    "named": ("confirmed", "What was missing has a name, and the gap shrank when it was added."),
    "ambiguous": (
        "undecided",
        "Something is missing, and these runs do not tell which of several effects it is.",
    ),
    "unknown": ("refuted", "Something is missing that none of the known effects explains."),
    "nothing_missing": ("confirmed", "Nothing is missing: what is left is noise."),
}


def verification_page(result: Verification, origin: Provenance, pictures: dict[str, bytes]) -> str:
    """Return the report of a verification as one HTML text."""
    return render(
        "verification.html.j2",
        title=f"{result.model.joint.name} against {result.subject}",
        origin=origin,
        result=result,
        headline=(
            "The model gives the measured response."
            if result.verdict == "passed"
            else "The model misses the response."
        ),
        facts=[
            ("Response error", percent(result.response_nrmse), f"noise floor {percent(result.noise_floor)}"),
            ("Tolerated", percent(result.tolerance), "beyond the noise"),
            ("Moment error", percent(result.moment_nrmse), "relative RMS"),
            ("Amplitude", percent(result.amplitude_rms_error), "RMS difference, of the first amplitude"),
            ("Period", milliseconds(result.mean_period_difference), "mean difference"),
        ],
        columns=(
            "Run",
            "Simulated by",
            "Response error",
            "Noise floor",
            "Moment error",
            "Amplitude",
            "Period",
        ),
        rows=[_run_row(run) for run in result.runs],
        failures=[f"{run.name}: {run.failure}." for run in result.runs if run.failure],
        payload={"loops": response_payload(result.runs)},
        **_common(result, pictures),
    )


def diagnosis_page(result: Diagnosis, origin: Provenance, pictures: dict[str, bytes]) -> str:
    """Return the report of a diagnosis as one HTML text."""
    badge, headline = VERDICTS[result.verdict]
    unit, moment = level_unit(result), quantities(result.model.joint.motion).moment
    return render(
        "diagnosis.html.j2",
        title=f"{result.model.joint.name}: what its model lacks",
        origin=origin,
        result=result,
        badge=badge,
        headline=headline,
        facts=[
            *(
                (
                    f"{moment if name == 'moment' else 'Response'} gap",
                    f"{percent(getattr(result.initial, name))} → {percent(getattr(result.final, name))}",
                    f"noise floor {percent(getattr(result.noise_floor, name))}",
                )
                for name in ("moment", "response")
                if np.isfinite(getattr(result.noise_floor, name))
            ),
            (
                "Effects named",
                str(len(result.steps)),
                ", ".join(spelled(step.effect) for step in result.steps) or "none",
            ),
        ],
        columns=("Step", f"{moment} gap", "Response gap", "Probability", "Not told apart from"),
        rows=_step_rows(result),
        parameters=[
            (spelled(step.effect), name, number(value, 4), parameter_unit(step, name) or "–")
            for step in result.steps
            for name, value in step.parameters.items()
        ],
        advices=[f"T{advice_words(advice, _amount(advice.level, unit))[1:]}." for advice in result.advice],
        **_common(result, pictures),
    )


def response_payload(runs: Sequence[RunVerification]) -> dict[str, Any]:
    """Return measured and simulated response over time for zooming, run by run."""
    curves = []
    for run in runs:
        factor, unit = prefixed(float(np.max(np.abs(run.measured))), CHANNEL_UNITS[run.channel])
        step = -(-run.time.size // DRAWN_SAMPLES)
        for label, signal in (("measured", run.measured), ("simulated", run.simulated)):
            if signal is not None:
                curves.append(
                    {
                        "label": label,
                        "run": f"{run.name}, {label}",
                        "group": run.name,
                        "x": _short(run.time[::step]),
                        "y": _short(signal[::step] * factor),
                        "model": [],
                        "axis": {"name": run.channel.capitalize(), "unit": unit},
                    }
                )
    return {
        "x": {"name": "Time", "symbol": "t", "unit": "s"},
        "y": {"name": "Response", "unit": ""},
        "palette": (PALETTE[0], PALETTE[1], INK),
        "each": True,
        "runs": curves,
    }


def _common(result: Verification | Diagnosis, pictures: dict[str, bytes]) -> dict[str, Any]:
    """Return what both pages show of a model and of figures: a diagnosis', with its effects among the terms."""
    model = getattr(result, "whole", None) or result.model
    motion, moments = model.joint.motion, list(getattr(result, "moments", ()))
    return {
        **inlined(result, pictures),
        "equation": markup(
            mathml(model, [e.effect.name for e in moments])
            + "".join(effect_mathml(e, motion) for e in moments)
        ),
        "term_columns": ("Term", "Of", "Value", "Unit", "95 % interval"),
        "term_rows": _terms(model),
    }


def inlined(result: Any, pictures: dict[str, bytes]) -> dict[str, Any]:
    """Return the kinds of figure of a result, and its pictures as parts of a page."""
    kinds = kinds_of(result)
    return {
        "kinds": kinds,
        "pictures": {
            kind: markup(inline_svg(svg, kind, kinds[kind].title)) for kind, svg in pictures.items()
        },
    }


def _terms(model: JointModel) -> list[tuple[str, ...]]:
    return [(row.name, row.formula, row.value, row.unit, row.interval) for row in term_rows(model)]


def _run_row(run: RunVerification) -> tuple[str, ...]:
    return (
        run.name,
        run.drive,
        percent(run.response_nrmse),
        percent(run.noise_floor),
        percent(run.moment_nrmse),
        percent(run.amplitude_rms_error),
        milliseconds(run.mean_period_difference),
    )


def _step_rows(result: Diagnosis) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("model alone", *_gap(result.initial), "", "")]
    for step in result.steps:
        others = ", ".join(spelled(member) for member in step.members if member != step.effect)
        dropped = (
            f"; no longer needed: {', '.join(map(spelled, step.terms_dropped))}" if step.terms_dropped else ""
        )
        named = f"+ {spelled(step.effect)}{dropped}"
        rows.append((named, *_gap(step.gap_after), f"{step.probability:.2f}", others or "–"))
    return [*rows, ("noise floor", *_gap(result.noise_floor), "", "")]


def _gap(gap: Gap) -> tuple[str, str]:
    return percent(gap.moment), percent(gap.response)


def _amount(value: float, unit: str) -> str:
    factor, prefixed_unit = prefixed(value, unit)
    return f"{value * factor:.3g} {prefixed_unit}"


def _short(values: Any) -> list[float | None]:
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in values]


def milliseconds(value: float | None) -> str:
    """Return a time in ms; a dash where there is none."""
    return "–" if value is None or not np.isfinite(value) else f"{1e3 * value:.3g} ms"
