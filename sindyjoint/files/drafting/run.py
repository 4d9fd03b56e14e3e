"""How a run was sampled and excited: its rate, its frequency, its level, and under which conditions."""

import re
import shlex
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from sindyjoint.errors import InputError, nearest
from sindyjoint.files.drafting.assignment import Dialogue
from sindyjoint.files.drafting.survey import Bundle, Column
from sindyjoint.files.timeaxis import (
    LONGEST_GAP,
    PARTS,
    check_frequency,
    check_order,
    decays,
    uniform_rate,
    with_lost_samples,
)
from sindyjoint.files.units import conversion, parse_quantity, unit_in_name
from sindyjoint.files.writers import toml_string
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.policy import SHARED
from sindyjoint.record import MINIMUM_SAMPLES
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
# What programs call a single number that is the sampling rate, Hz, or the interval, s.
RATES = {"fs", "fsamp", "srate", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "rate"}
INTERVALS = {
    "dt", "ts", "deltat", "sampletime", "sampleinterval", "samplinginterval", "samplingtime", "samplingperiod",
}  # fmt: skip
# Of temperatures, where they are no coulombs and farads.
WARM = {"C": "degC", "°C": "degC", "F": "degF", "°F": "degF"}
# Stamps this far apart, in seconds, are rather milliseconds.
COARSE = 0.5
# Share of its power by which a motion may change from one period to the next.
REPEATS = 0.03
_HERTZ = re.compile(r"(\d+(?:[.,p]\d+)?)\s*[hH]z")
_LEVEL_WORD = re.compile(
    r"(?:^|[^a-z])(low|lo|middle|mid|medium|high|hi|small|large|max|min|full|half)(?![a-z])", re.IGNORECASE
)
_LEVEL_SIZE = re.compile(
    r"(\d+(?:[.,p]\d+)?)\s*(Nm|N|kN|mm|in|inch|deg|mrad|rad|um|lb|lbf|V|percent|pct)(?![a-zA-Z])"
)


def draft_time(
    bundle: Bundle, column: Column | None, channels: dict[str, str], dialogue: Dialogue
) -> float | None:
    """Write how the run was sampled, and return its rate, Hz."""
    given = dialogue.answers.get("rate")
    if given == "none":
        channels["time"] = toml_string("none") + "  # quasi-static samples, in their order"
        return None
    if given is not None:
        channels["rate"] = toml_string(given)
        return parse_quantity(given, "Hz", "rate")
    if column is None:
        return _draft_rate(bundle, channels, dialogue)
    unit = dialogue.answers.get("time.unit") or column.unit
    if not unit:
        step = float(np.median(np.diff(column.values)))
        text = f"in which unit are the time stamps (column {column.key}, steps of {step:.3g})?"
        unit = (dialogue.ask("time.unit", text, "ms") if step >= COARSE else None) or "s"
    time = column.values * conversion(unit, "s", f"{bundle.name}: time")
    pairs = f"{{ column = {toml_string(column.key)}, unit = {toml_string(unit)} }}"
    channels["time"] = pairs + dialogue.mark("time.unit")
    try:
        check_order(time, bundle.name, str)
        return uniform_rate(time, bundle.name, str)
    except InputError:
        steps = np.diff(time)
        lost = with_lost_samples(time, {}) if np.all(steps > 0) else None
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
        channels["rate"] = toml_string(dialogue.ask("rate", text, guess) or guess) + dialogue.mark("rate")
        return rate


def _draft_rate(bundle: Bundle, channels: dict[str, str], dialogue: Dialogue) -> float | None:
    """Write the sampling rate that the file states above or beside its columns, or that was asked for."""
    remarks, where = "\n".join(bundle.remarks), "stated above the columns"
    stated, step = _RATE.search(remarks), _STEP.search(remarks)
    rate = None
    if stated:
        rate = float(stated[1].replace(",", ".")) * (1000 if stated[2] else 1)
    elif step:
        rate = 1 / (float(step[1].replace(",", ".")) * _SECONDS[step[2].lower()])
    else:
        # A single number beside the columns.
        for title, value in bundle.scalars:
            word = re.sub(r"[^a-z]", "", re.split(r"[./]", title)[-1].lower().removesuffix("hz"))
            if value > 0 and word in RATES | INTERVALS and rate is None:
                rate, where = value if word in RATES else 1 / value, f"the file's {printable(title)}"
    if rate is None:
        text = f"how fast was {bundle.name} sampled, such as '1 kHz', or 'none' of quasi-static samples?"
        dialogue.ask("rate", text, None)
        return None
    channels["rate"] = toml_string(f"{rate:.9g} Hz") + f"  # {where}"
    return rate


def find_frequency(angle: Array, moment: Array, rate: float, name: str) -> float | None:
    """Return the frequency of a sinusoidal excitation, Hz; None for an aperiodic run.

    A frequency in the file's name counts where the spectrum agrees; a frequency of the spectrum is rounded to what its
    resolution can show.
    """
    if angle.size < MINIMUM_SAMPLES:
        return None
    abscissa = np.linspace(-1, 1, angle.size)
    # Slow drift is no excitation.
    signals = [x - np.polyval(np.polyfit(abscissa, x, 3), abscissa) for x in (angle, moment)]
    signals = [x for x in signals if np.ptp(x) > 0]
    # A free decay has a frequency of its own, and none that drives it.
    if not signals or decays(angle):
        return None
    found = main_frequency(signals[0], rate, between_bins=True)
    named = _HERTZ.search(name)
    if named:
        stated = float(re.sub("[,p]", ".", named[1]))
        if _holds(stated, angle, moment, rate) and stated * angle.size / rate >= SHARED.fewest:
            return stated
    periods = found * angle.size / rate
    if periods < SHARED.fewest or not _holds(found, angle, moment, rate):
        return None
    # The power of what changes from one period to the next, relative to that of the signal.
    at = np.arange(angle.size)
    later = at + rate / found
    inside = later <= at[-1]
    changed = np.mean((np.interp(later[inside], at, signals[0]) - signals[0][inside]) ** 2)
    if changed / (2 * np.var(signals[0])) > REPEATS:
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
        for column in bundle.columns:
            if column.role not in ("time", "counter"):
                found[column.title].append((float(np.mean(column.values)), float(np.std(column.values))))
        for title, value in bundle.scalars:
            found[title].append((value, 0.0))
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
        stated = column.unit if column is not None else (unit_in_name(title) or ("",))[0]
        name = re.sub(r"\W+", "_", re.sub(r"[\[({].*", "", title)).strip("_")
        key = toml_string(title if column is None else column.key)
        lines.append(f"{name} = {{ column = {key}, unit = {toml_string(WARM.get(stated, stated) or '1')} }}")
    return ["", "[inputs]", *lines] if lines else []
