"""How fast a run was sampled: by its time stamps, by what its file states, or by what a person says."""

from __future__ import annotations

import json
import re

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.files.drafting.bundles import Bundle, Column
from sindyjoint.files.drafting.dialogue import Dialogue
from sindyjoint.files.timeaxis import LONGEST_GAP, check_order, uniform_rate
from sindyjoint.files.units import conversion, parse_quantity
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
# Stamps this far apart, in seconds, are rather milliseconds.
COARSE = 0.5


def draft_time(
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
    """Write the sampling rate that the file states above or beside its columns, or that was asked for."""
    remarks = "\n".join(bundle.remarks)
    stated, step = _RATE.search(remarks), _STEP.search(remarks)
    where = "stated above the columns"
    if stated:
        rate = float(stated[1].replace(",", ".")) * (1000 if stated[2] else 1)
    elif step:
        rate = 1 / (float(step[1].replace(",", ".")) * _SECONDS[step[2].lower()])
    elif (found := _rate_beside(bundle)) is not None:
        title, rate = found
        where = f"the file's {printable(title)}"
    else:
        dialogue.ask(
            "rate",
            f"how fast was {bundle.name} sampled, such as '1 kHz', or 'none' of quasi-static samples?",
            None,
        )
        return None
    channels["rate"] = quote(f"{rate:.9g} Hz") + f"  # {where}"
    return rate


def _rate_beside(bundle: Bundle) -> tuple[str, float] | None:
    """Return the single number beside the columns that is a rate, Hz, or an interval, s, and the rate, Hz."""
    for file in bundle.files:
        for title, value in file.scalars.items():
            word = re.sub(r"[^a-z]", "", re.split(r"[./]", title)[-1].lower().removesuffix("hz"))
            if value > 0 and word in RATES:
                return title, value
            if value > 0 and word in INTERVALS:
                return title, 1 / value
    return None


def quote(value: str | int | None) -> str:
    """Return a TOML string or number."""
    return str(value) if isinstance(value, int) else json.dumps(str(value), ensure_ascii=False)
