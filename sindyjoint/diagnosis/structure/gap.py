"""The response gap of a pulse test: how large, and where in time, amplitude and frequency it lies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.localisation import Place, Regions
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.result import RecordGap
from sindyjoint.diagnosis.structure.output_error import Fit, fit
from sindyjoint.diagnosis.structure.pulses import PulseProblem
from sindyjoint.numeric import Array, main_frequency, rms
from sindyjoint.response.oscillation import hilbert_envelope


def record_gaps(problem: PulseProblem, best: Fit, others: Sequence[PulseProblem]) -> tuple[RecordGap, ...]:
    """Return what was held out beside the simulations: other pulses, or the second half of these."""
    if others:
        return tuple(gap for each in others for gap in _beside(each, problem, best.x, 0.0, each.rig.name))
    ends = [_audible_end(problem, i) for i in range(len(problem.records))]
    middle = 0.5 * min(max(ends), problem.duration)
    half = fit(problem, best.x, middle, iterations=4)
    return tuple(_beside(problem, problem, best.x if half is None else half.x, middle, ""))


def _beside(
    measured_in: PulseProblem, fitted: PulseProblem, x: Array, held_from: float, name: str
) -> Iterator[RecordGap]:
    given, repaired = (replace(measured_in, found=found) for found in ((), fitted.found))
    before = given.simulate(given.setup(given.start()), given.duration)
    after = repaired.simulate(repaired.setup(x), given.duration)
    for i, (record, noise) in enumerate(zip(given.records, given.noise, strict=True)):
        measured, rate = record.displacement, record.sample_rate
        first = int(held_from * rate)
        held = slice(first, max(int(_audible_end(given, i) * rate), first + 8))
        own = float(np.std(measured[held]))
        shown = (None if before is None else before[i], None if after is None else after[i])
        yield RecordGap(
            f"{record.point} of {name}" if name else record.point,
            np.arange(measured.size) / rate, measured, *shown, noise.sigma, held_from,
            relative_gap(measured, shown[0], held), relative_gap(measured, shown[1], held),
            noise.sigma / own if own > 0 else float("nan"),
        )  # fmt: skip


def _audible_end(problem: PulseProblem, record: int) -> float:
    each = problem.records[record]
    noise, policy = problem.noise[record].sigma, problem.policy
    return audible_end(each.displacement, each.sample_rate, policy.audible * noise)


def audible_end(measured: Array, sample_rate: float, least: float) -> float:
    """Return the time at which the envelope of a decay falls below a level, or the end of the record, s."""
    envelope, _ = hilbert_envelope(measured, sample_rate)
    loud = np.flatnonzero(envelope > least)
    return float((loud[-1] + 1 if loud.size else measured.size) / sample_rate)


def relative_gap(measured: Array, simulated: Array | None, held: slice) -> float:
    """Return the RMS of simulated less measured over a part of a record, relative to the record's own there."""
    if simulated is None:
        return float("nan")
    own = float(np.std(measured[held]))
    return rms(simulated[held] - measured[held]) / own if own > 0 else float("nan")


def locate_gap(problem: PulseProblem) -> list[tuple[float, Place]]:
    """Return the regions of the records that hold more of the gap than their share; none where nothing simulates."""
    shown = problem.simulate(problem.setup(problem.start()), problem.duration)
    return [
        region
        for record, noise, signal in zip(problem.records, problem.noise, shown or (), strict=shown is not None)
        for region in regions_of(
            record.displacement, signal, record.sample_rate, noise.sigma,
            f" at {record.point}" if len(problem.records) > 1 else "", problem.policy,
        )
    ]  # fmt: skip


def regions_of(
    measured: Array,
    simulated: Array,
    sample_rate: float,
    noise: float,
    at: str = "",
    policy: DiagnosisPolicy = STRUCTURE,
) -> list[tuple[float, Place]]:
    """Return the regions that hold more of a record's gap than their share of it, each with its information.

    Signals and the RMS of the noise are in m; ``at`` ends the words, with the point where there are several records.
    """
    residual = simulated - measured
    power = np.maximum(residual**2 - noise**2, 0.0)
    if not power.any():
        return []
    time = np.arange(measured.size) / sample_rate
    end = audible_end(measured, sample_rate, policy.audible * noise)
    envelope, _ = hilbert_envelope(measured, sample_rate)
    height = envelope / float(envelope.max())
    regions = Regions(power, "record", policy)
    for low, high in zip((0.0, 0.05, 0.25, 0.5, 0.75), (0.05, 0.25, 0.5, 0.75, 1.0), strict=True):
        words = f"from {low * end:.3g} s to {high * end:.3g} s{at}"
        regions.add("time", (low * end, high * end), words, (time >= low * end) & (time < high * end))
    for low, high in ((0.0, 0.1), (0.1, 0.3), (0.3, 0.6), (0.6, 1.01)):
        top = min(high, 1.0)
        words = f"while the swing is {100 * low:.0f} % to {100 * top:.0f} % of the largest{at}"
        regions.add("amplitude", (low, top), words, (height >= low) & (height < high))
    _add_frequencies(regions, residual, measured, sample_rate, noise, at)
    return regions.found + _phase(simulated, measured, sample_rate, at, policy)


def _add_frequencies(
    regions: Regions, residual: Array, measured: Array, sample_rate: float, noise: float, at: str
) -> None:
    """Add frequency bands whose share of the gap is larger than their share of the response."""
    main = main_frequency(measured, sample_rate)
    frequency = np.fft.rfftfreq(residual.size, 1 / sample_rate)
    window = np.hanning(residual.size)
    gap = np.maximum(np.abs(np.fft.rfft(residual * window)) ** 2 - noise**2 * float(np.sum(window**2)), 0.0)
    own = np.abs(np.fft.rfft((measured - measured.mean()) * window)) ** 2
    for low, high, words in (
        (0.0, 0.5, f"below {0.5 * main:.3g} Hz, under the main line"),
        (1.5, np.inf, f"above {1.5 * main:.3g} Hz, over the main line"),
    ):
        mask = (frequency >= low * main) & (frequency < high * main)
        share, samples = float(gap[mask].sum() / gap.sum()), float(own[mask].sum() / own.sum())
        text = f"{words}{at}: {100 * share:.0f} % of the gap, {100 * samples:.0f} % of the response"
        span = (low * main, min(high * main, sample_rate / 2))
        regions.weigh("frequency", span, share, samples, text)


def _phase(
    simulated: Array, measured: Array, sample_rate: float, at: str, policy: DiagnosisPolicy
) -> list[tuple[float, Place]]:
    """Return whether the gap is one of amplitudes or of periods.

    For the analytic signals S and M, |S − M|² = (|S| − |M|)² + 4·|S|·|M|·sin²(Δφ/2).
    """
    from scipy.signal import hilbert

    cut = round(sample_rate / main_frequency(measured, sample_rate))
    if measured.size < 4 * cut:
        return []
    mine, other = (hilbert(x - x.mean())[cut:-cut] for x in (simulated, measured))
    amplitude = float(np.sum((np.abs(mine) - np.abs(other)) ** 2))
    total = float(np.sum(np.abs(mine - other) ** 2))
    if not total > 0:
        return []
    return [
        (share * 0.5, Place("phase", span, share, f"{words}{at}: {100 * share:.0f} % of the gap"))
        for share, span, words in (
            (1 - amplitude / total, "period", "the periods differ, and with them the phase"),
            (amplitude / total, "amplitude", "the amplitudes differ"),
        )
        if share > policy.phase_share
    ]
