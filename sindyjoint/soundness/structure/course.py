"""The course of a run that repeats: phases, levels and gains that change, a dead tail, another frequency."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rig_test import DRIVE
from sindyjoint.soundness.detectors.course import SIDE, Step, largest_step
from sindyjoint.soundness.detectors.lines import strongest_line
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.structure.recorded import Recorded, StructureWords

Complex = NDArray[np.complex128]
# Periods on either side of a step that are compared, at least: a multisine has few.
FEWEST_BESIDE = 2
# Of an integer by which a strongest line may miss a multiple of the declared frequency.
OFF_MULTIPLE = 0.05


def find_course(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    """Yield what changes within a run that repeats."""
    yield from _find_elsewhere(run)
    periods = run.periods
    if DRIVE not in periods or periods[DRIVE].mean.size < 2 * FEWEST_BESIDE + 1:
        return
    size = {name: float(np.median(np.abs(p.line))) for name, p in periods.items()}
    lines = {name: p.line / size[name] for name, p in periods.items() if size[name] > 0}
    tail = _dead_tail(lines)
    if tail:
        yield _tail_finding(run, tail)
        lines = {name: line[:-tail] for name, line in lines.items()}
    if DRIVE not in lines or lines[DRIVE].size < 2 * FEWEST_BESIDE + 1:
        return
    # A channel in which the line is no more than noise has no course.
    lines = {
        name: line for name, line in lines.items() if np.median(np.abs(np.diff(line))) < POLICY.scattered
    }
    if len(lines) < 3 or DRIVE not in lines:
        return
    yield from _find_phase_steps(run, lines, words) or _find_level_steps(run, lines, words)
    yield from _find_clock(run, lines[DRIVE])


def _beside(periods: int) -> int:
    """Return how many periods on either side of a step are compared."""
    return int(np.clip((periods - 1) // 4, FEWEST_BESIDE, SIDE))


def _find_elsewhere(run: Recorded) -> Iterator[Finding]:
    """Yield a run whose drive has its strongest line at no multiple of the declared frequency."""
    if run.frequency is None or run.duration * run.frequency < POLICY.fewest_periods:
        return
    strongest = strongest_line(run.channels[DRIVE], run.sample_rate)
    multiple = strongest / run.frequency
    if abs(multiple - max(1, round(multiple))) <= OFF_MULTIPLE:
        return
    yield Finding(
        "wrong_frequency",
        run.name,
        "time",
        "stops",
        f"the strongest line of the drive is at {strongest:.4g} Hz, which is no multiple of the declared "
        f"{run.frequency:g} Hz",
        "periods are cut at the wrong places: nothing repeats, and nothing is recovered",
        "correct the frequency or the sampling rate of that run; leave it out where nothing repeats",
    )


def _dead_tail(lines: dict[str, Complex]) -> int:
    """Return how many periods at the end of a run no channel shows the drive in."""
    alive = np.logical_or.reduce([np.abs(line) >= POLICY.dead_share for line in lines.values()])
    index = np.flatnonzero(alive)
    tail = alive.size - 1 - int(index[-1]) if index.size else 0
    return tail if tail >= POLICY.fewest_dead else 0


def _tail_finding(run: Recorded, tail: int) -> Finding:
    count = run.periods[DRIVE].mean.size
    # The period in which the drive ends belongs to it.
    start = run.at(count - tail - 1)
    return Finding(
        "dead_tail",
        run.name,
        None,
        "biases",
        f"no drive in the last {tail} periods ({(run.n_samples - start) / run.sample_rate:.3g} s)",
        "a mean over motion and standstill: k1, c1 and M_F are of an amplitude that never was",
        "those samples are left out; cut the file there",
        ((start, run.n_samples),),
        True,
    )


def _find_phase_steps(run: Recorded, lines: dict[str, Complex], words: StructureWords) -> list[Finding]:
    """Return samples that all channels lost, or one of them."""
    main = run.order * (run.frequency or 1.0)
    per = run.sample_rate / main
    least = max(POLICY.phase_step, 2 * np.pi * POLICY.lost_samples / per)

    def step(line: Complex) -> Step | None:
        found = largest_step(np.unwrap(np.angle(line)), POLICY.phase_scatter, _beside(line.size))
        stands = found is not None and abs(found.size) > least and found.contrast > POLICY.step_contrast
        return found if stands else None

    against = {n: step(line * np.conj(lines[DRIVE])) for n, line in lines.items() if n != DRIVE}
    slipped = {name: found for name, found in against.items() if found is not None}
    if not slipped:
        clock = step(lines[DRIVE])
        return [] if clock is None else [_phase_finding(run, None, clock, per, words)]
    if len(slipped) > len(against) / 2:
        largest = max(slipped.values(), key=lambda found: found.contrast)
        return [_phase_finding(run, DRIVE, largest, per, words)]
    return [_phase_finding(run, name, found, per, words) for name, found in slipped.items()]


def _phase_finding(
    run: Recorded, channel: str | None, step: Step, per: float, words: StructureWords
) -> Finding:
    at, end = run.at(step.period), run.at(step.period + 1)
    seconds, samples = at / run.sample_rate, abs(step.size) / (2 * np.pi) * per
    if channel is None:
        return Finding(
            "lost_samples",
            run.name,
            "time",
            "biases",
            f"the phase of all channels jumps by {np.degrees(step.size):+.3g}° at {seconds:.3g} s, as if "
            f"{samples:.3g} samples were {'missing' if step.size > 0 else 'inserted'}",
            "periods are averaged out of phase: k1, c1 and M_F come out wrong, and the noise too large",
            "make two runs of it, cut there; look at the buffer of the recorder",
            ((at, end),),
        )
    flipped = abs(abs(step.size) - np.pi) < 0.3
    return Finding(
        "sign_flips" if flipped else "channel_slip",
        run.name,
        channel,
        "stops" if flipped else "biases",
        f"the phase of the {words.of(channel)} against the other channels jumps by {np.degrees(step.size):+.3g}° at "
        f"{seconds:.3g} s" + ("" if flipped else f", as if it lost {samples:.3g} samples"),
        "two halves of the run contradict each other: all that is recovered of it is their mean",
        "make two runs of it, cut there, or leave it out",
        ((at, end),),
    )


def _find_level_steps(run: Recorded, lines: dict[str, Complex], words: StructureWords) -> Iterator[Finding]:
    """Yield a level that changes, or the gain of one channel."""
    height = {name: np.abs(line) for name, line in lines.items()}
    steps = {name: largest_step(h, POLICY.level_scatter, _beside(h.size)) for name, h in height.items()}
    stands = {
        name: step
        for name, step in steps.items()
        if step is not None and abs(step.size) > POLICY.level_step and step.contrast > POLICY.step_contrast
    }
    if not stands:
        return
    name = max(stands, key=lambda n: stands[n].contrast)
    at, side = stands[name].period, _beside(height[name].size)
    before, after = slice(max(0, at - side), at), slice(at + 1, at + 1 + side)
    changed = {n: float(h[after].mean() / max(h[before].mean(), 1e-12)) for n, h in height.items()}
    change = abs(changed[name] - 1)
    alone = all(abs(c - 1) < POLICY.gain_alone * change for n, c in changed.items() if n != name)
    where, span = run.at(at) / run.sample_rate, ((run.at(at), run.at(at + 1)),)
    gain = alone and name != DRIVE
    yield Finding(
        "gain_changes" if gain else "level_changes",
        run.name,
        name if gain else None,
        "biases",
        f"the {words.of(name)} changes by the factor {changed[name]:.3g} at {where:.3g} s"
        + (", no other channel does" if gain else ", and others with it" if not alone else ""),
        "what is recovered of the run is a mean of two gains"
        if gain
        else "periods of two levels are averaged: k3 is lost in k1, M_F and c1 exchange",
        "look at the range of the amplifier; make two runs of it, cut there"
        if gain
        else "make two runs of it, cut there",
        span,
    )


def _find_clock(run: Recorded, drive: Complex) -> Iterator[Finding]:
    """Yield a frequency other than declared."""
    late = slice(drive.size // 3, None)
    phase = np.unwrap(np.angle(drive))[late]
    order = np.arange(phase.size)
    slope, start = np.polyfit(order, phase, 1)
    rest = float(np.std(phase - slope * order - start))
    turn = float(slope) / (2 * np.pi * run.order)
    if (
        abs(turn) > POLICY.wrong_frequency
        and abs(slope) * order.size > POLICY.drift_contrast * rest
        and run.frequency
    ):
        yield Finding(
            "wrong_frequency",
            run.name,
            "time",
            "biases",
            f"the drive repeats at {run.frequency * (1 + turn):.5g} Hz, {100 * turn:+.2g} % from the declared "
            f"{run.frequency:g} Hz",
            f"if the sampling rate is wrong by that, c1 is by {-100 * turn:+.2g} % and all inertia by twice as much",
            "check the declared frequency and the sampling rate of that run",
        )
