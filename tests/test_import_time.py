"""What is imported when: a person waits for the modules that an answer needs, and for no others.

Times depend on the machine; the list of heavy modules does not.
"""

import json
import subprocess
import sys

import pytest

from sindyjoint.files import write_campaign
from sindyjoint.mechanics import virtual_campaign

HEAVY = (
    "numpy", "pysindy", "sklearn", "scipy.linalg", "scipy.signal", "scipy.stats", "scipy.optimize", "scipy.interpolate",
    "scipy.special", "pandas", "matplotlib", "sympy", "numba", "pint", "pydantic", "plotly", "dask", "joblib", "jinja2",
    "pyarrow", "h5py", "rich", "sindyjoint.mechanics.transient", "sindyjoint.substructure.recovery",
)  # fmt: skip
# The table of pydantic's fields, that of a terminal, and linear algebra are in every answer.
ANSWER = {"numpy", "scipy.linalg", "pydantic", "rich"}
# A formula is parsed by sympy, an interval is of Student's t; joints are simulated by numba.
MODEL = ANSWER | {"sympy", "scipy.special", "numba"}
PEAKS = {"scipy.signal", "scipy.stats", "scipy.optimize", "scipy.interpolate"}
PAGE = {"matplotlib", "jinja2"}
# A diagnosis has the records of joint and structure in one.
STRUCTURE = {"sindyjoint.substructure.recovery"}
#: What each verb may load on a campaign of CSV files.
MAY_LOAD = {
    "check CAMPAIGN": ANSWER,
    "discover CAMPAIGN": MODEL,
    "verify MODEL CAMPAIGN": MODEL,
    "diagnose CAMPAIGN": MODEL | {"scipy.optimize"} | STRUCTURE,
    "plan --campaign CAMPAIGN --time 20s": MODEL | STRUCTURE,
    # The selectors are those of pysindy; the splits and paths of some are scikit-learn's, and bring what it imports.
    "compare CAMPAIGN": {n for n in HEAVY if "." not in n or n in PEAKS | MODEL} - PAGE - {"plotly", "h5py"},
    "libraries list": {"numpy", "pydantic", "rich"},
    "libraries show paper": MODEL - {"numba"} | {"pint"},
    "schema": {"numpy", "pydantic", "scipy.linalg"},
}


def heavy_after(code: str, *arguments: object) -> set[str]:
    """Return the heavy modules that are imported once ``code`` has run in a fresh interpreter."""
    program = (
        f"import json, sys\ntry:\n    {code}\nexcept SystemExit as leave:\n    assert not leave.code\n"
        f"print('\\n' + json.dumps([name for name in {HEAVY!r} if name in sys.modules]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)], capture_output=True, text=True, check=True
    )
    return set(json.loads(run.stdout.splitlines()[-1]))


VERB = "from sindyjoint.cli import main; main(sys.argv[1:])"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return a campaign of CSV files and a model of it, by the words that stand for them in a command."""
    folder = tmp_path_factory.mktemp("import_time")
    plan = dict(frequencies=[3.0, 5.0], levels=[0.9, 0.5], duration=3.0, noise=0.01, random_state=0)
    write_campaign(virtual_campaign(**plan), folder / "campaign")
    heavy_after(VERB, "discover", folder / "campaign", "--out", folder / "found")
    return {"CAMPAIGN": folder / "campaign", "MODEL": folder / "found" / "model.json"}


@pytest.mark.parametrize("command", MAY_LOAD)
def test_a_verb_loads_what_it_uses(command, files):
    assert heavy_after(VERB, *(files.get(word, word) for word in command.split())) <= MAY_LOAD[command]


def test_a_page_loads_what_draws_it(files, tmp_path):
    assert heavy_after(VERB, "check", files["CAMPAIGN"], "--out", tmp_path / "out") <= ANSWER | PAGE


def test_import_of_the_package_is_light():
    assert heavy_after("import sindyjoint") == set()


def test_public_names_come_when_asked_for():
    assert heavy_after("from sindyjoint import Campaign, Joint, Run, load_campaign") <= {"numpy", "pydantic"}
    assert "sklearn" in heavy_after("from sindyjoint import JointRegressor")


@pytest.mark.parametrize("arguments", ["--help", "--version", "discover --help", "libraries --help"])
def test_help_is_light(arguments):
    # Newer releases of typer check their parameters with pydantic; that is 0.1 s and not ours to defer.
    assert heavy_after(VERB, *arguments.split()) <= {"pydantic"}


def test_a_refused_output_is_refused_before_the_heavy_imports(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    program = (
        "import sys\nfrom sindyjoint.cli import main\ntry:\n    main(sys.argv[1:])\nexcept SystemExit as leave:\n"
        "    print(leave.code, 'sympy' in sys.modules, 'numba' in sys.modules)"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, "discover", "--out", str(blocked)], capture_output=True, text=True
    )
    assert run.stdout.split() == ["2", "False", "False"]
