"""A test of an assembled structure: what drove it, what its sensors measured, and which of its joints are sought."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sindyjoint.documents import read_toml
from sindyjoint.errors import InputError, refuse
from sindyjoint.files.atomic import output_folder
from sindyjoint.files.writers import ENCODERS, REMARK, toml_pairs
from sindyjoint.inputs import Source
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.rig_file import RigFile, rig_path
from sindyjoint.mechanics.structure import Item, Structure, assemble
from sindyjoint.numeric import Array, Booleans
from sindyjoint.record import MINIMUM_SAMPLES, Motion

Quantity = Literal["acceleration", "velocity", "displacement"]
RigUse = Literal["identify", "validate", "update"]

#: How often each quantity is differentiated from a displacement.
ORDER: dict[str, int] = {"displacement": 0, "velocity": 1, "acceleration": 2}
#: What of a part each uncertain number is.
OF_BEAM = {"stiffness": ("bending_stiffness",), "mass": ("mass_per_length",), "loss": ("loss_factor",)}
OF_MASS = {"mass": ("mass", "inertia")}
#: The drive of a structure whose base is shaken, in the place of a point.
BASE = "base"
#: SI units of what drives and sensors measure.
UNITS = {
    "acceleration": "m/s**2",
    "velocity": "m/s",
    "displacement": "m",
    "force": "N",
    "base acceleration": "m/s**2",
}
#: What a file of a virtual test is called after.
SIMULATED_KEY = "simulated"
#: What the channel of the drive is called in findings.
DRIVE = "drive"


@dataclass(frozen=True)
class Sensor:
    """A sensor on a structure.

    Parameters
    ----------
    name : str
    point : str
        Where it sits.
    quantity : {"acceleration", "velocity", "displacement"}
    noise : float or None
        Standard deviation of single samples, SI, where it was declared.
    """

    name: str
    point: str
    quantity: Quantity = "acceleration"
    noise: float | None = None


@dataclass(frozen=True, eq=False)
class RigRun:
    """One run of a structure; every signal in SI at the same instants.

    Parameters
    ----------
    name : str
    drive : ndarray, shape (n,)
        Force, N, or acceleration of the base, m/s².
    responses : ndarray, shape (sensors, n)
    sample_rate : float
        Hz.
    frequency : float or None
        At which the drive repeats, Hz; None for a run that does not.
    level : str or None
    use : {"identify", "validate", "update"}
        The last: its joints stick, and it tells the structure's own numbers.
    source : Source, optional
    lost : ndarray of bool, shape (1 + sensors, n), optional
        Samples of drive and responses that the file does not hold: straight lines run across them.

    Raises
    ------
    InputError
        For signals of different length, too few samples, or values that are not finite.
    """

    name: str
    drive: Array
    responses: Array
    sample_rate: float
    frequency: float | None = None
    level: str | None = None
    use: RigUse = "identify"
    source: Source | None = None
    lost: Booleans | None = None
    # What was made of the run, by what it was made with: the check of the data and a discovery share it.
    _kept: dict[object, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        n = self.drive.size
        faults = [
            (
                self.responses.ndim != 2 or self.responses.shape[1] != n or n < MINIMUM_SAMPLES,
                f"responses of shape {self.responses.shape} beside a drive of {n} samples; expected one row per "
                f"sensor, as many samples, and at least {MINIMUM_SAMPLES}",
            ),
            (
                self.use == "update" and self.frequency is None,
                "a run that updates the structure repeats; expected its frequency, of a sine or a multisine",
            ),
            (
                not (np.all(np.isfinite(self.drive)) and np.all(np.isfinite(self.responses))),
                "a signal holds values that are not finite numbers; repair the file",
            ),
        ]
        refuse((there, f"run {self.name!r}: {words}") for there, words in faults)

    @property
    def signals(self) -> Array:
        """Drive and responses, shape (1 + sensors, n)."""
        return np.vstack([self.drive, self.responses])


@dataclass(frozen=True, eq=False)
class UncertainNumber:
    """A number of a structure that is known to some accuracy.

    Parameters
    ----------
    name : str
    uncertainty : float
        Relative standard uncertainty.
    mass, stiffness, loss : ndarray, shape (n, n)
        What it contributes to each matrix: a change of ε of the number adds ε times these.
    """

    name: str
    uncertainty: float
    mass: Array
    stiffness: Array
    loss: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """What a structure was assembled of.

    Parameters
    ----------
    items : tuple of Beam, Hinge, LumpedMass
    clamp_stiffness : float
        N·m/rad; infinite for a rigid clamp.
    stations : mapping of str to (str, float)
        Points along beams.
    loss_frequency : float or None
        Hz.
    """

    items: tuple[Item, ...]
    clamp_stiffness: float = np.inf
    stations: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    loss_frequency: float | None = None

    def assembled(self) -> Structure:
        """Return the structure."""
        return assemble(self.items, self.clamp_stiffness, self.stations, self.loss_frequency)


@dataclass(frozen=True, eq=False)
class RigTest:
    """A structure with unknown joints, its sensors and its runs.

    Parameters
    ----------
    name : str
    structure : Structure
    kinds : tuple of str
        Of every joint the kind it is of: joints of one kind share a law.
    at : str
        Point where the force acts, or ``"base"``.
    drive_noise : float or None
        Standard deviation of single samples of the drive, SI, where it was declared.
    sensors : tuple of Sensor
    runs : tuple of RigRun
    simulated : bool
    motion : {"rotation", "translation"}
        Of the joints.
    uncertain : tuple of UncertainNumber
        Numbers of the structure with a stated uncertainty.
    chain : Chain or None
        What the structure was assembled of; None for one by its matrices.
    """

    name: str
    structure: Structure
    kinds: tuple[str, ...]
    at: str
    sensors: tuple[Sensor, ...]
    runs: tuple[RigRun, ...]
    drive_noise: float | None = None
    simulated: bool = False
    motion: Motion = "rotation"
    uncertain: tuple[UncertainNumber, ...] = ()
    chain: Chain | None = None

    def __post_init__(self) -> None:
        names = [sensor.name for sensor in self.sensors]
        twice = sorted({name for name in names if names.count(name) > 1})
        refuse(
            [
                (
                    twice or not names,
                    f"sensor name(s) {', '.join(twice) or '(none)'}; expected sensors of different names",
                ),
                (
                    len(self.kinds) != self.structure.n_joints or not self.kinds,
                    f"{len(self.kinds)} joint(s); expected a structure with at least one joint",
                ),
                *(
                    (
                        len(run.responses) != len(names),
                        f"run {run.name!r}: {len(run.responses)} response(s) for {len(names)} sensor(s)",
                    )
                    for run in self.runs
                ),
            ]
        )
        sensor_rows(self.structure, self.sensors)
        load_row(self.structure, self.at)

    @property
    def channels(self) -> tuple[str, ...]:
        """What the rows of a run's signals are called: the drive and the sensors."""
        return (DRIVE, *(sensor.name for sensor in self.sensors))

    @property
    def identification_runs(self) -> tuple[RigRun, ...]:
        """Runs that may be used for fitting."""
        return tuple(run for run in self.runs if run.use == "identify")

    @property
    def update_runs(self) -> tuple[RigRun, ...]:
        """Runs whose joints stick."""
        return tuple(run for run in self.runs if run.use == "update")


