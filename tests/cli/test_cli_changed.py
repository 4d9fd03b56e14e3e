"""``changed``, and ``--at`` and ``samples`` of exports, from the command line."""

import csv
import io
import json

import numpy as np
import pytest

from sindyjoint import JointRegressor
from tests.doors.asked import ask


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    rng = np.random.default_rng(0)
    X = np.column_stack(
        [rng.uniform(-1, 1, (4000, 2)) * [8e-4, 0.02], np.repeat([250.0, 270.0, 290.0, 310.0], 1000)]
    )
    for name, k1 in (("before", 6000.0), ("after", 5000.0)):
        moment = (k1 + 6 * (X[:, 2] - 280)) * X[:, 0] + 48 * X[:, 1] + 1.9 * np.sign(X[:, 1])
        moment = moment + 0.01 * rng.normal(size=4000)
        fitted = JointRegressor("paper", inputs=["temperature"]).fit(X, moment, runs=X[:, 2])
        (folder / f"{name}.json").write_text(fitted.model_.to_json())
    return folder


def test_changed_leaves_with_one_and_says_what(models, tmp_path):
    files = [str(models / "before.json"), str(models / "after.json")]
    result = ask("changed", *files, "--json", "--out", str(tmp_path / "out"))
    assert result.status == 1
    record = json.loads(result.stdout)
    assert record["changed"] and "k1" in record["sentence"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "After against before" in page and (tmp_path / "out" / "changed.csv").is_file()
    assert ask("changed", files[0], files[0]).status == 0


def test_an_export_holds_inputs_and_says_what_that_costs(models):
    model = str(models / "before.json")
    result = ask("export", model, "--to", "abaqus", "--at", "temperature=250")
    assert result.status == 0 and "temperature: the law is that at 250" in result.stdout
    assert "held at 250, tested from 250 to 310" in result.stderr
    assert ask("export", model, "--to", "c", "--at", "load=3").status == 2


def test_samples_have_the_spread_of_the_model(models):
    model = str(models / "before.json")
    result = ask("export", model, "--to", "samples", "--count", "2000")
    rows = list(csv.reader(io.StringIO(result.stdout)))
    column = [name.split(" ")[0] for name in rows[0]].index("k1")
    drawn = np.array([float(row[column]) for row in rows[1:]])
    known = next(t for t in json.loads((models / "before.json").read_text())["terms"] if t["symbol"] == "k1")
    assert len(drawn) == 2000
    assert drawn.mean() == pytest.approx(known["coefficient"], abs=5 * known["standard_error"] / 2000**0.5)
    assert drawn.std() == pytest.approx(known["standard_error"], rel=0.1)
