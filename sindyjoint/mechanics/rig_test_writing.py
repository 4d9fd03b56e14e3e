"""A virtual test of a structure written as files, with the ``rig.toml`` that describes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.documents import read_toml
from sindyjoint.errors import InputError
from sindyjoint.files.atomic import output_folder
from sindyjoint.files.writers import ENCODERS, REMARK
from sindyjoint.mechanics.rig_file import RigFile, rig_path
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.rig_test_file import SIMULATED_KEY
from sindyjoint.mechanics.rigs import UNITS


def write_rig_test(
    rig: str | Path, test: RigTest, folder: str | Path, format: str = "csv", force: bool = False
) -> Path:
    """Write the runs of a virtual test and a ``rig.toml`` that describes them; the laws of the joints are not in it.

    Parameters
    ----------
    rig : str or Path
        Of which the test was made: the file's other tables stay as they are.
    test : RigTest
        With runs.
    folder : path
    format : {"csv", "tsv", "npz", "parquet", "h5", "mat"}
    force : bool
        Replace files that are no such test.
    """
    if format not in ENCODERS:
        raise InputError(f"format is {format!r}; expected one of {', '.join(ENCODERS)}")
    path = rig_path(rig)
    document = read_toml(path)
    given = RigFile.model_validate(document)
    for part, table in zip(document["chain"], given.chain, strict=True):
        if table.joint is not None:
            own = table.joint if table.law in ("model", "unknown") else table.law
            part |= {"law": "unknown", "kind": table.kind or own}
    document["loss_frequency"] = f"{test.structure.loss_frequency!r} Hz"
    document["time"] = {"column": "time", "unit": "s"}
    drive = document.setdefault("drive", {})
    drive |= {"column": "drive", "unit": UNITS[given.drive.quantity].replace("**", "^")}
    for table, sensor in zip(document["sensor"], given.sensor, strict=True):
        table |= {"unit": UNITS[sensor.quantity].replace("**", "^")}
    for key in ("pulse", "output", "recorder", "measured"):
        document.pop(key, None)
    files = {run.name: f"{_file_name(run.name)}-{SIMULATED_KEY}.{format}" for run in test.runs}
    document["run"] = [
        {"file": files[run.name], "name": run.name, "use": run.use}
        | ({"frequency": f"{run.frequency!r} Hz"} if run.frequency is not None else {})
        | ({"level": run.level} if run.level is not None else {})
        for run in test.runs
    ]
    with output_folder(folder, "rig-test", force=force) as stage:
        for run in test.runs:
            time = np.arange(run.drive.size) / run.sample_rate
            columns = {"time": time, "drive": run.drive}
            columns |= {
                sensor.name: signal for sensor, signal in zip(test.sensors, run.responses, strict=True)
            }
            (stage / files[run.name]).write_bytes(ENCODERS[format](columns, REMARK))
        (stage / "rig.toml").write_text(_toml(document), encoding="utf-8", newline="\n")
    return Path(folder) / "rig.toml"


def _file_name(name: str) -> str:
    return "".join(c if c.isalnum() or c in "._-" else "-" for c in name)


def _toml(document: Mapping[str, Any]) -> str:
    """Return a document of plain values, tables and lists of tables as TOML; JSON's strings and lists are TOML's."""

    def value(item: Any) -> str:
        if isinstance(item, dict):
            return "{ " + ", ".join(f"{key} = {value(inner)}" for key, inner in item.items()) + " }"
        return json.dumps(item, ensure_ascii=False)

    lines, tables = [], []
    for key, item in document.items():
        entries: Sequence[Any] = (
            item if isinstance(item, list) and item and isinstance(item[0], dict) else [item]
        )
        if isinstance(entries[0], dict):
            head = f"[[{key}]]" if isinstance(item, list) else f"[{key}]"
            for entry in entries:
                tables += ["", head, *(f"{name} = {value(inner)}" for name, inner in entry.items())]
        else:
            lines.append(f"{key} = {value(item)}")
    return "\n".join([*lines, *tables, ""])
