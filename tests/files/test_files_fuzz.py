"""A seeded fuzz of each reader: whatever the bytes, an input is understood or refused, in one line and in no time.

A short run of what ``python benchmarks/bench_fuzz.py`` counts by the hundred thousand.
"""

import time
import warnings

import pytest
from fuzz import targets

from sindyjoint.errors import SindyJointError

KINDS = (
    "formula", "unit", "manifest", "catalogue", "effects", "rig", "model", "record", "hashes", "csv", "tsv", "npy",
    "npz", "mat", "mat73", "hdf5", "parquet", "feather", "uff", "tdms", "test", "asc", "lvm", "json", "xlsx", "folder",
)  # fmt: skip
NUMBER = 25  # of inputs, for each kind
SEED = 16


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    for library in ("pyarrow", "h5py", "pyuff", "nptdms", "openpyxl"):
        pytest.importorskip(library)
    folder = tmp_path_factory.mktemp("fuzz")
    return targets(folder), folder


def test_every_kind_is_fuzzed(known):
    assert set(known[0]) == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_an_input_is_understood_or_refused(known, kind):
    target, folder = known[0][kind], known[1]
    # What another kind left there would have every input refused before it is read.
    (folder / "SHA256SUMS").unlink(missing_ok=True)
    with warnings.catch_warnings():
        # As on the command line: what counts here is what becomes of the input.
        warnings.simplefilter("ignore")
        for number in range(NUMBER):
            given = target.make(kind, SEED, number)
            begun = time.process_time()
            try:
                target.run(given, folder)
            except SindyJointError as error:
                assert "\n" not in str(error) and "\x1b" not in str(error), number
            except Exception as error:
                raise AssertionError(f"{kind}, seed {SEED}, input {number}: {given!r:.300}") from error
            # Milliseconds, unless a reader can be led astray.
            assert time.process_time() - begun < 5, number


@pytest.mark.parametrize(("kind", "number"), [("feather", 4588), ("feather", 10591), ("uff", 14890)])
def test_what_once_escaped_is_refused(known, kind, number):
    # Seed 36: names that are no UTF-8, a function without data, both found only where they are asked for.
    with pytest.raises(SindyJointError, match=f"cannot be read as {kind}"):
        known[0][kind].run(known[0][kind].make(kind, 36, number), known[1])


def test_the_fuzz_sees_a_fault(known, monkeypatch):
    # The control: a reader that lets an error through is found.
    monkeypatch.setattr("sindyjoint.documents._LONG_KEY", None)
    with pytest.raises(AssertionError, match="manifest, seed 16"):
        test_an_input_is_understood_or_refused(known, "manifest")
