"""``campaign.toml`` as pydantic models: which keys there are, what they mean, and what is wrong with a file.

The models hold what the person wrote; units become SI in ``campaign.py``.
"""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from sindyjoint.documents import check_finished, read_toml
from sindyjoint.errors import InputError, MissingInputError, refuse
from sindyjoint.plain import StrictTable, first_complaint

Column = str | int
MANIFEST_NAME = "campaign.toml"
# Instead of the column that is subtracted: none is to be.
NONE = "none"


class Channel(StrictTable):
    """One measured quantity: a column with its unit, or a declared constant.

    The value in the file is multiplied by ``gain`` (with a unit) and then ``offset`` is added. Of a quantity that
    ``[rig]`` gives, ``noise`` alone.
    """

    column: Column | None = Field(
        default=None, description="Name of the column; a number counts columns from 1."
    )
    file: str | None = Field(
        default=None,
        description="Another file of the same run, with the same instants, that holds the column.",
    )
    minus: Column | None = Field(
        default=None,
        description="Column of the same unit that is subtracted, as the motion of the other body is; 'none': there is "
        "none.",
    )
    unit: str | None = Field(default=None, description="Unit of the values in the file, any that pint knows.")
    gain: str | None = Field(default=None, description="Factor with its unit, such as '35.15 N/V'.")
    offset: str | None = Field(
        default=None, description="Added after the gain, with its unit, such as '-0.2 deg'."
    )
    noise: str | None = Field(
        default=None,
        description="RMS noise of a sample, such as '0.02 N*m'; in the unit of the file it is multiplied by the gain.",
    )
    constant: str | None = Field(
        default=None, description="Value of a quantity that was not recorded, such as '0 N*m'."
    )
    gain_uncertainty: str | float | None = Field(
        default=None,
        description="Relative standard uncertainty of the calibration, such as '1 %'; common to all runs.",
    )

    @property
    def columns(self) -> list[Column]:
        """Return the column, and the one that is subtracted."""
        both = [self.column, None if self.minus == NONE else self.minus]
        return [column for column in both if column is not None]

    @model_validator(mode="after")
    def _column_or_constant(self) -> Channel:
        if self.model_fields_set <= {"noise", "gain_uncertainty"} and self.model_fields_set:
            return self
        stray = self.unit or self.gain or self.offset or self.noise or self.file or self.minus
        carried = "a constant carries its unit; file, minus, unit, gain, offset and noise belong to a column"
        refuse(
            [
                (
                    (self.column is None) == (self.constant is None),
                    "expected either column (with unit) or constant",
                ),
                (self.constant is not None and stray, carried),
                (self.column is not None and self.unit is None, "key 'unit' is missing"),
            ]
        )
        return self


class AccelerationChannel(Channel):
    """A measured acceleration."""

    delay: str | None = Field(
        default=None, description="Time by which it lags the other channels; it is removed on reading."
    )


class TimeChannel(StrictTable):
    """The column of time stamps."""

    column: Column = Field(description="Its name, or its number from 1.")
    unit: str = Field(default="s", description="Of the stamps; of clock times and dates it is s.")

    @model_validator(mode="before")
    @classmethod
    def _refuse_words(cls, given: Any) -> Any:
        if isinstance(given, dict | TimeChannel):
            return given
        raise ValueError('expected a column, such as { column = "time", unit = "s" }, or \'none\'')


class Channels(StrictTable):
    """Which column holds which quantity."""

    time: TimeChannel | Literal["none"] | None = Field(
        default=None,
        description="Column of time stamps, also clock times and dates; or give rate. 'none': quasi-static samples, in "
        "their order.",
    )
    rate: float | str | None = Field(
        default=None, description="Sampling rate instead of a time column: '1 kHz', or Hz."
    )
    moment: Channel | None = Field(default=None, description="Rotation only.")
    angle: Channel | None = Field(default=None, description="Rotation only.")
    force: Channel | None = Field(default=None, description="Translation only.")
    displacement: Channel | None = Field(default=None, description="Translation only.")
    rate_of_angle: Channel | None = Field(
        default=None, description="Measured angular velocity; rotation only."
    )
    rate_of_displacement: Channel | None = Field(
        default=None, description="Measured velocity; translation only."
    )
    acceleration: AccelerationChannel | None = Field(
        default=None,
        description="Measured acceleration of the joint's motion, instead of angle or displacement or beside it.",
    )
    skew: str | None = Field(
        default=None, description="Time by which moment or force lags; it is removed on reading."
    )
    skew_removed: str | None = Field(
        default=None, description="Lag that was removed before the files were written."
    )
    skip: int | None = Field(
        default=None,
        ge=0,
        description="Lines of a text table or sheet above its header; omitted: found.",
    )
    resample: bool = Field(default=False, description="Interpolate irregular time stamps to a uniform rate.")

    def overridden_by(self, other: Channels | None) -> Channels:
        """Return these channels with those that one run declares put in."""
        if other is None:
            return self
        changes = {name: getattr(other, name) for name in other.model_fields_set}
        rivals = {"time": "rate", "rate": "time", "skew": "skew_removed", "skew_removed": "skew"}
        return self.model_copy(update={rivals[name]: None for name in changes if name in rivals} | changes)


