"""The guide keeps its word: it builds without a warning, commands run, samples load, public names are documented."""

import ast
import importlib.util
import json
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from fresh_clone import VERBS, blocks, commands_of, main_path_holds, write_own_data

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


@pytest.mark.parametrize("module", ["sindyjoint", "sindyjoint.errors"])
def test_no_public_name_is_undocumented(module):
    home = import_module(module)
    if f".. automodule:: {module}\n   :members:" in API:
        return
    missing = [name for name in home.__all__ if f":: {module}.{name}\n" not in API]
    assert missing == []
    for name in home.__all__:
        assert (getattr(home, name).__doc__ or "").strip(), name


def programs():
    """Every Python program that a reader meets: examples, notebooks, samples of README and guide."""
    for path in sorted((ROOT / "examples").glob("*.py")):
        yield path.name, path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "examples").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        yield path.name, "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    for page in (ROOT / "README.md", *PAGES):
        yield page.name, "\n".join(blocks(page.read_text(encoding="utf-8"), "python"))


PROGRAMS = {name: ast.parse(text) for name, text in programs()}


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_api_page_has_every_name_that_a_program_imports(name):
    imported = {
        f"{node.module}.{alias.name}"
        for node in ast.walk(PROGRAMS[name])
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("sindyjoint")
        for alias in node.names
    }
    imported |= {
        f"sindyjoint.{node.attr}"
        for node in ast.walk(PROGRAMS[name])
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "sindyjoint"
    }
    # From nowhere but the front door: what stands behind it may move.
    assert sorted(each for each in imported if f":: {each}\n" not in API or each.count(".") > 1) == []


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_campaign_has_three_levels_at_three_frequencies(name):
    lists = {
        (keyword.arg, len(keyword.value.elts))
        for node in ast.walk(PROGRAMS[name])
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") != "curves"
        for keyword in node.keywords
        if keyword.arg in ("frequencies", "levels") and isinstance(keyword.value, ast.List | ast.Tuple)
    }
    assert {each for each in lists if each[1] < 3} == set()


def documented():
    """Names of fields and methods of the classes on the API page."""
    for module, _, name in (
        path.rpartition(".") for path in re.findall(r"autoclass:: (\S+)", API) if path.count(".")
    ):
        kind = getattr(import_module(module), name)
        yield from dir(kind)
        yield from re.findall(r"^ *(\w+)(?:, \w+)* :", kind.__doc__, re.M)
        yield from getattr(kind, "__dataclass_fields__", ())


def foreign():
    """Names that programs use of Python, NumPy, Matplotlib, scikit-learn and pysindy."""
    import matplotlib.axes
    import matplotlib.figure
    import matplotlib.lines
    import numpy
    import pysindy
    import sklearn.model_selection

    kinds = (Path, str, list, dict, sys, tempfile, json, numpy, numpy.ndarray, matplotlib.axes.Axes)
    kinds += (matplotlib.figure.Figure, matplotlib.lines.Line2D, pysindy, pysindy.SINDy)
    kinds += (sklearn.model_selection.GridSearchCV, tempfile.TemporaryDirectory)
    fitted = {"best_estimator_", "best_params_", "cv_results_"}
    return fitted.union(*map(dir, kinds))


def test_the_api_page_has_every_field_that_a_program_uses():
    used = {
        node.attr: name
        for name, tree in PROGRAMS.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") != "sindyjoint"
    }
    known = {*documented(), *foreign()}
    assert {attribute: name for attribute, name in used.items() if attribute not in known} == {}


def written_by(name, folder=DOCS):
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_gallery_has_every_example_with_its_picture_and_output():
    # After a change of an example: python docs/write_gallery.py
    gallery = written_by("write_gallery")
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert page == gallery.page()
    examples = {path.name for path in (ROOT / "examples").iterdir() if path.suffix in (".py", ".ipynb")}
    assert {path.name for path in (*gallery.programs(), *gallery.notebooks())} == examples
    for program in gallery.programs():
        assert f"## {gallery.text_of(program)[0]}\n" in page
        assert (DOCS / "gallery" / f"{program.stem}.png").stat().st_size > 10_000
        assert (DOCS / "gallery" / f"{program.stem}.txt").stat().st_size > 50
    assert {path.stem for path in (DOCS / "gallery").iterdir()} == {Path(name).stem for name in examples}


