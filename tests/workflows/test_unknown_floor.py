"""A noise floor that is unknown, and one of runs that are kept out: what discover and diagnose make of them."""

import json

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from sindyjoint import JointModel, discover
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.rig import SensorNoise

RATE, N = 500.0, 8000


def run(name, level, seed, filtered=False, hidden=0.0, **options):
    """A joint moved by a random multisine of 1 to 6 Hz; ``hidden`` is a moment that no state predicts."""
    rng = np.random.default_rng(seed)
    time = np.arange(N) / RATE
    f, phase = rng.uniform(1, 6, 10), rng.uniform(0, 2 * np.pi, 10)
    w = 2 * np.pi * f
    angle = 3e-4 * np.sin(np.outer(time, w) + phase).sum(axis=1)
    rate = 3e-4 * (w * np.cos(np.outer(time, w) + phase)).sum(axis=1)
    moment = 5e3 * angle + 3e5 * angle**2 - 4e8 * angle**3 + 60 * rate + 1.5 * np.sign(rate)
    moment += hidden * np.sin(2 * np.pi * 2.345 * time) * moment.std()
    channels = [
        moment + level * moment.std() * rng.normal(size=N),
        angle + 1e-3 * angle.std() * rng.normal(size=N),
    ]
    if filtered:
        channels = [sosfilt(butter(6, 0.5, output="sos"), channel) for channel in channels]
    return Run(name, *channels, RATE, **options)


def campaign(*runs):
    return Campaign(Joint(inertia=0.0), runs)


def test_discover_says_that_no_floor_could_be_measured():
    runs = [run("a", 0.01, 1, True, 0.5), run("b", 0.01, 2, True, 0.5)]
    found = discover(campaign(*runs), "paper", correct=False)
    assert np.isnan(found.model.fitted.noise_floor)
    assert found.verdict.verdict == "undecided"
    assert "no noise floor could be measured" in found.verdict.reason
    record = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    # Samples of nearly one state bound the noise, by half of the moment here: that explains nothing.
    explained = record["trust"]["explained"]
    assert explained["colour"] == "poor" and explained["gap"] < 1.2 * explained["floor"]
    assert record["fit"]["noise_floor"] is None
    back = JointModel.from_json(json.dumps(json.loads(found.model.to_json()), allow_nan=False))
    assert np.isnan(back.fitted.noise_floor)
    assert back.fitted.misfit == pytest.approx(
        found.model.fitted.residual_rms / found.model.fitted.moment_rms
    )


def test_declared_noise_makes_the_floor_known():
    size = np.std(run("a", 0.01, 1, True).moment)
    declared = SensorNoise(moment=0.02 * size, angle=1e-7)
    found = discover(campaign(run("a", 0.01, 1, True, noise=declared)), "paper", correct=False)
    assert found.model.fitted.noise_floor == pytest.approx(0.02 * size, rel=0.01)
