"""The time axis: rounding is forgiven, irregularity is not; a delay filter as exact as it says."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.files import advanced, check_order, margin, resampled, uniform_rate


def row(index: int) -> str:
    return f"row {index + 1}"


def rate_of(time) -> float:
    check_order(np.asarray(time), "f", row)
    return uniform_rate(np.asarray(time, dtype=float), "f", row)


@pytest.mark.parametrize("rate", [100.0, 610.3515625, 750.0, 1000.0, 1024.0, 2048.0, 51200.0])
@pytest.mark.parametrize("start", [0.0, 12.3])
def test_exact_stamps_give_the_rate(rate, start):
    assert rate_of(start + np.arange(2000) / rate) == pytest.approx(rate, rel=1e-8)


@settings(deadline=None)
@example(rate=3844.875, digits=5, samples=64)  # least squares is further off than half a digit here
@given(
    rate=st.floats(20, 5000),
    digits=st.integers(3, 9),
    samples=st.integers(64, 3000),
)
def test_rounding_of_printed_stamps_is_forgiven(rate, digits, samples):
    time = np.round(np.arange(samples) / rate, digits)
    if 10.0**-digits > 0.25 / rate:
        return  # printed so coarsely that a lost sample would look the same
    # The ends are off by half a digit each; least squares does no worse than twice that.
    tolerance = 2 * 10.0**-digits / (samples / rate) + 1e-8
    assert rate_of(time) == pytest.approx(rate, rel=tolerance)


def test_single_precision_stamps_are_forgiven():
    # Single precision parts times above 32 s by 3.8e-6 s: 1.9 % of the step of 5 kHz.
    time = (np.arange(180_000) / 5000.0).astype(np.float32).astype(float)
    assert np.abs(np.diff(time) * 5000 - 1).max() > 0.01
    assert rate_of(time) == pytest.approx(5000.0, rel=1e-6)


@pytest.mark.parametrize("jitter", [0.03, 0.1, 0.4])
def test_jitter_is_refused(jitter):
    # Seed 1; uniform within ±jitter of a step, printed with seven digits.
    noise = np.random.default_rng(1).uniform(-jitter, jitter, 1000)
    time = np.round((np.arange(1000) + noise) / 1000, 7)
    with pytest.raises(
        InputError, match=r"f: sampling is irregular beyond 1 %, most in row \d+ .*resample = true"
    ):
        rate_of(time)


def test_jitter_below_one_percent_passes():
    noise = np.random.default_rng(1).uniform(-0.004, 0.004, 1000)
    assert rate_of((np.arange(1000) + noise) / 1000) == pytest.approx(1000, rel=1e-4)


def test_a_lost_sample_is_named():
    time = np.delete(np.arange(1000) / 1000, 400)
    with pytest.raises(InputError, match=r"most in row 401 \(step 0.002 s, median 0.001 s\)"):
        rate_of(time)


def test_a_clock_that_drifts_is_refused():
    # Each step is within 1 % of the next, yet the last stamps are several samples off any uniform grid.
    steps = np.linspace(0.995e-3, 1.005e-3, 10_000)
    with pytest.raises(InputError, match="irregular"):
        rate_of(np.cumsum(steps))


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        ([0, 1, 2, 1.5, 4], "f: time runs backwards in row 4 \\(1.5 s after 2 s\\)"),
        ([0, 1, 2, 2, 4], "f: duplicate time stamp in row 4 \\(2 s after 2 s\\)"),
        ([0], "f: 1 time stamp\\(s\\); expected a record"),
        ([], "f: 0 time stamp"),
    ],
)
def test_order(stamps, message):
    with pytest.raises(InputError, match=message):
        rate_of(stamps)


@settings(deadline=None)
@given(samples=st.floats(-40, 40), frequency=st.floats(0.001, 0.42), phase=st.floats(0, 6.28))
def test_delay_filter_shifts_a_sine_exactly(samples, frequency, phase):
    # 2e-6 is the ripple that the filter's Kaiser window allows up to 0.43 of the sampling rate.
    n = np.arange(400)
    lost = margin(samples)
    ahead = np.sin(2 * np.pi * frequency * (n + samples) + phase)
    shifted = advanced(np.sin(2 * np.pi * frequency * n + phase), samples)
    np.testing.assert_allclose(shifted, ahead[lost : n.size - lost], atol=5e-6)


def test_resampling_keeps_a_smooth_signal():
    # Seed 2. On even knots, 50 per period, cubic splines err by (2π/50)⁴/384 ≈ 6e-7 of the amplitude.
    rng = np.random.default_rng(2)
    time = np.arange(1000) / 200 + np.r_[0, rng.uniform(-2e-4, 2e-4, 998), 0]
    signals, rate = resampled(time, {"x": np.sin(2 * np.pi * 4 * time)}, "f", row)
    grid = time[0] + np.arange(signals["x"].size) / rate
    np.testing.assert_allclose(signals["x"], np.sin(2 * np.pi * 4 * grid), atol=1e-5)
    assert rate == pytest.approx(200, rel=1e-2)


def test_resampling_is_offered_and_works(bench):
    t = bench.columns["t"].copy()
    t[1:-1] += np.random.default_rng(3).uniform(-0.1, 0.1, size=t.size - 2) / 200
    phase = 2 * np.pi * 4 * t
    bench.table({"t": t, "m": 5 * np.sin(phase), "a": np.sin(phase - 0.3)})
    assert "set [channels] resample = true" in bench.refusal()
    bench.manifest(
        (bench.folder / "campaign.toml").read_text().replace("[channels]", "[channels]\nresample = true")
    )
    campaign = bench.load()
    run = campaign.runs[0]
    # The step is the median one, so the grid is known; 50 samples per period are good to 1e-4.
    np.testing.assert_allclose(run.moment, 5 * np.sin(2 * np.pi * 4 * run.time), atol=5e-4)
    assert any("run.csv: irregular samples were interpolated" in note for note in campaign.notes)


def test_a_gap_is_not_interpolated(bench):
    t = bench.columns["t"].copy()
    t[200:] += 0.5023
    bench.column("t", t)
    bench.manifest(
        (bench.folder / "campaign.toml").read_text().replace("[channels]", "[channels]\nresample = true")
    )
    assert "a gap of 0.5073 s before line 202 is too long to interpolate" in bench.refusal()


def test_declared_skew_is_removed(bench):
    # The moment lags by 1.7 ms, expected a third of a sample: 5 sin(ω(t − τ)) is recorded, 5 sin ωt.
    t = np.arange(2000) / 200.0
    omega, tau = 2 * np.pi * 4, 1.7e-3
    bench.table({"t": t, "m": 5 * np.sin(omega * (t - tau)), "a": np.sin(omega * t)})
    bench.manifest(
        (bench.folder / "campaign.toml").read_text().replace("[channels]", '[channels]\nskew = "1.7 ms"')
    )
    campaign = bench.load()
    run = campaign.runs[0]
    assert campaign.skew == pytest.approx(1.7e-3)
    np.testing.assert_allclose(run.moment, 5e3 * run.angle, atol=5e-5)
    assert 1900 < run.n_samples < 2000


def test_skew_on_a_short_run(bench):
    bench.replace("[channels]", '[channels]\nskew = "500 ms"')
    with pytest.raises(
        SindyJointError, match=r"\[channels\] skew: removing '500 ms' takes 132 samples from either"
    ):
        bench.load()
