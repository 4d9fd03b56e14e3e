"""Frequency tests against published formulas, their size and power on made-up estimates, and three answers."""

from inspect import signature

import numpy as np
import pytest
import scipy.stats

from sindyjoint.discovery.frequency import (
    detectable_change,
    frequency_test,
    group_estimates,
    heterogeneity,
    weighted_slope,
)
from sindyjoint.errors import InputError

HERTZ = np.array([3.0, 4.0, 5.0, 6.0])

WELCH = pytest.mark.skipif(
    "equal_var" not in signature(scipy.stats.f_oneway).parameters, reason="Welch's test came with SciPy 1.16"
)


@WELCH
def test_homogeneity_with_equal_groups_is_the_analysis_of_variance():
    """With equal standard errors that rest on many degrees, Welch's F is the ordinary one."""
    rng = np.random.default_rng(0)
    samples = [rng.normal(size=5000) for _ in range(4)]
    means = np.array([s.mean() for s in samples])
    errors = np.array([s.std(ddof=1) / np.sqrt(5000) for s in samples])
    q, p, _, _ = heterogeneity(means, errors, np.full(4, 4999.0))
    reference = scipy.stats.f_oneway(*samples, equal_var=False)
    assert p == pytest.approx(reference.pvalue, rel=1e-6)
    assert q / 3 == pytest.approx(reference.statistic, rel=1e-3)


@WELCH
def test_homogeneity_with_unequal_groups_is_welchs_test():
    rng = np.random.default_rng(1)
    samples = [rng.normal(0.5 * (i == 2), 1 + i, size=6 + 3 * i) for i in range(4)]
    means = np.array([s.mean() for s in samples])
    errors = np.array([s.std(ddof=1) / np.sqrt(s.size) for s in samples])
    _, p, _, _ = heterogeneity(means, errors, np.array([s.size - 1.0 for s in samples]))
    assert p == pytest.approx(scipy.stats.f_oneway(*samples, equal_var=False).pvalue, rel=1e-9)


def test_between_run_spread_is_dersimonian_and_lairds():
    # Written out by hand: w = 1, 1/4, 1; x = 0, 2, 4
    x, s = np.array([0.0, 2.0, 4.0]), np.array([1.0, 2.0, 1.0])
    q, _, i_squared, tau = heterogeneity(x, s, np.full(3, 1e9))
    assert q == pytest.approx(8.0)
    assert i_squared == pytest.approx(1 - 2 / 8)
    assert tau**2 == pytest.approx((8 - 2) / (2.25 - (1 + 0.0625 + 1) / 2.25))


def test_slope_is_weighted_least_squares():
    x, s = np.array([1.0, 2.5, 2.0, 4.0]), np.array([0.1, 0.2, 0.1, 0.4])
    coefficients, covariance = np.polyfit(HERTZ, x, 1, w=1 / s, cov="unscaled")
    assert weighted_slope(HERTZ, x, s) == pytest.approx((coefficients[0], np.sqrt(covariance[0, 0])))


def test_false_alarms_come_as_often_as_stated():
    rng = np.random.default_rng(2)
    errors, degrees, hits, total = np.array([1.0, 2.0, 1.5, 1.0]), 16, [], 2000
    for _ in range(total):
        estimated = errors * np.sqrt(rng.chisquare(degrees, 4) / degrees)
        test = frequency_test("c", HERTZ, 100 + errors * rng.normal(size=4), estimated, np.full(4, degrees))
        hits.append((test.p_homogeneity < 0.05, test.p_value < 0.05))
    homogeneity, both = np.mean(hits, axis=0)
    # 2000 trials at 5 %: ± 0.5 %; three of those. The doubled smaller of two related p-values errs to the safe side
    assert 0.035 < homogeneity < 0.065
    assert 0.025 < both < 0.06


def test_a_rise_is_found():
    rng = np.random.default_rng(3)
    rise = 100 * (1 + 0.1 * (HERTZ - 3) / 3)
    answers = [frequency_test("c", HERTZ, rise + rng.normal(size=4), np.ones(4)).answer for _ in range(100)]
    assert answers.count("depends on frequency") > 95
    # sharp estimates at the margin itself: called within it by a chance of 1 %; 2000 trials give that to 0.22 %
    sharp = [
        frequency_test("c", HERTZ, rise + 0.1 * rng.normal(size=4), np.full(4, 0.1)) for _ in range(2000)
    ]
    assert np.mean([test.answer == "independent within margin" for test in sharp]) < 0.01 + 3 * 0.0022


