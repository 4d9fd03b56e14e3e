"""Copies: blocks of samples, channels and runs that occur twice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Profile
from sindyjoint.soundness.words import Words

Indices = NDArray[np.intp]
# Samples that the search for scaled copies looks at.
LOOKED_AT = 4096


def repeated_blocks(values: Array) -> list[tuple[int, int, int]]:
    """Return blocks of samples that occur twice, as (first start, second start, length).

    Equal neighbours in the order of size are pairs; pairs that follow each other at the same lag are a block. Samples
    that are equal to the one before belong to a frozen channel and count for none.

    Parameters
    ----------
    values : ndarray, shape (n,)
    """
    order = np.argsort(values, kind="stable")
    same = np.flatnonzero(np.diff(values[order]) == 0)
    first, second = order[same], order[same + 1]
    fresh = np.concatenate([[True], np.diff(values) != 0])
    keep = fresh[first] & fresh[second]
    return [block for block in _join(first[keep], second[keep]) if block[2] >= POLICY.copied_samples]


def _join(first: Indices, second: Indices) -> list[tuple[int, int, int]]:
    """Return pairs that follow each other at one lag, joined."""
    if not first.size:
        return []
    lag = second - first
    order = np.lexsort((first, lag))
    first, lag = first[order], lag[order]
    breaks = np.flatnonzero((np.diff(first) != 1) | (np.diff(lag) != 0)) + 1
    starts = np.concatenate([[0], breaks])
    lengths = np.diff(np.append(starts, first.size))
    return [
        (int(first[s]), int(first[s] + lag[s]), int(length))
        for s, length in zip(starts, lengths, strict=True)
    ]


def find_repeated_blocks(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield runs in which a block of samples of both channels occurs twice, within a run or in two runs."""
    alive = [p for p in profiles if p.channels]
    if not alive:
        return
    edges = np.cumsum([0, *(p.run.n_samples for p in alive)])
    main = [p.channel("moment") or p.channels[0] for p in alive]
    blocks = repeated_blocks(np.concatenate([c.values for c in main]))
    seen: dict[tuple[int, int], list[tuple[int, int, int]]] = {}
    for a, b, length in blocks:
        i, j = (int(np.searchsorted(edges, at, side="right")) - 1 for at in (a, b))
        seen.setdefault((i, j), []).append((a - int(edges[i]), b - int(edges[j]), length))
    for (i, j), found in seen.items():
        one, other = alive[i], alive[j]
        share = sum(length for _, _, length in found) / one.run.n_samples
        spans = tuple((b, b + length) for _, b, length in found)
        if i == j:
            # A run that repeats to the last digit is simulated without noise.
            noisy = any(c.noise > 0 for c in one.channels)
            if noisy and share < POLICY.repeats_itself and _both_equal(one, other, found):
                yield _block_finding(other, spans, share)
        elif share >= POLICY.copied_share:
            yield _run_finding(one, other, share, _both_equal(one, other, found), found[0], words)


def _both_equal(one: Profile, other: Profile, blocks: Sequence[tuple[int, int, int]]) -> bool:
    """Return whether every channel, not the moment alone, is repeated in the longest block."""
    a, b, length = max(blocks, key=lambda block: block[2])
    pairs = [(c.values, d.values) for c, d in zip(one.channels, other.channels, strict=False)]
    return all(np.array_equal(x[a : a + length], y[b : b + length]) for x, y in pairs)


def _block_finding(profile: Profile, spans: tuple[tuple[int, int], ...], share: float) -> Finding:
    longest = max(b - a for a, b in spans)
    masked = share <= POLICY.most_masked
    return Finding(
        "repeated_block",
        profile.run.name,
        None,
        "biases" if masked else "stops",
        f"{len(spans)} block(s) of up to {longest} samples ({1e3 * longest / profile.run.sample_rate:.3g} ms) occur "
        f"twice, {100 * share:.2g} % of the run",
        "the time runs wrong from there on: k1, c1 and the noise floor are of a mean of two phases",
        "look at the buffer of the recorder and repeat the run, or cut it there and make two runs of it",
        spans,
        False,
    )


def _run_finding(
    one: Profile, other: Profile, share: float, whole: bool, block: tuple[int, int, int], words: Words
) -> Finding:
    shift = block[1] - block[0]
    moved = f", {1e3 * abs(shift) / other.run.sample_rate:.4g} ms apart" if shift else ""
    if whole:
        return Finding(
            "duplicate_run",
            other.run.name,
            None,
            "biases" if share < 0.5 else "stops",
            f"{100 * min(share, 1):.3g} % of its samples are those of run {one.run.name!r}{moved}",
            "the same evidence counts twice: every interval (k1, c1, M_F ...) is too narrow, and nothing is held out",
            "leave one of the two runs out, or put in the run that was meant",
        )
    return Finding(
        "duplicate_channel",
        other.run.name,
        "moment",
        "stops",
        f"{100 * min(share, 1):.3g} % of the {words.moment} are those of run {one.run.name!r}, the "
        f"{words.angle} is not",
        f"the law is fitted to the {words.moment} of another motion: no coefficient can be trusted",
        "put in the columns that were meant, or leave the run out",
    )


def find_scaled_copies(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield runs whose noise is that of another run, scaled: the same recording with another gain.

    Third differences of a channel with noise are nearly all noise, and noise of two recordings has nothing in common.
    """
    for name in ("moment", "angle"):
        rows, names, signals = [], [], []
        for p in profiles:
            channel = p.channel(name)
            dense = (p.samples_per_period or np.inf) >= POLICY.copied_period
            third = noise_pattern(channel.values) if channel is not None and dense else None
            if channel is not None and third is not None:
                rows.append(third)
                names.append(p)
                signals.append(channel.values[:LOOKED_AT])
        for i, j in combinations(range(len(rows)), 2):
            if rows[i].size != rows[j].size or np.array_equal(signals[i], signals[j]):
                continue
            likeness = float(rows[i] @ rows[j])
            if abs(likeness) < POLICY.copied_noise:
                continue
            gain = float(np.std(signals[j])) / max(float(np.std(signals[i])), 1e-300) * np.sign(likeness)
            yield Finding(
                "scaled_copy",
                names[j].run.name,
                name,
                "stops",
                f"the {words.of(name)} is that of run {names[i].run.name!r} times {gain:.4g}, noise included "
                f"(correlation {abs(likeness):.4f})",
                "one recording counts as two levels: k1 and k3 follow from a run that was never made",
                "leave one of the two runs out, or put in the run that was meant",
            )


def noise_pattern(values: Array) -> Array | None:
    """Return the normalised third differences of a channel, or None where they are no noise."""
    third = np.diff(values[:LOOKED_AT], 3)
    norm = float(np.linalg.norm(third))
    if third.size < 64 or norm == 0:
        return None
    # Of white noise the third differences have the correlation −3/4 from one to the next; of a smooth signal, 1.
    following = float(third[1:] @ third[:-1]) / norm**2
    if following > -0.5:
        return None
    # Friction steps and spikes stand out of the noise, and those of two runs may fall together.
    usual = 1.4826 * float(np.median(np.abs(third)))
    kept = np.where(np.abs(third) < 4 * usual, third, 0.0)
    return kept / max(float(np.linalg.norm(kept)), 1e-300)
