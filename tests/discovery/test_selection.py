"""The path of models and the choice on it."""

from functools import partial

import numpy as np
import pytest

from sindyjoint.discovery import Fit
from sindyjoint.discovery.best_subset import best_subsets
from sindyjoint.discovery.selection import (
    Step,
    choose_by_evidence,
    choose_by_one_standard_error,
    choose_by_threshold,
    elimination_path,
    exchange,
    path_of,
)


def step(t, share, held_out=(), group_t=None, columns=None, coefficients=None):
    """Return a step with given t-ratios, shares and held-out errors."""
    t, share = np.array(t, float), np.array(share, float)
    k = len(t)
    coefficients = np.ones(k) if coefficients is None else np.array(coefficients, float)
    fit = Fit(
        tuple(range(k)) if columns is None else columns,
        coefficients,
        np.diag((coefficients / t) ** 2),
        share,
        1.0,
        20,
        np.full(k, 20.0),
    )
    groups = np.full(k, np.inf) if group_t is None else np.array(group_t, float)
    return Step(fit, float(share.min()), np.array(held_out, float), groups)


@pytest.mark.parametrize("seed", range(6))
def test_path_has_one_set_of_each_size_and_keeps_forced_columns(make_factor, seed):
    factor = make_factor(seed)[0]
    for make in (elimination_path, partial(elimination_path, exchange_below=0)):
        path = make(factor, (5, 7))
        assert [len(s) for s in path] == list(range(9, 1, -1))
        assert all({5, 7} <= set(s) for s in path)


def test_backward_path_removes_the_term_that_costs_least(make_factor):
    factor, columns, target = make_factor(2)

    def error(chosen):
        return np.linalg.lstsq(columns[:, list(chosen)], target, rcond=None)[1][0]

    path = elimination_path(factor, exchange_below=0)
    for large, small in zip(path, path[1:], strict=False):
        choices = [tuple(c for c in large if c != leaving) for leaving in large]
        assert small == min(choices, key=error)


def test_exchange_never_fits_worse_and_ends_where_no_swap_helps(make_factor):
    for seed in range(5):
        factor, columns, target = make_factor(seed)
        scaled = factor.normalised()[0]
        start = [5, 6, 8]
        end = exchange(scaled, start)

        def error(chosen, columns=columns, target=target):
            return np.linalg.lstsq(columns[:, chosen], target, rcond=None)[1][0]

        assert error(end) <= error(start) * (1 + 1e-12)
        for leaving in end:
            for entering in set(range(9)) - set(end):
                swapped = [c for c in end if c != leaving] + [entering]
                assert error(swapped) >= error(end) * (1 - 1e-5)


def test_path_meets_the_exact_best_subset_of_a_joint_up_to_the_true_size(evidence):
    exact = {len(s): s for s in best_subsets(evidence.pooled)}
    path = {len(s): s for s in elimination_path(evidence.pooled)}
    for size in range(1, 7):
        assert path[size] == exact[size]


def test_evidence_takes_the_largest_set_in_which_each_term_passes():
    weak = step([20, 3.0, 30], [0.5, 0.05, 0.2])
    small = step([20, 30.0, 9], [0.5, 0.0015, 0.2])
    good = step([20, 30.0], [0.5, 0.2])
    selection = choose_by_evidence([weak, small, good, step([99], [0.5])])
    assert selection.step is good
    assert "5 standard errors out (here at least 0.2 and 20.0)" in selection.reason
    assert choose_by_evidence([weak, small, good], significance=2.0).step is weak
    assert choose_by_evidence([weak, small, good], least_share=0.001).step is small


def test_terms_that_other_groups_do_not_repeat_go():
    torn = step([20, 30], [0.5, 0.2], group_t=[50, 1.0])
    assert choose_by_evidence([torn, step([9], [0.5])]).chosen == 1


def test_a_smaller_model_that_predicts_as_well_is_preferred():
    large, small = step([9, 9], [0.3, 0.3], [1.0, 1.0]), step([9], [0.3], [0.9, 1.0])
    assert choose_by_evidence([large, small]).chosen == 1
    assert choose_by_evidence([large, step([9], [0.3], [1.2, 1.0])]).chosen == 0


def test_forced_terms_need_not_pass_and_signs_must():
    torn = step([1.0, 30], [0.0, 0.2], coefficients=[-1, 1])
    assert choose_by_evidence([torn]).step is None
    assert choose_by_evidence([torn], forced=[0]).chosen == 0
    assert choose_by_evidence([torn], forced=[0], signs={0: 1}).step is None
    assert choose_by_threshold([torn], 0.1, forced=[0]).chosen == 0
    assert choose_by_threshold([torn], 0.1, forced=[0], signs={0: 1}).step is None


def test_nothing_passes_in_words():
    assert (
        "no set of terms in which each stands 5 standard errors out"
        in choose_by_evidence([step([1], [0.5])]).reason
    )
    assert (
        "no term has a unique share of at least the given threshold of 0.9"
        in choose_by_threshold([step([9], [0.5])], 0.9).reason
    )


def test_one_standard_error_rule_pairs_the_runs():
    runs = np.array([1.0, 5.0, 2.0, 8.0])
    best = step([9, 9], [0.3, 0.3], runs)
    # worse by 0.1 ± 0.17, run by run, though runs differ by far more among themselves
    close = step([9], [0.3], runs + [0.5, -0.3, 0.2, 0.0])
    worse = step([9], [0.3], runs + 0.5)
    assert choose_by_one_standard_error([best, close]).chosen == 1
    assert choose_by_one_standard_error([best, worse]).chosen == 0
    assert choose_by_one_standard_error([step([9], [0.3])]).step is None


def test_steps_carry_the_fit_of_their_columns(evidence):
    sets = [(0, 1, 2, 3, 4), (0, 3, 4)]
    first, second = path_of(evidence, sets)
    assert first.columns == sets[0] and second.size == 3
    assert first.threshold == first.fit.unique_share.min()
    assert first.held_out.size == len(evidence.runs)
    assert first.held_out_rms < second.held_out_rms
