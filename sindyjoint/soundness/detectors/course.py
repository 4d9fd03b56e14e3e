"""The course of a run from period to period: no excitation, or levels, gains, zeros and phases that change."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.limits import SOUNDNESS
from sindyjoint.numeric import Array
from sindyjoint.soundness import Finding, Spans, Words
from sindyjoint.soundness.detectors import Record

Lines = Mapping[str, NDArray[np.complex128]]
# Periods on either side of a step that are compared, at most and of a record of few; the one that holds it is left out.
SIDE, FEWEST_BESIDE = 4, 2


@dataclass(frozen=True)
class Step:
    """A step in a series of periods.

    Parameters
    ----------
    period : int
        In which it happens.
    size : float
        Mean after less mean before.
    contrast : float
        Size over the scatter on both sides.
    beside : int
        Periods on either side that were compared.
    """

    period: int
    size: float
    contrast: float
    beside: int

    def sides(self, series: Array) -> tuple[float, float]:
        """Return the means of another series before and after the step."""
        left, right = slice(max(0, self.period - self.beside), self.period), slice(self.period + 1, None)
        return float(series[left].mean()), float(series[right][: self.beside].mean())


def step_of(series: Array, least: float = SOUNDNESS.tolerated) -> Step | None:
    """Return the step of a series that stands out most of the scatter on either side, where it is large enough.

    A gradual change, such as a start-up, scatters on either side nearly as much as it steps.

    Parameters
    ----------
    series : ndarray, shape (p,)
    least : float
        Size that is reported.
    """
    n, side = series.size, int(np.clip((series.size - 1) // 4, FEWEST_BESIDE, SIDE))
    if n <= SOUNDNESS.few_periods:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(series, side)
    left, right = windows[: n - 2 * side], windows[side + 1 :]
    size = right.mean(axis=1) - left.mean(axis=1)
    scatter = np.ptp(left, axis=1) + np.ptp(right, axis=1) + SOUNDNESS.granted_share
    # Some of few periods agree by chance: no less than what two ranges of as many are by their usual differences.
    contrast = np.abs(size) / np.maximum(scatter, side * np.median(np.abs(np.diff(series))))
    at = int(np.argmax(contrast))
    found = Step(at + side, float(size[at]), float(contrast[at]), side)
    # Ranges of fewer periods say less.
    return found if abs(found.size) > least and found.contrast > SOUNDNESS.contrast * SIDE / side else None


def drift_of(
    series: Array, least: float, even: bool = True, place: NDArray[np.intp] | None = None
) -> float | None:
    """Return the slope of a series, where over its places it adds up to what is reported and stands out of its scatter.

    Parameters
    ----------
    series : ndarray, shape (p,)
    least : float
        Change over all places that is reported.
    even : bool
        Whether both halves must change alike, as a drift does and a start-up does not.
    place : ndarray of int, shape (p,), optional
        Default: the periods of a run, of which a third may be its start-up.
    """
    if place is None:
        place = np.arange(series.size)[series.size // 3 :]
        series = series[place]
    half = place.size // 2
    if half < SIDE:
        return None
    slope, start = np.polyfit(place, series, 1)
    scatter = float(np.std(series - slope * place - start))
    total = abs(slope) * (place[-1] - place[0] + 1)
    early, late = (np.polyfit(place[part], series[part], 1)[0] for part in (slice(half), slice(-half, None)))
    alike = early * late > 0 and 1 / SOUNDNESS.contrast < early / late < SOUNDNESS.contrast
    stands = total > max(least, SOUNDNESS.outstanding * scatter) and (alike or not even)
    return float(slope) if stands else None


def find_course(record: Record, words: Words) -> Iterator[Finding]:
    """Yield what changes within a run that repeats."""
    periods, clock = record.periods, record.driven_by
    size = {name: float(np.median(np.abs(p.line))) for name, p in periods.items()}
    lines = {name: periods[name].line / size[name] for name in size if size[name] > 0 and name != "rate"}
    if clock not in lines or len(lines) < 2 or lines[clock].size <= SOUNDNESS.few_periods:
        return
    # Periods in which every channel is quiet, and those in which one is, as the motion while a joint sticks.
    still = [np.abs(line) < SOUNDNESS.tolerated for line in lines.values()]
    quiet, some = np.logical_and.reduce(still), np.logical_or.reduce(still)
    alive, moving = np.flatnonzero(~quiet), np.flatnonzero(~some)
    first, last = int(alive[0]), int(alive[-1]) + 1
    for kind, which, count, begin, end in (
        ("dead_start", "first", first, 0, record.at(first + 1)),
        ("dead_tail", "last", quiet.size - last, record.at(last - 1), record.n_samples),
    ):
        # Of a single period the excitation may be a part; that in which it begins or ends is left out, too.
        if count > 1:
            yield words.finding(
                kind,
                record.name,
                None,
                "biases",
                f"no excitation in the {which} {count} periods ({(end - begin) / record.sample_rate:.3g} s)",
                "those samples are left out; cut the file there",
                ((begin, end),),
                True,
            )
    if not moving.size:
        return
    first, last = int(moving[0]), int(moving[-1]) + 1
    if words.structure:
        # A channel in which the line is no more than noise has no course.
        lines = {
            n: z for n, z in lines.items() if np.median(np.abs(np.diff(z[first:last]))) < SOUNDNESS.large_part
        }
    lines = {name: line[first:last] for name, line in lines.items()}
    if clock not in lines:
        return
    found = list(_find_level_steps(record, lines, first, words))
    if not any(each.id == "level_changes" for each in found):
        # Of a joint with friction the channels' phase against each other goes with the level.
        found = _find_phase_steps(record, lines, first, words) or found
    yield from found
    if not found and not words.structure:
        for name in lines:
            yield from _find_zero_changes(
                record, name, periods[name].mean[first:last] / size[name], (first, size[name]), words
            )
        yield from _find_clock_drift(record, lines, words) if "moment" in lines else ()
    yield from _find_frequency(record, lines[clock], words)


def _place(record: Record, period: int) -> tuple[float, Spans]:
    """Return when a period begins, s, and its samples."""
    at = record.at(period)
    return at / record.sample_rate, ((at, record.at(period + 1)),)


def _beat(record: Record) -> float:
    """Return by how much mean and phase of a moment beat where one of few samples crosses a friction step."""
    per = record.samples_per_period / record.order
    return 2 / per if per < SOUNDNESS.few_samples else 0.0


def _find_phase_steps(record: Record, lines: Lines, first: int, words: Words) -> list[Finding]:
    """Return samples that all channels lost, or one of them."""
    per = record.samples_per_period / record.order
    least = max(SOUNDNESS.tolerated, 2 * np.pi / per)  # no less than a sample
    clock = record.driven_by
    apart = {n: np.unwrap(np.angle(z * np.conj(lines[clock]))) for n, z in lines.items() if n != clock}
    slipped = _steps_of(apart, least)
    if not slipped:
        slipped = _steps_of({None: np.unwrap(np.angle(lines[clock]))}, least)
    elif len(slipped) > max(1, len(apart) / 2):
        slipped = {clock: max(slipped.values(), key=lambda found: found.contrast)}
    else:
        # While one channel slips the others go on; where a start-up dies away all of them turn.
        slipped = {
            name: found
            for name, found in slipped.items()
            if np.median([np.ptp(found.sides(z)) for m, z in apart.items() if m != name] or [0.0])
            < SOUNDNESS.large_part * abs(found.size)
        }
    return [_phase_finding(record, name, found, first, words) for name, found in slipped.items()]


def _steps_of(series: Mapping[Any, Array], least: float = SOUNDNESS.tolerated) -> dict[Any, Step]:
    """Return the steps of those of some series that have one."""
    return {name: found for name, each in series.items() if (found := step_of(each, least)) is not None}


def _phase_finding(record: Record, channel: str | None, step: Step, first: int, words: Words) -> Finding:
    """Return the finding of a channel that slipped, or (None) of samples that all channels lost."""
    seconds, spans = _place(record, first + step.period)
    samples = abs(step.size) / (2 * np.pi) * record.samples_per_period / record.order
    size = f"jumps by {np.degrees(step.size):+.3g}° at {seconds:.3g} s"
    if channel is None:
        return words.finding(
            "lost_samples",
            record.name,
            "time",
            "biases",
            f"the phase of all channels {size}, as if {samples:.3g} samples were "
            f"{'missing' if step.size > 0 else 'inserted'}",
            "make two runs of it, cut there; look at the buffer of the recorder",
            spans,
        )
    flipped = abs(abs(step.size) - np.pi) < 0.1 * np.pi
    return words.finding(
        "sign_flips" if flipped else "channel_slip",
        record.name,
        channel,
        "stops" if flipped else "biases",
        f"the phase of the {words.of(channel)} against the other channels {size}"
        + ("" if flipped else f", as if it lost {samples:.3g} samples"),
        "cut the run there and reverse one part" if flipped else "make two runs of it, each with its delay",
        spans,
    )


def _find_level_steps(record: Record, lines: Lines, first: int, words: Words) -> Iterator[Finding]:
    """Yield a level that changes, or the gain of one channel."""
    height = {name: np.abs(line) for name, line in lines.items()}
    steps = _steps_of(height)
    if not steps:
        return
    name = max(steps, key=lambda n: steps[n].contrast)
    sides = ((n, steps[name].sides(h)) for n, h in height.items())
    changed = {n: after / max(before, 1e-12) for n, (before, after) in sides}
    others = max(abs(c - 1) for n, c in changed.items() if n != name)
    alone = others < SOUNDNESS.large_part * abs(changed[name] - 1)
    if alone and _beat(record):
        # Where the few samples of a period fall on a friction step, its amplitude beats.
        return
    seconds, spans = _place(record, first + steps[name].period)
    yield words.finding(
        "gain_changes" if alone else "level_changes",
        record.name,
        name if alone else None,
        # A joint whose stiffness jumps looks the same: that is for the fit to find, and no reason to stop.
        "biases",
        f"the {words.of(name)} changes by the factor {changed[name]:.3g} at {seconds:.3g} s, "
        + (
            f"the other channels change by {100 * others:.2g} % at most"
            if alone
            else "and other channels with it"
        ),
        "look at the range of the amplifier; cut the run there, and correct one part if it was that"
        if alone
        else "make two runs of it, cut there",
        spans,
    )


def _find_zero_changes(
    record: Record, name: str, mean: Array, of: tuple[int, float], words: Words
) -> Iterator[Finding]:
    """Yield a zero that jumps or drifts; ``mean`` is in parts of the channel's amplitude, which ``of`` holds."""
    first, amplitude = of
    step = step_of(mean, max(SOUNDNESS.tolerated, _beat(record) if name == "moment" else 0.0))
    slope = drift_of(mean, SOUNDNESS.tolerated)
    moved = step.size if step is not None else (slope or 0.0) * mean.size
    size = f"by {moved * amplitude:.3g} {words.unit(name)} ({100 * abs(moved):.2g} % of its amplitude)"
    if step is not None:
        seconds, spans = _place(record, first + step.period)
        yield words.finding(
            "zero_jumps",
            record.name,
            name,
            "biases",
            f"the zero of the {words.of(name)} jumps {size} at {seconds:.3g} s",
            "make two runs of it, cut there; look for a loose clamp",
            spans,
        )
    elif slope is not None:
        extent = f"the zero of the {words.of(name)} drifts {size} over the run"
        remedy = "let the amplifiers warm up, or remove a straight line from the channel before"
        yield words.finding("drift", record.name, name, "biases", extent, remedy)


