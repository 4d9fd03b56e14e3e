"""What a verification may call held out, what it knows of the rig, and where it starts; truth by another integrator."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import Campaign, Joint, Run, diagnose, discover, load_campaign, simulate, verify
from sindyjoint.equation import Nuisance, TestNuisances, Value, channel_delay
from sindyjoint.files import write_campaign
from sindyjoint.states import content_hash
from tests.equation.test_formula_evaluation import MAXWELL
from tests.made_models import model_of, term

RATE, INERTIA = 1000.0, 0.02
K1, K3, C1 = 6000.0, -2.6e9, 48.0
LIMIT = np.sqrt(K1 / (-3 * K3))
BRANCH, TAU = 500.0, 0.05
# Two of moment at each of three frequencies, N·m.
LEVELS = np.array([2.2, 2.2, 2.2, 1.2, 1.2, 1.2])


def move(drive, branch=0.0, friction=0.0):
    """Return the angle of every row of moments, sampled four times as often, from rest: classical Runge–Kutta."""
    step, state = 1 / (2 * RATE), np.zeros((3, len(drive)))
    angle = np.empty((drive.shape[1] // 4, len(drive)))

    def slope(y, moment):
        force = (
            moment - K1 * y[0] - K3 * y[0] ** 3 - C1 * y[1] - branch * y[2] - friction * np.tanh(y[1] / 1e-4)
        )
        return np.array([y[1], force / INERTIA, y[1] - y[2] / TAU])

    for sample in range(2 * len(angle)):
        if sample % 2 == 0:
            angle[sample // 2] = state[0]
        first, middle = drive[:, 2 * sample], drive[:, 2 * sample + 1]
        last = drive[:, min(2 * sample + 2, drive.shape[1] - 1)]
        a = slope(state, first)
        b = slope(state + step / 2 * a, middle)
        c = slope(state + step / 2 * b, middle)
        d = slope(state + step * c, last)
        state = state + step / 6 * (a + 2 * b + 2 * c + d)
    return angle.T


def recorded(drives, noise, seed, frequencies=None, skip=500, delay=0, zeros=0.0, **law):
    """Return a campaign of runs whose record begins in the middle of the motion; the moment lags by samples."""
    angle, generator = move(drives, **law), np.random.default_rng(seed)
    runs = []
    for i, (moment, motion) in enumerate(zip(drives[:, ::4], angle, strict=True)):
        late = np.roll(moment, delay)[skip:]
        kept = motion[skip:]
        late = late + noise * late.std() * generator.standard_normal(late.size)
        kept = (
            kept
            + noise * kept.std() * generator.standard_normal(kept.size)
            + np.broadcast_to(zeros, len(angle))[i]
        )
        runs.append(
            Run(f"run{i}", late, kept, RATE, frequency=None if frequencies is None else frequencies[i])
        )
    return Campaign(Joint("joint", "rotation", INERTIA), tuple(runs))


def times(seconds):
    return np.arange(round(4 * RATE * seconds)) / (4 * RATE)


def multisines(count, level, seed, seconds=3.5):
    """Return moments of lines without a common period."""
    time, lines = times(seconds), np.array([0.37, 0.81, 1.3, 1.9, 2.7, 3.3, 4.1, 5.3, 6.7])
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (count, lines.size, 1))
    drives = np.cos(2 * np.pi * lines[:, None] * time + phases).sum(axis=1)
    return level * drives / np.abs(drives).max(axis=1, keepdims=True) * np.minimum(time / 0.3, 1)


def sines(count, level, seconds=3.5):
    time, frequencies = times(seconds), [3.0, 4.5, 6.0, 3.0, 4.5, 6.0][:count]
    phase = np.arange(count)[:, None] * np.pi / 3
    drives = np.cos(2 * np.pi * np.array(frequencies)[:, None] * time + phase)
    return np.broadcast_to(level, count)[:, None] * drives * np.minimum(time / 0.3, 1), frequencies


def law(elements=()):
    terms = [
        term("linear_stiffness", "theta", K1),
        term("cubic_stiffness", "theta**3", K3),
        term("linear_damping", "omega", C1),
    ]
    made = model_of(terms, inertia=INERTIA, name="joint", angle=1.1 * LIMIT)
    return replace(made, elements=elements, covariance=())


# ---- held out


@pytest.fixture(scope="module")
def four():
    return recorded(*(lambda d: (d[0], 0.01, 5, d[1]))(sines(4, 2.2)), friction=0.4)


def test_a_run_that_a_fit_has_seen_is_not_held_out_whatever_it_is_marked(four, sindyjoint, tmp_path):
    """The marks of the second campaign are another's: the model file says what its fit used."""
    first = four.with_runs((*four.runs[:2], replace(four.runs[2], use="validate")))
    write_campaign(first, tmp_path / "first")
    assert sindyjoint("discover", tmp_path / "first", "--out", tmp_path / "model").status == 0
    # One that was fitted to, by another name; one that was kept out; one that was in no campaign of a fit.
    again = [replace(four.runs[0], name="renamed"), four.runs[2], four.runs[3]]
    write_campaign(four.with_runs(tuple(replace(r, use="validate") for r in again)), tmp_path / "second")
    answer = sindyjoint("verify", tmp_path / "model", tmp_path / "second", "--draws", 0, "--json")
    record = json.loads(answer.stdout)
    assert {run["name"]: run["seen"] for run in record["runs"]} == {
        "renamed": True,
        "run2": False,
        "run3": False,
    }
    assert any(
        "a fit of the model has used renamed: the error there is no prediction" in w
        for w in record["warnings"]
    )
    shown = sindyjoint("verify", tmp_path / "model", tmp_path / "second", "--draws", 0).stdout
    text = " ".join(shown.split())
    assert (
        "held out a fit of the model has used renamed: the error there is no prediction" in text
        and "not seen" in text
    )


