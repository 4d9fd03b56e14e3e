"""The manifest of a folder, drafted, with the questions that its files leave open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import numpy as np

from sindyjoint.errors import InputError, nearest, refuse
from sindyjoint.files.channels import KEYS
from sindyjoint.files.drafting.assignment import (
    NO_LOAD,
    Dialogue,
    Question,
    assign_columns,
    find_motion,
    find_unit,
)
from sindyjoint.files.drafting.run import (
    draft_time,
    find_course,
    find_frequency,
    input_lines,
    name_levels,
    offer_inputs,
    untold_rates,
)
from sindyjoint.files.drafting.survey import Bundle, Column, bundle_files, split_runs
from sindyjoint.files.manifest import NONE
from sindyjoint.files.timeaxis import unwound
from sindyjoint.files.units import conversion, needs_gain
from sindyjoint.files.writers import manifest_text, toml_value
from sindyjoint.record import Motion
from sindyjoint.text import list_some, printable

UNUSED = "not used"


@dataclass(frozen=True)
class UsedColumn:
    """A column of a draft.

    Parameters
    ----------
    file : str
        Or files, where it is the same in several.
    column : str, int or None
        Its name or number; None of what no column holds.
    quantity : str
        Key of the channel, or ``"not used"``.
    unit : str
        Or the value of a constant, or the sampling rate.
    why : str
    """

    file: str
    column: str | int | None
    quantity: str
    unit: str
    why: str


@dataclass(frozen=True)
class DraftedRun:
    """One run of a draft: its files, rate and excitation; the runs of one frequency and level repeat each other."""

    file: str
    rate: float | None
    samples: int
    frequency: float | None
    level: str
    run: str
    """Which of several in the file; else empty."""
    course: str
    """``"3 Hz"``, ``"free decay"``, ``"sweep"``, ``"aperiodic"`` or ``"quasi-static"``."""
    rows: tuple[int, int] | None = None
    """First and last of its rows, where runs stand one below the other."""


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


@dataclass(frozen=True)
class _Run:
    """A run with its channels as TOML text, by key, with comments; its largest deflection, SI, and what reads well."""

    drafted: DraftedRun
    channels: dict[str, str]
    peak: float
    unit: str
    factor: float
    used: tuple[UsedColumn, ...]


def draft_manifest(
    name: str,
    files: Sequence[Bundle],
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
    bundles = bundle_files(_split(files, dialogue))
    if not bundles:
        raise InputError(
            "no file holds columns of numbers: " + "; ".join(f"{file}: {why}" for file, why in left[:3])
        )
    # The constants of the rig, which raw strain gauges and laser spots need, stand in no file.
    refuse(
        (
            {"e1", "e2", "e3", "e4"} <= {column.title for column in bundle.columns},
            f"{bundle.name}: holds strain gauges (e1 to e4), which need the constants of the rig; write campaign.toml "
            "by hand with a [rig], as the guide shows",
        )
        for bundle in bundles
    )
    motion = find_motion(bundles, dialogue)
    assigned: list[tuple[Bundle, dict[str, Column]]] = []
    runs: list[_Run] = []
    for bundle in bundles:
        try:
            assigned.append((bundle, assign_columns(bundle, motion, dialogue, bundles)))
        except InputError as error:
            left.append((bundle.name, str(error).removeprefix(f"{bundle.name}: ")))
    # All columns that are one channel of the test, by quantity: what no file says of them is one answer.
    peers = {
        quantity: [columns[quantity] for _, columns in assigned if quantity in columns]
        for quantity in KEYS[motion]
    }
    offered, (untold, rates) = offer_inputs(bundles), untold_rates(assigned, dialogue)
    for bundle, columns in assigned:
        try:
            runs.append(_draft_run(bundle, columns, motion, dialogue, peers, offered, rates.get(bundle.name)))
        except InputError as error:
            left.append((bundle.name, str(error).removeprefix(f"{bundle.name}: ")))
    if not runs:
        # One reason once, with the files it holds for.
        reasons: dict[str, list[str]] = {}
        for file, why in left:
            reasons.setdefault(why, []).append(file)
        raise InputError(
            "; ".join(f"{list_some(names, 'files')}: {why}" for why, names in list(reasons.items())[:3])
        )
    peaks = [abs(run.peak / runs[0].factor) for run in runs]
    levels = name_levels([f"{run.drafted.file} {run.drafted.run}" for run in runs], peaks, runs[0].unit)
    runs = [
        replace(run, drafted=replace(run.drafted, level=level))
        for run, level in zip(runs, levels, strict=True)
    ]
    used = {run.drafted.file for run in runs}
    simulated = any(bundle.simulated for bundle in bundles if bundle.name in used)
    inputs = input_lines(dialogue.answers.get("inputs", ""), bundles[0])
    text = _write(dialogue.answers.get("name", name), motion, runs, simulated, dialogue, left, inputs)
    if len(untold) > 1 and "rate" in dialogue.questions:
        asked = dialogue.questions["rate"]
        more = (
            f"One rate is that of {list_some(untold[1:], 'files')}, too, or one for each: "
            f"'{untold[0]}: 1 kHz, {untold[1]}: ...'"
        )
        dialogue.questions["rate"] = replace(asked, text=f"{asked.text} {more}")
    return Draft(
        text,
        motion,
        runs[0].channels,
        tuple(run.drafted for run in runs),
        tuple(dialogue.questions.values()),
        tuple(left),
        simulated,
        _list_used(runs),
    )


def _split(files: Sequence[Bundle], dialogue: Dialogue) -> list[Bundle]:
    """Return the runs of all files; where numbers alone tell several in one apart, they may be several joints."""
    found: list[Bundle] = []
    for file in files:
        runs, told = split_runs(file)
        if not told:
            names = list_some([run.run for run in runs], "names")
            text = (
                f"are {names} in {file.name} runs of one joint (yes), or its columns those of one run (no)?"
            )
            runs = (file,) if dialogue.ask("runs", text, "yes") == "no" else runs
        found += runs
    return found


def _draft_run(
    bundle: Bundle,
    columns: dict[str, Column],
    motion: Motion,
    dialogue: Dialogue,
    peers: Mapping[str, Sequence[Column]],
    offered: Mapping[str, str],
    given: str | None,
) -> _Run:
    channels: dict[str, str] = {}
    rate = draft_time(bundle, columns.get("time"), channels, dialogue, given)
    used = [_used_time(bundle.name, columns.get("time"), channels, dialogue)]
    units: dict[str, tuple[str, str | None]] = {}
    for quantity, column in ((name, c) for name, c in columns.items() if name != "time"):
        key = KEYS[motion][quantity][0]
        unit, gain = units[quantity] = find_unit(column, quantity, motion, dialogue, peers[quantity])
        channels[key] = toml_value(
            {"file": column.file, "column": column.key, "minus": column.minus, "unit": unit, "gain": gain}
        ) + dialogue.mark(key, f"{key}.unit", f"{key}.gain")
        called = column.key if column.minus in (None, NONE) else f"{column.key} - {column.minus}"
        used.append(UsedColumn(bundle.name, called, key, unit, _why(column, key, unit, dialogue)))
    key = KEYS[motion]["moment"][0]
    if "moment" not in columns:
        load = dialogue.answers.get(key, NO_LOAD[motion])
        channels[key] = toml_value({"constant": load}) + dialogue.mark(key)
        used.append(UsedColumn(bundle.name, None, key, load, dialogue.why(key, "constant")))
    taken = {(c.file, key) for c in columns.values() for key in (c.key, c.minus)}
    used += [
        UsedColumn(bundle.name, c.key, UNUSED, c.unit, offered.get(c.title) or _why_not(c))
        for c in bundle.columns
        if (c.file, c.key) not in taken
    ]
    used += [
        UsedColumn(bundle.name, title, UNUSED, "", offered[title])
        for title, _ in bundle.scalars
        if title in offered
    ]
    of_motion = "angle" if "angle" in columns else "acceleration"
    angle = columns[of_motion]
    moment = columns["moment"].values if "moment" in columns else np.zeros_like(angle.values)
    refuse(
        [
            *(
                (
                    np.ptp(column.values) == 0,
                    f"{bundle.name}: column {column.key} never changes; check its cable, or name another column with "
                    "--set",
                )
                for column in (angle, columns.get("moment", angle))
            ),
            (angle.values.size != moment.size, f"{bundle.name}: its channels differ in length"),
        ]
    )
    unit, gain = units[of_motion]
    si, raw = KEYS[motion][of_motion][1], needs_gain(unit)
    factor = 1.0 if raw and gain is None else conversion(unit, si, f"{bundle.name}: {angle.key}", gain)
    values = unwound(angle.values, unit, factor if si == "rad" else 0.0)
    frequency = None if rate is None else find_frequency(values, moment, rate, f"{bundle.name} {bundle.run}")
    course, samples = find_course(values, rate, frequency), bundle.columns[0].values.size
    drafted = DraftedRun(bundle.name, rate, samples, frequency, "", bundle.run, course, bundle.rows)
    shown = (si, 1.0) if raw else (unit, factor)
    return _Run(drafted, channels, factor * float(np.ptp(values)) / 2, *shown, tuple(used))


def _used_time(file: str, column: Column | None, channels: dict[str, str], dialogue: Dialogue) -> UsedColumn:
    """Return how a run was sampled, by its channels."""
    if column is not None and "column" in channels.get("time", ""):
        unit = dialogue.answers.get("time.unit") or column.unit or "s"
        return UsedColumn(file, column.key, "time", unit, _why(column, "time", unit, dialogue))
    key = "rate" if "rate" in channels else "time"
    value, _, comment = channels.get(key, '"?"').partition("  # ")
    return UsedColumn(file, None, key, value.strip('"'), comment or dialogue.why("rate", "stamps"))


def _why_not(column: Column) -> str:
    """Return why a column is no channel."""
    if not np.ptp(column.values):
        return f"constant at {column.values[0]:g}"
    return f"looks like {column.role}" if column.role else "neither name nor unit tell"


def _why(column: Column, key: str, unit: str, dialogue: Dialogue) -> str:
    """Return why a column is a channel, and in that unit."""
    by_file = "its name" if column.role else "its values"
    of_unit = (
        "the file" if column.unit and column.unit == unit else "as usual" if key == "time" else "its size"
    )
    return f"column: {dialogue.why(key, by_file)}; unit: {dialogue.why(f'{key}.unit', of_unit)}"


def _list_used(runs: Sequence[_Run]) -> tuple[UsedColumn, ...]:
    """Return the columns of runs, those that are the same in several as one; the unused ones last.

    A star stands for what a file with several runs calls each of them.
    """
    same: dict[UsedColumn, list[str]] = {}
    for called, used in ((run.drafted.run, used) for run in runs for used in run.used):
        starred = bool(called) and used.column is not None
        column = str(used.column).replace(called, "*") if starred else used.column
        same.setdefault(replace(used, file="", column=column), []).append(used.file)
    merged = [
        replace(
            used,
            file=f"all {len(files)}"
            if len(files) == len(runs) > 1
            else list_some(list(dict.fromkeys(files)), "files"),
        )
        for used, files in same.items()
    ]
    return tuple(sorted(merged, key=lambda used: used.quantity == UNUSED))


def _write(
    name: str,
    motion: Motion,
    made: Sequence[_Run],
    simulated: bool,
    dialogue: Dialogue,
    left_out: Sequence[tuple[str, str]],
    inputs: Sequence[str],
) -> str:
    """Return the text of the manifest."""
    runs, channels = [run.drafted for run in made], [run.channels for run in made]
    load, (inertia, si) = KEYS[motion]["moment"][0], KEYS[motion]["inertia"]
    unit, given, per_unit = si.replace("**", "^"), dialogue.answers.get(inertia), ""
    if given is None and not any("column" in own[load] for own in channels):
        # Of a free decay the law is known up to a factor, which the inertia fixes.
        given = f"1 {unit}"
        per_unit = f"  # no {load} was measured: coefficients are per unit of {inertia}"
    head = ["# Drafted by sindyjoint init from the files of this folder."]
    if dialogue.questions:
        guesses = [printable(f"{each.key} = {each.guess}") for each in dialogue.questions.values()]
        head += [
            "# No file tells this: correct it below, and remove from this list what is right. Until then no result is "
            "trusted.",
            f"guessed = {toml_value(guesses)}",
        ]
    joint = [
        f"name = {toml_value(printable(name))}",
        f"motion = {toml_value(motion)}{dialogue.mark('motion')}",
        f"{inertia} = {toml_value(given)}{per_unit}"
        if given
        else f'# {inertia} = "0.02 {unit}"  # moving with the joint; left out: identified as a term',
    ]
    stems = [str(PurePosixPath(run.file).with_suffix("")) for run in runs]
    once = len({run.run for run in runs}) == len(runs)
    names = [(run.run if once else f"{run.file} {run.run}") if run.run else run.file for run in runs]
    known, answer = {*names, *stems}, dialogue.answers.get("validate", "")
    kept = [each for each in map(str.strip, answer.split(",")) if each]
    refuse(
        (each not in known, f"validate = {each!r} is no run; {nearest(each, names, 'runs there:')}")
        for each in kept
    )
    entries = [
        [
            f"file = {toml_value(run.file)}",
            *([f"name = {toml_value(name)}"] if stems.count(stem) > 1 else []),
            *([f"rows = {list(run.rows)}"] if run.rows else []),
            f"# {run.course}: no frequency" if run.frequency is None else f"frequency = {run.frequency!r}",
            f"level = {toml_value(run.level)}",
            *['use = "validate"'] * (not {name, stem}.isdisjoint(kept)),
        ]
        for run, name, stem in zip(runs, names, stems, strict=True)
    ]
    tail = ["", "# Left out:"] if left_out else []
    tail += [f"#   {' '.join(printable(f'{file}: {why}').split())}" for file, why in left_out]
    return manifest_text(
        [*head, *["", "simulated = true"] * simulated], joint, channels, entries, inputs, tail
    )
