"""Synthetic replicates of runs that repeat: a repaired model's own response, through the processing of the measurement.

The model is simulated under the measured drive, noise like that of the channels is added where asked for, and the
result becomes force states and rows as the measurement did. The true numbers of these rows are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.numbers.whole import Numbers, number_columns, numbers_of, with_numbers
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import Repaired, least_squares, modelled
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.simulated_run import simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.record import Run
from sindyjoint.response.run import SimulatedRun, span_of
from sindyjoint.states import ForceStates
from sindyjoint.states.harmonics import HarmonicBasis
from sindyjoint.states.periodic import kept_harmonics, replicate_states

Array = NDArray[np.float64]

# Steps of internal states per sample: what a slider overruns its limit by would be taken for the processing's.
SUBSTEPS = 64
# A fit ends where its step is so small beside the numbers, in standard errors.
SAME = 1e-2
# A nonlinear parameter of an effect stays above this share of where its fit began.
LEAST_LEFT = 0.05


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

    @cached_property
    def numbers(self) -> Numbers:
        """The true numbers of the replicates, with the covariance of those of the measurement."""
        return numbers_of(self.repaired, self.work.rows)

    @property
    def errors(self) -> Array:
        """Their standard errors."""
        return np.asarray(np.sqrt(np.diag(self.numbers.covariance)))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of them are fitted: all but delays."""
        fixed = np.zeros(self.numbers.values.size, dtype=bool)
        for each in self.repaired.effects:
            fixed[self.numbers.coefficients[each.name]] = each.shifts
        return ~fixed

    @property
    def positive(self) -> NDArray[np.bool_]:
        """Which of them are nonlinear parameters of effects, which have one sign."""
        inner = np.zeros(self.numbers.values.size, dtype=bool)
        for place in self.numbers.inner.values():
            inner[place] = True
        return inner

    @classmethod
    def of(cls, work: Work, repaired: Repaired) -> Replicates | None:
        """Return the replicates of a repaired model; None where a simulation does not follow its run."""
        made = []
        for run, state in zip(work.runs, work.states, strict=True):
            result = simulated(
                run, state, repaired.model, repaired.effects, work.policy, SUBSTEPS, response_only=True
            )
            if result is None or result.simulated_response is None:
                return None
            made.append(_as_measured(run, state, result))
        return cls(work, repaired, tuple(made), tuple(map(kept_harmonics, work.states)))

    def rows(self, noise: Sequence[tuple[Array, Array]] | None = None) -> tuple[GapRun, ...]:
        """Return their rows, at the phases of the measurement's, noise of moment and angle added."""
        work, states = self.work, []
        for place, (run, state) in enumerate(zip(self.runs, work.states, strict=True)):
            moment, angle = (0.0, 0.0) if noise is None else noise[place]
            there = replicate_states(state, self.bases[place], run.angle + angle, run.moment + moment)
            states.append(there)
        return gap_runs(states, self.repaired.model, work.groups, work.policy)

    def draw_noise(self, rng: np.random.Generator) -> list[tuple[Array, Array]]:
        """Return white noise of moment and angle for each run, as large as the measurement's."""

        def noise(state: ForceStates, run: Run) -> tuple[Array, Array]:
            size = run.n_samples
            known = np.nan_to_num([state.noise.moment, state.noise.angle])
            return known[0] * rng.standard_normal(size), known[1] * rng.standard_normal(size)

        return [noise(state, run) for state, run in zip(self.work.states, self.runs, strict=True)]

    def fit(self, rows: Sequence[GapRun], start: Array | None = None, most: int = 1) -> tuple[Array, Array]:
        """Return the numbers that fit rows, and the whitened residual there.

        By Gauss-Newton steps within a trust region, from the true numbers or from ``start``; by one step where
        ``most`` is one. A delay is out of the states already and does not move.
        """
        truth, errors, free = self.numbers.values, self.errors, self.free
        begin = truth if start is None else start

        def at(x: Array) -> Repaired:
            values = begin.copy()
            values[free] += x * errors[free]
            return with_numbers(self.repaired, values, self.numbers.covariance)

        def residual(x: Array) -> Array:
            one = at(x)
            return np.concatenate([r.white(modelled(r, one.model, one.effects) - r.target) for r in rows])

        def slopes(x: Array) -> Array:
            one = at(x)
            adding, shifts = ([e for e in one.effects if e.shifts == shift] for shift in (False, True))
            whole = stack(rows, lambda row: number_columns(row, one.model, adding, shifts))
            return np.asarray(whole[:, free] * errors[free])

        if most == 1:
            left, columns = residual(np.zeros(int(free.sum()))), slopes(np.zeros(int(free.sum())))
            x, _ = least_squares(columns, -left)
            left = left + columns @ x
        else:
            from scipy.optimize import least_squares as by_trust_region

            low = np.where(self.positive[free], (LEAST_LEFT - 1) * begin[free] / errors[free], -np.inf)
            found = by_trust_region(
                residual, np.zeros(int(free.sum())), slopes, bounds=(low, np.inf), xtol=SAME, max_nfev=most
            )
            x, left = found.x, found.fun
        values = begin.copy()
        values[free] += x * errors[free]
        return values, -left


def _as_measured(run: Run, state: ForceStates, result: SimulatedRun) -> Run:
    """Return a run with the response of its simulation; what precedes that is the period after it."""
    span = span_of(run, state)
    skipped = state.n_samples - result.time.size
    response = result.simulated_response
    assert response is not None and state.frequency is not None
    if skipped:
        later = state.time[:skipped] + np.ceil(skipped / run.sample_rate * state.frequency) / state.frequency
        response = np.concatenate([np.interp(later, result.time, response), response])
    moves = result.drive == "motion"
    return replace(
        run,
        moment=response if moves else run.moment[span],
        angle=state.angle if moves else response,
        rate=None,
        source=None,
        valid=None,
    )
