"""A discovery on disk: whole or not at all, and drawn again later without the measurements."""

import json
import re
import shutil
import subprocess
import sys
import time

import pytest

from sindyjoint import JointModel
from sindyjoint.errors import (
    InputError,
    OutputError,
)
from sindyjoint.reporting import draw, drawable, figure_bytes, load_results, write_results
from tests.doors.asked import ask


@pytest.fixture(scope="session")
def discovery():
    """Return a discovery from a small virtual campaign: three frequencies, two levels, three seconds each."""
    from sindyjoint import discover, simulate

    campaign = simulate("inter-panel", frequencies=[3, 4, 6], levels=[0.9, 0.5], duration=3, random_state=5)
    return discover(campaign, random_state=5)


@pytest.fixture(scope="session")
def results(discovery, tmp_path_factory):
    """Return the folder of its results."""
    from sindyjoint.reporting import write_results

    folder = tmp_path_factory.mktemp("made") / "results"
    return write_results(discovery, folder, ["sindyjoint", "discover", "--out", "my results"])


def run(*arguments):
    return ask("plot", *arguments)


def test_the_folder_holds_what_was_promised(results, discovery):
    names = sorted(str(path.relative_to(results)) for path in results.rglob("*") if path.is_file())
    figures = ["coefficients", "covariance", "fit", "loops", "map", "path", "residual"]
    assert names == sorted(
        [
            "SHA256SUMS",
            "model.json",
            "report.html",
            "terms.csv",
            "figures/data.json",
            *(f"figures/{name}.svg" for name in figures),
        ]
    )
    assert JointModel.from_json((results / "model.json").read_text()) == discovery.model
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "sindyjoint discover --out &#39;my results&#39;" in page and "<dd>5</dd>" in page
    assert "simulated, not measured" in page


def test_figures_drawn_later_are_the_same(results):
    data = load_results(results)
    for kind in drawable(data):
        assert figure_bytes(draw(kind, data), "svg") == (results / "figures" / f"{kind}.svg").read_bytes()


def test_nothing_is_left_when_the_page_fails(discovery, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("the template is broken")

    monkeypatch.setattr("sindyjoint.reporting.view.render", fail)
    with pytest.raises(RuntimeError, match="the template is broken"):
        write_results(discovery, tmp_path / "results")
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_named(discovery, tmp_path):
    (tmp_path / "results").write_text("mine")
    with pytest.raises(
        OutputError, match="cannot write into .*results': it is a file; expected the name of a folder"
    ):
        write_results(discovery, tmp_path / "results")
    assert (tmp_path / "results").read_text() == "mine"


@pytest.fixture(scope="module")
def written_again(discovery, results, tmp_path_factory):
    """A folder that held a file, the results written into it, and the processor's seconds of that."""
    folder = tmp_path_factory.mktemp("again")
    (folder / "notes.txt").write_text("mine")
    start = time.process_time()  # what is imported was imported for the results before
    write_results(discovery, folder)
    return folder, time.process_time() - start


def test_other_files_in_the_folder_stay(written_again):
    folder, _ = written_again
    assert (folder / "notes.txt").read_text() == "mine" and (folder / "report.html").exists()


@pytest.mark.parametrize(("suffix", "begins"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")])
def test_plot_writes_a_figure(results, tmp_path, suffix, begins):
    target = tmp_path / f"map.{suffix}"
    found = run(results / "model.json", "map-rest", "--out", target, "--width", "3.5", "--dpi", "80")
    assert found.status == 0, found.stderr
    assert found.stderr == f"wrote {target}\n" and found.stdout == ""
    assert target.read_bytes().startswith(begins)


def test_plot_without_a_kind_lists_them(results):
    found = run(results)
    assert found.status == 0
    assert [line.split()[0] for line in found.stdout.splitlines()] == drawable(
        load_results(results), parts=True
    )


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["gone", "map"], 2, "'gone' does not exist; expected a folder that a command wrote"),
        (["{empty}", "map"], 2, "holds no figures/data.json, from which figures are drawn; run"),
        (["{bare}", "map"], 1, "holds no figures/data.json, from which figures are drawn; run"),
        (["{results}", "mapp"], 2, "figure 'mapp' is not known; did you mean 'map'?"),
        (["{results}", "map", "--out", "map.gif"], 2, "--out is 'map.gif'; expected a name that ends"),
        (["{results}", "map", "--out", "{empty}/no/map.svg"], 2, "cannot write .*No such file or directory"),
    ],
)  # fmt: skip
def test_plot_refuses(results, tmp_path, tmp_path_factory, arguments, status, message):
    bare = tmp_path_factory.mktemp("bare")
    shutil.copy(results / "model.json", bare)
    places = {"results": results, "empty": tmp_path, "bare": bare}
    found = run(*(argument.format(**places) for argument in arguments))
    # A bare model is no fault of the input.
    assert found.status == status and found.stderr.count("\n") == 1
    assert re.search(message.replace("?", r"\?"), found.stderr)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("figures/data.json", "{", r"data.json: is not JSON \("),
        ("figures/data.json", "[" * 100_000, "data.json: is nested too deeply"),
        (
            "figures/data.json",
            "{}",
            "data.json': not a saved result: 'kind' is None; expected one of ReportData, Ver",
        ),
        ("figures/data.json", "\xff", "data.json: is not UTF-8 text"),
        ("model.json", "{}", "model.json: not a joint model"),
    ],
)
def test_damaged_results_name_the_file(results, tmp_path, name, text, message):
    folder = tmp_path / "results"
    shutil.copytree(results, folder, ignore=shutil.ignore_patterns("SHA256SUMS"))
    (folder / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=message):
        load_results(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["loops"][0].update(level=3), "loops.1.level: expected text in quotes, not 3"),
        (
            lambda d: d["loops"][0].update(moment=[1.0, 2.0]),
            "do not fit together .*; run the command with --out",
        ),
        (lambda d: d["loops"][0].update(angle=3.0), "do not fit together .*; run the command with --out"),
    ],
)
def test_changed_data_are_refused_in_one_line(results, tmp_path, change, message):
    folder = tmp_path / "results"
    shutil.copytree(results, folder, ignore=shutil.ignore_patterns("SHA256SUMS"))
    record = json.loads((folder / "figures" / "data.json").read_text(encoding="utf-8"))
    change(record)
    (folder / "figures" / "data.json").write_text(json.dumps(record), encoding="utf-8")
    found = run(folder, "loops", "--out", tmp_path / "loops.svg")
    assert found.status == 2 and found.stderr.count("\n") == 1 and re.search(message, found.stderr)
    assert not (tmp_path / "loops.svg").exists()


def test_data_of_another_model_are_refused(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder, ignore=shutil.ignore_patterns("SHA256SUMS"))
    record = json.loads((folder / "model.json").read_text())
    record["terms"][0]["coefficient"] *= 2
    (folder / "model.json").write_text(json.dumps(record))
    with pytest.raises(
        InputError, match="belongs to another model than .*model.json'; run the command with --out again"
    ):
        load_results(folder)


def test_writing_takes_little_time(written_again):
    # Two seconds are promised for twelve runs on a free machine; of this process only, ten times that on a busy one.
    assert written_again[1] < 20


def test_the_reporting_package_imports_nothing_heavy():
    script = (
        "import sys, sindyjoint.reporting, sindyjoint.cli.files; "
        "print(sorted({'matplotlib', 'sympy', 'jinja2', 'pysindy', 'numpy'} & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
