"""Exact best subsets against trying all of them."""

import itertools
import time

import numpy as np
import pytest

from sindyjoint.discovery.best_subset import best_subsets, replicate_subsets
from sindyjoint.discovery.factors import Factor
from sindyjoint.errors import InputError


def brute_force(columns, target, size, forced=(), signs=None):
    """Return the best set of a size by trying every one on the rows; None where no set obeys."""
    best = None
    for chosen in itertools.combinations(range(columns.shape[1]), size):
        if not set(forced) <= set(chosen):
            continue
        fit = np.linalg.lstsq(columns[:, chosen], target, rcond=None)[0]
        if any((signs or {}).get(c, 0) * v < 0 for c, v in zip(chosen, fit, strict=True)):
            continue
        error = float(np.sum((target - columns[:, chosen] @ fit) ** 2))
        if best is None or error < best[1]:
            best = (chosen, error)
    return best


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("forced", [(), (4,), (8, 2)])
def test_every_size_is_the_best_of_all_sets(make_factor, seed, forced):
    factor, columns, target = make_factor(seed)
    found = best_subsets(factor, forced)
    assert [*map(len, found)] == list(range(max(1, len(forced)), 10))
    for subset in found:
        chosen, _ = brute_force(columns, target, len(subset), forced)
        assert subset == chosen


@pytest.mark.parametrize("seed", range(4))
def test_signs_are_obeyed_exactly(make_factor, seed):
    factor, columns, target = make_factor(seed)
    signs = {0: -1, 3: 1, 5: 1}
    found = {len(s): s for s in best_subsets(factor, signs=signs)}
    for size in range(1, 10):
        best = brute_force(columns, target, size, signs=signs)
        assert found.get(size) == (None if best is None else best[0])


def test_units_and_order_do_not_matter(make_factor):
    _, columns, target = make_factor(3)
    order = np.random.default_rng(0).permutation(9)
    scaled = best_subsets(Factor.of((columns * np.geomspace(1e-8, 1e8, 9))[:, order], 1e-3 * target))
    for plain, other in zip(best_subsets(Factor.of(columns, target)), scaled, strict=True):
        assert plain == tuple(sorted(int(order[c]) for c in other))


def test_replicates_are_searched_alike(make_factor):
    factors = [make_factor(seed)[0].normalised()[0] for seed in range(6)]
    marks = replicate_subsets(np.array([f.triangle for f in factors]), 5)
    for factor, mark in zip(factors, marks, strict=True):
        for subset in best_subsets(factor)[:5]:
            assert tuple(np.flatnonzero(mark[len(subset)])) == subset


def test_not_every_set_of_25_candidates_is_tried():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(500, 25)) @ rng.normal(size=(25, 25))
    target = columns[:, :5] @ [1, 2, 3, 1, 1] + 5 * rng.normal(size=500)
    best_subsets(Factor.of(columns[:, :3], target))  # compiles
    start = time.process_time()
    found = best_subsets(Factor.of(columns, target))
    # A small part of a second; all 33 million sets would take hours.
    assert time.process_time() - start < 60.0
    assert len(found) == 25


def test_what_cannot_be_searched_is_refused(make_factor):
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="41 candidate terms; an exact best subset takes at most 40"):
        best_subsets(Factor.of(rng.normal(size=(60, 41)), rng.normal(size=60)))
    _, columns, target = make_factor(0)
    with pytest.raises(InputError, match="linearly dependent"):
        best_subsets(Factor.of(np.column_stack([columns, columns[:, 0]]), target))
