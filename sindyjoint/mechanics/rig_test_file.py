"""``rig.toml`` with sensors and runs: read for discovery, and written by a virtual test."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sindyjoint.errors import InputError, refuse
from sindyjoint.files.readers import read_table
from sindyjoint.files.units import parse_optional, parse_quantity
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.rig_file import (
    DriveTable,
    MatricesTable,
    RigFile,
    RunTable,
    SensorTable,
    StationTable,
)
from sindyjoint.mechanics.rig_test import (
    BASE,
    SIMULATED_KEY,
    UNITS,
    Chain,
    RigRun,
    RigTest,
    Sensor,
    UncertainNumber,
    uncertain_numbers,
)
from sindyjoint.mechanics.rigs import (
    PLACEHOLDERS,
    UNKNOWN,
    build_chain,
    build_excitation,
    read_measured,
    read_run,
    rig_file,
    solvable_structure,
)
from sindyjoint.mechanics.structure import Hinge, Structure, assemble
from sindyjoint.mechanics.virtual import JOINTS
from sindyjoint.mechanics.virtual_rig import Drive, Recorder
from sindyjoint.numeric import SAME, Array

LAWS: dict[str, Law] = {**JOINTS, **PLACEHOLDERS}
MOST_FREEDOMS = 2000


class RigPlan(NamedTuple):
    """A rig with its sensors, and what a virtual test shall do with it."""

    test: RigTest
    drives: tuple[Drive, ...]
    recorder: Recorder


def load_rig_test(rig: str | Path) -> RigTest:
    """Read a rig with sensors and measured runs.

    Where no ``[[run]]`` has a file, ``[pulse]`` and its ``[[measured]]`` records are one run.

    Raises
    ------
    InputError, UnitError, UnknownNameError, MissingInputError
        In one line that names file and field.
    """
    with rig_file(rig) as (path, given):
        files = [table for table in given.run if table.file is not None]
        if not files and given.pulse is not None and given.measured:
            return _pulse_test(given, path)
        test = _build_test(given, path, LAWS)
        if not files:
            raise InputError(
                "no [[run]] has a file and no [[measured]] stands beside a [pulse]; expected a record, or a virtual "
                "test by simulate"
            )
        runs = tuple(read_run(table, given, path) for table in files)
        marked = any(SIMULATED_KEY in (path.parent / str(table.file)).name for table in files)
        return replace(test, runs=runs, simulated=test.simulated or marked)


def load_rig_structure(rig: str | Path) -> RigTest:
    """Read a rig with sensors without its runs; a joint whose law is sought, or a model's, has ``UNKNOWN``.

    Raises
    ------
    InputError, UnitError, UnknownNameError, MissingInputError
        In one line that names file and field.
    """
    with rig_file(rig) as (path, given):
        return _build_test(given, path, LAWS)


def has_pulse(rig: str | Path) -> bool:
    """Return whether a rig is a chain that a pulse excites."""
    with rig_file(rig) as (_, given):
        return given.pulse is not None and bool(given.chain)


def load_rig_plan(rig: str | Path, laws: Mapping[str, Law] | None = None) -> RigPlan:
    """Read a rig whose joints have laws, shipped or given, with the runs that a virtual test shall make.

    Examples
    --------
    >>> import sindyjoint
    >>> plan = sindyjoint.load_rig_plan("pulse-rig")
    >>> [drive.frequency for drive in plan.drives][:2]
    [3.0, 3.0]
    """
    with rig_file(rig) as (path, given):
        test = _build_test(given, path, {**JOINTS, **(laws or {})})
        drives = tuple(
            _drive_of(table, number, given.drive) for number, table in enumerate(given.run, 1) if table.shape
        )
        if not drives:
            raise InputError(
                "no [[run]] has a shape; expected shape = 'sine', 'multisine', 'sweep' or 'impact', and amplitude"
            )
        r = given.recorder
        recorder = Recorder(
            parse_quantity(r.sample_rate, "Hz", "[recorder] sample_rate"),
            parse_quantity(r.duration, "s", "[recorder] duration"),
            parse_quantity(r.settling, "s", "[recorder] settling"),
            r.noise,
        )
        return RigPlan(test, drives, recorder)


def _build_test(given: RigFile, path: Path, laws: Mapping[str, Law]) -> RigTest:
    places = [(table.point, f"[[sensor]] {number}") for number, table in enumerate(given.sensor, 1)]
    shaken = given.drive.quantity == "base acceleration"
    if not shaken:
        places.append((given.drive.point, "[drive]"))
    stations = {
        _point(place): (place.beam, parse_quantity(place.at, "m", f"{where} point.at"))
        for place, where in places
        if isinstance(place, StationTable)
    }
    if given.matrices is not None:
        if stations:
            raise InputError(
                "a place along a beam is of a [[chain]]; with [matrices] a point is one of its freedoms"
            )
        structure, kinds, uncertain = _matrices(given.matrices, path)
        motion, chain = given.matrices.motion, None
    else:
        structure, kinds, uncertain, chain = _chain(given, laws, stations)
        motion = "rotation"
    sensors = tuple(
        Sensor(
            str(each.column), _point(each.point), each.quantity,
            parse_optional(each.noise, UNITS[each.quantity], f"[[sensor]] {number} noise"),
        )
        for number, each in enumerate(given.sensor, 1)
    )  # fmt: skip
    at = BASE if shaken else _point(given.drive.point)
    noise = parse_optional(given.drive.noise, UNITS[given.drive.quantity], "[drive] noise")
    return RigTest(
        given.name, structure, kinds, at, sensors, (), noise, motion=motion, uncertain=uncertain, chain=chain
    )


def _chain(
    given: RigFile, laws: Mapping[str, Law], stations: Mapping[str, tuple[str, float]]
) -> tuple[Structure, tuple[str, ...], tuple[UncertainNumber, ...], Chain]:
    items, stiffness = build_chain(given, laws)
    solvable_structure(items, stiffness)
    frequency = parse_optional(given.loss_frequency, "Hz", "loss_frequency")
    structure = assemble(items, stiffness, stations, frequency or None)
    if not frequency:
        unknown = any(hinge.law is UNKNOWN for hinge in structure.hinges)
        structure = replace(structure, loss_frequency=float(structure.frequencies(1, locked=unknown)[0]))
    joints = [part for part in given.chain if part.joint is not None]
    kinds = tuple(str(p.kind or (p.joint if p.law in ("unknown", "model") else p.law)) for p in joints)
    stated = {
        str(part.beam or part.joint or part.mass): {
            what: value
            for what in ("stiffness", "mass", "loss")
            if (value := getattr(part, f"{what}_uncertainty")) > 0
        }
        for part in given.chain
    }
    known = {str(part.beam): {"stiffness", "mass", "loss"} for part in given.chain if part.beam}
    wrong = {name: set(kinds) - known.get(name, {"mass"}) for name, kinds in stated.items()}
    refuse(
        (
            found,
            f"{name!r}: {min(found, default='')}_uncertainty is of a beam; expected mass_uncertainty at most",
        )
        for name, found in wrong.items()
    )
    chain = Chain(items, stiffness, stations, structure.loss_frequency)
    uncertain = uncertain_numbers(items, stiffness, stated, given.base.clamp_uncertainty)
    return structure, kinds, uncertain, chain


def _matrices(
    given: MatricesTable, path: Path
) -> tuple[Structure, tuple[str, ...], tuple[UncertainNumber, ...]]:
    """Return a structure whose first coordinates are the joints' angles (or elongations), from matrices of freedoms."""
    n = len(given.freedoms)
    if n > MOST_FREEDOMS:
        raise InputError(f"[matrices] {n} freedoms; expected at most {MOST_FREEDOMS}: reduce the model")
    file = path.parent / given.file
    columns = read_table(file)[0]
    given_mass, given_stiffness, given_damping = (
        _matrix(columns, name, n, file) for name in ("mass", "stiffness", "damping")
    )
    if given_mass is None or given_stiffness is None:
        raise InputError(f"{file}: expected arrays mass and stiffness, {n} × {n} as there are freedoms")
    place = {name: index for index, name in enumerate(given.freedoms)}
    refuse(
        (name not in place, f"[[matrices.joint]] {joint.name!r}: {name!r} is none of the freedoms")
        for joint in given.joint
        for name in joint.between
    )
    across, behind = np.zeros((len(given.joint), n)), [place[joint.between[-1]] for joint in given.joint]
    for row, joint in zip(across, given.joint, strict=True):
        row[[place[name] for name in joint.between]] = [-1.0, 1.0][-len(joint.between) :]
    forward = np.vstack([across, np.eye(n)[[index for index in range(n) if index not in behind]]])
    if len(set(behind)) < len(behind) or np.linalg.matrix_rank(forward) < n:
        raise InputError(
            "[[matrices.joint]]: two joints end at one freedom; name the freedoms the other way round"
        )
    back = np.linalg.inv(forward)
    mass, stiffness = (back.T @ matrix @ back for matrix in (given_mass, given_stiffness))
    damping = None if given_damping is None else back.T @ given_damping @ back
    zero = np.zeros((n, n))
    base = next((columns.columns([name])[0] for name in ("base", "base[:,0]") if name in columns.names), None)
    structure = Structure(
        mass, stiffness, zero, tuple(Hinge(joint.name, UNKNOWN) for joint in given.joint),
        {name: back[index] for name, index in place.items()}, viscous=damping,
        base=None if base is None else forward @ base,
    )  # fmt: skip
    numbers = (
        UncertainNumber("stiffness", given.stiffness_uncertainty, zero, stiffness, zero),
        UncertainNumber("mass", given.mass_uncertainty, mass, zero, zero),
    )
    uncertain = tuple(number for number in numbers if number.uncertainty)
    return structure, tuple(joint.kind or joint.name for joint in given.joint), uncertain


