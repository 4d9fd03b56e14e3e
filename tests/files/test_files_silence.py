"""Workbooks, JSON, LabVIEW files and test.json that used to be taken in silence, or without end: refused in a line."""

import io
import json
import time
import zipfile

import pytest
from fuzz import made_test
from made_files import lvm, xlsx

from sindyjoint.documents import SUMS, sums_of, sums_text
from sindyjoint.equation import read_test
from sindyjoint.errors import InputError
from sindyjoint.files import VARIABLE, read_table


def workbook(old: bytes, new: bytes) -> bytes:
    """Return a workbook with other XML in its sheets."""
    out = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(xlsx())) as book,
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as other,
    ):
        for name in book.namelist():
            data = book.read(name)
            other.writestr(name, data.replace(old, new) if "worksheets" in name else data)
    return out.getvalue()


END = b"</sheetData>"
LVM = lvm()
RUNS = {
    "a row without end": (
        "xlsx",
        workbook(END, b'<row r="99999999999"/>' + END),
        "beyond the limit of 20 MB",
    ),
    "a column without end": (
        "xlsx",
        workbook(END, b'<row r="90"><c r="ZZZ90"><v>1</v></c></row>' + END),
        "18278",
    ),
    "a workbook that grows": ("xlsx", workbook(END, b" " * 30_000_000 + END), "beyond the limit of 20 MB"),
    "entities that grow": ("xlsx", workbook(b"<sheetData>", b"<!DOCTYPE a><sheetData>"), "Excel workbook"),
    "a key twice": ("json", b'{"t": [1, 2], "t": [3, 4]}', "the key 't' is there twice"),
    "a name twice": ("json", b'{"columns": ["t", "t"], "data": [[1, 2]]}', "the key 't' is there twice"),
    "a path twice": ("json", b'{"a.b": [1, 2], "a": {"b": [3]}}', "the key 'a.b' is there twice"),
    "an integer of 400 digits": ("json", b'{"t": [1, %s]}' % (b"9" * 400), "an integer that is no number"),
    "an integer of 5000 digits": ("json", b'{"t": [1, %s]}' % (b"9" * 5000), "4300 digits"),
    "lists in lists": ("json", b'{"t": %s1%s}' % (b"[" * 100_000, b"]" * 100_000), "recursion"),
    "JSON that grows": ("json", b'{"t": [%s1]}' % (b"1," * 2_000_000), "beyond the limit of 20 MB"),
    "a segment cut short": ("lvm", LVM[: LVM.rindex(b"\n", 0, -30)], "announces 32 samples and holds"),
    "a step that is text": ("lvm", lvm("No").replace(b"Delta_X\t0", b"Delta_X\tx"), "LabVIEW measurement"),
}


@pytest.mark.parametrize("kind", RUNS)
def test_what_was_taken_in_silence_is_refused(tmp_path, monkeypatch, kind):
    ending, data, message = RUNS[kind]
    monkeypatch.setenv(VARIABLE, "20 MB")
    (tmp_path / f"run.{ending}").write_bytes(data)
    begun = time.process_time()
    with pytest.raises(InputError, match=message) as refusal:
        table, _ = read_table(tmp_path / f"run.{ending}")
        table.columns(list(table.names))
    assert "\n" not in str(refusal.value) and time.process_time() - begun < 5


def test_a_sheet_need_not_believe_the_size_it_states(tmp_path):
    (tmp_path / "run.xlsx").write_bytes(
        workbook(b'<dimension ref="A1:C67"', b'<dimension ref="A1:XFD1048576"')
    )
    table, _ = read_table(tmp_path / "run.xlsx")
    assert table.names == ("t", "m", "a") and table.columns(["m"])[0].size == 64


def test_channels_of_one_name_are_told_apart_by_their_number(tmp_path):
    (tmp_path / "run.lvm").write_bytes(LVM.replace(b"X_Value\tm\ta", b"X_Value\tm\tm"))
    table, _ = read_table(tmp_path / "run.lvm")
    first, second = table.columns([2, 3])
    assert not (first == second).any()
    with pytest.raises(InputError, match="column 'm' is there 2 times"):
        table.columns(["m"])


def test_a_damaged_tdms_file_says_one_thing(tmp_path, capfd):
    pytest.importorskip("nptdms")
    from made_files import tdms

    (tmp_path / "run.tdms").write_bytes(tdms()[:-100])
    with pytest.raises(InputError, match="truncated"):
        read_table(tmp_path / "run.tdms")
    assert capfd.readouterr() == ("", "")


def test_a_tampered_record_of_a_test_is_refused(tmp_path):
    text = made_test().to_json()
    file = tmp_path / "test.json"
    file.write_text(text)
    (tmp_path / SUMS).write_text(sums_text(sums_of(tmp_path)))
    assert read_test(tmp_path).to_json() == text
    file.write_text(text.replace('"value": 0.002', '"value": 0.003'))
    with pytest.raises(InputError, match="is not the file that was written"):
        read_test(tmp_path)
    (tmp_path / SUMS).unlink()
    data = json.loads(text)
    for changed, message in (
        (text.replace('"value": 0.002', '"value": ' + "9" * 400), "holds an integer"),
        (text.replace('"value": 0.002', '"value": NaN'), "value"),
        (text[:-30], "is not JSON"),
        (json.dumps([data]), "not a record of a test"),
        (json.dumps(data | {"nuisances": data["nuisances"] + [None]}), "nuisances"),
        (text.replace('"kind"', '"schema": 1, "kind"'), "the key 'schema' is there twice"),
        (text.replace('"a"', '"\\u001b[31m"'), "control character"),
    ):
        file.write_text(changed)
        with pytest.raises(InputError, match=message) as refusal:
            read_test(tmp_path)
        assert "\n" not in str(refusal.value)
