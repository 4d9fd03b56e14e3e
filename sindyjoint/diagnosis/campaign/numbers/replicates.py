"""Synthetic replicates of runs that repeat: a repaired model's own response, through the processing of the measurement.

The model is simulated under the measured drive, noise like that of the channels is added where asked for, and the
result becomes force states and rows as the measurement did. The true numbers of these rows are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.diagnosis.campaign.repair import Repaired
from sindyjoint.diagnosis.campaign.rows.build import along_replicate
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.simulated_run import as_recorded, simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.numeric import Array
from sindyjoint.record import Run
from sindyjoint.response.drive import prescribed
from sindyjoint.response.run import SimulatedRun, span_of
from sindyjoint.states import ForceStates
from sindyjoint.states.harmonics import HarmonicBasis
from sindyjoint.states.periodic import kept_harmonics, replicate_states

# Steps of internal states per sample: what a slider overruns its limit by would be taken for the processing's.
SUBSTEPS = 64


@dataclass(frozen=True, eq=False)
class Replicates:
    """The synthetic replicates of all runs of a campaign.

    Parameters
    ----------
    work : Work
        Of the measurement.
    repaired : Repaired
        The model that was simulated.
    runs : tuple of Run
        Over the span of the force states; their response is without noise, their drive as it was measured.
    bases : tuple of HarmonicBasis
        What their angles are reduced to.
    """

    work: Work
    repaired: Repaired
    runs: tuple[Run, ...]
    bases: tuple[HarmonicBasis, ...]

    @classmethod
    def of(cls, work: Work, repaired: Repaired) -> Replicates | None:
        """Return the replicates of a repaired model; None where a simulation does not follow its run."""
        made = []
        for run, state in zip(work.runs, work.states, strict=True):
            if prescribed(state, spurious=True):
                # Of a motion that drives, its harmonics beyond the first are noise.
                state = replicate_states(state, kept_harmonics(state, 1), state.angle, state.moment)
            result = simulated(
                run,
                state,
                repaired.model,
                repaired.effects,
                SUBSTEPS,
                response_only=True,
                spurious=True,
            )
            if result is None or result.simulated_response is None:
                return None
            made.append(_as_measured(run, state, result, repaired.effects))
        return cls(work, repaired, tuple(made), tuple(map(kept_harmonics, work.states)))

    def rows(self, noise: Sequence[tuple[Array, Array]] | None = None) -> tuple[GapRun, ...]:
        """Return their rows, noise of moment and angle added; phases and weights are the measurement's."""
        work, rows = self.work, []
        for place, (run, state) in enumerate(zip(self.runs, work.states, strict=True)):
            moment, angle = (0.0, 0.0) if noise is None else noise[place]
            there = replicate_states(state, self.bases[place], run.angle + angle, run.moment + moment)
            rows.append(along_replicate(work.rows[place], state, there, self.repaired.model))
        return tuple(rows)

    def draw_noise(self, rng: np.random.Generator) -> list[tuple[Array, Array]]:
        """Return white noise of moment and angle for each run, as large as the measurement's."""

        def noise(state: ForceStates, run: Run) -> tuple[Array, Array]:
            size = run.n_samples
            known = np.nan_to_num([state.noise.moment, state.noise.angle])
            return known[0] * rng.standard_normal(size), known[1] * rng.standard_normal(size)

        return [noise(state, run) for state, run in zip(self.work.states, self.runs, strict=True)]


def _as_measured(run: Run, state: ForceStates, result: SimulatedRun, effects: Sequence[FittedEffect]) -> Run:
    """Return a run with the response of its simulation; what precedes that is the period after it.

    The moment is as it was measured, late where its channel is: the simulated angle is moved to meet it, as the states
    are.
    """
    span = span_of(run, state)
    skipped = state.n_samples - result.time.size
    response = result.simulated_response
    assert response is not None and state.frequency is not None
    if skipped:
        later = state.time[:skipped] + np.ceil(skipped / run.sample_rate * state.frequency) / state.frequency
        response = np.concatenate([np.interp(later, result.time, response), response])
    moves = result.drive == "motion"
    if not moves:
        response = as_recorded(response, state.time, run.sample_rate, state, effects)
    return replace(
        run,
        moment=response if moves else run.moment[span],
        angle=state.angle if moves else response,
        rate=None,
        source=None,
        valid=None,
    )
