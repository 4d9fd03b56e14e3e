"""Coefficients over joints: outliers, trends, and uncertain gains that move all joints alike."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import batch
from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.export import batch_samples
from sindyjoint.workflows import CampaignRecord, holm, median_spread, population, random_effects, summarised


def sample(rng, n, spread=1.0, error=0.5):
    """Draw joints around 100 whose estimates have errors of very different size."""
    s = error * np.exp(rng.normal(0, 0.5, n))
    return 100 + spread * rng.normal(size=n) + s * rng.normal(size=n), s


def test_without_errors_the_spread_is_the_median_absolute_deviation():
    d = np.random.default_rng(0).normal(size=101)
    d -= np.median(d)
    assert median_spread(d, np.zeros(d.size)) == pytest.approx(1.4826 * np.median(np.abs(d)), rel=1e-4)


def test_random_effects_against_closed_forms():
    y = np.random.default_rng(1).normal(size=40)
    # Equal errors: the plain mean, and τ² = sample variance less s².
    mean, error, tau = random_effects(y, np.full(40, 0.3))
    assert mean == pytest.approx(y.mean(), rel=1e-9)
    assert tau**2 == pytest.approx(y.var(ddof=1) - 0.09, rel=1e-6)
    assert error == pytest.approx(y.std(ddof=1) / np.sqrt(40), rel=1e-6)
    # Errors that explain all of the scatter leave nothing between joints.
    assert random_effects(y, np.full(40, 3.0))[2] == 0.0


def test_bad_joints_are_named_and_do_not_spoil_the_others():
    rng = np.random.default_rng(2)
    y, s = sample(rng, 40)
    bad = [3, 17, 18, 30]
    y[bad] += 12.0
    (scatter,) = population({"k": y}, {"k": s}).scatters
    assert scatter.outliers == tuple(bad)
    assert scatter.mean == pytest.approx(100, abs=0.6) and scatter.spread == pytest.approx(1.0, abs=0.5)


def test_a_rough_estimate_is_no_outlier():
    rng = np.random.default_rng(3)
    y, s = sample(rng, 30)
    y[4], s[4] = 130.0, 20.0
    (scatter,) = population({"k": y}, {"k": s}).scatters
    assert scatter.outliers == ()
    s[4] = 0.5
    assert population({"k": y}, {"k": s}).scatters[0].outliers == (4,)


@pytest.mark.parametrize("n", [8, 30])
def test_joints_of_one_kind_are_left_alone(n):
    # 5 % over all five coefficients together; measured 2 to 9 % of 300 sets. 10 of 50 would be 3.6
    # standard deviations above 7 %.
    rng = np.random.default_rng(4)
    outlying = trending = 0
    for _ in range(50):
        drawn = {str(k): sample(rng, n) for k in range(5)}
        covariates = {"temperature": rng.uniform(-40, 80, n), "serial number": np.arange(n)}
        result = population(
            {k: y for k, (y, _) in drawn.items()}, {k: s for k, (_, s) in drawn.items()}, covariates
        )
        outlying += any(scatter.outliers for scatter in result.scatters)
        trending += any(trend.significant for trend in result.trends)
    assert outlying <= 9 and trending <= 9


def test_a_trend_is_found_beside_outliers_and_taken_out_of_the_scatter():
    rng = np.random.default_rng(5)
    y, s = sample(rng, 40)
    x = rng.uniform(-40, 80, 40)
    y += 0.2 * x
    y[7] += 10.0
    result = population({"k": y}, {"k": s}, {"temperature": x})
    (trend,) = result.trends
    assert trend.significant and trend.slope == pytest.approx(0.2, abs=3 * trend.slope_error)
    assert trend.slope_error < 0.012
    (scatter,) = result.scatters
    assert scatter.covariate == "temperature" and scatter.outliers == (7,)
    # Without what explains it the same scatter hides the joint.
    assert population({"k": y}, {"k": s}).scatters[0].outliers == ()


def test_missing_joints_stay_missing():
    y, s = sample(np.random.default_rng(6), 12)
    y[5] = np.nan
    s[6] = np.nan
    (scatter,) = population({"k": y}, {"k": s}).scatters
    assert np.isnan(scatter.scores[5]) and np.isnan(scatter.p_adjusted[6])
    few = population({"k": y[:4]}, {"k": s[:4]}).scatters[0]
    assert few.outliers == () and np.isnan(few.spread)


def test_equal_joints_have_no_outlier():
    (scatter,) = population({"k": np.full(9, 3.0)}, {"k": np.zeros(9)}).scatters
    assert scatter.outliers == () and scatter.spread < 1e-12


def test_holm_against_its_definition():
    p = np.array([0.03, np.nan, 0.001, 0.2, 0.02])
    np.testing.assert_allclose(holm(p), [0.06, np.nan, 0.004, 0.2, 0.06])


def test_shapes_are_checked():
    with pytest.raises(InputError, match="as many errors"):
        population({"k": [1.0, 2.0]}, {"k": [0.1]})


GAIN, NOISE, SPREAD, JOINTS = 0.03, 0.002, 0.02, 40
# The angle is uncertain: a cubic stiffness goes with its third power.
MOVES = {"linear_stiffness": ("k1", 6000.0, -GAIN), "cubic_stiffness": ("k3", -2.7e9, -3 * GAIN)}


@pytest.fixture(scope="module")
def joints():
    rng, shift = np.random.default_rng(7), -1.1
    records = []
    for number in range(JOINTS):
        terms = []
        for name, (symbol, mean, move) in MOVES.items():
            value = mean * (1 + SPREAD * rng.normal() + NOISE * rng.normal() + shift * move)
            shared = {"calibration": {"angle": value * move}} if move else {}
            error = abs(value) * float(np.hypot(NOISE, move))
            terms.append(
                {"id": name, "symbol": symbol, "coefficient": value, "unit": "N*m", "standard_error": error}
                | shared
            )
        joint = {"name": f"j{number}", "motion": "rotation", "serial": f"{number}"}
        result = {"terms": terms, "warnings": []}
        records.append(CampaignRecord(f"j{number}", "", "found", "", joint, result))
    return tuple(records)


def test_the_spread_is_that_of_joints_and_the_next_one_knows_the_gain(joints, tmp_path):
    found = summarised(joints, tmp_path)
    for scatter, (_, mean, move) in zip(found.population.scatters, MOVES.values(), strict=True):
        assert scatter.spread == pytest.approx(SPREAD * abs(scatter.mean), rel=0.3)
        expected = np.hypot(move, SPREAD / JOINTS**0.5) * abs(scatter.mean)
        assert scatter.mean_error == pytest.approx(expected, rel=0.05)
        # The true mean is within it, which a mean of forty joints without the gain misses by ten errors.
        assert abs(scatter.mean - mean) < 2 * scatter.mean_error
        assert abs(scatter.mean - mean) > 5 * SPREAD / JOINTS**0.5 * abs(mean)


def test_samples_of_a_batch_move_together_by_the_gain(joints, tmp_path):
    found = summarised(joints, tmp_path)
    (tmp_path / "batch.json").write_text(json.dumps(found.to_dict()))
    made = batch_samples(tmp_path, 4000)
    _, *rows = csv.reader(io.StringIO(str(made.files["samples.csv"])))
    k1, k3 = np.array(rows, dtype=float).T
    own = np.hypot(GAIN, SPREAD * np.hypot(1, JOINTS**-0.5))
    assert k1.std() / abs(k1.mean()) == pytest.approx(own, rel=0.15)
    # Of the covariance of relative errors, 3·GAIN² is the gain's; k3 is negative.
    relative = np.array([k1 / k1.mean(), k3 / k3.mean()])
    assert np.cov(relative)[0, 1] == pytest.approx(3 * GAIN**2, rel=0.2)


def test_samples_are_drawn_about_a_trend_at_the_value_that_is_given(joints, tmp_path):
    loads = np.linspace(50.0, 250.0, JOINTS)
    tested = []
    for record, load in zip(joints, loads, strict=True):
        k1, k3 = record.result["terms"]
        k1 = k1 | {"coefficient": k1["coefficient"] * (1 + 2e-3 * (load - 150)), "calibration": {}}
        joint = record.joint | {"inputs": {"load": float(load)}, "input_units": {"load": "N"}}
        tested.append(replace(record, joint=joint, result=record.result | {"terms": [k1, k3]}))
    found = summarised(tuple(tested), tmp_path)
    assert found.population.scatters[0].covariate == "load" and found.covariate_units["load"] == "N"
    (tmp_path / "batch.json").write_text(json.dumps(found.to_dict()))

    def drawn(at):
        _, *rows = csv.reader(io.StringIO(str(batch_samples(tmp_path, 4000, at=at).files["samples.csv"])))
        return np.array(rows, dtype=float)[:, 0]

    middle, heavy, also = drawn({}), drawn({"load": "250"}), drawn({"load": "0.25 kN"})
    assert heavy.mean() / middle.mean() == pytest.approx(1.2, abs=0.02)
    # The spread of joints, not of the loads that they were tested at, and their mean's error with the gain.
    assert middle.std() / middle.mean() < 1.6 * SPREAD
    assert np.array_equal(heavy, also)
    with pytest.raises(InputError, match="no coefficient has a trend with it; there are trends with load"):
        batch_samples(tmp_path, 10, at={"heat": "3"})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bandwidth": -1.0}, "bandwidth is -1.0 Hz; expected a positive number"),
        ({"forced": ["linear_damping"], "forbidden": ["linear_damping"]}, "is forced and forbidden"),
        ({"forbidden": ["nothing"]}, "has no term 'nothing'"),
    ],
)
def test_what_would_break_every_campaign_is_refused_once(options, message, tmp_path):
    (tmp_path / "campaign.toml").touch()
    with pytest.raises(SindyJointError, match=message):
        batch(tmp_path, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
