"""Writing a campaign so that :func:`~sindyjoint.files.load_campaign` gives it back."""

import io
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.errors import refuse
from sindyjoint.files.atomic import output_folder
from sindyjoint.files.channels import KEYS
from sindyjoint.files.manifest import MANIFEST_NAME
from sindyjoint.files.readers import SIMULATED, library
from sindyjoint.inputs import Input
from sindyjoint.record import Campaign, Joint, Motion, Run
from sindyjoint.rig import SensorRig

Columns = Mapping[str, NDArray[np.float64]]

# What stands in every file of a virtual test, so that no one takes it for a measured one.
REMARK = f"{SIMULATED}; columns in SI units"

# Units as they are written, by motion and key: moment, angle, measured rate, inertia.
UNITS = {
    motion: {key: unit.replace("**", "^") for key, unit in keys.values()} for motion, keys in KEYS.items()
}


def write_campaign(
    campaign: Campaign,
    folder: str | os.PathLike[str],
    format: str = "csv",
    rig: SensorRig | None = None,
    raw: Sequence[Columns] | None = None,
    force: bool = False,
) -> Path:
    """Write ``campaign.toml`` and one file per run, all of them or none.

    Parameters
    ----------
    campaign : Campaign
    folder : path-like
        Made where it is missing; a campaign that was written there is replaced.
    format : {"csv", "tsv", "npz", "parquet", "h5", "mat"}
        Of the run files. All of them hold every bit of the numbers.
    rig : SensorRig, optional
        Write four strains and three displacements (Eqs. 1–3 backwards) instead of moment and angle.
    raw : sequence of mapping, optional
        Channels ``e1`` to ``e4``, m/m, and ``d1`` to ``d3``, m, of each run as they were measured; written
        instead of those that Eqs. 1–3 backwards would give. Needs `rig`.
    force : bool
        Replace files of the same names that were not written so, or were changed since.

    Returns
    -------
    Path
        The manifest.

    Raises
    ------
    InputError
        For an unknown format, or a rig for a translational joint.
    OutputError
        When the folder cannot be written, or holds other files of these names.
    MissingExtraError
        When the format needs a library that is not installed.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[4], levels=[0.5], duration=1.0, rng=0)
    >>> path = sindyjoint.write_campaign(test, "tests", "npz")
    >>> sindyjoint.load_campaign("tests").simulated
    True
    """
    constant = any(np.ptp(run.moment) == 0 for run in campaign.runs)
    sets = 0 if raw is None else len(raw)
    refuse(
        [
            (format not in ENCODERS, f"format is {format!r}; expected one of {', '.join(ENCODERS)}"),
            (
                rig is not None and campaign.joint.motion != "rotation",
                "a rig of strain gauges and lasers was given for a translational joint; leave it out",
            ),
            (
                rig is not None and constant,
                "a rig was given and a run has a constant moment, which no strain gauge shows; leave it out",
            ),
            (
                raw is not None and (rig is None or sets != len(campaign.runs)),
                f"raw channels of {sets} run(s) were given; expected a rig and one set per run",
            ),
        ]
    )
    encode = ENCODERS[format]
    files = _file_names([run.name for run in campaign.runs], format)
    with output_folder(folder, "campaign", force=force) as stage:
        for number, (run, file) in enumerate(zip(campaign.runs, files, strict=True)):
            columns = _columns(run, campaign.joint, rig) | dict(raw[number] if raw is not None else {})
            (stage / file).write_bytes(encode(columns, REMARK if campaign.simulated else ""))
        (stage / MANIFEST_NAME).write_text(_manifest(campaign, files, rig), encoding="utf-8", newline="\n")
    return Path(folder) / MANIFEST_NAME


def _columns(run: Run, joint: Joint, rig: SensorRig | None) -> dict[str, NDArray[np.float64]]:
    """Return what one run file holds, in SI units."""
    moment, angle, rate, *_ = UNITS[joint.motion]
    columns = {"time": run.time}
    if run.fusion is not None and rig is None:
        columns |= {moment: run.moment + run.fusion.constant, "acceleration": run.fusion.acceleration}
        beside = {angle: run.fusion.angle, rate: run.fusion.rate}
        columns |= {name: values for name, values in beside.items() if values is not None}
    elif rig is None:
        columns |= {moment: run.moment, angle: run.angle}
    else:
        gauges = {"e": rig.strains(run.moment), "d": rig.displacements(run.angle)}
        columns |= {f"{kind}{n}": x for kind, own in gauges.items() for n, x in enumerate(own, start=1)}
    if run.rate is not None:
        columns[rate] = run.rate
    return columns | {name: values for name, values in run.inputs.items() if np.ptp(values) > 0}


