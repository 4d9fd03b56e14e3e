"""Uncertain gains move all joints of a batch alike: no part of their scatter, but of what is known of the next one."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.export.samples import batch_samples
from sindyjoint.workflows.joints.record import CampaignRecord
from sindyjoint.workflows.joints.summary import summarised

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
