"""Samples of a structure's channels: saturation, spikes, dropouts, channels that never change, coarse steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rig_test import DRIVE
from sindyjoint.soundness.detectors.held import held_spans
from sindyjoint.soundness.detectors.lines import strongest_line
from sindyjoint.soundness.detectors.saturation import saturated_samples
from sindyjoint.soundness.detectors.spikes import amplitude_of, spike_samples
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Channel
from sindyjoint.soundness.spans import Spans, spans_of
from sindyjoint.soundness.structure.recorded import Recorded, StructureWords

# Samples about a spike within which another channel shows the same blow.
NEAR = 5
DRIVEN = "the drive is wrong by that: all that is recovered of the joints, k1, k3, c1 and M_F"
SHOWN = "the recovered angles and moments are wrong by what this sensor adds to them: k1, k3, c1 and M_F"


def effect_of(channel: str) -> str:
    """Return what a fault of a channel does to what is recovered."""
    return DRIVEN if channel == DRIVE else SHOWN


def find_in_samples(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    """Yield what single samples of a run show."""
    yield from _find_dead(run, words)
    yield from _find_saturation(run, words)
    yield from _find_held(run, words)
    yield from _find_spikes(run, words)
    yield from _find_steps(run, words)
    yield from _find_few(run)


def _find_dead(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    for channel in run.dead:
        yield Finding(
            "frozen_channel",
            run.name,
            channel.name,
            "stops",
            f"the {words.of(channel.name)} is {channel.values[0]:.6g} {words.unit(channel.name)} in all "
            f"{channel.values.size} samples",
            "exact zeros outweigh every other sensor: all that is recovered is drawn towards zero",
            "check the cable; leave the run or, of all runs, the sensor out",
        )


def _find_saturation(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    for channel in run.alive:
        sides = [saturated_samples(channel, sign) for sign in (1.0, -1.0)]
        found = [at for at in sides if at is not None]
        if not found:
            continue
        at = np.logical_or.reduce(found)
        share = float(np.mean(at))
        yield Finding(
            "saturation",
            run.name,
            channel.name,
            "biases" if share <= POLICY.bearable_saturation else "stops",
            f"{100 * share:.2g} % of the samples of the {words.of(channel.name)} at its limit of "
            f"{np.abs(channel.values[at]).max():.4g} {words.unit(channel.name)}",
            f"its harmonics are too small, and others appear; {effect_of(channel.name)}",
            "repeat the run with a larger range, or leave it out",
            spans_of(at),
        )


def _find_held(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    for channel in run.alive:
        resolved = channel.step < POLICY.fine_step * channel.std
        spans = tuple(span for span in held_spans(channel, resolved) if _others_move(run, channel, span))
        if channel.name == DRIVE and all(channel.values[a] == 0.0 for a, _ in spans):
            continue  # before and after a blow nothing drives
        if not spans:
            continue
        longest = max(b - a for a, b in spans)
        share = sum(b - a for a, b in spans) / run.n_samples
        filled = can_be_filled(run, spans)
        yield Finding(
            "frozen_segment" if longest > POLICY.dropout_samples else "dropouts",
            run.name,
            channel.name,
            _severity(filled, share),
            f"the {words.of(channel.name)} stays at one value {len(spans)} time(s), for up to {longest} samples "
            f"({1e3 * longest / run.sample_rate:.3g} ms), {100 * share:.2g} % of the run",
            f"pulls its harmonics towards zero; {effect_of(channel.name)}",
            "those samples are filled in; look at cables and buffers"
            if filled
            else "repeat the run, or leave it out; look at cables and buffers",
            spans,
            filled,
        )


def _others_move(run: Recorded, channel: Channel, span: tuple[int, int]) -> bool:
    """Return whether most other channels change while one is held: before a blow nothing does, nor at a standstill."""
    start, stop = span
    moves = [np.ptp(c.values[start:stop]) > 0 for c in run.alive if c is not channel]
    return bool(np.mean(moves) > 0.5)


def _severity(filled: bool, share: float) -> Literal["stops", "biases"]:
    return "biases" if filled or share <= POLICY.bearable_saturation else "stops"


def can_be_filled(run: Recorded, spans: Spans) -> bool:
    """Return whether samples can be filled in: from other periods, or across gaps short against the motion."""
    if sum(b - a for a, b in spans) > POLICY.most_masked * run.n_samples:
        return False
    if run.frequency is not None:
        return True
    fastest = max(strongest_line(c.values, run.sample_rate) for c in run.alive)
    return max(b - a for a, b in spans) <= POLICY.bridged_gap * run.sample_rate / max(fastest, 1e-9)


def _find_spikes(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    marked = {c.name: spike_samples(_renamed(c, c.name in run.jumpy)) for c in run.alive}
    for channel in run.alive:
        repeats = run.frequency is not None
        spans = spans_of(marked[channel.name]) if repeats else _alone(channel, marked)
        count = sum(b - a for a, b in spans)
        if not 0 < count <= POLICY.most_spikes * run.n_samples:
            continue
        at = np.concatenate([np.arange(a, b) for a, b in spans])
        size = float(np.abs(channel.values[at] - np.median(channel.values)).max())
        yield Finding(
            "spikes",
            run.name,
            channel.name,
            "biases",
            f"{len(spans)} spike(s) of the {words.of(channel.name)}, up to {size:.3g} {words.unit(channel.name)}, "
            f"{size / max(amplitude_of(channel.values), 1e-300):.3g} times its amplitude",
            f"raise the noise at all harmonics; {effect_of(channel.name)}",
            "those samples are filled in; look for loose contacts",
            spans,
            True,
        )


def _renamed(channel: Channel, jumpy: bool) -> Channel:
    """Return a channel under the name by which spikes of accelerations are looked for."""
    return Channel("acceleration", channel.values) if jumpy else channel


def _alone(channel: Channel, marked: dict[str, NDArray[np.bool_]]) -> Spans:
    """Return the spikes of a channel of a record that no blow explains.

    A blow shows in several channels, and a joint that comes to a stop after it shows as less than the blow did.
    """
    x, own = channel.values - np.median(channel.values), marked[channel.name]
    far = POLICY.jump_range * float(np.abs(x[~own]).max(initial=0.0))
    spans = tuple((a, b) for a, b in spans_of(own) if np.abs(x[a:b]).max() > far)
    if channel.name == DRIVE:
        # The blow itself is a spike of the drive, to which sensors answer more slowly.
        return spans if len(spans) >= POLICY.fewest_jumps else ()
    others = np.logical_or.reduce([m for other, m in marked.items() if other != channel.name])
    near = np.convolve(others, np.ones(2 * NEAR + 1), mode="same") > 0
    return tuple((a, b) for a, b in spans if not near[a:b].any())


def _find_steps(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    for channel in run.alive:
        share = channel.step / channel.std if channel.std else 0.0
        few_levels = channel.levels[0].size <= channel.values.size / 4
        if not channel.quantised or share < POLICY.visible_step or not few_levels:
            continue
        coarse = share > POLICY.coarse_step
        yield Finding(
            "coarse_quantisation",
            run.name,
            channel.name,
            "biases" if coarse else "note",
            f"the {words.of(channel.name)} comes in steps of {channel.step:.3g} {words.unit(channel.name)}, "
            f"{100 * share:.2g} % of its standard deviation",
            f"steps follow the motion and do not average out; {effect_of(channel.name)}"
            if coarse
            else "adds a noise of a third of a step",
            "use a smaller range of the amplifier or of the converter",
        )


def _find_few(run: Recorded) -> Iterator[Finding]:
    if run.frequency is None:
        return
    per = run.sample_rate / (run.frequency * run.order)
    if per < POLICY.few_samples:
        yield Finding(
            "few_samples_per_period",
            run.name,
            "time",
            "note",
            f"{per:.3g} samples per period of the main line",
            "few harmonics remain: the corners of friction, and with them M_F and c1, are hardly seen",
            f"sample at {POLICY.few_samples:g} times the main frequency or more",
        )


def find_dead_drive(runs: Sequence[Recorded], words: StructureWords) -> Iterator[Finding]:
    """Yield runs in which nothing but noise drives the structure."""
    for run in runs:
        drive = next((c for c in run.alive if c.name == DRIVE), None)
        if drive is not None and drive.noise > POLICY.only_noise * drive.std:
            yield Finding(
                "no_signal",
                run.name,
                DRIVE,
                "stops",
                f"the drive is noise: {drive.std:.3g} {words.unit(DRIVE)} RMS, of which {drive.noise:.3g} from sample "
                "to sample",
                DRIVEN,
                "check the force cell; leave the run out",
            )
