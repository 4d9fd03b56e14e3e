"""Inclusion against the choice, inseparable terms in words."""

import numpy as np
import pytest

from sindyjoint import discover, simulate
from sindyjoint.discovery import Evidence, RunEvidence
from sindyjoint.discovery.factors import Factor
from sindyjoint.discovery.uncertainty import Inseparable, in_words, inclusion, inseparable

FIVE = range(5)


@pytest.fixture(scope="module")
def poor():
    """Return the evidence of a test that stays far below the softening limit, at 5 % noise."""
    campaign = simulate(levels=[0.4, 0.25], frequencies=[3, 4, 5], duration=4.0, noise=0.05, random_state=1)
    return discover(campaign, library="paper", threshold=0.0).regressor.evidence_, campaign


def test_inclusion_is_repeated_by_its_seed(poor):
    one, same, other = (inclusion(poor[0], 50, random_state=s)[0] for s in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


def test_inclusion_is_certain_where_the_choice_is(evidence):
    probability, sets = inclusion(evidence, 100, random_state=0)
    np.testing.assert_allclose(probability[:5], 1.0, atol=0.05)
    assert probability[5:].max() < 0.05
    assert set(sets[0][0]) == set(evidence.ids[:5]) and sets[0][1] > 0.9
    assert sum(share for _, share in sets) == pytest.approx(1.0)


def test_inclusion_takes_candidates_that_are_nearly_alike():
    # The third column is the first to nine digits: their Gram matrix has no Cholesky factor in double precision.
    rng = np.random.default_rng(0)
    x = rng.normal(size=(1600, 3))
    x[:, 2] = x[:, 0] + 1e-9 * x[:, 2]
    y = 2 * x[:, 0] + x[:, 1] + 0.1 * rng.normal(size=1600)
    runs = []
    for name, rows in zip("abcd", np.split(np.arange(1600), 4), strict=True):
        blocks = tuple(Factor.of(x[part], y[part]) for part in np.split(rows, 8))
        runs.append(RunEvidence(name, name, Factor.of(x[rows], y[rows]), blocks))
    (first, second, alike), _ = inclusion(
        Evidence(("first", "second", "alike"), tuple(runs)), 100, random_state=0
    )
    assert second > 0.95 and 0.95 < first + alike < 1.05


def test_inclusion_is_split_where_runs_do_not_tell(poor):
    _, campaign = poor
    evidence = discover(campaign).regressor.evidence_
    probability, _ = inclusion(evidence, 200, random_state=0)
    cubic = probability[evidence.ids.index("cubic_stiffness")]
    linear = probability[evidence.ids.index("linear_stiffness")]
    assert linear > 0.95
    assert cubic < 0.9


def test_inseparable_terms_are_named(poor):
    _, campaign = poor
    found = discover(campaign)
    evidence = found.regressor.evidence_
    pairs = inseparable(evidence, [evidence.ids.index(name) for name in evidence.ids[:5]])
    named = {(pair.chosen, pair.candidate) for pair in pairs}
    assert ("cubic_stiffness", "quintic_stiffness") in named
    worst = next(
        pair for pair in pairs if (pair.chosen, pair.candidate) == ("cubic_stiffness", "quintic_stiffness")
    )
    # θ³ and θ⁵ with θ taken out of both, on sinusoids of two levels
    assert abs(worst.correlation) > 0.9


def test_good_runs_separate_everything(evidence):
    assert inseparable(evidence, FIVE) == ()


def test_words():
    pair = Inseparable("cubic_stiffness", "quintic_stiffness", 1.84, -0.973)
    assert in_words(pair, 3.2e-4, 8.68e-4) == (
        "cubic stiffness and quintic stiffness are not separable on these runs: with both in the law, cubic stiffness "
        "stands only 1.8 standard errors out (their marks correlate to 0.97); no run passes 37 % of the softening limit"
    )
    assert in_words(pair).endswith("(their marks correlate to 0.97)")


def test_correlation_is_that_of_the_rows(found, evidence, rows):
    from sindyjoint.discovery.rows import state_columns

    columns = state_columns(found.regressor.terms_, rows["X"])
    columns = columns / np.linalg.norm(columns, axis=0)
    others, first, second = [0, 1, 3, 4], 2, evidence.ids.index("quintic_stiffness")
    a, b = (
        columns[:, i] - columns[:, others] @ np.linalg.lstsq(columns[:, others], columns[:, i], rcond=None)[0]
        for i in (first, second)
    )
    from sindyjoint.discovery.uncertainty import _partial_correlation

    expected = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    assert _partial_correlation(evidence, first, second, others) == pytest.approx(expected, rel=1e-6)
