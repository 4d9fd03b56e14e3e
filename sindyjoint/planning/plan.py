"""A plan: its runs, what is expected of them, when to stop; its file, which a person edits and a virtual test plays."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.documents import read_toml
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, UnitError, checks_options
from sindyjoint.files.units import parse_quantity
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import Actuator, tones
from sindyjoint.mechanics.sensors import Channel
from sindyjoint.mechanics.virtual import VirtualTest, campaign_joint
from sindyjoint.numeric import RNG
from sindyjoint.plain import SOME, entries_of
from sindyjoint.planning import PlannedRun, counted_runs
from sindyjoint.planning.information import Sensors
from sindyjoint.record import Campaign, Run

TELL_APART = "tell-apart"


@dataclass(frozen=True)
class Separation:
    """How surely effects are told apart.

    Parameters
    ----------
    effects : tuple of str
        That are held against each other.
    before : float
        Probability that the true one of them has by the runs that were made, or by the plan's other runs; NaN where
        these show none of them.
    after : tuple of float
        The same after each further run that separates them, expected.
    words : str
        What that means; where no run that can be made separates them, that.
    """

    effects: tuple[str, ...]
    before: Maybe
    after: tuple[float, ...]
    words: str

    enough: ClassVar[float] = 0.9  # at which effects are told apart


@dataclass(frozen=True)
class Prediction:
    """The precision of a coefficient that is expected of runs.

    Parameters
    ----------
    id, unit : str
    value : float
        In the middle of its range, SI.
    half_width95 : float
        Of its 95 % interval, median over joints and tests; infinite where the runs do not determine it.
    band90 : (float, float)
        Between these it lies in nine of ten tests of joints of the range.
    chosen : float
        Share of the joints of which a discovery is expected to take the term.
    """

    WRITTEN: ClassVar = same("half_width95", "unit", "band90", "chosen")
    id: str
    unit: str
    value: float
    half_width95: Maybe
    band90: tuple[Maybe, Maybe]
    chosen: float

    @property
    def relative(self) -> float:
        """Half-width as a share of the coefficient."""
        return self.half_width95 / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True)
class Step:
    """What is known after some of the runs.

    Parameters
    ----------
    runs : int
    seconds : float
        Duration of all of them.
    widest, highest : float
        What the plan makes small, relative: median over joints and tests, and below what it lies in 95 of 100.
    complete : float
        Share of the joints of which a discovery is expected to take every term that matters.
    grid : float
        Median of the same of those of the plain grid's runs that are made in that time; infinite where they do not
        determine it.
    """

    runs: int
    seconds: float
    widest: Maybe
    highest: Maybe
    complete: float
    grid: Maybe


@dataclass(frozen=True)
class Now:
    """How far the runs that were made have come.

    Parameters
    ----------
    runs : int
    seconds : float
        Duration of all of them.
    widest : float
        What the plan makes small, relative, as the runs have given it; infinite where they do not.
    complete : float
        Share of the joints of the range of which a discovery of these runs is expected to take every term that matters.
    missing : int
        Different frequencies and levels that a discovery asks for and that are missing.
    reached : bool
        Whether that is enough.
    """

    runs: int
    seconds: float
    widest: Maybe
    complete: float
    missing: int
    reached: bool


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Shown):
    """The result of :func:`sindyjoint.plan`.

    Parameters
    ----------
    model : JointModel
        The joint in the middle of its range.
    low, high : tuple of float
        Range of each coefficient.
    actuator : Actuator
    sensors : Sensors
    goals : tuple of (str, float)
        What is made small, and how much each counts, the weightiest first.
    terms : tuple of str
        Coefficients that matter.
    runs : tuple of PlannedRun
        In the order in which they are to be made.
    predicted, grid : tuple of Prediction
        Of the plan, and of the grid of the same duration (empty where its runs would be too short), by term.
    grid_runs : tuple of PlannedRun
    curve : tuple of Step
    until : float or None
        Relative half-width that is enough.
    stop : str
        Whether, and when, to stop.
    warnings : tuple of str
    now : Now, optional
        What the runs of a campaign have reached.
    apart : Separation, optional
        How surely given effects are told apart.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "runs": "runs",
        "predicted": "predicted_by_term",
        "grid": "grid_by_term",
        **same("undetermined", "goal"),
        "goals": "weights",
        **same("apart", "now", "curve", "stop", "warnings"),
    }
    model: JointModel
    low: tuple[float, ...]
    high: tuple[float, ...]
    actuator: Actuator
    sensors: Sensors
    goals: tuple[tuple[str, float], ...]
    terms: tuple[str, ...]
    runs: tuple[PlannedRun, ...]
    predicted: tuple[Prediction, ...]
    grid: tuple[Prediction, ...]
    grid_runs: tuple[PlannedRun, ...]
    curve: tuple[Step, ...]
    until: float | None
    stop: str
    warnings: tuple[str, ...] = ()
    now: Now | None = None
    apart: Separation | None = None

    @property
    def goal(self) -> str:
        """What counts most."""
        return self.goals[0][0]

    @property
    def count(self) -> str:
        """How many runs are to be made, in words."""
        return counted_runs(len(self.runs), self.now is not None)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Terms whose interval is expected to hold zero, or that a discovery would leave out of most joints."""
        return tuple(each.id for each in self.predicted if not (each.relative < 1.0 and each.chosen > 0.5))

    @property
    def seconds(self) -> float:
        """Duration of all runs."""
        return sum(run.duration for run in self.runs)

    @property
    def weights(self) -> dict[str, float]:
        """How much each of what is made small counts."""
        return dict(self.goals)

    @property
    def predicted_by_term(self) -> dict[str, Prediction]:
        """What is expected of the plan."""
        return {each.id: each for each in self.predicted}

    @property
    def grid_by_term(self) -> dict[str, Prediction]:
        """What is expected of the grid of the same duration."""
        return {each.id: each for each in self.grid}


PLAN_NAME = "plan.toml"
# Of a joint that turns, and of one that slides.
UNITS = {"moment": ("N*m", "N"), "angle": ("rad", "m"), "rate": ("rad/s", "m/s")}
# What sensors may have of each channel, by the keys of the file.
OF_CHANNELS = {
    "moment_noise": "moment", "moment_resolution": "moment_resolution",
    "angle_noise": "angle", "angle_resolution": "angle_resolution",
}  # fmt: skip


@dataclass(frozen=True)
class _RunEntry:
    drive: Literal["moment", "angle"]
    frequency: str
    level: str
    duration: str
    waveform: Literal["sine", "two-tone-3", "two-tone-5", "triangle", "multisine", "sweep"] = "sine"


@dataclass(frozen=True)
class _SensorEntry:
    rate: str = "1000 Hz"
    noise: float = 0.01
    moment_noise: str | None = None
    angle_noise: str | None = None
    moment_resolution: str | None = None
    angle_resolution: str | None = None


@dataclass(frozen=True)
class _PlanEntry:
    run: Annotated[tuple[_RunEntry, ...], SOME]
    sensors: _SensorEntry = _SensorEntry()


def plan_text(runs: Sequence[PlannedRun], sensors: Sensors) -> str:
    """Return runs and sensors as the text of ``plan.toml``."""
    slides = runs[0].unit in ("N", "m")
    known = {key: getattr(sensors, name) for key, name in OF_CHANNELS.items()}
    lines = [
        "# Runs to be made, in this order. Play them: sindyjoint simulate --plan plan.toml --out virtual",
        "",
        "[sensors]",
        f'rate = "{sensors.sample_rate!r} Hz"',
        f"noise = {sensors.noise!r}  # RMS of a sample, of each channel's RMS, where the unit's is not given",
        *(
            f'{key} = "{value!r} {UNITS[key.partition("_")[0]][slides]}"'
            for key, value in known.items()
            if value is not None
        ),
    ]
    for run in runs:
        lines += [
            "",
            "[[run]]",
            f'drive = "{run.drive}"',
            f'waveform = "{run.waveform}"',
            f'frequency = "{run.frequency!r} Hz"',
            f'level = "{run.level!r} {run.unit}"',
            f'duration = "{run.duration!r} s"',
        ]
    return "\n".join(lines) + "\n"


def read_plan(path: str | Path) -> tuple[tuple[PlannedRun, ...], Sensors]:
    """Read the runs and the sensors of ``plan.toml``, or of that of a folder.

    Raises
    ------
    InputError, UnitError
        For what is no plan; the message names the field.
    """
    place = Path(path)
    place = place / PLAN_NAME if place.is_dir() else place
    entry = entries_of(_PlanEntry, read_toml(place), str(place))
    runs = []
    for number, one in enumerate(entry.run, 1):
        where = f"{place}: run {number}"
        frequency = parse_quantity(one.frequency, "Hz", f"{where}: frequency")
        level, unit = parse_channel(one.level, one.drive, f"{where}: level")
        duration = parse_quantity(one.duration, "s", f"{where}: duration")
        if min(frequency, level, duration) <= 0:
            raise InputError(
                f"{where}: frequency, level and duration are {frequency:g}, {level:g} and {duration:g}; expected "
                "positive numbers"
            )
        runs.append(PlannedRun(one.drive, one.waveform, frequency, level, unit, duration))
    given: dict[str, Any] = {
        of: parse_channel(text, key.partition("_")[0], f"{place}: {key}")[0]
        for key, of in OF_CHANNELS.items()
        if (text := getattr(entry.sensors, key)) is not None
    }
    rate = parse_quantity(entry.sensors.rate, "Hz", f"{place}: rate")
    return tuple(runs), Sensors(rate, entry.sensors.noise, **given)


def parse_channel(text: str, channel: str, where: str) -> tuple[float, str]:
    """Return a moment or an angle in SI, and its unit, which says whether the joint turns or slides."""
    turns, slides = UNITS[channel]
    try:
        return parse_quantity(text, turns, where), turns
    except UnitError:
        with suppress(UnitError):
            return parse_quantity(text, slides, where), slides
        raise


def drive_signal(run: PlannedRun, sample_rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time (s) and what is prescribed (N·m or rad), each of shape (n,)."""
    time = np.arange(round(run.duration * sample_rate)) / sample_rate
    return time, tones(run.waveform, run.level, run.frequency)(time)


