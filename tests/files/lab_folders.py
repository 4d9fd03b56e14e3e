"""Folders of run files in the formats of measuring programs; each writer gives a campaign in one form.

As those of ``odd_folders``, a writer fills a folder and returns what a person must answer where the files do not tell.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import made_files
import numpy as np
import pytest
from odd_folders import files, rows
from scipy.interpolate import CubicSpline

from sindyjoint.record import Campaign


def mat_structs(folder: Path, truth: Campaign) -> dict[str, str]:
    """MATLAB v5: a struct for each file with a scalar sampling rate, and a constant channel beside."""
    from scipy.io import savemat

    for name, run in files(truth):
        held = {"torque_Nm": run.moment, "theta_deg": np.degrees(run.angle), "fs": run.sample_rate}
        savemat(
            folder / f"{name}.mat",
            {"rec": held | {"supply_V": np.full(run.n_samples, 24.0)}, "note": "bench"},
        )
    return {}


def mat_v73(folder: Path, truth: Campaign) -> dict[str, str]:
    """MATLAB v7.3 with the sampling interval beside the channels."""
    h5py = pytest.importorskip("h5py")
    for name, run in files(truth):
        buffer = io.BytesIO()
        with h5py.File(buffer, "w", userblock_size=512) as file:
            for title, values in (("M_Nm", run.moment), ("phi_mrad", 1e3 * run.angle)):
                file[title] = values[None, :]
            file["dt"] = [[1 / run.sample_rate]]
        data = bytearray(buffer.getvalue())
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
        data[: len(head)] = head
        (folder / f"{name}.mat").write_bytes(bytes(data))
    return {}


def hdf5_groups(folder: Path, truth: Campaign) -> dict[str, str]:
    """One file with a group for each run."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "joint.h5", "w") as file:
        for name, run in files(truth):
            for title, unit, values in (
                ("time", "s", run.time),
                ("moment", "N*m", run.moment),
                ("angle", "rad", run.angle),
            ):
                file[f"{name}/{title}"] = values
                file[f"{name}/{title}"].attrs["unit"] = unit
    return {}


def npz_runs(folder: Path, truth: Campaign) -> dict[str, str]:
    """One archive with all runs, called after their number."""
    arrays: dict[str, object] = {"fs": truth.runs[0].sample_rate}
    for number, run in enumerate(truth.runs, start=1):
        arrays |= {f"torque_Nm_{number}": run.moment, f"angle_urad_{number}": 1e6 * run.angle}
    np.savez_compressed(folder / "all.npz", **arrays)  # type: ignore[arg-type]
    return {"runs": "yes"}


def wide_table(folder: Path, truth: Campaign) -> dict[str, str]:
    """One sheet: the time, then moment and angle of each run, in pairs."""
    columns, titles = [truth.runs[0].time], ["time (s)"]
    for number, run in enumerate(truth.runs, start=1):
        columns += [run.moment, np.degrees(run.angle)]
        titles += [f"run {number} torque (N*m)", f"run {number} angle (deg)"]
    (folder / "all.csv").write_text(",".join(titles) + "\n" + rows(columns, ","))
    return {}


def universal(folder: Path, truth: Campaign) -> dict[str, str]:
    """Universal files (58, binary) with units of their ordinates."""
    pytest.importorskip("pyuff")
    for name, run in files(truth):
        parts = [(run.moment, "Moment", "N*m"), (1e3 * run.angle, "Angle", "mrad")]
        text = b"".join(
            made_files.data_set_58(values, 12, 6, label, binary=True, step=1 / run.sample_rate, unit=unit)
            for values, label, unit in parts
        )
        (folder / f"{name}.uff").write_bytes(text)
    return {}


def tdms(folder: Path, truth: Campaign) -> dict[str, str]:
    """TDMS with LabVIEW's increment and units in properties."""
    nptdms = pytest.importorskip("nptdms")
    for name, run in files(truth):
        clock = {"wf_increment": 1 / run.sample_rate, "wf_start_offset": 0.0}
        channels = [("Torque", "N*m", run.moment), ("Angle", "mrad", 1e3 * run.angle)]
        with nptdms.TdmsWriter(folder / f"{name}.tdms") as writer:
            writer.write_segment(
                [
                    nptdms.ChannelObject("bench", title, values, properties=clock | {"unit_string": unit})
                    for title, unit, values in channels
                ]
            )
    return {}


def parquet(folder: Path, truth: Campaign) -> dict[str, str]:
    """Parquet, a constant temperature among its columns."""
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    for name, run in files(truth):
        columns = {"t_s": run.time, "torque_Nm": run.moment, "theta_mrad": 1e3 * run.angle}
        pq.write_table(pa.table(columns | {"temp_degC": 21 + 0 * run.time}), folder / f"{name}.parquet")
    return {}


