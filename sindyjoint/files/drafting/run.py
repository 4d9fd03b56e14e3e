"""How a run was sampled and excited: its rate, its frequency, its level, and under which conditions."""

import re
import shlex
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np

from sindyjoint.errors import InputError, nearest
from sindyjoint.files.drafting.assignment import Dialogue
from sindyjoint.files.drafting.survey import WARM, Bundle, Column
from sindyjoint.files.timeaxis import (
    LONGEST_GAP,
    PARTS,
    check_frequency,
    check_order,
    decays,
    uniform_rate,
    with_lost_samples,
    without_drift,
)
from sindyjoint.files.units import conversion, parse_quantity, unit_in_name
from sindyjoint.files.writers import toml_pairs, toml_value
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.policy import SHARED
from sindyjoint.record import MINIMUM_SAMPLES
from sindyjoint.text import list_some, printable

# The sampling rate, or interval, as instruments write it above their tables.
_RATE = re.compile(
    r"(?:sampl\w*[ _-]*(?:rate|freq\w*)?|abtast\w*|\brate|\bfs)\b[^\d\n]{0,20}?(\d+(?:[.,]\d+)?)\s*(k?)(?:Hz|S/s)",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:delta[ _]?[tx]|\bdt|sampl\w*[ _-]*(?:interval|time|period)|increment)\b[^\d\n]{0,20}?"
    r"(\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)\s*([mu]?s)\b",
    re.IGNORECASE,
)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_NUMBER = re.compile(
    r"\b([A-Za-z][\w ]{0,40}?)['\"]?\s*(?:[\[(](?:Hz|s)[\])])?\s*[:=;,\t]\s*(\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?![\w.:/-])",
    re.IGNORECASE,
)
# What programs call a single number that is the sampling rate, Hz, or the interval, s.
RATES = {"fs", "fsamp", "srate", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "rate"}
INTERVALS = {
    "dt", "ts", "deltat", "sampletime", "sampleinterval", "samplinginterval", "samplingtime", "samplingperiod",
}  # fmt: skip
_HERTZ = re.compile(r"(\d+(?:[.,p]\d+)?)\s*[hH]z")
_LEVEL_WORD = re.compile(
    r"(?:^|[^a-z])(low|lo|middle|mid|medium|high|hi|small|large|max|min|full|half)(?![a-z])", re.IGNORECASE
)
_LEVEL_SIZE = re.compile(
    r"(\d+(?:[.,p]\d+)?)\s*(Nm|N|kN|mm|in|inch|deg|mrad|rad|um|lb|lbf|V|percent|pct)(?![a-zA-Z])"
)


def untold_rates(
    assigned: Sequence[tuple[Bundle, Mapping[str, Column]]], dialogue: Dialogue
) -> tuple[list[str], dict[str, str]]:
    """Return the files that do not tell how they were sampled, and what was answered, by file.

    An answer without names is that of these; of all files where each tells its own.
    """
    untold, files = dict[str, None](), {bundle.name: None for bundle, _ in assigned}
    for bundle, columns in assigned:
        probe = Dialogue({key: answer for key, answer in dialogue.answers.items() if key != "rate"})
        with suppress(InputError):
            draft_time(bundle, columns.get("time"), {}, probe)
        if "rate" in probe.questions:
            untold[bundle.name] = None
    answer = dialogue.answers.get("rate")
    if answer is None or ":" not in answer:
        return list(untold), dict.fromkeys(untold or files, answer) if answer else {}
    parts = (part.rpartition(":") for part in answer.split(","))
    rates = {file.strip(): rate.strip() for file, _, rate in parts}
    if not untold.keys() <= rates.keys() <= files.keys():
        raise InputError(
            f"rate = {answer!r}; expected FILE: RATE for each of {list_some(list(untold or files))}"
        )
    return list(untold), rates


