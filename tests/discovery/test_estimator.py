"""JointRegressor: scikit-learn's manners, one result by every way in, and what it does with terms given."""

import pickle

import numpy as np
import pysindy
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, LeaveOneGroupOut, cross_val_score
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import parametrize_with_checks

from sindyjoint import JointRegressor, TermLibrary, discover
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.paper import TERMS as IDS

TRUTH = np.array([6.066e3, -1.927e5, -2.684e9, 48.13, 1.867])


@pytest.mark.filterwarnings("ignore:X has .* features; angle, rate:UserWarning")
@parametrize_with_checks([JointRegressor("paper")])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.mark.parametrize("kind", ["number", "splits"])
def test_the_test_sets_of_a_splitter_are_the_groups(kind, rows):
    X, y = rows["X"][::7], rows["y"][::7]
    part = np.arange(len(y)) // 50 % 2
    cv, groups = {
        "number": (3, np.repeat([0, 1, 2], [len(each) for each in np.array_split(y, 3)])),
        "splits": ([(part == 1, part == 0), (part == 0, part == 1)], part),
    }[kind]
    own, given = JointRegressor("paper", cv=cv).fit(X, y), JointRegressor("paper").fit(X, y, groups)
    np.testing.assert_array_equal(own.coef_, given.coef_)
    np.testing.assert_array_equal(own.model_.standard_errors, given.model_.standard_errors)


def test_a_row_of_weight_three_is_a_row_three_times(rows):
    X, y = rows["X"][::7], rows["y"][::7]
    weight = np.random.default_rng(4).integers(0, 4, len(y))
    weighted = JointRegressor("paper").fit(X, y, sample_weight=weight)
    repeated = JointRegressor("paper").fit(X.repeat(weight, axis=0), y.repeat(weight))
    # The sums are the same, not their order.
    np.testing.assert_allclose(weighted.coef_, repeated.coef_, rtol=1e-9)
    np.testing.assert_allclose(weighted.model_.standard_errors, repeated.model_.standard_errors, rtol=1e-9)


def test_columns_beyond_the_acceleration_are_said_not_to_be_used():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 5))
    y = 3 * X[:, 0] + 2 * X[:, 2] + 0.01 * rng.normal(size=300)
    with pytest.warns(
        UserWarning, match="X has 5 features; angle, rate and acceleration are used, the others are"
    ):
        wide = JointRegressor("paper").fit(X, y)
    assert wide.n_features_in_ == 5
    np.testing.assert_array_equal(wide.predict(X), JointRegressor("paper").fit(X[:, :3], y).predict(X[:, :3]))


def test_same_result_as_discover(found, rows):
    regressor = JointRegressor().fit(**rows)
    assert regressor.selected_ == found.model.ids == IDS
    np.testing.assert_array_equal(regressor.coef_[:5], found.model.coefficients)
    np.testing.assert_array_equal(regressor.model_.standard_errors, found.model.standard_errors)


def test_coefficients_are_the_true_ones_within_four_standard_errors(found):
    assert np.all(
        np.abs(found.model.coefficients - TRUTH) < 4 * found.model.standard_errors + 0.01 * np.abs(TRUTH)
    )


def test_fitting_twice_equals_fitting_once(rows):
    once = JointRegressor().fit(**rows)
    twice = JointRegressor().fit(rows["X"][::7], rows["y"][::7]).fit(**rows)
    np.testing.assert_array_equal(once.coef_, twice.coef_)
    assert once.get_params() == twice.get_params()


def test_clone_and_pickle(rows):
    fitted = JointRegressor("paper", forced=["linear_stiffness"], signs={"coulomb_friction": 1}).fit(**rows)
    again = clone(fitted)
    assert not hasattr(again, "coef_") and again.get_params() == fitted.get_params()
    revived = pickle.loads(pickle.dumps(fitted))
    np.testing.assert_array_equal(revived.predict(rows["X"]), fitted.predict(rows["X"]))


def test_predict_is_the_model(rows):
    fitted = JointRegressor().fit(**rows)
    X = rows["X"]
    np.testing.assert_allclose(fitted.predict(X), fitted.model_.moment(X[:, 0], X[:, 1]), rtol=1e-12)
    assert fitted.score(X, rows["y"]) > 0.999


def test_cross_val_score_over_frequencies(rows):
    scores = cross_val_score(
        JointRegressor(), rows["X"], rows["y"], groups=rows["groups"], cv=LeaveOneGroupOut()
    )
    assert scores.shape == (4,) and scores.min() > 0.999


def test_grid_search_in_a_pipeline_picks_the_model_of_discover(found, rows):
    pipeline = Pipeline([("states", FunctionTransformer()), ("joint", JointRegressor())])
    grid = {"joint__threshold": [0.005, 0.05, 0.2], "joint__library": ["polynomial", "extended"]}
    search = GridSearchCV(pipeline, grid, cv=LeaveOneGroupOut(), error_score="raise")
    search.fit(rows["X"], rows["y"], groups=rows["groups"])
    assert search.best_params_ == {"joint__threshold": 0.005, "joint__library": "extended"}
    assert search.best_estimator_["joint"].selected_ == found.model.ids