def rate_above(folder: Path, truth: Campaign) -> dict[str, str]:
    """Semicolons and a header block with the rate; units in a row of their own."""
    for name, run in files(truth):
        head = f"# rig: bench 4\n# operator: K.\n# sample rate: {run.sample_rate:g} Hz\nM;phi\n[N*m];[mrad]\n"
        (folder / f"{name}.txt").write_text(head + rows([run.moment, 1e3 * run.angle], ";"))
    return {}


def arm_and_stroke(folder: Path, truth: Campaign) -> dict[str, str]:
    """The same joint as one that slides: pounds and millimetres, a command beside the measured stroke."""
    for name, run in files(truth):
        stroke = 1e3 * run.angle
        columns = [run.time, run.moment / 4.4482216152605, np.round(stroke, 3), stroke]
        head = "Time (sec),Load (lbf),Stroke command (mm),Stroke (mm)\n"
        (folder / f"{name}.csv").write_text(head + rows(columns, ","))
    return {}


def runs_below(folder: Path, truth: Campaign) -> dict[str, str]:
    """One table with all runs one below the other, told apart by a column of their numbers; the time begins anew."""
    parts = [
        np.column_stack([np.full(run.n_samples, number), run.time, run.moment, 1e3 * run.angle])
        for number, (_, run) in enumerate(files(truth), start=7)
    ]
    (folder / "all.csv").write_text("test_no,time_s,torque_Nm,theta_mrad\n" + rows(np.vstack(parts).T, ","))
    return {}


def runs_with_pauses(folder: Path, truth: Campaign) -> dict[str, str]:
    """One table with all runs of a day; the clock goes on from one to the next."""
    parts = [
        np.column_stack([number * 41.3 + run.time, run.moment, 1e3 * run.angle])
        for number, (_, run) in enumerate(files(truth))
    ]
    (folder / "day.csv").write_text("time_s,torque_Nm,theta_mrad\n" + rows(np.vstack(parts).T, ","))
    return {}


