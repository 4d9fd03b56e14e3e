"""Files that are damaged, hostile, or no files: refused before they cost memory or time."""

import io
import os
import struct
import zipfile

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.files import VARIABLE, load_campaign, open_blocks, read_table


def columns_of(path):
    table, _ = read_table(path)
    return table.columns(list(table.names))


def test_a_pipe_and_a_device_are_no_run_files(bench, tmp_path):
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes with names here")
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    for name in ("pipe.csv", "zero.csv"):
        for read in (read_table, open_blocks):
            with pytest.raises(InputError, match="is no regular file"):
                read(tmp_path / name)
        bench.replace("run.csv", name)
        with pytest.raises(InputError, match="is no regular file"):
            load_campaign(tmp_path, longest=100)


def header(shape, kind="<f8", fortran=False) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer,
        {"descr": np.lib.format.dtype_to_descr(np.dtype(kind)), "fortran_order": fortran, "shape": shape},
    )
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (header((10**12,)), "beyond the limit"),
        (header((10**6, 10**6)), "is no table of numbers"),
        (header((0, 10**15)), "holds nothing"),
        (header((4,), "V1000000000"), "is no table of numbers"),
        (header((4,), "V0"), "is no table of numbers"),
        (header((100, 2)) + bytes(800), "announces 1600 bytes and holds 800"),
        (header((-5,)) + bytes(40), "is no table of numbers"),
    ],
)
def test_an_absurd_array_is_refused_by_its_head(tmp_path, content, message):
    (tmp_path / "run.npy").write_bytes(content)
    with zipfile.ZipFile(tmp_path / "run.npz", "w") as archive:
        archive.writestr("t.npy", content)
    for name in ("run.npy", "run.npz"):
        with pytest.raises(InputError, match=message):
            columns_of(tmp_path / name)


def test_a_long_array_that_is_cut_off_is_refused_when_it_is_opened(tmp_path):
    (tmp_path / "run.npy").write_bytes(header((300_000, 2)) + bytes(16 * 299_999))
    with pytest.raises(InputError, match="it is truncated or damaged"):
        open_blocks(tmp_path / "run.npy")


def test_an_archive_that_grows_is_refused_by_its_list(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "run.npz", t=np.zeros(2_000_000))
    monkeypatch.setenv(VARIABLE, "10 MB")
    with pytest.raises(InputError, match=r"would take 16.* MB of memory, .*--largest 17MB before"):
        read_table(tmp_path / "run.npz")
    monkeypatch.setenv(VARIABLE, "20 MB")
    assert columns_of(tmp_path / "run.npz")[0].size == 2_000_000


def test_the_limit_is_an_option(bench, tmp_path, sindyjoint, monkeypatch):
    monkeypatch.setenv(VARIABLE, "1 GB")  # which is put back when the test ends
    answer = sindyjoint("--largest", "2 kB", "check", tmp_path)
    assert answer.status == 2 and "beyond the limit of 0.002 MB" in answer.stderr
    assert sindyjoint("--largest", "much", "check", tmp_path).status == 2


def test_a_compressed_matlab_array_that_grows_is_refused(tmp_path, monkeypatch):
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"t": np.zeros(2_000_000)}, do_compression=True)
    monkeypatch.setenv(VARIABLE, "10 MB")
    with pytest.raises(InputError, match="beyond the limit of 10 MB"):
        read_table(tmp_path / "run.mat")


@pytest.mark.parametrize("format", ["4", "5"])
@pytest.mark.parametrize("packed", [False, True])
def test_matlab_is_read_as_scipy_reads_it(tmp_path, format, packed):
    from scipy.io import loadmat, savemat

    rng = np.random.default_rng(0)
    arrays = {
        "row": rng.normal(size=(1, 7)),
        "single": rng.normal(size=(5, 3)).astype("f4"),
        "text": "no numbers",
        "empty": np.zeros((0, 0)),
        "small": np.array([[1.0, 2.0, 3.0]]),
        "name_of_thirty_one_letters_in_al": np.arange(4.0)[:, None],
    }
    if format == "5":
        arrays |= {
            "long": np.array([[2**53 + 1, -1]], dtype="i8"),
            "truth": np.array([[True, False]]),
            "s": {
                "m": np.arange(5.0),
                "u": {"deep": np.int16([[1], [2]])},
                "cell": np.array([1, "x"], dtype=object),
            },
            "complex": np.array([[1j]]),
            "cube": rng.normal(size=(2, 3, 4)),
        }
    savemat(tmp_path / "run.mat", arrays, format=format, do_compression=packed and format == "5")
    known = loadmat(tmp_path / "run.mat")
    from sindyjoint.files import read_arrays

    found = dict(read_arrays(tmp_path / "run.mat", (tmp_path / "run.mat").read_bytes()))
    assert found.pop("text", "no numbers") == "no numbers"
    wanted = {name for name in arrays if name not in ("text", "s", "complex")}
    inside = {"s.m", "s.u.deep", "s.cell{1}", "s.cell{2}"}
    assert set(found) == wanted | (inside if format == "5" else set())
    for name in wanted:
        np.testing.assert_array_equal(found[name], known[name])
        assert found[name].dtype.kind == known[name].dtype.kind or name == "truth"


@pytest.mark.parametrize("value", ["five!", np.array([[1, "x", 2, 3, 4]], dtype=object), np.zeros((1, 5))])
def test_a_matlab_array_of_far_more_rows_than_bytes_is_refused(tmp_path, value):
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"a": value})
    whole = (tmp_path / "run.mat").read_bytes()
    assert whole.count(struct.pack("<ii", 1, 5)) == 1
    (tmp_path / "run.mat").write_bytes(whole.replace(struct.pack("<ii", 1, 5), struct.pack("<ii", 2**24, 5)))
    # Rows are made only once the file is known to hold them: 2**24 of them would take minutes and gigabytes.
    with pytest.raises(InputError, match=r"run.mat: .*(letters|ends within|beyond|numbers)"):
        read_table(tmp_path / "run.mat")