def _find_clock_drift(record: Record, lines: Lines, words: Words) -> Iterator[Finding]:
    """Yield channels whose clocks differ."""
    apart = np.unwrap(np.angle(lines["moment"] * np.conj(lines["angle"])))
    slope = drift_of(apart, max(SOUNDNESS.tolerated, _beat(record)))
    if slope is None:
        return
    # A clock turns the moment against the angle. A joint that changes makes it larger or smaller, too.
    ratio = drift_of(np.log(np.abs(lines["moment"]) / np.abs(lines["angle"])), 0.0, even=False) or 0.0
    if abs(ratio) > SOUNDNESS.large_part * abs(slope):
        return
    total = slope * apart.size
    delay = 1e3 * total / (2 * np.pi) * record.samples_per_period / record.sample_rate
    yield words.finding(
        "clock_drift",
        record.name,
        "time",
        "biases",
        f"the phase between the channels drifts by {np.degrees(total):+.3g}° over the run, {delay:+.3g} ms",
        "record both channels with one clock, or cut the run into short ones",
    )


def _find_frequency(record: Record, clock: NDArray[np.complex128], words: Words) -> Iterator[Finding]:
    """Yield a frequency other than declared."""
    slope = drift_of(np.unwrap(np.angle(clock)), 0.0, even=False)
    turn = (slope or 0.0) / (2 * np.pi * record.order)
    if record.declared is None or abs(turn) <= SOUNDNESS.wrong_frequency:
        return
    yield Finding(
        "wrong_frequency",
        record.name,
        "time",
        "biases",
        f"the {words.of(record.driven_by)} repeats at {record.declared * (1 + turn):.5g} Hz, {100 * turn:+.2g} % from "
        f"the declared {record.declared:g} Hz",
        f"if the sampling rate is wrong by that, c1 is by {-100 * turn:+.2g} % and all inertia by twice as much",
        "check the declared frequency and the sampling rate of that run",
    )
