"""The effects on the command line."""

import json

import pytest

from sindyjoint.cli import main
from tests.conftest import LIBRARIES


def run(*arguments):
    with pytest.raises(SystemExit) as leave:
        main(["libraries", *arguments])
    return leave.value.code


def test_effects_are_listed_as_text_and_as_json(capsys):
    assert run("effects") == 0
    text = capsys.readouterr().out
    assert run("effects", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert {"id", "family", "meaning", "confused_with"} == set(record[0])
    assert all(entry["id"] in text for entry in record)


def test_check_knows_a_file_of_effects(capsys):
    path = LIBRARIES / "effects" / "memory.toml"
    assert run("check", str(path)) == 0
    assert "effect(s): dahl_friction" in capsys.readouterr().out


def test_check_names_the_fault_of_an_effect(capsys, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "m"\ndescription = "m"\n[[effect]]\nid = "m"\n')
    assert run("check", str(path)) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "mine.toml: [[effect]] 1 (m): key 'name' is missing" in error