def test_a_chunk_too_short_for_its_checksum_is_refused(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.create_dataset("x", data=np.arange(64.0), chunks=(16,), fletcher32=True)
    assert columns_of(tmp_path / "run.h5")[0].size == 64
    whole = (tmp_path / "run.h5").read_bytes()
    # Size and filter mask of each chunk, as its index has them: 16 numbers and four bytes.
    assert whole.count(struct.pack("<II", 132, 0)) == 4
    (tmp_path / "run.h5").write_bytes(whole.replace(struct.pack("<II", 132, 0), struct.pack("<II", 1, 0), 1))
    # HDF5 2.0.0 dies of it.
    with pytest.raises(
        InputError, match=r"run.h5: data set 'x' has a chunk of 1 bytes, too few for its checksum"
    ):
        columns_of(tmp_path / "run.h5")


def test_a_matlab_file_cut_anywhere_is_read_or_refused(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"t": np.arange(9.0), "s": {"m": np.arange(3.0)}})
    whole = (tmp_path / "run.mat").read_bytes()
    for length in range(len(whole)):
        (tmp_path / "run.mat").write_bytes(whole[:length])
        try:
            read_table(tmp_path / "run.mat")
        except InputError as error:
            assert str(error).count("\n") == 0


def test_feather_of_version_1_is_refused(tmp_path):
    pytest.importorskip("pyarrow")
    # Four letters are all of it that is looked at: what follows is what compiled code died of.
    (tmp_path / "run.feather").write_bytes(b"FEA1" + bytes(100) + b"FEA1")
    for read in (read_table, open_blocks):
        with pytest.raises(InputError, match="is Feather of version 1, which is no longer read"):
            read(tmp_path / "run.feather")


def external(h5py, folder):
    with h5py.File(folder / "other.h5", "w") as file:
        file["t"] = np.arange(40.0)
    (folder / "raw").write_bytes(np.arange(40.0).tobytes())


def linked(h5py, file):
    file["t"] = h5py.ExternalLink("other.h5", "t")


def virtual(h5py, file):
    layout = h5py.VirtualLayout(shape=(40,), dtype="f8")
    layout[:] = h5py.VirtualSource("nowhere.h5", "t", shape=(40,))
    file.create_virtual_dataset("t", layout)


def stored_elsewhere(h5py, file):
    file.create_dataset("t", shape=(40,), dtype="f8", external=[("raw", 0, 320)])


def never_written(h5py, file):
    file.create_dataset("t", shape=(40,), dtype="f8", chunks=(10,))


def holds_itself(h5py, file):
    file["a/b"] = np.arange(40.0)
    file["a/again"] = file["a"]


def enormous(h5py, file):
    file.create_dataset("t", shape=(10**9, 10**3), dtype="f8", chunks=(10, 10))


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (linked, "'t' is a link to another file"),
        (virtual, "'t' is virtual: its numbers lie in other files"),
        (stored_elsewhere, "'t' keeps its numbers in another file"),
        (never_written, "has room for numbers, and none were written"),
        (holds_itself, "holds itself"),
        (enormous, "beyond the limit"),
    ],
)
def test_hdf5_of_other_files_or_of_nothing_is_refused(tmp_path, write, message):
    h5py = pytest.importorskip("h5py")
    external(h5py, tmp_path)
    with h5py.File(tmp_path / "run.h5", "w") as file:
        write(h5py, file)
    with pytest.raises(InputError, match=message):
        columns_of(tmp_path / "run.h5")
    with pytest.raises(InputError, match=message):
        blocks = open_blocks(tmp_path / "run.h5")
        blocks.table(0, 20).columns(["t"])


def test_a_text_for_the_sampling_interval_of_tdms_is_named(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(tmp_path / "run.tdms")) as writer:
        clock = {"wf_increment": "fast"}
        writer.write_segment([nptdms.ChannelObject("g", "m", np.arange(9.0), properties=clock)])
    with pytest.raises(InputError, match="sampling interval of channel 'm' is 'fast'; expected seconds"):
        read_table(tmp_path / "run.tdms")


def long_table(lines=300_010) -> list[str]:
    return ["t,m,a", *(f"{n},{n % 7},{n % 5}" for n in range(lines))]


@pytest.mark.parametrize("at", [300_001, 262_145, 131_073])
@pytest.mark.parametrize(
    ("text", "message"), [("1,2", "has 2 fields and line 1 has 3"), ("t,m,a", "column 't' holds 't'")]
)
def test_a_fault_far_down_is_named_by_its_line(tmp_path, at, text, message):
    # Beyond the first segment, and on the very line where one begins: there it was taken for a header.
    lines = long_table()
    lines[at] = text
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    blocks = open_blocks(tmp_path / "run.csv")
    edges = [0, 131_072, 262_144, 300_000, blocks.rows]
    faults = []
    for start, stop in zip(edges, edges[1:], strict=False):
        try:
            blocks.table(start, stop).columns(["t", "m"])
        except InputError as error:
            faults.append(str(error))
    assert len(faults) == 1 and f"line {at + 1}" in faults[0] and message in faults[0], faults


def test_a_number_that_is_none_far_down_is_named_by_its_line(tmp_path):
    lines = long_table()
    lines[300_005] = "nan,1,2"
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="column 't' holds nan in line 300006"):
        open_blocks(tmp_path / "run.csv").table(300_000, 300_010).columns(["t"])