def sensor_rows(structure: Structure, sensors: Sequence[Sensor]) -> Array:
    """Return how the deflection at every sensor follows from the coordinates, shape (sensors, n)."""
    return np.stack([structure.point(sensor.point) for sensor in sensors])


def load_row(structure: Structure, at: str) -> Array:
    """Return the load of a unit drive on the coordinates, shape (n,): at a point, or −M·r of a base that is shaken.

    In coordinates that move with the base its acceleration a is the load −M·r·a (Clough and Penzien, Dynamics of
    Structures, 1993, section 2-3); r is the rigid motion with the base.
    """
    if at != BASE:
        return structure.point(at)
    if structure.base is None:
        raise InputError("the base is shaken, and the structure does not say what its base carries")
    return -structure.mass @ structure.base


def with_drive(structure: Structure, at: str) -> Structure:
    """Return a structure that has a shaken base as a point."""
    if at != BASE:
        return structure
    return replace(structure, points={**structure.points, BASE: load_row(structure, BASE)})


def uncertain_numbers(
    items: Sequence[Item],
    clamp_stiffness: float,
    stated: Mapping[str, Mapping[str, float]],
    of_clamp: float = 0.0,
) -> tuple[UncertainNumber, ...]:
    """Return the uncertain numbers of a chain.

    Parameters
    ----------
    items, clamp_stiffness
        As :func:`~sindyjoint.mechanics.structure.assemble` takes them.
    stated : mapping of str to mapping of str to float
        By the names of parts the relative standard uncertainty of their ``"stiffness"``, ``"mass"`` or ``"loss"``.
    of_clamp : float
        The same of the clamp's stiffness.
    """
    whole = assemble(items, clamp_stiffness)
    stiffer = [assemble(items, 2 * clamp_stiffness)] if of_clamp else []
    doubled = [("stiffness of the clamp", of_clamp, structure) for structure in stiffer]
    for index, item in enumerate(items):
        for what, uncertainty in stated.get(item.name, {}).items():
            names = OF_BEAM[what] if isinstance(item, Beam) else OF_MASS[what]
            twice = replace(item, **{name: 2 * getattr(item, name) for name in names})
            other = assemble([*items[:index], twice, *items[index + 1 :]], clamp_stiffness)
            doubled.append((f"{what} of {item.name}", uncertainty, other))
    return tuple(
        UncertainNumber(
            name, u, other.mass - whole.mass, other.stiffness - whole.stiffness, other.loss - whole.loss
        )
        for name, u, other in doubled
    )


