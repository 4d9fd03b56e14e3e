"""A diagnosis from the runs of a structure: two masses by SciPy, the joint and the structure as suspects."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose_rig
from sindyjoint.diagnosis import load_effects
from sindyjoint.numeric import solve_factored
from tests.doors.asked import checked_record

from .test_refine_rig import K3, C, K, few_harmonics, model  # noqa: F401
from .two_masses import integrated_run, rig_test, swept_run

DRIVES = [(1.5, 5.0), (2.5, 6.0), (2.5, 3.0), (4.0, 12.0)]
FIFTH = 3e9
EFFECTS = [e for e in load_effects() if e.id in ("quintic_stiffness", "quadratic_damping", "dahl_friction")]


def recorded(law, **options):
    runs = [
        integrated_run(f"{f:g} Hz {a:g} N", f, a, law, noise=0.005, seed=i) for i, (f, a) in enumerate(DRIVES)
    ]
    return rig_test(runs, **options)


@pytest.fixture(scope="module")
def richer():
    return recorded(lambda d, v: K * d + K3 * d**3 + FIFTH * d**5 + C * v)


@pytest.fixture(scope="module")
def known():
    """The joint as its bench knows it: within a half per cent."""
    given = model(K, K3, C)
    return given.with_numbers(given.numbers, given.covariance_matrix / 16)


@pytest.fixture()
def found(richer, known):
    return diagnose_rig(richer, known, effects=EFFECTS, max_effects=2)


@pytest.mark.slow
def test_the_missing_stiffness_is_named_and_measured(found, tmp_path):
    (step,) = found.steps
    assert step.effect == "quintic_stiffness" and found.verdict == "named"
    assert step.parameters["k5"] == pytest.approx(FIFTH, rel=0.02)
    assert found.initial.response > 5 * found.noise_floor.response
    assert found.final.response < 1.5 * found.noise_floor.response
    # The gaps are those of the run that no fit has seen.
    assert {record.name.split(", ")[1] for record in found.records} == {"2.5 Hz 6 N"}
    terms = {term.id: term for term in found.in_place.models["joint"].terms}
    fifth = terms["quintic_stiffness"]
    assert abs(fifth.coefficient - FIFTH) < 4 * fifth.standard_error
    found.report(tmp_path / "out")
    record = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    checked_record("diagnosis", record)
    assert "quintic_stiffness" in record["in_place"]["kinds"]["joint"]["terms"]
    saved = json.loads((tmp_path / "out" / "model.json").read_text())
    assert "quintic_stiffness" in [term["id"] for term in saved["terms"]]


def test_nothing_is_missing_where_nothing_is(known):
    narrow = replace(known, fitted=replace(known.fitted, angle=1e-3, rate=1.0))
    found = diagnose_rig(recorded(lambda d, v: K * d + K3 * d**3 + C * v), narrow, effects=EFFECTS)
    assert found.verdict == "nothing_missing" and not found.steps
    # Of runs that are kept out, too.
    beyond = [line for line in found.warnings if "beyond the tested range" in line]
    runs = {f"the given model in {f:g} Hz {a:g} N" for f, a in DRIVES}
    assert {line.split(",")[0] for line in beyond} == runs
    assert all("displacement up to" in line and "% of the time)" in line for line in beyond)


def test_a_late_sensor_is_no_fault_of_the_joint(known):
    """All sensors 2 ms behind the drive: the delay is named, and the joint's law stays."""
    test = recorded(lambda d, v: K * d + K3 * d**3 + C * v)
    late = []
    for run in test.runs:
        spectrum = np.fft.rfft(run.responses, axis=1)
        shift = np.exp(-2j * np.pi * np.fft.rfftfreq(run.drive.size, 1 / run.sample_rate) * 2e-3)
        late.append(replace(run, responses=np.fft.irfft(spectrum * shift, run.drive.size, axis=1)))
    found = diagnose_rig(replace(test, runs=tuple(late)), known, effects=EFFECTS)
    assert [step.effect for step in found.steps] == ["sensor_delay"]
    assert found.steps[0].parameters == {"tau": pytest.approx(2e-3, rel=0.05)}


def swept(law, forces, seconds=5.0):
    return rig_test([swept_run(f"{a:g} N", a, law, seconds, noise=0.005, seed=int(10 * a)) for a in forces])


def test_nothing_is_missing_in_runs_that_do_not_repeat(known):
    runs = swept(lambda d, v: K * d + K3 * d**3 + C * v, (5.0,), seconds=3.0)
    found = diagnose_rig(runs, known, effects=EFFECTS[:1])
    assert found.verdict == "nothing_missing" and not found.steps
    # The floor holds the noise of the drive: without it the gap would be a fifth above. The fit takes a part of the
    # noise of the run itself: of six draws the ratio is 0.85 to 0.97.
    assert 0.8 < found.final.response / found.noise_floor.response < 1.05
    assert any("segments are compared" in line for line in found.warnings)


@pytest.mark.slow
def test_runs_that_do_not_repeat_name_what_the_joint_lacks(known):
    truth = 60.0
    runs = swept(lambda d, v: K * d + K3 * d**3 + C * v + truth * v * abs(v), (3.0, 5.0, 4.0, 4.5))
    found = diagnose_rig(runs, known, effects=EFFECTS, max_effects=2)
    (step,) = found.steps
    assert step.effect == "quadratic_damping" and found.verdict == "named"
    assert step.parameters["c2"] == pytest.approx(truth, rel=0.05)
    assert found.initial.response > 20 * found.final.response
    assert {record.name.split(", ")[1] for record in found.records} == {"5 N"}


def test_solutions_on_threads_share_no_pivots(monkeypatch):
    """SciPy's wrapper changes the pivots while it solves: threads with the same ones crash the process."""
    import scipy.linalg

    matrix, right = np.random.default_rng(0).normal(size=(2, 9, 9))
    factors, solve, taken = scipy.linalg.lu_factor(matrix), scipy.linalg.lu_solve, []

    def spy(given, *others, **options):
        taken.append(given[1])
        return solve(given, *others, **options)

    monkeypatch.setattr(scipy.linalg, "lu_solve", spy)
    assert solve_factored(factors, right) == pytest.approx(np.linalg.solve(matrix, right))
    assert taken and not np.shares_memory(taken[0], factors[1])
