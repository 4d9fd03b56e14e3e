"""Pictures of a diagnosis: its gap, where it lies, what it is made of; runs and records before and after."""

from collections.abc import Iterable, Sequence
from functools import partial
from textwrap import fill
from typing import Any

import numpy as np

from sindyjoint.diagnosis.result import Diagnosis, RecordGap, RunGap
from sindyjoint.diagnosis.verdict import reported_together
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.reporting.figure import (
    MOST_PANELS,
    Kind,
    Panel,
    Scale,
    angle_scale,
    bars,
    by_name,
    each,
    fixed,
    moment_cells,
    moment_scale,
    plot,
    scaled,
    spread,
    time_label,
)
from sindyjoint.reporting.results.verification import CYCLES_SHOWN
from sindyjoint.reporting.style import DASHES, INK, MUTED, PALETTE, Axes, legend_above, plain, shortened
from sindyjoint.response.oscillations import hilbert_envelope
from sindyjoint.states.surface import MAP_CELLS, ForceStateMap, force_state_map
from sindyjoint.text import percent, quantities, spelled

PARTS = ("state", "history", "run", "processing", "noise")
SHARE = "share of the mean square gap (%)"
MOST_RIVALS = 4
FAR = 30  # a noise floor so many times below the gap is drawn on a logarithmic scale


def gap_by_step(result: Diagnosis, ax: Axes) -> None:
    """Draw the moment and response gap of the model alone and after each step, down to the noise floor.

    The scale is logarithmic where the noise lies so far below the gap that a linear one would not show it.
    """
    motion = result.model.joint.motion
    groups = reported_together(result.steps)
    labels = ["\n".join(fill(f"+ {spelled(s.effect, motion)}", 18) for s in group) for group in groups]
    gaps = [result.initial, *(group[-1].gap_after for group in groups)]
    called = {"moment": quantities(motion).moment.lower(), "response": "response"}
    shares = {name: 100 * np.array([getattr(gap, name) for gap in gaps]) for name in called}
    # What is not known is NaN: a simulation that failed, a moment that no sensor gave.
    shares = {name: values for name, values in shares.items() if np.isfinite(values).any()}
    floors = {name: 100 * getattr(result.noise_floor, name) for name in shares}
    shown = [value for values in shares.values() for value in values if value > 0]
    # A floor of mere rounding would be all that a picture shows; the legend states it.
    known = [*shown, *(floor for floor in floors.values() if shown and floor > min(shown) / FAR**2)] or [1.0]
    far = max(known) > FAR * min(known)
    low, thick = 0.5 * min(known) if far else 0.0, 0.8 / max(len(shares), 1)
    for index, (name, values) in enumerate(shares.items()):
        rows = np.arange(values.size) + (index - 0.5 * (len(shares) - 1)) * thick
        look: Any = {"color": PALETTE[index]}
        ax.barh(rows, values - low, left=low, height=0.9 * thick, label=f"{called[name]} gap", **look)
        for row, value in zip(rows, values, strict=True):
            if np.isfinite(value):
                # Behind a floor that would run through its words.
                across = [floor for floor in floors.values() if value <= floor < value * (3 if far else 1.3)]
                ax.text(max([value, *across]), row, f" {percent(value / 100)}", va="center", color=INK)
        if np.isfinite(floors[name]):
            below = "" if floors[name] in known else ", below the axis"
            label = f"noise floor of the {called[name]}, {percent(floors[name] / 100)}{below}"
            # No further than the bars: the legend stands above them.
            ax.plot([floors[name]] * 2, [-0.5, len(gaps) - 0.5], ls=DASHES[1], label=label, **look)
    ax.set(
        xscale="log" if far else "linear", xlim=(low, (2.5 if far else 1.25) * max(known)), yticks=range(len(gaps)),
        yticklabels=["model alone", *labels], ylim=(len(gaps) - 0.5, -0.5), xlabel="relative RMS (%)",
        title="Gap between model and measurement",
    )  # fmt: skip
    legend_above(ax, 2 * len(shares))


