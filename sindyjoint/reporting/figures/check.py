"""The figures of a check: every channel of every run, with what was found marked on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.record import MEASURED_ANGLE, MEASURED_RATE
from sindyjoint.reporting.figures.kind import Kind, by_name, each
from sindyjoint.reporting.figures.labels import time_label
from sindyjoint.reporting.style import ACCENT, INK, MUTED, PALETTE, plain, prefixed, shortened
from sindyjoint.soundness.words import words_of
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.record import Motion, Run
    from sindyjoint.soundness.check import Checked
    from sindyjoint.soundness.finding import Finding
    from sindyjoint.soundness.record import Record


RUNS_PER_FIGURE = 6
# The figure of all runs, or of so many.
TOGETHER, RUNS_TOGETHER = "runs", 24
# Of the least and the largest value of so many segments the picture of a channel is made.
SEGMENTS, MOST_SEGMENTS = 450, 30_000
FEWEST_SEGMENTS = 60
# A marked sample is drawn at least so wide, as a share of the run; a picture shows no more marks than these.
LEAST_WIDTH, MOST_MARKS = 0.006, 400
COLOURS = {"stops": ACCENT, "biases": PALETTE[4], "note": PALETTE[5]}
ROW, GAP = 1.0, 0.25


@dataclass(frozen=True, eq=False)
class Trace:
    """A channel as it is drawn: the extremes of segments of it.

    Parameters
    ----------
    channel : str
    time, values : ndarray, shape (m,)
        s, SI.
    unit : str
        Of a sensor on a structure; empty of the channels of a joint.
    """

    channel: str
    time: Array
    values: Array
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Mark:
    """Where a finding lies.

    Parameters
    ----------
    id, severity : str
    channel : str or None
    starts, ends : ndarray, shape (k,)
        s; empty where it is of the run as a whole.
    """

    id: str
    severity: str
    channel: str | None
    starts: Array
    ends: Array


@dataclass(frozen=True, eq=False)
class CheckedRun:
    """A run as it is drawn."""

    run: str
    duration: float
    traces: tuple[Trace, ...]
    marks: tuple[Mark, ...]
    without_time: bool = False


@dataclass(frozen=True, eq=False)
class CheckData:
    """What the pictures of a check are drawn from.

    Parameters
    ----------
    joint, motion, verdict : str
    runs : tuple of CheckedRun
    """

    joint: str
    motion: str
    verdict: str
    runs: tuple[CheckedRun, ...]


def gather_check(check: Checked) -> CheckData:
    """Return what is drawn of a check."""
    channels = sum(len(run.channels) for run in check.recorded)
    segments = int(np.clip(MOST_SEGMENTS // max(channels, 1), FEWEST_SEGMENTS, SEGMENTS))
    findings, words = check.soundness.findings, check.words
    units = words.units if words.structure else {}
    return CheckData(
        check.name,
        check.motion,
        check.soundness.verdict,
        tuple(
            _gather_run(run, [f for f in findings if f.run == run.name], segments, units)
            for run in check.recorded
        ),
    )


def _gather_run(
    run: Run | Record, findings: list[Finding], segments: int, units: Mapping[str, str]
) -> CheckedRun:
    traces = []
    for name, signal in run.channels.items():
        places = find_extremes(signal, segments)
        traces.append(Trace(name, places / run.sample_rate, signal[places], units.get(name, "")))
    marks = []
    for finding in findings:
        spans = np.array(finding.spans, dtype=float).reshape(-1, 2) / run.sample_rate
        starts, ends = _widen(spans[:, 0], spans[:, 1], run.duration)
        marks.append(Mark(finding.id, finding.severity, finding.channel, starts, ends))
    return CheckedRun(run.name, run.duration, tuple(traces), tuple(marks), run.quasi_static)


def find_extremes(signal: Array, segments: int) -> NDArray[np.intp]:
    """Return the places of the least and the largest value of each segment, in order: no peak is lost.

    All samples, where these are no more.
    """
    size = -(-signal.size // segments)
    if size <= 2:
        return np.arange(signal.size)
    padded = np.pad(signal, (0, -signal.size % size), mode="edge").reshape(-1, size)
    first = np.arange(padded.shape[0]) * size
    places = np.concatenate([first + padded.argmin(axis=1), first + padded.argmax(axis=1)])
    return np.unique(np.minimum(places, signal.size - 1))


def _widen(starts: Array, ends: Array, duration: float) -> tuple[Array, Array]:
    """Return spans wide enough to be seen, those that then overlap joined, and no more than a picture can show."""
    short = 0.5 * np.maximum(LEAST_WIDTH * duration - (ends - starts), 0.0)
    starts, ends = np.maximum(starts - short, 0.0), np.minimum(ends + short, duration)
    order = np.argsort(starts)
    starts, ends = starts[order], np.maximum.accumulate(ends[order]) if ends.size else ends
    new = np.concatenate([[True], starts[1:] > ends[:-1]]) if starts.size else np.zeros(0, dtype=bool)
    last = np.concatenate([new[1:], [True]]) if starts.size else new
    return starts[new][:MOST_MARKS], ends[last][:MOST_MARKS]


def draw_run(run: CheckedRun, ax: Axes, motion: Motion) -> Axes:
    """Draw the channels of a run one above the other, each over its range, and mark what was found."""
    words, q = words_of(motion), quantities(motion)
    angle, rate = q.angle_unit, q.rate_unit
    units = {"moment": q.moment_unit, "angle": angle, "rate": rate, "acceleration": f"{rate}/s"}
    units |= {MEASURED_ANGLE: angle, MEASURED_RATE: rate}
    base = {trace.channel: -index * (ROW + GAP) for index, trace in enumerate(run.traces)}
    bottom = min(base.values())
    for mark in run.marks:
        low, height = (base[mark.channel], ROW) if mark.channel in base else (bottom, ROW - bottom)
        bars = list(zip(mark.starts, mark.ends - mark.starts, strict=True))
        ax.broken_barh(bars, (low - 0.06, height + 0.12), color=COLOURS[mark.severity], alpha=0.45, lw=0)
    ticks, labels = [], []
    for trace in run.traces:
        least, most = float(trace.values.min()), float(trace.values.max())
        scaled = (trace.values - least) / ((most - least) or 1.0)
        ax.plot(trace.time, base[trace.channel] + scaled, color=INK, lw=0.5)
        factor, unit = prefixed(max(abs(least), abs(most)), trace.unit or units[trace.channel])
        name = trace.channel if trace.unit else words.of(trace.channel)
        ticks += [base[trace.channel], base[trace.channel] + 0.5, base[trace.channel] + ROW]
        labels += [f"{least * factor:.3g}", f"{name} ({unit})", f"{most * factor:.3g}"]
    _label_marks(run, ax, base)
    ax.set_yticks(ticks, [label.replace("-", "−") for label in labels])
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False)
    ax.set_xlim(0, run.duration)
    ax.set_ylim(bottom - 0.1, ROW + 0.12)
    ax.set_xlabel(time_label(run.without_time, motion))
    ax.set_title(plain(shortened(run.run, 40)))
    return ax


def _label_marks(run: CheckedRun, ax: Axes, base: dict[str, float]) -> None:
    """Name the findings: where they begin, or at the right where they are of the run as a whole."""
    whole = [mark.id.replace("_", " ") for mark in run.marks if not mark.starts.size]
    if whole:
        ax.set_title(", ".join(dict.fromkeys(whole)), loc="right", color=MUTED)
    used: dict[float, float] = {}
    for mark in sorted((m for m in run.marks if m.starts.size), key=lambda m: m.starts[0]):
        top = base.get(mark.channel or "", 0.0) + ROW
        # One after the other where they begin close together.
        at = max(float(mark.starts[0]), used.get(top, 0.0))
        text = mark.id.replace("_", " ")
        if at < 0.9 * run.duration:
            used[top] = at + 0.014 * run.duration * (len(text) + 1)
        ax.text(
            at, top + 0.03, text, va="bottom", ha="left" if at < 0.85 * run.duration else "right",
            fontsize=6.5, color=INK, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
        )  # fmt: skip


def kinds_of_check(data: CheckData) -> dict[str, Kind]:
    """Return the figures of a check: as many as its runs take."""
    count = len(data.runs)
    figures = [
        _kind_of(data.runs, slice(start, min(start + RUNS_PER_FIGURE, count)), number)
        for number, start in enumerate(range(0, max(count, 1), RUNS_PER_FIGURE), start=1)
    ]
    together = _kind_of(data.runs, slice(0, min(count, RUNS_TOGETHER)), 1)
    # A page shows them by and by; one picture of all is what a person wants of a folder.
    return by_name(*figures, replace(together, name=TOGETHER, part=True, columns=2))


def _kind_of(runs: tuple[CheckedRun, ...], here: slice, number: int) -> Kind:
    """Return the figure of some runs."""
    channels = max((len(run.traces) for run in runs[here]), default=1)
    return Kind(
        "channels" if number == 1 else f"channels-{number}",
        f"Channels of runs {here.start + 1} to {here.stop}",
        "Every channel over its range. Shaded: findings that stop (red), bias (orange) or are noted (blue), with "
        "their ids; those of a run as a whole stand at its upper right.",
        each(lambda shown: [(run, shown.motion) for run in shown.runs[here]], _draw),
        wide=True,
        height=lambda _: 0.75 + 0.62 * channels,
        columns=1,
    )


def _draw(item: tuple[CheckedRun, Motion], ax: Axes) -> Axes:
    run, motion = item
    return draw_run(run, ax, motion)
