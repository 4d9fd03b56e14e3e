"""The README keeps its word: its two commands, its samples, its fields, its links."""

import json
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [
    line for block in re.findall(r"```sh\n(.*?)```", README, re.S) for line in block.strip().splitlines()
]


def test_there_are_two_commands_of_one_line_each():
    assert len(COMMANDS) == 2
    for command in COMMANDS:
        assert command.startswith("python3 -m venv .venv && .venv/bin/pip install -q ")
    assert COMMANDS[0].endswith("&& .venv/bin/sindyjoint discover")
    assert COMMANDS[1].endswith('-e ".[test]" && .venv/bin/python -m pytest')


def test_the_script_that_checks_everything_runs_the_second_command():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert COMMANDS[1] in script.splitlines()
    assert "set -euo pipefail" in script
    subprocess.run(["bash", "-n", ROOT / ".ci" / "run"], check=True)


def test_the_first_command_ends_in_a_discovery():
    # The installation is the business of the script above; what it installs is run here, as a separate process.
    words = COMMANDS[0].split("&&")[-1].split()
    run = subprocess.run(
        [sys.executable, "-m", *[Path(words[0]).name, *words[1:]]], capture_output=True, text=True
    )
    # On a busy machine, from the third second on, a line for each stage.
    assert run.returncode == 0 and re.fullmatch(r"( *[\d.]+ s  [^\n]+\n)*", run.stderr), run.stderr
    assert "(simulated)" in run.stdout and "paper's term set confirmed" in run.stdout
    # "prints, among other things", line by line; after a change: copy them
    sample = README.split("among other things:", 1)[1].split("```")[1].removeprefix("text\n")
    assert {*sample.splitlines()} <= {line.rstrip() for line in run.stdout.splitlines()}


def test_the_extras_that_it_names_exist():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = set(re.findall(r'"\.\[(\w+)\]"', README)) | set(re.findall(r"\.\[(\w+)\]", README))
    assert named and named <= set(project["optional-dependencies"])


def test_it_explains_every_field_of_the_record(sindyjoint, tmp_path):
    from sindyjoint import simulate
    from sindyjoint.files import write_campaign

    write_campaign(simulate(frequencies=[3, 5], levels=[0.4, 0.8], duration=4.0, random_state=0), tmp_path)
    record = json.loads(sindyjoint("discover", tmp_path, "--json", "--library", "paper").stdout)
    table = README[README.index("| field | meaning |") : README.index("## Python and scikit-learn")]
    for part, value in record.items():
        inner = value[0] if isinstance(value, list) and isinstance(value[0], dict) else value
        for name in [part, *(inner if isinstance(inner, dict) else [])]:
            assert re.search(rf"`[^`]*\b{name}\b[^`]*`", table), f"{part}: {name}"


def test_its_python_sample_runs(tmp_path, capsys):
    from sindyjoint import simulate
    from sindyjoint.files import write_campaign

    sample = re.search(r"```python\n(.*?)```", README, re.S)[1]
    write_campaign(simulate(frequencies=[3, 5], levels=[0.4, 0.8], duration=4.0, random_state=0), tmp_path)
    names = {"angle": 1e-4, "rate": 0.01}
    lines = [line.split("#")[0].strip() for line in sample.splitlines()]
    program = "\n".join(line for line in lines if line).replace("campaign.toml", str(tmp_path))
    head = "\n".join(f"{name} = {value!r}" for name, value in names.items())
    (tmp_path / "sample.py").write_text(f"{head}\n{program}\nprint(found.model.equation())", encoding="utf-8")
    # In this process, whose warnings are errors.
    runpy.run_path(str(tmp_path / "sample.py"))
    assert capsys.readouterr().out.startswith("M = I·θ̈ + k1·θ")


def test_links_and_files_exist():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert "://" in target or (ROOT / target).exists(), target
    for name in ("CITATION.cff", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE"):
        assert f"({name})" in README and (ROOT / name).is_file(), name
    assert (ROOT / ".ci" / "run").is_file()
    for folder in re.findall(r"`(libraries|tests|benchmarks|examples)/`", README):
        assert (ROOT / folder).is_dir()


def test_package_citation_and_changelog_state_one_version():
    from sindyjoint import __version__

    citation = dict(
        re.findall(r"(?m)^(version|date-released): (.+)$", (ROOT / "CITATION.cff").read_text("utf-8"))
    )
    heads = re.findall(r"(?m)^## (\S+)(?: \((.+)\))?$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    newest = next(head for head in heads if head[0] != "Unreleased")
    assert newest == (citation["version"], citation["date-released"])
    assert __version__ == citation["version"]


def test_words_that_belong_to_nobody_elses_machine():
    for path in (
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        ROOT / "CHANGELOG.md",
        ROOT / "pyproject.toml",
    ):
        text = path.read_text(encoding="utf-8")
        assert "/work/" not in text and "/tmp/" not in text and "../shared" not in text
