"""A delay between channels that do not repeat, and a law with memory, which lags as well."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from sindyjoint.numeric import delayed
from sindyjoint.record import Campaign, Joint, Run
from tests.diagnosis.hidden_effects import hide_in_noise
from tests.soundness.faults import findings_of


@pytest.fixture(scope="module")
def multisines():
    return hide_in_noise("nothing", "multisine", 4, 0.1, 0.01).campaign


def delays(campaign):
    return [f for f in findings_of(campaign) if f.id == "channel_delay"]


def test_a_late_moment_is_found(multisines):
    late = [replace(r, moment=delayed(r.moment, 1.5e-3 * r.sample_rate)) for r in multisines.runs]
    (finding,) = delays(replace(multisines, runs=tuple(late)))
    # 0.1 ms: five of its standard errors.
    assert float(finding.extent.split(" ± ")[0].split()[-1]) == pytest.approx(1.5, abs=0.1)


def test_channels_in_time_have_no_delay(multisines):
    assert delays(multisines) == []


def test_memory_is_no_delay():
    # Without the memory beside it a delay of 3 ms halves what the five terms leave of this relaxation.
    assert delays(hide_in_noise("maxwell_branch", "multisine", 991, 0.1, 0.01).campaign) == []


def prescribed(motion, law, rate=1000.0, duration=4.0):
    """Return runs along motions written down, x(t, run), under a law of angle and rate, with 0.5 % noise."""
    time, rng = np.arange(0, duration, 1 / rate), np.random.default_rng(7)
    runs = []
    for index in range(4):
        angle = motion(time, index)
        moment = law(angle, np.gradient(angle, time), 1 / rate)
        noisy = [x + 0.005 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
        runs.append(Run(f"run {index}", *noisy, rate))
    return Campaign(Joint(inertia=0.0), tuple(runs))


def tones(time, index):
    rng = np.random.default_rng(index)
    return (0.6, 1.0)[index % 2] * sum(
        0.2 * np.sin(2 * np.pi * f * time + p) for f, p in rng.uniform([1.0, 0.0], [8.0, 6.0], (6, 2))
    )


def late_friction(angle, rate, step):
    lagging = lfilter([1 - np.exp(-step / 5e-3)], [1, -np.exp(-step / 5e-3)], np.sign(rate))
    return angle + 0.01 * rate + 0.2 * lagging


def test_friction_that_comes_late_is_no_delay():
    assert delays(prescribed(tones, late_friction)) == []


def test_damping_of_each_direction_is_no_drift_of_a_sweep():
    """Its mean moment grows with the rate, and so with time as the frequency rises."""
    swept = prescribed(
        lambda t, index: (0.6, 1.0)[index % 2] * np.sin(2 * np.pi * (1 + 0.9 * t) * t),
        lambda angle, rate, step: angle + 0.01 * rate + 0.005 * np.abs(rate) + 0.1 * np.sign(rate),
    )
    assert findings_of(swept) == ()
