"""A run whose moment comes late: by a delay, by a low-pass, and where its harmonics do not tell which."""

import re

import numpy as np
import pytest

from sindyjoint.record import Campaign, Joint, Run
from tests.soundness.faults import findings_of

RATE, TIME = 1000.0, np.arange(0, 4, 1e-3)


def found(response):
    """Return what is said of nine runs of a joint, the moment of one of them passed through a filter."""
    rng, runs = np.random.default_rng(4), []
    for frequency in (2.0, 4.0, 6.0):
        for size in (0.6e-3, 1e-3, 1.4e-3):
            turn = 2 * np.pi * frequency
            angle, rate = size * np.sin(turn * TIME), size * turn * np.cos(turn * TIME)
            moment = 3000 * angle - 1.2e8 * angle**3 + 8 * rate + 0.6 * np.sign(rate)
            if len(runs) == 4:
                lines = 2j * np.pi * np.fft.rfftfreq(TIME.size, 1 / RATE)
                moment = np.fft.irfft(np.fft.rfft(moment) * response(lines), TIME.size)
            noisy = [x + 0.003 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
            runs.append(Run(f"{frequency:g} Hz {size}", *noisy, RATE, frequency=frequency))
    (finding,) = [f for f in findings_of(Campaign(Joint(inertia=0.0), tuple(runs))) if f.severity != "note"]
    assert (finding.run, finding.channel) == ("4 Hz 0.001", "moment")
    return finding


def test_a_low_pass_is_told_from_a_delay_by_the_harmonics():
    finding = found(lambda s: 1 / (1 + s / (2 * np.pi * 15)))
    assert finding.id == "low_pass" and "ms earlier" not in finding.extent
    (corner,) = re.findall(r"corner of ([0-9.]+) Hz on its moment", finding.extent)
    assert float(corner) == pytest.approx(15, rel=0.03)


def test_where_they_do_not_tell_both_are_said():
    finding = found(lambda s: 1 / (1 + 4e-3 * s))
    assert finding.id == "channel_delay" and "as its harmonics leave open" in finding.extent
    told = re.findall(r"comes ([0-9.]+) ms earlier or, .* corner of ([0-9.]+) Hz", finding.extent)
    assert np.array(told[0], float) == pytest.approx([4, 40], rel=0.05)


def test_a_delay_that_is_clear_is_called_one():
    finding = found(lambda s: np.exp(-4e-3 * s))
    assert finding.id == "channel_delay" and "low-pass" not in finding.extent
