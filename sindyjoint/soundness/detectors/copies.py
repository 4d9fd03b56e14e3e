"""Copies: blocks of samples, channels and runs that occur twice."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from sindyjoint.limits import SOUNDNESS
from sindyjoint.numeric import Array
from sindyjoint.soundness import Finding, Words
from sindyjoint.soundness.detectors import Channel, Record

Block = tuple[int, int, int]
# Samples that the search for scaled copies looks at, and the deviation from a constant ratio, in parts of the largest
# value, that rounding to five digits leaves.
LOOKED_AT, PROPORTIONAL = 4096, 2e-5


def repeated_blocks(values: Array) -> list[Block]:
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
    first, lag = first[keep], (second - first)[keep]
    order = np.lexsort((first, lag))
    first, lag = first[order], lag[order]
    breaks = np.flatnonzero((np.diff(first) != 1) | (np.diff(lag) != 0)) + 1
    starts = np.concatenate([[0], breaks, [first.size]])
    return [
        (int(first[a]), int(first[a] + lag[a]), int(b - a))
        for a, b in zip(starts[:-1], starts[1:], strict=True)
        if b - a >= SOUNDNESS.copied_samples
    ]


def find_blocks(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield blocks that occur twice within a run, or in two runs; which channels they are of tells what happened."""
    shared: dict[tuple[int, int], dict[str, list[Block]]] = {}
    for name in dict.fromkeys(name for r in records for name in r.channels):
        some = [(i, c) for i, r in enumerate(records) if (c := r.channel(name)) is not None and _tells(c)]
        edges = np.cumsum([0, *(c.values.size for _, c in some)])
        for a, b, length in repeated_blocks(np.concatenate([c.values for _, c in some])) if some else ():
            i, j = (int(np.searchsorted(edges, at, side="right")) - 1 for at in (a, b))
            blocks = shared.setdefault((some[i][0], some[j][0]), {}).setdefault(name, [])
            blocks.append((a - int(edges[i]), b - int(edges[j]), length))
    for (i, j), found in shared.items():
        yield from (
            _within(records[i], found, words) if i == j else _between(records[i], records[j], found, words)
        )


def _tells(channel: Channel) -> bool:
    """Return whether equal samples of a channel tell anything: a load is measured, a motion perhaps computed."""
    return channel.name == "moment" or (channel.noise > 0 and not channel.quantised)


def _within(record: Record, found: dict[str, list[Block]], words: Words) -> Iterator[Finding]:
    """Yield blocks that all channels have twice; a run that repeats to the last digit is simulated without noise."""
    every = [
        (a, b, length)
        for a, b, length in next(iter(found.values()))
        if all(np.array_equal(c.values[a : a + length], c.values[b : b + length]) for c in record.alive)
    ]
    share = sum(length for _, _, length in every) / record.n_samples
    if not every or share >= 0.5 or not any(c.noise > 0 for c in record.alive):
        return
    longest = max(length for _, _, length in every)
    yield words.finding(
        "repeated_block",
        record.name,
        None,
        "biases" if share <= SOUNDNESS.large_part else "stops",
        f"{len(every)} block(s) of up to {longest} samples ({1e3 * longest / record.sample_rate:.3g} ms) occur twice, "
        f"{100 * share:.2g} % of the run",
        "look at the buffer of the recorder and repeat the run, or cut it there and make two runs of it",
        tuple((b, b + length) for _, b, length in every),
    )


def _between(one: Record, other: Record, found: dict[str, list[Block]], words: Words) -> Iterator[Finding]:
    """Yield what a run has of another one: everything, or some of its channels."""
    shares = {name: sum(length for *_, length in blocks) / one.n_samples for name, blocks in found.items()}
    copied = [name for name, share in shares.items() if share >= SOUNDNESS.minor_share]
    if not copied:
        return
    a, b, length = max(found[copied[0]], key=lambda block: block[2])
    shift = f", {1e3 * abs(b - a) / other.sample_rate:.4g} ms apart" if a != b else ""
    share = min(shares[copied[0]], 1.0)
    if all(
        np.array_equal(values[a : a + length], other.channels[name][b : b + length])
        for name, values in one.channels.items()
        if name in other.channels
    ):
        yield words.finding(
            "duplicate_run",
            other.name,
            None,
            "biases" if share < 0.5 else "stops",
            f"{100 * share:.3g} % of its samples are those of run {one.name!r}{shift}",
            "leave one of the two runs out, or put in the run that was meant",
        )
        return
    for name in copied:
        yield Finding(
            "duplicate_channel",
            other.name,
            name,
            "stops",
            f"{100 * share:.3g} % of the samples of its {words.of(name)} are those of run {one.name!r}, those of the "
            "other channels are not",
            "two runs are mixed: the load of one is fitted to the motion of another, and no coefficient can be trusted",
            "put in the columns that were meant, or leave the run out",
        )


def find_scaled(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield runs, or channels of a run, that are another one scaled, noise included: one recording with another gain.

    What two sensors, or two recordings, have in common may be nearly all: a mode that friction rings, a filter, a run
    that was repeated. The noise of either is its own, and far above rounding.
    """
    loud = [r for r in records if any(c.noise > 0 for c in r.alive)]
    for record in loud if words.structure else ():
        for one, two in combinations(record.alive, 2):
            gain = _gain_of_copy(one.values, two.values)
            if gain is None and not np.array_equal(one.values, two.values):
                continue
            yield Finding(
                "duplicate_channel",
                record.name,
                two.name,
                "stops",
                f"the {words.of(two.name)} is the {words.of(one.name)}"
                + ("" if gain is None else f" times {gain:.4g}, noise included"),
                "one sensor stands for two places: what is recovered moves both alike, which the structure does not",
                "put in the column that was meant, or leave that sensor out",
            )
    for before, after in combinations(loud, 2):
        for one in before.alive:
            other = after.channel(one.name)
            # A motion without noise was prescribed, and is proportional in any two runs.
            if (
                other is not None
                and one.name != "rate"
                and one.noise != 0
                and (gain := _gain_of_copy(one.values, other.values)) is not None
            ):
                yield words.finding(
                    "scaled_copy",
                    after.name,
                    one.name,
                    "stops",
                    f"the {words.of(one.name)} is that of run {before.name!r} times {gain:.4g}, noise included",
                    "leave one of the two runs out, or put in the run that was meant",
                )


def _gain_of_copy(one: Array, other: Array) -> float | None:
    """Return the factor by which a channel is another one, noise included; None where it is not, or is the same."""
    if one.size != other.size:
        return None
    one, other = one[:LOOKED_AT], other[:LOOKED_AT]
    both, squares = float(one @ other), float(one @ one) * float(other @ other)
    # Nearly all that is no copy leaves more of its squares than a copy can.
    if squares - both**2 > one.size * PROPORTIONAL**2 * squares or np.array_equal(one, other):
        return None
    gain = both / float(one @ one)
    return gain if np.abs(other - gain * one).max() <= PROPORTIONAL * np.abs(other).max() else None