def test_the_same_library_in_pysindy_gives_the_same_coefficients(rows):
    ours = JointRegressor("paper", threshold=0.0).fit(rows["X"], rows["y"])
    library = TermLibrary("paper")
    model = pysindy.SINDy(pysindy.STLSQ(threshold=0.01, alpha=0.0, unbias=False), feature_library=library)
    model.fit(rows["X"], t=1.0, x_dot=rows["y"][:, None])
    theirs = library.physical_coefficients(model.coefficients())[0]
    np.testing.assert_allclose(theirs, ours.coef_, rtol=1e-8)


@pytest.mark.parametrize(("angle", "moment"), [(1e3, 1.0), (1.0, 1e-3), (57.3, 2e5)])
def test_scaled_units_scale_the_coefficients(rows, angle, moment):
    scaled = {
        **rows,
        "X": rows["X"] * angle,
        "X_replicate": rows["X_replicate"] * angle,
        "y": rows["y"] * moment,
        "y_replicate": rows["y_replicate"] * moment,
    }
    plain, other = JointRegressor().fit(**rows), JointRegressor().fit(**scaled)
    assert other.selected_ == plain.selected_
    power = np.array([1, 2, 3, 1, 0])
    np.testing.assert_allclose(other.coef_[:5], plain.coef_[:5] * moment / angle**power, rtol=1e-7)
    np.testing.assert_allclose(
        [t.unique_share for t in other.model_.terms], [t.unique_share for t in plain.model_.terms], rtol=1e-7
    )


def test_negated_motion_negates_the_even_term_only(rows):
    mirrored = {**rows, "X": -rows["X"], "X_replicate": -rows["X_replicate"]}
    mirrored |= {"y": -rows["y"], "y_replicate": -rows["y_replicate"]}
    plain, other = JointRegressor().fit(**rows), JointRegressor().fit(**mirrored)
    np.testing.assert_allclose(other.coef_[:5], plain.coef_[:5] * [1, -1, 1, 1, 1], rtol=1e-9)


def test_forced_forbidden_signs_and_fixed(rows):
    forced = JointRegressor(forced=["quintic_stiffness"]).fit(**rows)
    assert {*IDS, "quintic_stiffness"} <= set(forced.selected_)
    assert "cubic_stiffness" not in JointRegressor(forbidden=["cubic_stiffness"]).fit(**rows).selected_
    negative = JointRegressor(signs={"coulomb_friction": -1}).fit(**rows)
    assert "coulomb_friction" not in negative.selected_
    assert JointRegressor(signs={"coulomb_friction": 1}).fit(**rows).selected_ == IDS
    known = JointRegressor(fixed={"linear_stiffness": 6066.0}).fit(**rows)
    assert known.selected_ == IDS
    stiffness = known.model_["linear_stiffness"]
    assert (stiffness.coefficient, stiffness.standard_error) == (6066.0, 0.0)
    free = JointRegressor().fit(**rows).model_
    assert known.model_["cubic_stiffness"].standard_error < 0.7 * free["cubic_stiffness"].standard_error
    assert known.model_.fitted.moment_rms == pytest.approx(free.fitted.moment_rms)


def test_a_known_inertia_can_be_fixed(inter_panel):
    from dataclasses import replace

    undeclared = replace(inter_panel, joint=replace(inter_panel.joint, inertia=None))
    fixed = discover(undeclared, fixed={"inertia": 0.02}, correct=False)
    declared = discover(inter_panel, correct=False)
    assert set(fixed.model.ids) == {*IDS, "inertia"} and fixed.model.inertia == 0.02
    for term in IDS:
        # the moment's RMS, and with it the unique shares, hold the inertia's part; the fit does not
        assert fixed.model[term].coefficient == pytest.approx(declared.model[term].coefficient, rel=1e-6)


