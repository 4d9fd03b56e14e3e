"""Triangular factors: as accurate as least squares on the rows, and exact under merging and weighting."""

import numpy as np
import pytest
import scipy.linalg

from sindyjoint.discovery.factors import Factor, dependent_columns, merge
from sindyjoint.errors import InputError


def conditioned(seed, condition, n=400, p=8):
    """Return rows whose matrix has exactly this condition number, and a target near their span."""
    rng = np.random.default_rng(seed)
    left = np.linalg.qr(rng.normal(size=(n, p)))[0]
    right = np.linalg.qr(rng.normal(size=(p, p)))[0]
    columns = left * np.geomspace(1, 1 / condition, p) @ right
    return columns, columns @ rng.normal(size=p) + 1e-3 * rng.normal(size=n)


@pytest.mark.parametrize("seed", range(5))
def test_solution_matches_lstsq_on_the_rows_at_condition_1e6(seed):
    columns, target = conditioned(seed, 1e6)
    blocks = np.array_split(np.arange(len(target)), 7)
    factor = merge(Factor.of(columns[rows], target[rows]) for rows in blocks)
    reference = scipy.linalg.lstsq(columns, target)[0]
    assert np.linalg.norm(factor.solve() - reference) <= 1e-9 * np.linalg.norm(reference)


def test_columns_of_very_different_units_lose_nothing():
    columns, target = conditioned(0, 1e3)
    scale = np.geomspace(1e-10, 1e10, columns.shape[1])
    scaled, norms, height = Factor.of(columns * scale, target).normalised()
    plain = np.linalg.lstsq(columns, target, rcond=None)[0]
    np.testing.assert_allclose(scaled.solve() * height / norms * scale, plain, rtol=1e-9)


@pytest.mark.parametrize("cuts", [[50], [3, 4, 5], [199], [1, 100, 101]])
def test_merging_is_stacking(make_factor, cuts):
    whole, columns, target = make_factor(1)
    parts = [Factor.of(c, t) for c, t in zip(np.split(columns, cuts), np.split(target, cuts), strict=True)]
    merged = merge(parts)
    np.testing.assert_allclose(gram(merged), gram(whole), rtol=1e-12, atol=1e-9)
    assert merged.rows == whole.rows == 200
    # in any order, and in two steps as well
    again = merge([merge(parts[1:]), parts[0]])
    np.testing.assert_allclose(gram(again), gram(whole), rtol=1e-12, atol=1e-9)


def test_row_weights_count_rows(make_factor):
    _, columns, target = make_factor(4)
    weight = np.random.default_rng(0).integers(0, 4, len(target))
    repeated = Factor.of(np.repeat(columns, weight, axis=0), np.repeat(target, weight))
    np.testing.assert_allclose(
        gram(Factor.of(columns, target, weight)), gram(repeated), rtol=1e-12, atol=1e-9
    )


def test_subset_and_error_are_those_of_the_rows(make_factor):
    factor, columns, target = make_factor(5)
    chosen = [7, 0, 3]
    coefficients = np.linalg.lstsq(columns[:, chosen], target, rcond=None)[0]
    part = factor.take(chosen)
    np.testing.assert_allclose(part.solve(), coefficients, rtol=1e-10)
    residual = target - columns[:, chosen] @ (coefficients + 0.1)
    assert part.squared_error(coefficients + 0.1) == pytest.approx(residual @ residual, rel=1e-12)
    assert factor.squared_target == pytest.approx(target @ target)
    np.testing.assert_allclose(factor.column_rms, np.sqrt(np.mean(columns**2, axis=0)))


def test_fixing_takes_a_known_part_out_of_the_target(make_factor):
    factor, columns, target = make_factor(6)
    remaining = factor.fixing([1, 4], [2.0, -1.0])
    others = [0, 2, 3, 5, 6, 7, 8]
    direct = Factor.of(columns[:, others], target - 2.0 * columns[:, 1] + columns[:, 4])
    np.testing.assert_allclose(gram(remaining), gram(direct), rtol=1e-12, atol=1e-9)


def test_fewer_rows_than_columns_still_merge(make_factor):
    _, columns, target = make_factor(7)
    single = [Factor.of(columns[i : i + 1], target[i : i + 1]) for i in range(60)]
    np.testing.assert_allclose(
        gram(merge(single)), gram(Factor.of(columns[:60], target[:60])), rtol=1e-12, atol=1e-9
    )


def test_dependent_columns_are_found_from_the_left(make_factor):
    _, columns, target = make_factor(8)
    doubled = np.column_stack([columns, columns[:, 0] - 2 * columns[:, 3]])
    assert dependent_columns(Factor.of(doubled, target)) == [9]
    assert dependent_columns(Factor.of(columns, target)) == []


def test_nothing_to_merge_is_refused():
    with pytest.raises(InputError, match="no factor to merge"):
        merge([])


def gram(factor):
    """Return [X | y]ᵀ[X | y]: it does not depend on the signs that a decomposition chose."""
    return factor.triangle.T @ factor.triangle
