"""Fourier series of a known fundamental: exact where the signal is one, honest about noise where it is not."""

import numpy as np
import pytest

from sindyjoint.states.harmonics import (
    HarmonicBasis,
    local_noise,
    refine_frequency,
    significant_harmonics,
    steady_start,
)

RATE = 1000.0


def tones(time, frequency, a, b, order=0):
    """Sum of harmonics, or its derivative of that order, in closed form."""
    total = np.zeros_like(time)
    for k, (ak, bk) in enumerate(zip(a, b, strict=True), start=1):
        w = 2 * np.pi * frequency * k
        total += w**order * (
            ak * np.cos(w * time + order * np.pi / 2) + bk * np.sin(w * time + order * np.pi / 2)
        )
    return total


@pytest.mark.parametrize("frequency", [3.0, 3.7, 6.0])  # 3.7 Hz: no whole number of samples per period
def test_series_and_derivatives_are_exact(frequency):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 9)) / np.arange(1, 10)
    time = np.arange(int(8 * RATE / frequency)) / RATE
    basis = HarmonicBasis.build(time, frequency, np.arange(1, 10))
    mean, found_a, found_b = basis.fit(0.3 + tones(time, frequency, a, b))
    assert mean == pytest.approx(0.3, abs=1e-12)
    np.testing.assert_allclose(found_a, a, atol=1e-12)
    np.testing.assert_allclose(
        basis.series(mean, found_a, found_b), 0.3 + tones(time, frequency, a, b), atol=1e-12
    )
    for order, derivative in ((1, basis.derivative), (2, basis.second_derivative)):
        exact = tones(time, frequency, a, b, order)
        np.testing.assert_allclose(derivative(found_a, found_b), exact, atol=1e-11 * np.abs(exact).max())


def test_rows_and_harmonics_can_be_taken():
    time = np.arange(1000) / RATE
    basis = HarmonicBasis.build(time, 4.0, np.array([1, 2, 3]))
    part = basis.take(np.array([True, False, True])).rows(slice(250, 500))
    # Phases of 6 rad are rounded to 1e-15, and thrice that by the sums of angles.
    np.testing.assert_allclose(part.cosine[:, 1], np.cos(2 * np.pi * 12 * time[250:500]), atol=1e-13)
    np.testing.assert_array_equal(part.angular, 2 * np.pi * np.array([4.0, 12.0]))


@pytest.mark.parametrize("count", [1, 2, 17, 120])
def test_all_harmonics_together_are_fitted_as_any_of_them(count):
    # The same least-squares problem, from the products of its columns one by one.
    rng = np.random.default_rng(4)
    time = np.arange(1999) / RATE
    basis = HarmonicBasis.build(time, 3.7, np.arange(1, count + 1))
    assert basis.complete
    signal = rng.normal(size=time.size)
    for rows in (slice(None), slice(300, 1500)):
        design = np.column_stack([np.ones(time[rows].size), basis.cosine[rows], basis.sine[rows]])
        expected = np.linalg.lstsq(design, signal[rows], rcond=None)[0]
        mean, a, b = basis.rows(rows).fit(signal[rows])
        np.testing.assert_allclose(np.concatenate([[mean], a, b]), expected, atol=1e-11)


def test_local_noise_of_white_noise_is_its_variance():
    # 40 neighbourhoods of 41 bins: each is known to 1/sqrt(20) = 22 %, their mean to 3.5 %; 12 % is more than three.
    noise = 0.2 * np.random.default_rng(1).normal(size=10_000)
    variance = local_noise(noise, RATE, 10.0 * np.arange(1, 41), 2.0)
    assert variance.shape == (40,)
    assert variance.mean() == pytest.approx(0.04, rel=0.12)


def test_local_noise_is_local():
    time = np.arange(10_000) / RATE
    hum = np.sin(2 * np.pi * 50.3 * time)
    near, far = local_noise(hum, RATE, np.array([50.0, 200.0]), 2.0)
    assert near > 1.0 and far < 1e-4 * near


def test_harmonics_end_where_the_spectrum_sinks_into_noise():
    amplitude = np.array([9.0, 5, 1, 4, 1, 1, 1, 1, 9.0])
    keep = significant_harmonics(amplitude, np.ones(9))
    # the third is a gap, the ninth is single beyond four misses: noise
    assert keep.tolist() == [True, True, False, True, False, False, False, False, False]
    assert significant_harmonics(np.zeros(3), np.ones(3)).tolist() == [True, False, False]


@pytest.mark.parametrize("true", [3.98, 4.0, 4.013])
def test_frequency_is_refined(true):
    time = np.arange(10_000) / RATE
    signal = np.sin(2 * np.pi * true * time + 0.4) + 0.2 * np.sin(6 * np.pi * true * time)
    noisy = signal + 0.01 * np.random.default_rng(2).normal(size=time.size)
    # Cramér–Rao: sqrt(6)·σ/(π·A·T·sqrt(n)) is 8e-6 Hz; the declared value stands unless contradicted by four errors
    assert refine_frequency(noisy, RATE, 4.0) == pytest.approx(true, abs=1e-4)


def test_frequency_is_refined_by_a_harmonic_where_the_fundamental_is_noise():
    """A multisine of a band has no line at the frequency at which it repeats."""
    time = np.arange(10_000) / RATE
    for seed in range(5):
        noise = 0.05 * np.random.default_rng(seed).normal(size=time.size)
        multisine = [
            np.sin(2 * np.pi * k * 0.5 * time) + np.cos(2 * np.pi * (k + 1) * 0.5 * time) for k in (7, 11)
        ]
        assert refine_frequency(multisine[0] + multisine[1] + noise, RATE, 0.5, 7) == 0.5
        off = np.sin(2 * np.pi * 7 * 0.502 * time) + noise
        assert refine_frequency(off, RATE, 0.5, 7) == pytest.approx(0.502, abs=2e-5)


def test_a_right_frequency_is_not_touched():
    time = np.arange(10_000) / RATE
    for seed in range(5):
        noise = 0.05 * np.random.default_rng(seed).normal(size=time.size)
        assert refine_frequency(np.sin(8 * np.pi * time) + noise, RATE, 4.0) == 4.0


@pytest.mark.parametrize("constant", [0.2, 0.5])
def test_transient_is_found(constant):
    # A free vibration that dies with the time constant: gone to 0.2 % of the fundamental after ln(500) = 6.2 of them.
    time = np.arange(10_000) / RATE
    signal = np.sin(8 * np.pi * time) + np.exp(-time / constant) * np.sin(2 * np.pi * 11.3 * time)
    noisy = signal + 0.001 * np.random.default_rng(3).normal(size=time.size)
    start = steady_start(noisy, RATE, 4.0) / 4.0
    # A free vibration off the harmonics leaves about a tenth of itself in them: ln(50)…ln(500) time constants.
    assert 2.0 * constant < start < 6.5 * constant


def test_nothing_is_left_out_of_a_steady_run():
    time = np.arange(10_000) / RATE
    noisy = np.sin(8 * np.pi * time) + 0.01 * np.random.default_rng(4).normal(size=time.size)
    assert steady_start(noisy, RATE, 4.0) == 0
    assert steady_start(noisy[:600], RATE, 4.0) == 0  # two periods and a half: nothing to compare
