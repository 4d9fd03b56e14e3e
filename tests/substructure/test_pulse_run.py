"""A rig's ``[pulse]`` and its ``[[measured]]`` records as the one run from which its joint's law is sought."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sindyjoint.mechanics
from sindyjoint import diagnose_structure, discover_rig
from sindyjoint.errors import InputError
from sindyjoint.mechanics import load_rig, load_rig_test

POINTS = ("tip", "joint")
RECORD = """
[[measured]]
file = "{point}.csv"
point = "{point}"
time = {{ column = "t", unit = "s" }}
displacement = {{ column = "w", unit = "mm" }}
"""


@pytest.fixture(scope="module")
def motion():
    rig = replace(load_rig("pulse-rig"), points=POINTS, duration=6.0, step=2.5e-4)
    return rig.respond()


@pytest.fixture(scope="module")
def path(motion, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pulse")
    text = (
        (Path(sindyjoint.mechanics.__file__).parent / "rig_files" / "pulse-rig.toml")
        .read_text(encoding="utf-8")
        .split("# A virtual test for")[0]
    )
    generator = np.random.default_rng(3)
    for point in POINTS:
        shown = 1e3 * motion.displacement[point]
        shown = shown + 1e-3 * shown.std() * generator.normal(size=shown.size)
        np.savetxt(
            folder / f"{point}.csv",
            np.column_stack([motion.time, shown]),
            "%.9g",
            ",",
            header="t,w",
            comments="",
        )
        text += RECORD.format(point=point)
    path = folder / "rig.toml"
    path.write_text(text.replace('"inter-panel"', '"unknown"'), encoding="utf-8")
    return path


def test_the_pulse_is_a_run(path):
    test = load_rig_test(path)
    (run,) = test.runs
    assert [sensor.point for sensor in test.sensors] == [*POINTS] and run.frequency is None
    assert run.drive.sum() / run.sample_rate == pytest.approx(65 * 5e-3, rel=1e-9)


def test_a_pulse_gives_stiffness_and_friction(path):
    (law,) = discover_rig(
        path, refine=False, random_state=0, forced=["linear_stiffness", "coulomb_friction"]
    ).laws
    true = load_rig("pulse-rig").items[1].law
    assert (
        law.kind == "joint" and "one run of a structure cannot refute a term" in law.discovery.verdict.reason
    )
    assert law.discovery.model["linear_stiffness"].coefficient == pytest.approx(true.k1, rel=0.1)
    assert law.discovery.model["coulomb_friction"].coefficient == pytest.approx(true.M_F, rel=0.1)


def test_records_of_a_pulse_have_one_rate(path, tmp_path):
    text = path.read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    for point, step in zip(POINTS, (1, 2), strict=True):
        lines = (path.parent / f"{point}.csv").read_text(encoding="utf-8").splitlines()
        (tmp_path / f"{point}.csv").write_text("\n".join([lines[0], *lines[1::step]]), encoding="utf-8")
    with pytest.raises(InputError, match=r"joint.csv: 500 Hz beside 1000 Hz of tip.csv"):
        load_rig_test(tmp_path / "rig.toml")


def test_a_rig_without_a_law_and_without_a_record_is_not_diagnosed(path, tmp_path):
    (tmp_path / "rig.toml").write_text(
        path.read_text(encoding="utf-8").split("[[measured]]")[0], encoding="utf-8"
    )
    with pytest.raises(InputError, match="give the model that stands there"):
        diagnose_structure(tmp_path / "rig.toml")


@pytest.mark.slow
def test_a_diagnosis_begins_with_the_law_of_the_pulse(path):
    result = diagnose_structure(path, effects=(), max_effects=1, advise=False)
    assert result.warnings[0].startswith("no model was given: the law was found in the same pulse")
