"""Copies in the runs of a structure: runs, blocks of samples and channels that occur twice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from sindyjoint.mechanics.rig_test import DRIVE
from sindyjoint.numeric import Array
from sindyjoint.soundness.detectors.copies import noise_pattern, repeated_blocks
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.structure.recorded import Recorded, StructureWords

# Deviation from a constant ratio that rounding leaves, relative.
PROPORTIONAL = 1e-6


def find_copies(runs: Sequence[Recorded], words: StructureWords) -> Iterator[Finding]:
    """Yield what occurs twice."""
    for run in runs:
        yield from _find_twice_in_run(run, words)
        yield from _find_blocks(run)
    for one, other in combinations(runs, 2):
        yield from _find_twice_in_runs(one, other, words)


def _find_twice_in_run(run: Recorded, words: StructureWords) -> Iterator[Finding]:
    """Yield two columns of a run with one content, noise included."""
    patterns = {c.name: noise_pattern(c.values) for c in run.alive}
    for one, other in combinations(patterns, 2):
        likeness = _likeness(patterns[one], patterns[other])
        equal = np.array_equal(run.channels[one], run.channels[other])
        if not equal and abs(likeness) < POLICY.copied_noise:
            continue
        gain = float(np.std(run.channels[other]) / np.std(run.channels[one]))
        yield Finding(
            "duplicate_channel",
            run.name,
            other,
            "stops",
            f"the {words.of(other)} is the {words.of(one)}"
            + ("" if equal else f" times {np.copysign(gain, likeness):.4g}, noise included"),
            "one sensor stands for two places: what is recovered bends the structure to make them move alike",
            "put in the column that was meant, or leave that sensor out",
        )


def _find_blocks(run: Recorded) -> Iterator[Finding]:
    """Yield blocks of samples that all channels of a run have twice; a run without noise repeats to the last digit."""
    noisy = [c for c in run.alive if c.noise > 0]
    if not noisy:
        return
    main = noisy[0].values
    blocks = [b for b in repeated_blocks(main) if _same(run.channels, b)]
    share = sum(length for _, _, length in blocks) / run.n_samples
    if not blocks or share >= POLICY.repeats_itself:
        return
    longest = max(length for _, _, length in blocks)
    yield Finding(
        "repeated_block",
        run.name,
        None,
        "biases" if share <= POLICY.most_masked else "stops",
        f"{len(blocks)} block(s) of up to {longest} samples ({1e3 * longest / run.sample_rate:.3g} ms) occur twice, "
        f"{100 * share:.2g} % of the run",
        "the time runs wrong from there on: what is recovered is a mean of two phases, and its noise too large",
        "look at the buffer of the recorder and repeat the run, or cut it there and make two runs of it",
        tuple((second, second + length) for _, second, length in blocks),
    )


def _same(channels: Mapping[str, Array], block: tuple[int, int, int]) -> bool:
    """Return whether a block is the same in every channel."""
    a, b, length = block
    return all(np.array_equal(x[a : a + length], x[b : b + length]) for x in channels.values())


def _find_twice_in_runs(one: Recorded, other: Recorded, words: StructureWords) -> Iterator[Finding]:
    """Yield runs, or channels of two runs, with one content; a scaled copy shows by its noise."""
    noisy = any(c.noise > 0 for c in one.alive)
    copied = [name for name in one.channels if _copied(one.channels[name], other.channels[name], noisy)]
    if not copied:
        return
    gain = float(np.std(other.channels[copied[0]]) / np.std(one.channels[copied[0]]))
    times = "" if abs(gain - 1) < 1e-9 else f" times {gain:.4g}"
    if len(copied) == len(one.channels):
        yield Finding(
            "duplicate_run" if not times else "scaled_copy",
            other.name,
            None,
            "stops",
            f"its samples are those of run {one.name!r}{times}",
            "the same evidence counts twice: every interval (k1, c1, M_F ...) is too narrow, and nothing is held out",
            "leave one of the two runs out, or put in the run that was meant",
        )
        return
    for name in copied:
        if name == DRIVE and not _noisy(one.channels[name]):
            continue  # a drive that was computed, and not measured
        yield Finding(
            "duplicate_channel",
            other.name,
            name,
            "stops",
            f"the {words.of(name)} is that of run {one.name!r}{times}, the other channels are not",
            "two runs are mixed: nothing that is recovered of this one is right",
            "put in the column that was meant, or leave the run out",
        )


def _copied(one: Array, other: Array, noisy: bool) -> bool:
    """Return whether a channel is that of another run, or that times a factor, which only noise would show."""
    size = min(one.size, other.size)
    one, other = one[:size], other[:size]
    if not np.ptp(one):
        return False
    if np.array_equal(one, other) or not noisy:
        return bool(np.array_equal(one, other))
    gain = float(one @ other) / float(one @ one)
    if np.abs(other - gain * one).max() <= PROPORTIONAL * np.abs(other).max():
        return True
    return abs(_likeness(noise_pattern(one), noise_pattern(other))) >= POLICY.copied_noise


def _likeness(one: Array | None, other: Array | None) -> float:
    """Return the correlation of two patterns of noise; zero where one is missing or they are not as long."""
    if one is None or other is None or one.size != other.size:
        return 0.0
    return float(one @ other)


def _noisy(values: Array) -> bool:
    return noise_pattern(values) is not None