def test_what_a_refinement_used_is_added_to_what_a_discovery_had_seen(four, sindyjoint, tmp_path):
    write_campaign(four.with_runs(four.runs[:2]), tmp_path / "first")
    write_campaign(four.with_runs(four.runs[2:3]), tmp_path / "second")
    sindyjoint("discover", tmp_path / "first", "--out", tmp_path / "model")
    answer = sindyjoint(
        "discover",
        tmp_path / "second",
        "--refine",
        "--model",
        tmp_path / "model",
        "--out",
        tmp_path / "later",
    )
    assert answer.status == 0, answer.stdout + answer.stderr
    result = verify(tmp_path / "later", four, draws=0)
    # Without marks those are compared that no fit has seen.
    assert [(run.name, run.seen) for run in result.runs] == [("run3", False)]


def test_a_model_without_a_record_says_so(four, tmp_path):
    record = json.loads(law().to_json())
    del record["fitted"]["seen"]  # as earlier versions wrote it
    (tmp_path / "model.json").write_text(json.dumps(record))
    result = verify(tmp_path, four, draws=0)
    assert {run.seen for run in result.runs} == {None} and len(result.runs) == 4
    assert any("the model does not record whether a fit has used" in line for line in result.warnings)


# ---- what belongs to the rig


def test_a_delay_that_discovery_removed_goes_with_the_model_to_other_runs_of_the_rig(sindyjoint, tmp_path):
    drives, frequencies = sines(6, LEVELS)
    write_campaign(recorded(drives, 0.005, 1, frequencies, delay=2), tmp_path / "first")
    late = recorded(multisines(2, 2.2, 2), 0.005, 3, delay=2)
    write_campaign(late, tmp_path / "other")
    answer = sindyjoint("discover", tmp_path / "first", "--align", "--out", tmp_path / "model")
    assert answer.status == 0, answer.stderr
    (found,) = json.loads((tmp_path / "model" / "model.json").read_text())["test"]["nuisances"]
    assert found["enters"] == "time shift" and found["value"] == pytest.approx(2e-3, abs=2e-4)
    result = verify(tmp_path / "model", tmp_path / "other", draws=0)
    bare = verify(replace(result.model, test=None), tmp_path / "other", draws=0)
    assert result.response_nrmse < 0.5 * bare.response_nrmse
    (line,) = [each for each in result.warnings if "found in another campaign of this rig" in each]
    assert "channel delay 0.002" in line or "channel delay 0.0019" in line or "channel delay 0.0020" in line
    assert any("without what was put right the response error is" in each for each in result.warnings)