def test_the_page_of_measured_figures_is_what_its_data_say():
    # After a new figure: python benchmarks/write_measured.py
    writer = written_by("write_measured", ROOT / "benchmarks")
    assert (DOCS / "guide" / "measured.md").read_text(encoding="utf-8") == writer.page()
    assert writer.with_interval("0/20") == "0/20 (0–16.8)"  # 1 - 0.025^(1/20)


def test_the_callouts_of_the_report_are_explained():
    page = (DOCS / "guide" / "report.md").read_text(encoding="utf-8")
    for name, (_, callouts) in pictures_of_the_report().items():
        after = page.split(f"images/{name}.png)", 1)[1].split("![", 1)[0]
        # The list ends at the first line that is no item: a table, text, or a heading.
        items = re.match(r"\n\n((?:\d+\. .*\n(?:   .*\n)*)+)", after)[1]
        assert len(re.findall(r"^\d+\. ", items, re.M)) == len(callouts), name


def pictures_of_the_report():
    """Return what the script draws, without importing the browser that it needs."""
    tree = ast.parse((DOCS / "write_report_pictures.py").read_text(encoding="utf-8"))
    (value,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") == "PICTURES"
    )
    return ast.literal_eval(value)


def test_every_figure_of_the_guide_has_a_command():
    # Rates of success stand on one page, under the commands that make them.
    for page in (ROOT / "README.md", *PAGES):
        text = page.read_text(encoding="utf-8")
        if page.name not in ("measured.md", "changelog.md"):
            assert not re.search(r"\d+ of \d+ ?\|", text), page.name
    sections = (DOCS / "guide" / "measured.md").read_text(encoding="utf-8").split("\n## ")[1:]
    for section in sections:
        assert re.search(r"(python|sindyjoint|tests/|examples/)", section), section.splitlines()[0]


def test_the_keys_page_has_every_key():
    from sindyjoint.files import manifest_schema
    from sindyjoint.mechanics import RigFile

    page = (DOCS / "guide" / "keys.md").read_text(encoding="utf-8")
    for schema in (manifest_schema(), RigFile.model_json_schema()):
        for table in (schema, *schema.get("$defs", {}).values()):
            for key, field in table.get("properties", {}).items():
                assert f"|`{key}`|" in page, key
                assert field.get("description") or "$ref" in str(field), key


def test_every_command_has_a_line():
    from sindyjoint.cli import make_app

    names = {command.name for command in make_app().registered_commands} | {
        group.name for group in make_app().registered_groups
    }
    text = (DOCS / "guide" / "commands.md").read_text(encoding="utf-8")
    assert names - set(re.findall(r"^- `sindyjoint (\w+)", text, re.M)) == set()


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


@pytest.mark.slow  # tests/docs/fresh_clone.py types the same in a fresh clone, in every run of .ci/run
def test_a_newcomer_gets_there_in_three_commands_and_on_in_two(tmp_path, monkeypatch, sindyjoint):
    from sindyjoint.files import load_campaign

    commands = commands_of(START)
    # The first installs: the script that checks everything types it in a fresh clone.
    assert commands[0] in (ROOT / "README.md").read_text(encoding="utf-8")
    assert "tests/docs/fresh_clone.py" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    write_own_data(tmp_path / "hinge")
    monkeypatch.chdir(tmp_path)
    said = {}
    for verb, command in zip(VERBS[1:], commands[1:], strict=True):
        words = shlex.split(command)
        assert words[:2] == [".venv/bin/sindyjoint", verb]
        done = sindyjoint(*words[1:])
        assert done.status == 0, done.stderr
        said[verb] = done.stdout
    main_path_holds(said, tmp_path / "results")
    runs = load_campaign(tmp_path / "hinge").runs
    levels = {"low", "middle", "high"}
    assert {(run.frequency, run.level) for run in runs} == {(f, each) for f in (3, 4, 5) for each in levels}
    assert [run.name for run in runs if run.use == "validate"] == ["5Hz-middle"]


def test_the_main_path_is_short():
    # What a user reads for the main job: the index names these pages.
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    path = index[index.index("**Main path**") : index.index("**Reference**")]
    pages = re.findall(r"\]\((guide/\w+\.md)\)", path)
    assert len(pages) == 3 and pages[0] == "guide/start.md"
    assert sum(len((DOCS / page).read_text(encoding="utf-8").split()) for page in pages) <= 3000


def test_samples_of_manifests_and_catalogues_load(tmp_path):
    from sindyjoint.equation import load_catalogue
    from sindyjoint.files import Manifest
    from sindyjoint.mechanics import RigFile

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
