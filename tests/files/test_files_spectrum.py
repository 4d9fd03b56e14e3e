"""The frequency check: it catches wrong frequencies and never accuses a good run."""

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.files import check_frequency
from sindyjoint.files.drafting.run import find_frequency


def held(angle, moment, rate, frequency) -> bool:
    try:
        check_frequency(angle, moment, rate, frequency, "f")
    except InputError as error:
        assert str(error).startswith(f"f: the declared frequency {frequency:g} Hz is absent from the data")
        return False
    return True


def hysteresis(frequency, rate=1000.0, seconds=10.0, noise=0.0, seed=0):
    """A joint driven at its angle: k θ + M_F sign θ̇, the friction as large as the elastic moment."""
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * frequency * np.arange(int(seconds * rate)) / rate
    angle, moment = np.sin(phase), np.sin(phase) + np.sign(np.cos(phase))
    return [x + noise * x.std() * rng.normal(size=x.size) for x in (angle, moment)]


@pytest.mark.parametrize("frequency", [0.5, 3.0, 4.0, 6.0, 33.3])
@pytest.mark.parametrize("noise", [0.0, 0.05, 1.0])
def test_the_right_frequency_is_found(frequency, noise):
    # At noise as large as the signal the line still stands high above the floor of 10 000 samples.
    assert held(*hysteresis(frequency, noise=noise), 1000.0, frequency)


@pytest.mark.parametrize("declared", [2.0, 2.5, 3.5, 4.0, 5.0, 6.0, 9.0, 12.0, 15.0, 60.0])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_wrong_frequency_is_refused_even_on_a_harmonic(declared, noise):
    assert not held(*hysteresis(3.0, noise=noise), 1000.0, declared)


def test_noise_alone_holds_no_frequency():
    # Seeds 0–49, none of which may pass: of 3000 such runs none reached a contrast of 6.
    for seed in range(50):
        rng = np.random.default_rng(seed)
        assert not held(*rng.normal(size=(2, 5000)), 1000.0, 5.0)


def test_a_slightly_mistuned_exciter_is_forgiven():
    assert held(*hysteresis(4.03), 1000.0, 4.0)


def test_drift_and_offset_do_not_hide_the_line():
    angle, moment = hysteresis(4.0)
    t = np.arange(angle.size) / 1000
    assert held(angle + 100 + 5 * t + 2 * t**2, moment - 30, 1000.0, 4.0)


def test_a_joint_that_sticks_shows_the_frequency_in_the_moment():
    rng = np.random.default_rng(4)
    _, moment = hysteresis(4.0)
    assert held(rng.normal(size=moment.size), moment, 1000.0, 4.0)
    assert not held(rng.normal(size=moment.size), None, 1000.0, 4.0)


def test_too_few_periods_are_not_judged():
    angle, moment = hysteresis(1.0, seconds=2.5)
    assert held(angle, moment, 1000.0, 1.2)


@pytest.mark.parametrize("periods", [3.1, 3.7, 4.5, 7.3])
def test_short_runs_are_not_accused(periods):
    assert held(*hysteresis(4.0, seconds=periods / 4), 1000.0, 4.0)


def test_the_message_names_the_channel_of_the_motion():
    time = np.arange(2000) / 200
    signal = np.sin(2 * np.pi * 4 * time)
    for motion, channel in (("rotation", "angle"), ("translation", "displacement")):
        with pytest.raises(InputError, match=f"the largest line of the {channel} is at 4 Hz"):
            check_frequency(signal, None, 200.0, 7.0, "f", motion)


@pytest.mark.parametrize("periods", [3.8, 4, 5])
def test_a_sine_of_few_periods_has_its_frequency(periods):
    # The cubic that is taken for drift takes a part of few periods, which is no change from one to the next.
    angle, moment = hysteresis(2.0, seconds=periods / 2, noise=0.01)
    assert find_frequency(angle, moment, 1000.0, "") == 2.0
    assert find_frequency(angle * np.linspace(0.2, 1, angle.size), moment, 1000.0, "") is None
