"""Noise, bandwidth and the smoothing kernel of runs that do not repeat."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, cheby2, detrend, ellip, sosfilt

from sindyjoint import measurement
from sindyjoint.errors import InputError
from sindyjoint.measurement import (
    channel_noise,
    coherent_to_the_top,
    difference_noise,
    moment_noise,
    motion_noise,
    quantisation_step,
    signal_end,
)
from sindyjoint.numeric import without_line
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.rig import SensorNoise
from sindyjoint.states import (
    broadband_states,
    dwells,
    force_states,
    moment_floor,
    smoothing_kernels,
    states_of,
)

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
    monkeypatch.setattr(measurement, "signal_end", lambda *given: calls.append(1) or signal_end(*given))
    values = np.random.default_rng(4).normal(size=(2, 2000)).cumsum(axis=1)
    run = Run(name="run", moment=values[0], angle=values[1], sample_rate=100.0)
    first = channel_noise(run)
    count = len(calls)
    assert channel_noise(run) is first and len(calls) == count > 0
    assert channel_noise(replace(run)) == first and len(calls) == 2 * count


RATE = 1000.0


@pytest.mark.parametrize("cutoff", [20.0, 100.0, 380.0])
@pytest.mark.parametrize("share", [0.05, 0.4, 0.6])
def test_derivatives_are_exact_in_the_passband(cutoff, share):
    # The response falls as an error function of width 0.1 of the cut-off: at 0.6 of it, four widths below, 1 − 3e-5.
    frequency = share * cutoff
    w = 2 * np.pi * frequency
    kernels = smoothing_kernels(cutoff, RATE)
    half = kernels[0].size // 2
    time = np.arange(-3 * half, 3 * half + 1) / RATE
    for order, kernel in enumerate(kernels):
        found = np.convolve(np.sin(w * time + 0.3), kernel, mode="valid")
        exact = w**order * np.sin(w * time[half:-half] + 0.3 + order * np.pi / 2)
        # Against the size of the kernel's band, (2π·cutoff)^order: the error of the sampled kernel is of its ends.
        np.testing.assert_allclose(found, exact, atol=1e-4 * w**order + 2e-6 * (2 * np.pi * cutoff) ** order)


def test_constants_and_lines_are_exact():
    low, first, second = smoothing_kernels(60.0, RATE)
    n = low.size
    line = np.linspace(-1, 1, n) * (n - 1) / 2 / RATE
    assert np.convolve(np.full(n, 7.0), low, "valid")[0] == pytest.approx(7.0)
    assert np.convolve(np.full(n, 7.0), first, "valid")[0] == pytest.approx(0.0, abs=1e-9)
    assert np.convolve(np.full(n, 7.0), second, "valid")[0] == pytest.approx(0.0, abs=1e-6)
    assert np.convolve(line, first, "valid")[0] == pytest.approx(1.0, rel=1e-4)


def test_the_stopband_is_closed():
    low, first, _ = smoothing_kernels(60.0, RATE)
    time = np.arange(5 * low.size) / RATE
    tone = np.sin(2 * np.pi * 90 * time)
    assert np.abs(np.convolve(tone, low, "valid")).max() < 1e-5
    assert np.abs(np.convolve(tone, first, "valid")).max() < 1e-5 * 2 * np.pi * 90


def multisine(top, seed, n=20_000):
    """Random-phase multisine of unit RMS up to ``top`` Hz."""
    rng = np.random.default_rng(seed)
    lines = np.arange(1, int(top * n / RATE))
    spectrum = np.zeros(n // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.uniform(size=lines.size))
    signal = np.fft.irfft(spectrum, n)
    return signal / signal.std()


@pytest.mark.parametrize("top", [20.0, 60.0, 150.0])
@pytest.mark.parametrize("level", [0.001, 0.01, 0.05])
def test_bandwidth_and_noise_of_a_multisine(top, level):
    signal = multisine(top, 5)
    noisy = signal + level * np.random.default_rng(6).normal(size=signal.size)
    end = signal_end(noisy, RATE)
    bandwidth, noise = end.bandwidth, end.noise
    # The edge is known to the resolution of the averaged spectrum, a few bins of 1.2 Hz, and its window's side lobes.
    assert top - 2 <= bandwidth <= top + 10
    # 5 %: a third of the band holds 6700 independent values, 1.2 % of scatter, and the median's bias
    assert noise == pytest.approx(level, rel=0.05)


@pytest.mark.parametrize("level", [0.001, 0.01, 0.05])
def test_noise_of_a_moment_with_friction_steps(level):
    time = np.arange(20_000) / RATE
    moment = np.sin(8 * np.pi * time) + 0.5 * np.sign(np.cos(8 * np.pi * time))
    noisy = moment + level * np.random.default_rng(7).normal(size=time.size)
    assert difference_noise(noisy) == pytest.approx(level, rel=0.05)
    noise, measured = moment_noise(noisy, RATE)
    assert noise == pytest.approx(level, rel=0.05)
    assert measured


def test_resting_and_passing():
    phase = 2 * np.pi * (np.arange(4000) + 0.5) / 1000
    assert not dwells(np.cos(phase))
    stuck = np.where(np.abs(np.cos(phase)) > 0.6, np.cos(phase), 0.0)
    assert dwells(stuck)


def sweep(noise=0.0, seed=8, n=20_000):
    """A joint k·θ + c·θ̇ + F·sign θ̇ moved by a sweep from 1 to 5 Hz, rate and acceleration known in closed form."""
    t = np.arange(n) / RATE
    phase, w = 2 * np.pi * (1.0 * t + 0.1 * t**2), 2 * np.pi * (1.0 + 0.2 * t)
    angle, rate = 1e-3 * np.sin(phase), 1e-3 * w * np.cos(phase)
    acceleration = 1e-3 * (2 * np.pi * 0.2 * np.cos(phase) - w**2 * np.sin(phase))
    moment = 5000 * angle + 50 * rate + 1.5 * np.sign(rate)
    rng = np.random.default_rng(seed)
    run = Run(
        "sweep",
        moment + noise * moment.std() * rng.normal(size=n),
        angle + noise * angle.std() * rng.normal(size=n),
        RATE,
    )
    return run, angle, rate, acceleration


def test_states_of_a_sweep():
    run, angle, rate, acceleration = sweep()
    states = broadband_states(run)
    middle = slice(round(states.time[0] * RATE), round(states.time[0] * RATE) + states.n_samples)
    assert states.dropped == pytest.approx(states.time[0])
    np.testing.assert_array_equal(states.moment, run.moment[middle])
    # Noise-free, the ends of the sweep are what limits: a cut in a chirp is no band-limited signal.
    core = slice(500, -500)
    np.testing.assert_allclose(states.angle[core], angle[middle][core], atol=1e-6 * 1e-3)
    np.testing.assert_allclose(states.rate[core], rate[middle][core], atol=1e-5 * np.abs(rate).max())
    np.testing.assert_allclose(
        states.acceleration[core], acceleration[middle][core], atol=1e-4 * np.abs(acceleration).max()
    )
    assert states.replicate is None and states.method == "broadband"
    assert set(states.block) == set(range(32))
    # Where it moves, the sign of its rate is right.
    assert np.all(np.sign(states.rate[states.moving]) == np.sign(rate[middle][states.moving]))
    assert states.moving_fraction > 0.8


def test_noise_of_a_sweep_is_measured():
    states = broadband_states(sweep(noise=0.01)[0])
    run, angle, rate, acceleration = sweep()
    assert states.noise.angle == pytest.approx(0.01 * angle.std(), rel=0.05)
    assert states.noise.moment == pytest.approx(0.01 * run.moment.std(), rel=0.05)
    middle = slice(round(states.time[0] * RATE), round(states.time[0] * RATE) + states.n_samples)
    # The claimed noise of the derivatives is that of the kernel under white noise: hold it against the known truth.
    for name, truth in (("rate", rate), ("acceleration", acceleration)):
        scatter = np.std(getattr(states, name) - truth[middle])
        # 20 %: smoothed noise has few independent samples, about 2·bandwidth·20 s
        assert getattr(states.noise, name) == pytest.approx(scatter, rel=0.2)


def test_measured_rate_is_used():
    run, angle, rate, acceleration = sweep()
    states = broadband_states(replace(run, rate=2 * rate))
    middle = slice(round(states.time[0] * RATE), round(states.time[0] * RATE) + states.n_samples)
    core = slice(500, -500)
    np.testing.assert_allclose(states.rate[core], 2 * rate[middle][core], atol=1e-4 * np.abs(rate).max())
    np.testing.assert_allclose(
        states.acceleration[core], 2 * acceleration[middle][core], atol=1e-3 * np.abs(acceleration).max()
    )


def test_a_record_too_short_is_refused():
    rng = np.random.default_rng(9)
    run = Run("short", rng.normal(size=40), rng.normal(size=40), 1000.0)
    with pytest.raises(
        InputError, match=r"run 'short': 40 samples are too few to differentiate; expected at least \d+"
    ):
        broadband_states(run)


def test_the_last_lines_of_a_motion_that_ends_abruptly_are_kept():
    """25 tones up to 8 Hz: the kernel falls beyond the last one. Before it had room, 11 % of the motion were lost."""
    rng = np.random.default_rng(4)
    time = np.arange(40_000) / 400.0
    tones, phases = rng.uniform(1, 8, 25), rng.uniform(0, 2 * np.pi, 25)
    angle = np.sum([np.sin(2 * np.pi * f * time + p) for f, p in zip(tones, phases, strict=True)], axis=0)
    noisy = angle + 5e-3 * np.std(angle) * rng.standard_normal(time.size)
    states = broadband_states(Run("tones", 2 * angle + np.sin(time), noisy, 400.0))
    first = round(states.time[0] * 400.0)
    error = states.angle - angle[first : first + states.n_samples]
    assert 8.0 < states.bandwidth < 11.0
    assert np.std(error) < 0.03 * np.std(angle)


def skirted(level, seed):
    """Return noise of an RMS that fades towards the end of its spectrum, as behind a filter: it shows no floor."""
    sections = butter(2, 0.25, output="sos")
    made = sosfilt(sections, np.random.default_rng(seed).standard_normal(N))
    return level * made / made.std()


@pytest.mark.parametrize("memory", [0.0, 0.1])
def test_samples_of_one_state_bound_a_noise_that_shows_nowhere(memory):
    """Within a tenth of the truth (1 % here); of a joint with memory it is an upper bound only."""
    angle = smooth(6.0)
    rate = np.gradient(angle, 1 / RATE)
    # What remembers: a Maxwell element's lag, of the share ``memory``.
    lagged = sosfilt(butter(1, 2.0, fs=RATE, output="sos"), angle)
    law = angle + 0.3 * angle**3 + 0.005 * rate + memory * lagged
    for level in (0.01, 0.04):
        moment = law + level * law.std() * skirted(1.0, 11)
        run = Run("r", sample_rate=RATE, angle=angle + 1e-4 * skirted(1.0, 12), moment=moment)
        (states,) = states_of(Campaign(Joint("j", inertia=0.0), (run,)), [run])
        floor = moment_floor([states], 0.0, bounded=True)
        assert floor.bound and "at most" in floor.words
        low, high = 0.9, np.inf if memory else 1.1
        assert low * level < floor.relative < high * level


def test_a_single_sweep_through_each_state_bounds_nothing():
    """No state comes back: the data do not show how far they repeat."""
    time = np.arange(N) / RATE
    angle = np.exp(-0.15 * time) * np.cos(2 * np.pi * 1.0 * time)
    moment = 2 * angle + skirted(0.01, 13)
    run = Run("r", sample_rate=RATE, angle=angle, moment=moment)
    (states,) = states_of(Campaign(Joint("j", inertia=0.0), (run,)), [run])
    assert states.noise.at_most is None
