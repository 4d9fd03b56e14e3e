"""Laws that depend on declared inputs: terms, hierarchy, regressors, campaigns, lags, levels."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import Campaign, JointRegressor, TermLibrary
from sindyjoint.discovery.uncertainty import cross_validate
from sindyjoint.equation import JointModel, load_catalogue, with_dependences
from sindyjoint.errors import InputError
from sindyjoint.inputs import Input, lagged, levels, run_levels
from sindyjoint.judgement.over_inputs import changed_term, find_lags
from sindyjoint.judgement.verdict import judge
from sindyjoint.states import campaign_states

RNG = np.random.default_rng(0)
TEMPERATURES = np.repeat([233.15, 273.15, 303.15, 333.15], 1500)
X = np.column_stack([RNG.uniform(-1, 1, (6000, 2)) * [8e-4, 0.02], TEMPERATURES])


def moment(X, k1_T=6.0, M_T=-0.004, noise=0.01):
    from_reference = X[:, 2] - 283.15
    smooth = 6066 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 48 * X[:, 1]
    friction = (1.867 + M_T * from_reference) * np.sign(X[:, 1])
    return (
        smooth
        + k1_T * from_reference * X[:, 0]
        + friction
        + noise * np.random.default_rng(1).normal(size=len(X))
    )


@pytest.fixture(scope="module")
def regressor():
    return JointRegressor(inputs=["temperature"]).fit(
        X, moment(X), runs=TEMPERATURES, groups=np.arange(6000) % 4
    )


def test_dependences_are_found_with_their_intervals_and_nothing_else(regressor):
    found = [term for term in regressor.model_.terms if term.inputs]
    assert [term.id for term in found] == [
        "linear_stiffness_by_temperature",
        "coulomb_friction_by_temperature",
    ]
    assert found[0].coefficient == pytest.approx(6.0, abs=4 * found[0].standard_error)
    assert found[1].coefficient == pytest.approx(-0.004, abs=4 * found[1].standard_error)
    assert regressor.inputs_[0].levels == 4 and regressor.inputs_[0].tested == (233.15, 333.15)


def test_five_terms_that_depend_on_temperature_are_the_papers_at_each_level():
    whole = moment(X) - 1.9e5 * X[:, 0] ** 2
    fitted = JointRegressor(inputs=["temperature"]).fit(
        X, whole, runs=TEMPERATURES, groups=np.arange(6000) % 4
    )
    model = replace(fitted.model_, fitted=replace(fitted.model_.fitted, noise_floor=0.01))
    verdict = judge(fitted, model)
    assert verdict.verdict == "confirmed" and not verdict.missing and not verdict.extra
    assert verdict.reason.startswith("at each level exactly the paper's five terms")
    assert verdict.reason.endswith("linear stiffness and Coulomb friction depend on temperature")
    # A friction that changes its sign on the way is no friction at a level between.
    slope = model["coulomb_friction_by_temperature"]
    steep = replace(slope, coefficient=-0.1, standard_error=0.001)
    terms = [steep if term is slope else term for term in model.terms]
    reversed_ = replace(model, terms=tuple(terms))
    said = judge(fitted, reversed_)
    assert (
        said.verdict == "undecided" and "changes its sign over the tested range of temperature" in said.reason
    )


def test_a_constant_joint_shows_no_dependence():
    fitted = JointRegressor(inputs=["temperature"]).fit(X, moment(X, 0, 0), runs=TEMPERATURES)
    assert not any(term.inputs for term in fitted.model_.terms)


def test_the_law_at_a_value_is_one_of_angle_and_rate(regressor):
    model = regressor.model_
    cold = model.at(temperature=233.15)
    assert cold.ids == ("linear_stiffness", "cubic_stiffness", "linear_damping", "coulomb_friction")
    assert cold["k1"].coefficient == pytest.approx(6066 - 300, rel=1e-3)
    at = X[:5]
    assert cold.moment(at[:, 0], at[:, 1]) == pytest.approx(
        model.moment(at[:, 0], at[:, 1], inputs={"temperature": 233.15})
    )
    row = np.array([1.0, *[0.0] * (len(model.ids) - 1)])
    row[model.ids.index("linear_stiffness_by_temperature")] = 233.15 - 283.15
    assert cold["k1"].standard_error == pytest.approx(np.sqrt(row @ model.covariance_matrix @ row))
    assert model.at().ids == cold.ids and model.at()["k1"].coefficient == model["k1"].coefficient


def test_a_model_with_inputs_is_read_as_it_was_written(regressor):
    model = regressor.model_
    again = JointModel.from_json(model.to_json())
    assert again.to_dict() == model.to_dict() and again.inputs == model.inputs and again.terms == model.terms
    plain = JointRegressor().fit(X[:, :2], moment(X, 0, 0)).model_
    assert "inputs" not in plain.to_json()


def test_columns_of_a_frame_are_taken_by_name(regressor):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"temperature": X[:, 2], "angle": X[:, 0], "rate": X[:, 1]})
    other = JointRegressor(inputs=["temperature"]).fit(
        frame, moment(X), runs=TEMPERATURES, groups=np.arange(6000) % 4
    )
    assert other.selected_ == regressor.selected_ and other.coef_ == pytest.approx(regressor.coef_)
    assert other.predict(frame) == pytest.approx(regressor.predict(X))
    with pytest.raises(InputError, match="expected one for the input 'load'"):
        JointRegressor(inputs=["load"]).fit(frame, moment(X))


def test_the_term_library_has_the_dependences():
    library = TermLibrary("paper", inputs=["temperature"]).fit(X)
    assert "cubic_stiffness_by_temperature" in library.get_feature_names()
    assert "cubic_stiffness_by_temperature_squared" in library.get_feature_names()
    assert library.transform(X).shape == (6000, 18)


def test_hierarchy_and_levels_bound_what_is_offered():
    paper = load_catalogue("paper")
    three = with_dependences(paper, [Input("T", "K", 283.15, levels=3)])
    assert not any(name.endswith("_squared") for name in three.ids)
    without_k1 = with_dependences(paper.without(["linear_stiffness"]), [Input("T", "K", 283.15, levels=4)])
    assert not any(name.startswith("linear_stiffness") for name in without_k1.ids)
    load = with_dependences(paper, [Input("load", "N", levels=2)])
    assert "coulomb_friction_proportional_to_load" in load and "coulomb_friction_by_load" not in load
    assert load["coulomb_friction_proportional_to_load"].unit_for("translation") == "1"
    signal = with_dependences(paper, [Input("signal", "V", levels=3, tested=(0.0, 2.0))])
    assert "coulomb_friction_switched_by_signal" in signal


@pytest.mark.parametrize("unit", ["K", "N", "V"])
def test_each_of_the_five_is_offered_straight_and_bent(unit):
    paper = load_catalogue("paper")
    offered = with_dependences(paper, [Input("T", unit, 1.0, levels=4, tested=(0.0, 2.0))])
    found = {term.id for term in paper}
    for term in offered:
        if term.inputs and "switched" not in term.id:
            found.add((changed_term(term.expression), "squared" in term.id))
    # A load also brings a moment of its own.
    own = {(None, False)} if unit == "N" else set()
    assert found == {*paper.ids, *((name, bent) for name in paper.ids for bent in (False, True)), *own}


def test_no_set_holds_a_dependence_without_its_coefficient(regressor):
    evidence = regressor.evidence_
    for step in regressor.selection_result_.path:
        assert evidence.complete(step.columns) == step.columns


def test_a_level_of_the_input_is_left_out(regressor):
    values = [run.name for run in regressor.evidence_.runs]
    folds = cross_validate(regressor.evidence_, values).folds
    assert len(folds) == 4 and all(fold.moment_error < 0.02 for fold in folds)


def test_levels_are_counted_in_runs_and_along_them():
    assert levels([np.full(9, v) for v in (1.0, 1.0, 2.0, 3.0)], (1.0, 3.0)) == 3
    switched = np.tile(np.repeat([0.0, 2.0], 400), 5) + 0.01 * RNG.normal(size=4000)
    assert levels([switched], (float(switched.min()), float(switched.max()))) == 2
    assert levels([np.linspace(0, 1, 2000)], (0.0, 1.0)) >= 4


def test_the_lag_of_a_switched_signal_is_found():
    rate, t = 500.0, np.arange(6000) / 500.0
    angle = 1e-3 * np.sin(2 * np.pi * 2 * t) + 4e-4 * np.sin(2 * np.pi * 4.7 * t)
    velocity = np.gradient(angle, t)
    signal = (RNG.random(120) > 0.5).repeat(50).astype(float)
    force = (1 + 2 * lagged(signal, 0.02 * rate)) * np.sign(velocity) + 50 * angle
    force += 0.01 * RNG.normal(size=t.size)
    campaign = Campaign.from_arrays(
        moment=force, angle=angle, rate=rate, frequency=None, inertia=0.0, inputs={"signal": signal}
    )
    (lag,) = find_lags(campaign_states(campaign), 0.0, campaign.inputs)
    assert lag.name == "signal" and lag.time == pytest.approx(0.02, rel=0.15) and lag.removed > 0.5


def test_a_run_must_have_every_input_and_no_other():
    signals = {"moment": [np.ones(64)], "angle": [np.sin(np.arange(64))], "rate": "10 Hz"}
    with pytest.raises(InputError, match="already means something"):
        Campaign.from_arrays(**signals, inputs={"omega": 1.0})
    with pytest.raises(InputError, match="2 value"):
        Campaign.from_arrays(**signals, inputs={"T": [1.0, 2.0]})
    one = Campaign.from_arrays(**signals, inputs={"T": ["20 degC"]}, references={"T": "0 degC"})
    assert one.inputs[0].reference == pytest.approx(273.15) and one.runs[0].inputs["T"][0] == pytest.approx(
        293.15
    )
    with pytest.raises(InputError, match="not declared"):
        Campaign(one.joint, one.runs)


def test_a_term_of_ones_own_stands_before_the_one_that_is_offered(tmp_path):
    (tmp_path / "mine.toml").write_text(
        """
