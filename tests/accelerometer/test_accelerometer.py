"""The angle from an accelerometer, alone or beside other sensors: closed forms, noise, drift, zero frequency."""

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.measurement import (
    averaged,
    disagreement,
    fuse,
    integrated_twice,
    measured_run,
    sensor_noise,
    with_channels,
)
from sindyjoint.record import MEASURED_ANGLE, Campaign, Joint
from sindyjoint.soundness import find_disagreement, record_of, words_of
from sindyjoint.states import force_states

RATE, FREQUENCY = 1000.0, 4.0
TIME = np.arange(8000) / RATE
ANGULAR = 2 * np.pi * FREQUENCY


def motion(parts=((1, 0.01, 0.0), (2, 1e-4, 0.4), (3, 5e-4, 1.0))):
    """Return angle, rate and acceleration of a sum of harmonics."""
    phase = [order * ANGULAR * TIME + lag for order, _, lag in parts]
    angle = sum(size * np.sin(p) for (_, size, _), p in zip(parts, phase, strict=True))
    rate = sum(order * ANGULAR * size * np.cos(p) for (order, size, _), p in zip(parts, phase, strict=True))
    return (
        angle,
        rate,
        -sum(
            (order * ANGULAR) ** 2 * size * np.sin(p)
            for (order, size, _), p in zip(parts, phase, strict=True)
        ),
    )


def run_of(moment, acceleration, angle=None, frequency=FREQUENCY):
    signals = {"moment": moment, "acceleration": acceleration} | ({} if angle is None else {"angle": angle})
    return measured_run("r", signals, RATE, frequency=frequency)


def noisy(signal, share, seed):
    return signal + share * np.std(signal) * np.random.default_rng(seed).standard_normal(signal.size)


def error(found, true):
    return np.std(found - true) / np.std(true)


def test_integrated_samples_of_a_sine_are_exact_even_near_the_nyquist_frequency():
    angular = 2 * np.pi * 0.3 * RATE
    path = integrated_twice(-(angular**2) * np.sin(angular * TIME), 1 / RATE)
    # The ends, where the record says nothing of how it goes on, and with them the straight line, are not compared.
    middle = slice(1000, -1000)
    apart = (path - np.sin(angular * TIME))[middle]
    line = np.polyval(np.polyfit(TIME[middle], apart, 1), TIME[middle])
    assert np.std(apart - line) < 2e-3
    naive = np.cumsum(np.cumsum(-(angular**2) * np.sin(angular * TIME))) / RATE**2
    assert np.std(naive[middle] - np.polyval(np.polyfit(TIME, naive, 1), TIME[middle])) > 0.3


@pytest.mark.parametrize("offset", [0.0, 9.81])
def test_the_acceleration_alone_gives_the_angle_about_its_mean(offset):
    angle, _, acceleration = motion()
    moment, found, fusion = fuse(60 * angle + 0.3, acceleration + offset, RATE, frequency=FREQUENCY)
    assert error(found, angle) < 1e-4
    assert not fusion.mean_known
    assert np.array_equal(moment, 60 * angle + 0.3)
    assert np.mean(found) == pytest.approx(0.3 / 60, rel=1e-3)


def test_the_angle_is_counted_from_where_the_elastic_moment_is_zero():
    angle, _, acceleration = motion()
    true = angle + 0.002
    law = 60 * true + 900 * true**2 - 4e4 * true**3 + 0.3 * np.sign(np.gradient(true))
    moment, found, fusion = fuse(law, acceleration, RATE, frequency=FREQUENCY)
    assert fusion.placed and fusion.constant == 0
    assert found == pytest.approx(true, abs=2e-5)
    assert np.array_equal(moment, law)


def test_without_a_stiffness_the_constant_part_is_taken_off():
    angle, rate, acceleration = motion()
    moment, found, fusion = fuse(0.5 * rate + 0.3, acceleration, RATE, frequency=FREQUENCY)
    assert not fusion.placed and fusion.constant == pytest.approx(0.3, rel=1e-2)
    assert np.mean(found) == pytest.approx(0, abs=1e-9)
    assert moment == pytest.approx(0.5 * rate, abs=3e-3)


def test_without_noise_the_fused_angle_is_the_measured_one():
    angle, rate, acceleration = motion()
    for sensors in ({"angle": angle}, {"angle": angle, "rate": rate}):
        moment, found, fusion = fuse(60 * angle, acceleration, RATE, frequency=FREQUENCY, **sensors)
        assert fusion.mean_known
        assert fusion.constant == 0
        assert error(found, angle) < 1e-6
        assert np.array_equal(moment, 60 * angle)


def test_a_known_mean_angle_stays():
    angle, _, acceleration = motion()
    _, found, fusion = fuse(angle, acceleration, RATE, angle=noisy(angle, 0.01, 1) + 0.004)
    assert fusion.mean_known
    assert np.mean(found) == pytest.approx(0.004, rel=1e-2)


def test_the_fused_angle_is_better_than_either_sensor():
    angle, rate, acceleration = motion()
    seen, shown = noisy(acceleration, 0.01, 2), noisy(angle, 0.01, 3)
    alone = error(fuse(angle, seen, RATE, frequency=FREQUENCY)[1], angle)
    both = error(fuse(angle, seen, RATE, angle=shown, frequency=FREQUENCY)[1], angle)
    three = error(
        fuse(angle, seen, RATE, angle=shown, rate=noisy(rate, 0.01, 4), frequency=FREQUENCY)[1], angle
    )
    # By the noise densities: 0.16 of a per cent of single samples' noise in the angle alone.
    assert three < both < min(alone, 0.01 / 5)
    assert alone < 0.01 / 3


