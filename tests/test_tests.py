"""The tests themselves: examples in docstrings are run, fixtures that are shared are made once."""

import ast
import doctest
import inspect
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import sindyjoint
from tests.conftest import unit_of

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for path in sorted((ROOT / "sindyjoint").rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


# One that searches the whole structure.
SLOW = "sindyjoint.workflows.diagnose.diagnose_structure"


def run_examples(module, chosen):
    """Run the examples of a module's docstrings that are chosen by name; return how many lines were run."""
    # What pytest's own --doctest-modules allows; that would load all modules, and each worker would.
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for each in doctest.DocTestFinder().find(import_module(module)):
        if chosen(each.name):
            runner.run(each)
    assert not runner.failures
    return runner.tries


@pytest.mark.parametrize("module", EXAMPLES)
def test_examples_of_docstrings_give_what_they_show(module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_examples(module, lambda name: name != SLOW)


@pytest.mark.slow
def test_an_example_that_takes_long_gives_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_examples(SLOW.rpartition(".")[0], lambda name: name == SLOW)


@pytest.mark.parametrize("name", [each for each in sindyjoint.__all__ if not each.isupper()])
def test_a_public_name_has_an_example_that_is_run(name):
    each = getattr(sindyjoint, name)
    (own,) = doctest.DocTestFinder(recurse=False).find(each, name)
    # Python 3.13 takes the indentation off when it compiles.
    assert "\nExamples\n--------\n" in inspect.cleandoc(each.__doc__) and own.examples, name
    assert each.__module__ in EXAMPLES and not any(doctest.SKIP in line.options for line in own.examples)


def test_there_is_one_list_of_public_names_and_not_a_long_one():
    assert 40 <= len(sindyjoint.__all__) <= 60
    with pytest.raises(AttributeError):
        sindyjoint.workflow  # noqa: B018


#: What tests are skipped without and the extra ``test`` does not bring.
ELSEWHERE = {
    "openseespy": "a step of .ci/run installs it, where there is a wheel of it",
    "fcntl": "of POSIX, in the standard library",
    "psutil": "comes with distributed",
}


def test_what_tests_are_skipped_without_is_installed_with_them():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    always, wanted = (
        {name.lower() for each in lines for name in re.findall(r"[A-Za-z][\w-]*", each.split(">=")[0])}
        for lines in (project["dependencies"], sum(project["optional-dependencies"].values(), []))
    )
    source = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests").rglob("*.py")))
    asked = {name.lower().replace("_", "-") for name in re.findall(r'importorskip\(\s*"(\w+)', source)}
    assert len(asked) > 15 and asked - wanted == {*ELSEWHERE} and not asked & always


def test_a_test_asserts_something_or_calls_what_does():
    """Itself, by what raises (``pytest.raises``, ``check=True``), or by a function of the tests that asserts."""
    trees = {
        path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "tests").rglob("*.py"))
    }
    functions = [
        node for tree in trees.values() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    ]
    known = {"raises", "warns", "fail", "check"}
    called = {each: _called(each) for each in functions}
    while more := {each.name for each, names in called.items() if each.name not in known and names & known}:
        known |= more
    idle = [each.name for each in functions if each.name.startswith("test_") and each.name not in known]
    assert not idle


def _called(function):
    """Return the names of what a function calls; ``"check"`` is among them where it asserts itself."""
    names = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Assert):
            names.add("check")
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            checks = name.startswith("assert_") or any(each.arg == "check" for each in node.keywords)
            names.add("check" if checks else name)
    return names


def test_tests_that_share_a_fixture_share_a_worker():
    # Of a folder, of a file; cases of one function, and no others.
    assert unit_of("tests/scaling/test_batch.py::test_a") == unit_of("tests/scaling/test_parallel.py::test_b")
    assert unit_of("tests/planning/test_plan.py::test_a") == unit_of("tests/planning/test_plan.py::test_b[1]")
    free = "tests/diagnosis/test_diagnosis_structure.py::"
    assert unit_of(free + "test_a[1]") == unit_of(free + "test_a[2]") != unit_of(free + "test_b")