class RigTable(StrictTable):
    """Raw gauges and the constants of the paper's Eqs. 1–3, instead of moment and angle channels."""

    strain: list[Column] | None = Field(
        default=None, min_length=4, max_length=4, description="Gauges 1, 2, 3, 4."
    )
    strain_unit: str = Field(default="um/m", description="Of all four gauges.")
    strain_gain: str | None = Field(default=None, description='Of all four gauges, such as "200 um/m/V".')
    displacement: list[Column] | None = Field(
        default=None, min_length=3, max_length=3, description="Spots 1, 2, 3."
    )
    displacement_unit: str = Field(default="mm", description="Of all three spots.")
    displacement_gain: str | None = Field(default=None, description='Of all three spots, such as "2 mm/V".')
    bending_stiffness: str | None = Field(default=None, description="E I of the additional beam.")
    section_height: str | None = Field(default=None, description="h of its section.")
    strain_position_factor: float = Field(default=1.0, description="β, for the position of the gauges.")
    joint_length: str | None = Field(default=None, description="L between the spots.")

    @model_validator(mode="after")
    def _constants_go_with_gauges(self) -> RigTable:
        strain, displacement = self.strain is not None, self.displacement is not None
        needs = {"bending_stiffness": strain, "section_height": strain, "joint_length": displacement}
        none = not (strain or displacement)
        refuse(
            [
                (none, "expected strain (four columns) or displacement (three columns)"),
                *(
                    (needed and getattr(self, name) is None, f"key {name!r} is missing")
                    for name, needed in needs.items()
                ),
            ]
        )
        return self


class InputTable(StrictTable):
    """What the law may depend on beside angle and rate: a column, or a value of all runs or of each."""

    column: Column | None = Field(default=None, description="Name of the column, or its number from 1.")
    unit: str | None = Field(
        default=None, description="Of the column and of plain numbers; degC and degF have their own zero."
    )
    constant: str | float | int | None = Field(
        default=None, description="Value in every run that states no other in its own inputs."
    )
    reference: str | float | int | None = Field(
        default=None,
        description="Value at which the coefficients hold that do not depend on it; omitted: the middle of the range.",
    )
    name: str | None = Field(default=None, description="In reports.")
    delay: str | None = Field(
        default=None, description="Time by which the column lags; it is removed on reading."
    )

    lag: str | None = Field(
        default=None,
        description="Time constant of the first-order lag with which the joint follows the input; omitted: found.",
    )

    @model_validator(mode="after")
    def _one_source(self) -> InputTable:
        column = self.column is not None
        refuse(
            [
                (column and self.constant is not None, "expected column or constant, not both"),
                (column and self.unit is None, "key 'unit' is missing"),
                (self.delay is not None and not column, "delay belongs to a column"),
            ]
        )
        return self


class JointTable(StrictTable):
    """The joint under test."""

    name: str = Field(default="joint", description="In reports.")
    motion: Literal["rotation", "translation"] = Field(
        default="rotation", description="Moment and angle, or force and displacement."
    )
    inertia: str | None = Field(
        default=None, description="Moving inertia between sensor and joint; omitted: identified."
    )
    mass: str | None = Field(default=None, description="The same for translation.")
    temperature: str | None = Field(default=None, description="Such as '23 degC'.")
    serial: str | None = Field(default=None, description="Serial number.")
    labels: dict[str, str | int | float | bool] = Field(default_factory=dict, description="Anything else.")


class RunTable(StrictTable):
    """One run: its file and how the joint was excited."""

    file: str = Field(
        description="Path from the manifest; * and ? stand for every file that matches, a run each."
    )
    name: str | None = Field(default=None, description="Defaults to the file's name without its ending.")
    rows: list[int] | None = Field(
        default=None,
        min_length=2,
        max_length=2,
        description="First and last row, from 1, of a file with several runs.",
    )
    frequency: float | str | None = Field(default=None, description="Hz; omitted for an aperiodic run.")
    level: str | int | float | None = Field(default=None, description="Free label of the excitation level.")
    use: Literal["identify", "validate"] = Field(
        default="identify", description="Fitted, or kept for validation."
    )
    channels: Channels | None = Field(default=None, description="What differs from [channels] in this run.")
    inputs: dict[str, str | float | int] = Field(
        default_factory=dict,
        description="Values that [inputs] have in this run, such as temperature = '-40 degC'.",
    )


