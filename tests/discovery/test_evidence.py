"""Fits from factors: coefficients and shares of the rows, covariance of the scatter of blocks."""

import numpy as np
import pytest

from sindyjoint.discovery import (
    Evidence,
    RunEvidence,
    fit_columns,
    group_t_ratios,
    held_out_errors,
)
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.discovery.rows import row_labels
from sindyjoint.errors import InputError


def simple_evidence(seed, noise=1.0, runs=6, blocks=8, n=40, effect=(2.0, -1.0, 0.0)):
    """Return the evidence of runs in three groups and the rows behind it."""
    rng = np.random.default_rng(seed)
    made, rows = [], []
    for index in range(runs):
        columns = rng.normal(size=(blocks * n, 3)) + [0.5, 0, 0]
        target = columns @ effect + noise * rng.normal(size=blocks * n)
        parts = tuple(
            Factor.of(c, t) for c, t in zip(np.split(columns, blocks), np.split(target, blocks), strict=True)
        )
        made.append(RunEvidence(f"run{index}", f"group{index % 3}", Factor.of(columns, target), parts))
        rows.append((columns, target, index % 3))
    return Evidence(("a", "b", "c"), tuple(made)), rows


def test_fit_is_least_squares_on_all_rows():
    evidence, rows = simple_evidence(0)
    columns, target = np.vstack([r[0] for r in rows]), np.concatenate([r[1] for r in rows])
    fit = fit_columns(evidence, [0, 2])
    np.testing.assert_allclose(fit.coefficients, np.linalg.lstsq(columns[:, [0, 2]], target, rcond=None)[0])
    without = target - columns[:, [2]] @ np.linalg.lstsq(columns[:, [2]], target, rcond=None)[0]
    residual = target - columns[:, [0, 2]] @ fit.coefficients
    share = np.sqrt((without @ without - residual @ residual) / (target @ target))
    assert fit.unique_share[0] == pytest.approx(share, rel=1e-9)
    assert fit.residual_rms == pytest.approx(np.sqrt(np.mean(residual**2)))


def test_standard_errors_are_the_scatter_of_repeated_campaigns():
    fits = [fit_columns(simple_evidence(seed)[0], range(3)) for seed in range(300)]
    scatter = np.std([f.coefficients for f in fits], axis=0, ddof=1)
    stated = np.sqrt(np.mean([f.standard_errors**2 for f in fits], axis=0))
    # 300 campaigns give the scatter to 4 %, and 42 degrees the stated one far better: 12 % is three of those
    np.testing.assert_allclose(stated, scatter, rtol=0.12)


def test_errors_correlated_within_blocks_widen_the_standard_error():
    """Row by row the noise looks small; a whole block is off together, and only blocks show it."""
    coefficients, stated = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        parts = []
        for _ in range(16):
            column = np.ones((50, 1)) + 0.1 * rng.normal(size=(50, 1))
            parts.append(Factor.of(column, 3 * column[:, 0] + rng.normal() + 0.1 * rng.normal(size=50)))
        fit = fit_columns(Evidence(("a",), (RunEvidence("r", "g", merge(parts), tuple(parts)),)), [0])
        coefficients.append(fit.coefficients[0])
        stated.append(fit.standard_errors[0])
    # scatter 0.25 = 1/√16; rows taken as independent would state 1/√800 = 0.035. 200 campaigns: 5 %, three of those
    assert np.std(coefficients) == pytest.approx(0.25, rel=0.15)
    assert np.sqrt(np.mean(np.square(stated))) == pytest.approx(0.25, rel=0.15)


def test_held_out_errors_are_refits_without_the_group():
    evidence, rows = simple_evidence(1)
    errors = held_out_errors(evidence, [0, 1])
    for index, (columns, target, group) in enumerate(rows):
        train = [r for r in rows if r[2] != group]
        fit = np.linalg.lstsq(
            np.vstack([r[0][:, :2] for r in train]), np.concatenate([r[1] for r in train]), rcond=None
        )[0]
        assert errors[index] == pytest.approx(np.mean((target - columns[:, :2] @ fit) ** 2), rel=1e-9)


def test_group_jackknife_needs_three_groups():
    evidence, _ = simple_evidence(2)
    assert group_t_ratios(evidence, [0, 1]).min() > 10
    assert np.all(np.isinf(group_t_ratios(evidence.only(["group0", "group1"]), [0, 1])))


def test_fixed_terms_leave_the_rest_as_if_subtracted():
    evidence, rows = simple_evidence(3)
    columns, target = np.vstack([r[0] for r in rows]), np.concatenate([r[1] for r in rows])
    remaining = evidence.fixing({"b": -1.0})
    assert remaining.ids == ("a", "c")
    expected = np.linalg.lstsq(columns[:, [0, 2]], target + columns[:, 1], rcond=None)[0]
    np.testing.assert_allclose(fit_columns(remaining, [0, 1]).coefficients, expected, rtol=1e-9)
    assert all(len(run.blocks) == 8 for run in remaining.runs)


def test_blocks_that_are_whole_runs_are_refused():
    with pytest.raises(InputError, match="blocks has one block in each run; .* two or more"):
        row_labels(6, None, [0, 0, 0, 1, 1, 1], [5, 5, 5, 5, 5, 5])
