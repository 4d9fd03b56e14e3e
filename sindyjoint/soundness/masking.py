"""What is left out of every fit: samples at fault are marked and bridged, a dead tail is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array, main_frequency
from sindyjoint.record import MINIMUM_SAMPLES, Campaign, Run
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.states.noise import difference_noise
from sindyjoint.text import list_some

Mask = NDArray[np.bool_]

SATURATION = "saturation"
# Fewest samples on either side of a gap from which a cubic across it is estimated.
FEWEST_BESIDE = 4
# A gap that is a longer share of the period than this is filled from the other periods.
LONG_GAP = 0.25
# Half of the window, as a share of the period, over which a signal is averaged to separate its noise from its course.
AVERAGED = 0.01


def mask_campaign(campaign: Campaign, findings: Sequence[Finding]) -> tuple[Campaign, tuple[str, ...]]:
    """Return the campaign without the samples that can be left out, and a sentence for each kind of fault on it.

    Parameters
    ----------
    campaign : Campaign
    findings : sequence of Finding
        Those with ``masked`` set count. Runs too long for memory stay as they are.
    """
    masked = [f for f in findings if f.masked and f.spans]
    by_run = {run.name: [f for f in masked if f.run == run.name] for run in campaign.runs}
    runs = tuple(mask_run(run, by_run[run.name]) for run in campaign.runs)
    if all(new is old for new, old in zip(runs, campaign.runs, strict=True)):
        return campaign, ()
    counts: dict[str, dict[str, int]] = {}
    for new, old in zip(runs, campaign.runs, strict=True):
        if new is not old:
            for kind in dict.fromkeys(f.id for f in by_run[old.name]):
                left = _find_samples(old, [f for f in by_run[old.name] if f.id == kind])
                counts.setdefault(kind, {})[old.name] = int(np.count_nonzero(left))
    return campaign.with_runs(runs), tuple(_word_masked(kind, runs) for kind, runs in counts.items())


def _word_masked(kind: str, counts: dict[str, int]) -> str:
    samples = sum(counts.values())
    return f"{samples} sample{'s' * (samples > 1)} of {list_some(list(counts))} left out: {kind.replace('_', ' ')}"


def mask_run(run: Run, findings: Sequence[Finding]) -> Run:
    """Return a run with samples marked as not valid and their values bridged; a dead start or tail is cut off.

    Where too few samples would remain, or the run is too long for memory, it is returned as it is.
    """
    if not findings or run.whole is not None:
        return run
    valid = ~_find_samples(run, findings)
    if run.valid is not None:
        valid &= run.valid
    if np.count_nonzero(valid) < MINIMUM_SAMPLES:
        return run
    known = np.flatnonzero(valid)
    kept = slice(int(known[0]), int(known[-1]) + 1)
    period = None if run.frequency is None else run.sample_rate / run.frequency
    signals: dict[str, Any] = {}
    for name, signal in run.channels.items():
        spans = [span for f in findings if f.channel in (name, None) for span in f.spans]
        signals[name] = bridge(signal[kept], ~_mark(spans, run.n_samples)[kept], period)
    valid = valid[kept]
    # First the whole run's channels, which are as long as its marks; then these.
    fresh = replace(run, valid=None, inputs={}).with_channels(signals)
    inputs = {name: values[kept] for name, values in run.inputs.items()}
    return replace(fresh, valid=None if valid.all() else valid, inputs=inputs)


def _mark(spans: Sequence[tuple[int, int]], n: int) -> Mask:
    marked = np.zeros(n, dtype=bool)
    for start, stop in spans:
        marked[max(start, 0) : stop] = True
    return marked


def _find_samples(run: Run, findings: Sequence[Finding]) -> Mask:
    """Return the samples that are left out because of some findings."""
    out = _mark([span for f in findings for span in f.spans], run.n_samples)
    for finding in findings:
        if finding.id == SATURATION and finding.channel in run.channels:
            out |= _find_censored(run, finding)
    return out


def _find_censored(run: Run, finding: Finding) -> Mask:
    """Return the samples whose noise may have been cut off at the limit of the range.

    Of samples that lie near the limit on average, those with noise inwards remain and those with noise outwards are
    clipped: to leave out only the latter would shift every coefficient. So all are left out whose running mean is
    nearer to the limit than twice the noise.
    """
    signal = run.channels[str(finding.channel)]
    margin = POLICY.censored_sigmas * difference_noise(signal)
    half = int(AVERAGED * run.sample_rate / main_frequency(signal, run.sample_rate))
    mean = np.convolve(
        np.pad(signal, half, mode="edge"), np.full(2 * half + 1, 1 / (2 * half + 1)), mode="valid"
    )
    clipped = signal[_mark(finding.spans, signal.size)]
    middle = 0.5 * (signal.max() + signal.min())
    out = np.zeros(signal.size, dtype=bool)
    if np.any(clipped > middle):
        out |= mean > np.min(clipped[clipped > middle]) - margin
    if np.any(clipped < middle):
        out |= mean < np.max(clipped[clipped < middle]) + margin
    return out


def bridge(signal: Array, valid: Mask, period: float | None = None) -> Array:
    """Return a signal whose samples that are not valid are interpolated.

    Across a gap runs the cubic of least squares through as many valid samples on either side as the gap is long, and at
    least four: it follows a turning point, as of a saturated peak, and averages noise. A gap longer than a quarter of a
    period is filled with the mean of the nearest periods instead.

    Parameters
    ----------
    signal : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    period : float, optional
        Of the excitation, samples.
    """
    filled = signal.copy()
    good = np.flatnonzero(valid)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], valid, [True]]).astype(np.int8)))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        gap = np.arange(start, stop)
        if period is not None and gap.size > LONG_GAP * period:
            filled[gap] = _fill_from_periods(signal, valid, gap, period)
            continue
        before, beside = np.searchsorted(good, start), max(FEWEST_BESIDE, gap.size)
        near = good[max(before - beside, 0) : before + beside]
        if near[0] > start or near[-1] < stop:
            # At an end of the record there is nothing to lean on at the other side.
            filled[gap] = signal[near[0] if near[0] > start else near[-1]]
            continue
        centre = (start + stop - 1) / 2
        half = float(np.max(np.abs(near - centre)))
        powers = np.vander((near - centre) / half, 4)
        cubic = np.linalg.lstsq(powers, signal[near], rcond=None)[0]
        filled[gap] = np.polyval(cubic, (gap - centre) / half)
    return filled


def _fill_from_periods(signal: Array, valid: Mask, gap: NDArray[np.intp], period: float) -> Array:
    """Return the mean of the nearest two valid samples whole periods before and after; linear where there is none."""
    n = signal.size
    indices = np.arange(n)
    total, count = np.zeros(gap.size), np.zeros(gap.size)
    for lag in range(1, int(n / period) + 1):
        for place in (gap - lag * period, gap + lag * period):
            low = np.clip(np.floor(place).astype(int), 0, n - 2)
            usable = (place >= 0) & (place <= n - 1) & valid[low] & valid[low + 1] & (count < 2)
            total += np.where(usable, np.interp(place, indices, signal), 0.0)
            count += usable
        if np.all(count >= 2):
            break
    linear = np.interp(gap, indices[valid], signal[valid])
    return np.where(count > 0, total / np.maximum(count, 1), linear)
