"""The same two signals as a file of every format that is read."""

import io
import json

import numpy as np
import pytest

SAMPLES = 64
T = np.arange(SAMPLES) / 128.0
M = np.sin(T * 50) * 3
A = np.cos(T * 50) * 1e-3


def parquet() -> bytes:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    pq.write_table(pa.table({"t": T, "m": M, "a": A, "remark": ["x"] * SAMPLES}), buffer)
    return buffer.getvalue()


def feather() -> bytes:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.feather as feather_format

    buffer = io.BytesIO()
    feather_format.write_feather(pa.table({"t": T, "m": M, "a": A}), buffer)
    return buffer.getvalue()


def mat5() -> bytes:
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, {"t": T, "s": {"m": M, "note": "text"}, "X": np.column_stack([A, T]), "title": "bench"})
    return buffer.getvalue()


def mat73() -> bytes:
    h5py = pytest.importorskip("h5py")
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        file["t"] = T[None, :]  # MATLAB's column vector, as HDF5 sees it
        file["s/m"] = M[None, :]
        file["X"] = np.column_stack([A, T]).T
        file["#refs#/a"] = [1.0]
    data = bytearray(buffer.getvalue())
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
    data[: len(header)] = header
    return bytes(data)


def hdf5() -> bytes:
    h5py = pytest.importorskip("h5py")
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["run/t"] = T
        file["run/s/m"] = M
        file["run/X"] = np.column_stack([A, T])
        file["other/t"] = T * 2
        file["pair"] = np.array(list(zip(M, A, strict=True)), dtype=[("m", "f8"), ("a", "f8")])
        file["title"] = "bench"
    return buffer.getvalue()


def npz() -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, t=T, m=M, X=np.column_stack([A, T]))
    return buffer.getvalue()


def npy() -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.column_stack([T, M, A]))
    return buffer.getvalue()


def data_set_58(
    values, node, direction, label, name="NONE", binary=False, double=True, step=T[1], unit="NONE"
) -> bytes:
    """Write one function at a nodal degree of freedom from the format's description (SDRC, data set 58)."""
    kind = f"b{1:6d}{2:6d}{11:12d}{values.size * (8 if double else 4):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    axis = "{:10d}    0    0    0 {:<20s} {:<20s}"
    lines = [
        f"{-1:6d}",
        f"{58:6d}" + (kind if binary else ""),
        *(f"{text:<80s}" for text in (name, "NONE", "NONE", "NONE", "NONE")),
        f"{1:5d}{0:10d}{0:5d}{0:10d} {'NONE':>10s}{node:10d}{direction:4d} {'NONE':>10s}{0:10d}{0:4d}",
        f"{4 if double else 2:10d}{values.size:10d}{1:10d}{0:13.5E}{step:13.5E}{0:13.5E}",
        axis.format(17, "Time", "s"),
        axis.format(0, label, unit),
        axis.format(0, "NONE", "NONE"),
        axis.format(0, "NONE", "NONE"),
    ]
    head = "\n".join(lines).encode() + b"\n"
    if binary:
        return head + values.astype("<f8" if double else "<f4").tobytes() + f"\n{-1:6d}\n".encode()
    width, fields = ("20.12E", 4) if double else ("13.5E", 6)
    rows = [values[place : place + fields] for place in range(0, values.size, fields)]
    body = "\n".join("".join(f"{value:{width}}" for value in row) for row in rows)
    return head + body.encode() + f"\n{-1:6d}\n".encode()


def uff(binary: bool, double: bool = True) -> bytes:
    pytest.importorskip("pyuff")
    functions = [(M, 12, 6, "Moment", "NONE"), (A, 12, 6, "Angle", "NONE"), (T, 3, -2, "Force", "hammer")]
    return b"".join(data_set_58(*function, binary=binary, double=double) for function in functions)


def tdms() -> bytes:
    nptdms = pytest.importorskip("nptdms")
    buffer = io.BytesIO()
    clock = {"wf_increment": T[1], "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(buffer) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("bench", "m", M, properties=clock),
                nptdms.ChannelObject("bench", "a", A, properties=clock),
                nptdms.ChannelObject("slow", "temperature", T[:8], properties={"wf_increment": 1.0}),
            ]
        )
    return buffer.getvalue()


