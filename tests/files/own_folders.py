"""Folders of a stranger's files: recorders' exports, sheets and files of channels, one table of all runs.

As those of ``odd_folders``, a writer fills a folder and returns what a person must answer where the files do not tell.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from odd_folders import files, rows

from sindyjoint.record import Campaign

END = "***End_of_Header***"


def sheets_of_channels(folder: Path, truth: Campaign) -> dict[str, str]:
    """A workbook for each run: a sheet of notes, then one for each channel with its own time."""
    openpyxl = pytest.importorskip("openpyxl")
    for name, run in files(truth):
        book = openpyxl.Workbook(write_only=True)
        notes = book.create_sheet("Info")
        for row in (["Specimen", 7], ["Sampling rate [Hz]", run.sample_rate], ["Operator", "K."]):
            notes.append(row)
        for title, values in (("Torque [N*m]", run.moment), ("Angle [mrad]", 1e3 * run.angle)):
            sheet = book.create_sheet(title.split()[0])
            sheet.append(["Time [s]", title])
            for row in np.column_stack([run.time, values]).tolist():
                sheet.append(row)
        book.save(folder / f"{name}.xlsx")
    return {}


def structs_v73(folder: Path, truth: Campaign) -> dict[str, str]:
    """MATLAB v7.3: nested structs of values and unit, and the rate."""
    h5py = pytest.importorskip("h5py")
    for name, run in files(truth):
        buffer = io.BytesIO()
        with h5py.File(buffer, "w", userblock_size=512) as file:
            for title, unit, values in (
                ("torque", "Nm", run.moment),
                ("angle", "deg", np.degrees(run.angle)),
            ):
                file[f"rec/{title}/values"] = values[None, :]
                file[f"rec/{title}/unit"] = np.array([[ord(letter)] for letter in unit], "u2")
                file[f"rec/{title}/unit"].attrs["MATLAB_class"] = np.bytes_("char")
            file["rec/Fs"] = [[run.sample_rate]]
        data = bytearray(buffer.getvalue())
        head = b"MATLAB 7.3 MAT-file, Platform: PCWIN64"
        data[: len(head)] = head
        (folder / f"{name}.mat").write_bytes(bytes(data))
    return {}


def channel_files(folder: Path, truth: Campaign) -> dict[str, str]:
    """A folder for each run, with a file of bare numbers for each channel and for the time."""
    for name, run in files(truth):
        (folder / name).mkdir()
        for title, values in (("time_s", run.time), ("moment_Nm", run.moment), ("angle_rad", run.angle)):
            (folder / name / f"{title}.txt").write_text(rows([values], ","))
    return {}


def dewesoft(folder: Path, truth: Campaign) -> dict[str, str]:
    """Dewesoft's text: lines above, decimal commas, °C beside, Latin-1."""
    for name, run in files(truth):
        head = f"File name: {name}.dxd\nStart time: 11/20/2026 10:11:11.345\nSample rate: {run.sample_rate:g}\n\n\n"
        columns = [run.time, run.moment, np.degrees(run.angle), 22 + 0.01 * np.sin(run.time)]
        text = head + "Data1\nTime (s)\tMz (Nm)\tPhi (deg)\tT_amb (°C)\n" + rows(columns, "\t", comma=True)
        (folder / f"{name}.txt").write_bytes(text.encode("latin-1"))
    return {}


def imc(folder: Path, truth: Campaign) -> dict[str, str]:
    """imc's CSV: comment lines, decimal commas, a row of units, a semicolon at each line's end; a joint that slides."""
    for name, run in files(truth):
        body = rows([run.time, run.moment / 1e3, 1e3 * run.angle, [""] * run.n_samples], ";", comma=True)
        text = "// imc STUDIO\n// Prüfling 3\nZeit;Kraft;Weg\ns;kN;mm\n" + body
        (folder / f"{name}.csv").write_bytes(text.encode("cp1252"))
    return {}


