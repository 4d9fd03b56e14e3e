"""What is left out of every fit: samples at fault are marked and bridged, or filled in; dead ends are cut."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import SindyJointError, StandstillError
from sindyjoint.measurement import difference_noise
from sindyjoint.measurement.runs import with_channels
from sindyjoint.mechanics.rig_test import RigRun, RigTest
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.record import MINIMUM_SAMPLES, Campaign, Run
from sindyjoint.soundness import Finding, Spans, Words
from sindyjoint.soundness.detectors import Mask, Record, marked_of, record_of, spans_of
from sindyjoint.states import force_states
from sindyjoint.text import list_some

SATURATION, ENDS = "saturation", ("dead_start", "dead_tail")


def mask_faults(measured: Any, findings: Sequence[Finding]) -> tuple[Any, tuple[str, ...]]:
    """Return a campaign without the samples that can be left out, or a structure's test with them filled in.

    And a sentence for each kind of fault on it.

    Parameters
    ----------
    measured : Campaign or RigTest
    findings : sequence of Finding
        Those with ``masked`` set count. Runs too long for memory stay as they are.
    """
    runs: list[Any] = []
    counts: dict[str, dict[str, int]] = {}
    for run in measured.runs:
        own = [f for f in findings if f.masked and f.spans and f.run == run.name]
        runs.append(mask_run(run, own) if isinstance(run, Run) else _fill_run(run, own, measured.channels))
        for kind in dict.fromkeys(f.id for f in own) if runs[-1] is not run else ():
            some = [f for f in own if f.id == kind]
            counts.setdefault(kind, {})[run.name] = (
                int(np.count_nonzero(_find_samples(run, some)))
                if isinstance(run, Run)
                else sum(b - a for f in some for a, b in f.spans)
            )
    said = (
        f"{(samples := sum(some.values()))} sample{'s' * (samples > 1)} of {list_some(list(some))} "
        f"{'filled in' if isinstance(measured, RigTest) and kind not in ENDS else 'left out'}: {kind.replace('_', ' ')}"
        for kind, some in counts.items()
    )
    return replace(measured, runs=tuple(runs)) if counts else measured, tuple(said)


def leave_out_standstill(
    campaign: Campaign, words: Words
) -> tuple[Campaign, tuple[str, ...], tuple[Finding, ...]]:
    """Return the campaign without the runs in which the joint hardly moves, and a sentence that names them.

    All of it where it moves in none that is fitted, and that as a fault of each.
    """
    reasons = {run.name: reason for run in campaign.runs if (reason := _standstill(run))}
    moving = tuple(run for run in campaign.runs if run.name not in reasons)
    if not reasons:
        return campaign, (), ()
    if not any(run.use == "identify" for run in moving):
        remedy = (
            "excite it more, record longer, or measure the motion with less noise; where samples were not taken at a "
            "known rate, declare time = 'none'"
        )
        if not any(np.ptp(run.moment) for run in campaign.runs):
            # A release from standstill then shows, and smoothing takes nothing of the first swing.
            remedy = "record free decays from rest, at larger angles, with 40 samples in a period or more"
        return (
            campaign,
            (),
            tuple(
                words.finding(
                    "no_signal", run, "angle", "stops", reason.split(": ", 1)[-1].split("; ")[0], remedy
                )
                for run, reason in reasons.items()
            ),
        )
    left_out = (
        f"{list_some(list(reasons))} left out: the velocity hardly rises above its noise in "
        f"{'them' if len(reasons) > 1 else 'it'}"
    )
    return campaign.with_runs(moving), (left_out,), ()


def _standstill(run: Run) -> str:
    """Return why a run shows no motion of the joint; empty where it does."""
    if run.whole is not None:
        return ""
    try:
        force_states(run)
    except SindyJointError as error:  # other reasons are for what asks for the states to say
        return str(error) if isinstance(error, StandstillError) else ""
    return ""


def _spans(findings: Sequence[Finding], *channels: str | None) -> Spans:
    """Return the samples at fault of one of some channels."""
    return tuple(span for f in findings if f.channel in channels for span in f.spans)


def _period(run: Run | RigRun) -> float | None:
    """Return the samples in a period of the excitation."""
    return None if run.frequency is None else run.sample_rate / run.frequency


def _fill_run(run: RigRun, masked: Sequence[Finding], names: Sequence[str]) -> RigRun:
    if not masked:
        return run
    n = run.drive.size
    signals = np.array(
        [
            bridge(x, ~marked_of(_spans(masked, name), n), _period(run))
            for x, name in zip(run.signals, names, strict=True)
        ]
    )
    known = np.flatnonzero(~marked_of([span for f in masked if f.id in ENDS for span in f.spans], n))
    kept = slice(int(known[0]), int(known[-1]) + 1) if known.size >= MINIMUM_SAMPLES else slice(None)
    return replace(run, drive=signals[0, kept], responses=signals[1:, kept], lost=None)


def mask_run(run: Run, findings: Sequence[Finding]) -> Run:
    """Return a run with samples marked as not valid and their values bridged; a dead start or tail is cut off.

    Where too few samples would remain, or the run is too long for memory, it is returned as it is.
    """
    valid = ~_find_samples(run, findings)
    if run.valid is not None:
        valid &= run.valid
    known = np.flatnonzero(valid)
    if not findings or run.whole is not None or known.size < MINIMUM_SAMPLES:
        return run
    kept = slice(int(known[0]), int(known[-1]) + 1)
    signals: dict[str, Any] = {
        name: bridge(x[kept], ~marked_of(_spans(findings, name, None), run.n_samples)[kept], _period(run))
        for name, x in run.channels.items()
    }
    valid = valid[kept]
    # First the whole run's channels, which are as long as its marks; then these.
    fresh = with_channels(replace(run, valid=None, inputs={}), signals)
    inputs = {name: values[kept] for name, values in run.inputs.items()}
    return replace(fresh, valid=None if valid.all() else valid, inputs=inputs)


def _find_samples(run: Run, findings: Sequence[Finding]) -> Mask:
    """Return the samples that are left out because of some findings."""
    out = marked_of([span for f in findings for span in f.spans], run.n_samples)
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
    # A sample is used where the running mean keeps two noise levels away from the limit of a saturated channel: noise
    # outwards is cut off there, of 1 in 40 samples at two levels; three cost a quarter more.
    margin = 2.0 * difference_noise(signal)
    # Averaged over a fiftieth of the period a signal's course is separated from its noise.
    half = int(0.01 * run.sample_rate / main_frequency(signal, run.sample_rate))
    mean = np.convolve(
        np.pad(signal, half, mode="edge"), np.full(2 * half + 1, 1 / (2 * half + 1)), mode="valid"
    )
    clipped = signal[marked_of(finding.spans, signal.size)]
    middle = 0.5 * (signal.max() + signal.min())
    top, bottom = (
        clipped[clipped > middle].min(initial=np.inf),
        clipped[clipped < middle].max(initial=-np.inf),
    )
    return np.asarray((mean > top - margin) | (mean < bottom + margin))


def bridge_record(record: Record, findings: Sequence[Finding]) -> Record:
    """Return the record of a joint with the samples bridged that are lost, held or spikes, of one channel or of all."""
    found = [f for f in findings if f.run == record.name and f.id != SATURATION and f.spans]
    return record_of(mask_run(record.run, found)) if found and record.run else record


def bridge(signal: Array, valid: Mask, period: float | None = None) -> Array:
    """Return a signal whose samples that are not valid are interpolated.

    Across a gap runs the cubic of least squares through as many valid samples on either side as the gap is long, and at
    least four: it follows a turning point, as of a saturated peak, and averages noise. A gap longer than a quarter of a
    period, or at an end, is filled with the mean of the nearest periods instead.

    Parameters
    ----------
    signal : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    period : float, optional
        Of the excitation, samples.
    """
    filled = signal.copy()
    good = np.flatnonzero(valid)
    for start, stop in spans_of(~valid):
        gap = np.arange(start, stop)
        # What is long, or has nothing to lean on at the other side, is filled from the other periods.
        if period is not None and (gap.size > 0.25 * period or 0 in gap or signal.size - 1 in gap):
            filled[gap] = _fill_from_periods(signal, valid, gap, period)
            continue
        # Fewest samples on either side of a gap from which a cubic across it is estimated.
        before, beside = np.searchsorted(good, start), max(4, gap.size)
        near = good[max(before - beside, 0) : before + beside]
        if near[0] > start or near[-1] < stop:
            # At an end of the record there is nothing to lean on at the other side.
            filled[gap] = signal[near[0] if near[0] > start else near[-1]]
            continue
        centre = (start + stop - 1) / 2
        half = float(np.max(np.abs(near - centre)))
        cubic = np.linalg.lstsq(np.vander((near - centre) / half, 4), signal[near], rcond=None)[0]
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
