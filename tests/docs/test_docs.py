"""The guide keeps its word: it builds without a warning, commands run, samples load, public names are documented."""

import re
import shlex
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("**/*.md"))
API = (DOCS / "api.md").read_text(encoding="utf-8")
START = (DOCS / "guide" / "start.md").read_text(encoding="utf-8")


def blocks(text, language):
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)


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


def logged(path, frequency, level, seed):
    """Write a run the way a logger would: a joint of k1, c1 and friction, moved by a sine, with 1 % noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 4, 1e-3)
    phase = 2 * np.pi * frequency * time
    angle, rate = level * np.sin(phase), level * 2 * np.pi * frequency * np.cos(phase)
    moment = 0.02 * -level * (2 * np.pi * frequency) ** 2 * np.sin(phase)
    moment += 6000 * angle + 50 * rate + 1.9 * np.sign(rate)
    moment += 0.01 * np.std(moment) * rng.normal(size=time.size)
    angle += 0.01 * np.std(angle) * rng.normal(size=time.size)
    rows = [f"{t:.4f},{m:.6f},{1e3 * a:.7f}" for t, m, a in zip(time, moment, angle, strict=True)]
    path.write_text("time,moment,angle\n" + "\n".join(rows) + "\n")


def test_a_newcomer_gets_there_in_three_commands(tmp_path):
    commands = [line for block in blocks(START, "sh") for line in block.strip().splitlines()]
    # The first installs; its words are those that the README has, which the script that checks everything runs.
    assert len(commands) <= 3
    assert commands[0] in (ROOT / "README.md").read_text(encoding="utf-8")
    (manifest,) = blocks(START, "toml")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "campaign.toml").write_text(manifest, encoding="utf-8")
    for seed, run in enumerate(tomllib.loads(manifest)["run"]):
        level = 7e-4 if run["level"] == "high" else 4e-4
        logged(tmp_path / "tests" / run["file"], run["frequency"], level, seed)
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
    from sindyjoint.discovery.catalogue import load_catalogue
    from sindyjoint.files.manifest import Manifest

    manifests = catalogues = 0
    for page in PAGES:
        for sample in blocks(page.read_text(encoding="utf-8"), "toml"):
            data = tomllib.loads(sample)
            if "term" in data:
                path = tmp_path / "sample.toml"
                path.write_text(sample, encoding="utf-8")
                assert data["term"][0]["id"] in load_catalogue(path).ids
                catalogues += 1
            else:
                Manifest.model_validate(data)
                manifests += 1
    assert manifests >= 2 and catalogues >= 1
