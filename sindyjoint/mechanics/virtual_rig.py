"""Virtual tests of an assembled structure: its joints' laws are known, and its sensors have noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
import scipy

from sindyjoint.errors import InputError, checks_options, refuse
from sindyjoint.mechanics import FunctionLaw, Law, PaperLaw
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.rig_test import BASE, RigRun, RigTest, RigUse, Sensor, with_drive
from sindyjoint.mechanics.rigs import UNKNOWN, MeasuredResponse, Rig
from sindyjoint.mechanics.sensors import Channel
from sindyjoint.mechanics.structure import Hinge, Structure
from sindyjoint.mechanics.transient import Response, respond
from sindyjoint.numeric import RNG, Array

Shape = Literal["sine", "multisine", "sweep", "impact"]

# Samples of the simulation for one of the record, at least; what lies above half its rate a filter takes out, as that
# of any recorder does.
OVERSAMPLING = 8
# Central differences of sixth order: at a third of the record's rate 1e-5 of a rate of change is missing.
REACH = 20  # samples of the record that the filter looks to either side
CENTRAL = np.array([3 / 4, -3 / 20, 1 / 60])


@dataclass(frozen=True)
class Drive:
    """What drives one run of a virtual test.

    Parameters
    ----------
    name : str
    shape : {"sine", "multisine", "sweep", "impact"}
    amplitude : float
        Peak, N, or m/s² of the base.
    frequency : float or None
        Of a sine, or at which a multisine repeats, Hz.
    band : tuple of float or None
        Lowest and highest frequency of a multisine or a sweep, Hz.
    width : float or None
        Of an impact, a half-sine, s.
    level : str or None
    use : {"identify", "validate", "update"}
    """

    name: str
    shape: Shape
    amplitude: float
    frequency: float | None = None
    band: tuple[float, float] | None = None
    width: float | None = None
    level: str | None = None
    use: RigUse = "identify"

    def __post_init__(self) -> None:
        needed = {
            "sine": ("frequency",), "multisine": ("frequency", "band"), "sweep": ("band",), "impact": ("width",),
        }  # fmt: skip
        missing = [name for name in needed.get(self.shape, ()) if getattr(self, name) is None]
        faults = [
            (self.shape not in needed, f"shape is {self.shape!r}; expected one of {', '.join(needed)}"),
            (missing, f"a {self.shape} wants {' and '.join(missing)}"),
        ]
        refuse((there, f"run {self.name!r}: {words}") for there, words in faults)

    @property
    def period(self) -> float | None:
        """Frequency at which the drive repeats, Hz; None where it does not."""
        return self.frequency if self.shape in ("sine", "multisine") else None

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        """Return the drive at some instants, shape (n,); a multisine has random phases, a sweep fades out again."""
        if self.shape == "sine":
            return self.amplitude * np.sin(2 * np.pi * (self.frequency or 0.0) * time)
        if self.shape == "impact":
            width = self.width or 0.0
            inside = (time >= 0) & (time < width)
            return self.amplitude * np.where(inside, np.sin(np.pi * time / width), 0.0)
        low, high = self.band or (0.0, 0.0)
        if self.shape == "sweep":
            end = float(time[-1])
            edge = np.clip(np.minimum(time, end - time) / (0.05 * end), 0, 1)
            phase = 2 * np.pi * (low * time + (high - low) * time**2 / (2 * end))
            return self.amplitude * np.sin(phase) * edge**2 * (3 - 2 * edge)
        base = self.frequency or 0.0
        lines = base * np.arange(np.ceil(low / base - 1e-9), np.floor(high / base + 1e-9) + 1)
        if not lines.size:
            raise InputError(
                f"run {self.name!r}: no multiple of {base:g} Hz lies from {low:g} to {high:g} Hz"
            )
        phases = generator.uniform(0, 2 * np.pi, lines.size)
        one = np.arange(0, 1 / base, 1 / (64 * high))
        peak = np.abs(np.sin(2 * np.pi * np.outer(one, lines) + phases).sum(axis=1)).max()
        return (
            self.amplitude
            / peak
            * sum(np.sin(2 * np.pi * line * time + phase) for line, phase in zip(lines, phases, strict=True))
        )


@dataclass(frozen=True)
class Recorder:
    """How the runs of a virtual test are recorded.

    Parameters
    ----------
    sample_rate : float
        Hz.
    duration, settling : float
        Of a record, and how long the drive has been on when it begins, s. Runs that do not repeat begin at rest.
    noise : float
        White noise of every channel as a fraction of its RMS.
    step : float
        Largest time step, s.
    """

    sample_rate: float = 500.0
    duration: float = 20.0
    settling: float = 10.0
    noise: float = 0.01
    step: float = 2.5e-4


def simulate_run(
    structure: Structure,
    at: str,
    sensors: Sequence[Sensor],
    drive: Drive,
    recorder: Recorder,
    generator: np.random.Generator,
) -> tuple[RigRun, Response]:
    """Simulate a run of a structure as its sensors record it, and return what really happened, too.

    Raises
    ------
    InputError, SimulationError
        As :func:`~sindyjoint.mechanics.transient.respond`.
    """
    settling = recorder.settling if drive.period else 0.0
    fine = recorder.sample_rate * OVERSAMPLING
    time = np.arange(0, settling + recorder.duration + 2 / fine, 1 / fine)
    # The filter looks ahead: what is recorded last needs what comes after it.
    ahead = np.arange(1, OVERSAMPLING * REACH + 1) / fine
    if drive.period:
        time = np.concatenate([time, time[-1] + ahead])
        # It fades in over a second.
        edge = np.clip(time, 0, 1)
        values = drive.values(time, generator) * (edge**2 * (3 - 2 * edge))
    else:
        values = np.concatenate([drive.values(time, generator), np.zeros(ahead.size)])
    points = tuple(dict.fromkeys(sensor.point for sensor in sensors))
    response = respond(
        with_drive(structure, at), sampled(values, fine), at,
        duration=settling + recorder.duration + ahead[-1], sample_rate=fine, step=recorder.step, points=points,
        limits="softening",
    )  # fmt: skip
    rate = recorder.sample_rate
    whole = [
        _sampled(response.force, rate, OVERSAMPLING),
        *(_shown(structure, at, each, response, rate) for each in sensors),
    ]
    first, n = round(settling * rate), round(recorder.duration * rate)
    channel = Channel(noise=recorder.noise)
    drive_signal, *others = (channel.read(s[first : first + n], generator) for s in whole)
    run = RigRun(
        drive.name, drive_signal, np.array(others), recorder.sample_rate, drive.period, drive.level, drive.use
    )
    return run, response


def _shown(structure: Structure, at: str, sensor: Sensor, response: Response, rate: float) -> Array:
    """Return what a sensor shows without noise; on a shaken base it shows the motion of the base, too.

    Acceleration is the rate of the simulated velocity: that of the simulation's steps rings where a joint sticks.
    """
    signal = recorded(sensor, response.displacement[sensor.point], response.velocity[sensor.point], rate)
    if at != BASE:
        return signal
    if sensor.quantity != "acceleration":
        raise InputError(f"sensor {sensor.name!r}: on a shaken base a virtual test knows accelerations only")
    assert structure.base is not None
    return signal + _sampled(response.force, rate, OVERSAMPLING) * float(
        structure.point(sensor.point) @ structure.base
    )


def recorded(
    sensor: Sensor, displacement: Array, velocity: Array, rate: float, finer: int = OVERSAMPLING
) -> Array:
    """Return what a sensor shows at the rate of the record, of motion at `finer` times that rate."""
    if sensor.quantity == "acceleration":
        return _sampled(velocity, rate, finer, derivative=True)
    return _sampled(displacement if sensor.quantity == "displacement" else velocity, rate, finer)


def between_samples(signal: Array, finer: int = OVERSAMPLING) -> Array:
    """Return a recorded signal at `finer` times its rate."""
    return np.asarray(
        scipy.signal.resample_poly(signal, finer, 1, window=_recorder_filter(finer), padtype="line")
    )


def _sampled(signal: Array, rate: float, finer: int, derivative: bool = False) -> Array:
    """Return a signal, or its rate of change, at the rate of the record, behind a filter without delay."""
    if derivative:
        reach, n, fine = CENTRAL.size, signal.size, finer * rate
        padded = np.concatenate([np.full(reach, signal[0]), signal, np.full(reach, signal[-1])])
        signal = sum(
            c * fine * (padded[reach + k : n + reach + k] - padded[reach - k : n + reach - k])
            for k, c in enumerate(CENTRAL, 1)
        )
    return np.asarray(
        scipy.signal.resample_poly(signal, 1, finer, window=_recorder_filter(finer), padtype="line")
    )


@lru_cache(maxsize=4)
def _recorder_filter(finer: int) -> Array:
    """Return the filter of the recorder: within 1e-5 of one up to 0.4 of its rate, where harmonics are compared."""
    return np.asarray(scipy.signal.firwin(2 * REACH * finer + 1, 1 / finer, window=("kaiser", 10.0)))


@checks_options()
def virtual_rig_test(
    test: RigTest,
    drives: Sequence[Drive],
    recorder: Recorder,
    rng: RNG = 0,
    seen: Callable[[str, Response], None] = lambda name, response: None,
) -> RigTest:
    """Return a test of a structure whose joints' laws are known, with simulated runs.

    Parameters
    ----------
    test : RigTest
        Its structure's joints hold the true laws.
    drives : sequence of Drive
    recorder : Recorder
    rng : int, Generator or None
        Source of noise and phases.
    seen : callable
        Called with the name of each run and what really happened in it.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import sindyjoint
    >>> plan = sindyjoint.load_rig_plan("pulse-rig")
    >>> recorder = replace(plan.recorder, duration=4.0, settling=4.0)
    >>> test = sindyjoint.virtual_rig_test(plan.test, plan.drives[:2], recorder)
    >>> len(test.runs)
    2
    """
    generator, runs = np.random.default_rng(rng), []
    for drive in drives:
        run, response = simulate_run(test.structure, test.at, test.sensors, drive, recorder, generator)
        seen(run.name, response)
        runs.append(run)
    return replace(test, runs=tuple(runs), simulated=True)


def hinges(rig: Rig) -> tuple[Hinge, ...]:
    """Return the joints of a rig, from the base on.

    Examples
    --------
    >>> import sindyjoint
    >>> [hinge.name for hinge in sindyjoint.hinges(sindyjoint.load_rig("pulse-rig"))]
    ['joint']
    """
    return tuple(item for item in rig.items if isinstance(item, Hinge))


def with_laws(rig: Rig, choose: Callable[[Hinge], Law]) -> Rig:
    """Return the same rig with the law that `choose` gives for each joint.

    Examples
    --------
    >>> import sindyjoint
    >>> rig = sindyjoint.load_rig("pulse-rig")
    >>> other = sindyjoint.with_laws(rig, lambda hinge: sindyjoint.PANEL_ROOT)
    >>> sindyjoint.hinges(other)[0].law.name
    'panel root joint'
    """
    return replace(
        rig,
        items=tuple(
            replace(item, law=choose(item)) if isinstance(item, Hinge) else item for item in rig.items
        ),
    )


def with_loss_factor(rig: Rig, loss_factor: float) -> Rig:
    """Return the same rig with another material loss factor of every beam."""
    return replace(
        rig,
        items=tuple(
            replace(item, loss_factor=loss_factor) if isinstance(item, Beam) else item for item in rig.items
        ),
    )


def _presliding(theta, omega, direction, state, parameters, out):
    elastic = theta * (parameters[0] + theta * (parameters[1] + theta * parameters[2]))
    z = state[0]
    out[0] = elastic + parameters[3] * omega + parameters[4] * z
    out[1] = (omega - abs(omega) * z) / parameters[5]


def presliding_law(law: PaperLaw, angle: float) -> FunctionLaw:
    """Return a joint whose Coulomb friction has elastic presliding.

    The friction moment is M_F·z with dz/dt = (θ̇ − |θ̇| z)/θ_p (Dahl, Aerospace Corporation TOR-158, 1968, with
    exponent one): a spring of stiffness M_F/θ_p at every reversal that yields to M_F over a few θ_p.

    Parameters
    ----------
    law : PaperLaw
    angle : float
        θ_p, rad.

    Raises
    ------
    InputError
        For an angle that is not above zero, or a law that is not the paper's.
    """
    another = not isinstance(law, PaperLaw)
    refuse(
        [
            (
                not 0 < angle < np.inf,
                f"presliding angle is {angle!r} rad; expected a finite number above zero",
            ),
            (another, "presliding is known of the paper's law only; the rig's joint has another one"),
        ]
    )
    return FunctionLaw(
        _presliding, (*law.parameters, float(angle)), n_states=1, inertia=law.inertia,
        softening_limit=law.softening_limit,
    )  # fmt: skip


@checks_options()
def virtual_pulse_test(
    rig: Rig,
    *,
    noise: float = 0.01,
    presliding: float | None = None,
    loss_factor: float | None = None,
    rng: RNG = 0,
) -> MeasuredResponse:
    """Simulate the pulse test of a rig as a sensor sees it.

    Parameters
    ----------
    rig : Rig
        Its joints' laws are the truth.
    noise : float
        White noise of the sensor as a fraction of the response's RMS.
    presliding : float, optional
        Angle of the elastic presliding of every joint, rad.
    loss_factor : float, optional
        Material loss factor of the beams, instead of the rig's.
    rng : int, Generator or None
        Source of the noise.

    Returns
    -------
    MeasuredResponse
        At the rig's first output point.
    """
    truth = []
    if presliding is not None:
        angle = presliding
        rig = with_laws(rig, lambda hinge: presliding_law(hinge.law, angle))  # type: ignore[arg-type]
        truth.append(f"presliding over {1e6 * presliding:g} µrad")
    if loss_factor is not None:
        rig = with_loss_factor(rig, loss_factor)
        truth.append(f"beam loss factor {loss_factor:g}")
    record = virtual_records(rig, noise, np.random.default_rng(rng))[0]
    return replace(record, simulated=True, truth=" and ".join(truth))


def virtual_records(rig: Rig, noise: float, generator: np.random.Generator) -> tuple[MeasuredResponse, ...]:
    """Return what sensors at a rig's output points record after its pulse, with noise as a fraction of their RMS."""
    if any(hinge.law is UNKNOWN for hinge in hinges(rig)):
        raise InputError(
            f"the rig {rig.name!r} has a joint whose law is 'model' and no measured response: a virtual test needs the "
            "true law; add a [measured] table, or name a shipped joint as the law"
        )
    channel, displacement = Channel(noise=noise), rig.respond().displacement
    return tuple(
        MeasuredResponse(point, channel.read(displacement[point], generator), rig.sample_rate)
        for point in rig.points
    )
