"""What pysindy's own tests ask of any optimizer and any library, asked of ours beside one of its own.

``benchmarks/others_tests.py`` runs those tests themselves.
"""

import numpy as np
import pysindy
import pytest
from sklearn.exceptions import NotFittedError

from sindyjoint import TermLibrary, UniqueShareSTLSQ

OPTIMIZERS = [UniqueShareSTLSQ, pysindy.STLSQ]
LIBRARIES = [lambda: TermLibrary("paper"), lambda: pysindy.PolynomialLibrary(degree=2)]
TRUTH = np.array([[1.0, 0.0, 0.0, 2.0, 0.0], [0.0, -1.5, 0.0, 0.0, 0.7]])
X = np.random.default_rng(0).normal(size=(400, 5))


@pytest.mark.parametrize("make", OPTIMIZERS)
@pytest.mark.parametrize("ask", [lambda o: o.predict(X), lambda o: o.complexity])
def test_an_optimizer_that_is_not_fitted_says_so(make, ask):
    with pytest.raises(NotFittedError):
        ask(make())


@pytest.mark.parametrize("make", OPTIMIZERS)
@pytest.mark.parametrize("targets", [1, 2])
def test_an_optimizer_finds_coefficients_of_each_target(make, targets):
    truth = TRUTH[:targets]
    fitted = make().fit(X, X @ truth.T)
    np.testing.assert_allclose(fitted.coef_, truth, atol=1e-2)
    assert fitted.coef_.shape == truth.shape and fitted.predict(X).shape == (400, targets)
    np.testing.assert_array_equal(fitted.ind_, truth != 0)
    assert fitted.complexity == np.count_nonzero(truth)


@pytest.mark.parametrize("make", OPTIMIZERS)
@pytest.mark.parametrize("wrap", [pysindy.WrappedOptimizer, pysindy.EnsembleOptimizer])
def test_an_optimizer_can_be_wrapped(make, wrap):
    options = {"bagging": True, "n_models": 3} if wrap is pysindy.EnsembleOptimizer else {}
    fitted = wrap(make(), **options).fit(X, X @ TRUTH[:1].T)
    np.testing.assert_allclose(np.ravel(fitted.coef_), TRUTH[0], atol=1e-2)


@pytest.mark.parametrize("make", OPTIMIZERS)
@pytest.mark.parametrize("options", [{"library_ensemble": True}, {"bagging": True, "n_subset": 2}])
def test_an_optimizer_fits_few_columns_and_fewer_rows_than_it_cuts_others_into(make, options):
    # pysindy draws by NumPy's global numbers.
    np.random.seed(0)
    fitted = pysindy.EnsembleOptimizer(make(), n_models=2, **options).fit(X, X @ TRUTH.T)
    assert fitted.coef_.shape == TRUTH.shape and len(fitted.coef_list) == 2


@pytest.mark.parametrize("seed", [0, 3, 5, 8])
def test_a_law_without_noise_ends(seed):
    # Its residual is rounding, of either sign: columns without a share were exchanged for one another for ever.
    columns = np.random.default_rng(seed).normal(size=(60, 6))
    truth = np.column_stack([TRUTH, np.zeros(2)])
    np.testing.assert_allclose(UniqueShareSTLSQ().fit(columns, columns @ truth.T).coef_, truth, atol=1e-9)


@pytest.mark.parametrize("make", LIBRARIES)
def test_a_library_has_a_name_for_each_column_alone_and_joined(make):
    states = X[:, :2]
    with pytest.raises(NotFittedError):
        make().transform(states)
    alone = make().fit([states])
    count = alone.n_output_features_
    assert np.asarray(alone.transform(states)).shape == (400, count) == (400, len(alone.get_feature_names()))
    linear = pysindy.PolynomialLibrary(degree=1)
    for joined, columns in ((make() + linear, count + 3), (make() * linear, count * 3)):
        made = joined.fit_transform(states)
        assert np.asarray(made).shape == (400, columns) == (400, len(joined.get_feature_names()))
    general = pysindy.GeneralizedLibrary([make(), linear]).fit(states)
    assert len(general.get_feature_names()) == count + 3
    with pytest.raises(ValueError):
        alone.transform(X[:, :3])
