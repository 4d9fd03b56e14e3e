"""Synthetic replicates of runs that repeat: a repaired model's own response, through the processing of the measurement.

The model is simulated under the measured drive, noise like that of the channels is added where asked for, and the
result becomes force states and rows as the measurement did. The true numbers of these rows are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.clock import STEP_SAMPLES, spend
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
    moving : tuple of HarmonicBasis
        Harmonics of which noise matters: of a prescribed angle those that the replicate moves with, of a moment that
        drives those that the angle is reduced to.
    driven : tuple of bool
        Whether the moment is the drive.
    """

    work: Work
    repaired: Repaired
    runs: tuple[Run, ...]
    bases: tuple[HarmonicBasis, ...]
    moving: tuple[HarmonicBasis, ...]
    driven: tuple[bool, ...]

    @classmethod
    def of(cls, work: Work, repaired: Repaired) -> Replicates | None:
        """Return the replicates of a repaired model; None where a simulation does not follow its run."""
        made, moving, driven = [], [], []
        for run, state, basis in zip(work.runs, work.states, work.harmonics, strict=True):
            driven.append(not prescribed(state, spurious=True))
            # Of a motion that drives, its harmonics beyond the first are noise.
            moving.append(basis if driven[-1] else kept_harmonics(state, 1))
            if not driven[-1]:
                state = replicate_states(state, moving[-1], state.angle, state.moment)
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
        return cls(work, repaired, tuple(made), work.harmonics, tuple(moving), tuple(driven))

    def rows(self, noise: Sequence[tuple[Array, Array]] | None = None) -> tuple[GapRun, ...]:
        """Return their rows, noise of moment and angle added; phases and weights are the measurement's."""
        if noise is None:
            return tuple(self.row(place) for place in range(len(self.runs)))
        return tuple(self.row(place, *each) for place, each in enumerate(noise))

    def row(self, place: int, moment: Array | float = 0.0, angle: Array | float = 0.0) -> GapRun:
        """Return the rows of one of them."""
        run, state = self.runs[place], self.work.states[place]
        spend(STEP_SAMPLES * state.n_samples)
        there = replicate_states(state, self.bases[place], run.angle + angle, run.moment + moment)
        return along_replicate(self.work.rows[place], state, there, self.repaired.model)

    def draw_noise(self, rng: np.random.Generator) -> list[tuple[Array, Array]]:
        """Return noise of moment and angle for each run, of that of the measurement what moves its numbers.

        Of both only harmonics of :attr:`moving`, but for the moment of a prescribed motion.
        """
        noise = []
        for state, basis, driven in zip(self.work.states, self.moving, self.driven, strict=True):
            moment = float(np.nan_to_num(state.noise.moment)) * rng.standard_normal(state.n_samples)
            angle = basis.series(*basis.fit(state.draw_angle_noise(state.n_samples, rng)))
            noise.append((basis.series(*basis.fit(moment)) if driven else moment, angle))
        return noise


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
