"""What physics does not admit: sliders that never yield, or with a negative stiffness."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.diagnosis import CAMPAIGN, load_effects
from sindyjoint.diagnosis.campaign import reference_scales
from sindyjoint.diagnosis.campaign.measure import CampaignEvidence
from sindyjoint.diagnosis.campaign.problem import CampaignProblem
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import sticks
from sindyjoint.mechanics import virtual_campaign

EFFECTS = {effect.id: effect for effect in load_effects()}


@pytest.fixture(scope="module")
def problem():
    campaign = virtual_campaign(
        "inter-panel", frequencies=[3.0, 5.0], levels=[0.8], noise=0.01, random_state=3
    )
    return CampaignProblem.build(campaign, None, "paper", tuple(EFFECTS.values()), CAMPAIGN)


def is_spring(name, values, rows, share=CAMPAIGN.sticking_share):
    return sticks(EFFECTS[name].variants[0], values, rows, share)


def test_a_slider_that_mostly_sticks_is_a_spring(problem):
    rows = problem.work.rows
    largest = max(np.abs(run.motion.angle).max() for run in rows)
    assert not is_spring("jenkins_element", [0.3 * largest], rows)
    assert is_spring("jenkins_element", [1.05 * largest], rows)
    assert not is_spring("dahl_friction", [1.05 * largest], rows)
    # Play whose slider never slips is a stop.
    assert is_spring("backlash_play", [largest, largest], rows)
    assert not is_spring("backlash_play", [0.3 * largest, 0.1 * largest], rows)


def test_the_policy_says_how_much_a_slider_may_stick(problem):
    """At a share below zero no slider is one, at one every slider is."""
    for share, there in ((-1.0, False), (1.0, True)):
        known = [EFFECTS["jenkins_element"], EFFECTS["cubic_damping"]]
        ev = CampaignEvidence(problem.work.plain, problem.work.model, known, (), share)
        names = {each.name for each in ev.candidates()}
        assert ("jenkins_element" in names) is there and "cubic_damping" in names


def test_little_half_cycles_between_pulls_do_not_make_a_slider_a_spring(problem):
    """Most half-cycles in number, hardly any of the way."""
    (row, *_) = problem.work.rows
    turns = np.linspace(0, 40 * np.pi, 4001)
    size = np.where(turns < 8 * np.pi, 1.0, 0.1)
    angle, rate = size * np.sin(turns), size * np.cos(turns)
    motion = replace(row.motion, angle=angle, rate=rate, acceleration=-angle)
    pulls = replace(row, motion=motion)
    assert not is_spring("jenkins_element", [0.3], [pulls])
    assert is_spring("jenkins_element", [1.05], [pulls])


def test_a_slider_whose_stiffness_would_be_negative_explains_nothing(problem):
    """A moment that is a Jenkins element upside down: the catalogue's sign leaves it no gain, whatever its corner."""
    (effect,) = [EFFECTS["jenkins_element"]]
    values = np.array([0.3 * reference_scales(problem.work.rows).angle])
    for sign, gains in ((1.0, True), (-1.0, False)):
        made = [
            replace(run, target=run.target + sign * 2e3 * effect.variants[0].along(run.motion, values)[:, 0])
            for run in problem.work.rows
        ]
        gain, (coefficient,) = GapRegression.build(made, problem.work.model).gain(effect.variants[0], values)
        assert (gain > 100) is gains and np.sign(coefficient) == sign
        if gains:
            assert coefficient == pytest.approx(2e3, rel=0.1)
