"""Folders of run files as laboratories leave them; each writer gives one campaign in one odd form.

A writer fills a folder and returns what a person must answer, in ``answers``, where the files do not tell.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from sindyjoint import simulate
from sindyjoint.record import Campaign, Run

FREQUENCIES, LEVELS, RATE, DURATION = (3.0, 5.0), (0.4, 0.7, 0.9), 500.0, 4.0


def campaign() -> Campaign:
    """Return the measured truth of all folders: a virtual test of the inter-panel joint, 1 % noise, seed 0."""
    return simulate(
        "inter-panel",
        frequencies=FREQUENCIES,
        levels=LEVELS,
        sample_rate=RATE,
        duration=DURATION,
        noise=0.01,
        random_state=0,
    )


def rows(columns: Sequence[Sequence[object]], delimiter: str, comma: bool = False) -> str:
    text = "\n".join(delimiter.join(str(value) for value in row) for row in zip(*columns, strict=True)) + "\n"
    return text.replace(".", ",") if comma else text


def files(truth: Campaign) -> list[tuple[str, Run]]:
    """Return a name without ending for each run, with its frequency but nothing about the level."""
    return [(f"test{number:02d}", run) for number, run in enumerate(truth.runs, start=1)]


def german_semicolons(folder: Path, truth: Campaign) -> dict[str, str]:
    """Semicolons, decimal commas, a header block and German names, in Latin-1."""
    for name, run in files(truth):
        head = "Prüfstand;4\nPrüfer;K. Weiß\nDatum;3.5.2024\n\nZeit;Drehmoment;Winkel\ns;Nm;mrad\n"
        body = rows([run.time.tolist(), run.moment.tolist(), (1e3 * run.angle).tolist()], ";", comma=True)
        (folder / f"{name}.csv").write_bytes((head + body).encode("latin-1"))
    return {}


def nameless_columns(folder: Path, truth: Campaign) -> dict[str, str]:
    """Columns of numbers without a line above them."""
    for name, run in files(truth):
        np.savetxt(folder / f"{name}.txt", np.column_stack([run.time, run.moment, run.angle]), fmt="%.12e")
    return {"motion": "rotation", "moment": "2", "angle": "3", "moment.unit": "N*m", "angle.unit": "rad"}


def clock_stamps(folder: Path, truth: Campaign) -> dict[str, str]:
    """Clock times across midnight, and degrees."""
    for name, run in files(truth):
        seconds = 59.0 + run.time
        stamps = [f"23:{58 + int(s // 60):02d}:{s % 60:06.3f}" for s in seconds]
        text = "clock,torque (N*m),theta (deg)\n" + rows([stamps, run.moment, np.degrees(run.angle)], ",")
        (folder / f"{name}.csv").write_text(text)
    return {}


def iso_stamps(folder: Path, truth: Campaign) -> dict[str, str]:
    """ISO time stamps, tabs, and a column of words."""
    for name, run in files(truth):
        stamps = [
            str(np.datetime64("2024-05-01T12:00:00.000") + np.timedelta64(int(round(1e3 * t)), "ms"))
            for t in run.time
        ]
        text = "timestamp\ttorque_Nm\tangle_mrad\tremark\n"
        (folder / f"{name}.tsv").write_text(
            text + rows([stamps, run.moment, 1e3 * run.angle, ["ok"] * run.n_samples], "\t")
        )
    return {}


def workbook(folder: Path, truth: Campaign) -> dict[str, str]:
    """An Excel workbook with a header block, milliseconds and a row of units."""
    import openpyxl

    for name, run in files(truth):
        book = openpyxl.Workbook()
        sheet = book.active
        sheet.append(["Joint test", None, name])
        sheet.append([])
        sheet.append(["Time", "Moment", "Angle"])
        sheet.append(["ms", "N*m", "µrad"])
        for row in zip(1e3 * run.time, run.moment, 1e6 * run.angle, strict=True):
            sheet.append([float(value) for value in row])
        book.save(folder / f"{name}.xlsx")
    return {}


def labview(folder: Path, truth: Campaign) -> dict[str, str]:
    """LabVIEW measurement files without a time column."""
    end = "***End_of_Header***"
    for name, run in files(truth):
        n, step = run.n_samples, 1 / run.sample_rate
        lines = [
            "LabVIEW Measurement\t",
            "Writer_Version\t2",
            "Separator\tTab",
            "Decimal_Separator\t.",
            "X_Columns\tNo",
        ]
        lines += ["Operator\tK", "Date\t2024/05/01", "Time\t12:00:00.5", f"{end}\t", "\t", "Channels\t2\t\t"]
        lines += [
            f"Samples\t{n}\t{n}\t",
            "Y_Unit_Label\tN*m\tmrad\t",
            "X0\t0\t0\t",
            f"Delta_X\t{step}\t{step}\t",
        ]
        lines += [f"{end}\t\t\t", "X_Value\tTorque\tAngle\tComment"]
        lines += [
            f"\t{m!r}\t{a!r}" for m, a in zip(run.moment.tolist(), (1e3 * run.angle).tolist(), strict=True)
        ]
        (folder / f"{name}.lvm").write_text("\n".join(lines) + "\n")
    return {}


def catman_asc(folder: Path, truth: Campaign) -> dict[str, str]:
    """Tabs below a header block with the sampling rate."""
    for name, run in files(truth):
        head = f"Messung {name}\nAbtastrate: {run.sample_rate:g} Hz\n\nMoment [N*m]\tWinkel [mrad]\n"
        (folder / f"{name}.asc").write_bytes(
            (head + rows([run.moment, 1e3 * run.angle], "\t")).encode("latin-1")
        )
    return {}


def json_columns(folder: Path, truth: Campaign) -> dict[str, str]:
    """JSON with nested lists; the unit of the moment stands nowhere."""
    for name, run in files(truth):
        record = {"rig": "4", "channels": {"time": run.time.tolist(), "torque": run.moment.tolist()}}
        record["channels"]["angle [mrad]"] = (1e3 * run.angle).tolist()
        (folder / f"{name}.json").write_text(json.dumps(record))
    return {"moment.unit": "N*m"}


def separate_files(folder: Path, truth: Campaign) -> dict[str, str]:
    """Moment and angle of each run in two files."""
    for name, run in files(truth):
        (folder / f"{name}_torque.csv").write_text("t,value [N*m]\n" + rows([run.time, run.moment], ","))
        (folder / f"{name}_angle.csv").write_text("t,value [mrad]\n" + rows([run.time, 1e3 * run.angle], ","))
    return {}


def volts(folder: Path, truth: Campaign) -> dict[str, str]:
    """Both channels in volts."""
    for name, run in files(truth):
        text = "time,torque [V],angle [V]\n" + rows([run.time, run.moment / 5, run.angle / 2e-3], ",")
        (folder / f"{name}.csv").write_text(text)
    return {"moment.gain": "5 N*m/V", "angle.gain": "2 mrad/V"}


def two_set_ups(folder: Path, truth: Campaign) -> dict[str, str]:
    """Two days with other names and units, a note and a damaged file among them."""
    (folder / "README.txt").write_text("Two days of tests.\nThe second day the amplifier was changed.\n")
    (folder / "broken.csv").write_bytes(bytes(range(256)))
    for number, (name, run) in enumerate(files(truth)):
        if number % 2:
            text = "T_ms;M_kNm;phi_deg\n" + rows(
                [1e3 * run.time, run.moment / 1e3, np.degrees(run.angle)], ";"
            )
        else:
            text = "time (s);moment (N*m);angle (rad);room (degC)\n"
            text += rows([run.time, run.moment, run.angle, [21.0] * run.n_samples], ";")
        (folder / f"{name}.dat").write_text(text)
    return {}


def irregular_stamps(folder: Path, truth: Campaign) -> dict[str, str]:
    """Write stamps of whole milliseconds at 500 Hz that stand still now and then: nobody can use them."""
    for name, run in files(truth):
        stamps = np.floor(run.time * 100) / 100
        (folder / f"{name}.csv").write_text(
            "t [s],torque [N*m],angle [mrad]\n" + rows([stamps, run.moment, 1e3 * run.angle], ",")
        )
    return {"rate": "500 Hz"}


ODD: list[Callable[[Path, Campaign], dict[str, str]]] = [
    german_semicolons,
    nameless_columns,
    clock_stamps,
    iso_stamps,
    workbook,
    labview,
    catman_asc,
    json_columns,
    separate_files,
    volts,
    two_set_ups,
    irregular_stamps,
]
