"""What is imported when: a person who asks for help does not wait for pysindy.

Times depend on the machine; the list of heavy modules does not.
"""

import json
import subprocess
import sys

import pytest

HEAVY = (
    "pysindy", "sklearn", "scipy", "pandas", "matplotlib", "sympy", "numba", "pint", "pydantic", "plotly", "dask",
    "joblib", "jinja2", "pyarrow", "h5py",
)  # fmt: skip


def heavy_after(code: str, *arguments: str) -> list[str]:
    """Return the heavy modules that are imported once ``code`` has run in a fresh interpreter."""
    program = (
        f"import json, sys\ntry:\n    {code}\nexcept SystemExit as leave:\n    assert not leave.code\n"
        f"print('\\n' + json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True
    )
    return json.loads(run.stdout.splitlines()[-1])


def test_import_of_the_package_is_light():
    assert heavy_after("import sindyjoint") == []


def test_public_names_come_when_asked_for():
    assert heavy_after("from sindyjoint import Campaign, Joint, Run, load_campaign") in ([], ["pydantic"])
    assert "sklearn" in heavy_after("from sindyjoint import JointRegressor")


@pytest.mark.parametrize("arguments", ["--help", "--version", "discover --help", "libraries --help"])
def test_help_is_light(arguments):
    heavy = heavy_after(f"from sindyjoint.cli import main; main({arguments.split()!r})")
    # Newer releases of typer check their parameters with pydantic; that is 0.1 s and not ours to defer.
    assert set(heavy) <= {"pydantic"}


def test_listing_the_libraries_needs_no_regression():
    heavy = heavy_after("from sindyjoint.cli import main; main(['libraries', 'list'])")
    assert not {"pysindy", "sklearn", "numba", "matplotlib", "pandas"} & set(heavy)


def test_a_refused_output_is_refused_before_the_heavy_imports(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    program = (
        "import sys\nfrom sindyjoint.cli import main\ntry:\n    main(sys.argv[1:])\nexcept SystemExit as leave:\n"
        "    print(leave.code, 'pysindy' in sys.modules, 'numba' in sys.modules)"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, "discover", "--out", str(blocked)], capture_output=True, text=True
    )
    assert run.stdout.split() == ["2", "False", "False"]
