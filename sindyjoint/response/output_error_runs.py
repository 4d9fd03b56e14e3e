"""Parameters and runs of the output-error problem: how far each may move, what drives a run, what is compared."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.element import JointElement, Value
from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.limits import RESPONSE
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import Excitation, repeated, sampled
from sindyjoint.mechanics.stickslip import slip_direction, transfer_moment
from sindyjoint.numeric import Array, Booleans, Integers, rms
from sindyjoint.record import Motion, Run
from sindyjoint.response import added_law, law_of_test
from sindyjoint.response.drive import Drive, choose_drive, prescribed, segment_starts
from sindyjoint.response.laws import law_terms
from sindyjoint.response.run import (
    above_noise,
    along_motion,
    angle_limits,
    averaged,
    followed_motion,
    measured_drive,
    remembered,
    rest_of,
    settling,
    span_of,
    window_of,
)
from sindyjoint.states import ForceStates, HarmonicBasis, smoothing_kernels


@dataclass(frozen=True)
class Parameter:
    """A parameter of the problem.

    Parameters
    ----------
    name : str
    kind : {"coefficient", "element", "nuisance", "initial"}
    start, scale, low, high : float
        In the parameter's unit.
    """

    name: str
    kind: str
    start: float
    scale: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Cycle:
    """How the compared samples of a run that repeats are read off one simulated period.

    Parameters
    ----------
    frequency : float
        Hz.
    nodes : int
        Simulated samples of a period.
    left : ndarray of int, shape (n,)
        The simulated sample before each compared one.
    share : ndarray, shape (n,)
        How far between that and the next.
    settled : int
        Periods in which a wrong initial state dies out, before the one that is used.
    """

    frequency: float
    nodes: int
    left: Integers
    share: Array
    settled: int

    @classmethod
    def of(cls, states: ForceStates, skip: int, settled: int) -> Self:
        """Return the cycle of periodic states, compared from sample ``skip`` on."""
        per = states.sample_rate / states.fundamental
        nodes = round(per)
        place = np.arange(skip, states.n_samples) / per % 1.0 * nodes
        left = np.floor(place).astype(np.intp)
        return cls(states.fundamental, nodes, left % nodes, place - left, settled)

    @property
    def sample_rate(self) -> float:
        """Of the simulation, Hz."""
        return self.nodes * self.frequency

    @property
    def duration(self) -> float:
        """What is simulated, s."""
        return (self.settled + 1) / self.frequency

    def at_samples(self, values: Array, slopes: Array) -> Array:
        """Return a simulated signal at the compared samples, by cubic Hermite interpolation, shape (sets, n)."""
        values, slopes = values[:, -self.nodes :], slopes[:, -self.nodes :] / self.sample_rate
        u, right = self.share, (self.left + 1) % self.nodes
        return (
            (1 + 2 * u) * (1 - u) ** 2 * values[:, self.left]
            + u * (1 - u) ** 2 * slopes[:, self.left]
            + u**2 * (3 - 2 * u) * values[:, right]
            + u**2 * (u - 1) * slopes[:, right]
        )


@dataclass(frozen=True, eq=False)
class Record:
    """A run as the problem uses it.

    Parameters
    ----------
    law : Law
        Of the joint in this run, with the numbers that the problem starts from.
    moment : ndarray
        At the sensor over the simulated samples, N·m.
    measured : ndarray, shape (n,)
        The response that is compared: the last n of the simulated samples.
    sigma : float
        Its noise.
    skip : int
        Simulated samples before the compared ones; none where a period is simulated for all.
    used : ndarray of bool, shape (n,), optional
        Of a prescribed motion the compared samples in which the joint moves: at a reversal friction jumps, and which
        side a sample is on is a matter of noise.
    inner : ndarray, shape (n_states,), optional
        Internal states that a simulation starts from: those of a joint brought from standstill to the first angle.
    remembered : ndarray of int
        Places of those that a run that repeats does not forget: they are estimated.
    cycle : Cycle, optional
        Where one period is simulated for all that the run repeats.
    in_law : pair of ndarray, or None
        Where it is simulated: the parameters of its compiled law, and their derivatives by the model's numbers.
    columns : ndarray, shape (n_simulated, n_terms), or None
        Of a prescribed motion: the terms along it.
    added : ndarray, shape (n_simulated,), or None
        Moments of the test along it.
    starts : tuple of int
        Samples at which the simulation starts and is restarted from states that are estimated; none for a run that
        repeats, and for one whose motion is prescribed.
    window : float
        s, from one start to the next of a joint without restoring moment.
    initial : int
        Index of the first of these states among the parameters: angle and rate of one start after the other; of a run
        that repeats its internal states: a slider that does not yield in it keeps what came before.
    """

    run: Run
    states: ForceStates
    law: Law
    drive: Drive
    moment: Array
    measured: Array
    sigma: float
    skip: int
    excitation: Excitation | None
    limits: tuple[float, float]
    starts: tuple[int, ...]
    window: float
    initial: int
    in_law: tuple[Array, Array] | None
    remembered: Integers
    used: Booleans | None = None
    inner: Array | None = None
    cycle: Cycle | None = None
    columns: Array | None = None
    added: Array | None = None

    @cached_property
    def followed(self) -> tuple[Array, Array]:
        """Angle and rate that internal states follow."""
        return followed_motion(self.states)

    @property
    def initial_indices(self) -> range:
        """Indices of its initial states among the parameters."""
        return range(self.initial, self.initial + 2 * len(self.starts))

    @property
    def inner_indices(self) -> range:
        """Indices among the parameters of the internal states that are remembered."""
        return range(self.initial, self.initial + self.remembered.size)

    def rows(self, start: int) -> slice:
        """Return the compared samples that the simulation from one of the starts gives."""
        ends = [*self.starts[1:], self.moment.size]
        return slice(max(self.starts[start] - self.skip, 0), max(ends[start] - self.skip, 0))

    def with_drive_noise(self, generator: np.random.Generator, model: JointModel) -> Self:
        """Return the record with another noise draw on the channel that drives: the moment, or the motion."""
        if self.drive == "motion":
            states = noisy_motion(self.states, generator)
            return replace(self, states=states, columns=term_columns(model, law_terms(model), states))
        level = self.states.noise.moment
        moment = self.moment + level * generator.standard_normal(self.moment.size)
        if self.excitation is None:
            return replace(self, moment=moment)
        if not self.excitation.periodic:
            drive = above_noise(moment, self.run.sample_rate)
            return replace(self, moment=moment, excitation=sampled(drive, self.run.sample_rate))
        mean = self.excitation.pieces[:, 0]
        periods = self.moment.size / mean.size
        noisy = mean + level / np.sqrt(periods) * generator.standard_normal(mean.size)
        return replace(self, excitation=repeated(noisy, self.excitation.step * mean.size))


def initial_parameters(record: Record, motion: Motion) -> Iterable[Parameter]:
    """Angle and rate of a run where its simulation starts and is restarted, or its internal states at the start."""
    names = ("angle", "rate") if motion == "rotation" else ("displacement", "velocity")
    signals = tuple(zip(names, (record.states.angle, record.states.rate), strict=True))
    for number, first in enumerate(record.starts, 1):
        for name, signal in signals:
            value, size = float(signal[first]), rms(signal - np.mean(signal))
            segment = f", segment {number}" if len(record.starts) > 1 else ""
            yield Parameter(
                f"initial {name} of {record.run.name}{segment}",
                "initial",
                value,
                size,
                value - size,
                value + size,
            )
    for place in record.remembered.tolist():
        assert record.inner is not None
        value = float(record.inner[place])
        size = max(2 * abs(value), float(np.ptp(record.states.angle)))
        name = f"internal state {place + 1} of {record.run.name} at its start"
        yield Parameter(name, "initial", value, size, -size, size)


def term_columns(model: JointModel, terms: Sequence[ModelTerm], states: ForceStates) -> Array:
    """Return some of a model's terms along a motion, shape (n, n_terms)."""
    if not terms:
        return np.empty((states.n_samples, 0))
    # At standstill friction keeps the side of the motion before.
    rate = np.where(states.rate == 0, 1e-300 * slip_direction(states.rate), states.rate)
    inputs = model.input_arrays(states.inputs, states.angle.shape)
    function = compile_terms([term.expression for term in terms], (*VARIABLES, *inputs))
    return function(states.angle, rate, states.acceleration, *inputs.values())


