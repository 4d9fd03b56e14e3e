"""Every kind of input and what reads it: for the tests, and for ``benchmarks/bench_fuzz.py``.

Every input follows from its format, a seed and its number. It is read as a user's file is; a reader may understand it
or refuse it with a :class:`SindyJointError`, and nothing else.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_inputs import Target
from fuzz_options import options_target

sys.path += [str(Path(__file__).resolve().parents[level]) for level in (1, 2)]

ROOT = Path(__file__).resolve().parents[2]


def read_formula(text: str) -> None:
    from sindyjoint.equation import coefficient_unit
    from sindyjoint.equation import formula as f

    expression = f.parse_formula(text, ["v_s"], ["z"])
    f.formula_latex(expression)
    f.formula_pretty(expression)
    f.parse_formula(f.formula_text(expression), ["v_s"], ["z"])
    coefficient_unit(expression, {"v_s": "rad/s", "z": "rad"}, "rotation")


def read_unit(text: str) -> None:
    from sindyjoint.equation import parse_unit
    from sindyjoint.errors import SindyJointError
    from sindyjoint.files import QUANTITIES, conversion, parse_quantity, unit_ratio

    for attempt in (
        *(lambda kind=kind: parse_quantity(text, kind, "f") for kind in ("N*m", "K", "rad", "s")),
        lambda: conversion(text.partition(" ")[2], "N", "f", "3 N/V"),
        lambda: parse_unit(text.partition(" ")[2]),
        lambda: unit_ratio(text.partition(" ")[2], "N*m"),
    ):
        try:
            value = attempt()
        except SindyJointError:
            continue
        assert value is None or not isinstance(value, float) or np.isfinite(value), (text, value)
    assert QUANTITIES


def read_columns(path: Path) -> None:
    """Read a data file as a whole, and in segments."""
    from sindyjoint.errors import SindyJointError
    from sindyjoint.files import open_blocks, read_table

    refusals = []
    try:
        table, _ = read_table(path)
    except SindyJointError as error:
        table = None
        refusals.append(error)
    for position in range(1, 1 + len(table.names[:6] if table else ())):
        try:
            table.columns([position])
            table.stated_unit(position)
        except SindyJointError as error:
            refusals.append(error)
    blocks = open_blocks(path)
    if blocks is not None:
        half = blocks.rows // 2
        for start, stop in ((0, half), (half, blocks.rows)):
            try:
                blocks.table(start, stop).columns(list(blocks.names[:3]))
            except SindyJointError as error:
                refusals.append(error)
    if refusals:
        raise refusals[0]


def read_folder(path: Path) -> None:
    """Draft a manifest for a folder with a data file."""
    from sindyjoint.files import draft_manifest, survey_folder

    draft_manifest("joint", *survey_folder(path.parent), {})


def read_test(path: Path) -> None:
    from sindyjoint.equation import read_test as read

    read(path)


def read_manifest(path: Path) -> None:
    from sindyjoint import load_campaign

    load_campaign(path)


def read_catalogue(path: Path) -> None:
    from sindyjoint.equation import load_catalogue

    load_catalogue(path)


def read_effects(path: Path) -> None:
    from sindyjoint.diagnosis import read_effects as read

    read(path)


def read_rig(path: Path) -> None:
    from sindyjoint.mechanics import load_rig

    load_rig(path)


def read_model(path: Path) -> None:
    from sindyjoint.export import read_model as read

    model = read(path)
    # What every command begins with.
    model.equation(), model.latex(), model.to_json()
    model.without_elements().moment(np.linspace(-1e-3, 1e-3, 5), np.linspace(-0.1, 0.1, 5))


def read_record(path: Path) -> None:
    from sindyjoint.workflows import last_result
    from sindyjoint.workflows import read_record as read

    last_result(path.parent)
    read(path.parent)


def read_saved(path: Path) -> None:
    from sindyjoint.reporting import draw, drawable, drawing, load_results

    data = load_results(path.parent.parent)
    with drawing(path.parent.parent):
        kinds = drawable(data, parts=True)
        chosen = zlib.crc32(path.read_bytes())
        if kinds and chosen % 8 == 0:  # drawing takes a hundred times as long as reading
            draw(kinds[chosen // 8 % len(kinds)], data)


def read_list(path: Path) -> None:
    from sindyjoint.documents import changed_files, read_checked

    changed_files(path.parent)
    read_checked(path.parent / "other")


def read_factors(path: Path) -> None:
    from sindyjoint.discovery import read_evidence

    read_evidence(path)


MANIFEST = """
[joint]
name = "bench"
inertia = "0.02 kg*m^2"
temperature = "23 degC"
labels = { room = "2", shift = 1 }

[channels]
time = { column = "t", unit = "s" }
moment = { column = "m", unit = "V", gain = "0.2 N*m/V", offset = "1 mN*m", noise = "2 mV" }
angle = { column = "a", unit = "mrad" }
skew = "0 s"

