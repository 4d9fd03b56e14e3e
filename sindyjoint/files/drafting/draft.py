"""The manifest of a folder, drafted, with the questions that its files leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.files.channels import KEYS
from sindyjoint.files.drafting.assignment import NO_LOAD, assign_columns, find_motion, find_unit
from sindyjoint.files.drafting.bundles import Bundle, Column, bundle_files
from sindyjoint.files.drafting.dialogue import Dialogue, Question
from sindyjoint.files.drafting.excitation import find_course, find_frequency, name_levels
from sindyjoint.files.drafting.sampling import draft_time, quote
from sindyjoint.files.drafting.survey import DataFile, share_units
from sindyjoint.files.drafting.used import UsedColumn, list_used, why_column
from sindyjoint.files.units import conversion, unit_ratio
from sindyjoint.record import Motion
from sindyjoint.text import printable


@dataclass(frozen=True)
class DraftedRun:
    """One run of a draft: its files, rate and excitation; the runs of one frequency and level repeat each other."""

    file: str
    rate: float | None
    samples: int
    frequency: float | None
    level: str
    course: str
    """``"3 Hz"``, ``"free decay"``, ``"sweep"``, ``"aperiodic"`` or ``"quasi-static"``."""


@dataclass(frozen=True)
class Draft:
    """A manifest as it would be written.

    Parameters
    ----------
    text : str
        Of ``campaign.toml``.
    motion : {"rotation", "translation"}
    channels : dict of str to str
        What the first run's channels are, as the manifest writes them.
    runs : tuple of DraftedRun
    questions : tuple of Question
        What the files leave open; the text holds the guesses, marked.
    left_out : tuple of (str, str)
        Files that are no runs, and why.
    simulated : bool
    columns : tuple of UsedColumn
        What each column of the files is taken for, and why.
    """

    text: str
    motion: Motion
    channels: dict[str, str]
    runs: tuple[DraftedRun, ...]
    questions: tuple[Question, ...]
    left_out: tuple[tuple[str, str], ...]
    simulated: bool
    columns: tuple[UsedColumn, ...] = ()

    @property
    def missing(self) -> tuple[Question, ...]:
        """Questions without an answer that could be guessed."""
        return tuple(question for question in self.questions if question.guess is None)


NO_LOAD_KEYS = ("moment", "force")


@dataclass(frozen=True)
class _Run:
    """A run with its channels as TOML text, by key, and comments on them."""

    bundle: Bundle
    channels: dict[str, str]
    rate: float | None
    frequency: float | None
    peak: float
    """Largest deflection in SI units."""
    unit: str
    factor: float
    """Of the unit in which the deflection reads well."""
    course: str
    used: tuple[UsedColumn, ...]

    @property
    def unloaded(self) -> bool:
        """Whether no load was measured: the law is then known per unit of inertia."""
        return not any("column" in self.channels.get(key, "") for key in NO_LOAD_KEYS)


def draft_manifest(
    name: str,
    files: Sequence[DataFile],
    left_out: Sequence[tuple[str, str]],
    answers: Mapping[str, str],
) -> Draft:
    """Return the manifest of data files.

    Parameters
    ----------
    name : str
        Of the joint, unless it is answered.
    files, left_out
        As :func:`~sindyjoint.files.drafting.survey.survey_folder` found them.
    answers : mapping of str to str
        What a person said, by the keys of questions.

    Raises
    ------
    InputError
        When no file holds a run.
    UnknownNameError
        For an answer to nothing.
    """
    dialogue = Dialogue(dict(answers))
    left = list(left_out)
    bundles = [bundle for bundle in bundle_files(share_units(files)) if bundle.columns]
    if not bundles:
        raise InputError(
            "no file holds columns of numbers: " + "; ".join(f"{file}: {why}" for file, why in left[:3])
        )
    _refuse_gauges(bundles)
    motion = find_motion(bundles, dialogue)
    assigned: list[tuple[Bundle, dict[str, Column]]] = []
    runs: list[_Run] = []

    def leave(bundle: Bundle, error: InputError) -> None:
        left.append((bundle.name, str(error).removeprefix(f"{bundle.name}: ")))

    for bundle in bundles:
        try:
            assigned.append((bundle, assign_columns(bundle, motion, dialogue)))
        except InputError as error:
            leave(bundle, error)
    # All columns that are one channel of the test, by quantity: what no file says of them is one answer.
    peers = {
        quantity: [columns[quantity] for _, columns in assigned if quantity in columns]
        for quantity in KEYS[motion]
    }
    for bundle, columns in assigned:
        try:
            runs.append(_draft_run(bundle, columns, motion, dialogue, peers))
        except InputError as error:
            leave(bundle, error)
    if not runs:
        raise InputError("; ".join(f"{file}: {why}" for file, why in left[:3]))
    peaks = [abs(run.peak / runs[0].factor) for run in runs]
    levels = name_levels([run.bundle.name for run in runs], peaks, runs[0].unit)
    text = _write(dialogue.answers.get("name", name), motion, runs, levels, dialogue, left)
    drafted = tuple(
        DraftedRun(
            run.bundle.name, run.rate, run.bundle.columns[0].values.size, run.frequency, level, run.course
        )
        for run, level in zip(runs, levels, strict=True)
    )
    simulated = any(run.bundle.simulated for run in runs)
    return Draft(
        text,
        motion,
        runs[0].channels,
        drafted,
        tuple(dialogue.questions.values()),
        tuple(left),
        simulated,
        list_used([run.used for run in runs]),
    )


def _refuse_gauges(bundles: Sequence[Bundle]) -> None:
    """Refuse raw strain gauges and laser spots: the constants of the rig stand in no file."""
    for bundle in bundles:
        titles = {column.title for column in bundle.columns}
        if {"e1", "e2", "e3", "e4"} <= titles:
            raise InputError(
                f"{bundle.name}: holds strain gauges (e1 to e4), which need the constants of the rig; write "
                "campaign.toml by hand with a [rig], as the guide shows"
            )


def _draft_run(
    bundle: Bundle,
    columns: dict[str, Column],
    motion: Motion,
    dialogue: Dialogue,
    peers: Mapping[str, Sequence[Column]],
) -> _Run:
    channels: dict[str, str] = {}
    rate = draft_time(bundle, columns.get("time"), channels, dialogue)
    used = [UsedColumn.of_time(bundle, columns.get("time"), channels, dialogue)]
    units: dict[str, tuple[str, str | None]] = {}
    for quantity, column in columns.items():
        if quantity == "time":
            continue
        key = KEYS[motion][quantity][0]
        unit, gain = units[quantity] = find_unit(column, quantity, motion, dialogue, peers[quantity])
        parts = [f"file = {quote(column.file)}"] if column.file else []
        parts += [f"column = {quote(column.key)}", f"unit = {quote(unit)}"]
        parts += [f"gain = {quote(gain)}"] if gain else []
        channels[key] = "{ " + ", ".join(parts) + " }" + dialogue.mark(key, f"{key}.unit", f"{key}.gain")
        used.append(UsedColumn(bundle.name, column.key, key, unit, why_column(column, key, unit, dialogue)))
    key = KEYS[motion]["moment"][0]
    if "moment" not in columns:
        load = dialogue.answers.get(key, NO_LOAD[motion])
        channels[key] = f"{{ constant = {quote(load)} }}{dialogue.mark(key)}"
        used.append(UsedColumn(bundle.name, None, key, load, dialogue.why(key, "constant")))
    taken = list(columns.values())
    used += [UsedColumn.unused(bundle.name, column) for column in bundle.columns if column not in taken]
    of_motion = "angle" if "angle" in columns else "acceleration"
    angle = columns[of_motion]
    moment = columns["moment"].values if "moment" in columns else np.zeros_like(angle.values)
    for column in (columns[name] for name in (of_motion, "moment") if name in columns):
        if np.ptp(column.values) == 0:
            raise InputError(f"{bundle.name}: column {column.key} never changes")
    if angle.values.size != moment.size:
        raise InputError(f"{bundle.name}: its channels differ in length")
    frequency = None if rate is None else find_frequency(angle.values, moment, rate, bundle.name)
    unit, gain = units[of_motion]
    si = KEYS[motion][of_motion][1]
    volts = unit_ratio(unit, "V")
    factor = 1.0 if volts and gain is None else conversion(unit, si, f"{bundle.name}: {angle.key}", gain)
    peak = factor * float(np.ptp(angle.values)) / 2
    course = find_course(angle.values, rate, frequency)
    shown = (si, 1.0) if volts else (unit, factor)
    return _Run(bundle, channels, rate, frequency, peak, *shown, course, tuple(used))


def _write(
    name: str,
    motion: Motion,
    runs: Sequence[_Run],
    levels: Sequence[str],
    dialogue: Dialogue,
    left_out: Sequence[tuple[str, str]],
) -> str:
    """Return the text of the manifest."""
    inertia, unit = KEYS[motion]["inertia"]
    given, per_unit = dialogue.answers.get(inertia), ""
    if given is None and all(run.unloaded for run in runs):
        # Of a free decay the law is known up to a factor, which the inertia fixes.
        given = f"1 {unit.replace('**', '^')}"
        per_unit = f"  # no {KEYS[motion]['moment'][0]} was measured: coefficients are per unit of {inertia}"
    lines = ["# Drafted by sindyjoint init from the files of this folder."]
    if dialogue.questions:
        lines.append('# What is marked "guessed" the files do not tell: correct it, or remove the mark.')
    if any(run.bundle.simulated for run in runs):
        lines += ["", "simulated = true"]
    lines += [
        "",
        "[joint]",
        f"name = {quote(printable(name))}",
        f"motion = {quote(motion)}{dialogue.mark('motion')}",
    ]
    lines.append(
        f"{inertia} = {quote(given)}{per_unit}"
        if given
        else f'# {inertia} = "0.02 {unit.replace("**", "^")}"  # moving with the joint; left out: identified as a term'
    )
    shared = {
        key: value
        for key, value in runs[0].channels.items()
        if all(r.channels.get(key) == value for r in runs)
    }
    lines += ["", "[channels]", *(f"{key} = {value}" for key, value in shared.items())]
    stems = [str(PurePosixPath(run.bundle.name).with_suffix("")) for run in runs]
    for run, level, stem in zip(runs, levels, stems, strict=True):
        lines += ["", "[[run]]", f"file = {quote(run.bundle.name)}"]
        lines += [f"name = {quote(run.bundle.name)}"] if stems.count(stem) > 1 else []
        lines.append(
            f"# {run.course}: no frequency" if run.frequency is None else f"frequency = {run.frequency!r}"
        )
        lines.append(f"level = {quote(level)}")
        particular = [f"{key} = {value}" for key, value in run.channels.items() if key not in shared]
        lines += ["[run.channels]", *particular] if particular else []
    lines += ["", "# Left out:"] if left_out else []
    lines += [f"#   {' '.join(printable(f'{file}: {why}').split())}" for file, why in left_out]
    return "\n".join(lines) + "\n"
