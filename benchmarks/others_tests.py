"""pysindy's own tests on ``UniqueShareSTLSQ`` and ``TermLibrary``, scikit-learn's on ``JointRegressor``.

pip download --no-binary :all: --no-deps pysindy && tar xf pysindy-*.tar.gz
python benchmarks/others_tests.py pysindy-*/test

The functions are pysindy's, imported from its source distribution; parts of this package stand where its own stood.
Each test of the three files is run, or named with the reason why it does not apply; one that is neither is a failure,
such as one that a later pysindy adds. What those files import for other optimizers alone (cvxpy, jax) is not needed.
"""

from __future__ import annotations

import argparse
import inspect
import json
import os
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock, patch

os.environ["SCIPY_ARRAY_API"] = "1"  # without it one of scikit-learn's checks is skipped

import pysindy
import pytest
from sklearn.utils.estimator_checks import check_estimator

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sindyjoint import JointRegressor, TermLibrary, UniqueShareSTLSQ  # noqa: E402

FILES = ("test_optimizers", "test_optimizers_complexity", "test_feature_library")
#: Parts of names of tests that ask a parameter or a function of another optimizer or library.
OF_OTHERS = (
    "bad_parameters", "bad_params", "sr3", "trapping", "sindypi", "sindy_pi", "sbr", "miosr", "frols", "ssr", "prox",
    "cvxpy", "pde", "constraint", "custom", "polynomial_", "fourier", "parameterized", "tensored_library",
    "generalized_library",
)  # fmt: skip
#: Other tests that do not apply, by the reason.
NOT_APPLICABLE = {
    "parameters are checked in fit, as scikit-learn asks": {"test_STLSQ_bad_parameters"},
    "it has neither normalize_columns, for it scales by itself, nor copy_X, nor verbose": {
        "test_alternate_parameters", "test_optimizers_verbose",
    },
    "there is no ridge whose bias a second fit takes away": {
        "test_illegal_unbias", "test_unbias", "test_unbias_external",
    },
    "there is no max_iter: the path of sets ends by itself": {"test_fit_warn"},
    "columns that always stay are `forced`": {
        "test_sparse_subset_multitarget", "test_sparse_subset_off_diagonal", "test_sparse_subset_unbias",
    },
    "asks the base class, a wrapper or a private function": {
        "test_not_implemented", "test_bad_optimizers", "test_normalize_columns", "test_remove_and_decrement",
    },
    "pysindy skips it; thresholds here are shares below 1": {"test_complexity_parameter"},
}  # fmt: skip


def reason_of(name: str) -> str:
    """Return why a test does not apply; nothing where that is not known."""
    other = "of another optimizer or library" if any(word in name for word in OF_OTHERS) else ""
    return next((reason for reason, names in NOT_APPLICABLE.items() if name in names), other)


def library() -> TermLibrary:
    """Return the paper's five terms; of Lorenz' three states they take two as angle and rate."""
    return TermLibrary("paper")


def joined() -> Any:
    """Return the same beside a polynomial."""
    return library() + pysindy.PolynomialLibrary()