class Manifest(StrictTable):
    """A whole ``campaign.toml``."""

    simulated: bool = Field(default=False, description="Whether the runs come from a virtual test.")
    notes: list[str] = Field(default_factory=list, description="Remarks that reports repeat.")
    guessed: list[str] = Field(
        default_factory=list,
        description="Guesses of init; no result is trusted before they are removed.",
    )
    joint: JointTable = Field(default=JointTable(), description="The joint under test.")
    channels: Channels = Field(description="Which column holds which quantity.")
    inputs: dict[
        str,
        Annotated[
            InputTable,
            BeforeValidator(
                lambda given: given if isinstance(given, dict | InputTable) else {"constant": given}
            ),
        ],
    ] = Field(
        default_factory=dict,
        description="What the law may depend on beside angle and rate, by its name in formulas.",
    )
    rig: RigTable | None = Field(default=None, description="Raw gauges instead of moment and angle.")
    limits: dict[str, str] = Field(
        default_factory=dict,
        description="Largest moment, angle or rate_of_angle that a plan may reach, such as moment = '6 N*m'.",
    )
    run: list[RunTable] = Field(
        min_length=1, description="One table for each run, or for each pattern of files."
    )


def manifest_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``campaign.toml``."""
    return Manifest.model_json_schema()


def read_manifest(path: str | Path) -> tuple[Path, Manifest]:
    """Read ``campaign.toml``, given the file or its folder.

    Returns
    -------
    path : Path
        The file that was read.
    manifest : Manifest

    Raises
    ------
    MissingInputError
        When there is no such file.
    InputError
        For a file that is not TOML, or not a campaign; the message names file and field.
    """
    file = Path(path)
    # os.path says no where pathlib raises: names too long, folders that may not be entered.
    if os.path.isdir(file):
        if not (file / MANIFEST_NAME).is_file():
            raise MissingInputError(
                f"folder {str(path)!r} holds no {MANIFEST_NAME}; {_command_that_writes(file)}, or give its path"
            )
        file = file / MANIFEST_NAME
    if not os.path.exists(file):
        raise MissingInputError(
            f"{str(path)!r} does not exist; expected a {MANIFEST_NAME}, or a folder with one"
        )
    if file.suffix.lower() != ".toml":
        raise InputError(
            f"{file}: this is not a TOML file; expected a {MANIFEST_NAME} that names it as a run: "
            f"{_command_that_writes(file.parent)}"
        )
    # What a person changes in a campaign that was simulated is meant; only one that is not all there is refused.
    check_finished(file.parent)
    content = read_toml(file)
    if not content:
        raise InputError(f"{file}: is empty; expected a campaign with [channels] and [[run]]")
    try:
        return file, _with_files(file, Manifest.model_validate(content))
    except ValidationError as error:
        raise InputError(f"{file}: {first_complaint(error)}") from error


def _command_that_writes(folder: Path) -> str:
    return f"{shlex.join(['sindyjoint', 'init', str(folder)])} writes one"


def _with_files(manifest: Path, read: Manifest) -> Manifest:
    """Return a manifest with a run for each file that matches a pattern."""
    runs: list[RunTable] = []
    for number, run in enumerate(read.run, start=1):
        if not set("*?") & set(run.file) or (manifest.parent / run.file).exists():
            runs.append(run)
            continue
        where = f"{manifest}: [[run]] {number}"
        found = sorted(
            path.relative_to(manifest.parent).as_posix()
            for path in manifest.parent.glob(run.file)
            if path.is_file()
        )
        if not found:
            raise MissingInputError(f"{where} file: no file matches {run.file!r} in {manifest.parent}")
        if run.name is not None and len(found) > 1:
            raise InputError(
                f"{where} name: name {run.name!r} would stand for {len(found)} runs; leave it out"
            )
        runs += [run.model_copy(update={"file": file}) for file in sorted(found, key=natural_order)]
    return read.model_copy(update={"run": runs})


def natural_order(name: str) -> list[tuple[float, str]]:
    """Return a key by which names are sorted as people count: run2 before run10.

    Examples
    --------
    >>> sorted(["run10", "run2", "run0.5", "run0.25"], key=natural_order)
    ['run0.25', 'run0.5', 'run2', 'run10']
    """
    parts = re.split(r"(\d+(?:\.\d+)?)", name)
    return [(float(part), "") if number % 2 else (-1.0, part) for number, part in enumerate(parts)]
