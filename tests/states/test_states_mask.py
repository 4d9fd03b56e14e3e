"""Where the joint moves: far enough from zero rate, and from every change of its sign."""

import numpy as np
import pytest

from sindyjoint.states.mask import moving_mask, rate_limit


def test_limit_follows_the_larger_of_share_and_noise():
    rate = np.array([-2.0, 1.0])
    assert rate_limit(rate, 0.001, 0.05) == pytest.approx(0.1)
    assert rate_limit(rate, 0.1, 0.05) == pytest.approx(0.4)  # four standard errors


def test_guard_on_both_sides():
    rate = np.array([1.0, 1, 1, 1, 0.01, 1, 1, 1, 1])
    assert moving_mask(rate, 0.1, 2).tolist() == [True, True] + [False] * 5 + [True, True]
    assert moving_mask(rate, 0.1, 0).tolist() == [True] * 4 + [False] + [True] * 4


def test_a_jump_through_zero_is_a_reversal():
    rate = np.array([1.0, 1, 1, -1, -1, -1, -1])
    assert moving_mask(rate, 0.1, 1).tolist() == [True, True, False, False, False, True, True]


def test_nothing_moves_below_the_limit():
    assert not moving_mask(np.full(10, 0.05), 0.1, 3).any()
    assert moving_mask(np.full(10, -0.5), 0.1, 3).all()
