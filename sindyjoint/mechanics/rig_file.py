"""Where a ``rig.toml`` is found, and its tables."""

from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from sindyjoint.documents import read_toml
from sindyjoint.errors import InputError, refuse
from sindyjoint.plain import StrictTable

RIG_FOLDER = Path(__file__).parent / "rig_files"

# Matrices of a chain are full: a thousand elements are gigabytes and minutes, and a beam is exact with a few.
MOST_ELEMENTS, MOST_PARTS = 200, 100


def shipped_rigs() -> list[str]:
    """Names of the rigs that ship with the package."""
    return sorted(path.stem for path in RIG_FOLDER.glob("*.toml"))


def rig_path(rig: str | Path) -> Path:
    """Return the file of a rig: of one that ships with the package, in a folder, or itself."""
    if str(rig) in shipped_rigs():
        return RIG_FOLDER / f"{rig}.toml"
    path = Path(rig)
    return path / "rig.toml" if (path / "rig.toml").is_file() else path


def is_rig_test(path: str | Path) -> bool:
    """Return whether a file, or that of a folder without a campaign, is a rig."""
    file = rig_path(path)
    if (Path(path) / "campaign.toml").is_file() or not file.is_file() or file.suffix != ".toml":
        return False
    try:
        read = read_toml(file)
    except InputError:
        return False
    return "chain" in read or "matrices" in read


def has_measured_runs(path: str | Path) -> bool:
    """Return whether a file is a rig with runs that were recorded."""
    runs = read_toml(rig_path(path)).get("run", []) if is_rig_test(path) else []
    return any(isinstance(run, dict) and "file" in run for run in runs)


class SectionTable(StrictTable):
    """A rectangular section, bent over its height."""

    width: str = Field(description='Across the bending, such as "60 mm".')
    height: str = Field(description="Along the bending.")
    youngs_modulus: str = Field(description='Such as "70 GPa".')
    density: str = Field(description='Such as "2700 kg/m^3".')


class PartTable(StrictTable):
    """One part of the chain: a beam, a joint or a mass, by the key that names it."""

    beam: str | None = Field(default=None, description="Name of a beam.")
    joint: str | None = Field(default=None, description="Name of a joint.")
    mass: str | None = Field(default=None, description="Name of a mass.")
    length: str | None = Field(default=None, description="Of a beam.")
    section: SectionTable | None = Field(
        default=None, description="Of a beam, or stiffness and mass per length."
    )
    bending_stiffness: str | None = Field(default=None, description="Of a beam: E I.")
    mass_per_length: str | None = Field(default=None, description="Of a beam.")
    elements: int = Field(default=8, ge=1, le=MOST_ELEMENTS, description="Finite elements of a beam.")
    loss_factor: float = Field(default=0.0, description="Of the beam's material.")
    law: str | None = Field(
        default=None, description="Of a joint: a shipped joint, 'model', or 'unknown' where it is sought."
    )
    kind: str | None = Field(default=None, description="Of a joint: joints of one kind share a law.")
    stiffness_uncertainty: float = Field(default=0.0, ge=0, lt=1, description="Of a beam, relative.")
    mass_uncertainty: float = Field(default=0.0, ge=0, lt=1, description="Of a beam or a mass, relative.")
    loss_uncertainty: float = Field(default=0.0, ge=0, lt=1, description="Of a beam's loss factor, relative.")
    value: str | None = Field(default=None, description="Of a mass, or what a joint weighs: '8 kg'.")
    inertia: str | None = Field(default=None, description="Of a mass or a joint.")

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        kinds = [kind for kind in ("beam", "joint", "mass") if getattr(self, kind) is not None]
        section = self.section is not None
        both = self.bending_stiffness is not None and self.mass_per_length is not None
        refuse(
            [
                (len(kinds) != 1, "exactly one of the keys 'beam', 'joint' and 'mass' names a part"),
                (
                    self.beam is not None and (self.length is None or section == both),
                    "a beam wants length, and either section or bending_stiffness and mass_per_length",
                ),
                (
                    self.joint is not None and self.law is None,
                    "a joint wants law, the name of a shipped joint or 'model'",
                ),
                (self.mass is not None and self.value is None, "a mass wants value, such as '8 kg'"),
            ]
        )
        return self


