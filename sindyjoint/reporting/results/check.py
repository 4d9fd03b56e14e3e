"""A check of the data: every channel with what was found marked on it; of a campaign, of a stopped result too."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.judgement.headlines import judge_check
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign, Motion
from sindyjoint.reporting.figure import MOST_PANELS, Kind, by_name, time_label
from sindyjoint.reporting.page import Blocks, Page, section, sentence
from sindyjoint.reporting.registry import view_of_type
from sindyjoint.reporting.style import (
    ACCENT,
    INK,
    MUTED,
    PALETTE,
    Axes,
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
    csv_text,
    escape,
    findings_table,
    tabulate,
)
from sindyjoint.reporting.view import View
from sindyjoint.soundness import words_of
from sindyjoint.soundness.check import Check
from sindyjoint.soundness.detectors import Record
from sindyjoint.text import quantities, spelled

# The figure of all runs, or of so many.
TOGETHER = "runs"
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


def gather_check(check: Check[Any]) -> CheckData:
    """Return what is drawn of a check."""
    # Of the least and the largest value of so many segments the picture of a channel is made.
    segments = int(np.clip(30_000 // max(sum(len(run.channels) for run in check.recorded), 1), 60, 450))
    return CheckData(
        check.name,
        check.words.motion,
        check.soundness.verdict,
        tuple(_gather_run(check, run, segments) for run in check.recorded),
    )


def _gather_run(check: Check[Any], run: Record, segments: int) -> CheckedRun:
    units = check.words.units if check.words.structure else {}
    traces = (
        Trace(name, places / run.sample_rate, signal[places], units.get(name, ""))
        for name, signal in run.channels.items()
        for places in [find_extremes(signal, segments)]
    )
    marks = (
        Mark(f.id, f.severity, f.channel, *_widen(np.divide(f.spans, run.sample_rate), run.duration))
        for f in check.soundness.findings
        if f.run == run.name
    )
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


def _widen(spans: Array, duration: float) -> tuple[Array, Array]:
    """Return spans wide enough to be seen, those that then overlap joined, and no more than a picture can show."""
    starts, ends = spans.reshape(-1, 2).T
    short = 0.5 * np.maximum(0.006 * duration - (ends - starts), 0.0)
    starts, ends = np.maximum(starts - short, 0.0), np.minimum(ends + short, duration)
    order = np.argsort(starts)
    starts, ends = starts[order], np.maximum.accumulate(ends[order]) if ends.size else ends
    new = np.concatenate([[True], starts[1:] > ends[:-1]]) if starts.size else np.zeros(0, dtype=bool)
    last = np.concatenate([new[1:], [True]]) if starts.size else new
    most = 400
    return starts[new][:most], ends[last][:most]


def draw_run(data: CheckData, ax: Axes, run: CheckedRun) -> None:
    """Draw the channels of a run one above the other, each over its range, and mark what was found."""
    words = words_of(data.motion)
    colours = {"stops": ACCENT, "biases": PALETTE[4], "note": PALETTE[5]}
    base = {trace.channel: -index * (ROW + GAP) for index, trace in enumerate(run.traces)}
    bottom = min(base.values())
    for mark in run.marks:
        low, height = (base[mark.channel], ROW) if mark.channel in base else (bottom, ROW - bottom)
        ax.broken_barh(
            list(zip(mark.starts, mark.ends - mark.starts, strict=True)), (low - 0.06, height + 0.12),
            color=colours[mark.severity], alpha=0.45, lw=0,
        )  # fmt: skip
    ticks: dict[float, str] = {}
    for trace in run.traces:
        least, most, at = float(trace.values.min()), float(trace.values.max()), base[trace.channel]
        ax.plot(trace.time, at + (trace.values - least) / ((most - least) or 1.0), color=INK, lw=0.5)
        factor, unit = prefixed(max(abs(least), abs(most)), trace.unit or words.unit(trace.channel))
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


def _label_marks(run: CheckedRun, ax: Axes, base: dict[str, float]) -> None:
    """Name the findings: where they begin, or at the right where they are of the run as a whole."""
    whole = dict.fromkeys(spelled(mark.id) for mark in run.marks if not mark.starts.size)
    ax.set_title(", ".join(whole), loc="right", color=MUTED)
    used: dict[float, float] = {}
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8}
    for mark in sorted((m for m in run.marks if m.starts.size), key=lambda m: m.starts[0]):
        top = base.get(mark.channel or "", 0.0) + ROW
        # One after the other where they begin close together.
        at = max(float(mark.starts[0]), used.get(top, 0.0))
        if at < 0.9 * run.duration:
            used[top] = at + 0.014 * run.duration * (len(mark.id) + 1)
        side = "left" if at < 0.85 * run.duration else "right"
        ax.text(at, top + 0.03, spelled(mark.id), va="bottom", ha=side, fontsize=6.5, color=INK, bbox=box)


def kinds_of_check(data: CheckData) -> dict[str, Kind]:
    """Return the figures of a check: as many as its runs take."""
    figures = [_kind_of(data, start, MOST_PANELS) for start in range(0, max(len(data.runs), 1), MOST_PANELS)]
    # A page shows them by and by; one picture of all is what a person wants of a folder.
    return by_name(*figures, replace(_kind_of(data, 0, 24), name=TOGETHER, part=True, columns=2))


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


BADGES = {"sound": "confirmed", "doubtful": "undecided", "unsound": "refuted"}
HEADLINES = {
    "sound": "Nothing was found that stands against a model of these data.",
    "doubtful": "A model can be made of these data; some of its coefficients are biased.",
    "unsound": "No model is made of these data as they are.",
}
CSV_COLUMNS = ("id", "run", "channel", "severity", "masked", "extent", "effect", "remedy")


def _check_of(result: Any) -> Check[Any]:
    """Return a check, or that at which a result stopped."""
    return result if isinstance(result, Check) else result.stopped


def _tables(result: Any) -> tuple[TextTable, ...]:
    """Return the findings, their channels in the words of the joint's kind of motion."""
    check = _check_of(result)
    found = [replace(f, channel=f.channel and check.words.label(f.channel)) for f in check.soundness.findings]
    return (findings_table(found),)


