"""By what a campaign is known, and a run with its channels aligned."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sindyjoint.inputs import lagged
from sindyjoint.numeric import delayed
from sindyjoint.record import Campaign, Run


def content_hash(campaign: Campaign) -> str:
    """Return the hash by which a campaign is known: of the samples, rates and frequencies of its runs.

    What a run is used for, and where its file lies, do not change it.
    """
    digest = hashlib.sha256(campaign.joint.motion.encode())
    for run in campaign.runs:
        digest.update(repr((run.name, float(run.sample_rate), run.frequency, run.n_samples)).encode())
        for signal in (run.moment, run.angle, run.rate):
            digest.update(b"-" if signal is None else np.ascontiguousarray(signal).tobytes())
        for name, values in sorted(run.inputs.items()):
            digest.update(name.encode() + np.ascontiguousarray(values).tobytes())
        if run.whole is not None and run.source is not None:
            digest.update(run.source.sha256.encode())
    return f"sha256:{digest.hexdigest()}"


def aligned_run(run: Run, delay: float) -> Run:
    """Return a run whose motion comes ``delay`` s later, by cubic splines, without the ends where it is not known.

    A lag of the moment behind the motion is thereby undone.
    """
    lost = int(np.ceil(abs(delay * run.sample_rate))) + 1
    kept = slice(lost, run.n_samples - lost)
    later = with_later_motion(run, delay)
    rate = None if later.rate is None else later.rate[kept]
    valid = None if run.valid is None else run.valid[kept]
    inputs = {name: values[kept] for name, values in run.inputs.items()}
    return replace(
        run, angle=later.angle[kept], rate=rate, moment=run.moment[kept], valid=valid, inputs=inputs
    )


def with_later_motion(run: Run, delay: float) -> Run:
    """Return a run whose motion comes ``delay`` s later, as long as it was: at its ends it stands still."""
    samples = delay * run.sample_rate
    rate = None if run.rate is None else delayed(run.rate, samples)
    return replace(run, angle=delayed(run.angle, samples), rate=rate)


def with_lags(campaign: Campaign, lags: Mapping[str, float]) -> Campaign:
    """Return a campaign whose inputs are as the joint follows them; lags that are declared stay.

    Parameters
    ----------
    campaign : Campaign
    lags : mapping of str to float
        Time constants, s, by the names of inputs.
    """
    own = {each.name: lags.get(each.name, 0.0) for each in campaign.inputs if not each.lag}
    own = {name: time for name, time in own.items() if time}
    if not own or campaign.quasi_static:
        return campaign
    runs = tuple(
        replace(run, inputs={n: lagged(v, own.get(n, 0.0) * run.sample_rate) for n, v in run.inputs.items()})
        for run in campaign.runs
    )
    inputs = tuple(replace(each, lag=own.get(each.name, each.lag)) for each in campaign.inputs)
    return replace(campaign, runs=runs, inputs=inputs)