class ColumnTable(StrictTable):
    """A column of a pulse file and its unit."""

    column: str | int = Field(description="Its name, or its number from 1.")
    unit: str = Field(description="Of its values.")


class PulseTable(StrictTable):
    """The force on the structure: a shape, or a file."""

    point: str = Field(default="tip", description='Where the force acts: a part, or "tip".')
    shape: Literal["rectangular", "half-sine"] | None = Field(default=None, description="Instead of a file.")
    force: str | ColumnTable = Field(description="Peak of the shape, or a column of the file.")
    duration: str | None = Field(default=None, description="Of the shape.")
    file: str | None = Field(default=None, description="With the measured force.")
    time: ColumnTable | None = Field(default=None, description="Column of the file.")
    uncertainty: float = Field(default=0.0, ge=0, lt=1, description="Relative standard error of the force.")

    @model_validator(mode="after")
    def _shape_or_file(self) -> Self:
        refuse(
            [
                ((self.shape is None) == (self.file is None), "expected either shape or file"),
                (
                    self.shape is not None and (self.duration is None or not isinstance(self.force, str)),
                    "a shape wants force, such as '65 N', and duration, such as '5 ms'",
                ),
                (
                    self.file is not None and (self.time is None or isinstance(self.force, str)),
                    "a file wants time and force, each { column = ..., unit = ... }",
                ),
            ]
        )
        return self


class OutputTable(StrictTable):
    """What is simulated and returned."""

    points: list[str] = Field(default=["tip"], description="Where the displacement is returned.")
    duration: str = Field(default="20 s", description="Simulated from the pulse on.")
    sample_rate: str = Field(default="1 kHz", description="Of what is returned.")
    step: str = Field(default="0.5 ms", description="Of the simulation.")
    modes: int = Field(default=12, ge=1, le=MOST_ELEMENTS, description="Kept of the beams.")


class MeasuredTable(StrictTable):
    """A measured response; its first sample is the instant at which the pulse begins."""

    file: str = Field(description="With the response.")
    time: ColumnTable = Field(description="Column of the file.")
    displacement: ColumnTable = Field(description="Column of the file.")
    point: str = Field(default="tip", description="Where it was measured.")


class BaseTable(StrictTable):
    """The base: a rigid clamp unless a stiffness is given."""

    clamp_stiffness: str | None = Field(default=None, description="Rotational; omitted: rigid.")
    clamp_uncertainty: float = Field(default=0.0, ge=0, lt=1, description="Of its stiffness, relative.")

    @model_validator(mode="after")
    def _known_clamp(self) -> Self:
        if self.clamp_uncertainty and self.clamp_stiffness is None:
            raise ValueError(
                "clamp_uncertainty is of clamp_stiffness, which is missing: a clamp without it is rigid"
            )
        return self


class StationTable(StrictTable):
    """A place along a beam."""

    beam: str = Field(description="Its name.")
    at: str = Field(description="How far from its end at the base.")


class SensorTable(StrictTable):
    """A sensor on the structure and its column in the files of the runs."""

    column: str | int = Field(description="Its name, or its number from 1; also the sensor's name.")
    quantity: Literal["acceleration", "velocity", "displacement"] = Field(
        default="acceleration", description="What it measures."
    )
    unit: str = Field(description="Of the column.")
    point: str | StationTable = Field(description="A part's far end, a freedom, or a place along a beam.")
    noise: str | None = Field(
        default=None, description="Standard deviation; default: by what does not repeat."
    )


class DriveTable(StrictTable):
    """What drives the structure, as it was measured."""

    quantity: Literal["force", "base acceleration"] = Field(default="force", description="What it is.")
    point: str | StationTable = Field(default="tip", description="Where a force acts.")
    column: str | int = Field(default="force", description="Its name, or its number from 1.")
    unit: str = Field(default="N", description="Of the column.")
    noise: str | None = Field(
        default=None, description="Standard deviation; default: by what does not repeat."
    )


