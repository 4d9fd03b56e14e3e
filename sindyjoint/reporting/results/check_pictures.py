"""Every channel of every run, with what a check found marked on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.record import MEASURED_ANGLE, MEASURED_RATE, Motion, Run
from sindyjoint.reporting.figure import Axes, Kind, by_name, time_label
from sindyjoint.reporting.style import ACCENT, INK, MUTED, PALETTE, plain, prefixed, shortened
from sindyjoint.soundness.check import Checked
from sindyjoint.soundness.record import Record
from sindyjoint.soundness.words import words_of
from sindyjoint.text import quantities

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
    """A channel as it is drawn: the extremes of segments of it, s and SI; the unit of a sensor on a structure."""

    channel: str
    time: Array
    values: Array
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Mark:
    """Where a finding lies, in s; nowhere in particular where it is of the run as a whole."""

    id: str
    severity: str
    channel: str | None
    starts: Array
    ends: Array

    @property
    def words(self) -> str:
        """Its id as it is written."""
        return self.id.replace("_", " ")


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
    """What the pictures of a check are drawn from."""

    joint: str
    motion: Motion
    verdict: str
    runs: tuple[CheckedRun, ...]


def gather_check(check: Checked) -> CheckData:
    """Return what is drawn of a check."""
    channels = sum(len(run.channels) for run in check.recorded)
    segments = int(np.clip(MOST_SEGMENTS // max(channels, 1), FEWEST_SEGMENTS, SEGMENTS))
    runs = tuple(_gather_run(check, run, segments) for run in check.recorded)
    return CheckData(check.name, check.motion, check.soundness.verdict, runs)


def _gather_run(check: Checked, run: Run | Record, segments: int) -> CheckedRun:
    units = check.words.units if check.words.structure else {}
    extremes = {name: find_extremes(signal, segments) for name, signal in run.channels.items()}
    traces = (
        Trace(name, places / run.sample_rate, run.channels[name][places], units.get(name, ""))
        for name, places in extremes.items()
    )
    marks = []
    for finding in check.soundness.findings:
        if finding.run == run.name:
            spans = np.array(finding.spans, dtype=float).reshape(-1, 2) / run.sample_rate
            where = _widen(spans[:, 0], spans[:, 1], run.duration)
            marks.append(Mark(finding.id, finding.severity, finding.channel, *where))
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


def draw_run(data: CheckData, ax: Axes, run: CheckedRun) -> Axes:
    """Draw the channels of a run one above the other, each over its range, and mark what was found."""
    words, q = words_of(data.motion), quantities(data.motion)
    units = {
        "moment": q.moment_unit,
        "angle": q.angle_unit,
        "rate": q.rate_unit,
        "acceleration": f"{q.rate_unit}/s",
    }
    units |= {MEASURED_ANGLE: q.angle_unit, MEASURED_RATE: q.rate_unit}
    base = {trace.channel: -index * (ROW + GAP) for index, trace in enumerate(run.traces)}
    bottom = min(base.values())
    for mark in run.marks:
        low, height = (base[mark.channel], ROW) if mark.channel in base else (bottom, ROW - bottom)
        bars = list(zip(mark.starts, mark.ends - mark.starts, strict=True))
        ax.broken_barh(bars, (low - 0.06, height + 0.12), color=COLOURS[mark.severity], alpha=0.45, lw=0)
    ticks: dict[float, str] = {}
    for trace in run.traces:
        least, most, at = float(trace.values.min()), float(trace.values.max()), base[trace.channel]
        ax.plot(trace.time, at + (trace.values - least) / ((most - least) or 1.0), color=INK, lw=0.5)
        factor, unit = prefixed(max(abs(least), abs(most)), trace.unit or units[trace.channel])
        name = trace.channel if trace.unit else words.of(trace.channel)
        ticks |= {at: f"{least * factor:.3g}", at + 0.5: f"{name} ({unit})", at + ROW: f"{most * factor:.3g}"}
    _label_marks(run, ax, base)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False)
    ax.set(
        yticks=list(ticks), yticklabels=[label.replace("-", "−") for label in ticks.values()], xlim=(0, run.duration),
        ylim=(bottom - 0.1, ROW + 0.12), xlabel=time_label(run.without_time, data.motion),
        title=plain(shortened(run.run, 40)),
    )  # fmt: skip
    return ax


def _label_marks(run: CheckedRun, ax: Axes, base: dict[str, float]) -> None:
    """Name the findings: where they begin, or at the right where they are of the run as a whole."""
    whole = [mark.words for mark in run.marks if not mark.starts.size]
    if whole:
        ax.set_title(", ".join(dict.fromkeys(whole)), loc="right", color=MUTED)
    used: dict[float, float] = {}
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8}
    for mark in sorted((m for m in run.marks if m.starts.size), key=lambda m: m.starts[0]):
        top = base.get(mark.channel or "", 0.0) + ROW
        # One after the other where they begin close together.
        at = max(float(mark.starts[0]), used.get(top, 0.0))
        if at < 0.9 * run.duration:
            used[top] = at + 0.014 * run.duration * (len(mark.words) + 1)
        side = "left" if at < 0.85 * run.duration else "right"
        ax.text(at, top + 0.03, mark.words, va="bottom", ha=side, fontsize=6.5, color=INK, bbox=box)


def kinds_of_check(data: CheckData) -> dict[str, Kind]:
    """Return the figures of a check: as many as its runs take."""
    starts = range(0, max(len(data.runs), 1), RUNS_PER_FIGURE)
    figures = [_kind_of(data, start, RUNS_PER_FIGURE) for start in starts]
    # A page shows them by and by; one picture of all is what a person wants of a folder.
    together = replace(_kind_of(data, 0, RUNS_TOGETHER), name=TOGETHER, part=True, columns=2)
    return by_name(*figures, together)


def _kind_of(data: CheckData, start: int, count: int) -> Kind:
    """Return the figure of some runs."""
    runs = data.runs[start : start + count]
    channels = max((len(run.traces) for run in runs), default=1)
    return Kind(
        f"channels-{1 + start // count}" if start else "channels",
        f"Channels of runs {start + 1} to {start + len(runs)}",
        "Every channel over its range. Shaded: findings that stop (red), bias (orange) or are noted (blue), with "
        "their ids; those of a run as a whole stand at its upper right.",
        lambda shown: [partial(draw_run, run=run) for run in runs],
        wide=True,
        height=lambda _: 0.75 + 0.62 * channels,
        columns=1,
    )
