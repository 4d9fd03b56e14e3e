"""Identifiability notes: what a campaign cannot show, reported with every diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.record import Campaign
from sindyjoint.soundness.policy import POLICY
from sindyjoint.states import ForceStates
from sindyjoint.text import in_words_of, list_some

# Share of a record left out as start-up from which it is reported.
LARGE_DROP = 0.25


def identifiability_notes(campaign: Campaign, states: Sequence[ForceStates]) -> list[str]:
    """Return one line for each question that a campaign's runs leave open.

    Parameters
    ----------
    campaign : Campaign
    states : sequence of ForceStates
        Of the runs that may be used for identification, whole.
    """
    lines = [*campaign.warnings]
    if len(states) == 1:
        held = (
            "the runs kept for validation are all there is to check it"
            if campaign.validation_runs
            else "nothing could be held out, the gaps are those of segments of that run"
        )
        lines.append(f"one run only: {held}")
    frequencies = [s.frequency for s in states if s.frequency is not None]
    if len(frequencies) == len(states) and max(frequencies) < POLICY.same * min(frequencies):
        line = "one frequency only: effects of frequency, rate and inertia cannot be distinguished"
        lines.append(in_words_of(campaign.joint.motion, line))
    ranges = [float(np.ptp(s.angle)) for s in states]
    periodic = [s for s in states if s.method == "periodic"]
    if len(periodic) == len(states) and max(ranges) < POLICY.same_level * min(ranges):
        lines.append("one level only: effects of amplitude cannot be distinguished")
    if campaign.quasi_static:
        lines.append("the noise was estimated from neighbouring samples of the path, not from repetition")
    elif not periodic:
        lines.append("no run repeats: noise was estimated from the spectrum, not from repetition")
    short = [
        s.run
        for s in periodic
        if s.frequency and s.n_samples * s.frequency < POLICY.few_periods * s.sample_rate
    ]
    if short:
        lines.append(
            f"fewer than {POLICY.few_periods} periods in {list_some(short)}: what changes in time cannot be seen"
        )
    ends = {run.name: run.duration for run in campaign.runs}
    late = [s.run for s in periodic if s.dropped > LARGE_DROP * ends[s.run]]
    if late:
        lines.append(
            f"{100 * max(s.dropped / ends[s.run] for s in periodic):.0f} % of the record was left out as start-up in "
            f"{list_some(late)}: what changed in that time was not examined"
        )
    return lines