def text(delimiter: str) -> bytes:
    rows = zip(T.tolist(), M.tolist(), A.tolist(), strict=True)
    return "\n".join([delimiter.join("tma"), *(delimiter.join(map(repr, row)) for row in rows)]).encode()


def xlsx() -> bytes:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title = "about"
    book.active.append(["Bench 3", None, "operator K."])
    sheet = book.create_sheet("data")
    for row in [
        ["recorded in May"],
        ["t", "m", "a"],
        ["s", "N*m", "rad"],
        *zip(T.tolist(), M.tolist(), A.tolist(), strict=True),
    ]:
        sheet.append(list(row))
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def lvm(x_columns: str = "One", comma: bool = False) -> bytes:
    """Write a file as LabVIEW's "Write to Measurement File" does, in two segments."""
    end, half = "***End_of_Header***", SAMPLES // 2
    lines = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    lines += [f"Decimal_Separator\t{',' if comma else '.'}", "Multi_Headings\tYes", f"X_Columns\t{x_columns}"]
    lines += ["Time_Pref\tRelative", "Operator\tK", "Date\t2024/05/01", "Time\t12:00:00.5", f"{end}\t", "\t"]
    for rows in (range(half), range(half, SAMPLES)):
        lines += ["Channels\t2\t\t", f"Samples\t{half}\t{half}\t", "Date\t2024/05/01\t2024/05/01\t"]
        lines += ["Y_Unit_Label\tN*m\trad\t", "X0\t0\t0\t", f"Delta_X\t{T[1]}\t{T[1]}\t", f"{end}\t\t\t"]
        lines += ["X_Value\tm\ta\tComment"]
        for i in rows:
            lines.append(
                "\t".join(
                    ["" if x_columns == "No" else repr(T[i].item()), repr(M[i].item()), repr(A[i].item())]
                )
            )
        lines.append("")
    body = "\n".join(lines)
    return (body.replace(".", ",") if comma else body).encode()


def json_columns() -> bytes:
    return json.dumps({"bench": "3", "t": T.tolist(), "s": {"m": M.tolist(), "a": A.tolist()}}).encode()


# ending, bytes, and what t, M and A are called there
FORMATS = {
    "csv": (lambda folder: text(","), ["t", "m", "a"]),
    "tsv": (lambda folder: text("\t"), ["t", "m", "a"]),
    "txt": (lambda folder: text(" "), ["t", "m", "a"]),
    "dat": (lambda folder: text(";"), ["t", "m", "a"]),
    "asc": (lambda folder: b"Bench 3\nRate: 128 Hz\n\n" + text("\t"), ["t", "m", "a"]),
    "lvm": (lambda folder: lvm(), ["X_Value", "m", "a"]),
    "xlsx": (lambda folder: xlsx(), ["t", "m", "a"]),
    "json": (lambda folder: json_columns(), ["t", "s.m", "s.a"]),
    "parquet": (lambda folder: parquet(), ["t", "m", "a"]),
    "feather": (lambda folder: feather(), ["t", "m", "a"]),
    "mat": (lambda folder: mat5(), ["t", "s.m", "X(:,1)"]),
    "h5": (lambda folder: hdf5(), ["run/t", "run/s/m", "run/X[:,0]"]),
    "hdf5": (lambda folder: hdf5(), ["other/t", "pair/m", "pair/a"]),
    "npz": (lambda folder: npz(), ["t", "m", "X[:,0]"]),
    "npy": (lambda folder: npy(), [1, 2, 3]),
    "uff": (lambda folder: uff(False), ["time", "12:+RZ Moment", "12:+RZ Angle"]),
    "unv": (lambda folder: uff(True), ["time", "12:+RZ Moment", "12:+RZ Angle"]),
    "tdms": (lambda folder: tdms(), ["time", "bench/m", "bench/a"]),
}


def stored(ending: str, folder, data: bytes | None = None):
    path = folder / f"run.{ending}"
    path.write_bytes(FORMATS[ending][0](folder) if data is None else data)
    return path
