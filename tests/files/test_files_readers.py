"""Every format: the same numbers come back, and damaged files are refused in one line."""

import builtins
import sys
import warnings

import numpy as np
import pytest
from made_files import (
    FORMATS,
    SAMPLES,
    A,
    M,
    T,
    lvm,
    mat5,
    mat73,
    stored,
    uff,
)
from scipy.io import savemat

from sindyjoint.errors import InputError, MissingExtraError, SindyJointError
from sindyjoint.files import READERS, load_campaign, read_table


def test_every_reader_is_tested():
    assert {f".{ending}" for ending in FORMATS} == set(READERS)


@pytest.mark.parametrize("ending", FORMATS)
def test_the_same_numbers_come_back(ending, tmp_path):
    table, sha256 = read_table(stored(ending, tmp_path))
    time, moment, angle = table.columns(FORMATS[ending][1])
    if ending == "hdf5":
        time = time / 2
    # Text of data set 58 holds twelve digits, a workbook sixteen; everything else holds all bits.
    tolerance = {"uff": 1e-11, "xlsx": 1e-15}.get(ending, 0)
    np.testing.assert_allclose(time, T, rtol=1e-15 if ending in ("uff", "unv", "tdms") else 0)
    np.testing.assert_allclose(moment, M, rtol=tolerance)
    np.testing.assert_allclose(angle, A, rtol=tolerance)
    assert len(sha256) == 64
    assert all(values.dtype == np.float64 for values in (time, moment, angle))


def test_mat_v73(tmp_path):
    table, _ = read_table(stored("mat", tmp_path, mat73()))
    time, moment, angle = table.columns(["t", "s.m", "X(:,1)"])
    np.testing.assert_array_equal([time, moment, angle], [T, M, A])
    assert "#refs#.a" not in table.names


def test_structs_in_an_array_are_numbered_and_a_vector_may_have_its_name_beside_it(tmp_path):
    signals = np.zeros((2,), dtype=[("values", object), ("label", object)])
    signals[0], signals[1] = (np.arange(40.0)[:, None], "Torque [Nm]"), (np.ones((40, 1)), "Angle")
    savemat(tmp_path / "scope.mat", {"out": {"time": np.arange(40.0), "signals": signals}})
    table = read_table(tmp_path / "scope.mat")[0]
    assert table.names == ("out.time", "out.signals(1).Torque [Nm]", "out.signals(2).Angle")
    np.testing.assert_array_equal(table.columns(["out.signals(1).Torque [Nm]"])[0], np.arange(40.0))
    assert table.stated_unit("out.signals(1).Torque [Nm]")[1] == "N*m"


def test_the_column_of_a_matrix_has_no_unit(tmp_path):
    np.savez(tmp_path / "a.npz", data=np.arange(80.0).reshape(40, 2))
    table = read_table(tmp_path / "a.npz")[0]
    assert table.names == ("data[:,0]", "data[:,1]") and table.stated_unit("data[:,0]")[1] == ""


def test_names_without_their_group_where_they_are_unique(tmp_path):
    table, _ = read_table(stored("h5", tmp_path))
    np.testing.assert_array_equal(table.columns(["X[:,0]"])[0], A)
    with pytest.raises(InputError, match="column 't' is missing; .*columns there: "):
        table.columns(["t"])
    table, _ = read_table(stored("mat", tmp_path))
    np.testing.assert_array_equal(table.columns(["m"])[0], M)


def test_universal_file_names(tmp_path):
    table, _ = read_table(stored("uff", tmp_path))
    np.testing.assert_allclose(table.columns(["hammer"])[0], table.columns(["3:-Y"])[0])
    with pytest.raises(InputError, match=r"column '12:\+RZ' is missing; did you mean '12:\+RZ "):
        table.columns(["12:+RZ"])