def budget_parts(result: Diagnosis, ax: Axes) -> None:
    """Draw what the first gap is made of, in mean square."""
    shares = [100 * getattr(result.budget, name) / (result.budget.total or 1.0) for name in PARTS]
    bars(ax, PARTS, shares, 112, SHARE, [*PALETTE[:4], MUTED], "{:.1f} %", title="Budget of the first gap")


def rivals(result: Diagnosis, ax: Axes) -> None:
    """Draw the probability of the named effect of each step and of its rivals."""
    rows = [
        (f"{before}{spelled(name, result.model.joint.motion)}", probability, colour)
        for number, step in enumerate(result.steps, 1)
        for before, name, probability, colour in (
            (f"{number}. ", step.effect, step.probability, PALETTE[0]),
            *(("    ", *rival, MUTED) for rival in step.rivals[:MOST_RIVALS]),
        )
    ]
    labels, values, colours = zip(*rows, strict=True)
    bars(ax, labels, values, 1.2, "probability", colours, "{:.2f}", 0.6, "Named effects and their rivals")


def where(result: Diagnosis, ax: Axes) -> None:
    """Draw the regions that hold more of the gap than their share of the samples."""
    labels = [plain(fill(shortened(region.words.partition(":")[0], 60), 26)) for region in result.where]
    bars(
        ax, labels, [100 * region.share for region in result.where], 100, SHARE, PALETTE[0], height=0.6,
        title="Where the gap lies",
    )  # fmt: skip


def maps(result: Diagnosis) -> list[Panel]:
    """Return the maps of the residual before and, where effects were added, after."""
    both = (
        (result.before, "Residual of the model alone"),
        (result.after, "Residual with the effects, same colours"),
    )
    return [partial(_map, runs=runs, title=title) for runs, title in both if runs]


def overlays(result: Diagnosis) -> list[Panel]:
    """Return measured and modelled curves and residuals of the runs of the largest and the smallest amplitude."""
    after = {run.run: run for run in result.after}
    runs = spread(sorted(result.before, key=lambda run: -float(np.ptp(run.angle))), 2)
    return [
        partial(draw, before=run, after=after.get(run.run)) for run in runs for draw in (_loop, _residual)
    ]


def _map(result: Diagnosis, ax: Axes, runs: Sequence[RunGap], title: str) -> None:
    """Draw the mean residual in cells of (θ, θ̇); the colours are those of the map before, the last has their scale."""
    label = "mean of measured less model ({})" if runs is (result.after or result.before) else ""
    moment_cells(ax, _mean_residual(runs), result.model, title, label, _mean_residual(result.before))


def _mean_residual(runs: Sequence[RunGap]) -> ForceStateMap:
    """Return the mean residual of every cell."""
    angle, rate, residual = (
        np.concatenate([getattr(run, name) for run in runs]) for name in ("angle", "rate", "residual")
    )
    return force_state_map(angle, rate, residual, MAP_CELLS)


MEASURED: Any = {"color": PALETTE[0], "label": "measured"}
BEFORE: Any = {"color": PALETTE[1], "lw": 0.9, "ls": (0, (4, 1.5))}
AFTER: Any = {"color": INK, "lw": 0.8}


def _loop(result: Diagnosis, ax: Axes, before: RunGap, after: RunGap | None) -> None:
    """Draw the measured moment and the models' over the angle; over time where the run has no frequency."""
    q = quantities(result.model.joint.motion)
    # What the rows are: less the inertia's moment, unless the inertia is among the terms.
    name = q.moment if "inertia" in result.model.ids else q.transfer
    curves = [
        (before, before.measured, MEASURED | {"lw": 2.4, "alpha": 0.45}),
        (before, before.model, BEFORE | {"label": "model alone"}),
        *([] if after is None else [(after, after.model, AFTER | {"label": "with the effects"})]),
    ]
    _drawn(result, ax, moment_scale(result.model.joint.motion, before.measured, name), curves)


