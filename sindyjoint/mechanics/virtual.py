"""Virtual tests: the vibration test of a joint whose law is known, and its measuring channels."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any, Literal

import numpy as np
import scipy

from sindyjoint.errors import InputError, SimulationError, UnknownNameError, checks_options, refuse
from sindyjoint.measurement.runs import measured_run
from sindyjoint.mechanics import INTER_PANEL, PANEL_ROOT, Law, SumLaw
from sindyjoint.mechanics.excitation import SINE, Excitation, tones
from sindyjoint.mechanics.sensors import SENSOR_RIG, Channel, raw_channels
from sindyjoint.mechanics.stickslip import prescribed_motion, simulate
from sindyjoint.numeric import RNG, Array
from sindyjoint.record import Campaign, Joint, Run

Drive = Literal["moment", "rig", "displacement"]

JOINTS: dict[str, Law] = {"inter-panel": INTER_PANEL, "panel-root": PANEL_ROOT}
DRIVES = ("moment", "rig", "displacement")
Accelerometer = Literal["", "instead", "beside"]

#: Peak angles as fractions of the softening limit.
LEVELS = (0.92, 0.63, 0.35)

#: Beam inertia between exciter and gauges of the "rig" drive, kg·m²: puts the inter-panel joint's resonance at 5.5 Hz.
BEAM_INERTIA = 5.0


# The prescribed motion starts here in its cycle, so that reversals fall between samples and not on them.
PHASE = 0.1


def named_joint(joint: str | Law) -> Law:
    """Return the law of a joint by name; a law is returned as it is.

    Raises
    ------
    UnknownNameError
        For an unknown name.
    """
    if isinstance(joint, str) and joint not in JOINTS:
        raise UnknownNameError(f"joint {joint!r} is not known; expected one of {', '.join(JOINTS)}")
    return JOINTS[joint] if isinstance(joint, str) else joint


@dataclass(frozen=True)
class VirtualTest:
    """A plan of runs: which joint, how driven, how measured.

    Parameters
    ----------
    law : Law
    frequencies : tuple of float
        Hz.
    levels : tuple of float
        Peak angles as fractions of `angle_limit`.
    drive : {"moment", "rig", "displacement"}
        A sinusoidal moment at the sensor, one on the exciter inertia `beam_inertia`, or a sinusoidal angle.
    sample_rate, duration : float
        Hz and s.
    settling : float
        Time simulated before the record begins, s. Zero: the start-up transient is part of the record.
    moment_channel, angle_channel : Channel
    accelerometer : {"", "instead", "beside"}
        Whether the motion is measured by an accelerometer instead of the angle's sensor or beside it.
    acceleration_channel : Channel
    angle_drift : float
        Of the angle's sensor over the record, as a share of the angle's RMS: a random walk and a straight line.
    raw : bool
        Whether moment and angle are read through strain gauges and laser spots (with the moment channel's errors).
    skew : float
        Time delay between the channels, s: the moment lags the angle.
    beam_inertia : float
        J of the "rig" drive, kg·m².
    angle_limit : float
        rad.
    rtol : float
        Tolerance of the simulation.
    waveform : str
        One of :data:`sindyjoint.mechanics.excitation.TONES`.
    """

    law: Law
    frequencies: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0)
    levels: tuple[float, ...] = LEVELS
    drive: Drive = "moment"
    sample_rate: float = 1000.0
    duration: float = 10.0
    settling: float = 0.0
    moment_channel: Channel = field(default_factory=Channel)
    angle_channel: Channel = field(default_factory=Channel)
    raw: bool = False
    skew: float = 0.0
    beam_inertia: float = BEAM_INERTIA
    accelerometer: Accelerometer = ""
    acceleration_channel: Channel = field(default_factory=Channel)
    angle_drift: float = 0.0
    angle_limit: float = 0.0
    rtol: float = 1e-7
    waveform: str = SINE

    def __post_init__(self) -> None:
        lists = [(name, getattr(self, name)) for name in ("frequencies", "levels")]
        above = [(name, getattr(self, name)) for name in ("sample_rate", "duration", "angle_limit")]
        at_least = [(name, getattr(self, name)) for name in ("settling", "beam_inertia", "angle_drift")]
        top = max(self.frequencies, default=0.0)
        refuse(
            [
                (
                    self.drive not in DRIVES,
                    f"drive is {self.drive!r}; expected 'moment', 'rig' or 'displacement'",
                ),
                (
                    self.accelerometer not in ("", "instead", "beside"),
                    f"accelerometer is {self.accelerometer!r}; expected 'instead' or 'beside'",
                ),
                (
                    self.accelerometer and self.raw,
                    "raw_channels and an accelerometer were given; expected one of the two",
                ),
                *(
                    (
                        not (values and all(0 < v < np.inf for v in values)),
                        f"{name} are {values!r}; expected at least one positive number",
                    )
                    for name, values in lists
                ),
                *(
                    (len(set(values)) < len(values), f"{name} are {values!r}; each may be named once")
                    for name, values in lists
                ),
                *((not 0 < v < np.inf, f"{name} is {v!r}; expected a positive number") for name, v in above),
                *(
                    (not 0 <= v < np.inf, f"{name} is {v!r}; expected a number that is not negative")
                    for name, v in at_least
                ),
                (
                    self.sample_rate < 10 * top,
                    f"sample_rate is {self.sample_rate:g} Hz; expected at least {10 * top:g} Hz, ten samples per "
                    f"period of {top:g} Hz",
                ),
                (
                    not 2 * abs(self.skew) * top < 1,
                    f"skew is {self.skew!r} s; expected less than half a period",
                ),
            ]
        )

    @property
    def _exciter_inertia(self) -> float:
        return self.beam_inertia if self.drive == "rig" else 0.0

    def _excitation(self, amplitude: float, frequency: float) -> Excitation:
        # A rig near its resonance overshoots when the moment starts at once: it is faded in over three periods.
        ramp = 3.0 / frequency if self.drive == "rig" else 0.0
        return replace(tones(self.waveform, amplitude, frequency), ramp=ramp)

    def amplitude(self, frequency: float, level: float) -> float:
        """Amplitude of the drive that reaches the level's peak angle: a moment, N·m, or the angle, rad.

        Raises
        ------
        InputError
            When no amplitude reaches the angle.
        """
        target = level * self.angle_limit
        if self.drive == "displacement":
            return target
        # Near a resonance the peak builds up slowly; elsewhere the second cycle repeats the first.
        periods = 30.0 if self.drive == "rig" else 4.0
        duration = min(self.settling + self.duration, periods / frequency)

        def excess(amplitude: float) -> float:
            try:
                motion = simulate(
                    self.law, self._excitation(amplitude, frequency), duration, 200 * frequency,
                    beam_inertia=self._exciter_inertia, limits=(-1.3 * target, 1.3 * target), rtol=1e-5,
                )  # fmt: skip
            except SimulationError:
                return 0.3
            return float(np.abs(motion.angle).max()) / target - 1.0

        w = 2 * np.pi * frequency
        at_peak = np.abs(
            self.law.moment(np.array([target, -target]), w * target, np.array([1.0, -1.0]), None)
        )
        high = 2 * float(at_peak.max() + (self.law.inertia + self._exciter_inertia) * w**2 * target)
        if excess(high) < 0:
            raise InputError(f"no moment up to {high:.3g} N·m reaches {target:.3g} rad at {frequency:g} Hz")
        found = float(scipy.optimize.brentq(excess, 0.0, high, xtol=1e-12 * high, rtol=2e-4))
        # Near a resonance the peak jumps with the amplitude; the side that stays below the angle is taken.
        return found if excess(found) < 1e-3 else found * (1 - 5e-4)

    def ideal(self, frequency: float, amplitude: float) -> tuple[Array, Array, Array]:
        """Moment, angle and acceleration at the sensors, free of errors but the time delay, each of shape (n,)."""
        start, n = round(self.settling * self.sample_rate), round(self.duration * self.sample_rate)
        # A shifted channel is interpolated from a finer record: 16 kHz for 1 kHz keeps a 6 Hz tone to 1e-6.
        finer = 16 if self.skew or self.accelerometer else 1
        rate = self.sample_rate * finer
        # Room on both sides of the record for a shifted channel.
        total = (start + n + round(abs(self.skew) * self.sample_rate) + 2) / self.sample_rate
        if self.drive == "displacement":
            tone = tones(self.waveform, amplitude, frequency, PHASE)
            motion = prescribed_motion(self.law, tone, round(total * rate), rate)
        else:
            motion = simulate(
                self.law, self._excitation(amplitude, frequency), total, rate,
                beam_inertia=self._exciter_inertia, rtol=self.rtol,
            )  # fmt: skip
        time, angle, moment = motion.time, motion.angle, motion.moment
        kept = slice(start * finer, (start + n) * finer, finer)
        # An acceleration jumps where friction does. Sampled without an anti-alias filter, the place of a jump between
        # two samples is lost, and with it what the jump does to the rate.
        shown = np.asarray(scipy.signal.resample_poly(motion.acceleration, 1, finer))[start : start + n]
        # Straight lines between the fine samples, since a moment has corners (and, for a prescribed motion, jumps) at
        # which smooth curves ring.
        return np.interp(time[kept] - self.skew, time, moment), angle[kept], shown

    def measured(
        self, moment: Array, angle: Array, generator: np.random.Generator
    ) -> tuple[Array, Array, dict[str, Array]]:
        """Return moment and angle as measured, and the raw channels (empty when not asked for)."""
        if not self.raw:
            return self.moment_channel.read(moment, generator), self.angle_channel.read(angle, generator), {}
        moment = self.moment_channel.gain * moment + self.moment_channel.offset
        angle = self.angle_channel.gain * angle + self.angle_channel.offset
        errors = Channel(noise=self.moment_channel.noise, bits=self.moment_channel.bits)
        raw = raw_channels(moment, angle, errors, generator)
        shown = np.stack(list(raw.values()))
        return SENSOR_RIG.moment(shown[:4]), SENSOR_RIG.angle(shown[4:]), raw

    def drift(self, angle: Array, generator: np.random.Generator) -> Array:
        """Return how the angle's sensor drifts, rad, shape (n,); zero without a drift."""
        if not self.angle_drift:
            return np.zeros(angle.size)
        walk = np.cumsum(generator.standard_normal(angle.size)) / np.sqrt(angle.size)
        line = generator.standard_normal() * np.linspace(0, 1, angle.size)
        return np.asarray(self.angle_drift * np.std(angle) * (walk + line))


def run_tests(test: VirtualTest, generator: np.random.Generator) -> list[tuple[Run, dict[str, Array]]]:
    """Make every run of the plan, frequency by frequency, level by level.

    Beside each stand the raw channels that it was computed from, empty unless asked for.
    """
    runs = []
    for frequency in test.frequencies:
        for level in test.levels:
            moment, angle, acceleration = test.ideal(frequency, test.amplitude(frequency, level))
            moment, angle, raw = test.measured(moment, angle, generator)
            signals = {"moment": moment, "angle": angle + test.drift(angle, generator)}
            if test.accelerometer:
                signals["acceleration"] = test.acceleration_channel.read(acceleration, generator)
            if test.accelerometer == "instead":
                del signals["angle"]
            run = measured_run(
                f"{frequency:g}Hz-{level:g}",
                signals,
                test.sample_rate,
                frequency=frequency,
                level=f"{level:g}",
            )
            runs.append((run, raw))
    return runs


def virtual_test(
    joint: str | Law = "inter-panel",
    *,
    noise: float = 0.01,
    quantisation: int | None = None,
    hidden: Any = None,
    raw_channels: bool = False,
    moment_gain: float = 1.0,
    angle_gain: float = 1.0,
    angle_offset: float = 0.0,
    moment_offset: float = 0.0,
    angle_limit: float | None = None,
    frequencies: Sequence[float] = (3.0, 4.0, 5.0, 6.0),
    levels: Sequence[float] = LEVELS,
    **options: Any,
) -> VirtualTest:
    """Write the plan of a virtual test; parameters are those of :func:`virtual_campaign`."""
    law = named_joint(joint)
    if hidden is not None:
        law = SumLaw(law, hidden)
    limit = angle_limit if angle_limit is not None else law.softening_angle
    if not np.isfinite(limit):
        raise InputError(
            "this joint has no softening limit for the levels to refer to; give angle_limit in rad"
        )
    return VirtualTest(
        law, tuple(map(float, frequencies)), tuple(map(float, levels)), angle_limit=float(limit), raw=raw_channels,
        moment_channel=Channel(noise, quantisation, moment_gain, moment_offset),
        angle_channel=Channel(noise, quantisation, angle_gain, angle_offset),
        acceleration_channel=Channel(noise, quantisation), **options,
    )  # fmt: skip


def plan_options() -> tuple[str, ...]:
    """Return what the plan of a virtual test may be asked for."""
    return (*signature(virtual_test).parameters, *signature(VirtualTest).parameters)


@checks_options(plan_options)
def virtual_campaign(
    joint: str | Law = "inter-panel",
    *,
    rng: RNG = None,
    name: str | None = None,
    **options: Any,
) -> Campaign:
    """Simulate the paper's test campaign: single-frequency runs of a joint at several levels.

    Parameters
    ----------
    joint : {"inter-panel", "panel-root"} or Law
        The paper's joints by name (Tables 1 and 2, averages), or any law.
    rng : int, Generator or None
        Source of the noise.
    name : str, optional
        Name of the joint in reports.
    **options
        ``frequencies`` (3, 4, 5, 6 Hz), ``levels`` (peak angles as fractions of the softening limit
        sqrt(k1/(3|k3|)), or of ``angle_limit`` in rad), ``drive`` ("moment", "rig", "displacement"), ``noise``
        (fraction of each channel's RMS, 0.01), ``quantisation`` (bits), ``sample_rate`` (1000 Hz), ``duration``
        (10 s), ``settling`` (s simulated before the record; 0 keeps the start-up transient), ``raw_channels`` (read
        through strain gauges and lasers), ``beam_inertia`` (kg·m², for "rig"), ``hidden`` (a law added to the
        joint's), ``skew`` (time delay between the channels: moment behind angle, s), ``angle_offset`` (rad),
        ``moment_offset`` (N·m), ``angle_gain``, ``moment_gain``, ``accelerometer`` ("instead" of the angle's sensor or
        "beside" it), ``angle_drift`` (of the angle's sensor, as a share of the angle's RMS), ``rtol``.

    Returns
    -------
    Campaign
        Marked as simulated.

    Raises
    ------
    InputError, UnknownNameError, SimulationError

    Examples
    --------
    >>> campaign = virtual_campaign(frequencies=[4], levels=[0.5], duration=1.0, rng=1)
    >>> campaign.runs[0].name, campaign.simulated
    ('4Hz-0.5', True)
    """
    test = virtual_test(joint, **options)
    runs = [run for run, _ in run_tests(test, np.random.default_rng(rng))]
    return Campaign(campaign_joint(test, name), tuple(runs), simulated=True)


def campaign_joint(test: VirtualTest, name: str | None = None) -> Joint:
    """Return the joint of a virtual test as a campaign names it."""
    return Joint(
        name=name or getattr(test.law, "name", None) or _find_name(test.law), inertia=test.law.inertia
    )


def _find_name(law: Any) -> str:
    first = getattr(law, "first", None)
    return "joint" if first is None else getattr(first, "name", None) or _find_name(first)
