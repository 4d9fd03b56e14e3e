"""Factors of rows that pass by once: as accurate as a QR decomposition of all of them."""

import numpy as np
import pytest
import scipy.linalg

from sindyjoint.discovery.factors import Factor, dependent_columns, merge
from sindyjoint.discovery.rows import factor_of
from sindyjoint.equation import Reference, compile_terms, load_catalogue, term_columns
from sindyjoint.errors import InputError
from sindyjoint.numeric import BLOCK


def conditioned(seed, condition, n=20_000, p=20):
    """Return rows whose matrix has exactly this condition number, and a target near their span."""
    rng = np.random.default_rng(seed)
    left = np.linalg.qr(rng.normal(size=(n, p)))[0]
    right = np.linalg.qr(rng.normal(size=(p, p)))[0]
    columns = left * np.geomspace(1, 1 / condition, p) @ right
    return columns, columns @ rng.normal(size=p) + 1e-3 * rng.normal(size=n)


def summed(columns, target, size=BLOCK):
    parts = [slice(start, start + size) for start in range(0, target.size, size)]
    return merge(Factor.of(columns[part], target[part]) for part in parts)


@pytest.mark.parametrize("seed", range(4))
def test_solution_matches_lstsq_on_the_rows_at_condition_1e6(seed):
    columns, target = conditioned(seed, 1e6)
    reference = scipy.linalg.lstsq(columns, target)[0]

    def error(c):
        return np.linalg.norm(c - reference) / np.linalg.norm(reference)

    assert error(summed(columns, target).solve()) <= 1e-9
    # A plain Gram matrix would not do.
    assert error(np.linalg.solve(columns.T @ columns, columns.T @ target)) > 1e-7


@pytest.mark.parametrize("size", [1, 7, 64, 2048, 5000])
def test_the_size_of_the_blocks_does_not_matter(size):
    columns, target = conditioned(9, 1e3, n=3001, p=6)
    factor, whole = summed(columns, target, size), Factor.of(columns, target)
    np.testing.assert_allclose(factor.solve(), whole.solve(), rtol=1e-9)
    assert factor.rows == 3001
    assert factor.squared_error(whole.solve()) == pytest.approx(whole.squared_error(whole.solve()), rel=1e-9)


def test_columns_that_begin_late_or_small_and_columns_that_depend():
    rng = np.random.default_rng(0)
    n = 40_000
    columns = rng.normal(size=(n, 8))
    columns[:25_000, 3] = 0.0
    columns[:, 5] *= np.where(np.arange(n) < 15_000, 1e-9, 1e3)
    columns[:, 7] = columns[:, 0] - 2 * columns[:, 1]
    target = columns[:, :6] @ np.arange(1.0, 7.0) + 0.1 * rng.normal(size=n)
    factor = summed(columns, target)
    assert dependent_columns(factor) == [7]
    reference = np.linalg.lstsq(columns[:, :7], target, rcond=None)[0]
    np.testing.assert_allclose(factor.take(range(7)).solve(), reference, rtol=1e-9, atol=1e-12)


def test_the_very_same_bits_every_time():
    columns, target = conditioned(2, 1e4)
    assert np.array_equal(summed(columns, target).triangle, summed(columns, target).triangle)


def test_terms_are_evaluated_as_everywhere_else():
    rng = np.random.default_rng(1)
    angle, rate = 8e-4 * rng.uniform(-1, 1, 9001), 0.02 * rng.uniform(-1, 1, 9001)
    moment = 6066 * angle + 1.9 * np.sign(rate) + 0.01 * rng.normal(size=9001)
    terms = load_catalogue("extended").resolve(Reference(8e-4, 0.02, 5.0))
    function, parts = compile_terms([term.expression for term in terms]), np.array_split(np.arange(9001), 5)
    total = merge(factor_of(function, (angle[part], rate[part]), moment[part]) for part in parts)
    whole = Factor.of(term_columns(terms, angle, rate), moment)
    scaled, other = total.normalised()[0], whole.normalised()[0]
    np.testing.assert_allclose(scaled.solve(), other.solve(), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("row", [3, 9321])
def test_a_term_without_a_finite_value_is_refused(row):
    terms = load_catalogue("paper").resolve()
    function = compile_terms([term.expression for term in terms])
    angle, rate = np.random.default_rng(0).normal(size=(2, 12_000))
    rate[row] = np.nan
    with pytest.raises(
        InputError, match=rf"rows from {row // BLOCK * BLOCK} .*column 4 .* at row {row % BLOCK};"
    ):
        factor_of(function, (angle, rate), np.ones(12_000))
