"""The course of a steady run from period to period: levels, gains, zeros, phases and clocks that change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Profile
from sindyjoint.soundness.words import Words

Complex = NDArray[np.complex128]
# Periods on either side of a step that are compared; the one that holds it is left out.
SIDE = 4


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
    """

    period: int
    size: float
    contrast: float


def largest_step(series: Array, least_scatter: float = 0.0, side: int = SIDE) -> Step | None:
    """Return the step of a series that stands out most of the scatter on either side; None for a short series.

    A gradual change, such as a start-up, scatters on either side nearly as much as it steps.

    Parameters
    ----------
    series : ndarray, shape (p,)
    least_scatter : float
        Scatter that is taken for granted.
    side : int
        Periods on either side that are compared.
    """
    n = series.size
    if n < 2 * side + 1:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(series, side)
    left, right = windows[: n - 2 * side], windows[side + 1 :]
    size = right.mean(axis=1) - left.mean(axis=1)
    scatter = np.ptp(left, axis=1) + np.ptp(right, axis=1) + least_scatter + 1e-300
    contrast = np.abs(size) / scatter
    at = int(np.argmax(contrast))
    return Step(at + side, float(size[at]), float(contrast[at]))


def find_course(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield what changes within a steady run."""
    periods = profile.periods
    if not {"moment", "angle"} <= set(periods) or periods["angle"].mean.size < 2 * SIDE + 1:
        return
    size = {name: float(np.median(np.abs(p.line))) for name, p in periods.items()}
    if min(size["moment"], size["angle"]) <= 0:
        return
    yield from _find_dead_ends(profile, size)
    first, last = _living(profile, size)
    if last - first < 2 * SIDE + 1:
        return
    lines = {name: periods[name].line[first:last] / size[name] for name in ("moment", "angle")}
    found = list(_find_phase_steps(profile, lines, first))
    if not found:
        found = list(_find_level_steps(profile, lines, first, words))
    yield from found
    if found:
        return
    for name in ("moment", "angle"):
        mean = periods[name].mean[first:last] / size[name]
        yield from _find_zero_changes(profile, name, mean, first, words)
    yield from _find_clock(profile, lines)


def _living(profile: Profile, size: dict[str, float]) -> tuple[int, int]:
    """Return the first and the end of the periods in which the motion is there."""
    alive = np.abs(profile.periods["angle"].line) > POLICY.dead_share * size["angle"]
    index = np.flatnonzero(alive)
    return (int(index[0]), int(index[-1]) + 1) if index.size else (0, 0)


def _find_dead_ends(profile: Profile, size: dict[str, float]) -> Iterator[Finding]:
    """Yield start and end of a run in which neither channel shows the excitation."""
    quiet = np.logical_and.reduce(
        [np.abs(profile.periods[n].line) < POLICY.dead_share * size[n] for n in ("moment", "angle")]
    )
    if quiet.all() or not quiet.any():
        return
    alive = np.flatnonzero(~quiet)
    ends = {"dead_start": (0, int(alive[0])), "dead_tail": (int(alive[-1]) + 1, quiet.size)}
    for kind, (a, b) in ends.items():
        if b - a < POLICY.fewest_dead:
            continue
        # The period in which the excitation begins or ends belongs to it.
        start, stop = profile.at(a), profile.run.n_samples if kind == "dead_tail" else profile.at(b + 1)
        start = profile.at(a - 1) if kind == "dead_tail" else start
        yield Finding(
            kind,
            profile.run.name,
            None,
            "biases",
            f"no excitation in the {'first' if kind == 'dead_start' else 'last'} {b - a} periods "
            f"({(stop - start) / profile.run.sample_rate:.3g} s)",
            "a mean over motion and standstill: k1, c1 and M_F are of an amplitude that never was",
            "those samples are left out; cut the file there",
            ((start, stop),),
            True,
        )


def _find_phase_steps(profile: Profile, lines: dict[str, Complex], first: int) -> Iterator[Finding]:
    """Yield samples lost by both channels, or by one of them."""
    per = profile.samples_per_period or 1.0
    phase = {name: np.unwrap(np.angle(line)) for name, line in lines.items()}
    apart = np.unwrap(np.angle(lines["moment"] * np.conj(lines["angle"])))
    least = 2 * np.pi * POLICY.lost_samples / per
    both = largest_step(phase["angle"], POLICY.phase_scatter)
    single = largest_step(apart, POLICY.phase_scatter)
    if single is not None and _stands(single, max(POLICY.phase_step, least)):
        yield _phase_finding(profile, "channel_slip", single, per, first)
    elif both is not None and _stands(both, max(POLICY.phase_step, least)):
        # A step in the angle alone would be one between the channels.
        yield _phase_finding(profile, "lost_samples", both, per, first)


def _beat(profile: Profile) -> float:
    """Return by how much mean and phase of a moment beat where one of few samples crosses a friction step.

    In parts of its amplitude; zero where a period has samples enough.
    """
    per = profile.samples_per_period or np.inf
    return 2 / per if per < POLICY.few_samples else 0.0


def _stands(step: Step, least: float) -> bool:
    return abs(step.size) > least and step.contrast > POLICY.step_contrast


def _phase_finding(profile: Profile, kind: str, step: Step, per: float, first: int) -> Finding:
    at = profile.at(first + step.period)
    samples = abs(step.size) / (2 * np.pi) * per
    spans = ((at, profile.at(first + step.period + 1)),)
    seconds = at / profile.run.sample_rate
    if kind == "lost_samples":
        return Finding(
            kind,
            profile.run.name,
            "time",
            "biases",
            f"the phase of both channels jumps by {np.degrees(step.size):+.3g}° at {seconds:.3g} s, as if "
            f"{samples:.3g} samples were {'missing' if step.size > 0 else 'inserted'}",
            "periods are averaged out of phase: k1, k3, c1 and M_F come out wrong, and the noise floor too large",
            "make two runs of it, cut there; look at the buffer of the recorder",
            spans,
        )
    flipped = abs(abs(step.size) - np.pi) < 0.3
    return Finding(
        "sign_flips" if flipped else kind,
        profile.run.name,
        "moment",
        "stops" if flipped else "biases",
        f"the phase between the channels jumps by {np.degrees(step.size):+.3g}° at {seconds:.3g} s"
        + ("" if flipped else f", as if one of them lost {samples:.3g} samples"),
        "the sign of k1, c1 and M_F changes within the run"
        if flipped
        else "shifts c1 by about k1 times that delay",
        "cut the run there and reverse one part" if flipped else "make two runs of it, each with its delay",
        spans,
    )


def _find_level_steps(
    profile: Profile, lines: dict[str, Complex], first: int, words: Words
) -> Iterator[Finding]:
    """Yield a level that changes, or the gain of one channel."""
    height = {name: np.abs(line) for name, line in lines.items()}
    ratio = np.log(np.maximum(height["moment"], 1e-12) / np.maximum(height["angle"], 1e-12))
    steps = {name: largest_step(h, POLICY.level_scatter) for name, h in height.items()}
    name = max(steps, key=lambda n: -1.0 if steps[n] is None else steps[n].contrast)  # type: ignore[union-attr]
    step = steps[name]
    if step is None or not _stands(step, POLICY.level_step):
        return
    other = "angle" if name == "moment" else "moment"
    at = step.period
    after, before = slice(at + 1, at + 1 + SIDE), slice(max(0, at - SIDE), at)
    changed = {n: float(height[n][after].mean() / max(height[n][before].mean(), 1e-12)) for n in height}
    alone = abs(changed[other] - 1) < POLICY.gain_alone * abs(changed[name] - 1)
    if alone and (profile.samples_per_period or np.inf) < POLICY.few_samples:
        # Where the few samples of a period fall on a friction step, its amplitude beats.
        return
    where = profile.at(first + at) / profile.run.sample_rate
    span = ((profile.at(first + at), profile.at(first + at + 1)),)
    if alone and np.ptp(ratio) > 0:
        yield Finding(
            "gain_changes",
            profile.run.name,
            name,
            # A joint whose stiffness jumps looks the same: that is for the fit to find, and no reason to stop.
            "biases",
            f"the {words.of(name)} changes by the factor {changed[name]:.3g} at {where:.3g} s while the "
            f"{words.of(other)} changes by {changed[other]:.3g}",
            "every coefficient (k1, c1, M_F) is a mean of two gains, or of two states of the joint",
            "look at the range of the amplifier; cut the run there, and correct one part if it was that",
            span,
        )
        return
    yield Finding(
        "level_changes",
        profile.run.name,
        None,
        "biases",
        f"the {words.angle} changes by the factor {changed['angle']:.3g}, the {words.moment} by "
        f"{changed['moment']:.3g}, at {where:.3g} s",
        "periods of two levels are averaged: k3 is lost in k1, M_F and c1 exchange",
        "make two runs of it, cut there",
        span,
    )


def _find_zero_changes(
    profile: Profile, name: str, mean: Array, first: int, words: Words
) -> Iterator[Finding]:
    """Yield a zero that jumps or drifts; ``mean`` is in parts of the channel's amplitude."""
    amplitude = float(np.median(np.abs(profile.periods[name].line)))
    unit = words.unit(name)
    step = largest_step(mean, POLICY.zero_scatter)
    effect = (
        "adds to the noise floor and, through the mean, to k2 and the unequal parts of M_F"
        if name == "moment"
        else "adds to the noise floor; through the mean k1, k2 and k3 are of another zero"
    )
    least = max(POLICY.zero_step, _beat(profile) if name == "moment" else 0.0)
    if step is not None and _stands(step, least):
        at = profile.at(first + step.period)
        yield Finding(
            "zero_jumps",
            profile.run.name,
            name,
            "biases",
            f"the zero of the {words.of(name)} jumps by {step.size * amplitude:.3g} {unit} "
            f"({100 * abs(step.size):.2g} % of its amplitude) at {at / profile.run.sample_rate:.3g} s",
            effect,
            "make two runs of it, cut there; look for a loose clamp",
            ((at, profile.at(first + step.period + 1)),),
        )
        return
    late = mean[mean.size // 3 :]
    half = late.size // 2
    if half < 4:
        return
    slopes = [np.polyfit(np.arange(part.size), part, 1)[0] for part in (late[:half], late[half:])]
    slope, _ = np.polyfit(np.arange(late.size), late, 1)
    scatter = float(
        np.std(late - np.polyval(np.polyfit(np.arange(late.size), late, 1), np.arange(late.size)))
    )
    total = slope * mean.size
    even = slopes[0] * slopes[1] > 0 and POLICY.even_drift < slopes[0] / slopes[1] < 1 / POLICY.even_drift
    if abs(total) > POLICY.drift and even and abs(slope) * late.size > POLICY.drift_contrast * scatter:
        yield Finding(
            "drift",
            profile.run.name,
            name,
            "biases",
            f"the zero of the {words.of(name)} drifts by {total * amplitude:.3g} {unit} "
            f"({100 * abs(total):.2g} % of its amplitude) over the run",
            effect,
            "let the amplifiers warm up, or remove a straight line from the channel before",
        )


def _find_clock(profile: Profile, lines: dict[str, Complex]) -> Iterator[Finding]:
    """Yield a frequency other than declared, and channels whose clocks differ."""
    frequency = profile.run.frequency
    count = lines["angle"].size
    late = slice(count // 3, None)
    order = np.arange(count)[late]
    apart = np.unwrap(np.angle(lines["moment"] * np.conj(lines["angle"])))[late]
    slope = float(np.polyfit(order, apart, 1)[0])
    scatter = float(np.std(apart - np.polyval(np.polyfit(order, apart, 1), order)))
    total = slope * count
    if (
        abs(total) > max(POLICY.clock_drift, _beat(profile))
        and abs(slope) * order.size > POLICY.drift_contrast * scatter
        and _even(apart)
    ):
        delay = total / (2 * np.pi * (profile.frequency or 1.0))
        yield Finding(
            "clock_drift",
            profile.run.name,
            "time",
            "biases",
            f"the phase between the channels drifts by {np.degrees(total):+.3g}° over the run, {1e3 * delay:+.3g} ms",
            "a delay that grows shifts c1 by about k1 times its mean",
            "record both channels with one clock, or cut the run into short ones",
        )
    if frequency is None:
        return
    phase = np.unwrap(np.angle(lines["angle"]))[late]
    turn = float(np.polyfit(order, phase, 1)[0]) / (2 * np.pi)
    rest = float(np.std(phase - np.polyval(np.polyfit(order, phase, 1), order)))
    if (
        abs(turn) > POLICY.wrong_frequency
        and abs(turn) * 2 * np.pi * order.size > POLICY.drift_contrast * rest
    ):
        yield Finding(
            "wrong_frequency",
            profile.run.name,
            "time",
            "biases",
            f"the motion has {frequency * (1 + turn):.5g} Hz, {100 * turn:+.2g} % from the declared {frequency:g} Hz",
            f"if the sampling rate is wrong by that, c1 is by {-100 * turn:+.2g} % and the inertia by twice as much",
            "check the declared frequency and the sampling rate of that run",
        )


def _even(series: Array) -> bool:
    """Return whether both halves of a series change alike, as a drift does and a start-up does not."""
    half = series.size // 2
    first, second = (np.polyfit(np.arange(half), part, 1)[0] for part in (series[:half], series[-half:]))
    return bool(first * second > 0 and POLICY.even_drift < first / second < 1 / POLICY.even_drift)
