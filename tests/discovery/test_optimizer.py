"""Sequential thresholding on unique shares inside plain pysindy: the same joint model as every other door gives."""

import pickle

import numpy as np
import pysindy
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, KFold

from sindyjoint import JointRegressor, TermLibrary, UniqueShareSTLSQ
from sindyjoint.errors import InputError, UnknownNameError

PAPER = {"linear_stiffness", "quadratic_stiffness", "cubic_stiffness", "linear_damping", "coulomb_friction"}


@pytest.fixture(scope="module")
def labelled(rows):
    """Return moving states with their moment, and the labels of the rows; the noise of the motion is not looked at."""
    return rows["X"], rows["y"], {name: rows[name] for name in ("groups", "runs", "blocks")}


def sindy(**options):
    return pysindy.SINDy(feature_library=TermLibrary("extended"), optimizer=UniqueShareSTLSQ(**options))


def terms_of(model):
    return {n: c for n, c in zip(model.get_feature_names(), physical(model), strict=True) if c}


def physical(model):
    return model.feature_library.physical_coefficients(model.coefficients())[0]


def test_a_list_of_runs_and_their_moments_is_a_joint_model(labelled):
    X, y, labels = labelled
    parts = [labels["runs"] == run for run in dict.fromkeys(labels["runs"].tolist())]
    model = sindy(**labels).fit([X[p] for p in parts], 1e-3, x_dot=[y[p, None] for p in parts])
    regressor = JointRegressor("extended").fit(X, y, **labels)
    found = terms_of(model)
    assert set(found) == set(regressor.selected_) == PAPER
    for term in regressor.model_.terms:
        assert found[term.id] == pytest.approx(term.coefficient, rel=1e-9)
    assert model.optimizer.selection_result_.reason == regressor.selection_result_.reason
    assert model.score([X[p] for p in parts], 1e-3, x_dot=[y[p, None] for p in parts]) > 0.999


@pytest.mark.parametrize("every", [1, 10, 40])
def test_the_terms_do_not_depend_on_the_number_of_samples(labelled, every):
    X, y, labels = labelled
    thin = {name: label[::every] for name, label in labels.items()}
    assert (
        set(terms_of(sindy(threshold=0.004, **thin).fit(X[::every], 1e-3, x_dot=y[::every, None]))) == PAPER
    )


def test_fitting_anew_keeps_nothing_of_an_earlier_fit(labelled):
    X, y, labels = labelled
    columns = np.asarray(TermLibrary("extended").fit(X).transform(X))
    optimizer = UniqueShareSTLSQ(**labels).fit(columns, y)
    first = optimizer.coef_.copy()
    steps = len(optimizer.history_)
    again = optimizer.fit(columns, -y)
    np.testing.assert_allclose(again.coef_, -first, rtol=1e-12)
    assert len(again.history_) == steps == len(again.selection_result_.path)
    assert again.history_[again.selection_result_.chosen] == pytest.approx(again.coef_)


def test_each_target_has_a_choice_of_its_own(labelled):
    X, y, labels = labelled
    columns = np.asarray(TermLibrary("paper").fit(X).transform(X))
    spring = 6066 * X[:, 0] + 0.01 * np.random.default_rng(3).normal(size=len(X))
    both = UniqueShareSTLSQ(threshold=0.004, **labels).fit(columns, np.column_stack([y, spring]))
    assert [np.count_nonzero(row) for row in both.coef_] == [5, 1]
    assert len(both.selections_) == 2


def test_it_clones_and_pickles_and_sets_parameters():
    optimizer = UniqueShareSTLSQ(threshold=0.02, forced=(0,))
    assert clone(optimizer).get_params() == optimizer.get_params()
    assert pickle.loads(pickle.dumps(optimizer)).get_params() == optimizer.get_params()
    assert optimizer.set_params(threshold=0.1) is optimizer and optimizer.threshold == 0.1
    with pytest.raises(ValueError, match="Invalid parameter 'treshold'"):
        optimizer.set_params(treshold=0.1)


