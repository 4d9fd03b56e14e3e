"""The guide keeps its word: it builds without a warning, commands run, samples load, public names are documented."""

import re
import shlex
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from fresh_clone import blocks, commands_of, write_own_data

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("**/*.md"))
API = (DOCS / "api.md").read_text(encoding="utf-8")
START = (DOCS / "guide" / "start.md").read_text(encoding="utf-8")


def test_it_builds_without_a_warning(tmp_path):
    pytest.importorskip("sphinx", reason="sphinx is not installed: the guide is not built")
    for name in ("myst_parser", "furo", "latex2mathml"):
        pytest.importorskip(name, reason=f"{name} is not installed: the guide is not built")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", DOCS, tmp_path / "html"],
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    page = (tmp_path / "html" / "api.html").read_text(encoding="utf-8")
    method = (tmp_path / "html" / "guide" / "method.html").read_text(encoding="utf-8")
    assert "<math" in method and "http" not in re.sub(
        r"<math[^>]*>", "", "".join(re.findall(r"<script[^>]*>", method))
    )
    assert 'id="sindyjoint.discover"' in page and "Find which terms the equation of a joint has." in page


@pytest.mark.parametrize("module", ["sindyjoint", "sindyjoint.reporting", "sindyjoint.errors"])
def test_no_public_name_is_undocumented(module):
    home = import_module(module)
    if f".. automodule:: {module}\n   :members:" in API:
        return
    missing = [name for name in home.__all__ if f":: {module}.{name}\n" not in API]
    assert missing == []
    for name in home.__all__:
        assert (getattr(home, name).__doc__ or "").strip(), name


def test_every_command_has_a_line():
    from sindyjoint.cli.app import app

    names = {command.name for command in app.registered_commands} | {
        group.name for group in app.registered_groups
    }
    text = (DOCS / "guide" / "commands.md").read_text(encoding="utf-8")
    assert names - set(re.findall(r"^\| `sindyjoint (\w+)", text, re.M)) == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_the_guide_names_files_that_exist():
    for page in PAGES:
        for name in re.findall(
            r"`((?:libraries|benchmarks|examples)/[\w/]+\.\w+)`", page.read_text(encoding="utf-8")
        ):
            assert (ROOT / name).exists(), f"{page.name}: {name}"


def test_a_newcomer_gets_there_in_three_commands(tmp_path):
    commands = commands_of(START)
    # The first installs: the script that checks everything types it in a fresh clone.
    assert len(commands) <= 3
    assert commands[0] in (ROOT / "README.md").read_text(encoding="utf-8")
    assert "tests/docs/fresh_clone.py" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    write_own_data(START, tmp_path / "hinge")
    for command in commands[1:]:
        words = shlex.split(command)
        assert words[0] == ".venv/bin/sindyjoint"
        done = subprocess.run(
            [sys.executable, "-m", "sindyjoint", *words[1:]], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    assert "linear_stiffness" in done.stdout and "coulomb_friction" in done.stdout
    assert (tmp_path / "results" / "report.html").stat().st_size > 100_000


def test_samples_of_manifests_and_catalogues_load(tmp_path):
    from sindyjoint.equation.catalogue import load_catalogue
    from sindyjoint.files.manifest import Manifest
    from sindyjoint.mechanics.rig_file import RigFile

    manifests = catalogues = 0
    for page in PAGES:
        for sample in blocks(page.read_text(encoding="utf-8"), "toml"):
            data = tomllib.loads(sample)
            if "term" in data:
                path = tmp_path / "sample.toml"
                path.write_text(sample, encoding="utf-8")
                assert data["term"][0]["id"] in load_catalogue(path).ids
                catalogues += 1
            elif "chain" in data:
                assert RigFile.model_validate(data).chain
            else:
                Manifest.model_validate(data)
                manifests += 1
    assert manifests >= 2 and catalogues >= 1
