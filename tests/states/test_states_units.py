"""Harmonics, periods, masks and standstills alone, against closed forms."""

import numpy as np
import pytest

from sindyjoint.record import Run
from sindyjoint.states import (
    HarmonicBasis,
    force_states,
    local_noise,
    mean_period,
    moving_mask,
    rate_limit,
    refine_frequency,
    repetition,
    significant_harmonics,
    unsteady_periods,
    without_noise_travel,
)

SAMPLING = 1000.0


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
    time = np.arange(int(8 * SAMPLING / frequency)) / SAMPLING
    basis = HarmonicBasis.build(time, frequency, np.arange(1, 10))
    mean, found_a, found_b = basis.fit(0.3 + tones(time, frequency, a, b))
    assert mean == pytest.approx(0.3, abs=1e-12)
    np.testing.assert_allclose(found_a, a, atol=1e-12)
    np.testing.assert_allclose(
        basis.series(mean, found_a, found_b), 0.3 + tones(time, frequency, a, b), atol=1e-12
    )
    for order, derivative in enumerate(basis.motion(mean, found_a, found_b)[1:], 1):
        exact = tones(time, frequency, a, b, order)
        np.testing.assert_allclose(derivative, exact, atol=1e-11 * np.abs(exact).max())


def test_rows_and_harmonics_can_be_taken():
    time = np.arange(1000) / SAMPLING
    basis = HarmonicBasis.build(time, 4.0, np.array([1, 2, 3]))
    part = basis.take(np.array([True, False, True])).rows(slice(250, 500))
    # Phases of 6 rad are rounded to 1e-15, and thrice that by the sums of angles.
    np.testing.assert_allclose(part.cosine[:, 1], np.cos(2 * np.pi * 12 * time[250:500]), atol=1e-13)
    np.testing.assert_array_equal(part.angular, 2 * np.pi * np.array([4.0, 12.0]))


@pytest.mark.parametrize("count", [1, 2, 17, 120])
def test_all_harmonics_together_are_fitted_as_any_of_them(count):
    # The same least-squares problem, from the products of its columns one by one.
    rng = np.random.default_rng(4)
    time = np.arange(1999) / SAMPLING
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
    variance = local_noise(noise, SAMPLING, 10.0 * np.arange(1, 41), 2.0)
    assert variance.shape == (40,)
    assert variance.mean() == pytest.approx(0.04, rel=0.12)


def test_local_noise_is_local():
    time = np.arange(10_000) / SAMPLING
    hum = np.sin(2 * np.pi * 50.3 * time)
    near, far = local_noise(hum, SAMPLING, np.array([50.0, 200.0]), 2.0)
    assert near > 1.0 and far < 1e-4 * near


def test_harmonics_end_where_the_spectrum_sinks_into_noise():
    amplitude = np.array([9.0, 5, 1, 4, 1, 1, 1, 1, 9.0])
    keep = significant_harmonics(amplitude, np.ones(9))
    # the third is a gap, the ninth is single beyond four misses: noise
    assert keep.tolist() == [True, True, False, True, False, False, False, False, False]
    assert significant_harmonics(np.zeros(3), np.ones(3)).tolist() == [True, False, False]


@pytest.mark.parametrize("true", [3.98, 4.0, 4.013])
def test_frequency_is_refined(true):
    time = np.arange(10_000) / SAMPLING
    signal = np.sin(2 * np.pi * true * time + 0.4) + 0.2 * np.sin(6 * np.pi * true * time)
    noisy = signal + 0.01 * np.random.default_rng(2).normal(size=time.size)
    # Cramér–Rao: sqrt(6)·σ/(π·A·T·sqrt(n)) is 8e-6 Hz; the declared value stands unless contradicted by four errors
    assert refine_frequency(noisy, SAMPLING, 4.0) == pytest.approx(true, abs=1e-4)


def test_frequency_is_refined_by_a_harmonic_where_the_fundamental_is_noise():
    """A multisine of a band has no line at the frequency at which it repeats."""
    time = np.arange(10_000) / SAMPLING
    for seed in range(5):
        noise = 0.05 * np.random.default_rng(seed).normal(size=time.size)
        multisine = [
            np.sin(2 * np.pi * k * 0.5 * time) + np.cos(2 * np.pi * (k + 1) * 0.5 * time) for k in (7, 11)
        ]
        assert refine_frequency(multisine[0] + multisine[1] + noise, SAMPLING, 0.5, 7) == 0.5
        off = np.sin(2 * np.pi * 7 * 0.502 * time) + noise
        assert refine_frequency(off, SAMPLING, 0.5, 7) == pytest.approx(0.502, abs=2e-5)


