"""What is imported when: a person waits for the modules that an answer needs, and for no others.

Times depend on the machine; the list of heavy modules does not.
"""

import json
import subprocess
import sys

import pytest

from sindyjoint.files import write_campaign
from sindyjoint.mechanics import virtual_campaign
from tests.made_models import paper_model

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
#: What each verb may load on a campaign of CSV files; one after the other in one interpreter, each may load more.
IN_TURN = {
    # Newer releases of typer check their parameters with pydantic; that is 0.1 s and not ours to defer.
    **dict.fromkeys(("--help", "--version", "discover --help", "libraries --help"), {"pydantic"}),
    "libraries list": {"numpy", "pydantic", "rich"},
    "check CAMPAIGN": ANSWER,
    "discover CAMPAIGN": MODEL,
    "verify MODEL CAMPAIGN": MODEL,
    "plan --campaign CAMPAIGN --time 20s": MODEL | STRUCTURE,
    "diagnose CAMPAIGN": MODEL | {"scipy.optimize"} | STRUCTURE,
}
#: The same of verbs that load what those before them do not, or less.
ALONE = {
    # The selectors are those of pysindy; the splits and paths of some are scikit-learn's, and bring what it imports.
    "compare CAMPAIGN -l paper --replicates 10": {n for n in HEAVY if "." not in n or n in PEAKS | MODEL}
    - PAGE
    - {"plotly", "h5py"},
    "libraries show paper": MODEL - {"numba"} | {"pint"},
    "schema": {"numpy", "pydantic", "scipy.linalg"},
}


def heavy_after(*codes: str) -> list[set[str]]:
    """Return the heavy modules that are imported once each of some codes has run, all in one fresh interpreter."""
    program = "import json, sys\nfound = []\n"
    for code in codes:
        program += (
            f"try:\n    {code}\nexcept SystemExit as leave:\n    assert not leave.code\n"
            f"found.append([name for name in {HEAVY!r} if name in sys.modules])\n"
        )
    run = subprocess.run(
        [sys.executable, "-c", program + "print('\\n' + json.dumps(found))"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [set(names) for names in json.loads(run.stdout.splitlines()[-1])]


def verb(*arguments: object) -> str:
    return f"from sindyjoint.cli import main; main({[str(each) for each in arguments]!r})"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return a campaign of CSV files and a model of it, by the words that stand for them in a command."""
    folder = tmp_path_factory.mktemp("import_time")
    plan = dict(frequencies=[3.0, 5.0], levels=[0.9, 0.5], duration=3.0, noise=0.01, random_state=0)
    write_campaign(virtual_campaign(**plan), folder / "campaign")
    (folder / "model.json").write_text(paper_model().to_json())
    return {"CAMPAIGN": folder / "campaign", "MODEL": folder / "model.json"}


def test_verbs_load_what_they_use(files):
    codes = [verb(*(files.get(word, word) for word in command.split())) for command in IN_TURN]
    for (command, allowed), loaded in zip(IN_TURN.items(), heavy_after(*codes), strict=True):
        assert loaded <= allowed, command


@pytest.mark.parametrize("command", ALONE)
def test_a_verb_alone_loads_what_it_uses(command, files):
    (loaded,) = heavy_after(verb(*(files.get(word, word) for word in command.split())))
    assert loaded <= ALONE[command]


def test_a_page_loads_what_draws_it(files, tmp_path):
    (loaded,) = heavy_after(verb("check", files["CAMPAIGN"], "--out", tmp_path / "out"))
    assert loaded <= ANSWER | PAGE


def test_public_names_come_when_asked_for():
    names = "Campaign, Joint, Run, load_campaign"
    package, light, heavy = heavy_after(
        "import sindyjoint", f"from sindyjoint import {names}", "from sindyjoint import JointRegressor"
    )
    assert package == set() and light <= {"numpy", "pydantic"} and "sklearn" in heavy


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
