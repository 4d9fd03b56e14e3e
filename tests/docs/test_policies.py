"""The guide's page of limits says what the package decides by, and no limit hides elsewhere in these folders."""

import ast
import dataclasses
import importlib.util
from functools import cache
from pathlib import Path

import pytest

from sindyjoint.policy import described, policies

ROOT = Path(__file__).resolve().parents[2]


def writer():
    spec = importlib.util.spec_from_file_location("write_policies", ROOT / "docs" / "write_policies.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


POLICIES = policies()


def test_the_page_is_what_the_records_say():
    # After a change of a limit: python docs/write_policies.py
    text = (ROOT / "docs" / "guide" / "policies.md").read_text(encoding="utf-8")
    assert text == writer().page()
    assert "guide/policies\n" in (ROOT / "docs" / "index.md").read_text(encoding="utf-8")


def test_the_page_of_keys_is_what_reads_the_files():
    # After a change of a key: python docs/write_keys.py
    spec = importlib.util.spec_from_file_location("write_keys", ROOT / "docs" / "write_keys.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = (ROOT / "docs" / "guide" / "keys.md").read_text(encoding="utf-8")
    assert text == module.page()
    assert "None |" not in text, "a key without a description"
    assert {"`skip`", "`gain`", "`clamp_stiffness`", "`use`"} <= set(text.replace("|", " ").split())


def test_every_folder_that_decides_has_a_policy():
    needed = {
        "batch",
        "bias",
        "diagnosis",
        "discovery",
        "equation",
        "response",
        "soundness",
        "states",
        "judgement",
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