def sheets(folder: Path, truth: Campaign) -> dict[str, str]:
    """A workbook with a sheet for each run, and one of notes."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook(write_only=True)
    book.create_sheet("notes").append(["bench 4"])
    for name, run in files(truth):
        sheet = book.create_sheet(name)
        sheet.append(["time [s]", "moment [Nm]", "angle [mrad]"])
        for row in np.column_stack([run.time, run.moment, 1e3 * run.angle]).tolist():
            sheet.append(row)
    book.save(folder / "bench.xlsx")
    return {}


def mat_units(folder: Path, truth: Campaign) -> dict[str, str]:
    """MATLAB v5: nested structs, each of values and their unit."""
    from scipy.io import savemat

    for name, run in files(truth):
        channels = {
            "Torque": {"values": run.moment, "unit": "Nm"},
            "Angle": {"values": np.degrees(run.angle), "unit": "deg"},
        }
        savemat(folder / f"{name}.mat", {"data": channels | {"fs": run.sample_rate}})
    return {}


def bench_words(folder: Path, truth: Campaign) -> dict[str, str]:
    """Pound-inches, German degrees, and a speed in revolutions per minute without another name."""
    pounds = 4.4482216152605 * 0.0254
    for name, run in files(truth):
        speed = np.gradient(run.angle, run.time) * 30 / np.pi
        columns = [run.time, run.moment / pounds, np.degrees(run.angle), speed]
        (folder / f"{name}.txt").write_text(
            "Zeit_s\tTorque (lbf-in)\tWinkel_Grad\trpm\n" + rows(columns, "\t")
        )
    return {}


def encoder(folder: Path, truth: Campaign) -> dict[str, str]:
    """Counts of an encoder, which only a gain makes an angle."""
    for name, run in files(truth):
        columns = [run.time, run.moment, run.angle / 1e-8]
        (folder / f"{name}.csv").write_text("time_s,torque_Nm,encoder_counts\n" + rows(columns, ","))
    return {"angle.gain": "1e-8 rad/count"}


def free_swings(folder: Path, truth: Campaign) -> dict[str, str]:
    """Three free decays in degrees without a moment, the rate in a header block: 9 Hz, 2 % of critical damping."""
    rng, turn = np.random.default_rng(3), 2 * np.pi * 9.0
    for number, size in enumerate((4.0, 6.0, 8.0), start=1):
        time = np.arange(0, 3, 1e-3)
        angle = size * np.exp(-0.02 * turn * time) * np.cos(turn * np.sqrt(1 - 0.02**2) * time)
        noisy = angle + 5e-3 * size * rng.standard_normal(time.size)
        head = "Recorder 7\nSampling rate: 1000 Hz\n\ntheta [deg]\n"
        (folder / f"swing{number}.txt").write_text(head + rows([noisy], ","))
    return {"moment": "0 N*m"}


def row_labels(folder: Path, truth: Campaign) -> dict[str, str]:
    """Tables of R: quoted row numbers that no heading names."""
    for name, run in files(truth):
        labels = [f'"{number}"' for number in range(1, run.n_samples + 1)]
        columns = [labels, run.time, run.moment, 1e3 * run.angle]
        (folder / f"{name}.txt").write_text('"t_s" "torque_Nm" "phi_mrad"\n' + rows(columns, " "))
    return {}


def channel_rows(folder: Path, truth: Campaign) -> dict[str, str]:
    """A channel in each row: its name and unit at the left, its samples to the right."""
    for name, run in files(truth):
        columns = [
            ["Time", "s", *run.time],
            ["Torque", "N*m", *run.moment],
            ["Angle", "deg", *np.degrees(run.angle)],
        ]
        (folder / f"{name}.csv").write_text(
            "\n".join(";".join(map(str, column)) for column in columns) + "\n"
        )
    return {}


def names_beside(folder: Path, truth: Campaign) -> dict[str, str]:
    """HDF5 with one matrix that lies; names, units and rate are attributes."""
    h5py = pytest.importorskip("h5py")
    for name, run in files(truth):
        with h5py.File(folder / f"{name}.h5", "w") as file:
            file.attrs.update({"sampling_rate": run.sample_rate, "operator": "K."})
            file["raw"] = np.stack([run.moment, 1e3 * run.angle])
            file["raw"].attrs.update({"channels": np.array(["torque", "angle"], "S9"), "units": "N*m, mrad"})
    return {}


def rate_beside(folder: Path, truth: Campaign) -> dict[str, str]:
    """The sampling rate of each run in a file beside it."""
    for name, run in files(truth):
        (folder / f"{name}.csv").write_text("M_Nm,phi_mrad\n" + rows([run.moment, 1e3 * run.angle], ","))
        (folder / f"{name}.json").write_text(json.dumps({"rig": "bench 4", "daq": {"fs": run.sample_rate}}))
    return {}


def two_rates(folder: Path, truth: Campaign) -> dict[str, str]:
    """Moment and angle in two files, the angle at twice the rate, from earlier on, with stamps in ms."""
    for name, run in files(truth):
        fast = (np.arange(2 * run.n_samples + 9) - 10) / (2 * run.sample_rate)
        angle = 1e3 * CubicSpline(run.time, run.angle)(fast)
        (folder / f"{name}_torque.csv").write_text("t_s,torque_Nm\n" + rows([run.time, run.moment], ","))
        (folder / f"{name}_angle.csv").write_text("t_ms,angle_mrad\n" + rows([1e3 * fast, angle], ","))
    return {}


def groups_of_rates(folder: Path, truth: Campaign) -> dict[str, str]:
    """TDMS with a group for each rate: the moment at twice that of the angle, and from earlier on."""
    nptdms = pytest.importorskip("nptdms")
    for name, run in files(truth):
        step = 1 / run.sample_rate
        fast = CubicSpline(run.time, run.moment)((np.arange(2 * run.n_samples + 9) - 10) * step / 2)
        noon = np.datetime64("2026-11-20T12:00:00", "us")
        early, late = ({"wf_start_time": noon + np.timedelta64(us, "us")} for us in (0, round(5e6 * step)))
        with nptdms.TdmsWriter(folder / f"{name}.tdms") as writer:
            writer.write_segment(
                [
                    nptdms.ChannelObject(
                        "fast", "Torque [N*m]", fast, properties=early | {"wf_increment": step / 2}
                    ),
                    nptdms.ChannelObject(
                        "slow", "Angle [rad]", run.angle, properties=late | {"wf_increment": step}
                    ),
                ]
            )
    return {}


LAB: list[Callable[[Path, Campaign], dict[str, str]]] = [
    mat_structs,
    mat_v73,
    hdf5_groups,
    npz_runs,
    wide_table,
    universal,
    tdms,
    parquet,
    rate_above,
    arm_and_stroke,
    runs_below,
    runs_with_pauses,
    sheets,
    mat_units,
    bench_words,
    encoder,
    row_labels,
    channel_rows,
    names_beside,
    rate_beside,
    two_rates,
    groups_of_rates,
]