def _file_names(names: list[str], format: str) -> list[str]:
    """Return one harmless file name per run name, no two alike even where case does not count."""
    taken: dict[str, str] = {}
    for name in names:
        clean = re.sub(r"[^\w.+=-]+", "-", name).strip(".-")
        # File systems count bytes.
        stem = clean.encode()[:100].decode(errors="ignore") or "run"
        ways = chain([stem], (f"{stem}-{number}" for number in count(2)))
        free = next(way for way in ways if way.lower() not in taken)
        taken[free.lower()] = f"{free}.{format}"
    return list(taken.values())


def _manifest(campaign: Campaign, files: list[str], rig: SensorRig | None) -> str:
    """Return the text of ``campaign.toml`` for runs written in SI units under the given file names."""
    joint, units = campaign.joint, UNITS[campaign.joint.motion]
    inertia = list(units)[3]
    head = {
        "simulated": campaign.simulated or None,
        "notes": list(campaign.notes) or None,
        "guessed": list(campaign.guessed) or None,
    }
    stated = {
        "name": joint.name,
        "motion": joint.motion,
        inertia: _quantity(joint.inertia, units[inertia]),
        "temperature": _quantity(joint.temperature, "K"),
        "serial": joint.serial,
        "labels": {toml_value(key): value for key, value in joint.labels.items()} or None,
    }
    channels = [_channels_of(run, joint.motion, rig, campaign.gain_uncertainty) for run in campaign.runs]
    runs = []
    for run, file in zip(campaign.runs, files, strict=True):
        held = [(each, run.inputs[each.name]) for each in campaign.inputs]
        entry = {
            "file": file,
            "name": run.name,
            "frequency": None if run.frequency is None else float(run.frequency),
            "level": run.level,
            "use": run.use,
            "inputs": {each.name: _number(each, v[0]) for each, v in held if np.ptp(v) == 0} or None,
        }
        runs.append(toml_pairs(entry))
    raw = rig and {
        "strain": ["e1", "e2", "e3", "e4"],
        "strain_unit": "m/m",
        "displacement": ["d1", "d2", "d3"],
        "displacement_unit": "m",
        "bending_stiffness": _quantity(rig.bending_stiffness, "N*m^2"),
        "section_height": _quantity(rig.section_height, "m"),
        "strain_position_factor": float(rig.strain_position_factor),
        "joint_length": _quantity(rig.joint_length, "m"),
    }
    keys = {name: key for name, (key, _) in KEYS[joint.motion].items()}
    limits = {keys[name]: _quantity(value, units[keys[name]]) for name, value in campaign.limits.items()}
    tables: dict[str, Any] = {"inputs": _inputs_of(campaign), "limits": limits, "rig": raw}
    lines = [f for title, own in tables.items() if own for f in ("", f"[{title}]", *toml_pairs(own))]
    skew = {"skew_removed": _quantity(campaign.skew, "s")}
    return manifest_text(toml_pairs(head), toml_pairs(stated), channels, runs, [*toml_pairs(skew), *lines])


def manifest_text(
    head: Sequence[str],
    joint: Sequence[str],
    channels: Sequence[Mapping[str, str]],
    runs: Sequence[Sequence[str]],
    tables: Sequence[str] = (),
    tail: Sequence[str] = (),
) -> str:
    """Return the text of ``campaign.toml``: what the channels of all runs share stands once, all else with each run.

    Parameters
    ----------
    head, joint : sequence of str
        Lines above the first table, and of ``[joint]``.
    channels : sequence of mapping of str to str
        Of each run, by key, as TOML.
    runs : sequence of sequence of str
        Lines of each ``[[run]]``.
    tables, tail : sequence of str
        Lines between ``[channels]`` and the runs, and at the end.
    """
    shared = {key: text for key, text in channels[0].items() if all(own.get(key) == text for own in channels)}
    lines = [*head, "", "[joint]", *joint, "", "[channels]", *_lines(shared), *tables]
    for run, own in zip(runs, channels, strict=True):
        particular = _lines({key: text for key, text in own.items() if key not in shared})
        lines += ["", "[[run]]", *run, *(["[run.channels]", *particular] if particular else [])]
    return "\n".join([*lines, *tail]).lstrip("\n") + "\n"


def _lines(texts: Mapping[str, str]) -> list[str]:
    return [f"{key} = {text}" for key, text in texts.items()]


