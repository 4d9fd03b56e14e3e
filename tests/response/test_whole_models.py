"""Models with elements, and nuisances of a test, at every door that simulates."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import verify
from sindyjoint.equation import Drift, Nuisance, TestNuisances, Value, range_warnings, read_test
from sindyjoint.errors import InputError
from sindyjoint.mechanics import FunctionLaw, SumLaw, virtual_campaign
from sindyjoint.response import draw_models, law_of_test, model_law
from sindyjoint.states import content_hash, force_states, run_hash
from tests.equation.test_formula_evaluation import JENKINS, MAXWELL, with_elements
from tests.made_models import paper_model


def slider(theta, omega, direction, state, p, out):
    out[0] = p[0] * state[0]
    full = abs(state[0]) >= p[1] and state[0] * omega > 0
    out[1] = 0.0 if full else omega


@pytest.fixture(scope="module")
def with_slider():
    hidden = FunctionLaw(slider, (3000.0, 1e-4), 1)
    return virtual_campaign(
        "inter-panel", hidden=hidden, frequencies=(3, 5), levels=(0.9, 0.5), duration=3.0, random_state=11
    )


def test_the_law_of_a_model_with_elements_is_that_of_its_parts():
    model = with_elements(JENKINS, MAXWELL)
    law = model_law(model)
    assert law.n_states == 2 and law.inertia == model.inertia
    theta, omega, z = np.array([1e-4, -2e-4]), np.array([0.01, -0.01]), np.array([[5e-5, 2e-5], [1e-5, 3e-5]])
    plain = model_law(model.without_elements()).moment(theta, omega, np.sign(omega))
    assert law.moment(theta, omega, np.sign(omega), z) == pytest.approx(plain + 3000 * z[0] + 500 * z[1])


def test_verification_takes_the_slider_that_it_fails_without(with_slider):
    whole = with_elements(JENKINS)
    assert verify(whole, with_slider, draws=6).passed
    assert not verify(whole.without_elements(), with_slider, draws=0, tolerance=0.01).passed


def test_a_law_with_elements_still_sticks():
    # Half the Coulomb moment leaves the joint where it is, but for the springs of slider and joint.
    from sindyjoint.mechanics import harmonic, simulate

    model = with_elements(JENKINS)
    held = simulate(model_law(model), harmonic(0.5 * model["coulomb_friction"].coefficient, 2.0), 2.0, 1000.0)
    assert np.all(held.angle == 0.0)


def test_draws_keep_what_is_positive():
    wide = with_elements(JENKINS)
    wide = wide.with_numbers(wide.numbers, np.diag((2 * wide.numbers) ** 2))
    for draw in draw_models(wide, 50, np.random.default_rng(1)):
        assert all(number.value > 0 for number in draw.elements[0].numbers)


def lagging(campaign, delay, zero):
    runs = []
    for run in campaign.runs:
        late = np.interp(run.time - delay, run.time, run.moment)
        runs.append(replace(run, moment=late, angle=run.angle + zero))
    return campaign.with_runs(tuple(runs))


def nuisances(campaign, **options):
    def one(id, enters, number, unit):
        return Nuisance(id, enters, Value(id, number, 0.0, (number, number), unit))

    return TestNuisances(
        content_hash(campaign),
        campaign.joint.name,
        (one("channel_delay", "time shift", 2e-3, "s"), one("angle_offset", "angle zero", 2e-4, "rad")),
        **options,
    )


def test_nuisances_are_put_right_in_their_campaign(with_slider):
    model, faulty = with_elements(JENKINS), lagging(with_slider, 2e-3, 2e-4)
    right = verify(replace(model, test=nuisances(faulty)), faulty, draws=0)
    # The moment was delayed by linear interpolation: a little of it is lost.
    assert right.response_nrmse < 0.02 < 0.05 < verify(model, faulty, draws=0).response_nrmse
    assert (
        "put right, as found in this campaign: channel delay 0.002 s, angle offset 0.0002 rad"
        in right.warnings
    )


def test_a_campaign_of_another_joint_is_left_as_it_is(with_slider):
    model, test = with_elements(JENKINS), nuisances(lagging(with_slider, 2e-3, 2e-4))
    other = verify(replace(model, test=replace(test, joint="another")), with_slider, draws=0)
    assert other.response_nrmse == verify(model, with_slider, draws=0).response_nrmse
    assert any("is not applied to a campaign of" in line for line in other.warnings)


def test_runs_that_no_fit_has_seen_are_what_is_compared(with_slider):
    names = tuple(run.name for run in with_slider.runs)[1:3]
    model = with_elements(JENKINS)
    seen = tuple(run_hash(run) for run in with_slider.runs if run.name not in names)
    result = verify(replace(model, fitted=replace(model.fitted, seen=seen)), with_slider, draws=0)
    assert tuple(run.name for run in result.runs) == names
    assert any("compared are the runs that no fit has seen" in line for line in result.warnings)


def test_the_content_of_a_campaign_is_known_by_its_samples_alone(with_slider):
    same = with_slider.with_runs(tuple(replace(run, use="validate") for run in with_slider.runs))
    other = with_slider.with_runs(
        tuple(replace(run, angle=run.angle * (1 + 1e-12)) for run in with_slider.runs)
    )
    assert content_hash(same) == content_hash(with_slider) != content_hash(other)


def test_a_moment_of_the_frequency_belongs_to_the_test(with_slider):
    stiffer = replace(
        JENKINS,
        id="frequency_dependent_stiffness",
        columns=(Value("k_f", 10.0, 0.1, (9.8, 10.2), "N*m*s/rad", "frequency*theta"),),
        parameters=(),
        states=(),
        signals=("frequency",),
    )
    test = TestNuisances("", moments=(stiffer,))
    states = force_states(with_slider.runs[0])
    law = law_of_test(test, paper_model(), states)
    base = model_law(paper_model())
    assert isinstance(law, SumLaw)
    theta, still, one = np.array([1e-4]), np.zeros(1), np.ones(1)
    assert law.moment(theta, still, one) - base.moment(theta, still, one) == pytest.approx(10 * 3.0 * 1e-4)


def test_the_record_of_a_test_is_read_back(tmp_path, with_slider):
    test = nuisances(with_slider, drift=Drift("moment_drift", {"3Hz-0.9": 0.1}))
    (tmp_path / "test.json").write_text(test.to_json(), encoding="utf-8")
    assert read_test(tmp_path) == test and read_test(tmp_path / "model.json") == test
    assert read_test(tmp_path / "elsewhere" / "model.json") is None


@pytest.mark.parametrize("text", ["[]", "{", '{"schema": 1}', '{"schema": 2, "kind": "TestNuisances"}'])
def test_a_tampered_record_of_a_test_is_refused_in_one_line(tmp_path, text):
    (tmp_path / "test.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"test\.json: (not a record of a test|is not JSON)") as error:
        read_test(tmp_path)
    assert "\n" not in str(error.value)


def test_beyond_the_tested_range_is_said_with_its_share_of_the_time():
    model = paper_model()  # tested to 8e-4 rad and 0.03 rad/s
    time = np.arange(0, 1, 1e-3)
    inside = 8e-4 * np.sin(6 * time)
    assert range_warnings(model.fitted, "rotation", inside, 0 * inside, "run") == ()
    (line,) = range_warnings(model.fitted, "rotation", 2 * inside, 0 * inside, "run")
    share = np.mean(np.abs(2 * inside) > 1.05 * 8e-4)
    assert "angle up to 0.0016 rad where 0.0008 was tested" in line and f"{100 * share:.1f}" in line
