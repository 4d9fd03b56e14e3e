"""The manifest of a folder, drafted, with the questions that its files leave open."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.files.channels import KEYS
from sindyjoint.files.drafting.assignment import assign_columns, find_motion, find_unit
from sindyjoint.files.drafting.bundles import Bundle, Column, bundle_files
from sindyjoint.files.drafting.dialogue import Dialogue, Question
from sindyjoint.files.drafting.excitation import find_frequency, name_levels
from sindyjoint.files.drafting.survey import DataFile
from sindyjoint.files.timeaxis import LONGEST_GAP, check_order, uniform_rate
from sindyjoint.files.units import conversion, parse_quantity, unit_ratio
from sindyjoint.record import Motion
from sindyjoint.text import printable

# The sampling rate, or interval, as instruments write it above their tables.
_RATE = re.compile(
    r"(?:sampl\w*[ _-]*(?:rate|freq\w*)?|abtast\w*|\brate|\bfs)\b[^\d\n]{0,20}?(\d+(?:[.,]\d+)?)\s*(k?)Hz",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:delta[ _]?[tx]|\bdt|sampl\w*[ _-]*(?:interval|time|period)|increment)\b[^\d\n]{0,20}?"
    r"(\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)\s*([mu]?s)\b",
    re.IGNORECASE,
)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
# Stamps this far apart, in seconds, are rather milliseconds.
COARSE = 0.5


@dataclass(frozen=True)
class DraftedRun:
    """One run of a draft: its files, rate and excitation."""

    file: str
    rate: float | None
    samples: int
    frequency: float | None
    level: str


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
    """

    text: str
    motion: Motion
    channels: dict[str, str]
    runs: tuple[DraftedRun, ...]
    questions: tuple[Question, ...]
    left_out: tuple[tuple[str, str], ...]
    simulated: bool

    @property
    def missing(self) -> tuple[Question, ...]:
        """Questions without an answer that could be guessed."""
        return tuple(question for question in self.questions if question.guess is None)


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
    bundles = [bundle for bundle in bundle_files(files) if bundle.columns]
    if not bundles:
        raise InputError(
            "no file holds columns of numbers: " + "; ".join(f"{file}: {why}" for file, why in left[:3])
        )
    _refuse_gauges(bundles)
    motion = find_motion(bundles, dialogue)
    runs = []
    for bundle in bundles:
        try:
            runs.append(_draft_run(bundle, motion, dialogue))
        except InputError as error:
            left.append((bundle.name, str(error).removeprefix(f"{bundle.name}: ")))
    if not runs:
        raise InputError("; ".join(f"{file}: {why}" for file, why in left[:3]))
    peaks = [abs(run.peak / runs[0].factor) for run in runs]
    levels = name_levels([run.bundle.name for run in runs], peaks, runs[0].unit)
    text = _write(dialogue.answers.get("name", name), motion, runs, levels, dialogue, left)
    drafted = tuple(
        DraftedRun(run.bundle.name, run.rate, run.bundle.columns[0].values.size, run.frequency, level)
        for run, level in zip(runs, levels, strict=True)
    )
    simulated = any(run.bundle.simulated for run in runs)
    return Draft(
        text, motion, runs[0].channels, drafted, tuple(dialogue.questions.values()), tuple(left), simulated
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


def _draft_run(bundle: Bundle, motion: Motion, dialogue: Dialogue) -> _Run:
    columns = assign_columns(bundle, motion, dialogue)
    channels: dict[str, str] = {}
    rate = _draft_time(bundle, columns.get("time"), channels, dialogue)
    unit = ""
    for quantity, column in columns.items():
        if quantity == "time":
            continue
        key = KEYS[motion][quantity][0]
        unit, gain = find_unit(column, quantity, motion, dialogue)
        parts = [f"file = {quote(column.file)}"] if column.file else []
        parts += [f"column = {quote(column.key)}", f"unit = {quote(unit)}"]
        parts += [f"gain = {quote(gain)}"] if gain else []
        channels[key] = "{ " + ", ".join(parts) + " }" + dialogue.mark(key, f"{key}.unit", f"{key}.gain")
    of_motion = "angle" if "angle" in columns else "acceleration"
    angle, moment = columns[of_motion], columns["moment"]
    for column in (angle, moment):
        if np.ptp(column.values) == 0:
            raise InputError(f"{bundle.name}: column {column.key} never changes")
    if angle.values.size != moment.values.size:
        raise InputError(f"{bundle.name}: its channels differ in length")
    frequency = None if rate is None else find_frequency(angle.values, moment.values, rate, bundle.name)
    unit, gain = find_unit(angle, of_motion, motion, dialogue)
    si = KEYS[motion][of_motion][1]
    volts = unit_ratio(unit, "V")
    factor = 1.0 if volts and gain is None else conversion(unit, si, f"{bundle.name}: {angle.key}", gain)
    peak = factor * float(np.ptp(angle.values)) / 2
    return _Run(bundle, channels, rate, frequency, peak, *((si, 1.0) if volts else (unit, factor)))


def _draft_time(
    bundle: Bundle, column: Column | None, channels: dict[str, str], dialogue: Dialogue
) -> float | None:
    """Write how the run was sampled, and return its rate, Hz."""
    if dialogue.answers.get("rate") == "none":
        channels["time"] = quote("none") + "  # quasi-static samples, in their order"
        return None
    if "rate" in dialogue.answers:
        channels["rate"] = quote(dialogue.answers["rate"])
        return parse_quantity(dialogue.answers["rate"], "Hz", "rate")
    if column is None:
        return _draft_rate(bundle, channels, dialogue)
    unit = dialogue.answers.get("time.unit") or column.unit
    if not unit:
        step = float(np.median(np.diff(column.values)))
        text = f"in which unit are the time stamps (column {column.key}, steps of {step:.3g})?"
        unit = (dialogue.ask("time.unit", text, "ms") if step >= COARSE else None) or "s"
    time = column.values * conversion(unit, "s", f"{bundle.name}: time")
    entry = f"{{ column = {quote(column.key)}, unit = {quote(unit)} }}{dialogue.mark('time.unit')}"
    rate = float((time.size - 1) / (time[-1] - time[0])) if time[-1] > time[0] else 0.0
    try:
        check_order(time, bundle.name, str)
        channels["time"] = entry
        return uniform_rate(time, bundle.name, str)
    except InputError:
        steps = np.diff(time)
        if np.all(steps > 0) and steps.max() <= LONGEST_GAP * np.median(steps):
            channels["time"], channels["resample"] = entry, "true  # the time stamps are irregular"
            return rate
        channels.pop("time", None)
        if rate <= 0:
            return _draft_rate(bundle, channels, dialogue)
        guess = f"{rate:.6g} Hz"
        text = f"how fast was {bundle.name} sampled? Its stamps stand still or leave gaps; on average they give {guess}"
        channels["rate"] = quote(dialogue.ask("rate", text, guess) or guess) + dialogue.mark("rate")
        return rate


def _draft_rate(bundle: Bundle, channels: dict[str, str], dialogue: Dialogue) -> float | None:
    """Write the sampling rate that the file's remarks state, or that was asked for."""
    remarks = "\n".join(bundle.remarks)
    stated, step = _RATE.search(remarks), _STEP.search(remarks)
    if stated:
        rate = float(stated[1].replace(",", ".")) * (1000 if stated[2] else 1)
    elif step:
        rate = 1 / (float(step[1].replace(",", ".")) * _SECONDS[step[2].lower()])
    else:
        dialogue.ask(
            "rate",
            f"how fast was {bundle.name} sampled, such as '1 kHz', or 'none' of quasi-static samples?",
            None,
        )
        return None
    channels["rate"] = quote(f"{rate:.9g} Hz") + "  # stated above the columns"
    return rate


def quote(value: str | int | None) -> str:
    """Return a TOML string or number."""
    return str(value) if isinstance(value, int) else json.dumps(str(value), ensure_ascii=False)


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
    given = dialogue.answers.get(inertia)
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
        f"{inertia} = {quote(given)}"
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
            "# frequency = 3.0  # Hz; the motion is no steady sine, so it is left out"
            if run.frequency is None
            else f"frequency = {run.frequency!r}"
        )
        lines.append(f"level = {quote(level)}")
        particular = [f"{key} = {value}" for key, value in run.channels.items() if key not in shared]
        lines += ["[run.channels]", *particular] if particular else []
    lines += ["", "# Left out:"] if left_out else []
    lines += [f"#   {' '.join(printable(f'{file}: {why}').split())}" for file, why in left_out]
    return "\n".join(lines) + "\n"
