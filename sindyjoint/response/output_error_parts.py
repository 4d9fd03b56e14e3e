"""Parts of the output-error problem: its parameters, and the runs as it uses them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.mechanics.excitation import Excitation, repeated, sampled
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.segments import segment_starts
from sindyjoint.record import Motion, Run
from sindyjoint.response.policy import POLICY
from sindyjoint.response.run import Drive, angle_limits, choose_drive, measured_drive, rms, settling
from sindyjoint.states import ForceStates

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


@dataclass(frozen=True)
class Parameter:
    """A parameter of the problem.

    Parameters
    ----------
    name : str
    kind : {"coefficient", "nuisance", "initial"}
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
class Record:
    """A run as the problem uses it.

    Parameters
    ----------
    starts : tuple of int
        Samples at which the simulation starts and is restarted from states that are estimated; none for a run that
        repeats, and for one whose motion is prescribed.
    initial : int
        Index of the first of these states among the parameters: angle and rate of one start after the other.
    """

    run: Run
    states: ForceStates
    drive: Drive
    moment: Array
    measured: Array
    sigma: float
    skip: int
    excitation: Excitation | None
    limits: tuple[float, float]
    starts: tuple[int, ...]
    initial: int

    @property
    def initial_indices(self) -> range:
        """Indices of its initial states among the parameters."""
        return range(self.initial, self.initial + 2 * len(self.starts))

    def rows(self, start: int) -> slice:
        """Return the compared samples that the simulation from one of the starts gives."""
        ends = [*self.starts[1:], self.moment.size]
        return slice(max(self.starts[start] - self.skip, 0), max(ends[start] - self.skip, 0))

    def with_drive_noise(self, generator: np.random.Generator) -> Record:
        """Return the record with another noise draw on the moment channel."""
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


def coefficient(model: JointModel, name: str, moment: float) -> Parameter:
    """Return a coefficient of the model, and how far it may move.

    Negative friction starts at zero and may become as large as the RMS of the moment.
    """
    term = model[name]
    value = term.coefficient
    scale = abs(value) if value != 0 else max(term.standard_error, 1e-12)
    # The coefficient that would carry the whole moment, as far as the term's share is known.
    whole = scale / term.unique_share if term.unique_share > 0 else 0.0
    reach = max(
        POLICY.range_share * scale, POLICY.range_errors * term.standard_error, POLICY.range_moment * whole
    )
    low, high = value - reach, value + reach
    if name == "coulomb_friction" and value < 0:
        return Parameter(name, "coefficient", 0.0, scale, 0.0, moment)
    if name == "coulomb_friction":
        low = max(low, 0.0)
    if name == INERTIA:
        low = max(low, 0.1 * value)
    return Parameter(name, "coefficient", value, scale, low, high)


def nuisance_parameter(name: Nuisance, size: float, period: float) -> Parameter:
    """Return a nuisance parameter for a response of this RMS whose fastest motion has this period, s."""
    start = NUISANCE[name].start
    reach = {
        "delay": POLICY.delay_range * period,
        "gain": POLICY.gain_range,
        "offset": POLICY.offset_range * size,
    }[name]
    # A gain is one of one, a delay and an offset are small: their scale is a hundredth of the motion's.
    scale = {"delay": 0.01 * period, "gain": 1.0, "offset": 0.01 * size}[name]
    return Parameter(name, "nuisance", start, scale, start - reach, start + reach)


def initial_parameters(record: Record, motion: Motion) -> Iterable[Parameter]:
    """Angle and rate of a run where its simulation starts, and where it is restarted."""
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


def record_of(law: Law, run: Run, states: ForceStates, index: int, window: float) -> Record:
    """Return a run as the problem uses it; `index` is the next free one among the parameters."""
    first = round(states.time[0] * run.sample_rate)
    span = slice(first, first + states.n_samples)
    drive = choose_drive(law, states)
    skip = settling(states)
    moment = run.moment[span]
    measured = (moment if drive == "motion" else run.angle[span])[skip:]
    noise = states.noise.moment if drive == "motion" else states.noise.angle
    starts: tuple[int, ...] = ()
    if drive == "windows":
        starts = tuple(segment_starts(states.n_samples, run.sample_rate, window))
    elif drive == "moment" and states.method != "periodic":
        starts = (0,)
    return Record(
        run=run,
        states=states,
        drive=drive,
        moment=moment,
        measured=measured,
        sigma=max(noise, POLICY.least_noise * float(np.std(measured))),
        skip=skip,
        excitation=measured_drive(run, states) if drive == "moment" else None,
        limits=angle_limits(law, states, drive),
        starts=starts,
        initial=index,
    )
