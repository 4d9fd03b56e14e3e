"""Every limit that decides an answer is explained, printed and used."""

import ast
import dataclasses
import importlib.util
import json
from functools import cache
from pathlib import Path

import pytest

from sindyjoint.policy import described, policies

ROOT = Path(__file__).resolve().parents[2]


POLICIES = policies()


def test_limits_are_printed_with_what_set_them(sindyjoint):
    record = json.loads(sindyjoint("limits", "--json").stdout)
    assert set(record) == set(POLICIES)
    told = record["shared"]["tolerated"]
    assert told["value"] == 0.05 and told["source"] and told["meaning"]
    assert "tolerated" not in record["states"] and POLICIES["states"].tolerated == told["value"]
    assert record["diagnosis in_place"]["least_help"]["value"] == 0.5
    printed = sindyjoint("limits", "states").stdout
    assert "harmonic_misses = 4" in printed and "from: measured on simulated" in printed
    assert "least_help" not in printed
    wrong = sindyjoint("limits", "kitchen")
    assert wrong.status == 2 and "no part 'kitchen' has limits; expected one of" in wrong.stderr


def test_the_page_of_keys_is_what_reads_the_files():
    # After a change of a key: python docs/write_keys.py
    spec = importlib.util.spec_from_file_location("write_keys", ROOT / "docs" / "write_keys.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = (ROOT / "docs" / "guide" / "keys.md").read_text(encoding="utf-8")
    assert text == module.page()
    assert "|None|" not in text, "a key without a description"
    assert {"`skip`", "`gain`", "`clamp_stiffness`", "`use`"} <= set(text.replace("|", " ").split())


def test_every_folder_that_decides_has_a_policy():
    needed = {
        "diagnosis",
        "discovery",
        "equation",
        "response",
        "soundness",
        "states",
        "judgement",
        "shared",
        "measurement",
    }
    assert needed <= {name.split()[0] for name in POLICIES}


@pytest.mark.parametrize("name", POLICIES)
def test_a_limit_is_explained_and_cannot_be_changed(name):
    policy = POLICIES[name]
    for item in described(policy):
        assert item.meaning and item.unit and item.source, item.name
        assert "|" not in item.meaning + item.source, item.name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(policy, described(policy)[0].name, 0)


@cache
def attributes_used():
    """Every name that the package takes of an object."""
    used = set()
    for path in (ROOT / "sindyjoint").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute):
                used.add(node.attr)
    return used


@pytest.mark.parametrize("name", POLICIES)
def test_every_limit_is_used(name):
    fields = {item.name for item in described(POLICIES[name])}
    assert fields - attributes_used() == set()