def cases(test: Callable[..., None], data: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Return the arguments of a test that applies, with the parts of this package; none where it does not."""
    optimizer = UniqueShareSTLSQ
    of_library = test.__module__ == "test_feature_library"
    lorenz = data["data_lorenz"]
    with_libraries = [(lorenz, make()) for make in (library, joined)]
    match test.__name__:
        case "test_supports_multiple_targets":
            return [(optimizer, True)]
        case "test_fit":
            return [(data["data_derivative_1d"], each, None) for each in (optimizer(), optimizer(0.1))]
        case "test_not_fitted":
            return with_libraries if of_library else [(optimizer(),)]
        case "test_complexity_not_fitted":
            return [(optimizer(), data["data_derivative_2d"], None)]
        case "test_sample_weight_optimizers":
            return [(data["data_1d"], optimizer)]
        case "test_ensemble_optimizer" | "test_bad_ensemble_params":
            return [(lorenz, each) for each in parameters(test)]
        case "test_pickle":
            return [(lorenz, optimizer, each, None) for each in ({}, {"threshold": 0.0})]
        case "test_fit_transform" | "test_change_in_data_shape" | "test_get_feature_names":
            return with_libraries
        case "test_output_shape":
            return [(lorenz, library(), 5), (lorenz, joined(), 15)]
        case "test_concat" | "test_tensored":
            return [(lorenz,)]
        case "test_generalized_library_bad_parameters":
            ours = [each | {"libraries": [library() for _ in each["libraries"]]} for each in parameters(test)]
            return [(lorenz, each) for each in ours]
    return []


def parameters(test: Callable[..., None]) -> list[Any]:
    """Return what a test is parametrised with."""
    marks = [mark for mark in getattr(test, "pytestmark", []) if mark.name == "parametrize"]
    return list(marks[0].args[1]) if marks else []


def imported(folder: Path) -> tuple[dict[str, Any], list[ModuleType]]:
    """Return the data of pysindy's fixtures and its modules of tests."""
    for name in ("cvxpy", "jax"):
        try:
            import_module(name)
        except ImportError:
            sys.modules[name] = MagicMock()
    for name in ("SBR", "MIOSR", "SINDyPI", "ConstrainedSR3", "StableLinearSR3", "TrappingSR3"):
        if not hasattr(pysindy.optimizers, name):
            setattr(pysindy.optimizers, name, type(name, (MagicMock,), {}))
    pytest.lazy_fixture = str  # type: ignore[attr-defined]
    sys.path[:0] = [str(folder), str(folder / "test_optimizers")]
    fixtures = import_module("conftest")
    made = {}
    for name in ("data_1d", "data_lorenz", "data_derivative_1d", "data_derivative_2d"):
        fixture = getattr(fixtures, name)
        made[name] = inspect.unwrap(getattr(fixture, "_fixture_function", fixture))()
    return made, [import_module(name) for name in FILES]


def outcome(test: Callable[..., None], arguments: tuple[Any, ...]) -> str:
    """Return how a test ends with the parts of this package in the place of those that its module names."""
    module = sys.modules[test.__module__]
    ours = (
        {"STLSQ": UniqueShareSTLSQ} if hasattr(module, "EnsembleOptimizer") else {"IdentityLibrary": library}
    )
    try:
        with patch.multiple(module, **ours):
            test(*arguments)
    except (Exception, pytest.fail.Exception) as error:  # what is counted here
        return f"{type(error).__name__}: {error}"
    return "passed"


def main() -> None:
    """Run, print a line per test, fail where one fails or is not known."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tests", type=Path, help="folder `test` of pysindy's source distribution")
    parser.add_argument("--json", type=Path, help="file for the counts")
    given = parser.parse_args()
    made = [of_pysindy(given.tests.resolve()), of_scikit_learn()]
    for counts in made:
        print("{tests}: {passed} of {run} passed; {others} do not apply".format_map(counts))
    if given.json:
        given.json.write_text(json.dumps(made, indent=1) + "\n")
    raise SystemExit(any(counts["passed"] < counts["run"] for counts in made))


def of_pysindy(folder: Path) -> dict[str, Any]:
    """Return how many of pysindy's tests pass, and how many do not apply; print how each ends."""
    data, modules = imported(folder)
    counts = {
        "tests": f"pysindy {version('pysindy')}: optimizers, libraries",
        "passed": 0,
        "run": 0,
        "others": 0,
    }
    for module in modules:
        for name, test in inspect.getmembers(module, inspect.isfunction):
            if not name.startswith("test_") or test.__module__ != module.__name__:
                continue
            ends = [outcome(test, arguments) for arguments in cases(test, data)]
            reason = "" if ends else reason_of(name)
            counts["others"] += bool(reason)
            counts["passed"] += ends.count("passed")
            counts["run"] += len(ends) or not reason
            print(f"{module.__name__}::{name}: {'; '.join(dict.fromkeys(ends)) or reason or 'not known'}")
    return counts


def of_scikit_learn() -> dict[str, Any]:
    """Return how many checks of scikit-learn the regressor passes, and how many are declared not to apply."""
    ends = check_estimator(JointRegressor("paper"), on_fail=None, on_skip=None)
    status = [end["status"] for end in ends]
    for end in ends:
        if end["status"] != "passed":
            print(f"{end['check_name']}: {end['status']}: {end['exception']}")
    return {
        "tests": f"scikit-learn {version('scikit-learn')}: check_estimator",
        "passed": status.count("passed"),
        "run": status.count("passed") + status.count("failed"),
        "others": status.count("xfail") + status.count("skipped"),
    }


if __name__ == "__main__":
    main()