def test_three_answers():
    flat = [100.0, 100.5, 99.5, 100.0]
    sharp = frequency_test("k1", HERTZ, flat, [1.0] * 4)
    assert sharp.answer == "independent within margin" and "is ruled out" in sharp.reason
    rough = frequency_test("k1", HERTZ, flat, [10.0] * 4)
    assert rough.answer == "cannot tell" and "is not ruled out; margin 10 %" in rough.reason
    steep = frequency_test("k1", HERTZ, [100.0, 110.0, 120.0, 130.0], [1.0] * 4)
    assert steep.answer == "depends on frequency" and steep.change == pytest.approx(30 / 115, rel=1e-6)
    tiny = frequency_test("k1", HERTZ, [100.0, 101.0, 102.0, 103.0], [0.1] * 4)
    assert tiny.answer == "independent within margin" and "below the margin of 10 %" in tiny.reason
    assert "a smaller one is there, and significant: a trend of +3.0 % ± 0.3 %" in tiny.reason
    either_side = frequency_test("c", HERTZ, [1.0, -1.0, 1.0, -1.0], [3.0] * 4)
    assert either_side.change_bound == np.inf and either_side.answer == "cannot tell"


def test_equivalence_bound_is_the_worst_pair():
    x, s = np.array([100.0, 103.0, 101.0]), np.array([0.5, 0.5, 2.0])
    test = frequency_test("k1", [3, 4, 5], x, s)
    quantile = scipy.stats.norm.ppf(0.99)
    pairs = [
        (3 + quantile * np.hypot(1.03 * 0.5, 0.5)) / 100,
        (2 + quantile * np.hypot(0.5, 103 / 101 * 2)) / 101,
        (1 + quantile * np.hypot(1.01 * 0.5, 2)) / 100,
    ]
    assert test.change_bound == pytest.approx(max(pairs), rel=1e-6)


@pytest.mark.parametrize("factor", [1e-9, 1.0, -3e7])
def test_units_do_not_matter(factor):
    x, s = np.array([100.0, 104.0, 99.0, 101.0]), np.array([1.0, 2.0, 1.0, 3.0])
    plain, scaled = frequency_test("c", HERTZ, x, s), frequency_test("c", HERTZ, factor * x, abs(factor) * s)
    for name in ("q", "p_homogeneity", "p_trend", "i_squared", "change", "change_bound"):
        # SciPy before 1.16 has the F distribution of many degrees to eight digits.
        assert getattr(scaled, name) == pytest.approx(getattr(plain, name), rel=1e-7)
    assert scaled.answer == plain.answer


def test_bare_numbers_have_no_errors_but_their_scatter():
    values = [6153.0, 6134.0, 5912.0, 6063.0]  # the paper's Table 1, k1
    test = frequency_test("k1", HERTZ, values)
    reference = scipy.stats.linregress(HERTZ, values)
    assert test.p_trend == pytest.approx(reference.pvalue, rel=1e-9)
    assert (test.slope, test.slope_error) == pytest.approx((reference.slope, reference.stderr))
    assert np.isnan(test.p_homogeneity) and np.isnan(test.q)
    assert test.p_value == test.p_trend
    # two degrees of freedom: quantiles 4.303 and 1.061
    expected = (4.3027 + 1.0607) * reference.stderr * 3 / np.mean(values)
    assert detectable_change(test) == pytest.approx(expected, rel=1e-4)


def test_groups_are_fitted_alone(found, evidence, rows):
    from sindyjoint.discovery.rows import state_columns

    result = group_estimates(evidence, range(5))
    assert result.groups == ("3 Hz", "4 Hz", "5 Hz", "6 Hz")
    here = rows["groups"] == "5 Hz"
    columns = state_columns(found.regressor.terms_, rows["X"][here])[:, :5]
    scale = np.linalg.norm(columns, axis=0)
    fit = np.linalg.lstsq(columns / scale, rows["y"][here], rcond=None)[0] / scale
    np.testing.assert_allclose(result.coefficients[2], fit, rtol=1e-6)
    assert result.standard_errors.shape == (4, 5) and np.all(result.standard_errors > 0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([3, 4], [1.0, 2.0]), "at 2 frequencies; expected three or more"),
        (([3, 4, 5], [1.0, 2.0]), "estimates of shape \\(2,\\)"),
        (([3, 4, 5], [1.0, 2.0, np.nan]), "positive margin, all finite"),
        (([3, 4, 5], [1.0, 2.0, 3.0], [1.0, 0.0, 1.0]), "one positive standard error"),
    ],
)
def test_bad_input_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        frequency_test("c1", *arguments)