def noisy_motion(states: ForceStates, generator: np.random.Generator) -> ForceStates:
    """Return states whose motion has another draw of the noise that its estimate has.

    That of a series is in the coefficients of its harmonics, √(2/n)·σ each; elsewhere white noise went through the
    smoothing kernels.
    """
    n = states.n_samples
    if states.method == "periodic" and states.frequency is not None:
        orders = np.arange(1, max(1, round(states.bandwidth / states.frequency)) + 1)
        size = states.white_noise(states.frequency * orders) * np.sqrt(2.0 / n)
        a, b = size * generator.standard_normal((2, orders.size))
        angle, rate, acceleration = HarmonicBasis.build(states.time, states.frequency, orders).motion(
            0.0, a, b
        )
    else:
        kernels = smoothing_kernels(states.bandwidth, states.sample_rate)
        noise = states.draw_angle_noise(n + kernels[0].size - 1, generator)
        angle, rate, acceleration = (np.convolve(noise, kernel, mode="valid") for kernel in kernels)
    return replace(
        states,
        angle=states.angle + angle,
        rate=states.rate + rate,
        acceleration=states.acceleration + acceleration,
        replicate=None,
    )


def record_of(
    model: JointModel,
    run: Run,
    states: ForceStates,
    test: TestNuisances,
    index: int,
    window: float | None,
    settled: int,
) -> Record:
    """Return a run as the problem uses it; ``index`` is the next free one among the parameters.

    Of a run that repeats one period is simulated, after ``settled`` in which it becomes steady. A motion that was
    prescribed is the drive. Where the states are a mean period, a law with internal states runs through it twice:
    these are not known at its start.
    """
    law, span, run = law_of_test(test, model, states), span_of(run, states), averaged(run, states)
    window = window_of(states, window)
    drive = "motion" if prescribed(states, spurious=True) else choose_drive(law, states)
    skip, moment = settling(states), run.moment[span]
    measured = (moment if drive == "motion" else run.angle[span])[skip:]
    noise = states.noise.moment if drive == "motion" else states.noise.angle
    excitation = measured_drive(run, states) if drive == "moment" else None
    starts: tuple[int, ...] = ()
    if drive == "windows":
        starts = tuple(segment_starts(states.n_samples, run.sample_rate, window))
    elif drive == "moment" and states.repeated and law.n_states:
        excitation = repeated(states.moment, states.n_samples / run.sample_rate)
        moment, skip = np.tile(states.moment, 2), states.n_samples
    elif drive == "moment" and states.method != "periodic":
        starts = (0,)
    steady = drive == "moment" and states.method == "periodic"
    added = added_law(test, states) if drive == "motion" else None
    inner = None
    if drive == "moment" and not test.moments:
        inner = along_motion(law, states, run.sample_rate)[1][:, 0]
    return Record(
        run=run,
        states=states,
        law=law,
        drive=drive,
        moment=moment,
        measured=measured,
        sigma=max(noise, RESPONSE.simulated * float(np.std(measured))),
        skip=0 if steady else skip,
        excitation=excitation,
        limits=angle_limits(law, states, drive),
        starts=starts,
        window=window,
        initial=index,
        in_law=None if drive == "motion" else numbers_in_law(model, states, test, law),
        used=states.moving[skip:] if drive == "motion" else None,
        inner=inner,
        remembered=np.empty(0, dtype=np.intp) if inner is None or not steady else remembered(law, states),
        cycle=Cycle.of(states, skip, settled) if steady else None,
        columns=term_columns(model, law_terms(model), states) if drive == "motion" else None,
        added=None
        if added is None
        else transfer_moment(added, *followed_motion(states), run.sample_rate, rest=rest_of(states))[0],
    )


