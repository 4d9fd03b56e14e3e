"""Samples that the recorder lost: its time stamps go on, and what lies between them is missing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sindyjoint.numeric import main_frequency
from sindyjoint.record import Run
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY


def find_lost(run: Run) -> Iterator[Finding]:
    """Yield the samples of a run that were never recorded, or were left out before.

    A run that repeats has other periods that show what they were. Of one that does not, a gap that is short against the
    motion can be bridged; across a longer one derivatives would be invented.
    """
    if run.valid is None or run.valid.all():
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[True], run.valid, [True]]).astype(np.int8)))
    spans = tuple((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))
    missing = sum(b - a for a, b in spans)
    longest = max(b - a for a, b in spans)
    share = missing / run.n_samples
    period = run.sample_rate / main_frequency(run.angle, run.sample_rate)
    bridged = run.frequency is not None or longest <= POLICY.bridged_gap * period
    maskable = share <= POLICY.most_masked and bridged
    remedy = "those samples are left out; look at the buffer of the recorder"
    if not maskable:
        remedy = "make a run of each part between the gaps, or repeat it; look at the buffer of the recorder"
    yield Finding(
        "lost_samples",
        run.name,
        None,
        "biases" if maskable else "stops",
        f"{missing} samples in {len(spans)} place(s) are missing, {100 * share:.2g} % of the run, the first after "
        f"{spans[0][0] / run.sample_rate:.3g} s, at most {1e3 * longest / run.sample_rate:.3g} ms in a row",
        "read as if they followed each other, the samples beside a gap have a rate and a phase that never was: c1, M_F "
        "and k1",
        remedy,
        spans,
        maskable,
    )