@pytest.mark.parametrize("binary", [False, True])
def test_universal_file_in_single_precision(binary, tmp_path):
    table, _ = read_table(stored("uff", tmp_path, uff(binary, double=False)))
    np.testing.assert_allclose(table.columns(["12:+RZ Moment"])[0], M, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("binary", [False, True])
def test_universal_file_with_lost_values(binary, tmp_path):
    data = uff(binary).replace(f"{SAMPLES:10d}".encode(), b"       500")
    with pytest.raises(
        InputError, match="function 1 announces 500 values and holds 64; the file may be truncated"
    ):
        read_table(stored("uff", tmp_path, data))


def test_tdms_channels_of_different_clocks(tmp_path):
    table, _ = read_table(stored("tdms", tmp_path))
    with pytest.raises(InputError, match="no common sampling interval; declare .channels. rate"):
        table.columns(["time", "m", "temperature"])


def test_npz_never_unpickles(tmp_path):
    class Evil:
        def __reduce__(self):
            return (builtins.exec, ("raise SystemExit('unpickled')",))

    path = tmp_path / "run.npz"
    np.savez(path, t=np.array([Evil()], dtype=object))
    with pytest.raises(InputError, match="array 't' of object .*expected a table of numbers"):
        read_table(path)


def test_parquet_null_is_named_with_its_row(tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    path = tmp_path / "run.parquet"
    pq.write_table(pa.table({"m": [1.0, None, 3.0], "i": [1, None, 3], "s": ["a", "b", "c"]}), path)
    table, _ = read_table(path)
    with pytest.raises(InputError, match="column 'm' holds nan in row 2; remove or repair"):
        table.columns(["m"])
    with pytest.raises(InputError, match="column 'i' holds nan in row 2"):
        table.columns(["i"])
    with pytest.raises(InputError, match="column 's' holds .*; expected real numbers"):
        table.columns(["s"])


@pytest.mark.parametrize(
    "ending", ["parquet", "feather", "mat", "h5", "npz", "uff", "tdms", "lvm", "xlsx", "json"]
)
@pytest.mark.parametrize("damage", ["empty", "rubbish", "text", "half", "head"])
def test_damaged_file_is_refused_in_one_line(ending, damage, tmp_path):
    whole = FORMATS[ending][0](tmp_path)
    data = {
        "empty": b"",
        "rubbish": np.random.default_rng(5).integers(0, 256, 3000, dtype=np.uint8).tobytes(),
        "text": b"t,m,a\n1,2,3\n" * 20,
        "half": whole[: len(whole) // 2],
        "head": whole[:40],
    }[damage]
    path = stored(ending, tmp_path, data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(SindyJointError) as caught:
            read_table(path)[0].columns(FORMATS[ending][1])
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 400


@pytest.mark.parametrize(
    "ending", ["csv", "parquet", "feather", "mat", "h5", "npz", "uff", "tdms", "lvm", "xlsx", "json"]
)
def test_damage_anywhere_is_read_or_refused(ending, tmp_path):
    # Seed 6: forty files with one to three bytes changed. A changed digit may pass; a traceback may not.
    whole = FORMATS[ending][0](tmp_path)
    rng = np.random.default_rng(6)
    for _ in range(40):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), rng.integers(1, 4)):
            data[place] = rng.integers(0, 256)
        try:
            read_table(stored(ending, tmp_path, bytes(data)))[0].columns(FORMATS[ending][1])
        except SindyJointError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("ending", "module", "package"),
    [
        ("parquet", "pyarrow", "pyarrow"),
        ("feather", "pyarrow", "pyarrow"),
        ("h5", "h5py", "h5py"),
        ("uff", "pyuff", "pyuff"),
        ("tdms", "nptdms", "npTDMS"),
        ("xlsx", "openpyxl", "openpyxl"),
    ],
)
def test_missing_library_names_the_extra(ending, module, package, tmp_path, monkeypatch):
    path = stored(ending, tmp_path)
    for name in {module, *(name for name in sys.modules if name.startswith(f"{module}."))}:
        monkeypatch.setitem(sys.modules, name, None)
    extra = "excel" if ending == "xlsx" else "formats"
    wanted = rf'needs {package}; run: pip install "sindyjoint\[{extra}\]"'
    with pytest.raises(MissingExtraError, match=wanted):
        read_table(path)


def test_unknown_ending(tmp_path):
    path = tmp_path / "run.docx"
    path.write_bytes(b"x")
    with pytest.raises(
        InputError, match=r"run.docx: ending '.docx' is unknown; expected one of csv, tsv, txt"
    ):
        read_table(path)


def test_truncated_mat_through_the_campaign(tmp_path):
    stored("mat", tmp_path, mat5()[:700])
    (tmp_path / "campaign.toml").write_text(
        '[channels]\nrate = "128 Hz"\nmoment = { column = "s.m", unit = "N*m" }\n'
        'angle = { column = "X(:,1)", unit = "rad" }\n[[run]]\nfile = "run.mat"\n'
    )
    with pytest.raises(InputError, match=r"run.mat: (cannot be read as MATLAB|column .* is missing)"):
        load_campaign(tmp_path)


@pytest.mark.parametrize("ending", FORMATS)
def test_a_campaign_in_every_format(ending, tmp_path):
    stored(ending, tmp_path)
    time, moment, angle = FORMATS[ending][1]
    (tmp_path / "campaign.toml").write_text(
        f'[channels]\ntime = {{ column = "{time}", unit = "s" }}\n'
        f'moment = {{ column = "{moment}", unit = "N*m" }}\n'
        f'angle = {{ column = "{angle}", unit = "rad" }}\n[[run]]\nfile = "run.{ending}"\n'
    )
    run = load_campaign(tmp_path).runs[0]
    np.testing.assert_allclose(run.moment, M, rtol=1e-11)
    assert run.sample_rate == (64.0 if ending == "hdf5" else 128.0)


@pytest.mark.parametrize(("x_columns", "comma"), [("No", False), ("One", True), ("No", True)])
def test_lvm_without_stamps_and_with_decimal_commas(x_columns, comma, tmp_path):
    table, _ = read_table(stored("lvm", tmp_path, lvm(x_columns, comma)))
    np.testing.assert_allclose(np.array(table.columns(["X_Value", "m", "a"])), [T, M, A])
    assert table.stated_unit("m") == ("m", "N*m", False)


def rows_of(columns) -> str:
    return "\n".join(",".join(map(str, row)) for row in zip(*columns, strict=True)) + "\n"


@pytest.mark.parametrize(
    "stamps",
    [
        [
            f"2024-05-01T23:59:{59 + t:06.3f}" if t < 1 else f"2024-05-02T00:00:{t - 1:06.3f}"
            for t in np.arange(40) / 20
        ],
        [f"23:59:{59 + t:06.3f}" if t < 1 else f"00:00:{t - 1:06.3f}" for t in np.arange(40) / 20],
        [f"5/1/2024 12:00:{t:05.2f} PM" for t in np.arange(40) / 20],
        [f"01.05.2024 09:{int(t // 60):02d}:{t % 60:05.2f}" for t in 59 + np.arange(40) / 20],
        [f"59:{58 + t:.2f}" for t in np.arange(40) / 20],
    ],
)
def test_clock_and_date_stamps_become_seconds(stamps, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("when,m\n" + rows_of([stamps, range(40)]))
    time, m = read_table(path)[0].columns(["when", "m"])
    np.testing.assert_allclose(time, np.arange(40) / 20, atol=1e-9)
    np.testing.assert_array_equal(m, np.arange(40))


def test_a_date_that_is_no_time_stamp_asks_for_a_rate(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("when,m\n" + rows_of([["2024-05-01"] * 40, range(40)]))
    with pytest.raises(
        InputError, match=r"holds '2024-05-01'; expected a number, or \[channels\] rate instead"
    ):
        read_table(path)[0].columns(["when"])


PREAMBLES = {
    "words": "Test bench 3\nOperator: K\n\n",
    "pairs": "Date;1.5.2024\nRate;128\nGain;2,5\n",
    "as wide as the table": "Operator,Smith,Room 4\nRig,4,x\n",
    "one number": "Bench\n128\n",
}


@pytest.mark.parametrize("units", ["", "s,N*m,rad\n"])
@pytest.mark.parametrize("preamble", PREAMBLES)
def test_lines_above_the_header_are_found(preamble, units, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(PREAMBLES[preamble] + "t,m,a\n" + units + rows_of([T, M, A]))
    table, _ = read_table(path)
    assert table.names == ("t", "m", "a")
    assert table.units == (("s", "N*m", "rad") if units else ())
    np.testing.assert_array_equal(np.array(table.columns(["t", "m", "a"])), [T, M, A])
    skipped, _ = read_table(path, skip=PREAMBLES[preamble].count("\n"))
    np.testing.assert_array_equal(skipped.columns(["m"])[0], M)


@pytest.mark.parametrize("broken", ["1.0,2.0\n", "1.0,x,2.0\n"])
def test_a_damaged_first_row_is_no_preamble(broken, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,m,a\n" + broken + rows_of([T, M, A]))
    with pytest.raises(InputError, match="line 2"):
        read_table(path)[0].columns(["m"])


def test_a_column_without_a_name_has_its_number(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,,a\n" + rows_of([T, M, A]))
    table, _ = read_table(path)
    assert table.names == ("t", "2", "a")
    np.testing.assert_array_equal(table.columns(["2"])[0], M)


def test_skip_is_for_text_and_sheets(tmp_path):
    with pytest.raises(InputError, match="skip = 3 was given; only text tables and sheets"):
        read_table(stored("npz", tmp_path), skip=3)
