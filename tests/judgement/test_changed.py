"""Two tests of one joint: what moved, what is the same, and what calibration does not know."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from sindyjoint import JointRegressor, changed
from sindyjoint.equation import gain_errors, with_gain_uncertainty
from sindyjoint.errors import InputError
from sindyjoint.judgement.changed import compare_models
from sindyjoint.reporting import text_of
from tests.equation.test_formula_evaluation import JENKINS, with_elements


def model_of(seed, k1=6066.0, friction=1.867, rows=4000):
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1, 1, (rows, 2)) * [8e-4, 0.02]
    moment = k1 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 48 * X[:, 1] + friction * np.sign(X[:, 1])
    return JointRegressor("paper").fit(X, moment + 0.05 * rng.normal(size=rows)).model_


@pytest.fixture(scope="module")
def before():
    return model_of(0)


def test_an_unchanged_joint_is_the_same(before):
    said = changed(before, model_of(1))
    assert not said.changed
    assert {s.id: s.answer for s in said.shifts}["linear_stiffness"] == "the same within margin"


def test_false_alarms_keep_to_their_risk(before):
    """Fifteen pairs at 5 %: more than three false alarms have a chance of one in two hundred."""
    models = [model_of(seed, rows=600) for seed in range(100, 130)]
    pairs = zip(models[::2], models[1::2], strict=True)
    same = [compare_models(one, other).changed for one, other in pairs if one.ids == other.ids]
    assert len(same) > 10 and sum(same) <= 3


def test_few_degrees_of_freedom_make_a_difference_less_certain(before):
    """Two estimates with errors of 1 and 4 degrees each differ by 5: Welch's t of 8 degrees, not a normal score."""
    half = t.ppf(0.975, 4)

    def estimate(value):
        first = before.terms[0]
        own = replace(first, coefficient=value, standard_error=1.0, interval95=(value - half, value + half))
        return before.with_terms([own], [[1.0]])

    (shift,) = compare_models(estimate(100.0), estimate(105.0)).shifts
    assert (
        shift.p_value == pytest.approx(2 * t.sf(5 / np.sqrt(2), 8), rel=1e-6)
        and shift.answer == "changed within margin"
    )
    assert shift.interval[1] - shift.change == pytest.approx(t.ppf(0.975, 8) * np.sqrt(2) / 100, rel=1e-6)


def test_what_moved_is_named_with_its_size(before):
    said = changed(before, model_of(2, k1=6066 * 0.95, friction=1.867 * 1.3))
    told = {s.symbol: s for s in said.moved}
    assert set(told) == {"k1", "M_F"}
    assert told["M_F"].change == pytest.approx(0.3, abs=0.02) and told["M_F"].answer == "changed"
    assert told["k1"].answer == "changed within margin"
    low, high = told["k1"].interval
    assert low < -0.05 < high < 0
    assert "k1 by -5" in text_of(said).replace("−", "-")
    assert json.loads(json.dumps(said.to_dict()))["changed"] is True


def test_calibration_counts_unless_the_sensors_are_the_same(before):
    gains = {"moment": 0.03}
    one, other = (with_gain_uncertainty(m, gains) for m in (before, model_of(2, k1=6066 * 0.97)))
    assert not compare_models(one, other).changed
    assert compare_models(one, other, same_sensors=True).changed
    assert type(one).from_json(one.to_json()).fitted.gains == {"moment": 0.03}


def test_an_error_of_a_gain_moves_coefficients_by_their_degree(before):
    """An angle 1 % too large makes k1 1 % and k3 3 % smaller, c1 1 %, and leaves the friction."""
    errors = gain_errors(replace(before, fitted=replace(before.fitted, gains={"angle": 0.01})))
    relative = dict(zip(before.ids, errors / np.abs(before.coefficients), strict=True))
    wanted = {
        "linear_stiffness": 0.01,
        "cubic_stiffness": 0.03,
        "linear_damping": 0.01,
        "coulomb_friction": 0.0,
    }
    assert {name: relative[name] for name in wanted} == pytest.approx(wanted, abs=1e-6)
    known = with_gain_uncertainty(before, {"moment": 0.02, "angle": 0.01})
    k1, k3 = known.ids.index("linear_stiffness"), known.ids.index("cubic_stiffness")
    common = 0.02**2 + 3 * 0.01**2
    shared = known.covariance_matrix[k1, k3] - before.covariance_matrix[k1, k3]
    assert shared == pytest.approx(common * before.coefficients[k1] * before.coefficients[k3], rel=1e-6)
    assert known["k1"].standard_error == pytest.approx(
        np.hypot(0.0224 * 6066, before["k1"].standard_error), rel=0.01
    )


def test_terms_of_one_test_alone_are_not_compared(before):
    less = before.with_terms(before.terms[:-1], np.array(before.covariance)[:-1, :-1])
    said = compare_models(before, less)
    assert said.shifts[-1].answer == "not compared" and any("one of the two only" in w for w in said.warnings)


def test_what_is_no_test_of_the_same_joint_is_refused(before):
    sliding = replace(before, joint=replace(before.joint, motion="translation"))
    with pytest.raises(InputError, match="same joint"):
        changed(before, sliding)
    with pytest.raises(InputError, match="margin is 2"):
        changed(before, before, margin=2)


def test_numbers_of_elements_are_compared():
    one = with_elements(JENKINS)
    softer = replace(JENKINS, columns=(replace(JENKINS.columns[0], value=2700.0),))
    assert changed(one, one).sentence == "the same: every change beyond 10 % is ruled out"
    assert changed(one, with_elements(softer)).sentence == "changed: k_t by -10 %"
    # In another form the same name is another number.
    bent = replace(JENKINS, columns=(replace(JENKINS.columns[0], formula="z + z**3"),))
    said = changed(one, with_elements(bent))
    assert [s.answer for s in said.shifts if s.symbol == "k_t"] == ["not compared", "not compared"]
    assert "jenkins_element.k_t" in said.warnings[0] and "stand(s) in one of the two only" in said.warnings[0]