def _residual(result: Diagnosis, ax: Axes, before: RunGap, after: RunGap | None) -> None:
    """Draw the residuals of a run together with its noise."""
    of = "noise of the mean period" if before.repeats else "noise"
    noise = {"color": MUTED, "alpha": 0.2, "lw": 0, "label": f"{of}, ±2σ"}
    named = (before, BEFORE, "residual of the model alone"), (after, AFTER, "residual with the effects")
    curves = [(run, run.residual, look | {"label": label}) for run, look, label in named if run is not None]
    up = moment_scale(result.model.joint.motion, before.residual, "Measured less model")
    _drawn(result, ax, up, curves, [(None, (-2 * before.noise, 2 * before.noise), noise)])


def _drawn(
    result: Diagnosis, ax: Axes, up: Scale, runs: Sequence[tuple[RunGap, Array, Any]], behind: Any = ()
) -> None:
    """Draw curves of a run, each in its pieces, which have one entry in the legend."""
    motion, run = result.model.joint.motion, runs[0][0]
    across = angle_scale(motion, [float(np.abs(each.angle).max()) for each in result.before])
    curves = [*behind]
    for one, values, look in runs:
        unnamed = {name: value for name, value in look.items() if name != "label"}
        curves += [(x, y, unnamed) for x, y in _pieces(one, values)] + [([], [], look)]
    where = f"{run.frequency:.3g} Hz" + (f", level {run.level}" if run.level else "")
    along = across if run.frequency > 0 else time_label(result.model.fitted.quasi_static, motion)
    plot(ax, along, up, curves, where if run.repeats else run.run, columns=1 if behind else 2)


def _pieces(run: RunGap, values: Array) -> list[tuple[Array, Array]]:
    """Return curves to draw: of a mean period by direction of motion, of another run by unbroken parts of a segment.

    Samples in which the joint sticks are no part of either, and no line crosses them.
    """
    time, rate = run.time[: run.curve], run.rate[: run.curve]
    cut = np.diff(time) > 1.5 * np.median(np.diff(time))
    if run.repeats:
        cut |= np.diff(np.sign(rate)) != 0
    x = run.angle if run.frequency > 0 else run.time
    return [(x[part], values[part]) for part in np.split(np.arange(run.curve), np.flatnonzero(cut) + 1)]


CAMPAIGN_KINDS = by_name(
    Kind(
        "gap",
        "Gap by step",
        "Gap between model and measurement before and after each named effect, with the noise floor.",
        fixed(gap_by_step),
        wide=True,
        # A bar is as thick whatever the number of steps.
        height=lambda result: 1.5 + 0.4 * (1 + len(result.steps)),
    ),
    Kind(
        "maps",
        "Maps before and after",
        "Mean of measured less model over cells of angle and rate, with the model alone and with the effects, in "
        "the same colours.",
        maps,
    ),
    Kind(
        "overlay",
        "Runs before and after",
        "Some runs with the model alone and with the effects, and the residual of either with the noise. "
        "Coefficients are those of the fit to all runs.",
        overlays,
    ),
    Kind(
        "where",
        "Where the gap lies",
        "Regions of the motion that hold more of the first gap than their share of the samples.",
        fixed(where, when=lambda result: result.where),
        wide=True,
    ),
    Kind(
        "budget",
        "Budget of the gap",
        "What the first gap is made of: effects of the joint without internal state and its coefficients (state), "
        "hysteresis in the joint (history), differences between runs, what lies outside the joint or is not explained "
        "(run), processing and time step, noise.",
        fixed(budget_parts, when=lambda result: not np.isnan(result.budget.total)),
        wide=True,
    ),
    Kind(
        "rivals",
        "Rivals",
        "Probability of each named effect, and of the effects that would explain nearly as much.",
        fixed(rivals, when=lambda result: result.steps),
        wide=True,
        height=lambda result: 1.1 + 0.28 * sum(1 + len(s.rivals[:MOST_RIVALS]) for s in result.steps),
    ),
)


