"""Steady runs held against each other: which departs by itself, and what is the joint's."""

import numpy as np
import pytest

from sindyjoint.soundness.law.motions import MOST_HARMONICS, POINTS, cycles_of
from sindyjoint.soundness.law.odd_runs import Held, find_odd_runs, find_other_scales
from sindyjoint.soundness.words import words_of

PHASE = 2 * np.pi * np.arange(POINTS) / POINTS
PLAN = [(f, level) for f in (3.0, 4.0, 6.0) for level in (1.0, 2.0, 3.0)]


def runs_of(extra, plan):
    """Return runs at frequencies and levels; ``extra`` adds to moments of 1 to 3 Nm."""
    moments, angles = [], []
    for frequency, level in plan:
        angle, rate = level * np.sin(PHASE), level * frequency * np.cos(PHASE)
        moment = angle - 0.02 * angle**3 + 0.03 * rate + 0.1 * np.sign(rate)
        moments.append(np.fft.rfft(moment + extra(frequency, level, angle, rate)) / POINTS)
        angles.append(np.fft.rfft(angle) / POINTS)
    names = tuple(f"{f:g} Hz {level:g}" for f, level in plan)
    harmonics = np.array([moments, angles])[:, :, : MOST_HARMONICS + 1]
    return cycles_of(names, np.array([f for f, _ in plan]), harmonics, np.zeros((len(plan), POINTS, 0)))


def told(extra, plan=PLAN):
    found, _ = find_odd_runs(runs_of(extra, plan), 0.0, words_of("rotation"))
    return [(f.id, f.run) for f in found]


def only(frequency, level, law):
    return lambda f, x, a, v: law(a, v) if (f, x) == (frequency, level) else 0.0


def cusp(a, v):
    return 0.3 * np.abs(a)


@pytest.mark.parametrize("run", [(4.0, 2.0), (3.0, 1.0)])
def test_a_run_that_departs_within_the_range_of_the_others_differs(run):
    assert told(only(*run, cusp)) == [("run_differs", f"{run[0]:g} Hz {run[1]:g}")]


def test_what_all_runs_of_a_frequency_show_is_the_joints():
    plan = [(f, level) for f, level in PLAN if level < 3]
    assert told(lambda f, x, a, v: 0.1 * x**1.6 * np.sin(3 * PHASE) if f == 4 else 0.0, plan) == []


@pytest.mark.parametrize(
    ("alike", "frequency", "level", "departs"),
    [
        (PLAN, 4.0, 2.0, True),
        ([(f, x) for f, x in PLAN if x < 3], 6.0, 3.0, False),  # beyond the range of the others
        (
            [(f, x) for f, x in PLAN if x > 1],
            3.0,
            1.0,
            False,
        ),  # smaller than any other: a memory depends on it
        ([(4.0, 3.0), (6.0, 1.0)], 4.0, 2.0, False),  # any of three may be the odd one
        ([(f, x) for f, x in PLAN if x < 3], 4.0, 60.0, True),  # another unit, not the edge of a range
    ],
)
def test_a_run_departs_where_the_others_can_say_what_is_expected(alike, frequency, level, departs):
    plan = [*(a for a in alike if a != (frequency, level)), (frequency, level)]
    runs = runs_of(only(frequency, level, cusp), plan)
    held = Held(runs, tuple(range(len(plan) - 1)), 0.0, 0.001)
    assert held.departs(len(plan) - 1) is departs


def test_the_lag_of_one_run_is_told_even_where_it_swings_furthest():
    late = 2 * np.pi * 6.0 * 6e-3

    def shifted(f, level, a, v):
        if (f, level) != (6.0, 3.0):
            return 0.0
        angle, rate = level * np.sin(PHASE - late), level * f * np.cos(PHASE - late)
        return angle - a - 0.02 * (angle**3 - a**3) + 0.03 * (rate - v) + 0.1 * (np.sign(rate) - np.sign(v))

    assert told(shifted) == [("channel_delay", "6 Hz 3")]


@pytest.mark.parametrize("odd", [(2,), (0, 4, 7), (1, 3, 5, 8)])
@pytest.mark.parametrize(
    ("factor", "mistake"), [(180 / np.pi, "rad and deg"), (1e-3, "a unit and its thousandth")]
)
def test_runs_in_another_unit_are_named_with_the_mistake(odd, factor, mistake):
    gains = np.where(np.isin(np.arange(len(PLAN)), odd), factor, 1.0)
    runs = runs_of(lambda f, x, a, v: 0.0, PLAN).scaled("angle", gains)
    found, rest = find_other_scales(runs, 0.0, words_of("rotation"))
    assert [(f.id, f.run, f.channel) for f in found] == [
        ("gain_differs", runs.names[i], "angle") for i in odd
    ]
    assert all(mistake in f.extent for f in found) and len(rest) == len(PLAN) - len(odd)
