"""``plan.toml``: the runs of a plan as a file that a person edits and that a virtual test plays."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from sindyjoint.documents import read_toml
from sindyjoint.errors import InputError, UnitError, checks_options
from sindyjoint.files.units import parse_quantity
from sindyjoint.mechanics.excitation import tones
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.sensors import Channel
from sindyjoint.mechanics.virtual import VirtualTest, campaign_joint
from sindyjoint.numeric import RNG
from sindyjoint.plain import SOME
from sindyjoint.planning.information import Sensors
from sindyjoint.planning.runs import PlannedRun
from sindyjoint.record import Campaign, Run
from sindyjoint.tables import entries_of

PLAN_NAME = "plan.toml"
# Of a joint that turns, and of one that slides.
UNITS = {"moment": ("N*m", "N"), "angle": ("rad", "m"), "rate": ("rad/s", "m/s")}
# What the sensors read.
READ = ("moment", "angle")


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
    lines = [
        "# Runs to be made, in this order. Play them: sindyjoint simulate --plan plan.toml --out virtual",
        "",
        "[sensors]",
        f'rate = "{sensors.sample_rate!r} Hz"',
        f"noise = {sensors.noise!r}  # RMS of a sample, of each channel's RMS, where the unit's is not given",
    ]
    slides = runs[0].unit in ("N", "m")
    for name in READ:
        units, noise = UNITS[name], getattr(sensors, name)
        lines += [f'{name}_noise = "{noise!r} {units[slides]}"'] * (noise is not None)
        step = getattr(sensors, f"{name}_resolution")
        lines += [f'{name}_resolution = "{step!r} {units[slides]}"'] * (step is not None)
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
    given: dict[str, Any] = {}
    for name in READ:
        for key, of in ((f"{name}_noise", name), (f"{name}_resolution", f"{name}_resolution")):
            text = getattr(entry.sensors, key)
            if text is not None:
                given[of], _ = parse_channel(text, name, f"{place}: {key}")
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
