"""Noise of a channel that does not repeat: measured and right, quantised, declared, or said to be unknown."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, cheby2, detrend, ellip, sosfilt

from sindyjoint.errors import InputError
from sindyjoint.measurement import noise as states_noise
from sindyjoint.measurement.noise import (
    channel_noise,
    coherent_to_the_top,
    moment_noise,
    motion_noise,
    quantisation_step,
    signal_end,
)
from sindyjoint.numeric import without_line
from sindyjoint.record import Run
from sindyjoint.rig import SensorNoise
from sindyjoint.states import force_states
from sindyjoint.states.floor import moment_floor

RATE, N = 1000.0, 20_000


def smooth(top=20.0, seed=3):
    """Return a random-phase multisine of unit RMS up to ``top`` Hz."""
    rng = np.random.default_rng(seed)
    lines = np.arange(1, int(top * N / RATE))
    spectrum = np.zeros(N // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.uniform(size=lines.size))
    signal = np.fft.irfft(spectrum, N)
    return signal / signal.std()


def noise(level, seed=4):
    return level * np.random.default_rng(seed).normal(size=N)


@pytest.mark.parametrize("estimate", [moment_noise, motion_noise])
@pytest.mark.parametrize("top", [20.0, 150.0, 300.0])
@pytest.mark.parametrize("level", [0.001, 0.01, 0.05])
def test_white_noise_is_measured(estimate, top, level):
    found, measured = estimate(smooth(top) + noise(level), RATE)
    assert measured
    assert found == pytest.approx(level, rel=0.1)


@pytest.mark.parametrize("estimate", [moment_noise, motion_noise])
@pytest.mark.parametrize("order", [2, 4, 8])
def test_noise_behind_a_low_pass_filter_is_not_measured(estimate, order):
    filtered = sosfilt(butter(order, 0.5, output="sos"), smooth() + noise(0.01))
    assert not estimate(filtered, RATE)[1]


@pytest.mark.parametrize("estimate", [moment_noise, motion_noise])
@pytest.mark.parametrize("bits", [8, 10, 12])
@pytest.mark.parametrize("level", [0.0, 0.001, 0.01])
def test_quantisation_is_noise(estimate, bits, level):
    signal = smooth() + noise(level)
    step = 2.1 * np.abs(signal).max() / 2**bits
    found, measured = estimate(np.round(signal / step) * step, RATE)
    assert measured
    assert found == pytest.approx(np.hypot(level, step / np.sqrt(12)), rel=0.1)


def test_only_a_lattice_has_a_quantisation_step():
    assert quantisation_step(0.25 * np.round(smooth() / 0.25)) == pytest.approx(0.25)
    assert quantisation_step(smooth()) < 1e-3
    # One period over and over has few values, too.
    assert quantisation_step(np.sin(2 * np.pi * 20 * np.arange(N) / RATE)) == 0.0


def test_a_signal_up_to_half_the_sampling_rate_is_told_by_coherence():
    angle = smooth(480.0)
    assert coherent_to_the_top(angle + noise(0.1), 5e3 * angle + noise(500.0, 7), RATE)
    assert not coherent_to_the_top(smooth() + noise(0.1), 5e3 * smooth() + noise(500.0, 7), RATE)


def aperiodic_run(filtered=False, declared=None):
    angle = 1e-3 * smooth(12.0)
    moment = 5e3 * angle + 5.0 * smooth(12.0, 8)
    channels = [moment + noise(0.05, 6), angle + noise(1e-5, 7)]
    if filtered:
        channels = [sosfilt(butter(6, 0.5, output="sos"), channel) for channel in channels]
    return Run("run", *channels, RATE, noise=declared or SensorNoise())


def test_states_say_whether_their_noise_is_known():
    known, unknown = force_states(aperiodic_run()), force_states(aperiodic_run(filtered=True))
    assert known.noise.measured and known.noise.motion_measured
    assert not unknown.noise.measured and not unknown.noise.motion_measured
    assert moment_floor([known], 0.0).moment == pytest.approx(0.05, rel=0.1)
    lost = moment_floor([known, unknown], 0.0)
    assert np.isnan(lost.moment) and lost.words == "the data do not show how far they repeat"
    assert moment_floor([known, known, known, unknown], 0.0).moment == pytest.approx(0.05, rel=0.1)


STOP_BANDS = {
    "Chebyshev, 60 dB": cheby2(8, 60, 0.5, output="sos"),
    "Chebyshev, 40 dB": cheby2(6, 40, 0.3, output="sos"),
    "elliptic": ellip(6, 0.5, 60, 0.5, output="sos"),
}


@pytest.mark.parametrize("filtered", STOP_BANDS)
@pytest.mark.parametrize("top", [12.0, 60.0])
def test_a_level_stop_band_is_no_floor(filtered, top):
    """What lies beyond the edge is level, and 40 to 60 dB below the noise that the channel really has."""
    angle = 1e-3 * smooth(top)
    channels = [5e3 * angle + noise(0.05, 6), angle + noise(1e-5, 7)]
    behind = [sosfilt(STOP_BANDS[filtered], channel) for channel in channels]
    states = force_states(Run("run", *behind, RATE))
    found = states.noise
    # The noise before the filter began to fall; near its edge some is gone.
    assert found.moment == pytest.approx(0.05, rel=0.25) and found.measured
    assert found.angle == pytest.approx(1e-5, rel=0.25) and found.motion_measured
    # And the edge of the filter is not taken for the end of the signal.
    assert states.bandwidth < 2 * top
    # The multisine itself ends as abruptly, in both channels: its floor is one.
    known = force_states(Run("run", *channels, RATE)).noise
    assert known.measured and known.motion_measured and known.moment == pytest.approx(0.05, rel=0.1)
    declared = SensorNoise(moment=0.05, angle=1e-5)
    assert force_states(Run("run", *behind, RATE, noise=declared)).noise.moment == 0.05


def test_declared_noise_is_the_floor_where_nothing_repeats():
    states = force_states(aperiodic_run(True, SensorNoise(moment=0.07, angle=2e-5)))
    assert states.noise.moment == 0.07
    assert states.noise.angle == 2e-5
    assert states.noise.measured and states.noise.motion_measured


def test_declared_noise_is_a_lower_bound_where_a_run_repeats():
    time = np.arange(5000) / RATE
    angle = 1e-3 * np.sin(2 * np.pi * 4 * time)
    run = Run("sine", 5e3 * angle + noise(0.05)[:5000], angle + noise(1e-6)[:5000], RATE, frequency=4.0)
    assert force_states(replace(run, noise=SensorNoise(moment=0.2))).noise.moment == 0.2
    assert force_states(replace(run, noise=SensorNoise(moment=0.01))).noise.moment == pytest.approx(
        0.05, rel=0.1
    )


def test_noise_is_above_zero():
    with pytest.raises(InputError, match="noise of the angle"):
        SensorNoise(angle=0.0)


def test_a_line_is_taken_out_as_scipy_does():
    signals = np.random.default_rng(4).normal(size=(3, 40)).cumsum(axis=1)
    np.testing.assert_allclose(without_line(signals), detrend(signals, type="linear"), atol=1e-12)


def test_noise_is_measured_once_for_a_run(monkeypatch):
    calls = []
    monkeypatch.setattr(states_noise, "signal_end", lambda *given: calls.append(1) or signal_end(*given))
    values = np.random.default_rng(4).normal(size=(2, 2000)).cumsum(axis=1)
    run = Run(name="run", moment=values[0], angle=values[1], sample_rate=100.0)
    first = channel_noise(run)
    count = len(calls)
    assert channel_noise(run) is first and len(calls) == count > 0
    assert channel_noise(replace(run)) == first and len(calls) == 2 * count
