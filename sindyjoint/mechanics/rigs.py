"""Rigs: chains of beams, joints and masses with their excitation, written as TOML files.

Two ship with the package: ``pulse-rig``, after section 5 of the paper, and ``four-panel-wing``.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from sindyjoint.documents import read_toml
from sindyjoint.errors import InputError, MissingInputError, SindyJointError, UnknownNameError, refuse
from sindyjoint.files.readers import read_table
from sindyjoint.files.timeaxis import bridged, with_lost_samples
from sindyjoint.files.units import conversion, parse_optional, parse_quantity
from sindyjoint.inputs import Source
from sindyjoint.mechanics import Law, PaperLaw
from sindyjoint.mechanics.beam import Beam, rectangular_section
from sindyjoint.mechanics.excitation import Excitation, pulse, sampled
from sindyjoint.mechanics.rig_file import (
    ColumnTable,
    DriveTable,
    MeasuredTable,
    PartTable,
    PulseTable,
    RigFile,
    RunTable,
    SensorTable,
    rig_path,
    shipped_rigs,
)
from sindyjoint.mechanics.rig_test import DRIVE, UNITS, RigRun
from sindyjoint.mechanics.structure import Hinge, Item, LumpedMass, Structure, assemble
from sindyjoint.mechanics.transient import Response, respond
from sindyjoint.mechanics.virtual import JOINTS
from sindyjoint.numeric import Array
from sindyjoint.plain import first_complaint
from sindyjoint.record import MINIMUM_SAMPLES

#: In the place of a law that is sought, or that a model is given for; its numbers are never used.
UNKNOWN = PaperLaw(k1=1.0, name="unknown")
PLACEHOLDERS: dict[str, Law] = {"model": UNKNOWN, "unknown": UNKNOWN}
# Of a chain, and of a simulation, so that they take minutes.
MOST_ELEMENTS_OF_ALL, MOST_STEPS = 600, 10_000_000
# Beyond these, SI, nothing is a part of a structure, and matrices are no longer solved.
SMALLEST, LARGEST = 1e-12, 1e15


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """Displacement at a point of a rig after its pulse, measured or of a virtual test.

    Parameters
    ----------
    point : str
    displacement : ndarray, shape (n,)
        m; the first sample is the instant at which the pulse begins.
    sample_rate : float
        Hz.
    simulated : bool
        Whether it comes from a virtual test.
    truth : str
        What a virtual test holds beyond the rig as written; empty for nothing.
    """

    point: str
    displacement: Array
    sample_rate: float
    simulated: bool = False
    truth: str = ""

    @property
    def time(self) -> Array:
        """Sample instants, s."""
        return np.arange(self.displacement.size) / self.sample_rate


@dataclass(frozen=True, eq=False)
class Rig:
    """A structure with its excitation, in SI units.

    Parameters
    ----------
    name, description : str
    items : tuple
        Beams, joints and masses from the base on.
    clamp_stiffness : float
        N·m/rad.
    excitation : Excitation
        N.
    at : str
        Point where the force acts.
    points : tuple of str
        Output points.
    duration, sample_rate, step : float
        s, Hz, s.
    modes : int
    measured : MeasuredResponse or None
        The response that the file names.
    also_measured : tuple of MeasuredResponse
        Further records of the same pulse, at other points.
    pulse_uncertainty : float
        Relative standard error of the force.

    Examples
    --------
    >>> import sindyjoint
    >>> rig = sindyjoint.load_rig("pulse-rig")
    >>> rig.name
    'pulse rig'
    >>> len(rig.points)
    1
    """

    name: str
    description: str
    items: tuple[Item, ...]
    clamp_stiffness: float
    excitation: Excitation
    at: str
    points: tuple[str, ...]
    duration: float
    sample_rate: float
    step: float
    modes: int
    measured: MeasuredResponse | None = None
    also_measured: tuple[MeasuredResponse, ...] = ()
    pulse_uncertainty: float = 0.0

    def structure(self) -> Structure:
        """Assemble the chain."""
        return assemble(self.items, self.clamp_stiffness)

    def respond(self, **options: Any) -> Response:
        """Simulate the rig; options as in :func:`sindyjoint.mechanics.transient.respond`."""
        chosen: dict[str, Any] = {
            "duration": self.duration, "sample_rate": self.sample_rate, "step": self.step, "points": self.points,
            "modes": self.modes,
        }  # fmt: skip
        return respond(self.structure(), self.excitation, self.at, **(chosen | options))


@contextmanager
def rig_file(rig: str | Path) -> Iterator[tuple[Path, RigFile]]:
    """Open the file of a rig: its path and its tables; errors name it, or one in its folder."""
    path = rig_path(rig)
    if not path.is_file():
        raise MissingInputError(
            f"{str(rig)!r} is no rig; expected a TOML file or one of {', '.join(shipped_rigs())}"
        )
    try:
        yield path, RigFile.model_validate(read_toml(path))
    except ValidationError as error:
        raise InputError(f"{path}: {first_complaint(error)}") from error
    except SindyJointError as error:
        named = str(error).startswith(str(path.parent))
        raise type(error)(f"{error}" if named else f"{path}: {error}") from error


def load_rig(rig: str | Path, laws: Mapping[str, Law] | None = None) -> Rig:
    """Read a rig.

    Parameters
    ----------
    rig : str or Path
        The name of a shipped rig, or a TOML file.
    laws : mapping of str to Law, optional
        Laws by the names that the rig's joints give as ``law``, in addition to the shipped joints; ``"model"`` is
        the name for a model under verification.

    Raises
    ------
    InputError, UnitError, UnknownNameError, MissingInputError
        In one line that names file and field.

    Examples
    --------
    >>> rig = load_rig("pulse-rig")
    >>> 3 < rig.structure().frequencies(1)[0] < 6
    np.True_
    """
    with rig_file(rig) as (path, given):
        return _build_rig(given, path, {**JOINTS, **(laws or {})})


def _build_rig(given: RigFile, path: Path, laws: Mapping[str, Law]) -> Rig:
    if given.pulse is None or not given.chain:
        raise InputError(
            "no [pulse] on a [[chain]]: of runs and sensors discover and simulate make something"
        )
    items, stiffness = build_chain(given, laws)
    where = f"{path}: [output]"
    records = tuple(read_measured(table, path) for table in given.measured)
    rig = Rig(
        name=given.name, description=given.description, items=items, clamp_stiffness=stiffness,
        excitation=build_excitation(given.pulse, path), at=given.pulse.point, points=tuple(given.output.points),
        duration=parse_quantity(given.output.duration, "s", f"{where} duration"),
        sample_rate=parse_quantity(given.output.sample_rate, "Hz", f"{where} sample_rate"),
        step=parse_quantity(given.output.step, "s", f"{where} step"), modes=given.output.modes,
        measured=records[0] if records else None, also_measured=records[1:],
        pulse_uncertainty=given.pulse.uncertainty,
    )  # fmt: skip
    times = {name: getattr(rig, name) for name in ("duration", "sample_rate", "step")}
    # What would take hours or all memory to simulate.
    elements = sum(item.elements for item in items if isinstance(item, Beam))
    steps = rig.duration * max(1 / (rig.step or np.inf), rig.sample_rate)
    refuse(
        [
            (
                elements > MOST_ELEMENTS_OF_ALL,
                f"{elements} elements in all; expected at most {MOST_ELEMENTS_OF_ALL}",
            ),
            *(
                (
                    not SMALLEST < value < LARGEST,
                    f"{where} {name} is {value:g} in SI; expected a positive number",
                )
                for name, value in times.items()
            ),
            (
                steps > MOST_STEPS,
                f"{where}: {steps:.3g} steps of time; expected at most {MOST_STEPS:g}: a shorter duration, a lower "
                "sample_rate or a larger step",
            ),
        ]
    )
    structure = solvable_structure(items, stiffness)
    for name in (rig.at, *rig.points, *(record.point for record in records)):
        structure.point(name)
    return rig


def solvable_structure(items: Sequence[Item], clamp_stiffness: float) -> Structure:
    """Return the assembled chain; refuse one that no computer can solve."""
    try:
        structure = assemble(items, clamp_stiffness)
        # Whether it holds together is the business of who simulates it, with the law that its joints will have.
        with suppress(InputError):
            structure.frequencies(1, locked=True)
    except (np.linalg.LinAlgError, ArithmeticError, ValueError) as error:
        if isinstance(error, SindyJointError):
            raise
        raise InputError(
            f"the chain cannot be solved ({' '.join(str(error).split()):.80}); check lengths, stiffnesses and masses"
        ) from None
    return structure


def build_chain(given: RigFile, laws: Mapping[str, Law]) -> tuple[tuple[Item, ...], float]:
    """Return the parts of a chain and the stiffness of its clamp, N·m/rad; infinite where it is rigid."""
    items = tuple(build_item(part, f"[[chain]] {i}", laws) for i, part in enumerate(given.chain, 1))
    clamp = given.base.clamp_stiffness
    return items, np.inf if clamp is None else parse_quantity(clamp, "N*m/rad", "[base] clamp_stiffness")


def build_item(part: PartTable, where: str, laws: Mapping[str, Law]) -> Item:
    """Return a part of a chain in SI units; laws are those by name that its joints may have."""

    def number(name: str, unit: str) -> float:
        text = getattr(part, name)
        value = parse_optional(text, unit, f"{where} {name}") or 0.0
        if value != 0 and not SMALLEST < abs(value) < LARGEST:
            raise InputError(f"{where} {name} is {value:g} in SI; no part of a structure has that")
        return value

    if part.joint is not None:
        if part.law not in laws:
            raise UnknownNameError(
                f"{where} law: joint {part.law!r} is not known; expected one of {', '.join(laws)}, "
                "or a model given as 'model'"
            )
        return Hinge(part.joint, laws[str(part.law)], number("value", "kg"), number("inertia", "kg*m**2"))
    if part.mass is not None:
        return LumpedMass(part.mass, number("value", "kg"), number("inertia", "kg*m**2"))
    if part.section is None:
        stiffness, mass = number("bending_stiffness", "N*m**2"), number("mass_per_length", "kg/m")
    else:
        units = {"youngs_modulus": "Pa", "density": "kg/m**3", "width": "m", "height": "m"}
        values = {
            name: parse_quantity(getattr(part.section, name), unit, f"{where} section.{name}")
            for name, unit in units.items()
        }
        refuse(
            (
                not SMALLEST < value < LARGEST,
                f"{where} section.{name} is {value:g} in SI; expected a number above zero",
            )
            for name, value in values.items()
        )
        stiffness, mass = rectangular_section(**values)
    return Beam(str(part.beam), number("length", "m"), stiffness, mass, part.elements, part.loss_factor)


def build_excitation(given: PulseTable, path: Path) -> Excitation:
    """Return the force of a pulse, N; a measured one follows straight lines between samples."""
    where = f"{path}: [pulse]"
    if given.shape is not None:
        duration = parse_quantity(str(given.duration), "s", f"{where} duration")
        return pulse(parse_quantity(str(given.force), "N", f"{where} force"), duration, given.shape)
    assert given.file is not None and given.time is not None and isinstance(given.force, ColumnTable)
    values, rate = _read_series(path.parent / given.file, given.time, "force", given.force, "N")
    return sampled(np.append(values, 0.0), rate, "linear")


def _uniform_rate(file: Path, time: Array) -> float:
    """Return the sampling rate of instants in s, Hz."""
    with np.errstate(all="ignore"):
        steps = np.diff(time)
        even = steps.size and np.all(np.abs(steps - steps.mean()) <= 0.01 * steps.mean())
    if not (even and steps.mean() > 0):
        raise InputError(f"{file}: time does not rise in equal steps within 1 %; resample the file")
    return 1 / float(np.mean(steps))


def _read_series(
    file: Path, time: ColumnTable, name: str, channel: ColumnTable, target: str
) -> tuple[Array, float]:
    """Read one channel in its SI unit and its sampling rate, Hz."""
    seconds = conversion(time.unit, "s", f"{file}: time")
    to_si = conversion(channel.unit, target, f"{file}: {name}")
    stamps, values = read_table(file)[0].columns([time.column, channel.column])
    rate = _uniform_rate(file, stamps * seconds)
    return values * to_si, rate


def read_measured(given: MeasuredTable, path: Path) -> MeasuredResponse:
    """Read a response to a pulse; InputError where it is too short or all zero."""
    file = path.parent / given.file
    values, sample_rate = _read_series(file, given.time, "displacement", given.displacement, "m")
    if values.size < MINIMUM_SAMPLES or not values.any():
        raise InputError(
            f"{file}: displacement has {values.size} samples, "
            f"{'all zero' if not values.any() else 'too few'}; expected a response of at least {MINIMUM_SAMPLES}"
        )
    return MeasuredResponse(given.point, values, sample_rate)


def read_run(table: RunTable, given: RigFile, path: Path) -> RigRun:
    """Read one measured run of a rig, in SI, with the units that its file states otherwise than they are declared."""
    file = path.parent / str(table.file)
    channels: list[DriveTable | SensorTable] = [given.drive, *given.sensor]
    factors = [conversion(c.unit, UNITS[c.quantity], f"{file}: {c.column}") for c in channels]
    seconds = conversion(given.time.unit, "s", f"{file}: time")
    read, sha256 = read_table(file)
    stamps, *values = read.columns([given.time.column, *(channel.column for channel in channels)], gaps=True)
    pairs = enumerate(zip(values, factors, strict=True))
    held = {str(at): bridged(each) * factor for at, (each, factor) in pairs}
    time, present = bridged(stamps) * seconds, np.isfinite(values)
    whole = with_lost_samples(time, held)
    if whole is None:
        rate = _uniform_rate(file, time)
    else:
        # Of a recorder that lost rows the whole grid.
        held, rate, recorded = whole
        there = np.zeros((len(present), recorded.size), dtype=bool)
        there[:, recorded] = present
        present = there
    drive, *responses = held.values()
    frequency = parse_optional(table.frequency, "Hz", f"{file}: frequency")
    names = ("time", DRIVE, *(str(each.column) for each in given.sensor))
    columns = zip(names, (given.time, *channels), strict=True)
    units = tuple(read.unit(name, each.column, each.unit) for name, each in columns)
    return RigRun(
        table.name or Path(str(table.file)).stem, drive, np.array(responses), rate, frequency,
        table.level, table.use, Source(str(table.file), sha256, units), None if present.all() else ~present,
    )  # fmt: skip