def test_the_noise_of_both_sensors_and_the_drift_are_measured():
    angle, _, acceleration = motion()
    walk = np.cumsum(np.random.default_rng(5).standard_normal(TIME.size)) * 1e-5
    shown, seen = noisy(angle, 0.02, 6) + walk, noisy(acceleration, 0.005, 7)
    path = integrated_twice(seen - seen.mean(), 1 / RATE)
    expected = 0.005 * np.std(acceleration), 0.02 * np.std(angle), 1e-5
    # Of the drift only what stands out of the acceleration's noise is seen, which it hides in turn.
    assert sensor_noise(shown, path, RATE)[1:] == pytest.approx(expected[1:], rel=0.5)
    assert sensor_noise(shown - walk, path, RATE)[:2] == pytest.approx(expected[:2], rel=0.1)
    fusion = fuse(angle, seen, RATE, angle=shown, frequency=FREQUENCY)[2]
    assert expected[0] / 2 < fusion.noise < 1.5 * expected[0]


def test_a_drift_of_the_displacement_sensor_does_no_harm():
    angle, _, acceleration = motion()
    walk = np.cumsum(np.random.default_rng(8).standard_normal(TIME.size)) / np.sqrt(TIME.size)
    drift = 0.5 * np.std(angle) * (walk + TIME / TIME[-1])
    shown = noisy(angle, 0.01, 9) + drift
    _, found, fusion = fuse(angle, noisy(acceleration, 0.01, 10), RATE, angle=shown, frequency=FREQUENCY)
    assert not fusion.mean_known
    assert error(found, angle) < 5e-3
    assert error(shown, angle) > 0.15


def test_states_have_the_noise_of_the_sensors():
    angle, _, acceleration = motion()
    quiet, loud = (
        force_states(run_of(noisy(60 * angle, 0.01, 1), noisy(acceleration, share, 2)))
        for share in (0.01, 0.05)
    )
    assert loud.noise.acceleration == pytest.approx(5 * quiet.noise.acceleration, rel=0.5)
    assert error(quiet.acceleration, motion()[2][-quiet.n_samples :]) < 0.01


@pytest.mark.parametrize("beside", [False, True])
def test_a_run_that_does_not_repeat(beside):
    phase = 2 * np.pi * (2 * TIME + 0.75 * TIME**2)
    rate = 2 * np.pi * (2 + 1.5 * TIME)
    angle = 0.01 * np.sin(phase)
    acceleration = 0.01 * (-(rate**2) * np.sin(phase) + 3 * np.pi * np.cos(phase))
    shown = noisy(angle, 0.01, 3) if beside else None
    run = run_of(60 * angle, noisy(acceleration, 0.01, 4), shown, None)
    states = force_states(run)
    assert states.method == "broadband"
    kept = np.round(states.time * RATE).astype(int)
    assert error(states.acceleration, acceleration[kept]) < 0.02
    assert error(states.angle, angle[kept]) < 0.05
    # What is said of the noise is what it is.
    actual = np.std(states.acceleration - acceleration[kept])
    assert states.noise.acceleration == pytest.approx(actual, rel=0.5)


def test_a_running_mean_over_a_period_leaves_no_harmonic_and_follows_what_is_slow():
    angle, *_ = motion()
    slow = 0.3 * TIME
    assert averaged(angle + slow, RATE / FREQUENCY)[500:-500] == pytest.approx(slow[500:-500], abs=1e-6)
    assert averaged(slow, 237.4) == pytest.approx(slow, abs=1e-6)


@pytest.mark.parametrize(("gain", "delay"), [(1.0, 0.0), (1.1, 0.0), (-1.0, 0.0), (1.0, 2e-3)])
def test_gain_and_delay_between_the_sensors_are_found(gain, delay):
    angle, _, acceleration = motion()
    late = np.interp(TIME - delay, TIME, acceleration)
    run = run_of(60 * angle, noisy(gain * late, 0.01, 1), angle=noisy(angle, 0.01, 2))
    fusion = run.fusion
    found = disagreement(fusion.angle, fusion.acceleration, RATE, fusion.angle_noise, fusion.noise)
    assert found[0] == pytest.approx(gain, abs=5e-3)
    assert found[2] == pytest.approx(delay, abs=5e-5)
    findings = list(find_disagreement(record_of(run), words_of("rotation")))
    expected = [] if (gain, delay) == (1.0, 0.0) else ["stops" if gain < 0 else "biases"]
    assert [each.severity for each in findings] == expected
    if delay:
        assert "delay = '2 ms'" in findings[0].remedy


def test_a_repaired_channel_is_fused_anew():
    angle, _, acceleration = motion()
    spiked = noisy(acceleration, 0.01, 1)
    spiked[4000] += 300 * np.std(acceleration)
    run = run_of(60 * angle, spiked, angle=noisy(angle, 0.01, 2))
    mended = with_channels(run, {"acceleration": noisy(acceleration, 0.01, 1)})
    assert error(mended.angle, angle) < error(run.angle, angle)
    assert set(mended.channels) == {"moment", "angle", "acceleration", MEASURED_ANGLE}


def test_what_is_not_known_is_said():
    angle, _, acceleration = motion()
    run = run_of(60 * angle + 0.3, acceleration)
    campaign = Campaign(Joint(), (run,))
    assert not campaign.mean_known
    (line,) = campaign.warnings
    for part in (
        "mean angle is not known",
        "accelerometer does not see it",
        "preload",
        "where the elastic moment is zero",
        "k1 + 2·k2·θ0",
    ):
        assert part in line


def test_channels_of_different_lengths_are_refused():
    with pytest.raises(InputError, match="moment has 100 samples, acceleration has 99 samples"):
        run_of(np.ones(100), np.ones(99))
