"""Rows in memory become the factors that a QR decomposition of each block gives, on any number of threads."""

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from sindyjoint import JointRegressor
from sindyjoint.discovery import rows as module


def states(n=12_000, seed=0):
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1, 1, (n, 2)) * [8e-4, 0.02]
    y = 6066 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 1.867 * np.sign(X[:, 1]) + 0.01 * rng.normal(size=n)
    return X, y


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