def test_a_zero_belongs_to_a_run_and_is_estimated_anew_in_each():
    drives, frequencies = sines(4, 2.2)
    first = recorded(drives, 0.003, 1, frequencies, zeros=1.2e-4)
    zero = Nuisance("angle_offset", "angle zero", Value("theta_0", 1.2e-4, 0.0, (1.2e-4, 1.2e-4), "rad"))
    model = replace(law(), test=TestNuisances(content_hash(first), "joint", (zero,)))
    assert verify(model, first, draws=0).response_nrmse < 0.01
    other = recorded(multisines(2, 2.2, 4), 0.003, 2, zeros=np.array([-1e-4, 5e-5]))
    result = verify(model, other, draws=0)
    assert result.response_nrmse < 0.01 < 0.1 < verify(law(), other, draws=0).response_nrmse
    (line,) = [each for each in result.warnings if "estimated anew in each run" in each]
    found = [
        float(part.split()[0]) for part in line.replace(";", " ").replace(")", " ").split("angle zero ")[1:]
    ]
    # Of 3000 samples at 0.3 % noise the mean is known to some 1e-7 rad.
    assert found == pytest.approx([-1e-4, 5e-5], abs=2e-6)


def test_a_diagnosis_of_another_campaign_starts_from_what_the_model_knows_of_the_rig(few_effects):
    few_effects("channel_delay", "constant_moment", "angle_offset")
    drives, frequencies = sines(6, LEVELS)
    model = discover(recorded(drives, 0.005, 1, frequencies, delay=2), align=True).model
    found = diagnose(recorded(drives, 0.005, 7, frequencies, delay=2), model, advise=False)
    assert "channel_delay" not in [step.effect for step in found.steps]
    assert found.whole.test.total("time shift") == pytest.approx(2e-3, abs=2e-4)
    assert any("as the given model knows of this rig: channel delay" in line for line in found.warnings)
    assert set(model.fitted.seen) < set(found.whole.fitted.seen) and len(found.whole.fitted.seen) == 12


# ---- where a simulation starts


@pytest.mark.parametrize("kind", ["sines", "multisines"])
def test_no_run_near_the_softening_limit_loses_its_figure_to_a_noisy_first_sample(kind):
    """Six runs up to 0.99 of the limit at 3 % noise; their records begin anywhere in a cycle."""
    frequencies = None
    drives = multisines(6, 1.0, 3)
    if kind == "sines":
        drives, frequencies = sines(6, 1.0)
    # Of 16 levels between two, all moved at once, the last below 0.99 of the limit; then of 16 above that one.
    low, step = np.zeros(6), 6.0
    with np.errstate(all="ignore"):
        for _ in range(2):
            step /= 16
            levels = low + step * np.arange(1, 16)[:, None]
            moved = move((levels[..., None] * drives).reshape(-1, drives.shape[1]), BRANCH)
            peaks = np.nan_to_num(np.abs(moved).max(axis=1), nan=1.0).reshape(levels.shape)
            low = low + step * np.logical_and.accumulate(peaks <= 0.99 * LIMIT).sum(axis=0)
    campaign = recorded(low[:, None] * drives, 0.03, 1, frequencies, branch=BRANCH)
    branch = replace(MAXWELL, columns=(replace(MAXWELL.columns[0], value=BRANCH),))
    result = verify(law((branch,)), campaign, draws=0)
    assert [run.drive for run in result.runs] == ["moment"] * 6
    # The noise of both channels: 3 % of the angle's, and what as much of the moment's makes of the motion.
    assert all(run.response_nrmse is not None and run.response_nrmse < 0.045 for run in result.runs)