def run_name(number: int, run: PlannedRun) -> str:
    """Return the name of a planned run."""
    return f"{number:02d}-{run.frequency:g}Hz"


@checks_options()
def play(law: Law, runs: Sequence[PlannedRun], sensors: Sensors, rng: RNG = 0) -> Campaign:
    """Make the runs of a plan as a virtual test.

    Parameters
    ----------
    law : Law
        The joint.
    runs : sequence of PlannedRun
    sensors : Sensors
    rng : int, Generator or None
        Of the noise.

    Raises
    ------
    SimulationError
        When the joint passes its softening limit.

    Examples
    --------
    >>> import sindyjoint
    >>> made = sindyjoint.plan("inter-panel", time=6.0, band=(2.0, 4.0))
    >>> test = sindyjoint.play(sindyjoint.INTER_PANEL, made.runs, made.sensors, rng=0)
    >>> len(test.runs) == len(made.runs)
    True
    """
    generator = np.random.default_rng(rng)
    steps = (sensors.moment_resolution, sensors.angle_resolution)
    made = []
    for number, run in enumerate(runs, 1):
        test = VirtualTest(
            law, (run.frequency,), (1.0,), "displacement" if run.drive == "angle" else "moment",
            sensors.sample_rate, run.duration, angle_limit=1.0, waveform=run.waveform,
        )  # fmt: skip
        moment, angle, _ = test.ideal(run.frequency, run.level)
        noise = sensors.analogue(moment, angle)
        shares = [
            sigma / float(np.sqrt(np.mean(x**2))) for sigma, x in zip(noise, (moment, angle), strict=True)
        ]
        read = [Channel(share).read(x, generator) for share, x in zip(shares, (moment, angle), strict=True)]
        moment, angle = (
            x if step is None else np.round(x / step) * step for x, step in zip(read, steps, strict=True)
        )
        made.append(
            Run(
                run_name(number, run), moment, angle, sensors.sample_rate, frequency=run.frequency,
                level=f"{run.level:.4g} {run.unit}",
            )
        )  # fmt: skip
    return Campaign(campaign_joint(test), tuple(made), simulated=True)
