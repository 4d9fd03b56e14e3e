"""By what a campaign is known, and a run with its channels aligned."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from sindyjoint.inputs import lagged
from sindyjoint.numeric import Array, delayed
from sindyjoint.record import Campaign, Run

# Of a run's hash: two of a million runs would share so many in one of 10⁷ cases.
HASH_DIGITS = 16


def content_hash(campaign: Campaign) -> str:
    """Return the hash by which a campaign is known: of the samples, rates and frequencies of its runs.

    What a run is used for, and where its file lies, do not change it.
    """
    digest = hashlib.sha256(campaign.joint.motion.encode())
    for run in campaign.runs:
        digest.update(repr((run.name, float(run.sample_rate), run.frequency, run.n_samples)).encode())
        digest.update(b"".join(_content(run)))
    return f"sha256:{digest.hexdigest()}"


def run_hash(run: Run) -> str:
    """Return the hash by which a run is known, whatever its name: of its samples and their rate."""
    return signals_hash(run.sample_rate, _content(run))


def signals_hash(sample_rate: float, signals: Iterable[bytes | Array]) -> str:
    """Return the hash of what was recorded at a rate, Hz."""
    digest = hashlib.sha256(repr(float(sample_rate)).encode())
    for signal in signals:
        digest.update(signal if isinstance(signal, bytes) else np.ascontiguousarray(signal).tobytes())
    return digest.hexdigest()[:HASH_DIGITS]


def _content(run: Run) -> list[bytes]:
    parts = [b"-" if signal is None else np.ascontiguousarray(signal).tobytes()
             for signal in (run.moment, run.angle, run.rate)]  # fmt: skip
    parts += [
        name.encode() + np.ascontiguousarray(values).tobytes() for name, values in sorted(run.inputs.items())
    ]
    return parts + ([run.source.sha256.encode()] if run.whole is not None and run.source is not None else [])


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
