"""Amplitude and period against closed forms."""

import numpy as np
import pytest

from sindyjoint.numeric import main_frequency, noise_by_differences
from sindyjoint.response import compare_oscillations, hilbert_envelope, oscillation

RATE = 1000.0
TIME = np.arange(20_000) / RATE


def ring_down(frequency=4.5, decay=0.06, amplitude=1.4e-3):
    return amplitude * np.exp(-decay * TIME) * np.sin(2 * np.pi * frequency * TIME)


def test_white_noise_is_measured_on_a_vibration():
    noisy = ring_down() + 1e-5 * np.random.default_rng(5).standard_normal(TIME.size)
    # Seed 5. The median of 20 000 absolute values scatters by about 1 %; fourth differences are correlated.
    assert noise_by_differences(noisy, 4) == pytest.approx(1e-5, rel=0.05)
    assert noise_by_differences(ring_down(), 4) < 1e-9


def test_period_and_amplitude_of_a_ring_down():
    frequency, decay = 4.5, 0.06
    found = oscillation(ring_down(frequency, decay), RATE)
    # Extremes of exp(−δt)·sin(ωt) lie 1/(2f) apart exactly; half-cycle k+2 is exp(−δT) times half-cycle k.
    np.testing.assert_allclose(found.period, 1 / frequency, atol=2e-6)
    np.testing.assert_allclose(
        found.amplitude[2:] / found.amplitude[:-2], np.exp(-decay / frequency), rtol=1e-4
    )
    # A cubic over 0.35 of a period rounds the tops off a little, the same for any two signals.
    assert found.amplitude[0] == pytest.approx(1.4e-3, rel=0.02)
    assert found.first == 1


def test_noise_does_not_add_swings():
    signal = ring_down()
    noisy = signal + 0.02 * signal.std() * np.random.default_rng(2).standard_normal(TIME.size)
    assert oscillation(noisy, RATE).time.size == oscillation(signal, RATE).time.size == 180


def test_a_wandering_rest_drops_out_of_the_amplitude():
    signal = ring_down(decay=0.0)
    moved = oscillation(signal + 5e-4 * np.tanh((TIME - 10) / 4), RATE)
    np.testing.assert_allclose(moved.amplitude, oscillation(signal, RATE).amplitude, rtol=0.01)


def test_envelope_and_frequency_by_hilbert():
    envelope, frequency = hilbert_envelope(ring_down(), RATE)
    middle = slice(500, -500)
    np.testing.assert_allclose(envelope[middle], 1.4e-3 * np.exp(-0.06 * TIME[middle]), rtol=0.03)
    np.testing.assert_allclose(frequency[middle], 4.5, rtol=0.02)
    assert main_frequency(ring_down(), RATE) == pytest.approx(4.5, abs=0.05)


def test_two_vibrations_differ_by_what_was_put_in():
    gap = compare_oscillations(oscillation(ring_down(4.5), RATE), oscillation(1.1 * ring_down(4.6), RATE))
    assert gap.mean_period_difference == pytest.approx(1 / 4.5 - 1 / 4.6, rel=1e-3)
    # 10 % of every amplitude: the root mean square of exp(−δt) over the record, relative to the first, and 1 % more
    # since the quicker one has decayed less at the same half-cycle, and a larger first amplitude.
    expected = 0.1 * np.sqrt(np.mean(np.exp(-0.12 * TIME)))
    assert gap.amplitude_rms_error == pytest.approx(expected, rel=0.12)
    same = compare_oscillations(oscillation(ring_down(), RATE), oscillation(ring_down(), RATE))
    assert same.amplitude_rms_error == same.mean_period_difference == 0.0


def test_swings_are_paired_by_time_not_by_number():
    whole = ring_down()
    late = whole.copy()
    late[:160] = 0.0  # the first maximum is missing from one of them
    gap = compare_oscillations(oscillation(whole, RATE), oscillation(late, RATE, 4.5))
    assert gap.amplitude_rms_error < 0.01 and gap.mean_period_difference < 1e-3


@pytest.mark.parametrize("signal", [np.zeros(500), np.arange(500.0), np.ones(8)])
def test_what_does_not_vibrate_has_no_swings(signal):
    assert oscillation(signal, RATE) is None
    assert compare_oscillations(None, oscillation(ring_down(), RATE)) is None
