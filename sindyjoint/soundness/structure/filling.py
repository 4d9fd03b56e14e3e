"""Samples of a structure's channels that are filled in: across short gaps, or from the other periods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.mechanics.rig_test import DRIVE, RigRun, RigTest
from sindyjoint.record import MINIMUM_SAMPLES
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.masking import bridge
from sindyjoint.text import list_some

TAIL = "dead_tail"


def fill_test(test: RigTest, findings: Sequence[Finding]) -> tuple[RigTest, tuple[str, ...]]:
    """Return a test whose samples at fault are filled in, its dead tails cut, and a sentence for each kind of fault."""
    masked = [f for f in findings if f.masked and f.spans]
    if not masked:
        return test, ()
    names = [DRIVE, *(sensor.name for sensor in test.sensors)]
    runs = tuple(filled_run(run, [f for f in masked if f.run == run.name], names) for run in test.runs)
    words = []
    for kind in dict.fromkeys(f.id for f in masked):
        of_kind = [f for f in masked if f.id == kind]
        samples = sum(b - a for f in of_kind for a, b in f.spans)
        where = list_some(list(dict.fromkeys(str(f.run) for f in of_kind)))
        done = "left out" if kind == TAIL else "filled in"
        words.append(f"{samples} sample{'s' * (samples > 1)} of {where} {done}: {kind.replace('_', ' ')}")
    return replace(test, runs=runs), tuple(words)


def filled_run(run: RigRun, findings: Sequence[Finding], names: Sequence[str] = ()) -> RigRun:
    """Return a run with the samples of its masked findings filled in, or cut where its tail is dead.

    Parameters
    ----------
    run : RigRun
    findings : sequence of Finding
        Of the run; those with ``masked`` set count.
    names : sequence of str
        Of the channels.
    """
    masked = [f for f in findings if f.masked and f.spans]
    if not masked:
        return run
    signals = run.signals.copy()
    period = None if run.frequency is None else run.sample_rate / run.frequency
    for number, name in enumerate(names):
        spans = [span for f in masked if f.channel == name for span in f.spans]
        if spans:
            valid = np.ones(run.drive.size, dtype=bool)
            for start, stop in spans:
                valid[start:stop] = False
            signals[number] = bridge(signals[number], valid, period)
    ends = [f.spans[0][0] for f in masked if f.id == TAIL]
    last = min(ends) if ends and min(ends) >= MINIMUM_SAMPLES else run.drive.size
    return replace(run, drive=signals[0, :last], responses=signals[1:, :last])