def _page(result: Any, data: CheckData, show: Blocks) -> Page:
    """Return the verdict, every finding, and every channel; first those of the run with the severest finding."""
    check, (table,) = _check_of(result), _tables(result)
    found, verdict = check.soundness.findings, check.soundness.verdict
    count = {s: str(sum(f.severity == s for f in found)) for s in ("stops", "biases", "note")}
    facts = [
        ("Runs", str(len(check.recorded)), f"{sum(len(r.traces) for r in data.runs)} channels"),
        ("Stop", count["stops"], "no model is made"),
        ("Bias", count["biases"], "coefficients are shifted"),
        ("Notes", count["note"], "good to know"),
    ]
    # Where what stops a model is accepted, the work goes on; the lights say what that is.
    stands = "doubtful" if verdict == "unsound" and not check.stopping else verdict
    why = sentence(check.reason)
    if why and result is not check:
        why += f" So there is no {type(result).__name__.lower()}."
    named, names = [f.run for f in found if f.run is not None], [run.run for run in data.runs]
    worst = names.index(named[0]) if named and named[0] in names else 0
    figure, panel = divmod(worst, MOST_PANELS)
    return Page(
        f"{check.name}: are its data sound?",
        f"Are the data of this {'structure' if check.words.structure else 'joint'} sound?",
        check.name,
        # Small here, below at the size at which a finding is seen.
        show.hero(list(kinds_of_check(data))[figure], panel, again=True),
        (show.verdict(HEADLINES[stands], BADGES[verdict], verdict),),
        (show.paragraph(why, "reason"), show.facts(facts), show.warnings(check.warnings)),
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


def _files(result: Any, data: CheckData) -> dict[str, str]:
    """Return the findings as a table; of a result that was stopped, what it writes else, so that none is stale."""
    check = _check_of(result)
    rows = [[getattr(f, name) for name in CSV_COLUMNS] for f in check.soundness.findings]
    texts = {"findings.csv": csv_text(CSV_COLUMNS, rows)}
    return texts if result is check else texts | view_of_type(result).texts(result, data)


def _about(result: Any) -> str:
    """Return the joint and the verdict."""
    check = _check_of(result)
    return f"{escape(check.name)}{' (simulated)' * check.simulated}: the data are [bold]{check.soundness.verdict}[/]"


def _printed(result: Any, console: Console) -> Iterator[Any]:
    """Yield each kind of finding once: where and how much, what it does and what to do."""
    from rich.constrain import Constrain
    from rich.padding import Padding

    (table,) = _tables(result)
    kinds: dict[tuple[str, str, str], list[str]] = {}
    for kind, where, severity, extent, advice in table.rows:
        kinds.setdefault((severity, spelled(kind), advice), []).append(f"{where}: {extent}")
    for (severity, kind, advice), found in kinds.items():
        yield f"[bold]{severity}[/]: {escape(kind)}"
        for line in (*found, f"→ {advice}"):
            yield Constrain(Padding(escape(line), (0, 0, 0, 2)), 80)
    if not kinds:
        yield "  nothing"


CHECK = View(
    about=_about,
    data=CheckData,
    kind="Check",
    folder="check",
    record_file="check.json",
    judged_by=lambda result: ("soundness",),
    question="What was found?",
    kinds=kinds_of_check,
    record=_check_of,
    drawn_from=lambda result: gather_check(_check_of(result)),
    simulated=lambda result: not isinstance(result, CheckData) and _check_of(result).simulated,
    headline=lambda result: judge_check(_check_of(result)),
    tables=_tables,
    page=_page,
    campaign=lambda result: _check_of(result).campaign,
    files=_files,
    printed=_printed,
    # What was decided on reading stands at the end of the page.
    warnings=lambda result: (*_check_of(result).warnings, *_check_of(result).notes),
)


def _runs_table(result: Campaign) -> TextTable:
    """Return the runs of a campaign."""
    q = quantities(result.joint.motion)
    rate = f"/{q.angle_unit} of path" if result.quasi_static else "Hz"
    return tabulate(
        "runs",
        "Runs",
        result.runs,
        {
            "run": lambda run: run.name,
            "samples": lambda run: str(run.n_samples),
            "rate": lambda run: f"{run.sample_rate:g} {rate}",
            "frequency": lambda run: DASH if run.frequency is None else f"{run.frequency:g} Hz",
            "largest motion": lambda run: f"{np.abs(run.angle).max():.3e} {q.angle_unit}",
            f"largest {q.moment.lower()}": lambda run: (
                f"{np.abs(run.moment).max():.3g} {pretty_unit(q.moment_unit)}"
            ),
        },
    )


#: What the runs of a campaign hold; its picture and its page are those of its check.
CAMPAIGN = View(
    about=lambda result: (
        f"{escape(result.joint.name)}{' (simulated)' * result.simulated}: {len(result.runs)} run(s)"
    ),
    tables=lambda result: (_runs_table(result),),
    # Numbers in SI units.
    rows=lambda result: [
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
    ],
    # What stands against a campaign its check says.
    warnings=lambda result: (),
    details=lambda result: aligned(_runs_table(result)),
)
