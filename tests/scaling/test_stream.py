"""Tables of force states from disk: the same model as of rows in memory, in bounded memory."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.io

from sindyjoint import JointRegressor
from sindyjoint.discovery.long_tables import discover_rows
from sindyjoint.equation import Reference
from sindyjoint.errors import InputError
from sindyjoint.files import open_blocks, read_table


def motion(n, seed=0):
    """Return moving states of the paper's joint: θ, θ̇, θ̈ and the transfer moment."""
    rng = np.random.default_rng(seed)
    phase = np.cumsum(rng.uniform(0.001, 0.003, n))
    angle = 8e-4 * np.sin(phase) * (0.6 + 0.4 * np.sin(0.01 * phase))
    rate = 0.02 * np.cos(phase) * (0.6 + 0.4 * np.sin(0.013 * phase))
    moment = 6066 * angle - 2.684e9 * angle**3 + 48 * rate + 1.867 * np.sign(rate)
    return angle, rate, rng.normal(size=n), moment + 0.02 * rng.normal(size=n)


def write(path, columns):
    """Write columns in the format of the path's ending."""
    table = np.column_stack(list(columns.values()))
    if path.suffix == ".npy":
        np.save(path, np.asfortranarray(table) if "fortran" in path.stem else table)
    elif path.suffix == ".parquet":
        pa = pytest.importorskip("pyarrow")
        from pyarrow import parquet

        parquet.write_table(pa.table(columns), path, row_group_size=7000)
    elif path.suffix == ".h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                # One of them as a matrix of a single column.
                file[f"states/{name}"] = values[:, None] if name == "moment" else values
    elif path.suffix == ".mat":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w", userblock_size=512) as file:
            file["states/angle"], file["states/rate"] = columns["angle"][None], columns["rate"][None]
            file["states/acceleration"], file["moment"] = (
                columns["acceleration"][None],
                columns["moment"][None],
            )
            file["both"] = np.vstack([columns["angle"], columns["moment"]])
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    elif path.suffix == ".feather":
        pa = pytest.importorskip("pyarrow")
        from pyarrow import feather

        feather.write_feather(pa.table(columns), path, chunksize=7000)
    elif path.suffix == ".tdms":
        nptdms = pytest.importorskip("nptdms")
        with nptdms.TdmsWriter(path) as file:
            for start in range(0, table.shape[0], 7000):
                file.write_segment(
                    [nptdms.ChannelObject("states", n, c[start : start + 7000]) for n, c in columns.items()]
                )
    else:
        head = "# made by hand\n" + ",".join(columns) + "\nrad,rad/s,rad/s^2,N*m\n"
        path.write_text(head + "\n".join(",".join(map(repr, row)) for row in table.tolist()) + "\n")


FILES = (
    "rows.csv",
    "rows.parquet",
    "rows.h5",
    "rows.npy",
    "fortran.npy",
    "rows.mat",
    "rows.feather",
    "rows.tdms",
)
NAMES = ("angle", "rate", "acceleration", "moment")


@pytest.mark.parametrize("name", FILES)
def test_stretches_are_what_the_reader_gives(tmp_path, name):
    columns = dict(zip(NAMES, motion(20_011), strict=True))
    write(tmp_path / name, columns)
    wanted = [1, 4] if name.endswith("npy") else ["angle", "moment"]
    blocks, whole = open_blocks(tmp_path / name), read_table(tmp_path / name)[0].columns(wanted)
    assert blocks.rows == 20_011
    for start, stop in ((0, 20_011), (0, 1), (6_999, 7_001), (12_345, 18_000), (3, 9_000), (20_000, 20_011)):
        for part, column in zip(blocks.table(start, stop).columns(wanted), whole, strict=True):
            np.testing.assert_array_equal(part, column[start:stop])
    everything = read_table(tmp_path / name)[0]
    assert blocks.names == everything.names and dict(blocks.aliases) == dict(everything.aliases)


