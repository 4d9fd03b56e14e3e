"""The tests themselves: examples in docstrings are run, fixtures that are shared are made once."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

from tests.conftest import unit_of

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "sindyjoint").rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("module", EXAMPLES)
def test_examples_of_docstrings_give_what_they_show(module):
    # What pytest's own --doctest-modules allows; that would load all 500 modules, and each worker would.
    tried = doctest.testmod(import_module(module), optionflags=doctest.ELLIPSIS)
    assert not tried.failed
    assert tried.attempted or "doctest: +SKIP" in Path(import_module(module).__file__).read_text("utf-8")


def test_tests_that_share_a_fixture_share_a_worker():
    # Of a folder, of a file; cases of one function, and no others.
    assert unit_of("tests/scaling/test_batch.py::test_a") == unit_of("tests/scaling/test_parallel.py::test_b")
    assert unit_of("tests/planning/test_plan.py::test_a") == unit_of("tests/planning/test_plan.py::test_b[1]")
    free = "tests/diagnosis/test_diagnosis_structure.py::"
    assert unit_of(free + "test_a[1]") == unit_of(free + "test_a[2]") != unit_of(free + "test_b")
