"""The numbers behind a result, as plain lines: what ``--verbose`` adds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Diagnosis
    from sindyjoint.record import Campaign
    from sindyjoint.response.verification import Verification
    from sindyjoint.states import ForceStates
    from sindyjoint.workflows.comparison import Comparison
    from sindyjoint.workflows.discover import Discovery
    from sindyjoint.workflows.reproduce import Reproduction

# Steps of a path shown on either side of the chosen one.
NEIGHBOURS = 3


def details(result: Any) -> Iterator[str]:
    """Yield the lines for a result of any command; none for a kind that has nothing to add."""
    tellers = {
        "Discovery": _discovery,
        "Comparison": _comparison,
        "Verification": _verification,
        "Diagnosis": _diagnosis,
        "Reproduction": _reproduction,
        "Batch": _batch,
        "Campaign": _campaign,
        "RigMotion": _rig,
    }
    teller = tellers.get(type(result).__name__)
    return teller(result) if teller else iter(())  # type: ignore[operator]


def state_lines(states: Sequence[ForceStates], motion: str = "rotation") -> Iterator[str]:
    """Yield a line per run: its samples, how its rate was made, how much of it moves, and its noise."""
    angle, moment = ("rad", "N·m") if motion == "rotation" else ("m", "N")
    yield from _aligned(
        [
            (
                "run",
                "samples",
                "rate",
                "states",
                "band",
                "moving",
                "noise of the motion",
                "noise of the moment",
            ),
            *(
                (
                    state.run,
                    str(state.n_samples),
                    f"{state.sample_rate:.4g} Hz",
                    state.method,
                    f"{state.bandwidth:.3g} Hz",
                    f"{100 * state.moving.mean():.1f} %",
                    f"{state.noise.angle:.2e} {angle}",
                    f"{state.noise.moment:.2e} {moment}",
                )
                for state in states
            ),
        ]
    )


def _discovery(result: Discovery) -> Iterator[str]:
    model = result.model
    yield from state_lines(result.states, model.joint.motion)
    if result.skew is not None:
        late, error = 1e3 * result.skew.time, 1e3 * result.skew.standard_error
        yield f"time by which the moment lags: {late:.4f} ms ± {error:.4f} ms"
    path, chosen = result.selection.path, result.selection.chosen
    yield f"{len(result.regressor.terms_)} candidates; {len(path)} models on the path"
    first, last = (0, len(path)) if chosen is None else (max(0, chosen - NEIGHBOURS), chosen + NEIGHBOURS + 1)
    rows = [("", "terms", "residual", "held out", "threshold", "least |t| over groups")]
    for index, step in enumerate(path[first:last], first):
        least = float(np.min(step.group_t_ratios)) if step.group_t_ratios.size else float("inf")
        rows.append(
            (
                "chosen" if index == chosen else "",
                str(step.size),
                f"{step.fit.residual_rms:.4g}",
                _number(step.held_out_rms),
                f"{step.threshold:.2e}",
                _number(least),
            )
        )
    yield from _aligned(rows)
    fitted = model.fitted
    yield (
        f"moment {fitted.moment_rms:.4g} RMS, residual {fitted.residual_rms:.4g}, of which the data cannot repeat "
        f"{fitted.noise_floor:.4g}"
    )
    yield from _shares(result)


def _shares(result: Discovery) -> Iterator[str]:
    bias = {} if result.bias is None else dict(zip(result.bias.ids, result.bias.pooled, strict=True))
    rows = [("term", "share it carries alone", "relative error", "bias taken out")]
    for term in result.model.terms:
        size = abs(term.coefficient) or 1.0
        out = f"{100 * (bias[term.id] / size):+.3f} %" if term.id in bias else "–"
        rows.append(
            (term.id, f"{100 * term.unique_share:.2f} %", f"{100 * (term.standard_error / size):.3f} %", out)
        )
    yield from _aligned(rows)


def _campaign(campaign: Campaign) -> Iterator[str]:
    angle, moment = ("rad", "N·m") if campaign.joint.motion == "rotation" else ("m", "N")
    rows = [("run", "samples", "rate", "frequency", "largest motion", "largest moment")]
    for run in campaign.runs:
        rows.append(
            (
                run.name,
                str(run.n_samples),
                f"{run.sample_rate:g} Hz",
                "–" if run.frequency is None else f"{run.frequency:g} Hz",
                f"{np.abs(run.angle).max():.3e} {angle}",
                f"{np.abs(run.moment).max():.3g} {moment}",
            )
        )
    yield from _aligned(rows)


def _rig(result: Any) -> Iterator[str]:
    response = result.response
    yield f"{response.time.size} samples, steps of {1e3 * response.step:g} ms, {response.events} events of joints"
    before, after = response.energy.max(), response.energy[-1]
    yield f"largest energy {before:.4g} J, left at the end {after:.4g} J, became heat {sum(result.heat.values()):.4g} J"


def _comparison(result: Comparison) -> Iterator[str]:
    rows = [("method", "time", "held out", "response", "terms")]
    for choice in (*result.methods, *result.frequencies, *result.libraries):
        rows.append(
            (
                choice.name,
                _seconds(choice.seconds),
                _number(choice.held_out),
                _number(choice.response),
                " ".join(term.id for term in choice.terms) or "none",
            )
        )
    yield from _aligned(rows)
    yield from (f"{stage}: {_seconds(spent)}" for stage, spent in result.seconds.items())


def _verification(result: Verification) -> Iterator[str]:
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
                _number(run.response_nrmse),
                _number(run.noise_floor),
                _number(run.beyond_noise),
                f"{result.tolerance:g}",
                "–" if run.band is None else str(run.band.draws),
                "–" if run.band is None else str(run.band.failed),
            )
        )
    yield from _aligned(rows)


def _diagnosis(result: Diagnosis) -> Iterator[str]:
    for step in result.steps:
        rows = [(f"step {step.effect}", "probability"), *((n, f"{p:.3g}") for n, p in step.rivals)]
        yield from _aligned([rows[0], (step.effect, f"{step.probability:.3g}"), *rows[1:]])
    budget = result.budget
    parts = {name: getattr(budget, name) for name in ("state", "history", "run", "processing", "noise")}
    yield "mean square of the first gap: " + ", ".join(f"{name} {value:.3g}" for name, value in parts.items())


def _reproduction(result: Reproduction) -> Iterator[str]:
    for joint in result.joints:
        yield joint.table.joint
        yield from state_lines(joint.loops)
        yield "furthest of each parameter, in the paper's deviations: " + ", ".join(
            f"{value:.2f}" for value in joint.largest_error
        )


def _batch(result: Any) -> Iterator[str]:
    rows = [("campaign", "status", "terms", "reason")]
    for record in result.records:
        terms = " ".join(term["id"] for term in (record.result or {}).get("terms", ()))
        rows.append((record.id, record.status, terms, record.reason))
    yield from _aligned(rows)


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the rows with their columns under each other, the first to the left, others to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        cells = [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        yield "  ".join([row[0].ljust(widths[0]), *cells])


def _number(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.4g}"


def _seconds(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{value:.2f} s"
