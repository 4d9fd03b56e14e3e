"""The response gap of records: how large, and where in time, amplitude and frequency, or in which segment, it lies."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from sindyjoint.diagnosis.parts import Place, Regions, most_informative
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.result import RecordGap
from sindyjoint.diagnosis.structure import Fit, fit
from sindyjoint.diagnosis.structure.pulses import PulseProblem
from sindyjoint.diagnosis.structure.runs import RunsProblem, channels_of
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.rig_test import UNITS
from sindyjoint.numeric import Array, analytic, main_frequency
from sindyjoint.response.oscillations import hilbert_envelope
from sindyjoint.substructure.simulated import series
from sindyjoint.substructure.simulated.segments import SegmentedRun


def beside(
    name: str,
    time: Array,
    signals: Sequence[Any],
    compared: Sequence[Any],
    own: float,
    noise: float,
    sigma: float,
    held_from: float = 0.0,
    quantity: str = "displacement",
) -> RecordGap:
    """Return a record beside its simulations before and after the effects were added.

    Parameters
    ----------
    name : str
    time, signals
        What is drawn: measured, before and after; None for no simulation.
    compared : sequence of ndarray
        What is compared of these, of any shape.
    own, noise : float
        Norms of the measured one, and of the noise, in what is compared.
    sigma, held_from, quantity
        As of the record.
    """
    (measured, before, after), (truth, *simulated) = signals, compared
    own = own or float("nan")
    old, new = (np.nan if each is None else float(np.linalg.norm(each - truth)) / own for each in simulated)
    return RecordGap(
        name, time, measured, before, after, sigma, held_from, old, new, noise / own, quantity,
        UNITS[quantity].replace("**2", "²"),
    )  # fmt: skip


def each_of(signals: Iterable[Any], part: Callable[[Any], Any]) -> list[Any]:
    """Return a part of every signal; None of what could not be simulated."""
    return [None if each is None else part(each) for each in signals]


def record_gaps(problem: PulseProblem, best: Fit, others: Sequence[PulseProblem]) -> tuple[RecordGap, ...]:
    """Return what was held out beside the simulations: other pulses, or the second half of these."""
    if others:
        return tuple(
            gap for each in others for gap in _held(each, problem, best.x, 0.0, f" of {each.rig.name}")
        )
    middle = 0.5 * min(max(_audible_ends(problem)), problem.duration)
    half = fit(problem, best.x, middle, iterations=4)
    return tuple(_held(problem, problem, best.x if half is None else half.x, middle, ""))


def _held(
    measured_in: PulseProblem, fitted: PulseProblem, x: Array, held_from: float, name: str
) -> Iterator[RecordGap]:
    given, repaired = (replace(measured_in, found=found) for found in ((), fitted.found))
    pair = [
        given.simulate(given.setup(given.start()), given.duration),
        repaired.simulate(repaired.setup(x), given.duration),
    ]
    for i, (record, noise, end) in enumerate(
        zip(given.records, given.noise, _audible_ends(given), strict=True)
    ):
        measured, rate = record.displacement, record.sample_rate
        first = int(held_from * rate)
        held = slice(first, max(int(end * rate), first + 8))
        signals = [measured, *each_of(pair, itemgetter(i))]
        root = float(np.sqrt(measured[held].size))
        yield beside(
            f"{record.point}{name}", np.arange(measured.size) / rate, signals, each_of(signals, itemgetter(held)),
            root * float(np.std(measured[held])), root * noise.sigma, noise.sigma, held_from,
        )  # fmt: skip


def _audible_ends(problem: PulseProblem) -> list[float]:
    return [
        audible_end(record.displacement, record.sample_rate, problem.policy.significant * noise.sigma)
        for record, noise in zip(problem.records, problem.noise, strict=True)
    ]


def audible_end(measured: Array, sample_rate: float, least: float) -> float:
    """Return the time at which the envelope of a decay falls below a level, or the end of the record, s."""
    envelope, _ = hilbert_envelope(measured, sample_rate)
    loud = np.flatnonzero(envelope > least)
    return float((loud[-1] + 1 if loud.size else measured.size) / sample_rate)


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
    end = audible_end(measured, sample_rate, policy.significant * noise)
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
    cut = round(sample_rate / main_frequency(measured, sample_rate))
    if measured.size < 4 * cut:
        return []
    mine, other = (analytic(x - x.mean())[cut:-cut] for x in (simulated, measured))
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


def steady_gaps(given: RunsProblem, repaired: RunsProblem, x: Array) -> Iterator[RecordGap]:
    """Yield every sensor of every run that repeats over some periods beside its simulations.

    Gaps are those of the harmonics that are compared; parameters as of :func:`segment_gaps`.
    """
    for place, run in enumerate(given.runs):
        # Of the pictures eight periods, 64 samples of each.
        time = np.arange(8 * 64) / 64 * 2 * np.pi / run.omega
        answers = given.answer(place, given.start()), repaired.answer(place, x)
        shown = [run.measured, *each_of(answers, itemgetter(1))]
        waves = each_of(shown, partial(series, omega=run.omega, time=time))
        for sensor, channel in enumerate(given.test.sensors):
            compared = each_of(shown, itemgetter(sensor))
            noise = float(np.sqrt(2 * np.sum(run.sigma[sensor] ** 2)))
            yield beside(
                f"{channel.name}, {run.name}", time, each_of(waves, itemgetter(sensor)), compared,
                float(np.linalg.norm(compared[0])), noise, noise / np.sqrt(2), quantity=channel.quantity,
            )  # fmt: skip


def segment_gaps(given: RunsProblem, repaired: RunsProblem, x: Array) -> Iterator[RecordGap]:
    """Yield every sensor of every run that does not repeat beside its simulations.

    Gaps are those of all its segments, each from the state from which it fits best; signals those of the one in which
    the sensor shows most.

    Parameters
    ----------
    given, repaired : RunsProblem
        Without effects and with them.
    x : ndarray
        The numbers of the repaired one.
    """
    for record in given.records:
        before, _ = _simulate(given, record, given.start())
        after, weighed = _simulate(repaired, record, x)
        measured = [record.measured[:, a:b] for a, b in record.spans]
        shown = each_of((measured, before, after), lambda segments: list(zip(*segments, strict=True)))
        for sensor, channel in enumerate(record.test.sensors):
            pieces = each_of(shown, itemgetter(sensor))
            loudest = int(np.argmax([np.mean(part**2) for part in pieces[0]]))
            time = np.arange(*record.spans[loudest]) / record.rate
            compared, sigma = each_of(pieces, np.concatenate), float(weighed.sigma[sensor])
            rows = sum(part.size / s**2 for part, s in zip(pieces[0], weighed.weights, strict=True))
            yield beside(
                f"{channel.name}, {record.name}", time, each_of(pieces, itemgetter(loudest)), compared,
                float(np.linalg.norm(compared[0])), sigma * float(np.sqrt(rows)), sigma, float(time[0]),
                channel.quantity,
            )  # fmt: skip


def _simulate(
    problem: RunsProblem, record: SegmentedRun, x: Array
) -> tuple[list[Array] | None, SegmentedRun]:
    """Return what the sensors show of each segment, shape (sensors, n), from where it fits best; None without a motion.

    And the run with its noise as it was measured there.
    """
    try:
        reduced = problem.simulated(record, x)
        settled = record.settled(reduced).with_measured_noise(reduced)
        shown = [each for each, _ in settled.motions(reduced, channels_of(problem.setup(x)))]
        return shown, settled.with_noise_of_drive(reduced)
    except (SimulationError, InputError, np.linalg.LinAlgError):
        return None, record


def locate_segments(problem: RunsProblem) -> tuple[Place, ...]:
    """Return in which run, at which time and at which sensor the gap of the given models lies."""
    residual = problem.residuals(problem.start())
    if residual is None:
        return ()
    rows, sensors = sum(record.rows for record in problem.records), problem.test.sensors
    last, cells, runs, times = residual[residual.size - rows :], [], [], []
    for record in problem.records:
        for first, stop in record.spans:
            own, last = np.split(last, [record.segment_rows(first, stop)])
            cells.append(np.maximum(np.sum(own.reshape(len(sensors), -1) ** 2 - 1, axis=1), 0.0))
            runs.append(record.name)
            times.append(f"{record.name} from {first / record.rate:.3g} s to {stop / record.rate:.3g} s")
    axes = (
        ("run", "in run", 0, runs),
        ("time", "in", 0, times),
        ("sensor", "at sensor", 1, [s.name for s in sensors]),
    )
    return cells_of_gap(np.array(cells), "segments", axes, problem.policy)


def cells_of_gap(
    excess: Array, kind: str, axes: Sequence[tuple[str, str, int, Sequence[str]]], policy: DiagnosisPolicy
) -> tuple[Place, ...]:
    """Return along which labels what cells have beyond the noise lies.

    Parameters
    ----------
    excess : ndarray
        Of every cell.
    kind : str
        What the cells are.
    axes : sequence of (name, words, axis, labels)
        Labels along an axis of the cells; several may be alike.
    policy : DiagnosisPolicy
    """
    if not excess.any():
        return ()
    regions = Regions(excess.ravel(), kind, policy)
    for name, words, axis, labels in axes:
        for label in dict.fromkeys(labels):
            mask = np.zeros(excess.shape, dtype=bool)
            mask[(slice(None),) * axis + (np.array(labels) == label,)] = True
            regions.add(name, label, f"{words} {label}", mask.ravel())
    return most_informative(regions.found, policy, one_per_axis=True)