def test_a_grid_search_over_it_has_scores(labelled):
    X, y, _ = labelled
    columns = np.asarray(TermLibrary("extended").fit(X).transform(X))
    search = GridSearchCV(UniqueShareSTLSQ(), {"threshold": [0.003, 0.5]}, cv=KFold(4)).fit(columns, y)
    scores = search.cv_results_["mean_test_score"]
    assert np.isfinite(scores).all() and search.best_params_ == {"threshold": 0.003}


def test_a_grid_search_over_it_inside_sindy_has_scores(labelled):
    X, y, _ = labelled
    time = 1e-3 * np.arange(len(X))

    def score(model, states, at):
        """SINDy.score knows no moment: the scorer looks it up by the time that stands for the target."""
        return model.score(states, at, x_dot=y[np.searchsorted(time, at), None])

    search = GridSearchCV(sindy(), {"optimizer__threshold": [0.003, 0.5]}, scoring=score, cv=KFold(4))
    search.fit(X, time, x_dot=y[:, None])
    scores = search.cv_results_["mean_test_score"]
    assert np.isfinite(scores).all() and search.best_params_ == {"optimizer__threshold": 0.003}
    assert scores[0] > 0.999 > scores[1]


def test_forced_forbidden_and_signed_columns(labelled):
    X, y, labels = labelled
    library = TermLibrary("paper").fit(X)
    columns, names = np.asarray(library.transform(X)), library.get_feature_names()
    options = dict(labels, feature_names=names)
    kept = UniqueShareSTLSQ(threshold=0.3, forced=["quadratic_stiffness"], **options).fit(columns, y)
    assert kept.coef_[0, names.index("quadratic_stiffness")] != 0
    without = UniqueShareSTLSQ(forbidden=[names.index("coulomb_friction")], **options).fit(columns, y)
    assert without.coef_[0, names.index("coulomb_friction")] == 0
    assert without.left_out_ == (names.index("coulomb_friction"),)
    signed = UniqueShareSTLSQ(threshold=0.0, signs={"cubic_stiffness": 1}, **options).fit(columns, y)
    assert signed.coef_[0, names.index("cubic_stiffness")] >= 0


def test_shuffled_moments_have_no_model(labelled):
    X, y, labels = labelled
    shuffled = np.random.default_rng(5).permutation(y)
    optimizer = sindy(**labels).fit(X, 1e-3, x_dot=shuffled[:, None]).optimizer
    assert not optimizer.coef_.any() and optimizer.selection_result_.chosen is None


@pytest.mark.parametrize(
    "options, error, message",
    [
        ({"threshold": 1.5}, InputError, "threshold is 1.5; expected a share of the moment's RMS"),
        ({"method": "magic"}, UnknownNameError, "method is 'magic'; expected one of stlsq, "),
        ({"forced": ["k1"]}, UnknownNameError, "forced names 'k1', .*give feature_names"),
        ({"forced": [99]}, InputError, "forced names column 99; there are 5 columns"),
        ({"signs": {0: 2}}, InputError, r"signs: '0' is 2; expected \+1 or -1"),
        ({"feature_names": ["a"]}, InputError, "feature_names has 1 names; one for each of 5 columns"),
        ({"groups": [1, 2]}, InputError, r"groups has shape \(2,\)"),
        ({"replicate": (np.ones((3, 5)), np.ones(3))}, InputError, r"replicate has shapes \(3, 5\) and \(3,\)"),
    ],
)  # fmt: skip
def test_bad_parameters_are_refused_in_fit(labelled, options, error, message):
    X, y, _ = labelled
    columns = np.asarray(TermLibrary("paper").fit(X).transform(X))
    with pytest.raises(error, match=message):
        UniqueShareSTLSQ(**options).fit(columns, y)


def test_the_threshold_stands_alone_as_that_of_pysindys_does():
    assert UniqueShareSTLSQ(0.1).threshold == pysindy.STLSQ(0.1).threshold == 0.1