@pytest.mark.parametrize("samples", [4, 20, 300])
def test_a_free_run_takes_as_few_samples_as_others_report_with(samples, sindyjoint, tmp_path):
    campaign = recorded(multisines(1, 2.2, 6), 0.0005, 8)
    write_campaign(campaign, tmp_path / "runs")
    (tmp_path / "model.json").write_text(law().to_json())
    answer = sindyjoint(
        "verify", tmp_path / "model.json", tmp_path / "runs", "--draws", 0, "--free-run", samples, "--json"
    )
    (run,) = json.loads(answer.stdout)["runs"]
    # What a damped joint forgets of its start within a few ms; 0.05 % is the noise of either channel.
    assert run["response_nrmse"] < 0.002


@pytest.mark.shared
def test_the_delay_of_the_first_part_of_emps_goes_to_its_last(public_data):
    whole = load_campaign(public_data("emps"))
    (run,) = whole.runs
    cut = 2 * run.n_samples // 3

    def part(name, samples):
        return whole.with_runs((Run(name, run.moment[samples], run.angle[samples], run.sample_rate),))

    model = discover(part("first", slice(0, cut)), align=True).model
    last = part("last", slice(cut, None))
    carried = verify(model, last, draws=0)
    assert carried.runs[0].seen is False
    # −0.68 ms of the force: measured 2.58 % where it is 3.03 % without.
    assert carried.moment_nrmse < 0.9 * verify(replace(model, test=None), last, draws=0).moment_nrmse
    free = verify(model, last, draws=0, free_run=20)
    # Measured 4.5 mm.
    assert free.runs[0].rmse < 6e-3


def test_a_simulated_test_of_a_model_has_the_delay_of_its_rig(sindyjoint, tmp_path):
    known = replace(law(), test=TestNuisances("", "joint", (channel_delay(2e-3, 0.0),)))
    (tmp_path / "model.json").write_text(known.to_json())
    answer = sindyjoint(
        "simulate", "--model", tmp_path / "model.json", "--frequencies", 3, "--levels", 0.8, "--duration", 2,
        "--noise", 0, "--out", tmp_path / "runs",
    )  # fmt: skip
    assert "the moment lags by 0.002 s, as the model knows of its rig" in answer.stderr
    (run,) = load_campaign(tmp_path / "runs").runs
    # What the law and the inertia make of the angle, 2 ms later: by second differences of noise-free samples.
    step = 1 / run.sample_rate
    rate, acceleration = np.gradient(run.angle, step), np.gradient(np.gradient(run.angle, step), step)
    moment = K1 * run.angle + K3 * run.angle**3 + C1 * rate + INERTIA * acceleration
    late = np.interp(run.time - 2e-3, run.time, moment)
    inside = slice(20, -20)
    assert np.std((run.moment - late)[inside]) < 0.01 * np.std(run.moment)
    assert np.std((run.moment - moment)[inside]) > 0.03 * np.std(run.moment)


def test_a_joint_that_sticks_is_not_failed_by_the_moments_that_friction_may_hold():
    """Without an inertia the motion drives the simulation, and says nothing of the moment while nothing moves."""
    runs = simulate(frequencies=[2, 3, 4], levels=[0.9, 0.5, 0.2], duration=6.0, rng=7)
    unknown = replace(runs, joint=replace(runs.joint, inertia=0.0))
    model = discover(unknown, library="paper").model
    found = verify(model, unknown, draws=0)
    assert {run.drive for run in found.runs} == {"motion"} and found.passed
    assert found.response_nrmse == pytest.approx(found.moment_nrmse, rel=0.05)
    # The control: a friction that is not the joint's fails.
    other = replace(
        model,
        terms=tuple(
            replace(t, coefficient=1.3 * t.coefficient) if t.id == "coulomb_friction" else t
            for t in model.terms
        ),
    )
    assert not verify(other, unknown, draws=0).passed
