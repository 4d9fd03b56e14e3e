"""The score against the Gaussian density itself; the search on noise, on a known set, and in another order."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from sindyjoint.diagnosis.evidence import RIDGE, SIZES, Evidence, Rotated
from sindyjoint.diagnosis.evidence.search import Candidate, Search, deviate

GROUPS, ROWS = 6, 30


def evidence(seed, columns, coefficients=(), noise=1.0, spread=None):
    rng = np.random.default_rng(seed)
    rows = GROUPS * ROWS
    X = rng.standard_normal((rows, columns))
    target = X[:, : len(coefficients)] @ np.array(coefficients, dtype=float) + noise * rng.standard_normal(
        rows
    )
    made = Evidence(target, np.repeat(np.arange(GROUPS), ROWS), np.zeros(rows) if spread is None else spread)
    made.add(X)
    return made


def density(made, chosen, group, size):
    """Return log p(y_g | the others), less its constant, from the joint covariance of noise and coefficients."""
    X, out = made.columns[:, chosen], made.group == group
    noise = 1 + size**2 * made.spread
    precision = (X[~out].T / noise[~out]) @ X[~out] + RIDGE * np.eye(len(chosen))
    mean = np.linalg.solve(precision, (X[~out].T / noise[~out]) @ made.target[~out])
    covariance = np.diag(noise[out]) + X[out] @ np.linalg.inv(precision) @ X[out].T
    known = multivariate_normal(X[out] @ mean, covariance).logpdf(made.target[out])
    return known + 0.5 * out.sum() * np.log(2 * np.pi)


@pytest.mark.parametrize("spread", [None, 0.0, 2e4])
def test_a_score_is_the_density_of_each_group_given_the_others(spread):
    rng = np.random.default_rng(1)
    shape = None if spread is None else spread * rng.uniform(0, 1, GROUPS * ROWS)
    made = evidence(2, 4, [3.0, -2.0], noise=1.5, spread=shape)
    for chosen in ([0], [0, 1], [0, 1, 3]):
        found = made.score(chosen)
        assert found.by_group == pytest.approx([density(made, chosen, g, found.size) for g in range(GROUPS)])
        best = max(sum(density(made, chosen, g, size) for g in range(GROUPS)) for size in SIZES)
        assert found.total == pytest.approx(best)
    beside = made.beside([0, 1], [2, 3], SIZES[-1])
    for column, found in zip((2, 3), beside, strict=True):
        assert found.by_group == pytest.approx(
            [density(made, [0, 1, column], g, found.size) for g in range(GROUPS)]
        )


def test_prediction_errors_of_the_true_law_are_those_of_noise():
    """χ² of each row has the mean 1 and the variance 2: 7 200 rows of forty draws, three standard errors."""
    squares = [evidence(seed, 3, [2.0, 1.0, 0.5]).score([0, 1, 2]).chi_square.sum() for seed in range(40)]
    rows = 40 * GROUPS * ROWS
    assert np.sum(squares) / rows == pytest.approx(1.0, abs=3 * np.sqrt(2 / rows))


def search(made, candidates):
    known = [Candidate(f"c{i}", 0, np.empty(0), i, False) for i in candidates]
    return Search(made, [0], known, lambda candidate, beside, size: candidate)


def test_in_noise_nothing_is_found():
    """Chance .001 each: that three of three hundred are found by luck has a probability of 4 in 1 000."""
    found = [search(evidence(seed, 12, [5.0]), range(1, 12)).run().members for seed in range(300)]
    assert sum(map(bool, found)) <= 2


def test_a_set_is_found_whatever_the_order_of_its_candidates():
    made = evidence(5, 12, [5.0, 0, 0.8, 0, 0, -0.9])
    for order in (range(1, 12), range(11, 0, -1)):
        found = search(made, order).run()
        assert found.names == {"c2", "c5"}
        for member in found.members:
            assert not search(made, order).alike(found, search(made, order).rivals(found, member)[0])


def test_a_pair_is_found_of_which_neither_wins_alone():
    """Two columns that hide each other: their sum is all that one of them sees."""
    rng = np.random.default_rng(7)
    made = evidence(7, 6, [5.0])
    one = rng.standard_normal(made.target.size)
    other = one + 0.1 * rng.standard_normal(made.target.size)
    made.target = made.target + 6.0 * (one - other)
    pair = made.add(np.column_stack([one, other]))
    found = search(made, [*range(1, 6), *pair]).run()
    assert found.names == {f"c{place}" for place in pair}


def test_a_sign_that_physics_denies_is_not_admissible():
    made = evidence(3, 4, [5.0, -2.0])
    both = [Candidate("c1", 0, np.empty(0), 1, sign) for sign in (True, False)]
    refused, taken = (Search(made, [0], [each], lambda c, b, s: c).run() for each in both)
    assert not refused.members and taken.names == {"c1"}


def test_one_group_alone_wins_nothing():
    assert deviate(np.array([500.0, 0, 0, 0, 0, 0])) == pytest.approx(3 / np.sqrt(6))
    assert deviate(np.full(6, 2.0)) == pytest.approx(2 * np.sqrt(6))


@pytest.mark.parametrize("corrects", [False, True])
def test_a_small_effect_in_unsure_noise_is_one_on_which_groups_agree(corrects):
    """Both win, and take less than a tenth of the residual, the noise of which is stated 1.2 times too large."""
    rng = np.random.default_rng(11)
    rows = 50 * GROUPS * ROWS
    X, noise = rng.standard_normal((rows, 2)), rng.standard_normal(rows)
    kept = []
    for size in (0.35, 0.05):
        group = np.repeat(np.arange(GROUPS), 50 * ROWS)
        made = Evidence((5 * X[:, 0] + size * X[:, 1] + noise) / 1.2, group, np.ones(rows))
        made.add(X)
        each = Candidate("c1", 0, np.empty(0), 1, False, corrects)
        looked = Search(made, [0], [each], lambda candidate, beside, size: candidate, sure=False)
        assert looked.wins(looked.chosen([each]), looked.chosen([]))
        kept.append(bool(looked.run().members))
    assert kept == [True, False]


@dataclass
class Plain:
    """Rows of unit noise as they are."""

    def white(self, rows):
        return rows


@pytest.mark.parametrize("cyclic", [True, False])
def test_rotated_rows_keep_their_length_and_separate_noise_from_a_smooth_moment(cyclic):
    place = np.arange(200) / 200
    rotated = Rotated(Plain(), place, cyclic, 2.0)
    rows = np.random.default_rng(0).standard_normal((200, 3))
    assert np.linalg.norm(rotated(rows), axis=0) == pytest.approx(np.linalg.norm(rows, axis=0))
    # The whole variance of a discrepancy of unit size is that of 200 rows of 2 N·m each.
    assert rotated.spread.sum() == pytest.approx(200 * 4.0, rel=1e-6)
    smooth = rotated(np.sin(2 * np.pi * place))
    axes = np.argsort(-rotated.spread)[:20]
    assert np.sum(smooth[axes] ** 2) > 0.95 * np.sum(smooth**2)