def test_a_right_frequency_is_not_touched():
    time = np.arange(10_000) / SAMPLING
    for seed in range(5):
        noise = 0.05 * np.random.default_rng(seed).normal(size=time.size)
        assert refine_frequency(np.sin(8 * np.pi * time) + noise, SAMPLING, 4.0) == 4.0


@pytest.mark.parametrize("constant", [0.2, 0.5])
def test_transient_is_found(constant):
    # A free vibration that dies with the time constant: gone to 0.2 % of the fundamental after ln(500) = 6.2 of them.
    time = np.arange(10_000) / SAMPLING
    signal = np.sin(8 * np.pi * time) + np.exp(-time / constant) * np.sin(2 * np.pi * 11.3 * time)
    noisy = signal + 0.001 * np.random.default_rng(3).normal(size=time.size)
    start = unsteady_periods(noisy, SAMPLING, 4.0)[0] / 4.0
    # A free vibration off the harmonics leaves about a tenth of itself in them: ln(50)…ln(500) time constants.
    assert 2.0 * constant < start < 6.5 * constant


def test_nothing_is_left_out_of_a_steady_run():
    time = np.arange(10_000) / SAMPLING
    noisy = np.sin(8 * np.pi * time) + 0.01 * np.random.default_rng(4).normal(size=time.size)
    assert unsteady_periods(noisy, SAMPLING, 4.0) == (0, 0)
    assert unsteady_periods(noisy[:600], SAMPLING, 4.0) == (
        0,
        0,
    )  # two periods and a half: nothing to compare


def test_a_drive_that_is_ramped_down_leaves_out_its_last_periods():
    # Ten seconds of 4 Hz, the last of them faded: four periods.
    time = np.arange(10_000) / SAMPLING
    faded = np.sin(8 * np.pi * time) * np.minimum(1, 10 - time)
    noisy = faded + 0.01 * np.random.default_rng(5).normal(size=time.size)
    assert unsteady_periods(noisy, SAMPLING, 4.0) == (0, 4)


def test_limit_follows_the_larger_of_share_and_noise():
    rate = np.array([-2.0, 1.0])
    assert rate_limit(rate, 0.001, 0.05) == pytest.approx(0.1)
    assert rate_limit(rate, 0.1, 0.05) == pytest.approx(0.4)  # four standard errors


def test_guard_on_both_sides():
    rate = np.array([1.0, 1, 1, 1, 0.01, 1, 1, 1, 1])
    assert moving_mask(rate, 0.1, 2).tolist() == [True, True] + [False] * 5 + [True, True]
    assert moving_mask(rate, 0.1, 0).tolist() == [True] * 4 + [False] + [True] * 4


def test_a_jump_through_zero_is_a_reversal():
    rate = np.array([1.0, 1, 1, -1, -1, -1, -1])
    assert moving_mask(rate, 0.1, 1).tolist() == [True, True, False, False, False, True, True]


def test_nothing_moves_below_the_limit():
    assert not moving_mask(np.full(10, 0.05), 0.1, 3).any()
    assert moving_mask(np.full(10, -0.5), 0.1, 3).all()


RATE = 500.0


def multisine(periods, noise=0.0, samples=1000, seed=0):
    """An angle of 20 tones and its acceleration as the moment; the period is ``samples`` long."""
    generator = np.random.default_rng(seed)
    time = np.arange(samples * periods) / RATE
    lines = np.arange(1, 21)
    phases = generator.uniform(0, 2 * np.pi, lines.size)
    w = 2 * np.pi * lines * RATE / samples
    angle = 1e-3 * np.sum(np.cos(np.outer(time, w) + phases), axis=1)
    moment = np.sum(-1e-3 * w**2 * np.cos(np.outer(time, w) + phases), axis=1)
    angle = angle + noise * np.std(angle) * generator.standard_normal(time.size)
    moment = moment + noise * np.std(moment) * generator.standard_normal(time.size)
    return Run("multisine", moment, angle, RATE)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_the_period_of_a_multisine_is_found(noise):
    assert repetition(multisine(5, noise)) == 1000


