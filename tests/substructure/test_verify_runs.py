"""Models against what the sensors of a structure measured; data by SciPy's integrator, not by the package's."""

import json
from dataclasses import replace

import pytest

import sindyjoint
from sindyjoint.errors import InputError
from tests.doors.asked import checked_record
from tests.made_models import model_of, term

from .two_masses import integrated_run, rig_test, swept_run

K, K3, C, NOISE = 900.0, 4e6, 12.0, 0.01


def elastic(d, v):
    return K * d + K3 * d**3 + C * v


def model(stiffness=K, name="joint", error=0.0):
    formulas = ("theta", "theta**3", "omega")
    values = zip(
        ("linear_stiffness", "cubic_stiffness", "linear_damping"), formulas, (stiffness, K3, C), strict=True
    )
    terms = [term(id, formula, value, error * value) for id, formula, value in values]
    return model_of(terms, inertia=0.0, angle=0.02, name=name, motion="translation")


@pytest.fixture(scope="module")
def runs():
    return [
        integrated_run("2.5 Hz", 2.5, 6.0, elastic, noise=NOISE, seed=1),
        swept_run("sweep", 5.0, elastic, seconds=8.0, noise=NOISE, seed=2),
    ]


@pytest.fixture(scope="module")
def declared(runs):
    """A test whose noise is declared: that of a sweep is not measured."""
    test = rig_test(runs)
    sizes = runs[1].responses.std(axis=1) * NOISE
    sensors = tuple(replace(s, noise=float(size)) for s, size in zip(test.sensors, sizes, strict=True))
    return replace(test, sensors=sensors, drive_noise=float(runs[1].drive.std() * NOISE))


@pytest.fixture(scope="module")
def verified(declared):
    return sindyjoint.verify(model(), declared, draws=0)


def test_the_law_of_the_joint_leaves_the_noise_of_the_sensors(verified):
    assert verified.passed and verified.kind == "rig"
    # Of a model made by hand nobody knows what it was fitted to.
    assert {run.seen for run in verified.runs} == {None}
    assert [run.name for run in verified.runs] == [
        f"{r}, {s}" for r in ("2.5 Hz", "sweep") for s in ("x1", "x2")
    ]
    assert [run.drive for run in verified.runs] == ["steady"] * 2 + ["standstill"] * 2
    for run in verified.runs:
        # The drive has noise, too, which the simulation takes for force: twice that of the sensor at most.
        assert run.noise_floor == pytest.approx(NOISE, rel=0.3)
        assert run.response_nrmse < 2 * NOISE and run.rmse_unit == "m/s^2"
    record = json.loads(json.dumps(verified.to_dict(), allow_nan=False))
    checked_record("verification", record)


def test_a_joint_that_is_five_percent_stiffer_fails(declared):
    other = sindyjoint.verify(model(1.05 * K), declared, tolerance=0.02, draws=3)
    assert not other.passed and other.response_nrmse > 0.03
    assert "beyond the noise, the most of all runs" in " ".join(other.warnings)


def test_runs_for_validation_alone_are_compared(declared):
    kept = replace(declared, runs=(declared.runs[0], replace(declared.runs[1], use="validate")))
    found = sindyjoint.verify(model(), kept, draws=0)
    assert {(run.name, run.seen) for run in found.runs} == {("sweep, x1", None), ("sweep, x2", None)}
    assert not any("use = 'validate'" in line for line in found.warnings)


def test_the_band_holds_the_model(declared):
    test = replace(declared, runs=declared.runs[:1])
    found = sindyjoint.verify(model(error=0.02), test, draws=8, random_state=1)
    for run in found.runs:
        inside = (run.band.low <= run.simulated) & (run.simulated <= run.band.high)
        assert inside.mean() > 0.9 and run.band.draws == 8


def test_motions_beyond_what_was_tested_are_named(declared):
    small = model()
    small = replace(small, fitted=replace(small.fitted, angle=1e-4))
    found = sindyjoint.verify(small, replace(declared, runs=declared.runs[:1]), draws=0)
    assert found.beyond_range == ("2.5 Hz",) and any("2.5 Hz, joint" in line for line in found.warnings)


def test_a_record_that_begins_in_the_midst_of_its_motion_is_said_to(declared):
    late = declared.runs[1]
    late = replace(late, drive=late.drive[431:], responses=late.responses[:, 431:])
    found = sindyjoint.verify(model(), replace(declared, runs=(late,)), draws=0)
    assert any("does not begin there" in line for line in found.warnings)


def test_a_report_holds_every_model(verified, tmp_path):
    other = replace(verified, beside=(model(name="other"),))
    folder = other.report(tmp_path / "out")
    assert json.loads((folder / "model-2.json").read_text())["joint"]["name"] == "other"
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Coefficients of other." in page and page.count("Equation of the joint") == 2


@pytest.mark.parametrize(
    ("models", "options", "said"),
    [
        ([model(), model()], {}, "two models stand for 'joint'"),
        (model(), {"noise": 0.01}, "belong.s. to a virtual pulse test; the rig has recorded runs"),
        (model(), {"free_run": 10}, "belongs to a campaign"),
    ],
)
def test_what_cannot_be_compared_is_refused(declared, models, options, said):
    with pytest.raises(InputError, match=said):
        sindyjoint.verify(models, declared, **options)


def test_several_models_are_for_kinds_of_joint_alone():
    with pytest.raises(InputError, match="2 models were given; expected one"):
        sindyjoint.verify([model(), model()], "pulse-rig")
