"""Runs that do not repeat: a gain that differs, another law, a drift; and none of it where nothing is."""

import re
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.record import Campaign, Joint, Run
from tests.soundness.faults import findings_of

RATE, DURATION, NOISE = 400.0, 10.0, 0.01


def multisine(seed):
    """A joint of the paper's law, its angle prescribed: twelve tones of 1 to 8 Hz."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, DURATION, 1 / RATE)
    tones = 2 * np.pi * (1 + 7 * rng.uniform(size=12))
    phase = np.outer(tones, time) + 2 * np.pi * rng.uniform(size=(12, 1))
    scale = (4e-4, 2.5e-4)[seed % 2] / np.abs(np.cos(phase).sum(axis=0)).max()
    angle, rate = scale * np.cos(phase).sum(axis=0), -scale * (tones @ np.sin(phase))
    moment = 6066 * angle - 2.684e9 * angle**3 + 48 * rate + 0.4 * np.sign(rate)
    noisy = [x + NOISE * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    return Run(f"multisine {seed}", *noisy, RATE)


RUNS = [multisine(seed) for seed in range(6)]
LINE = np.arange(RUNS[0].n_samples) / RUNS[0].n_samples


def found(**changes):
    """Return what is said of the runs, the fourth of them changed."""
    runs = tuple(replace(run, **changes) if index == 3 else run for index, run in enumerate(RUNS))
    return list(findings_of(Campaign(Joint(inertia=0.0), runs)))


def test_nothing_is_said_of_sound_runs():
    assert found() == []


@pytest.mark.parametrize("channel", ["moment", "angle"])
@pytest.mark.parametrize("gain", [0.85, 1.2])
def test_a_gain_of_one_run_is_found_with_its_channel(channel, gain):
    (finding,) = found(**{channel: gain * getattr(RUNS[3], channel)})
    assert (finding.id, finding.run, finding.channel) == ("gain_differs", "multisine 3", channel)
    (told,) = re.findall(r" is ([0-9.]+) times ", finding.extent)
    assert float(told) == pytest.approx(gain, rel=0.02)


def test_another_law_is_a_run_that_differs():
    (finding,) = found(moment=RUNS[3].moment + 1.5e7 * RUNS[3].angle * np.abs(RUNS[3].angle))
    assert (finding.id, finding.run) == ("run_differs", "multisine 3")


def test_a_delay_of_one_run_is_found_and_a_zero_told():
    (finding,) = found(moment=np.roll(RUNS[3].moment, 2))
    assert (finding.id, finding.run) == ("channel_delay", "multisine 3")
    (told,) = re.findall(r"comes ([0-9.]+) ms earlier", finding.extent)
    assert float(told) == pytest.approx(5, rel=0.1)
    (finding,) = found(moment=RUNS[3].moment - 0.5)
    assert finding.id == "run_differs"
    (told,) = re.findall(r"agree with ([0-9.]+) N\*m added", finding.extent)
    assert float(told) == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize("channel", ["moment", "angle"])
@pytest.mark.parametrize("size", [0.08, 0.3])
def test_a_drift_is_found(channel, size):
    signal = getattr(RUNS[3], channel)
    (finding,) = found(**{channel: signal + size * np.sqrt(2) * np.std(signal) * LINE})
    assert (finding.id, finding.run, finding.severity) == ("drift", "multisine 3", "biases")