def numbers_in_law(
    model: JointModel, states: ForceStates, test: TestNuisances, law: Law
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the parameters of a run's compiled law, and their derivatives by the model's numbers.

    They are linear in these, whatever inputs the law is held at: one number after the other is doubled.
    """
    start, columns = law.compiled().parameters, []
    for place, value in enumerate(model.numbers):
        change = np.zeros(model.numbers.size)
        change[place] = value if value != 0 else 1.0
        other = law_of_test(test, model.with_numbers(model.numbers + change), states)
        columns.append((other.compiled().parameters - start) / change[place])
    return start, np.column_stack(columns)


Nuisance = Literal["delay", "gain", "offset"]


# What a nuisance parameter starts at, and its unit as it is written.
NUISANCE: dict[Nuisance, tuple[float, str]] = {"delay": (0.0, " s"), "gain": (1.0, ""), "offset": (0.0, "")}


def coefficient(model: JointModel, name: str, moment: float) -> Parameter:
    """Return a coefficient of the model, and how far it may move.

    Negative friction starts at zero and may become as large as the RMS of the moment.
    """
    term = model[name]
    value = term.coefficient
    scale = abs(value) if value != 0 else max(term.standard_error, 1e-12)
    # Where the term's share is not known, it is taken for the whole.
    reach = RESPONSE.reach * scale / min(term.unique_share if term.unique_share > 0 else 1.0, 1.0)
    low, high = value - reach, value + reach
    if name == "coulomb_friction" and value < 0:
        return Parameter(name, "coefficient", 0.0, scale, 0.0, moment)
    if name == "coulomb_friction":
        low = max(low, 0.0)
    if name == INERTIA:
        low = max(low, 0.1 * value)
    return Parameter(name, "coefficient", value, scale, low, high)


def element_parameters(elements: Iterable[JointElement]) -> Iterable[Parameter]:
    """Yield the numbers of elements as parameters, in the order of a model's numbers; each keeps its sign."""
    for element in elements:
        for number in element.numbers:
            value, reach = number.value, range_of(element, number)
            scale = abs(value) if value != 0 else max(number.standard_error, 1e-12)
            ends = sorted((value / reach, value * reach)) if value != 0 else (-reach * scale, reach * scale)
            yield Parameter(f"{number.name} of {element.id}", "element", value, scale, *ends)


def range_of(element: JointElement, number: Value) -> float:
    """Return how many times itself a number of an element may become."""
    shape = number.unit in ("", "1") and number in element.parameters
    return RESPONSE.shape_range if shape else RESPONSE.element_range


def nuisance_parameter(name: Nuisance, size: float, period: float) -> Parameter:
    """Return a nuisance parameter for a response of this RMS whose fastest motion has this period, s."""
    start, whole = NUISANCE[name][0], {"delay": period, "gain": 1.0, "offset": size}[name]
    reach = RESPONSE.reach * whole
    # A gain is one of one, a delay and an offset are small: their scale is a hundredth of the motion's.
    scale = whole if name == "gain" else 0.01 * whole
    return Parameter(name, "nuisance", start, scale, start - reach, start + reach)