def draft_time(
    bundle: Bundle,
    column: Column | None,
    channels: dict[str, str],
    dialogue: Dialogue,
    given: str | None = None,
) -> float | None:
    """Write how the run was sampled, as was answered or as its file tells, and return its rate, Hz."""
    if given == "none":
        channels["time"] = toml_value("none") + "  # quasi-static samples, in their order"
        return None
    if given is not None:
        channels["rate"] = toml_value(given)
        return parse_quantity(given, "Hz", "rate")
    # What counts rows is no time where a rate is stated.
    counts = column is not None and column.role is None and bool(np.all(np.diff(column.values) == 1))
    if column is None or (counts and _draft_rate(bundle, {}, Dialogue({})) is not None):
        return _draft_rate(bundle, channels, dialogue)
    unit = dialogue.answers.get("time.unit") or column.unit
    if not unit:
        step = float(np.median(np.diff(column.values)))
        text = f"in which unit are the time stamps (column {column.key}, steps of {step:.3g})?"
        # Stamps this far apart, in seconds, are rather milliseconds.
        unit = (dialogue.ask("time.unit", text, "ms") if step >= 0.5 else None) or "s"
    time = column.values * conversion(unit, "s", f"{bundle.name}: time")
    channels["time"] = toml_value({"column": column.key, "unit": unit}) + dialogue.mark("time.unit")
    try:
        check_order(time, bundle.name, str)
        return uniform_rate(time, bundle.name, str)
    except InputError:
        steps = np.diff(time)
        lost = with_lost_samples(time, {})
        if lost is not None:
            return lost[1]
        rate = float((time.size - 1) / (time[-1] - time[0])) if time[-1] > time[0] else 0.0
        if np.all(steps > 0) and steps.max() <= LONGEST_GAP * np.median(steps):
            channels["resample"] = "true  # the time stamps are irregular"
            return rate
        del channels["time"]
        if rate <= 0:
            return _draft_rate(bundle, channels, dialogue)
        guess = f"{rate:.6g} Hz"
        text = f"how fast was {bundle.name} sampled? Its stamps stand still or leave gaps; on average they give {guess}"
        channels["rate"] = toml_value(dialogue.ask("rate", text, guess) or guess) + dialogue.mark("rate")
        return rate


def _draft_rate(bundle: Bundle, channels: dict[str, str], dialogue: Dialogue) -> float | None:
    """Write the sampling rate that is stated above, beside or within the file, or that was asked for."""
    found = [(f"the file's {printable(title)}", rate) for title, rate in _named_rates(bundle.scalars)]
    beside = [(f"in {printable(note)}", text) for note, text in bundle.notes]
    for place, text in [("above the columns", "\n".join(bundle.remarks)), *beside]:
        rates = [float(n.replace(",", ".")) * (1000 if kilo else 1) for n, kilo in _RATE.findall(text)]
        steps = [float(n.replace(",", ".")) * _SECONDS[unit.lower()] for n, unit in _STEP.findall(text)]
        stated = rates or [1 / max(step, 1e-9) for step in steps]
        stated = stated or [rate for _, rate in _named_rates(_NUMBER.findall(text))]
        found += [(f"stated {place}", rate) for rate in stated if rate > 0]
    where, rate = found[0] if found else ("", None)
    if rate is None or any(abs(other / rate - 1) > SHARED.tolerated for _, other in found):
        text = f"how fast was {bundle.name} sampled, such as '1 kHz', or 'none' of quasi-static samples?"
        listed = (f"{other:g} Hz is {said}" for said, other in found)
        dialogue.ask("rate", f"{text} {', '.join(listed)}".strip(), None)
        return None
    channels["rate"] = toml_value(f"{rate:.9g} Hz") + f"  # {where}"
    return rate


def _named_rates(numbers: Iterable[tuple[str, float | str]]) -> Iterator[tuple[str, float]]:
    """Yield what is a sampling rate, or an interval, by its name, as a rate in Hz."""
    for title, number in numbers:
        word = re.sub(r"[^a-z]", "", re.split(r"[./]", title)[-1].lower().removesuffix("hz"))
        value = float(number)
        if value > 0 and word in RATES | INTERVALS:
            yield title, value if word in RATES else 1 / value


def find_frequency(angle: Array, moment: Array, rate: float, name: str) -> float | None:
    """Return the frequency of a sinusoidal excitation, Hz; None for an aperiodic run.

    A frequency in the file's name counts where the spectrum agrees; a frequency of the spectrum is rounded to what its
    resolution can show.
    """
    if angle.size < MINIMUM_SAMPLES:
        return None
    moving = [x for x in (angle, moment) if np.ptp(x) > 0]
    # A free decay has a frequency of its own, and none that drives it.
    if not moving or decays(angle):
        return None
    steady = without_drift(moving[0], 3)
    found = main_frequency(steady, rate, between_bins=True)
    named = _HERTZ.search(name)
    if named:
        stated = float(re.sub("[,p]", ".", named[1]))
        if _holds(stated, angle, moment, rate) and stated * angle.size / rate >= SHARED.fewest:
            return stated
    periods = found * angle.size / rate
    if periods < SHARED.fewest or not _holds(found, angle, moment, rate):
        return None
    # The power of what changes from one period to the next, relative to that of the signal; a polynomial that is fitted
    # to the signal itself takes a part of few periods.
    at = np.arange(angle.size)
    later = at + rate / found
    inside = later <= at[-1]
    changed = without_drift(np.interp(later[inside], at, moving[0]) - moving[0][inside], 2)
    # Share of its power by which a motion may change from one period to the next.
    if np.mean(changed**2) / (2 * np.var(steady)) > 0.03:
        return None
    # The fewest digits that lie within its error.
    rounded = [float(f"{found:.{digits}g}") for digits in range(1, 8)]
    return next((value for value in rounded if abs(value - found) <= 0.05 * found / periods), found)