class RunTable(StrictTable):
    """One run of the structure: a file, or what a virtual test shall drive it by."""

    file: str | None = Field(default=None, description="With time, drive and sensors.")
    name: str | None = Field(default=None, description="Default: the file's.")
    frequency: str | None = Field(
        default=None, description="At which the drive repeats; omitted: it does not."
    )
    level: str | None = Field(default=None, description="Free label.")
    use: Literal["identify", "validate", "update"] = Field(
        default="identify",
        description="Fitted, kept for validation, or (its joints stick) for the structure alone.",
    )
    shape: Literal["sine", "multisine", "sweep", "impact"] | None = Field(
        default=None, description="For simulate."
    )
    amplitude: str | None = Field(default=None, description="For simulate: peak of the drive.")
    band: list[str] | None = Field(
        default=None,
        min_length=2,
        max_length=2,
        description="For simulate: of a multisine or a sweep.",
    )
    width: str | None = Field(default=None, description="For simulate: of an impact, a half-sine.")


class RecorderTable(StrictTable):
    """How simulate records the runs."""

    sample_rate: str = Field(default="500 Hz", description="Of the files.")
    duration: str = Field(default="20 s", description="Of each.")
    settling: str = Field(default="10 s", description="With the drive on, before the record begins.")
    noise: float = Field(default=0.01, ge=0, lt=1, description="White, as a fraction of each channel's RMS.")


class MatrixJointTable(StrictTable):
    """A joint between two freedoms of a structure that is given by its matrices."""

    name: str = Field(description="In results.")
    between: list[str] = Field(
        min_length=1, max_length=2, description="Freedoms; one of them alone: against the ground."
    )
    kind: str | None = Field(default=None, description="Joints of one kind share a law.")


class MatricesTable(StrictTable):
    """A structure by its matrices, without the joints, instead of a chain."""

    file: str = Field(
        description="NPZ or MAT with mass, stiffness and perhaps damping, and base: the rigid motion with the base."
    )
    freedoms: list[str] = Field(min_length=1, description="Their names, in the order of the matrices.")
    joint: list[MatrixJointTable] = Field(min_length=1, description="Where the joints sit.")
    motion: Literal["rotation", "translation"] = Field(default="rotation", description="Of the joints.")
    stiffness_uncertainty: float = Field(
        default=0.0, ge=0, lt=1, description="Of the whole matrix, relative."
    )
    mass_uncertainty: float = Field(default=0.0, ge=0, lt=1, description="Of the whole matrix, relative.")


class RigFile(StrictTable):
    """All of ``rig.toml``."""

    name: str = Field(description="In reports.")
    description: str = Field(default="", description="One sentence.")
    base: BaseTable = Field(default=BaseTable(), description="The clamp.")
    chain: list[PartTable] = Field(
        default=[], max_length=MOST_PARTS, description="Parts from the base to the tip."
    )
    matrices: MatricesTable | None = Field(default=None, description="Instead of a chain.")
    loss_frequency: str | None = Field(
        default=None, description="At which the loss factors hold. Default: the first mode."
    )
    pulse: PulseTable | None = Field(default=None, description="What moves the structure, of a pulse test.")
    time: ColumnTable = Field(
        default=ColumnTable(column="time", unit="s"), description="In the files of the runs."
    )
    drive: DriveTable = Field(default=DriveTable(), description="In the files of the runs.")
    sensor: list[SensorTable] = Field(default=[], description="In the files of the runs.")
    run: list[RunTable] = Field(
        default=[],
        description="Runs from which the joints' law is sought; without any: the pulse.",
    )
    recorder: RecorderTable = Field(default=RecorderTable(), description="Of virtual runs.")
    output: OutputTable = Field(default=OutputTable(), description="What is simulated.")
    measured: list[MeasuredTable] = Field(
        default=[], description="One record, or several of the same pulse, the main one first."
    )

    @field_validator("measured", mode="before")
    @classmethod
    def _one_or_several(cls, given: Any) -> Any:
        return [given] if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _chain_or_matrices(self) -> Self:
        driven = self.pulse is not None or (self.run and self.sensor)
        refuse(
            [
                (bool(self.chain) == (self.matrices is not None), "expected either [[chain]] or [matrices]"),
                (not driven, "expected [pulse], or [[sensor]] and [[run]]"),
            ]
        )
        return self