def _curves_of(record: RecordGap) -> list[tuple[Array, Any]]:
    """Return signal and look of the measured and simulated curves."""
    curves = (
        (record.measured, MEASURED | {"lw": 1.8}),
        (record.before, {"color": MUTED, "lw": 0.9, "ls": (0, (1, 1)), "label": "model alone"}),
        (record.after, AFTER | {"ls": (0, (4, 1.5)), "label": "with the effects"}),
    )
    return [(signal, look) for signal, look in curves if signal is not None]


def _over_time(
    record: RecordGap, ax: Axes, curves: Iterable[tuple[Array, Any]], kept: slice, name: str = "", **more: Any
) -> None:
    """Draw signals over time, on an axis that suits what was measured."""
    up = scaled(name or record.quantity.capitalize(), record.measured, record.unit)
    shown = [(record.time[kept], signal[kept], look) for signal, look in curves]
    plot(ax, "Time (s)", up, [*shown, *more.pop("levels", ())], record.name, **more)


def overlay(record: RecordGap, ax: Axes) -> None:
    """Draw the measured displacement and, over it, the residuals before and after."""
    thin = {"lw": 0.7, "rasterized": record.time.size > 4000}
    residuals = (record.before, PALETTE[1], "of the model alone"), (record.after, INK, "with the effects")
    curves: list[tuple[Array, Any]] = [
        (record.measured, MEASURED | thin | {"lw": 0.5, "alpha": 0.35}),
        *(
            (simulated - record.measured, thin | {"color": color, "label": f"residual {of}"})
            for simulated, color, of in residuals
            if simulated is not None
        ),
    ]
    _over_time(record, ax, curves, slice(None))
    if record.held_from:
        ax.axvline(record.held_from, color=MUTED, lw=0.6)
        ax.annotate("kept out of the fit →", (record.held_from, 0.03), xycoords=("data", "axes fraction"),
                    xytext=(3, 0), textcoords="offset points", color=MUTED)  # fmt: skip


def cycles(record: RecordGap, ax: Axes) -> None:
    """Draw a few cycles of what the fit did not see, measured and simulated."""
    _over_time(record, ax, _curves_of(record), _middle_cycles(record))


def _middle_cycles(record: RecordGap) -> slice:
    """Return a few cycles just behind the middle of the record: what the fit did not see, and has not yet died."""
    rate = 1 / (record.time[1] - record.time[0])
    first = int((record.held_from or 0.25 * record.time[-1]) * rate)
    count = int(CYCLES_SHOWN * rate / main_frequency(record.measured, rate))
    return slice(first, min(first + max(count, 2), record.time.size))


def envelope(record: RecordGap, ax: Axes) -> None:
    """Draw the envelopes by Hilbert's transform, on a logarithmic scale, with the noise."""
    rate = 1 / (record.time[1] - record.time[0])
    cut = int(rate / main_frequency(record.measured, rate))
    heights = [
        (hilbert_envelope(signal, rate)[0], look) for signal, look in _curves_of(record) if np.ptp(signal) > 0
    ]
    noise = (None, record.noise, {"color": MUTED, "lw": 0.7, "ls": (0, (4, 2)), "label": "noise (RMS)"})
    _over_time(record, ax, heights, slice(cut, -cut), "Envelope", levels=[noise], yscale="log")


def _records(result: Diagnosis) -> tuple[RecordGap, ...]:
    return result.records[:MOST_PANELS]


STRUCTURE_KINDS = CAMPAIGN_KINDS | by_name(
    Kind(
        "overlay",
        "Before and after",
        "Measured response, and the residual of the simulations with the model alone and with the effects. "
        "What lies behind a line was kept out of the fit that is drawn.",
        each(_records, overlay),
        wide=True,
    ),
    Kind(
        "cycles",
        "A few cycles",
        "Some cycles of what was kept out of the fit, measured and simulated.",
        each(_records, cycles),
        wide=True,
    ),
    Kind(
        "envelope",
        "Envelope",
        "Envelope of the measured and the simulated displacement, with the noise.",
        # Of a pulse; a steady motion has an envelope without shape.
        each(lambda result: _records(result) if result.in_place is None else (), envelope),
        wide=True,
    ),
)
