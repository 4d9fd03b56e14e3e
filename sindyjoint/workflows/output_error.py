"""The output-error problem: residuals of simulated responses as a function of coefficients and nuisance parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.model import INERTIA, JointModel
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.excitation import Excitation, repeated, sampled
from sindyjoint.mechanics.laws import FormulaLaw, Law, PaperLaw
from sindyjoint.mechanics.stickslip import Motion, simulate_many, simulate_windows, transfer_moment
from sindyjoint.record import Run
from sindyjoint.states import ForceStates
from sindyjoint.workflows.model_law import PAPER_PARAMETERS, law_terms, model_law
from sindyjoint.workflows.response import Drive, angle_limits, choose_drive, measured_drive, rms, settling

Array = NDArray[np.float64]
Nuisance = Literal["delay", "gain", "offset"]


class NuisanceKind(NamedTuple):
    """What a nuisance parameter starts at and how it is written."""

    start: float
    unit: str


NUISANCE: dict[Nuisance, NuisanceKind] = {
    "delay": NuisanceKind(0.0, " s"),
    "gain": NuisanceKind(1.0, ""),
    "offset": NuisanceKind(0.0, ""),
}

RTOL = 1e-7
# Step of the differences, in units of a parameter's scale: far above the integrator's tolerance.
STEP = 2e-4
# A coefficient may move by so many standard errors, this share of itself, or until its term carries so much more of
# the moment, whichever is most.
RANGE_ERRORS, RANGE_SHARE, RANGE_MOMENT = 20.0, 0.5, 0.1
# Widest gain, delay (share of a period of the fastest motion) and offset (share of the response's RMS) searched.
GAIN_RANGE, DELAY_SHARE, OFFSET_SHARE = 0.25, 0.1, 0.5
# Noise below this share of the response would weigh what no simulation can reach.
LEAST_NOISE = 1e-4
# Residual, in RMS of the response, of a simulation that fails: further off than any that reaches its end.
FAR_OFF = 10.0
# Simulations per run that tell what the noise of the moment does.
DRIVE_DRAWS = 4


@dataclass(frozen=True)
class Parameter:
    """A parameter of the problem.

    Parameters
    ----------
    name : str
    kind : {"coefficient", "nuisance", "initial"}
    start, scale, low, high : float
        In its own unit.
    """

    name: str
    kind: str
    start: float
    scale: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class _Record:
    """A run as the problem uses it."""

    run: Run
    states: ForceStates
    drive: Drive
    moment: Array
    measured: Array
    sigma: float
    skip: int
    excitation: Excitation | None
    limits: tuple[float, float]
    initial: int | None  # place of its initial angle among the parameters; the rate follows

    def with_drive_noise(self, generator: np.random.Generator) -> _Record:
        """Return the record with another noise of the moment channel."""
        level = self.states.noise.moment
        moment = self.moment + level * generator.standard_normal(self.moment.size)
        if self.excitation is None:
            return replace(self, moment=moment)
        if not self.excitation.periodic:
            return replace(self, moment=moment, excitation=sampled(moment, self.run.sample_rate))
        mean = self.excitation.pieces[:, 0]
        periods = self.moment.size / mean.size
        noisy = mean + level / np.sqrt(periods) * generator.standard_normal(mean.size)
        return replace(self, excitation=repeated(noisy, self.excitation.step * mean.size))


@dataclass(frozen=True, eq=False)
class OutputError:
    """Residuals, Jacobian and covariance of the simulated responses of some runs.

    Parameters
    ----------
    law : Law
    runs : tuple
    parameters : tuple of Parameter
    places : ndarray of int
        Where the coefficients stand among the compiled law's parameters.
    inertia_place : int or None
        Of the inertia among the parameters, where it is one.
    window : float
        s.
    """

    law: Law
    runs: tuple[_Record, ...]
    parameters: tuple[Parameter, ...]
    places: NDArray[np.intp]
    inertia_place: int | None
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
        """Collect the parameters of a model and what the runs add to them."""
        law = model_law(model)
        names = [term.id for term in law_terms(model)]
        order = list(PAPER_PARAMETERS) if isinstance(law, PaperLaw) else names
        parameters = [_coefficient(model, name) for name in names]
        inertia_place = None
        if INERTIA in model:
            inertia_place = len(parameters)
            parameters.append(_coefficient(model, INERTIA))
        size = rms(np.concatenate([s.angle - np.mean(s.angle) for s in states]))
        fastest = max(rms(s.rate) / max(rms(s.angle - np.mean(s.angle)), 1e-300) for s in states)
        parameters += [_nuisance(name, size, 2 * np.pi / fastest) for name in nuisance]
        records = []
        for run, state in zip(runs, states, strict=True):
            records.append(_record(law, run, state, len(parameters)))
            if records[-1].initial is not None:
                parameters += _initial(run.name, state)
        places = np.array([order.index(name) for name in names], dtype=np.intp)
        return cls(law, tuple(records), tuple(parameters), places, inertia_place, window)

    def that_can_start(self) -> tuple[OutputError, tuple[str, ...]]:
        """Return the problem without the runs whose simulation fails at the start, and why each fails."""
        start = np.array([parameter.start for parameter in self.parameters])
        good, words = [], []
        for record in self.runs:
            try:
                self._predicted(record, start[None])
                good.append(record)
            except SimulationError as error:
                words.append(f"{record.run.name} ({error})")
        gone = [i for i in range(len(self.parameters)) if any(
            _belongs(record, i) for record in self.runs if record not in good)]  # fmt: skip
        kept = [i for i in range(len(self.parameters)) if i not in gone]
        places = {old: new for new, old in enumerate(kept)}
        records = tuple(
            record if record.initial is None else replace(record, initial=places[record.initial])
            for record in good
        )
        parameters = tuple(self.parameters[i] for i in kept)
        return replace(self, runs=records, parameters=parameters), tuple(words)

    def residual(self, x: Array) -> Array:
        """Residuals of all runs in units of their noise, shape (n,); far off where a simulation fails."""
        return np.concatenate([self._weighted(record, x[None])[0] for record in self.runs])

    def jacobian(self, x: Array) -> Array:
        """Return the derivative of the residuals by differences, shape (n, p)."""
        steps = np.array([STEP * parameter.scale for parameter in self.parameters])
        # Away from a bound on the upper side.
        steps = np.where(x + steps > [parameter.high for parameter in self.parameters], -steps, steps)
        columns = []
        for record in self.runs:
            # A run does not know the initial states of others: those columns are zero.
            own = [i for i, p in enumerate(self.parameters) if p.kind != "initial" or _belongs(record, i)]
            sets = np.vstack([x, x + np.diag(steps)[own]])
            values = self._weighted(record, sets)
            block = np.zeros((values.shape[1], x.size))
            block[:, own] = ((values[1:] - values[0]) / steps[own][:, None]).T
            columns.append(block)
        return np.vstack(columns)

    def covariance(self, x: Array) -> Array:
        """Covariance of the parameters, robust against errors that are correlated within a block of time.

        H⁻¹ (Σ g_b g_bᵀ) H⁻¹ with H = JᵀJ and g_b the part of Jᵀr that block b has (White, Econometrica 48(4), 1980),
        or s²H⁻¹ where there are not twice as many blocks as parameters. What the noise of the measured moment does
        through the simulation is added: all blocks of a run share it. Directions without any effect get a standard
        error of a hundred times their own size.
        """
        jacobian, residual = self.jacobian(x), self.residual(x)
        scale = np.array([parameter.scale for parameter in self.parameters])
        scaled = jacobian * scale
        values, vectors = np.linalg.eigh(scaled.T @ scaled)
        inverse = (vectors / np.maximum(values, 1e-4)) @ vectors.T
        labels = np.concatenate([i * 100_000 + r.states.block[r.skip :] for i, r in enumerate(self.runs)])
        blocks = np.unique(labels, return_inverse=True)[1]
        count, p = int(blocks.max()) + 1, x.size
        if count > 2 * p:
            scores = np.zeros((count, p))
            np.add.at(scores, blocks, scaled * residual[:, None])
            middle = scores.T @ scores * (count / (count - p))
            # With no part of the residual in a direction, its noise is still what it is.
            middle += scaled.T @ scaled * 1e-3 * float(np.mean(residual**2))
            result = inverse @ middle @ inverse
        else:
            result = inverse * float(residual @ residual) / max(residual.size - p, 1)
        result += inverse @ self._drive_scatter(x, scaled, residual) @ inverse
        return (result + result.T) / 2 * np.outer(scale, scale)

    def _drive_scatter(self, x: Array, jacobian: Array, residual: Array) -> Array:
        """Covariance of Jᵀr that the noise of the measured moment causes through the simulation, shape (p, p)."""
        total, first = np.zeros((x.size, x.size)), 0
        for index, record in enumerate(self.runs):
            rows = slice(first, first + record.measured.size)
            first = rows.stop
            if record.drive == "motion":
                continue
            generator = np.random.default_rng(index)
            for _ in range(DRIVE_DRAWS):
                noisy = record.with_drive_noise(generator)
                change = self._weighted(noisy, x[None])[0] - residual[rows]
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
                predicted = self._predicted(record, x[None])[0]
            except SimulationError as error:
                raise SimulationError(f"run {record.run.name!r}: {error}", error.time) from error
            found[record.run.name] = rms(predicted - record.measured) / float(np.std(record.measured))
        return found

    def _weighted(self, record: _Record, sets: Array) -> Array:
        """Residuals of one run for each set, shape (sets, n)."""
        try:
            predicted = self._predicted(record, sets)
        except SimulationError:
            if len(sets) == 1:
                # The optimiser shortens its step: nothing is as far off as this.
                return np.full(
                    (1, record.measured.size), FAR_OFF * float(np.std(record.measured)) / record.sigma
                )
            return np.vstack([self._weighted(record, x[None]) for x in sets])
        return (predicted - record.measured) / record.sigma

    def _predicted(self, record: _Record, sets: Array) -> Array:
        """Response of one run for each set of parameters, shape (sets, n)."""
        gain, delay, offset = (self._value(name, sets) for name in ("gain", "delay", "offset"))
        if record.drive == "motion":
            signals = np.array([self._moment(record, law) for law in self._laws(sets)])
            slope = np.gradient(signals, 1 / record.run.sample_rate, axis=1)
            shifted = signals - delay * slope
        else:
            motion = self._motion(record, sets)
            # The moment is late by the delay, and so is what it moves.
            shifted = motion[0] + delay * motion[1] + 0.5 * delay**2 * motion[2]
        return (gain * shifted + offset)[:, record.skip :]

    def _value(self, name: Nuisance, sets: Array) -> Array:
        names = [parameter.name for parameter in self.parameters]
        if name in names:
            return sets[:, names.index(name), None]
        return np.full((len(sets), 1), NUISANCE[name].start)

    def _motion(self, record: _Record, sets: Array) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration for each set, each of shape (sets, n)."""
        if record.drive == "windows":
            start = np.column_stack([record.states.angle, record.states.rate])
            motions: list[Motion] = [
                simulate_windows(
                    law, record.moment, record.run.sample_rate, self.window, start, interpolation="cubic",
                    limits=record.limits, rtol=RTOL,
                )
                for law in self._laws(sets)
            ]  # fmt: skip
            return tuple(
                np.array([getattr(m, name) for m in motions]) for name in ("angle", "rate", "acceleration")
            )  # type: ignore[return-value]
        assert record.excitation is not None
        initial = np.tile([record.states.angle[0], record.states.rate[0]], (len(sets), 1))
        if record.initial is not None:
            initial = sets[:, record.initial : record.initial + 2]
        many = simulate_many(
            self.law, [record.excitation], record.moment.size / record.run.sample_rate, record.run.sample_rate,
            parameters=self._law_parameters(sets), beam_inertia=self._inertia(sets) - self.law.inertia,
            initial=initial, limits=record.limits, rtol=RTOL,
        )  # fmt: skip
        return many.angle, many.rate, many.acceleration

    def _moment(self, record: _Record, law: Law) -> Array:
        s = record.states
        return transfer_moment(law, s.angle, s.rate, record.run.sample_rate, acceleration=s.acceleration)[0]

    def _law_parameters(self, sets: Array) -> Array:
        base = np.asarray(self.law.compiled().parameters)  # type: ignore[union-attr]
        values = np.tile(base, (len(sets), 1))
        values[:, self.places] = sets[:, : self.places.size]
        return values

    def _inertia(self, sets: Array) -> Array:
        if self.inertia_place is None:
            return np.full(len(sets), self.law.inertia)
        return sets[:, self.inertia_place]

    def _laws(self, sets: Array) -> list[Law]:
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