def test_purely_viscous_data_yield_no_friction():
    rng = np.random.default_rng(0)
    phase = np.linspace(0, 40 * np.pi, 8000)
    X = np.column_stack([8e-4 * np.sin(phase), 0.02 * np.cos(phase)])
    X *= (1 + 0.5 * (np.arange(8000) // 2000))[:, None] / 2.5
    y = 6066 * X[:, 0] + 48.13 * X[:, 1] + 0.02 * rng.normal(size=8000)
    fitted = JointRegressor().fit(X, y, groups=np.arange(8000) // 2000)
    assert fitted.selected_ == ("linear_stiffness", "linear_damping")


@pytest.mark.parametrize("seed", range(3))
def test_shuffled_moments_yield_no_model(rows, seed):
    shuffled = np.random.default_rng(seed).permutation(rows["y"])
    fitted = JointRegressor().fit(**{**rows, "y": shuffled, "y_replicate": shuffled})
    assert fitted.selected_ == () and "no set of terms" in fitted.selection_result_.reason
    assert not fitted.predict(rows["X"]).any()


def test_a_weight_of_two_counts_a_row_twice(rows):
    X, y = rows["X"][:3000], rows["y"][:3000]
    weight = np.random.default_rng(0).integers(0, 3, 3000)
    weighted = JointRegressor("paper", threshold=0.0).fit(X, y, sample_weight=weight)
    repeated = JointRegressor("paper", threshold=0.0).fit(np.repeat(X, weight, axis=0), np.repeat(y, weight))
    np.testing.assert_allclose(weighted.coef_, repeated.coef_, rtol=1e-9)


@pytest.mark.parametrize("labelled", [True, False])
def test_a_weight_of_zero_is_a_row_that_is_not_there(rows, labelled):
    """A whole frequency, or a part of one record that is held out, may have no weight."""
    given = rows if labelled else {"X": rows["X"], "y": rows["y"]}
    counts = rows["groups"] != rows["groups"][0]
    weighted = JointRegressor("paper").fit(**given, sample_weight=counts.astype(float))
    without = JointRegressor("paper").fit(**{name: values[counts] for name, values in given.items()})
    np.testing.assert_array_equal(weighted.coef_, without.coef_)
    np.testing.assert_array_equal(weighted.model_.standard_errors, without.model_.standard_errors)
    assert not np.array_equal(weighted.coef_, JointRegressor("paper").fit(**given).coef_)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"method": "magic"}, UnknownNameError, "method is 'magic'; expected one of stlsq, best_subset"),
        ({"selection": "luck"}, UnknownNameError, "selection is 'luck'"),
        ({"threshold": 1.5}, InputError, "threshold is 1.5; expected a share of the moment's RMS"),
        (
            {"forced": ["nothing"]},
            UnknownNameError,
            "forced names 'nothing', which is not among the candidates",
        ),
        (
            {"forced": ["linear_damping"], "forbidden": ["linear_damping"]},
            InputError,
            "term 'linear_damping' is forced and forbidden",
        ),
        ({"signs": {"nothing": 1}}, UnknownNameError, "signs names 'nothing'"),
        ({"signs": {"linear_stiffness": 2}}, InputError, "'linear_stiffness' is 2; expected \\+1 or -1"),
        ({"fixed": {"nothing": 1.0}}, UnknownNameError, "fixed names 'nothing'"),
        ({"fixed": {"linear_stiffness": np.nan}}, InputError, "expected a finite coefficient"),
        ({"library": "atlantis"}, UnknownNameError, "atlantis"),
    ],
)
def test_bad_parameters_are_refused_in_fit(rows, options, error, message):
    with pytest.raises(error, match=message):
        JointRegressor(**options).fit(**rows)


def test_bad_data_are_refused(rows):
    with pytest.raises(InputError, match="sample_weight holds -1; weights that are not negative"):
        JointRegressor().fit(rows["X"], rows["y"], sample_weight=np.full(len(rows["y"]), -1.0))
    with pytest.raises(ValueError, match="zero for every row"):
        JointRegressor().fit(rows["X"], rows["y"], sample_weight=np.zeros(len(rows["y"])))
    with pytest.raises(InputError, match="X has 1 feature\\(s\\); 2 \\(angle, rate\\) or 3"):
        JointRegressor().fit(rows["X"][:, :1], rows["y"])
    with pytest.raises(InputError, match="too few samples in motion; drive the joint harder"):
        JointRegressor().fit(rows["X"][:20], rows["y"][:20])
    with pytest.raises(InputError, match="groups has shape \\(3,\\)"):
        JointRegressor().fit(rows["X"], rows["y"], groups=[1, 2, 3])


def test_a_motion_shared_by_all_blocks_asks_more_of_each_term(rows):
    """Where the scatter of blocks lacks the angle's noise, a term must also carry 0.15 of the residual."""
    shared = {**rows, "X_replicate": rows["X"], "y_replicate": rows["y"]}
    separate, one = JointRegressor().fit(**rows), JointRegressor().fit(**shared)
    residual = one.selection_result_.path[0].fit.residual_rms / one.model_.fitted.moment_rms
    assert separate.least_share_ == separate.least_share == 0.002
    assert one.least_share_ == pytest.approx(max(0.002, 0.15 * residual))
    noisy = rows["y"] + np.random.default_rng(0).normal(size=len(rows["y"])) * 0.1 * np.std(rows["y"])
    loud = JointRegressor().fit(**{**shared, "y": noisy, "y_replicate": noisy})
    # 10 % noise: 0.15 of it is 1.5 %
    assert loud.least_share_ == pytest.approx(0.015, rel=0.05)
