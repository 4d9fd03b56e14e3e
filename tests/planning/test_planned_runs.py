"""Levels keep every joint of a range within the limits; the chosen runs are the ones that tell most."""

import numpy as np
import pytest

from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.mechanics.laws import INTER_PANEL, PaperLaw, softening_limit
from sindyjoint.planning.information import Information
from sindyjoint.planning.joints import like_law, like_model
from sindyjoint.planning.policy import POLICY
from sindyjoint.planning.runs import Actuator, PlannedRun, candidates, highest_level, motion
from sindyjoint.planning.search import Choice, best_runs
from sindyjoint.response.model_law import model_law
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
    actuator = Actuator(drive, (4.0, 4.0), rate=0.01)
    runs, grid = candidates(LAWS[:2], LAWS[0], actuator, 10.0, "rad", waveforms=("two-tone-3", "triangle"))
    assert {run.waveform for run in runs} == {"two-tone-3", "triangle"} and len(runs) == 2 * len(
        POLICY.levels
    )
    assert {run.waveform for run in grid} == {"sine"}
    for run in runs:
        moved = motion(LAWS[0], drive, 4.0, run.level, waveform=run.waveform)
        assert np.abs(moved.rate).max() <= 0.01


def test_a_model_is_a_range_of_its_errors():
    model = paper_model()
    known = like_model(model)
    assert known.high - known.low == pytest.approx(2 * POLICY.model_errors * model.standard_errors)


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
            moved.angle.max() / softening_limit(law)[1],
            moved.angle.min() / softening_limit(law)[0],
        ]
        used.append(max(shares))
    assert 0.9 < max(used) < 1.0


def test_without_any_limit_there_is_no_highest_level():
    with pytest.raises(InputError, match="give the largest moment, angle or rate"):
        highest_level([PaperLaw(6000.0, c1=40.0)], Actuator("angle", (4.0, 4.0)), 4.0)


def test_runs_lie_in_the_band_and_the_grid_is_three_by_three():
    runs, grid = candidates(LAWS[:2], LAWS[0], Actuator("angle", (2.0, 8.0)), 10.0, "rad")
    assert {run.frequency for run in grid} == {2.0, 5.0, 8.0} and len(grid) == 9
    assert all(2.0 <= run.frequency <= 8.0 for run in runs)
    top = max(run.level for run in grid)
    assert {round(run.level / top, 2) for run in grid} == set(POLICY.grid_levels)


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
    runs = [PlannedRun("angle", "sine", f, 1.0, "rad", 1.0) for f in (2.0, 4.0, 8.0) for _ in POLICY.levels]
    gram = np.array(strength, dtype=float)[:, None, None, None]
    told = Information(gram, gram, np.zeros((15, 1, 1)), np.full((15, 1), 8.0))
    return Choice(tuple(runs), told, np.ones((1, 1)), (0,), **options)


def test_the_most_telling_runs_are_chosen_with_enough_frequencies_and_levels():
    strength = np.ones(15)
    strength[6] = 3.0
    found = choice(strength)
    runs = best_runs(found, 6)
    assert found.missing(runs) == 0 and runs.count(6) == 4
    # What was measured before counts.
    known = [(2.0, "0"), (4.0, "1"), (8.0, "2")]
    before = Information(*(np.ones((3, 1, 1, 1)),) * 2, np.zeros((3, 1, 1)), np.full((3, 1), 8.0))
    assert best_runs(choice(strength, known=before, known_runs=tuple(known)), 6) == [6] * 6
