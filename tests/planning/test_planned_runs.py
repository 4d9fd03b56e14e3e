"""Levels keep every joint of a range within the limits; the chosen runs are the ones that tell most."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import planning as planned_runs
from sindyjoint.errors import InputError, SimulationError, UnknownNameError
from sindyjoint.limits import PLANNING, SOUNDNESS
from sindyjoint.mechanics import INTER_PANEL, Actuator, PaperLaw, tones
from sindyjoint.planning import (
    Choice,
    Information,
    PlannedRun,
    Sensors,
    best_runs,
    candidates,
    highest_level,
    like_law,
    like_model,
    motion,
    play,
    run_information,
)
from sindyjoint.record import Campaign, Joint
from sindyjoint.response import model_law
from sindyjoint.soundness import find_faults, main_line
from tests.equation.test_formula_evaluation import JENKINS, with_elements
from tests.made_models import paper_model

FIXED = {name: (value, value) for name, value in (("cubic_stiffness", -2.684e9), ("linear_damping", 48.13))}
RANGE = like_law(INTER_PANEL).narrowed({"linear_stiffness": (5000.0, 8000.0), **FIXED})
LAWS = [model_law(corner) for corner in RANGE.corners()]


def test_a_rough_idea_becomes_a_range():
    assert RANGE.model["linear_stiffness"].coefficient == 6500.0
    assert len(LAWS) == 8 and len(RANGE.draws(5)) == 5
    assert all(
        np.all((RANGE.low <= one.coefficients) & (one.coefficients <= RANGE.high)) for one in RANGE.draws(5)
    )
    with pytest.raises(UnknownNameError, match="the joint has no such term; it has linear_stiffness"):
        RANGE.narrowed({"stiffness": (1.0, 2.0)})
    with pytest.raises(InputError, match="expected two ascending finite numbers"):
        RANGE.narrowed({"linear_stiffness": (8000.0, 5000.0)})


@pytest.mark.parametrize("drive", ["moment", "angle"])
def test_waveforms_of_several_tones_are_offered_within_the_limits(drive):
    actuator = Actuator(drive, (2.0, 16.0), rate=0.01)
    few = replace(PLANNING, frequencies=2)
    runs, grid = candidates(LAWS[:2], LAWS[0], actuator, 10.0, "rad", few, ("two-tone-3", "sweep"))
    # Every tone within the band: the second one has three times the frequency, the last of a sweep eight times.
    assert {(run.waveform, run.frequency) for run in runs} == {
        ("two-tone-3", 2.0), ("two-tone-3", 5.33), ("sweep", 2.0)
    }  # fmt: skip
    assert {run.waveform for run in grid} == {"sine"} and len(runs) == 3 * len(PLANNING.levels)
    for run in runs:
        moved = motion(LAWS[0], drive, run.frequency, run.level, waveform=run.waveform)
        assert np.abs(moved.rate).max() <= 0.01


@pytest.mark.parametrize("waveform, duration", [("triangle", 10.0), ("sweep", 10.0), ("multisine", 10.0)])
def test_a_waveform_without_room_in_the_band_or_the_run_is_refused(waveform, duration):
    with pytest.raises(InputError, match=f"waveform {waveform} drives from .* no room for it from 2 to 8 Hz"):
        candidates(LAWS[:1], LAWS[0], Actuator("angle", (2.0, 8.0)), duration, "rad", PLANNING, (waveform,))


def test_a_sweep_passes_from_its_frequency_to_five_times_that_and_back():
    """Its series is that of sin(3x − 2 sin x): the phase of a sine whose frequency is 3 − 2 cos x."""
    time = np.linspace(0.0, 1.0, 2001)
    x = 2 * np.pi * 0.5 * time
    assert tones("sweep", 2.0, 0.5)(time) == pytest.approx(2 * np.sin(3 * x - 2 * np.sin(x)), abs=6e-3)


def test_a_model_is_a_range_of_its_errors():
    model = paper_model()
    known = like_model(model)
    assert known.high - known.low == pytest.approx(2 * PLANNING.significant * model.standard_errors)


def test_elements_of_a_model_act_in_the_limits_and_in_what_a_run_tells():
    whole = with_elements(JENKINS)
    joint, model = like_model(whole), whole.without_elements()
    laws = [model_law(one) for one in joint.corners()]
    assert all(len(one.elements) == 1 for one in joint.draws(3))
    actuator = Actuator("angle", (4.0, 4.0), moment=4.0)
    # The slider takes its part of the moment, 0.3 N*m of 4.
    alone = highest_level([model_law(one) for one in like_model(model).corners()], actuator, 4.0)
    assert highest_level(laws, actuator, 4.0) == pytest.approx(0.85 * alone, rel=0.1)
    run = PlannedRun("angle", "sine", 4.0, 4e-4, "rad", 5.0)
    told, plain = (run_information(run, one, Sensors(500.0)) for one in (joint.model, model))
    # Its moment is no error of the terms; what the terms make of the motion is the same.
    assert told.bread == pytest.approx(plain.bread)


@pytest.mark.parametrize(
    "limits", [{}, {"moment": 3.5}, {"angle": 3e-4}, {"rate": 0.01}], ids=lambda limits: str(limits)
)
@pytest.mark.parametrize("drive", ["moment", "angle"])
def test_the_highest_level_keeps_every_joint_within_the_limits_and_no_less(drive, limits):
    actuator = Actuator(drive, (4.0, 4.0), **limits)
    level = highest_level(LAWS, actuator, 4.0)
    used = []
    # Also of joints that are not at the corners.
    for law in (*LAWS, *(model_law(one) for one in RANGE.draws(6, 3))):
        moved = motion(law, drive, 4.0, level)
        shares = [np.abs(getattr(moved, name)).max() / getattr(actuator, name) for name in limits]
        shares += [
            moved.angle.max() / law.softening_limit[1],
            moved.angle.min() / law.softening_limit[0],
        ]
        used.append(max(shares))
    assert 0.9 < max(used) < 1.0


def test_without_any_limit_there_is_no_highest_level():
    with pytest.raises(InputError, match="give the largest moment, angle or rate"):
        highest_level([PaperLaw(6000.0, c1=40.0)], Actuator("angle", (4.0, 4.0)), 4.0)


def test_a_level_at_which_the_joint_does_not_repeat_is_passed_over(monkeypatch):
    actuator = Actuator("moment", (4.0, 4.0), moment=4.0)
    whole, _ = candidates([INTER_PANEL], INTER_PANEL, actuator, 5.0, "N*m")
    refused = []

    def sometimes(law, drive, frequency, level, *given, **options):
        if not refused and level > 1.0:
            refused.append(level)
            raise SimulationError("the joint does not repeat")
        return motion(law, drive, frequency, level, *given, **options)

    monkeypatch.setattr(planned_runs, "motion", sometimes)
    some, _ = candidates([INTER_PANEL], INTER_PANEL, actuator, 5.0, "N*m")
    assert refused and len(some) == len(whole)
    # The curve from moment to angle has one point less.
    assert [r.level for r in some] == pytest.approx([r.level for r in whole], rel=0.2)


def test_runs_lie_in_the_band_and_the_grid_is_three_by_three():
    offered, grid = candidates(LAWS[:2], LAWS[0], Actuator("angle", (2.0, 8.0)), 10.0, "rad")
    assert {run.frequency for run in grid} == {2.0, 5.0, 8.0} and len(grid) == 9
    assert all(2.0 <= run.frequency <= 8.0 for run in offered)
    top = max(run.level for run in grid)
    assert {round(run.level / top, 2) for run in grid} == set(PLANNING.levels[::2])


@pytest.mark.parametrize("given, text", [
    ({"drive": "force"}, "expected 'moment' or 'angle'"),
    ({"band": (8.0, 2.0)}, "two ascending positive frequencies"),
    ({"rate": 0.0}, "limit of the rate is 0.0"),
])  # fmt: skip
def test_an_actuator_that_cannot_be_is_refused(given, text):
    with pytest.raises(InputError, match=text):
        Actuator(**given)


def choice(strength, **options):
    """Runs at three frequencies and five levels that tell so much of one coefficient."""
    runs = [PlannedRun("angle", "sine", f, 1.0, "rad", 1.0) for f in (2.0, 4.0, 8.0) for _ in PLANNING.levels]
    gram = np.array(strength, dtype=float)[:, None, None, None]
    told = Information(gram, gram, np.full((15, 1), 8.0))
    return Choice(tuple(runs), told, np.ones((1, 1)), (0,), **options)


def test_the_most_telling_runs_are_chosen_at_three_frequencies_with_two_levels_each():
    strength = np.ones(15)
    strength[6] = 3.0
    found = choice(strength)
    runs = best_runs(found, 8)
    # Five settings more are asked for, which leaves the best one three runs of eight.
    assert found.missing(runs) == 0 and runs.count(6) == 3
    # What was measured before counts where a plan has too few runs for all of that; half of them are at a frequency.
    known = [(f, level) for f in (2.0, 4.0, 8.0) for level in "01"]
    before = Information(*(np.ones((6, 1, 1, 1)),) * 2, np.full((6, 1), 8.0))
    assert best_runs(choice(strength, known=before, known_runs=tuple(known)), 4).count(6) == 2


def test_the_high_tone_of_a_planned_run_is_no_disagreement_of_its_channels():
    """Friction changes its sign with the faster tone: the strongest line of the moment is there."""
    run = play(
        INTER_PANEL, [PlannedRun("angle", "two-tone-3", 8.0, 6e-5, "rad", 4.0)], Sensors(2000.0, 0.01)
    ).runs[0]
    moment, share = main_line(run.moment, run.sample_rate, 8.0)
    assert moment == pytest.approx(24.0) and share < SOUNDNESS.unknown
    assert not {each.id for each in find_faults(Campaign(Joint(), (run,)))} & {"channels_disagree"}
    slow = replace(run, angle=6e-5 * np.sin(2 * np.pi * 8.0 * run.time))
    assert "channels_disagree" in {each.id for each in find_faults(Campaign(Joint(), (slow,)))}
