"""Rows in memory become the factors that a QR decomposition of each block gives, on any number of threads."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from sindyjoint import JointRegressor
from sindyjoint.discovery import rows as module
from sindyjoint.discovery.factors import Factor
from sindyjoint.discovery.rows import RowLabels, Rows, gather, state_columns
from sindyjoint.equation.catalogue import Reference, load_catalogue
from sindyjoint.errors import InputError


def states(n=12_000, seed=0):
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1, 1, (n, 2)) * [8e-4, 0.02]
    y = 6066 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 1.867 * np.sign(X[:, 1]) + 0.01 * rng.normal(size=n)
    return X, y


TERMS = load_catalogue("extended").resolve(Reference(8e-4, 0.02, 5.0))


def scaled(factor):
    return factor.normalised()[0].solve()


@pytest.mark.parametrize("weighted", [False, True])
def test_factors_are_those_of_a_decomposition(weighted):
    X, y = states()
    weight = np.random.default_rng(1).uniform(0.1, 3, y.size) if weighted else None
    evidence = gather(TERMS, Rows(X, y, weight), RowLabels.of(y.size, None, None, None))
    columns = state_columns(TERMS, X)
    assert len(evidence.runs) == 4 and {len(run.blocks) for run in evidence.runs} == {16}
    pooled = Factor.of(columns, y, weight)
    np.testing.assert_allclose(scaled(evidence.pooled), scaled(pooled), rtol=1e-8, atol=1e-10)
    assert evidence.pooled.rows == pytest.approx(pooled.rows)
    part = slice(750 + 3000, 938 + 3000)  # the fifth block of the second run
    block = Factor.of(columns[part], y[part], None if weight is None else weight[part])
    gram = [f.triangle.T @ f.triangle for f in (evidence.runs[1].blocks[4], block)]
    norms = np.linalg.norm(block.triangle, axis=0)
    np.testing.assert_allclose(gram[0] / norms / norms[:, None], gram[1] / norms / norms[:, None], atol=1e-11)


def test_a_motion_that_its_sample_does_not_show(monkeypatch):
    # Only rows beside the sample reach the stop: the first coordinates do not suit, the factors do all the same.
    X, y = states(40_000)
    X[:, 0] *= np.where(np.arange(y.size) % 100 == 57, 1.0, 1e-3)
    evidence = gather(TERMS, Rows(X, y), RowLabels.of(y.size, np.zeros(y.size), None, None))
    whole = Factor.of(state_columns(TERMS, X), y)
    np.testing.assert_allclose(scaled(evidence.pooled), scaled(whole), rtol=1e-6, atol=1e-8)


def test_threads_change_no_bit_and_are_given_back(monkeypatch):
    monkeypatch.setattr(module, "THREADED", 1)
    X, y = states()
    found = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            before = [pool["num_threads"] for pool in threadpool_info()]
            found.append(JointRegressor().fit(X, y))
            assert [pool["num_threads"] for pool in threadpool_info()] == before
    assert np.array_equal(found[0].coef_, found[1].coef_)
    assert found[0].model_.to_json() == found[1].model_.to_json()


def test_labels_in_any_order_give_the_same_evidence():
    X, y = states()
    run, block = np.arange(y.size) * 3 // y.size, np.arange(y.size) * 24 // y.size
    order = np.random.default_rng(2).permutation(y.size)
    inorder = gather(TERMS, Rows(X, y), RowLabels.of(y.size, run, None, block))
    mixed = gather(TERMS, Rows(X[order], y[order]), RowLabels.of(y.size, run[order], None, block[order]))
    names = {run.name: run for run in mixed.runs}
    for one in inorder.runs:
        other = names[one.name]
        assert [b.rows for b in one.blocks] == [b.rows for b in other.blocks]
        np.testing.assert_allclose(scaled(one.pooled), scaled(other.pooled), rtol=1e-7, atol=1e-9)


def test_a_term_without_a_finite_value_is_named():
    X, y = states()
    X[7000, 1] = np.nan
    with pytest.raises(InputError, match="term 'linear_damping' .* has no finite value at sample"):
        gather(TERMS, Rows(X, y), RowLabels.of(y.size, None, None, None))
