"""The measured record: what a campaign of vibration runs is, in SI units, checked on creation.

Everything past ``files/`` is rad, N·m, s; for a translational joint (``motion = "translation"``) read metre
for radian and newton for newton-metre. The attribute names stay those of the rotational case.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.described import Shown
from sindyjoint.errors import InputError, refuse
from sindyjoint.hooks import supplied
from sindyjoint.inputs import Input, LongRecord, Source, check_inputs, signals_of
from sindyjoint.plain import Size
from sindyjoint.rig import Fusion, SensorNoise, unknown_means
from sindyjoint.text import control_character, printable, quantities

Motion = Literal["rotation", "translation"]
Use = Literal["identify", "validate"]

MINIMUM_SAMPLES = 32
#: What every report says first on runs of a virtual test.
SIMULATED = "the campaign is simulated (a virtual test), not measured"
# Channels of a run with an accelerometer, beside which its angle is that of all sensors.
MEASURED_ANGLE, MEASURED_RATE = "measured angle", "measured rate"
LARGEST = 1e50  # value of a channel: no unit makes one larger, and its powers are still numbers
WITHOUT_TIME = (
    "the samples have no time: candidates are terms and elements without rate; inertia, damping, frequency and delay "
    "are not judged"
)


def checked_signal(name: str, values: ArrayLike, run: str) -> NDArray[np.float64]:
    """Return a read-only float64 copy of a one-dimensional signal of finite values that squares of squares allow."""
    array = np.array(values, dtype=np.float64)
    if array.ndim != 1:
        raise InputError(f"run {run!r}: {name} has shape {array.shape}; expected a one-dimensional signal")
    bad = np.flatnonzero(~(np.abs(array) <= LARGEST))
    if bad.size:
        raise InputError(
            f"run {run!r}: {name} holds {bad.size} value(s) that are not finite or beyond {LARGEST:g}, the first at "
            f"sample {bad[0]}; remove or repair them before the run is used"
        )
    array.flags.writeable = False
    return array


def _check_texts(where: str, texts: Iterable[str | None]) -> None:
    """Refuse what a terminal would obey, not show."""
    for text in texts:
        if isinstance(text, str) and control_character(text) is not None:
            raise InputError(f"{where}: {printable(text)!r:.60} holds a control character; take it out")


@dataclass(frozen=True)
class Joint:
    """The joint under test.

    Parameters
    ----------
    name : str
        What the joint is called in reports.
    motion : {"rotation", "translation"}
        Whether angle and moment (rad, N·m) or displacement and force (m, N) are meant.
    inertia : float or None
        Moving inertia between moment sensor and joint, kg·m² (kg). ``None``: identified as a term.
    temperature : float or None
        At which the joint was tested, K.
    serial : str or None
        Serial number.
    labels : mapping of str to str
        Anything else the person wrote down about the joint.

    Examples
    --------
    >>> import sindyjoint
    >>> sindyjoint.Joint("latch", inertia=0.02, temperature=293.15).motion
    'rotation'
    """

    name: str = "joint"
    motion: Motion = "rotation"
    inertia: Size | None = None
    temperature: float | None = None
    serial: str | None = None
    labels: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        inertia, temperature = self.inertia, self.temperature
        heavy = inertia is None or (np.isfinite(inertia) and inertia >= 0)
        warm = temperature is None or (np.isfinite(temperature) and temperature > 0)
        refuse(
            [
                (
                    self.motion not in ("rotation", "translation"),
                    f"motion is {self.motion!r}; expected 'rotation' or 'translation'",
                ),
                (not heavy, f"inertia is {inertia!r}; expected a finite number that is not negative"),
                (not warm, f"temperature is {temperature!r} K; expected a finite number above zero"),
            ]
        )
        _check_texts("joint", (self.name, self.serial, *self.labels, *self.labels.values()))


@dataclass(frozen=True, eq=False)
class Run:
    """One measured run, uniformly sampled.

    Parameters
    ----------
    name : str
    moment, angle : array_like, shape (n,)
        Moment at the sensor, N·m (N), and joint angle, rad (m), at the same instants.
    sample_rate : float
        Hz.
    rate : array_like, shape (n,), optional
        Measured angular velocity, rad/s (m/s).
    frequency : float, optional
        Excitation frequency, Hz; ``None`` for an aperiodic run.
    level : str, optional
        Free label of the excitation level.
    use : {"identify", "validate"}
        Runs marked ``"validate"`` are never used for fitting.
    source : Source, optional
    whole : LongRecord, optional
        Where all of its samples are, if the run is longer than what is in memory.
    noise : SensorNoise
        Of the sensors, as declared.
    valid : array_like of bool, shape (n,), optional
        False at samples that are left out of every fit because a channel is at fault there; the signals then hold
        interpolated values. Default: all samples count.
    inputs : mapping of str to array_like, shape (n,), or float
        What else the law may depend on, SI, at the same instants; a number stands for all of them.
    fusion : Fusion, optional
        The sensors of a run with an accelerometer, whose angle is that of all of them.
    quasi_static : bool
        Whether the samples lie at even steps of the travelled path, which then takes the place of time:
        ``sample_rate`` is their number per rad (m). See :mod:`sindyjoint.measurement.runs`.

    Raises
    ------
    InputError
        For signals of different length, too few samples, values that are not finite, or a sampling rate that
        cannot resolve the frequency.

    Examples
    --------
    >>> import sindyjoint
    >>> t = np.arange(1000) / 500
    >>> run = sindyjoint.Run("4 Hz", np.sin(25 * t), 1e-3 * np.sin(25 * t), sample_rate=500.0, frequency=4.0)
    >>> run.duration
    2.0
    """

    name: str
    moment: NDArray[np.float64]
    angle: NDArray[np.float64]
    sample_rate: float
    rate: NDArray[np.float64] | None = None
    frequency: float | None = None
    level: str | None = None
    use: Use = "identify"
    source: Source | None = field(default=None)
    whole: LongRecord | None = field(default=None)
    noise: SensorNoise = SensorNoise()
    valid: NDArray[np.bool_] | None = None
    inputs: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    fusion: Fusion | None = None
    quasi_static: bool = False

    @property
    def channels(self) -> dict[str, NDArray[np.float64]]:
        """Channels by name: moment, angle and perhaps rate; of a run with an accelerometer also its sensors."""
        found = {"moment": self.moment, "angle": self.angle, "rate": self.rate}
        if self.fusion is not None:
            found |= {"acceleration": self.fusion.acceleration, MEASURED_ANGLE: self.fusion.angle}
            found[MEASURED_RATE] = self.fusion.rate
        return {name: values for name, values in found.items() if values is not None}

    def __post_init__(self) -> None:
        _check_texts("run", (self.name, self.level))
        for name in ("moment", "angle", "rate"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, checked_signal(name, values, self.name))
        n, run, frequency = self.angle.size, f"run {self.name!r}", self.frequency
        beside = [
            (name, getattr(self, name)) for name in ("moment", "rate") if getattr(self, name) is not None
        ]
        steady = frequency is None or (np.isfinite(frequency) and frequency > 0)
        untimed = frequency is not None or self.rate is not None
        refuse(
            [
                *(
                    (
                        values.size != n,
                        f"{run}: {name} has {values.size} samples and angle has {n}; expected equal lengths",
                    )
                    for name, values in beside
                ),
                (n < MINIMUM_SAMPLES, f"{run}: {n} samples; expected at least {MINIMUM_SAMPLES}"),
                (
                    not (np.isfinite(self.sample_rate) and self.sample_rate > 0),
                    f"{run}: sample_rate is {self.sample_rate!r} Hz; expected a positive number",
                ),
                (
                    self.use not in ("identify", "validate"),
                    f"{run}: use is {self.use!r}; expected 'identify' or 'validate'",
                ),
                (
                    self.quasi_static and untimed,
                    f"{run}: samples without time have neither a frequency nor a measured rate; leave both out",
                ),
                (not steady, f"{run}: frequency is {frequency!r} Hz; expected a positive number"),
                # Ten samples per period carry the first three harmonics, and no more: the least that shows a cubic.
                (
                    self.sample_rate < 10 * (frequency or 0.0),
                    f"{run}: sampling at {self.sample_rate:g} Hz is too slow for {frequency or 0.0:g} Hz excitation; "
                    f"expected at least {10 * (frequency or 0.0):g} Hz",
                ),
            ]
        )
        if self.valid is not None:
            valid = np.array(self.valid)
            kept = np.count_nonzero(valid)
            refuse(
                [
                    (
                        valid.dtype != np.bool_ or valid.shape != self.angle.shape,
                        f"{run}: valid has shape {valid.shape} and type {valid.dtype}; expected one truth value for "
                        f"each of the {n} samples",
                    ),
                    (
                        kept < MINIMUM_SAMPLES,
                        f"{run}: {kept} of {n} samples are valid; expected at least {MINIMUM_SAMPLES}",
                    ),
                ]
            )
            valid.flags.writeable = False
            object.__setattr__(self, "valid", valid)
        object.__setattr__(self, "inputs", signals_of(self.name, self.inputs, n))

    @property
    def label(self) -> str:
        """How messages name the run: by its name, and by its file where it came from one."""
        return f"run {self.name!r}" + (f" ({self.source.path})" if self.source else "")

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return self.angle.size

    @property
    def time(self) -> NDArray[np.float64]:
        """Sample instants from zero, s."""
        return np.arange(self.n_samples) / self.sample_rate

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.n_samples / self.sample_rate


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(Shown):
    """A joint and its runs.

    Parameters
    ----------
    joint : Joint
    runs : tuple of Run
        At least one; names are unique.
    simulated : bool
        Whether the runs come from a virtual test. Reports say so.
    skew : float or None
        Declared time by which the moment channel lags the angle channel, s; already removed from the runs.
    notes : tuple of str
        What reading the files had to decide; repeated in reports.
    inputs : tuple of Input
        Declared inputs of the law; every run has a value of each. What the runs for identification test of them is
        their tested range.
    gain_uncertainty : mapping of str to float
        Relative standard uncertainty of the gain of ``"moment"``, ``"angle"``, ``"rate"``, where declared: an error
        that all runs share.
    limits : mapping of str to float
        Largest ``"moment"``, ``"angle"`` and ``"rate"`` that a plan of further runs may reach, SI, where declared.
    guessed : tuple of str
        What was guessed where no file tells, such as ``"angle.unit = deg"``.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> len(test.runs), test.joint.inertia
    (4, 0.02)
    >>> t = np.arange(1000) / 500
    >>> made = sindyjoint.Campaign.from_arrays(
    ...     moment=np.sin(25 * t), angle=0.1 * np.sin(25 * t), rate="500 Hz", units={"angle": "mrad"}
    ... )
    >>> bool(made.runs[0].angle.max() < 1.1e-4)
    True
    """

    joint: Joint
    runs: tuple[Run, ...]
    simulated: bool = False
    skew: float | None = None
    notes: tuple[str, ...] = ()
    inputs: tuple[Input, ...] = ()
    gain_uncertainty: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    guessed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "runs", tuple(self.runs))
        if not self.runs:
            raise InputError("a campaign without runs was given; expected at least one run")
        names = [run.name for run in self.runs]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"run name(s) used twice: {', '.join(twice)}; give each run another name")
        if len({run.quasi_static for run in self.runs}) > 1:
            raise InputError(
                "some runs have time and some have none; expected all of one kind: make two campaigns of them"
            )
        if self.quasi_static and self.joint.inertia is None:
            # Nothing accelerates: no test of this kind identifies an inertia.
            object.__setattr__(self, "joint", replace(self.joint, inertia=0.0))
        check_inputs(self.inputs, self.runs)
        tested = self.identification_runs or self.runs
        inputs = [each.tested_by([run.inputs[each.name] for run in tested]) for each in self.inputs]
        object.__setattr__(self, "inputs", tuple(inputs))
        for name, value in self.gain_uncertainty.items():
            if name not in ("moment", "angle", "rate") or not 0 < value < 1:
                raise InputError(
                    f"gain_uncertainty of {name!r} is {value!r}; expected a share between 0 and 1, of moment, angle "
                    "or rate"
                )

    @property
    def quasi_static(self) -> bool:
        """Whether the samples have an order and no time."""
        return self.runs[0].quasi_static

    @property
    def moves_freely(self) -> bool:
        """Whether no run that may be used for fitting has a measured moment."""
        return all(np.ptp(run.moment) == 0 for run in self.identification_runs)

    @property
    def identification_runs(self) -> tuple[Run, ...]:
        """Runs that may be used for fitting."""
        return tuple(run for run in self.runs if run.use == "identify")

    @property
    def validation_runs(self) -> tuple[Run, ...]:
        """Runs kept for validation, never used for fitting."""
        return tuple(run for run in self.runs if run.use == "validate")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What every report on the campaign says first."""
        said = (*[SIMULATED] * self.simulated, *[WITHOUT_TIME] * self.quasi_static, *self.notes)
        runs = {run.name: run.fusion for run in self.runs}
        return (*said, *unknown_means(runs, quantities(self.joint.motion)))

    @property
    def mean_known(self) -> bool:
        """Whether the mean angle of all runs was measured: an accelerometer does not see it."""
        return all(run.fusion is None or run.fusion.mean_known for run in self.runs)

    def __repr__(self) -> str:
        virtual = "simulated " if self.simulated else ""
        names = [run.name for run in self.runs[:4]] + ["..."] * (len(self.runs) > 4)
        return f"<Campaign: {self.joint.name}, {len(self.runs)} {virtual}run(s): {', '.join(names)}>"

    @classmethod
    def from_arrays(cls, **signals: Any) -> Campaign:
        """Return a campaign of NumPy arrays; see :func:`sindyjoint.files.arrays.campaign_from_arrays`.

        Examples
        --------
        >>> import numpy as np
        >>> t = np.arange(2000) / 500
        >>> angle, moment = 2 * np.sin(6 * np.pi * t), 4 * np.cos(6 * np.pi * t)
        >>> campaign = Campaign.from_arrays(moment=moment, angle=angle, rate="500 Hz", units={"angle": "mrad"})
        >>> campaign.runs[0].frequency, float(campaign.runs[0].angle.max())
        (3.0, 0.002)
        """
        return supplied("arrays").campaign_from_arrays(**signals)

    @classmethod
    def from_frames(cls, frames: Any, **options: Any) -> Campaign:
        """Return a campaign of one data frame or several; see :func:`sindyjoint.files.arrays.campaign_from_frames`."""
        return supplied("arrays").campaign_from_frames(frames, **options)

    def with_runs(self, runs: tuple[Run, ...]) -> Campaign:
        """Return the same campaign with other runs."""
        return replace(self, runs=tuple(runs))