def write_rig_test(
    rig: str | Path, test: RigTest, folder: str | Path, format: str = "csv", force: bool = False
) -> Path:
    """Write the runs of a virtual test and a ``rig.toml`` that describes them; the laws of the joints are not in it.

    Parameters
    ----------
    rig : str or Path
        Of which the test was made: the file's other tables stay as they are.
    test : RigTest
        With runs.
    folder : path
    format : {"csv", "tsv", "npz", "parquet", "h5", "mat"}
    force : bool
        Replace files that are no such test.
    """
    if format not in ENCODERS:
        raise InputError(f"format is {format!r}; expected one of {', '.join(ENCODERS)}")
    document = read_toml(rig_path(rig))
    given = RigFile.model_validate(document)
    for part, table in zip(document["chain"], given.chain, strict=True):
        if table.joint is not None:
            own = table.joint if table.law in ("model", "unknown") else table.law
            part |= {"law": "unknown", "kind": table.kind or own}
    document["loss_frequency"] = f"{test.structure.loss_frequency!r} Hz"
    document["time"] = {"column": "time", "unit": "s"}
    drive = {"column": DRIVE, "unit": UNITS[given.drive.quantity].replace("**", "^")}
    document["drive"] = document.get("drive", {}) | drive
    for table, sensor in zip(document["sensor"], given.sensor, strict=True):
        table |= {"unit": UNITS[sensor.quantity].replace("**", "^")}
    for key in ("pulse", "output", "recorder", "measured"):
        document.pop(key, None)
    files = {run.name: re.sub(r"[^\w.-]", "-", run.name) + f"-{SIMULATED_KEY}.{format}" for run in test.runs}
    document["run"] = [
        {"file": files[run.name], "name": run.name, "use": run.use}
        | {"frequency": run.frequency and f"{run.frequency!r} Hz", "level": run.level}
        for run in test.runs
    ]
    with output_folder(folder, "rig-test", force=force) as stage:
        for run in test.runs:
            columns = dict(zip(test.channels, run.signals, strict=True))
            columns = {"time": np.arange(run.drive.size) / run.sample_rate, **columns}
            (stage / files[run.name]).write_bytes(ENCODERS[format](columns, REMARK))
        (stage / "rig.toml").write_text(_toml(document), encoding="utf-8", newline="\n")
    return Path(folder) / "rig.toml"


def _toml(document: Mapping[str, Any]) -> str:
    """Return a document of plain values, tables and lists of tables as TOML."""
    lines, tables = [], []
    for key, item in document.items():
        entries = item if isinstance(item, list) and item else [item]
        if not isinstance(entries[0], dict):
            lines += toml_pairs({key: item})
            continue
        head = f"[[{key}]]" if isinstance(item, list) else f"[{key}]"
        for entry in entries:
            tables += ["", head, *toml_pairs(entry)]
    return "\n".join([*lines, *tables, ""])
