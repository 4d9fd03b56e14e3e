"""--verbose prints steps, times and the numbers behind a result on stderr; --quiet nothing; stdout never changes."""

import re
import sys
from pathlib import Path

import pytest
from test_cli_help import EVERY

import sindyjoint
from sindyjoint.files import write_campaign
from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.policy import policies
from sindyjoint.reporting.registry import VIEWS, details

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "reporting"))
from handmade_results import comparison, diagnosis, structure, verification  # noqa: E402

COMPUTE = ("batch", "compare", "diagnose", "discover", "reproduce", "simulate", "verify")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = virtual_campaign("inter-panel", frequencies=[3, 6], levels=[0.9, 0.5], duration=3, random_state=2)
    return write_campaign(made, tmp_path_factory.mktemp("runs")).parent


@pytest.mark.parametrize("name", COMPUTE)
def test_every_command_that_computes_has_both(name):
    names = {parameter.name for parameter in EVERY[(name,)].params}
    assert {"quiet", "verbose"} <= names


def test_verbose_changes_stderr_only(sindyjoint, folder):
    plain = sindyjoint("discover", folder, "--library", "paper")
    loud = sindyjoint("discover", folder, "--library", "paper", "--verbose")
    assert plain.status == loud.status == 0 and plain.stderr == "" and loud.stdout == plain.stdout
    lines = loud.stderr.splitlines()
    stages = [re.fullmatch(r" *(\d+\.\d\d) s  (.+)", line) for line in lines]
    times = [float(found[1]) for found in stages if found]
    assert times == sorted(times) and [found[2] for found in stages if found][0] == "starting"
    assert "selecting terms" in loud.stderr
    # The numbers behind it: the noise of each run, the models near the chosen one, the unique share of each term.
    assert re.search(
        r"3Hz-0.9 +\d+ +1000 Hz +periodic +\S+ Hz +[\d.]+ % +[\d.e-]+ rad +[\d.e-]+ N·m", loud.stderr
    )
    assert re.search(r"chosen +5 +0\.0\d+ +0\.0\d+", loud.stderr)
    assert re.search(r"coulomb_friction +\d+\.\d+ % +\d+\.\d+ %", loud.stderr)


def test_quiet_and_verbose_contradict_each_other(sindyjoint, tmp_path):
    answer = sindyjoint("simulate", "--out", tmp_path / "v", "--quiet", "--verbose")
    assert answer.status == 2 and answer.stdout == "" and answer.stderr.count("\n") == 1
    assert "--verbose: contradicts --quiet; choose one of them" in answer.stderr
    assert not (tmp_path / "v").exists()


def test_simulated_runs_are_told_one_by_one(sindyjoint, tmp_path):
    options = ("--frequencies", "4", "--levels", "0.8", "--duration", "2")
    loud = sindyjoint("simulate", "--out", tmp_path / "v", *options, "--verbose")
    assert loud.status == 0
    assert re.search(r"4Hz-0.8 +2000 +1000 Hz +4 Hz +7\.\d+e-04 rad +5\.\d+ N·m", loud.stderr)
    quiet = sindyjoint("simulate", "--out", tmp_path / "q", *options, "--quiet")
    assert quiet.stderr == "" and quiet.status == 0


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (
            verification(),
            "pulse at tip         pulse     2501   0.02   0.01       0.01732       0.05          20",
        ),
        (verification(failed=True), "–"),
        (diagnosis(), "bouc_wen"),
        (structure(), "bouc_wen"),
        (structure(), "tip        4001  1.00e-05 m"),
        (comparison(), "lasso_lars"),
    ],
)
def test_what_lies_behind_other_results(result, words):
    text = "\n".join(details(result))
    assert words in text and not re.search(r"\bnan\b", text)


def test_what_is_no_result_is_refused():
    with pytest.raises(TypeError, match="object is no result; known are Discovery, ReportData, "):
        list(details(object()))


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A package with two policies in one folder, one in another, and a folder without."""
    limits = "from dataclasses import dataclass, replace\nfrom sindyjoint.policy import limit\n"
    limits += "@dataclass(frozen=True)\nclass P:\n    least: float = limit(0.2, 'least share', source='convention')\n"
    limits += "    late: float = limit(2.0, 'largest delay', source='measured', unit='ms')\n"
    texts = {
        "states/policy.py": f"{limits}POLICY = P()\n",
        "diagnosis/policy.py": f"{limits}CAMPAIGN = P()\nSTRUCTURE = replace(CAMPAIGN, least=0.3)\nOTHER = 3\n",
        "files/read.py": "",
    }
    for name, text in texts.items():
        path = tmp_path / "toyjoint" / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
        (path.parent / "__init__.py").write_text("")
    (tmp_path / "toyjoint" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    yield policies("toyjoint")
    for name in [name for name in sys.modules if name.partition(".")[0] == "toyjoint"]:
        del sys.modules[name]


def test_the_policies_in_force_are_listed(toy, monkeypatch):
    assert {name: record.least for name, record in toy.items()} == {
        "states": 0.2,
        "diagnosis campaign": 0.2,
        "diagnosis structure": 0.3,
    }
    monkeypatch.setattr("sindyjoint.reporting.registry.policies", lambda: toy)
    assert "policy of diagnosis structure: least 0.3, late 2.0 ms" in list(details(structure()))
    lines = list(details(diagnosis()))
    assert "policy of states: least 0.2, late 2.0 ms" in lines
    assert not any(line.startswith("policy of diagnosis structure") for line in lines)


def test_a_view_names_folders_that_there_are():
    parts = {path.name for path in Path(sindyjoint.__file__).parent.iterdir() if path.is_dir()}
    for view in VIEWS:
        assert {name.split()[0] for name in view.judged_by} <= parts
