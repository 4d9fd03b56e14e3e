"""The faults of a campaign's data: one detector per fault, one list of findings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sindyjoint.record import Campaign, Run
from sindyjoint.soundness.finding import Finding

KINDS = ("saturation", "spikes")


def find_faults(campaign: Campaign) -> tuple[Finding, ...]:
    """Return every fault that the data of a campaign show, the severest first."""
    found = [f for run in campaign.runs for f in (*_saturation(run), *_spikes(run))]
    order = ("stops", "biases", "note")
    return tuple(sorted(found, key=lambda f: order.index(f.severity)))


def _spans(mask: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return tuple((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))


def _saturation(run: Run) -> Iterator[Finding]:
    for name in ("moment", "angle", "rate"):
        signal = getattr(run, name)
        if signal is None or np.ptp(signal) == 0:
            continue
        at = (signal == signal.max()) | (signal == signal.min())
        if np.count_nonzero(at) > max(8, 0.002 * signal.size):
            share = 100 * np.count_nonzero(at) / signal.size
            yield Finding(
                "saturation", run.name, name, "biases",
                f"{share:.1f} % of the samples at the highest or lowest value",
                "flattens the peaks: the stiffness seems to soften (k3)", "choose a larger range of the amplifier",
                _spans(at), True,
            )  # fmt: skip


def _spikes(run: Run) -> Iterator[Finding]:
    for name in ("moment", "angle", "rate"):
        signal = getattr(run, name)
        if signal is None or np.ptp(signal) == 0:
            continue
        centre = signal[1:-1] - 0.5 * (signal[2:] + signal[:-2])
        at = np.zeros(signal.size, dtype=bool)
        at[1:-1] = np.abs(centre) > 5 * np.sqrt(np.median(signal**2))
        at[1:-1] &= np.abs(signal[1:-1]) > np.maximum(np.abs(signal[2:]), np.abs(signal[:-2]))
        if np.any(at):
            yield Finding(
                "spikes", run.name, name, "note", f"{np.count_nonzero(at)} samples far from their neighbours",
                "would dominate the sum of squares of every coefficient", "check the cables and shields",
                _spans(at), True,
            )  # fmt: skip
