"""The output-error problem: residuals of simulated responses as a function of coefficients and nuisance parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.laws import FormulaLaw, Law, PaperLaw
from sindyjoint.mechanics.segments import simulate_segments
from sindyjoint.mechanics.stickslip import Motion, simulate_many, transfer_moment
from sindyjoint.paper import PARAMETERS as PAPER_PARAMETERS
from sindyjoint.record import Run
from sindyjoint.response.model_law import law_terms, model_law, with_coefficients
from sindyjoint.response.output_error_parts import (
    NUISANCE,
    Nuisance,
    Parameter,
    Record,
    coefficient,
    initial_parameters,
    nuisance_parameter,
    record_of,
)
from sindyjoint.response.run import rms
from sindyjoint.states import ForceStates

Array = NDArray[np.float64]
RTOL = 1e-7
# Step of the differences, in units of a parameter's scale: far above the integrator's tolerance.
STEP = 2e-4
# Residual, in RMS of the response, of a simulation that fails: larger than that of any simulation that reaches its end.
FAR_OFF = 10.0
# Simulations per run from which the effect of the moment's noise is estimated.
DRIVE_DRAWS = 4


@dataclass(frozen=True, eq=False)
class OutputError:
    """Residuals, Jacobian and covariance of the simulated responses of some runs.

    Parameters
    ----------
    law : Law
    runs : tuple
    parameters : tuple of Parameter
    indices : ndarray of int
        Indices of the coefficients among the compiled law's parameters.
    inertia_index : int or None
        Of the inertia among the parameters, where it is one.
    window : float
        Length of a multiple-shooting segment, s.
    """

    law: Law
    runs: tuple[Record, ...]
    parameters: tuple[Parameter, ...]
    indices: NDArray[np.intp]
    inertia_index: int | None
    window: float

    @classmethod
    def of(
        cls,
        model: JointModel,
        runs: Sequence[Run],
        states: Sequence[ForceStates],
        nuisance: Sequence[Nuisance],
        window: float,
    ) -> OutputError:
        """Collect the parameters of a model and those of the runs; negative friction starts at zero."""
        simulable = without_negative_friction(model)
        law = model_law(simulable)
        names = [term.id for term in law_terms(model)]
        order = list(PAPER_PARAMETERS) if isinstance(law, PaperLaw) else names
        most = rms(np.concatenate([s.transfer_moment(model.inertia) for s in states]))
        parameters = [coefficient(model, name, most) for name in names]
        inertia_index = None
        if INERTIA in model:
            inertia_index = len(parameters)
            parameters.append(coefficient(model, INERTIA, most))
        size = rms(np.concatenate([s.angle - np.mean(s.angle) for s in states]))
        fastest = max(rms(s.rate) / max(rms(s.angle - np.mean(s.angle)), 1e-300) for s in states)
        parameters += [nuisance_parameter(name, size, 2 * np.pi / fastest) for name in nuisance]
        records = []
        for run, state in zip(runs, states, strict=True):
            records.append(record_of(law, run, state, len(parameters), window))
            parameters += initial_parameters(records[-1], model.joint.motion)
        indices = np.array([order.index(name) for name in names], dtype=np.intp)
        return cls(law, tuple(records), tuple(parameters), indices, inertia_index, window)

    def drop_failing_runs(self) -> tuple[OutputError, tuple[str, ...]]:
        """Return the problem without the runs whose simulation fails at the start, and why each fails."""
        start = np.array([parameter.start for parameter in self.parameters])
        good, words = [], []
        for record in self.runs:
            try:
                self._predict(record, start[None])
                good.append(record)
            except SimulationError as error:
                words.append(f"{record.run.name} ({error})")
        gone = {i for record in self.runs if record not in good for i in record.initial_indices}
        kept = [i for i in range(len(self.parameters)) if i not in gone]
        shifted = {old: new for new, old in enumerate(kept)}
        records = tuple(
            replace(record, initial=shifted[record.initial]) if record.starts else record for record in good
        )
        parameters = tuple(self.parameters[i] for i in kept)
        return replace(self, runs=records, parameters=parameters), tuple(words)

    @property
    def n_shared(self) -> int:
        """Number of parameters that all runs share: they come before the initial states."""
        return sum(parameter.kind != "initial" for parameter in self.parameters)

    def residual(self, x: Array) -> Array:
        """Residuals of all runs in units of their noise, shape (n,); FAR_OFF where a simulation fails."""
        return np.concatenate([self._weigh_residual(record, x[None])[0] for record in self.runs])

    def jacobian(self, x: Array) -> Array:
        """Return the derivative of the residuals by differences, shape (n, p)."""
        steps = np.array([STEP * parameter.scale for parameter in self.parameters])
        # Away from a bound on the upper side.
        steps = np.where(x + steps > [parameter.high for parameter in self.parameters], -steps, steps)
        columns = []
        for record in self.runs:
            # A run does not know the initial states of others: those columns are zero. Its initial states at one
            # start act only on the samples up to the next, so all angles move at once, and all rates.
            groups = [[i] for i in range(self.n_shared)] + [
                list(record.initial_indices[k::2]) for k in range(2) if record.starts
            ]
            sets = np.vstack([x, *(x + np.isin(np.arange(x.size), group) * steps for group in groups)])
            values = self._weigh_residual(record, sets)
            block = np.zeros((values.shape[1], x.size))
            for group, changed in zip(groups, values[1:], strict=True):
                for start, i in enumerate(group):
                    rows = record.rows(start) if i >= self.n_shared else slice(None)
                    block[rows, i] = (changed - values[0])[rows] / steps[i]
            columns.append(block)
        return np.vstack(columns)

    def covariance(self, x: Array) -> Array:
        """Covariance of the parameters that all runs share, robust against errors correlated within a block of time.

        H⁻¹ (Σ g_b g_bᵀ) H⁻¹ with H = JᵀJ and g_b the part of Jᵀr that block b has (White, Econometrica 48(4), 1980),
        or s²H⁻¹ where there are not twice as many blocks as parameters. J is what the initial states of the runs
        cannot do (Frisch and Waugh, Econometrica 1(4), 1933). What the noise of the measured moment does through the
        simulation is added: all blocks of a run share it. Directions without any effect get a standard error of a
        hundred times their size.
        """
        jacobian, residual = self.jacobian(x), self.residual(x)
        count = self.n_shared
        scale = np.array([parameter.scale for parameter in self.parameters])
        scaled, initial = (jacobian * scale)[:, :count], (jacobian * scale)[:, count:]
        if initial.shape[1]:
            scaled = scaled - initial @ np.linalg.lstsq(initial, scaled, rcond=None)[0]
        scale = scale[:count]
        values, vectors = np.linalg.eigh(scaled.T @ scaled)
        inverse = (vectors / np.maximum(values, 1e-4)) @ vectors.T
        labels = np.concatenate([i * 100_000 + r.states.block[r.skip :] for i, r in enumerate(self.runs)])
        blocks = np.unique(labels, return_inverse=True)[1]
        count, p = int(blocks.max()) + 1, scale.size
        if count > 2 * p:
            scores = np.zeros((count, p))
            np.add.at(scores, blocks, scaled * residual[:, None])
            middle = scores.T @ scores * (count / (count - p))
            # With no part of the residual in a direction, its noise is still what it is.
            middle += scaled.T @ scaled * 1e-3 * float(np.mean(residual**2))
            result = inverse @ middle @ inverse
        else:
            result = inverse * float(residual @ residual) / max(residual.size - x.size, 1)
        result += inverse @ self._estimate_drive_scatter(x, scaled, residual) @ inverse
        return (result + result.T) / 2 * np.outer(scale, scale)

    def _estimate_drive_scatter(self, x: Array, jacobian: Array, residual: Array) -> Array:
        """Covariance of Jᵀr that the noise of the measured moment causes through the simulation, shape (p, p)."""
        total, first = np.zeros((jacobian.shape[1],) * 2), 0
        for index, record in enumerate(self.runs):
            rows = slice(first, first + record.measured.size)
            first = rows.stop
            if record.drive == "motion":
                continue
            generator = np.random.default_rng(index)
            for _ in range(DRIVE_DRAWS):
                noisy = record.with_drive_noise(generator)
                change = self._weigh_residual(noisy, x[None])[0] - residual[rows]
                if np.abs(change).max() < FAR_OFF * float(np.std(record.measured)) / record.sigma:
                    score = jacobian[rows].T @ change
                    total += np.outer(score, score) / DRIVE_DRAWS
        return total

    def nrmse(self, x: Array) -> dict[str, float]:
        """Response NRMSE of each run.

        Raises
        ------
        SimulationError
            When a simulation fails; the message names the run.
        """
        found = {}
        for record in self.runs:
            try:
                predicted = self._predict(record, x[None])[0]
            except SimulationError as error:
                raise SimulationError(f"run {record.run.name!r}: {error}", error.time) from error
            found[record.run.name] = rms(predicted - record.measured) / float(np.std(record.measured))
        return found

    def _weigh_residual(self, record: Record, sets: Array) -> Array:
        """Residuals of one run for each set, shape (sets, n)."""
        try:
            predicted = self._predict(record, sets)
        except SimulationError:
            if len(sets) == 1:
                # The optimiser then shortens its step: no other residual is as large.
                return np.full(
                    (1, record.measured.size), FAR_OFF * float(np.std(record.measured)) / record.sigma
                )
            return np.vstack([self._weigh_residual(record, x[None]) for x in sets])
        return (predicted - record.measured) / record.sigma

    def _predict(self, record: Record, sets: Array) -> Array:
        """Response of one run for each set of parameters, shape (sets, n)."""
        gain, delay, offset = (self._get_value(name, sets) for name in ("gain", "delay", "offset"))
        if record.drive == "motion":
            signals = np.array([self._predict_moment(record, law) for law in self._build_laws(sets)])
            slope = np.gradient(signals, 1 / record.run.sample_rate, axis=1)
            shifted = signals - delay * slope
        else:
            motion = self._simulate_motion(record, sets)
            # The moment is late by the delay, and so is what it moves.
            shifted = motion[0] + delay * motion[1] + 0.5 * delay**2 * motion[2]
        return (gain * shifted + offset)[:, record.skip :]

    def _get_value(self, name: Nuisance, sets: Array) -> Array:
        names = [parameter.name for parameter in self.parameters]
        if name in names:
            return sets[:, names.index(name), None]
        return np.full((len(sets), 1), NUISANCE[name].start)

    def _simulate_motion(self, record: Record, sets: Array) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration for each set, each of shape (sets, n)."""
        if record.drive == "windows":
            starts = np.zeros((record.moment.size, 2))
            motions: list[Motion] = []
            for law, states in zip(
                self._build_laws(sets),
                sets[:, record.initial_indices.start : record.initial_indices.stop],
                strict=True,
            ):
                starts[list(record.starts)] = states.reshape(-1, 2)
                motions.append(
                    simulate_segments(
                        law,
                        record.moment,
                        record.run.sample_rate,
                        self.window,
                        starts,
                        interpolation="cubic",
                        limits=record.limits,
                        rtol=RTOL,
                    )  # fmt: skip
                )
            return tuple(
                np.array([getattr(m, name) for m in motions]) for name in ("angle", "rate", "acceleration")
            )  # type: ignore[return-value]
        assert record.excitation is not None
        initial = np.tile([record.states.angle[0], record.states.rate[0]], (len(sets), 1))
        if record.starts:
            initial = sets[:, record.initial_indices.start : record.initial_indices.stop]
        many = simulate_many(
            self.law, [record.excitation], record.moment.size / record.run.sample_rate, record.run.sample_rate,
            parameters=self._law_parameters(sets), beam_inertia=self._inertia(sets) - self.law.inertia,
            initial=initial, limits=record.limits, rtol=RTOL,
        )  # fmt: skip
        return many.angle, many.rate, many.acceleration

    def _predict_moment(self, record: Record, law: Law) -> Array:
        s = record.states
        return transfer_moment(law, s.angle, s.rate, record.run.sample_rate, acceleration=s.acceleration)[0]

    def _law_parameters(self, sets: Array) -> Array:
        base = np.asarray(self.law.compiled().parameters)  # type: ignore[union-attr]
        values = np.tile(base, (len(sets), 1))
        values[:, self.indices] = sets[:, : self.indices.size]
        return values

    def _inertia(self, sets: Array) -> Array:
        if self.inertia_index is None:
            return np.full(len(sets), self.law.inertia)
        return sets[:, self.inertia_index]

    def _build_laws(self, sets: Array) -> list[Law]:
        laws: list[Law] = []
        for values, inertia in zip(self._law_parameters(sets), self._inertia(sets), strict=True):
            if isinstance(self.law, PaperLaw):
                laws.append(
                    replace(
                        self.law, **dict(zip(PAPER_PARAMETERS.values(), values, strict=True)), inertia=inertia
                    )
                )
            else:
                assert isinstance(self.law, FormulaLaw)
                named = dict(zip(self.law.parameters, values, strict=True))
                laws.append(replace(self.law, parameters=named, inertia=inertia))
        return laws


def without_negative_friction(model: JointModel) -> JointModel:
    """Return the model with zero friction where its friction is negative: with that a joint cannot stick."""
    values = [
        max(term.coefficient, 0.0) if term.id == "coulomb_friction" else term.coefficient
        for term in model.terms
    ]
    return with_coefficients(model, values) if list(model.coefficients) != values else model
