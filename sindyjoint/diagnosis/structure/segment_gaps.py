"""The gap of runs of a structure that do not repeat: segments beside their simulations."""

from __future__ import annotations

import numpy as np

from sindyjoint.diagnosis.localisation import Place, Regions, most_informative
from sindyjoint.diagnosis.result import RecordGap
from sindyjoint.diagnosis.structure.records import RecordsProblem, channels_of
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.numeric import Array
from sindyjoint.substructure.simulated.segments import SegmentedRun

UNITS = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}


def segment_gaps(given: RecordsProblem, repaired: RecordsProblem, x: Array) -> list[RecordGap]:
    """Return every sensor of every run that does not repeat beside its simulations.

    Gaps are those of all its segments, each from the state from which it fits best; signals those of the one in which
    the sensor shows most.

    Parameters
    ----------
    given, repaired : RecordsProblem
        Without effects and with them.
    x : ndarray
        The numbers of the repaired one.
    """
    found = []
    for record in given.records:
        before, _ = _simulate(given, record, given.start())
        after, weighed = _simulate(repaired, record, x)
        found += [_gap(weighed, sensor, (before, after)) for sensor in range(len(record.sigma))]
    return found


def _simulate(
    problem: RecordsProblem, record: SegmentedRun, x: Array
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


def _gap(record: SegmentedRun, sensor: int, pair: tuple[list[Array] | None, ...]) -> RecordGap:
    shares = record.shares or (1.0,) * len(record.spans)
    parts = [record.measured[sensor, a:b] for a, b in record.spans]
    size = float(np.sqrt(sum(float(np.sum(part**2)) for part in parts)))
    shown = int(np.argmax([np.mean(part**2) for part in parts]))

    def gap(simulated: list[Array] | None) -> float:
        if simulated is None:
            return float("nan")
        pairs = zip(simulated, parts, strict=True)
        return float(np.sqrt(sum(float(np.sum((s[sensor] - part) ** 2)) for s, part in pairs))) / size

    before, after = (None if each is None else each[shown][sensor] for each in pair)
    channel, sigma = record.test.sensors[sensor], float(record.sigma[sensor])
    noise = sigma * float(np.sqrt(sum(part.size / s**2 for part, s in zip(parts, shares, strict=True))))
    time = np.arange(record.spans[shown][0], record.spans[shown][1]) / record.rate
    return RecordGap(
        f"{channel.name}, {record.name}", time, parts[shown], before, after, sigma, float(time[0]),
        gap(pair[0]), gap(pair[1]), noise / size,
        channel.quantity, UNITS[channel.quantity],
    )  # fmt: skip


def measured_power(problem: RecordsProblem) -> float:
    """Return the sum of squares of what the sensors show of all segments, in their noise and that of the drive."""
    total = 0.0
    for record in problem.records:
        shares = record.shares or (1.0,) * len(record.spans)
        for (a, b), share in zip(record.spans, shares, strict=True):
            total += float(np.sum((share * record.measured[:, a:b] / record.sigma[:, None]) ** 2))
    return total


def locate_segments(problem: RecordsProblem) -> tuple[Place, ...]:
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
    excess = np.array(cells)
    if not excess.any():
        return ()
    regions = Regions(excess.ravel(), "segments", problem.policy)
    axes = (
        ("run", "in run", 0, runs),
        ("time", "in", 0, times),
        ("sensor", "at sensor", 1, [s.name for s in sensors]),
    )
    for name, words, axis, labels in axes:
        for label in dict.fromkeys(labels):
            mask = np.zeros(excess.shape, dtype=bool)
            mask[(slice(None),) * axis + (np.array(labels) == label,)] = True
            regions.add(name, label, f"{words} {label}", mask.ravel())
    return most_informative(regions.found, problem.policy, one_per_axis=True)