[[run]]
file = "run.csv"
frequency = 4.0
level = "low"
[[run]]
name = "again"
file = "run.csv"
use = "validate"
channels = { angle = { column = 3, unit = "deg" } }
"""


def _table() -> str:
    """Return a run as CSV: 96 samples at 200 Hz of a sine of 4 Hz."""
    t = np.arange(96) / 200
    rows = zip(t, 5 * np.sin(25.1 * t), np.sin(25.1 * t - 0.3), strict=True)
    return "t,m,a\n" + "".join(f"{a:.6g},{b:.8g},{c:.8g}\n" for a, b, c in rows)


def _texts(pattern: str) -> list[str]:
    return [path.read_text(encoding="utf-8") for path in sorted(ROOT.glob(pattern))]


def _units() -> list[str]:
    from sindyjoint.files import QUANTITIES, USUAL

    units = [*QUANTITIES, *(unit for known in USUAL.values() for unit in known)]
    return [f"{n} {unit}" for unit in units for n in ("1", "0.25", "-3e2")] + [
        "23 degreeC", "23 degC", "70 degF", "0.1 mi**99.999", "1 dB*m", "2 Np", "35.15 N/V", "1 kg*m^2/(s^2*rad)",
    ]  # fmt: skip


def _documents(folder: Path) -> dict[str, Target]:
    """Return what is text: formulas, units, and the documents of campaigns and results."""
    from made_models import paper_model

    from sindyjoint.documents import sums_of, sums_text
    from sindyjoint.workflows import CampaignRecord
    from tests.equation.test_formula_evaluation import JENKINS, MAXWELL, with_elements

    (folder / "run.csv").write_text(_table(), encoding="utf-8")
    shutil.copy(folder / "run.csv", folder / "other")
    formulas = re.findall(r'(?:formula|rate|limit) = "([^"]*)"', "\n".join(_texts("libraries/**/*.toml")))
    record = CampaignRecord(
        "a", "a/campaign.toml", "found", "chosen", {"name": "a", "motion": "rotation", "labels": {}},
        {"terms": [{"id": "k1", "coefficient": 1.0}]}, "0" * 64, {"model.json": "0" * 64, "factors.npz": "1" * 64},
    )  # fmt: skip
    return {
        "formula": Target(formulas, read_formula),
        "unit": Target(_units(), read_unit),
        "manifest": Target([MANIFEST], read_manifest, "campaign.toml"),
        "catalogue": Target(_texts("libraries/p*.toml"), read_catalogue, "own.toml"),
        "effects": Target(
            _texts("libraries/effects/*.toml"),
            read_effects,
            "effects.toml",
        ),
        "rig": Target(_texts("sindyjoint/mechanics/rig_files/*.toml"), read_rig, "rig.toml"),
        "model": Target(
            [paper_model().to_json(), with_elements(JENKINS, MAXWELL).to_json()], read_model, "model.json"
        ),
        "test": Target([made_test().to_json()], read_test, "test.json"),
        "record": Target([record.to_json()], read_record, "record.json"),
        "hashes": Target([sums_text(sums_of(folder))], read_list, "SHA256SUMS"),
    }


def made_test() -> Any:
    """Return errors of channels, a drift, and a moment of the frequency."""
    from dataclasses import replace

    from sindyjoint.equation import Drift, Nuisance, TestNuisances
    from tests.equation.test_formula_evaluation import JENKINS, value

    stiffer = replace(
        JENKINS, columns=(value("k_f", 10.0, "frequency*theta"),), parameters=(), states=(), signals=("frequency",)
    )  # fmt: skip
    delay = Nuisance("channel_delay", "time shift", value("channel_delay", 2e-3, unit="s"))
    slopes = {"run": 1e-3}
    return TestNuisances("0" * 64, "a", (delay,), Drift("moment_drift", slopes), (stiffer,))


def _results(folder: Path, wanted: str) -> dict[str, Any]:
    """Return command lines, factors of a campaign, or the data that figures of one kind of result are drawn from."""
    if wanted == "options":
        return {"options": options_target(folder)}
    from sindyjoint import diagnose, discover, simulate, verify
    from sindyjoint.diagnosis import load_effects
    from sindyjoint.discovery import evidence_bytes
    from sindyjoint.reporting import write_results
    from sindyjoint.soundness import check_data
    from sindyjoint.workflows import FACTORS_FILE, rig_motion

    campaign = simulate(random_state=0, duration=1.0, frequencies=(3.0, 5.0))
    found = discover(campaign, "paper", correct=False)
    if wanted == "factors":
        return {"factors": Target([evidence_bytes(found.regressor.evidence_)], read_factors, FACTORS_FILE)}
    results = {
        "saved": lambda: found,
        "verified": lambda: verify(found.model, campaign, draws=2),
        "rigged": lambda: rig_motion("pulse-rig"),
        "diagnosed": lambda: diagnose(campaign, advise=False, effects=load_effects()[:4], max_effects=1),
        "checked": lambda: check_data(campaign),
    }
    write_results(results[wanted](), folder / wanted)
    (folder / wanted / "SHA256SUMS").unlink()
    file = f"{wanted}/figures/data.json"
    return {wanted: Target([thinned((folder / file).read_text(encoding="utf-8"))], read_saved, file)}


def _formats(folder: Path) -> dict[str, Target]:
    """Return the data files."""
    import io

    import made_files as made
    import pyarrow as pa
    import pyarrow.parquet as pq
    import scipy.io
    from pyarrow import feather

    text = _table()
    old = io.BytesIO()
    scipy.io.savemat(old, {"t": made.T, "X": np.column_stack([made.A, made.M]), "note": "text"}, format="4")
    packed = io.BytesIO()
    scipy.io.savemat(packed, {"t": made.T, "s": {"m": made.M, "u": {"n": np.int8([1])}}}, do_compression=True)
    chunked = io.BytesIO()
    import h5py

    with h5py.File(chunked, "w") as file:
        file.create_dataset("t", data=made.T, chunks=(16,), compression="gzip")
        file.create_dataset(
            "X", data=np.column_stack([made.A, made.T]), chunks=(16, 2), shuffle=True, fletcher32=True
        )
    plain = io.BytesIO()
    np.savez(plain, t=made.T, m=made.M.astype("f4"), n=np.arange(64, dtype="i2"))
    fields = io.BytesIO()
    np.save(fields, np.array(list(zip(made.T, made.M, strict=True)), dtype=[("t", "f8"), ("m", "f4")]))
    numbers = pa.table({"t": made.T, "m": made.M.astype("f4")})
    pq.write_table(numbers, plain_parquet := io.BytesIO(), compression="none", use_dictionary=False)
    feather.write_feather(numbers, plain_feather := io.BytesIO(), compression="uncompressed")
    rows = json.dumps([{"t": t, "m": m} for t, m in zip(made.T.tolist(), made.M.tolist(), strict=True)])
    (folder / "in").mkdir(exist_ok=True)
    return {
        "csv": Target(
            [text, text.replace(",", ";").replace(".", ","), "# note\n" + text], read_columns, "run.csv"
        ),
        "tsv": Target([text.replace(",", "\t"), text.replace(",", "   ")], read_columns, "run.tsv"),
        "npy": Target([made.npy(), fields.getvalue()], read_columns, "run.npy"),
        "npz": Target([made.npz(), plain.getvalue()], read_columns, "run.npz"),
        "mat": Target([made.mat5(), packed.getvalue(), old.getvalue()], read_columns, "run.mat"),
        "mat73": Target([made.mat73()], read_columns, "seven.mat"),
        "hdf5": Target([made.hdf5(), chunked.getvalue()], read_columns, "run.h5"),
        "parquet": Target([made.parquet(), plain_parquet.getvalue()], read_columns, "run.parquet"),
        "feather": Target([made.feather(), plain_feather.getvalue()], read_columns, "run.feather"),
        "uff": Target([made.uff(False), made.uff(True)], read_columns, "run.uff"),
        "tdms": Target([made.tdms()], read_columns, "run.tdms"),
        "asc": Target([f"Bench 3\nRate: 200 Hz\n\n{text}"], read_columns, "run.asc"),
        "lvm": Target([made.lvm(way).decode() for way in ("No", "One")], read_columns, "run.lvm"),
        "json": Target([made.json_columns().decode(), rows], read_columns, "run.json"),
        "xlsx": Target([_short_workbook()], read_columns, "run.xlsx"),
        "folder": Target(
            [text, text.replace("t,m,a", "time [s],force [kN],x [mm]")], read_folder, "in/run.csv"
        ),
    }


def _short_workbook() -> bytes:
    import io

    import openpyxl

    book = openpyxl.Workbook()
    for row in [["t", "m", "a"], ["s", "N*m", "rad"], *[[i / 100, i % 5, -i * 1e-3] for i in range(20)]]:
        book.active.append(row)
    book.save(buffer := io.BytesIO())
    return buffer.getvalue()


def thinned(text: str, longest: int = 60) -> str:
    """Return a JSON document with every long list cut to a few of its entries, alike for all of the same length."""

    def thin(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: thin(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [thin(inner) for inner in value[:: max(1, -(-len(value) // longest))]]
        return value

    return json.dumps(thin(json.loads(text)))


RESULTS = ("saved", "verified", "rigged", "diagnosed", "checked", "factors", "options")


def targets(folder: Path, result: str | None = None) -> dict[str, Any]:
    """Return every kind of input, of :data:`RESULTS` the one that is named; the folder is for their files."""
    folder.mkdir(parents=True, exist_ok=True)
    return {**_documents(folder), **_formats(folder), **(_results(folder, result) if result else {})}