def test_what_does_not_repeat_has_no_period():
    time = np.arange(5000) / RATE
    decay = np.exp(-time) * np.cos(2 * np.pi * 3 * time)
    sweep = np.sin(2 * np.pi * (1 + time) * time)
    noise = np.random.default_rng(0).standard_normal(5000)
    for angle in (decay, sweep, noise):
        assert repetition(Run("run", np.gradient(np.gradient(angle)), angle, RATE)) is None


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_lines_without_a_common_period_do_not_repeat_though_they_come_near(noise):
    """After 2.5 s they differ by a tenth, after five by a fifth: their mean period would jump where it closes."""
    time = np.arange(5000) / RATE
    rng = np.random.default_rng(1)
    angle = sum(np.sin(2 * np.pi * f * time) for f in (0.4 * 1.01, 1.2, 2.0, 3.2 * 1.002))
    angle = angle + noise * np.std(angle) * rng.standard_normal(time.size)
    near = np.std(angle[1250:] - angle[:-1250]) / np.std(angle) / np.sqrt(2)
    assert 0.02 < near < 0.15
    assert repetition(Run("run", angle.copy(), angle, RATE)) is None


def test_two_periods_are_too_few_and_a_rest_that_is_lost_is_too_much():
    assert repetition(multisine(2)) is None
    whole = multisine(4)
    cut = Run("cut", whole.moment[:3700], whole.angle[:3700], RATE)
    assert repetition(cut) is None


def test_the_transient_is_left_out_and_noise_averages():
    clean, noisy = multisine(9), multisine(9, 0.05)
    disturbed = noisy.angle.copy()
    disturbed[:1000] += 2e-3 * np.exp(-np.arange(1000) / 200)
    mean, first = mean_period(Run("run", noisy.moment, disturbed, RATE), 1000)
    assert first == 1000
    left = mean.angle - clean.angle[:1000]
    # Eight periods: the noise falls by the square root of eight; five standard errors of an RMS over 1000 samples.
    assert np.std(left) == pytest.approx(0.05 * np.std(clean.angle) / np.sqrt(8), rel=5 / np.sqrt(2000))


def test_states_of_the_mean_period_follow_themselves_to_both_ends():
    run = multisine(5)
    states = force_states(run)
    assert states.repeated and states.n_samples == 1000
    # The kernel is cut at five standard deviations of its window: exp(-12.5) of its height.
    assert np.allclose(states.acceleration, run.moment[:1000], rtol=0, atol=5e-6 * np.std(run.moment))


RATE, NOISE = 500.0, 0.003


def held_states(creep=0.0, noise=NOISE):
    """Half a period of motion, two seconds in which it is held (creeping there and back), and half a period more."""
    moving = np.arange(250) / RATE
    there = 0.5 - 0.5 * np.cos(2 * np.pi * moving)
    held = 1.0 + creep * np.sin(np.pi * np.arange(1000) / 1000)
    angle = np.concatenate([np.zeros(100), there, held, there[::-1], np.zeros(100)])
    angle = angle + noise * np.random.default_rng(3).standard_normal(angle.size)
    return force_states(Run("held", angle.copy(), angle, RATE), "broadband", 60.0)


def travel(rate):
    return float(np.sum(np.abs(rate))) / RATE


def test_noise_does_not_travel_while_the_joint_is_held():
    states = held_states()
    angle, rate = without_noise_travel(states, states.angle, states.rate, 1 / RATE)
    held = (states.time > 0.8) & (states.time < 2.6)
    assert travel(states.rate[held]) > 0.3
    assert travel(rate[held]) < 0.02
    assert np.max(np.abs(angle - states.angle)) < 3 * NOISE


def test_a_slow_motion_that_stands_out_of_the_noise_of_the_angle_is_kept():
    states = held_states(creep=0.1)
    angle, rate = without_noise_travel(states, states.angle, states.rate, 1 / RATE)
    held = (states.time > 0.7) & (states.time < 2.7)
    assert travel(rate[held]) == pytest.approx(0.2, abs=0.02)
    assert np.max(np.abs(angle - states.angle)) < 3 * NOISE


def test_a_motion_without_noise_stays_as_it_is():
    states = held_states(creep=0.1, noise=0.0)
    angle, rate = without_noise_travel(states, states.angle, states.rate, 1 / RATE)
    np.testing.assert_allclose(angle, states.angle, atol=1e-5)
    np.testing.assert_allclose(rate, states.rate, atol=2e-3)