def toml_value(item: Any) -> str:
    """Return text, a number, a list or a table as TOML, in a line.

    JSON's escapes are TOML's but for DEL; an unpaired surrogate is no text.
    """
    if isinstance(item, Mapping):
        return f"{{ {', '.join(toml_pairs(item))} }}"
    text = json.dumps(item, ensure_ascii=False).encode("utf-8", errors="replace").decode("utf-8")
    return text.replace("\x7f", "\\u007f")


def toml_pairs(table: Mapping[str, Any]) -> list[str]:
    """Return the lines of a table without those of None."""
    return _lines({key: toml_value(item) for key, item in table.items() if item is not None})


def _inputs_of(campaign: Campaign) -> dict[str, dict[str, Any]]:
    """Return ``[inputs]``: what changes along a run is a column of its file, in SI; all else stands with the runs."""
    tables = {}
    for each in campaign.inputs:
        column = any(np.ptp(run.inputs[each.name]) > 0 for run in campaign.runs)
        tables[each.name] = {
            "column": each.name if column else None,
            "unit": each.unit if column else each.shown_unit,
            "reference": _number(each, each.reference),
            "name": each.label,
        }
    return tables


def _number(each: Input, value: float) -> float | str | None:
    return float(value) if each.unit == "1" else _quantity(value, each.unit)


def _channels_of(
    run: Run, motion: Motion, rig: SensorRig | None, gains: Mapping[str, float]
) -> dict[str, str]:
    """Return the ``[channels]`` entries of one run as TOML text."""
    channels: dict[str, Any] = {"rate": _quantity(run.sample_rate, "Hz")}
    fusion = run.fusion if rig is None else None
    measured = {
        "moment": True,
        "angle": fusion is None or fusion.angle is not None,
        "acceleration": fusion is not None,
        "rate": run.rate is not None or (run.fusion is not None and run.fusion.rate is not None),
    }
    for quantity in (name for name, there in measured.items() if there):
        key, unit = KEYS[motion][quantity][0], UNITS[motion][KEYS[motion][quantity][0]]
        columned = rig is None or quantity == "rate"
        # An accelerometer alone has the gain of the angle.
        alone = quantity == "acceleration" and not measured["angle"]
        channels[key] = {
            "column": key if columned else None,
            "unit": unit if columned else None,
            "noise": _quantity(getattr(run.noise, quantity), unit),
            "gain_uncertainty": gains.get("angle" if alone else quantity),
        }
        # A moment that never changes, as in a free decay, is declared: a constant column is a dead channel.
        if quantity == "moment" and columned and np.ptp(run.moment) == 0:
            channels[key] = {"constant": _quantity(run.moment[0], unit)}
    texts = {key: toml_value(entry) for key, entry in channels.items()}
    return {key: text for key, text in texts.items() if text != toml_value({})}


def _quantity(value: float | None, unit: str) -> str | None:
    """Return a quantity with every digit that its float64 holds."""
    return None if value is None else f"{float(value)!r} {unit}"


def _text(columns: Columns, remark: str, delimiter: str) -> bytes:
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    # repr of a float is the shortest text that reads back to the same bits.
    top = [f"# {remark}"] if remark else []
    lines = [*top, delimiter.join(columns), *(delimiter.join(map(repr, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode("utf-8")


def _npz(columns: Columns, remark: str) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **columns, **_remarked(remark))
    return buffer.getvalue()


def _remarked(remark: str) -> dict[str, NDArray[Any]]:
    return {"remark": np.array(remark)} if remark else {}


def _mat(columns: Columns, remark: str) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, dict(columns) | _remarked(remark), oned_as="column")
    return buffer.getvalue()


def _parquet(columns: Columns, remark: str) -> bytes:
    arrow, parquet = library("writing", "pyarrow"), library("writing", "pyarrow.parquet", "pyarrow")
    buffer = io.BytesIO()
    table = arrow.table(dict(columns))
    parquet.write_table(table.replace_schema_metadata({"remark": remark}) if remark else table, buffer)
    return buffer.getvalue()


def _hdf5(columns: Columns, remark: str) -> bytes:
    buffer = io.BytesIO()
    with library("writing", "h5py").File(buffer, "w") as file:
        if remark:
            file.attrs["remark"] = remark
        for name, values in columns.items():
            file[name] = values
    return buffer.getvalue()


ENCODERS: dict[str, Callable[[Columns, str], bytes]] = {
    "csv": lambda columns, remark: _text(columns, remark, ","),
    "tsv": lambda columns, remark: _text(columns, remark, "\t"),
    "npz": _npz,
    "parquet": _parquet,
    "h5": _hdf5,
    "mat": _mat,
}
