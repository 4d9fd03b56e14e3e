"""The output-error problem: residuals of simulated responses as a function of a model's numbers and nuisances."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics import LawWithNumbers
from sindyjoint.mechanics.stickslip import Motion, brought_from_rest, simulate_many
from sindyjoint.numeric import Array, Integers, rms
from sindyjoint.record import Run
from sindyjoint.response.drive import FAR_OFF, SETTLED, simulate_segments
from sindyjoint.response.laws import law_terms, with_coefficients
from sindyjoint.response.output_error_runs import (
    NUISANCE,
    Nuisance,
    Parameter,
    Record,
    coefficient,
    element_parameters,
    initial_parameters,
    nuisance_parameter,
    record_of,
)
from sindyjoint.response.run import along_motion, attempted, followed_motion, released, rest_of
from sindyjoint.states import ForceStates

RTOL = 1e-7
# Step of the differences, in units of a parameter's scale: far above the integrator's tolerance. Below the second one
# responses are rough where a slider turns between two samples, and where nothing pulls a joint back.
STEP, ROUGH_STEP = 2e-4, 1e-2
# Sum of squares, in units of noise, below which a change by a parameter's whole scale has no effect.
WITHOUT_EFFECT = 1e-4
# Simulations from which the effect of noise, of the moment or of a drive, is estimated.
DRAWS = 4


@dataclass(frozen=True, eq=False)
class OutputError:
    """Residuals, Jacobian and covariance of the simulated responses of some runs.

    Parameters
    ----------
    model : JointModel
        With the numbers to start from.
    runs : tuple of Record
    parameters : tuple of Parameter
        Coefficients of the terms, the inertia where it is one, numbers of the elements, nuisances, initial states.
    inertia_index : int or None
        Of the inertia among the parameters, where it is one.
    most_steps : int, optional
        Of the integrator in a run.
    """

    model: JointModel
    runs: tuple[Record, ...]
    parameters: tuple[Parameter, ...]
    inertia_index: int | None
    most_steps: int | None = None

    @classmethod
    def of(
        cls,
        model: JointModel,
        runs: Sequence[Run],
        states: Sequence[ForceStates],
        nuisance: Sequence[Nuisance],
        window: float | None,
        test: TestNuisances | None = None,
        settled: int = SETTLED,
    ) -> "OutputError":
        """Collect the parameters of a model and those of the runs; negative friction starts at zero.

        Where runs repeat, a period is compared after so many (``settled``) from the measured state on.
        """
        test = test or TestNuisances("")
        simulable = without_negative_friction(model)
        inertia = test.joint_of(model.joint).inertia or model.inertia
        most = rms(np.concatenate([s.transfer_moment(inertia) for s in states]))
        parameters = [coefficient(model, term.id, most) for term in law_terms(model)]
        inertia_index = None
        if INERTIA in model:
            inertia_index = len(parameters)
            parameters.append(coefficient(model, INERTIA, most))
        parameters += element_parameters(model.elements)
        size = rms(np.concatenate([s.angle - np.mean(s.angle) for s in states]))
        fastest = max(rms(s.rate) / max(rms(s.angle - np.mean(s.angle)), 1e-300) for s in states)
        parameters += [nuisance_parameter(name, size, 2 * np.pi / fastest) for name in nuisance]
        records = []
        for run, state in zip(runs, states, strict=True):
            records.append(record_of(simulable, run, state, test, len(parameters), window, settled))
            parameters += initial_parameters(records[-1], model.joint.motion)
        return cls(simulable, tuple(records), tuple(parameters), inertia_index)

    def failing_runs(self) -> dict[str, str]:
        """Return the runs whose simulation fails at the start, and why each fails."""
        tried = [
            (r.run.name, attempted(partial(self._predict, r), self.table[0][None])[1]) for r in self.runs
        ]
        return {name: why for name, why in tried if why}

    @property
    def goes_on_alone(self) -> bool:
        """Whether all runs are free motions, simulated from their start."""
        return all(r.starts == (0,) and r.drive == "moment" and np.ptp(r.moment) == 0 for r in self.runs)

    @cached_property
    def table(self) -> Array:
        """Start, scale, lowest and highest value of all parameters, shape (4, p)."""
        return np.array([(each.start, each.scale, each.low, each.high) for each in self.parameters]).T

    @property
    def n_shared(self) -> int:
        """Number of parameters that all runs share: they come before the initial states."""
        return sum(parameter.kind != "initial" for parameter in self.parameters)

    def residual(self, x: Array) -> Array:
        """Residuals of all runs in units of their noise, shape (n,); FAR_OFF where a simulation fails."""
        return np.concatenate([self._weigh_residual(record, x[None])[0] for record in self.runs])

    @property
    def rough(self) -> bool:
        """Whether slips that come and go make the residual rough: what it falls along depends on the step."""
        return any(record.drive == "windows" for record in self.runs)

    def jacobian(self, x: Array, step: float = ROUGH_STEP) -> Array:
        """Return the derivative of the residuals by differences, shape (n, p); where it is rough over ``step``.

        And there to both sides: by one side EMPS ends between 3.6 and 4.3 mm, by both between 3.6 and 3.9.
        """
        wide = [self.rough or parameter.kind == "element" for parameter in self.parameters]
        _, scale, low, high = self.table
        steps = np.where(wide, step, STEP) * scale
        both = self.rough & (x - steps >= low) & (x + steps <= high)
        # Away from a bound on the upper side.
        steps = np.where(x + steps > high, -steps, steps)
        columns = []
        for record in self.runs:
            # A run does not know the initial states of others: those columns are zero. Its initial states at one
            # start act only on the samples up to the next, so all angles move at once, and all rates.
            groups = [[i] for i in (*range(self.n_shared), *record.inner_indices)] + [
                list(record.initial_indices[k::2]) for k in range(2) if record.starts
            ]
            moved = np.array([np.isin(np.arange(x.size), group) * steps for group in groups])
            back = moved * both if both.any() else np.zeros((1, x.size))
            values = self._weigh_residual(record, np.vstack([x + moved, x - back]))
            rises = values[: len(groups)] - values[len(groups) :]
            block = np.zeros((values.shape[1], x.size))
            for group, rise in zip(groups, rises, strict=True):
                for start, i in enumerate(group):
                    rows = record.rows(start) if i in record.initial_indices else slice(None)
                    block[rows, i] = rise[rows] / (steps[i] * (1 + both[i]))
            columns.append(block)
        return np.vstack(columns)

    def covariance(self, x: Array) -> Array:
        """Covariance of the parameters that all runs share, robust against errors correlated within a block of time.

        H⁻¹ (Σ g_b g_bᵀ) H⁻¹ with H = JᵀJ and g_b the part of Jᵀr that block b has (White, Econometrica 48(4),
        1980), or s²H⁻¹ where there are not twice as many blocks as parameters. J is what the initial states of the
        runs cannot do (Frisch and Waugh, Econometrica 1(4), 1933). What the noise of the drive (the measured
        moment, or a prescribed motion) does through the simulation is added: all blocks of a run share it.
        Directions without any effect get a standard error of a hundred times their size.
        """
        jacobian, residual = self.jacobian(x), self.residual(x)
        count = self.n_shared
        scale = self.table[1]
        scaled, initial = (jacobian * scale)[:, :count], (jacobian * scale)[:, count:]
        if initial.shape[1]:
            scaled = scaled - initial @ np.linalg.lstsq(initial, scaled, rcond=None)[0]
        scale = scale[:count]
        values, vectors = np.linalg.eigh(scaled.T @ scaled)
        inverse = (vectors / np.maximum(values, WITHOUT_EFFECT)) @ vectors.T
        nowhere = vectors[:, values < WITHOUT_EFFECT]
        labels = np.concatenate(
            [i * 100_000 + r.states.block[-r.measured.size :] for i, r in enumerate(self.runs)]
        )
        blocks = np.unique(labels, return_inverse=True)[1]
        count, p = int(blocks.max()) + 1, scale.size
        if count > 2 * p:
            scores = np.zeros((count, p))
            np.add.at(scores, blocks, scaled * residual[:, None])
            middle = scores.T @ scores * (count / (count - p))
            # Blocks are few: in no direction the residual does less than if all of it were independent noise.
            root = vectors / np.sqrt(np.maximum(values, WITHOUT_EFFECT))
            ratios, along = np.linalg.eigh(root.T @ middle @ root)
            spread = np.maximum(ratios, float(np.mean(residual**2)))
            result = (root @ along * spread) @ (root @ along).T
        else:
            result = inverse * float(residual @ residual) / max(residual.size - x.size, 1)
        # Such a direction has no part of the residual either, and the products above hold none of it.
        result += nowhere @ nowhere.T / WITHOUT_EFFECT
        result += inverse @ self._estimate_drive_scatter(x, scaled, residual) @ inverse
        return (result + result.T) / 2 * np.outer(scale, scale)

    def _estimate_drive_scatter(self, x: Array, jacobian: Array, residual: Array) -> Array:
        """Covariance of Jᵀr that the noise of the drive causes through the simulation, shape (p, p)."""
        total, first = np.zeros((jacobian.shape[1],) * 2), 0
        for index, record in enumerate(self.runs):
            rows = slice(first, first + record.measured.size)
            first = rows.stop
            generator = np.random.default_rng(index)
            for _ in range(DRAWS):
                noisy = record.with_drive_noise(generator, self.model)
                change = self._weigh_residual(noisy, x[None])[0] - residual[rows]
                if np.abs(change).max() < FAR_OFF * float(np.std(record.measured)) / record.sigma:
                    score = jacobian[rows].T @ change
                    total += np.outer(score, score) / DRAWS
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
        residual = (predicted - record.measured) / record.sigma
        return residual if record.used is None else residual * record.used

    def _predict(self, record: Record, sets: Array) -> Array:
        """Response of one run for each set of parameters, shape (sets, n)."""
        gain, delay, offset = (self._get_value(name, sets) for name in ("gain", "delay", "offset"))
        if record.drive == "motion":
            signals = np.array([self._predict_moment(record, x) for x in sets])
            shifted = signals - delay * np.gradient(signals, 1 / record.run.sample_rate, axis=1)
        else:
            motion = self._simulate_motion(record, sets)
            # The moment is late by the delay, and so is what it moves.
            shifted = motion[0] + delay * motion[1] + 0.5 * delay**2 * motion[2]
        return (gain * shifted + offset)[:, record.skip :]

    def _get_value(self, name: Nuisance, sets: Array) -> Array:
        names = [parameter.name for parameter in self.parameters]
        if name in names:
            return sets[:, names.index(name), None]
        return np.full((len(sets), 1), NUISANCE[name][0])

    def _simulate_motion(self, record: Record, sets: Array) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration for each set, each of shape (sets, n)."""
        if record.drive == "windows":
            motions = [self._simulate_segments(record, x) for x in sets]
            return tuple(
                np.array([getattr(m, name) for m in motions]) for name in ("angle", "rate", "acceleration")
            )  # type: ignore[return-value]
        assert record.excitation is not None
        initial = np.tile([record.states.angle[0], record.states.rate[0]], (len(sets), 1))
        if record.starts:
            initial = sets[:, record.initial_indices.start : record.initial_indices.stop]
        cycle, rate = record.cycle, record.run.sample_rate
        duration = record.moment.size / rate if cycle is None else cycle.duration
        many = simulate_many(
            record.law, [record.excitation], duration, rate if cycle is None else cycle.sample_rate,
            parameters=self._law_parameters(record, sets),
            beam_inertia=self._inertia(record, sets) - record.law.inertia,
            initial=initial, initial_state=self._inner(record, sets), limits=record.limits, rtol=RTOL,
            most_steps=self.most_steps,
        )  # fmt: skip
        angle, rates, acceleration = many.angle, many.rate, many.acceleration
        if cycle is None:
            return angle, rates, acceleration
        # An acceleration jumps where the joint sticks: between samples it is taken as it is before.
        return (
            cycle.at_samples(angle, rates),
            cycle.at_samples(rates, acceleration),
            acceleration[:, -cycle.nodes :][:, cycle.left],
        )

    def _inner(self, record: Record, sets: Array) -> Array | None:
        """Return the internal states that each set starts from; how far what is held has yielded is its law's."""
        if record.inner is not None and record.remembered.size:
            inner = np.tile(record.inner, (len(sets), 1))
            inner[:, record.remembered] = sets[:, record.inner_indices]
            return inner
        if record.inner is None or not record.inner.size or not released(record.states):
            return record.inner
        motion, rest = followed_motion(record.states), rest_of(record.states)
        laws = (
            LawWithNumbers(record.law, numbers, record.law.inertia)
            for numbers in self._law_parameters(record, sets)
        )
        return np.array([brought_from_rest(law, *motion, rest, held=True) for law in laws])

    def _simulate_segments(self, record: Record, x: Array) -> Motion:
        """Return the motion of one set by multiple shooting; internal states start as along the measured motion."""
        law = LawWithNumbers(
            record.law,
            self._law_parameters(record, x[None])[0],
            float(self._inertia(record, x[None])[0]),
        )
        s, rate = record.states, record.run.sample_rate
        inner = along_motion(law, s, rate)[1] if law.n_states else None
        starts = np.zeros((record.moment.size, 2))
        first = record.initial_indices
        starts[list(record.starts)] = x[first.start : first.stop].reshape(-1, 2)
        return simulate_segments(
            law, record.moment, rate, record.window, starts, interpolation="cubic", initial_state=inner,
            limits=record.limits, rtol=RTOL,
        )  # fmt: skip

    def _predict_moment(self, record: Record, x: Array) -> Array:
        """Moment at the sensor of a prescribed motion; sliders stop at their limits exactly, between steps too."""
        assert record.columns is not None
        total = record.columns @ x[: record.columns.shape[1]]
        total = total + self._inertia(record, x[None])[0] * record.states.acceleration
        for element in self.model.with_numbers(x[self.number_indices]).elements:
            total = total + self._columns(element)[record.run.name] @ element.coefficients
        return total if record.added is None else total + record.added

    def _columns(self, element: JointElement) -> dict[str, Array]:
        """Return the columns of an element along the motion of every run: they rest on its shape alone."""
        key, known = (element.id, *element.values), self._known
        if key not in known:
            # Shapes of elements of which the columns are kept: those that a Jacobian asks for.
            if len(known) == 32:
                del known[next(iter(known))]
            motions = [(*each.followed, 1 / each.run.sample_rate, rest_of(each.states)) for each in self.runs]
            names = (each.run.name for each in self.runs)
            known[key] = dict(zip(names, element.columns_of(motions), strict=True))
        return known[key]

    @cached_property
    def _known(self) -> dict[tuple[str | float, ...], dict[str, Array]]:
        return {}

    @cached_property
    def number_indices(self) -> Integers:
        """Indices of the model's numbers, in its order, among the parameters."""
        names = [parameter.name for parameter in self.parameters]
        inner = [place for place, each in enumerate(self.parameters) if each.kind == "element"]
        return np.array([*(names.index(term.id) for term in self.model.terms), *inner], dtype=np.intp)

    def start_of(self, model: JointModel) -> Array:
        """Return parameters with the numbers of another model; nuisances and initial states as they start."""
        x = self.table[0].copy()
        x[self.number_indices] = model.numbers
        return x

    def _law_parameters(self, record: Record, sets: Array) -> Array:
        assert record.in_law is not None
        start, slopes = record.in_law
        return start + (sets[:, self.number_indices] - self.model.numbers) @ slopes.T

    def _inertia(self, record: Record, sets: Array) -> Array:
        if self.inertia_index is None:
            return np.full(len(sets), record.law.inertia)
        return sets[:, self.inertia_index]


def without_negative_friction(model: JointModel) -> JointModel:
    """Return the model with zero friction where its friction is negative: with that a joint cannot stick."""
    values = [
        max(term.coefficient, 0.0) if term.id == "coulomb_friction" else term.coefficient
        for term in model.terms
    ]
    return with_coefficients(model, values) if list(model.coefficients) != values else model