name = "mine"
description = "the paper's terms, and friction over temperature"
include = ["paper"]
[[term]]
id = "warm_friction"
symbol = "M_T"
formula = "(temperature - T0)*sign(omega)"
unit = "N*m/K"
name = "friction over temperature"
meaning = "dry friction that falls as the grease warms"
family = "friction"
inputs = [{ name = "temperature", unit = "K", reference = "T0" }]
within = ["coulomb_friction"]
"""
    )
    own = JointRegressor(str(tmp_path / "mine.toml"), inputs=[Input("temperature", "K", 283.15)])
    own.fit(X, moment(X), runs=TEMPERATURES)
    assert "warm_friction" in own.selected_ and "coulomb_friction_by_temperature" in own.indistinct_
    (term,) = (t for t in own.model_.terms if t.id == "warm_friction")
    assert term.parameters == (("T0", 283.15),) and term.coefficient == pytest.approx(-0.004, rel=0.05)
    with pytest.raises(InputError, match="depends on the input 'temperature', which these data do not have"):
        JointRegressor(str(tmp_path / "mine.toml")).fit(X[:, :2], moment(X))


def test_runs_at_nearly_one_value_are_at_one_level():
    measured = {"a": 20.1, "b": 20.4, "c": 59.8, "d": 60.0, "e": 20.2}
    at = run_levels({name: np.linspace(v - 0.1, v + 0.1, 9) for name, v in measured.items()}, (20.0, 60.1))
    assert at["a"] == at["b"] == at["e"] == pytest.approx(60.7 / 3)
    assert at["c"] == at["d"] == pytest.approx(59.9)
    assert run_levels({"a": np.linspace(0, 1, 9), "b": np.ones(9)}, (0.0, 1.0)) == {}
    assert run_levels({"a": np.ones(9)}, (1.0, 1.0)) == {}
