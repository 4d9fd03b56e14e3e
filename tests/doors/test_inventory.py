"""Nothing that a user can reach comes or goes unnoticed, and each item is held by a test."""

import ast
import importlib
import json

import pytest

import sindyjoint
from sindyjoint import errors
from tests.doors.inventory import GOLDEN, HOLDERS, TESTS, holder_of_option, inventory

KNOWN = json.loads(GOLDEN.read_text(encoding="utf-8"))
# Shown by typer itself.
OF_TYPER = {"--install-completion"}


def test_the_inventory_is_what_the_doors_offer(sindyjoint):
    found = inventory(sindyjoint)
    for section, items in found.items():
        # As JSON has it.
        assert json.loads(json.dumps(items)) == KNOWN[section], (
            f"{section}: if this is meant, run python -m tests.doors.inventory and say so in CHANGELOG.md"
        )
    assert list(found) == list(KNOWN) and all(KNOWN.values())


@pytest.mark.parametrize("section", KNOWN)
def test_each_section_is_held_by_a_test(section):
    file, _, name = HOLDERS[section].partition("::")
    module = ast.parse((TESTS.parent / file).read_text(encoding="utf-8"))
    assert name in {node.name for node in module.body if isinstance(node, ast.FunctionDef)}, HOLDERS[section]


@pytest.mark.parametrize("command", KNOWN["commands"])
def test_every_option_is_given_by_a_test(command):
    without = [
        option for option in KNOWN["commands"][command]
        if option not in OF_TYPER and not holder_of_option(command, option)
    ]  # fmt: skip
    assert without == []


def test_an_option_that_no_test_gives_is_seen():
    assert holder_of_option("discover", "-" + "-shout") is None
    assert holder_of_option("check", "--json")


@pytest.mark.parametrize("name", KNOWN["names"])
def test_public_names_are_documented_and_signed(name):
    # One line first, then a section for each parameter of its own.
    each = getattr(sindyjoint, name)
    text = each.__doc__ or ""
    assert text.strip().splitlines()[0].endswith("."), name
    if not isinstance(each, type):
        own = [p for p in KNOWN["names"][name] if p not in ("options", "parameters")]
        assert [p for p in own if p not in text] == [], name


@pytest.mark.parametrize("name", KNOWN["errors"])
def test_errors_are_of_one_family(name):
    kind = getattr(errors, name)
    assert issubclass(kind, errors.SindyJointError) and kind.__doc__
    builtin = [base for base in kind.__mro__ if base.__module__ == "builtins"]
    assert kind is errors.SindyJointError or len(builtin) > 3, "one of the builtins, too"


def test_names_come_from_where_they_are_said_to():
    for name in sindyjoint.__all__:
        each = getattr(sindyjoint, name)
        assert getattr(importlib.import_module(each.__module__), name) is each