def _matrix(table: Any, name: str, n: int, file: Path) -> Array | None:
    """Return a matrix whose columns a reader has named one by one; None where there is none."""
    ways = [[f"{name}[:,{at}]" for at in range(n)], [f"{name}(:,{at})" for at in range(1, n + 1)]]
    found = [way for way in ([[name]] if n == 1 else ways) if set(way) <= set(table.names)]
    if not found:
        return None
    matrix = np.column_stack(table.columns(found[0]))
    if matrix.shape != (n, n):
        raise InputError(f"{file}: {name} has shape {matrix.shape}; expected ({n}, {n}), finite numbers")
    return matrix


def _point(place: str | StationTable) -> str:
    return place if isinstance(place, str) else f"{place.beam} at {place.at}"


def _pulse_test(given: RigFile, path: Path) -> RigTest:
    """Return the test of a rig whose only run is its pulse, with the displacements that were measured after it.

    Each sample of the force is its mean over the time that it stands for, which keeps impulse and centre of a pulse
    that lasts a few samples.
    """
    assert given.pulse is not None
    records = [read_measured(table, path) for table in given.measured]
    rate = records[0].sample_rate
    refuse(
        (
            abs(record.sample_rate / rate - 1) > SAME,
            f"{table.file}: {record.sample_rate:.6g} Hz beside {rate:.6g} Hz of {given.measured[0].file}; expected "
            "records of one rate: resample one",
        )
        for table, record in zip(given.measured, records, strict=True)
    )
    n = min(record.displacement.size for record in records)
    time = np.arange(n) / rate
    force = build_excitation(given.pulse, path).mean(time - 0.5 / rate, time + 0.5 / rate)
    # To which the force of a pulse is known where nothing is stated: as the lines of its samples are.
    relative = max(given.pulse.uncertainty, 1e-3)
    # Records at one point are told apart by a number.
    points = [record.point for record in records]
    again = [points[:index].count(point) for index, point in enumerate(points)]
    sensors = [
        SensorTable(
            column=f"{point} ({n + 1})" if n else point, quantity="displacement", unit="m", point=point
        )
        for point, n in zip(points, again, strict=True)
    ]
    drive = DriveTable(point=given.pulse.point)
    test = _build_test(given.model_copy(update={"sensor": sensors, "drive": drive}), path, LAWS)
    run = RigRun("pulse", force, np.array([record.displacement[:n] for record in records]), rate)
    # White noise by which the strongest line of the force is known as it is.
    noise = relative * float(np.abs(np.fft.rfft(force)).max()) * np.sqrt(2 / n)
    return replace(test, runs=(run,), drive_noise=noise)


def _drive_of(table: RunTable, number: int, drive: DriveTable) -> Drive:
    where = f"[[run]] {number}"
    if table.amplitude is None or table.shape is None:
        raise InputError(f"{where}: a run to simulate wants shape and amplitude")
    ends = [parse_quantity(end, "Hz", f"{where} band") for end in table.band or ()]
    band = (ends[0], ends[1]) if ends else None
    frequency = parse_optional(table.frequency, "Hz", f"{where} frequency")
    width = parse_optional(table.width, "s", f"{where} width")
    name = table.name or Path(table.file or f"run-{number:02d}").stem
    return Drive(
        name, table.shape, parse_quantity(table.amplitude, UNITS[drive.quantity], f"{where} amplitude"),
        frequency, band, width, table.level, table.use,
    )  # fmt: skip
