"""Every target of ``export``: what is written holds the law that was exported, or runs and gives its moment."""

import csv
import importlib.util
import json
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np
import pytest

from tests.doors.asked import ask
from tests.doors.inventory import GOLDEN
from tests.doors.truth import Truth
from tests.made_models import paper_model

TARGETS = json.loads(GOLDEN.read_text(encoding="utf-8"))["targets"]
LAW = {
    "linear_stiffness": 6.066e3, "quadratic_stiffness": -1.927e5, "cubic_stiffness": -2.684e9,
    "linear_damping": 48.13, "coulomb_friction": 1.867,
}  # fmt: skip
ENDINGS = {"python": ".py", "c": ".h", "fmu": ".fmu"}
RNG = np.random.default_rng(4)
ANGLE = RNG.uniform(-7e-4, 7e-4, 50)
RATE = RNG.uniform(2e-3, 0.03, 50) * RNG.choice([-1, 1], 50)
MOMENT = Truth(law=LAW).moment(ANGLE, RATE)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return a function that exports the paper's law: the files and the record."""
    place = tmp_path_factory.mktemp("exports")
    model = place / "model.json"
    model.write_text(paper_model().to_json(), encoding="utf-8")
    made = {}

    def export(target):
        if target not in made:
            if target == "fmu":
                pytest.importorskip("pythonfmu")
            out = place / f"{target}{ENDINGS.get(target, '')}"
            options = ["--random-state", 1] if target == "samples" else []
            answer = ask("export", model, "--to", target, "--out", out, *options, "--json")
            assert answer.status == 0, answer.stderr
            record = json.loads(answer.stdout)
            made[target] = [place / file for file in record["files"]], record
        return made[target]

    return export


@pytest.mark.parametrize("target", TARGETS)
def test_a_target_writes_what_it_promises(target, written):
    files, record = written(target)
    assert record["target"] == target and files and all(file.stat().st_size > 100 for file in files)
    if target == "samples":
        return
    # What is said of each term: carried, with its error over the tested range, or not.
    assert {row["term"] for row in record["fidelity"]} >= set(LAW)
    for row in record["fidelity"]:
        assert row["carried"] != (row["term"] in record["not_carried"])
        if row["carried"] and row["error"] is not None:
            assert row["error"] < 0.05, row


def test_python_runs_and_gives_the_moment(written):
    (path,), _ = written("python")
    spec = importlib.util.spec_from_file_location("exported_joint", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    given = [module.transfer_moment(*state) for state in zip(ANGLE.tolist(), RATE.tolist(), strict=True)]
    np.testing.assert_allclose(given, MOMENT, rtol=1e-12)


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_c_compiles_without_a_warning(written, tmp_path):
    (path,), _ = written("c")
    header = tmp_path / "joint.h"
    header.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "main.c").write_text('#include "joint.h"\nint main(void) { return 0; }\n')
    done = subprocess.run(
        ["cc", "-std=c99", "-Wall", "-Werror", "-Wno-unused-function", "main.c", "-lm", "-o", "main"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_fmu_is_a_unit_of_its_standard(written):
    (path,), _ = written("fmu")
    with zipfile.ZipFile(path) as unit:
        root = ElementTree.fromstring(unit.read("modelDescription.xml"))
    assert root.get("fmiVersion") == "2.0" and root.find("CoSimulation") is not None


def test_json_is_the_model(written):
    (path,), _ = written("json")
    record = json.loads(path.read_text(encoding="utf-8"))
    terms = record.get("terms") or record["model"]["terms"]
    assert {term["id"]: term["coefficient"] for term in terms} == pytest.approx(LAW)


def test_samples_scatter_as_their_covariance_says(written):
    (path,), _ = written("samples")
    rows = [
        row
        for row in csv.reader(path.read_text(encoding="utf-8").splitlines())
        if row and not row[0].startswith("#")
    ]
    names, values = (
        rows[0],
        np.array([[float(cell) for cell in row] for row in rows[1:] if row[0][:1] in "-0123456789"]),
    )
    for name, true in LAW.items():
        (column,) = [i for i, each in enumerate(names) if each.startswith(name)]
        draws = values[:, column]
        # 1000 draws of a relative error of 1e-3: mean to 5 of its errors, scatter to a sixth.
        assert abs(draws.mean() - true) < 5e-3 * abs(true) / np.sqrt(draws.size)
        assert draws.std() == pytest.approx(1e-3 * abs(true), rel=1 / 6)


@pytest.mark.parametrize("target", ["ansys", "abaqus", "nastran", "simscape", "opensees", "mujoco", "latex"])
def test_text_holds_the_damping(target, written):
    files, _ = written(target)
    text = "".join(file.read_text(encoding="utf-8") for file in files)
    # The elastic moment may stand as a table; what is linear in the rate is one number everywhere.
    assert "48.13" in text or "4.813" in text, target