def lvm_commas(folder: Path, truth: Campaign) -> dict[str, str]:
    """LabVIEW measurement files with a time column, decimal commas and a supply voltage."""
    for name, run in files(truth):
        n = run.n_samples
        lines = ["LabVIEW Measurement", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t,"]
        lines += [
            "X_Columns\tOne",
            END,
            "",
            "Channels\t3\t\t\t",
            f"Samples\t{n}\t{n}\t{n}",
            "Delta_X\t0,002\t0,002\t0,002",
        ]
        lines += [f"{END}\t\t\t", "X_Value\tTorque_Nm\tAngle_mrad\tSupply_V\tComment"]
        body = rows([run.time, run.moment, 1e3 * run.angle, [24.01] * n], "\t", comma=True)
        (folder / f"{name}.lvm").write_text("\n".join(lines) + "\n" + body)
    return {}


def parquet_long(folder: Path, truth: Campaign) -> dict[str, str]:
    """One Parquet table of all runs, told apart by a column of their names."""
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    runs = files(truth)
    columns = {
        "run_id": np.concatenate([[name] * run.n_samples for name, run in runs]),
        "time_s": np.concatenate([run.time for _, run in runs]),
        "torque_Nm": np.concatenate([run.moment for _, run in runs]),
        "angle_rad": np.concatenate([run.angle for _, run in runs]),
    }
    pq.write_table(pa.table(columns), folder / "all.parquet")
    return {}


def pounds_and_noon(folder: Path, truth: Campaign) -> dict[str, str]:
    """US style: lbf·in, degrees, dates with AM and PM across noon, and °F."""
    for name, run in files(truth):
        seconds = 11 * 3600 + 59 * 60 + 58 + run.time
        hours = [(int(s // 3600) - 1) % 12 + 1 for s in seconds]
        stamps = [
            f"11/20/2026 {hour:02d}:{int(s // 60) % 60:02d}:{s % 60:06.3f} {'AM' if s < 43200 else 'PM'}"
            for hour, s in zip(hours, seconds, strict=True)
        ]
        pounds = run.moment / (4.4482216152605 * 0.0254)
        head = "Test Lab,ACME\nSpecimen,hinge 7\n\nDate/Time,Torque (lbf·in),Rotation (deg),Temp (F)\n"
        columns = [stamps, pounds, np.degrees(run.angle), [71.2] * run.n_samples]
        (folder / f"{name}.csv").write_text(head + rows(columns, ","))
    return {}


def calibration_sheet(folder: Path, truth: Campaign) -> dict[str, str]:
    """Counts of both channels, and a sheet with their calibration that a person reads."""
    for name, run in files(truth):
        columns = [run.time, run.moment / 5e-9, run.angle / 2e-12]
        (folder / f"{name}.csv").write_text("t_s,torque_adc_counts,angle_enc_counts\n" + rows(columns, ","))
    text = "channel,gain,unit\ntorque_adc_counts,5e-9,N*m\nangle_enc_counts,2e-12,rad\n"
    (folder / "calibration.csv").write_text(text)
    return {"moment.gain": "5e-9 N*m/count", "angle.gain": "2e-12 rad/count"}


def tidy_rows(folder: Path, truth: Campaign) -> dict[str, str]:
    """A table as pandas melts it: in each row the run, an instant, the name of a channel, its value and its unit."""
    lines = ["run;time_s;channel;value;unit"]
    for name, run in files(truth):
        for title, unit, values in (("Torque", "N*m", run.moment), ("Angle", "mrad", 1e3 * run.angle)):
            columns = [
                [name] * run.n_samples,
                run.time,
                [title] * run.n_samples,
                values,
                [unit] * run.n_samples,
            ]
            lines.append(rows(columns, ";", comma=True).rstrip())
    (folder / "all.csv").write_text("\n".join(lines) + "\n")
    return {}


def decays_below(folder: Path, truth: Campaign) -> dict[str, str]:
    """Three free decays of one column pair, one below the other, blank lines between: 9 Hz, 2 % of critical damping."""
    rng, turn, parts = np.random.default_rng(3), 2 * np.pi * 9.0, []
    for size in (4.0, 6.0, 8.0):
        time = np.arange(0, 3, 1e-3)
        angle = size * np.exp(-0.02 * turn * time) * np.cos(turn * np.sqrt(1 - 0.02**2) * time)
        parts.append(rows([time, angle + 5e-3 * size * rng.standard_normal(time.size)], ";"))
    (folder / "decays.csv").write_text("t [s];phi [deg]\n" + "\n".join(parts))
    return {"moment": "0 N*m"}


OWN: list[Callable[[Path, Campaign], dict[str, str]]] = [
    sheets_of_channels,
    structs_v73,
    channel_files,
    dewesoft,
    imc,
    lvm_commas,
    parquet_long,
    pounds_and_noon,
    calibration_sheet,
    tidy_rows,
]