def _belongs(record: _Record, place: int) -> bool:
    return record.initial is not None and record.initial <= place < record.initial + 2


def _coefficient(model: JointModel, name: str) -> Parameter:
    term = model[name]
    value = term.coefficient
    scale = abs(value) if value != 0 else max(term.standard_error, 1e-12)
    # The coefficient that would carry the whole moment, as far as the term's share is known.
    whole = scale / term.unique_share if term.unique_share > 0 else 0.0
    reach = max(RANGE_SHARE * scale, RANGE_ERRORS * term.standard_error, RANGE_MOMENT * whole)
    never_negative = name in ("coulomb_friction", INERTIA) and value >= 0
    low = max(value - reach, 0.0) if never_negative else value - reach
    if name == INERTIA:
        low = max(low, 0.1 * value)
    return Parameter(name, "coefficient", value, scale, low, value + reach)


def _nuisance(name: Nuisance, size: float, period: float) -> Parameter:
    start = NUISANCE[name].start
    reach = {"delay": DELAY_SHARE * period, "gain": GAIN_RANGE, "offset": OFFSET_SHARE * size}[name]
    # A gain is one of one, a delay and an offset are small: their scale is a hundredth of the motion's.
    scale = {"delay": 0.01 * period, "gain": 1.0, "offset": 0.01 * size}[name]
    return Parameter(name, "nuisance", start, scale, start - reach, start + reach)


def _initial(run: str, states: ForceStates) -> list[Parameter]:
    parameters = []
    for name, signal in (("angle", states.angle), ("rate", states.rate)):
        value, size = float(signal[0]), rms(signal - np.mean(signal))
        parameters.append(
            Parameter(f"initial {name} of {run}", "initial", value, size, value - size, value + size)
        )
    return parameters


def _record(law: Law, run: Run, states: ForceStates, place: int) -> _Record:
    first = round(states.time[0] * run.sample_rate)
    span = slice(first, first + states.n_samples)
    drive = choose_drive(law, states)
    skip = settling(states)
    moment = run.moment[span]
    measured = (moment if drive == "motion" else run.angle[span])[skip:]
    noise = states.noise.moment if drive == "motion" else states.noise.angle
    free = drive == "moment" and states.method != "periodic"
    return _Record(
        run=run,
        states=states,
        drive=drive,
        moment=moment,
        measured=measured,
        sigma=max(noise, LEAST_NOISE * float(np.std(measured))),
        skip=skip,
        excitation=measured_drive(run, states) if drive == "moment" else None,
        limits=angle_limits(law, states, drive),
        initial=place if free else None,
    )