def test_a_clock_of_tdms_goes_on_from_segment_to_segment(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    signal = nptdms.ChannelObject("g", "angle", np.arange(100.0), properties={"wf_increment": 0.01})
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([signal])
    time, angle = open_blocks(tmp_path / "a.tdms").table(40, 60).columns(["time", "angle"])
    whole = read_table(tmp_path / "a.tdms")[0].columns(["time", "angle"])
    np.testing.assert_array_equal([time, angle], [column[40:60] for column in whole])


def test_older_kinds_of_a_format_are_loaded_as_a_whole(tmp_path):
    scipy.io.savemat(tmp_path / "five.mat", {"angle": np.arange(5.0)})
    assert open_blocks(tmp_path / "five.mat") is None
    (tmp_path / "one.feather").write_bytes(b"FEA1" + bytes(20))
    with pytest.raises(InputError, match="is Feather of version 1"):
        open_blocks(tmp_path / "one.feather")
    (tmp_path / "bad.feather").write_bytes(b"ARROW1" + bytes(20))
    with pytest.raises(InputError, match="bad.feather"):
        open_blocks(tmp_path / "bad.feather")


@pytest.mark.parametrize("name", FILES)
def test_the_same_model_as_in_memory(tmp_path, name):
    angle, rate, acceleration, moment = motion(30_001)
    write(tmp_path / name, dict(zip(NAMES, (angle, rate, acceleration, moment), strict=True)))
    columns = {"angle": 1, "rate": 2, "moment": 4} if name.endswith("npy") else None
    streamed = discover_rows(tmp_path / name, columns=columns, size=1000)
    in_memory = JointRegressor().fit(np.column_stack([angle, rate]), moment)
    assert streamed.selected_ == in_memory.selected_ and len(in_memory.selected_) == 4
    np.testing.assert_allclose(streamed.coef_, in_memory.coef_, rtol=1e-9)
    np.testing.assert_allclose(streamed.model_.standard_errors, in_memory.model_.standard_errors, rtol=1e-6)


def test_several_files_are_runs_and_processes_change_no_bit(tmp_path):
    runs = [motion(8_000, seed) for seed in range(3)]
    files = []
    for number, run in enumerate(runs):
        files.append(tmp_path / f"run-{number}.npy")
        write(files[-1], dict(zip(NAMES, run, strict=True)))
    columns = {"angle": 1, "rate": 2, "moment": 4}
    one = discover_rows(files, "paper", columns=columns, groups=["a", "b", "a"])
    two = discover_rows(files, "paper", columns=columns, groups=["a", "b", "a"], jobs=2)
    assert [(run.name, run.group) for run in one.evidence_.runs] == [
        ("run-0", "a"),
        ("run-1", "b"),
        ("run-2", "a"),
    ]
    assert np.array_equal(one.coef_, two.coef_)
    X = np.vstack([np.column_stack(run[:2]) for run in runs])
    names, groups = np.repeat(["run-0", "run-1", "run-2"], 8_000), np.repeat(["a", "b", "a"], 8_000)
    in_memory = JointRegressor("paper").fit(X, np.concatenate([run[3] for run in runs]), groups, runs=names)
    np.testing.assert_allclose(one.coef_, in_memory.coef_, rtol=1e-9)


def test_inertia_known_or_found(tmp_path):
    angle, rate, acceleration, moment = motion(20_000)
    write(
        tmp_path / "rows.npy",
        dict(zip(NAMES, (angle, rate, acceleration, moment + 0.02 * acceleration), strict=True)),
    )
    columns = {"angle": 1, "rate": 2, "acceleration": 3, "moment": 4}
    known = discover_rows(tmp_path / "rows.npy", "paper", columns=columns, inertia=0.02)
    found = discover_rows(tmp_path / "rows.npy", "paper", columns=columns)
    assert "inertia" in found.selected_ and "inertia" not in known.selected_
    assert found.model_["inertia"].coefficient == pytest.approx(0.02, rel=0.02)
    assert known.model_["linear_stiffness"].coefficient == pytest.approx(6066, rel=1e-3)


def test_a_given_reference_is_used(tmp_path):
    angle, rate, acceleration, moment = motion(10_000)
    write(tmp_path / "rows.npy", dict(zip(NAMES, (angle, rate, acceleration, moment), strict=True)))
    columns = {"angle": 1, "rate": 2, "moment": 4}
    given = discover_rows(tmp_path / "rows.npy", columns=columns, reference=Reference(1e-3, 0.05, 5.0))
    stribeck = next(term for term in given.terms_ if term.id == "stribeck_friction")
    assert dict(stribeck.values)["v_s"] == pytest.approx(0.005)


def stages(path, **given):
    reported = []
    columns = {"angle": 1, "rate": 2, "moment": 4} if path.suffix == ".npy" else None
    fit = discover_rows(path, columns=columns, progress=reported.append, **given)
    # Between two stages segments are counted.
    return fit, [stage for stage in reported if not stage.startswith("segments: ")]


def test_one_pass_is_enough_where_a_look_tells_the_scale(tmp_path):
    columns = dict(zip(NAMES, motion(20_000), strict=True))
    write(tmp_path / "rows.npy", columns)
    scanned, reported = stages(tmp_path / "rows.npy")
    assert reported == ["scanning the largest values", "accumulating factors", "selecting terms"]
    # Of so few rows the look takes all: the scale is that of two passes, and so is every digit.
    largest = Reference(*(float(np.abs(columns[name]).max()) for name in ("angle", "rate", "moment")))
    given, _ = stages(tmp_path / "rows.npy", reference=largest)
    assert scanned.reference_ == largest and scanned.terms_ == given.terms_
    assert np.array_equal(scanned.coef_, given.coef_)
    # Of a library without such parameters not even a look is taken.
    assert stages(tmp_path / "rows.npy", library="paper")[1] == reported[1:]


@pytest.mark.parametrize("ending", ["npy", "parquet"])
def test_larger_values_beside_the_look_are_met(tmp_path, ending):
    angle, rate, acceleration, moment = motion(400_000)
    # Between two pieces of the scan, amplitudes twice as large.
    larger = slice(10_000, 20_000)
    angle[larger], rate[larger] = 2 * angle[larger], 2 * rate[larger]
    moment = 6066 * angle - 2.684e9 * angle**3 + 48 * rate + 1.867 * np.sign(rate)
    moment = moment + 0.02 * np.random.default_rng(1).normal(size=moment.size)
    write(tmp_path / f"rows.{ending}", dict(zip(NAMES, (angle, rate, acceleration, moment), strict=True)))
    found, reported = stages(tmp_path / f"rows.{ending}")
    largest = Reference(*(float(np.abs(x).max()) for x in (angle, rate, moment)))
    # Parquet files state their largest values.
    assert any("larger values" in stage for stage in reported) == (ending == "npy")
    given, _ = stages(tmp_path / f"rows.{ending}", reference=largest)
    assert found.reference_ == largest and found.terms_ == given.terms_
    assert np.array_equal(found.coef_, given.coef_) and len(found.selected_) == 4


def test_what_cannot_be_is_refused(tmp_path):
    angle, rate, acceleration, moment = motion(1_000)
    moment[777] = np.nan
    write(tmp_path / "rows.npy", dict(zip(NAMES, (angle, rate, acceleration, moment), strict=True)))
    columns = {"angle": 1, "rate": 2, "moment": 4}
    with pytest.raises(InputError, match=r"column 4 holds nan in row 778"):
        discover_rows(tmp_path / "rows.npy", columns=columns)
    with pytest.raises(InputError, match="column 'angle' is missing"):
        discover_rows(tmp_path / "rows.npy")
    with pytest.raises(InputError, match="columns name no acceleration"):
        discover_rows(tmp_path / "rows.npy", columns=columns, inertia=0.02)
    with pytest.raises(InputError, match="cannot be read in segments"):
        np.savez(tmp_path / "rows.npz", angle=angle)
        discover_rows(tmp_path / "rows.npz")
    with pytest.raises(InputError, match="nothing.npy: cannot be read"):
        discover_rows(tmp_path / "nothing.npy")


PEAK = """
import sys
from sindyjoint.discovery.long_tables import discover_rows
columns = {"angle": 1, "rate": 2, "moment": 3}
fit = discover_rows(sys.argv[1], "paper", columns=columns)
# Not ru_maxrss: what the parent used counts there.
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(peak.split()[1], len(fit.selected_))
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak is read from /proc")
def test_memory_does_not_grow_with_the_rows(tmp_path):
    peaks = []
    for n in (300_000, 4_500_000):
        angle, rate, _, moment = motion(n)
        np.save(tmp_path / "rows.npy", np.column_stack([angle, rate, moment]))
        answer = subprocess.run(
            [sys.executable, "-c", PEAK, tmp_path / "rows.npy"], capture_output=True, text=True
        )
        kilobytes, terms = map(int, answer.stdout.split())
        peaks.append(kilobytes)
        assert terms == 4
    # Fifteen times the rows, 100 MB more of them; the two readings differ by the size of a segment.
    assert peaks[1] - peaks[0] < 30_000


def test_only_the_end_of_the_file_can_be_cut_off(tmp_path):
    # Segments end where their last number may be the shortest; the file itself ends within one.
    write(tmp_path / "rows.csv", dict(zip(NAMES, motion(2_000), strict=True)))
    text = (tmp_path / "rows.csv").read_text()
    blocks = open_blocks(tmp_path / "rows.csv")
    for stop in range(40, 2_001):
        blocks.table(stop - 40, stop).columns(["moment"])
    (tmp_path / "rows.csv").write_text(text.rstrip("\n")[:-14])
    cut = open_blocks(tmp_path / "rows.csv")
    cut.table(0, 1_990).columns(["moment"])
    with pytest.raises(InputError, match="ends within line"):
        cut.table(1_900, 2_000).columns(["moment"])
