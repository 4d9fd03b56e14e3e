"""How the joints of a structure move in its runs, as they are simulated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from sindyjoint.diagnosis.structure.records import RecordsProblem, channels_of
from sindyjoint.diagnosis.structure.runs import RunsProblem
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.numeric import Array, main_frequency

# Samples of the highest harmonic over a period.
PHASES = 8


def joint_motions(problem: RunsProblem, x: Array) -> Iterator[tuple[str, Array, Array]]:
    """Yield the name of a run, and angle and rate of the joints over its period or a segment, shape (joints, n)."""
    for place, run in enumerate(problem.runs):
        found = problem.answer(place, x)
        if found is None:
            continue
        amplitudes = run.angles(found[0])
        orders = np.arange(amplitudes.shape[1])
        wave = np.exp(1j * np.outer(orders, np.linspace(0, 2 * np.pi, PHASES * orders.size)))
        yield run.name, (amplitudes @ wave).real, (1j * run.omega * orders * amplitudes @ wave).real
    if not isinstance(problem, RecordsProblem):
        return
    for record in problem.records:
        with suppress(SimulationError, InputError):
            channels = channels_of(problem.setup(x))
            reduced = problem.simulated(record, x)
            for _, (angle, rate) in record.begun(reduced).motions(reduced, channels):
                yield record.name, angle.T, rate.T


def main_period(problem: RunsProblem) -> float:
    """Return the longest period of the strongest lines of the drives, or of what sensors show of other runs, s."""
    found = [2 * np.pi / (run.omega * (1 + int(np.argmax(np.abs(run.drive[1:]))))) for run in problem.runs]
    if isinstance(problem, RecordsProblem):
        found += [1 / main_frequency(record.measured[0], record.rate) for record in problem.records]
    return max(found)