def find_course(angle: Array, rate: float | None, frequency: float | None) -> str:
    """Return what kind of run a motion is: ``"3 Hz"``, ``"free decay"``, ``"sweep"`` or ``"aperiodic"``.

    Examples
    --------
    >>> time = np.arange(4000) / 500
    >>> find_course(np.exp(-time / 3) * np.cos(20 * time), 500.0, None)
    'free decay'
    >>> find_course(np.sin(10 * time + 5 * time**2), 500.0, None)
    'sweep'
    """
    if frequency is not None:
        return f"{frequency:g} Hz"
    if rate is None:
        return "quasi-static"
    if decays(angle):
        return "free decay"
    parts = np.array_split(angle, PARTS)
    found = np.array([main_frequency(part - part.mean(), rate, between_bins=True) for part in parts])
    turns = np.diff(found) if found[-1] > found[0] else -np.diff(found)
    enough = found.min() * angle.size / rate / PARTS > 1
    return "sweep" if enough and np.all(turns > 0) and np.ptp(found) > found.min() / 2 else "aperiodic"


def _holds(frequency: float, angle: Array, moment: Array, rate: float) -> bool:
    """Return whether a campaign with this frequency would be accepted."""
    try:
        check_frequency(angle, None if np.ptp(moment) == 0 else moment, rate, frequency, "")
    except InputError:
        return False
    return rate >= 10 * frequency


def name_levels(names: Sequence[str], peaks: Sequence[float], unit: str) -> list[str]:
    """Return a label for the level of each run: the word or size in its file's name, or its amplitude.

    Parameters
    ----------
    names : sequence of str
        Of the files.
    peaks : sequence of float
        Largest deflections of the joint, in the unit.
    unit : str

    Examples
    --------
    >>> name_levels(["3Hz-low", "4Hz_0.5in", "c", "d"], [0.001, 0.002, 0.0031, 0.003], "rad")
    ['low', '0.5 in', '3 mrad', '3 mrad']
    """
    if unit in ("rad", "m") and max(peaks) < SHARED.minor_share:
        peaks, unit = [1e3 * peak for peak in peaks], f"m{unit}"
    labels, lowest = [""] * len(names), 0.0
    for i in sorted(range(len(names)), key=lambda i: peaks[i]):
        if not (lowest and peaks[i] <= (1 + SHARED.alike) * lowest):
            lowest = peaks[i]
        stem = _HERTZ.sub(" ", names[i])
        word, size = _LEVEL_WORD.search(stem), _LEVEL_SIZE.search(stem)
        written = word[1].lower() if word else f"{re.sub('[,p]', '.', size[1])} {size[2]}" if size else ""
        labels[i] = written or f"{float(f'{lowest:.2g}'):g} {unit}"
    return labels


def offer_inputs(bundles: Sequence[Bundle]) -> dict[str, str]:
    """Return what has one value in each run, and others in others, as a temperature or a preload, and the offer."""
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for bundle in bundles:
        rates = {title for title, _ in _named_rates(bundle.scalars)}
        own = [(c.title, c.values) for c in bundle.columns if c.role not in ("time", "counter")]
        own += [(title, np.array([value])) for title, value in bundle.scalars if title not in rates]
        for title, signal in own:
            found[title].append((float(np.mean(signal)), float(np.std(signal))))
    offered = {}
    for title, values in found.items():
        levels, within = np.transpose(values)
        if levels.size == len(bundles) and within.max() < SHARED.tolerated * np.ptp(levels):
            offer = f"lets the law depend on it: --set inputs={shlex.quote(title)}"
            offered[title] = f"one value in each run, {levels.min():.4g} to {levels.max():.4g}; {offer}"
    return offered


def input_lines(answer: str, bundle: Bundle) -> list[str]:
    """Return ``[inputs]`` with the columns, or single numbers, that were named."""
    lines = []
    for title in filter(None, map(str.strip, answer.split(","))):
        column, scalars = bundle.find(title), [each for each, _ in bundle.scalars]
        if column is None and title not in scalars:
            known = [str(each.key) for each in bundle.columns] + scalars
            raise InputError(f"inputs = {title!r} is no column; {nearest(title, known, 'columns there:')}")
        key, unit = (
            (title, (unit_in_name(title) or ("",))[0]) if column is None else (column.key, column.unit)
        )
        name = re.sub(r"\W+", "_", re.sub(r"[\[({].*", "", title)).strip("_")
        lines += toml_pairs({name: {"column": key, "unit": WARM.get(unit, unit) or "1"}})
    return ["", "[inputs]", *lines] if lines else []
