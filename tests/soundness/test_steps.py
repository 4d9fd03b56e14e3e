"""Steps in a series of periods: found by their size, and hardly ever in noise."""

import numpy as np
import pytest

from sindyjoint.soundness.detectors.course import step_of


@pytest.mark.parametrize(("periods", "most"), [(9, 3), (12, 3), (24, 0)])
def test_noise_has_no_steps(periods, most):
    """What the policy says of the rate: one in 5 000 series of few periods, none of more."""
    rng = np.random.default_rng(2)
    assert sum(step_of(rng.standard_normal(periods), 0.0) is not None for _ in range(5000)) <= most


@pytest.mark.parametrize("periods", [9, 24])
def test_a_step_is_found_where_it_is(periods):
    at = periods // 2
    series = np.where(np.arange(periods) < at, 0.0, np.where(np.arange(periods) == at, 0.04, 0.1))
    noisy = series + 1e-4 * np.random.default_rng(3).standard_normal(periods)
    step = step_of(noisy)
    assert step.period == at and step.size == pytest.approx(0.1, abs=1e-3)


def test_a_start_up_is_no_step():
    assert step_of(1 - np.exp(-np.arange(40) / 6)) is None
