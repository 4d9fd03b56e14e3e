"""Numbers of an element with corners are those of the simulated response, which has corners where the joint has."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import INTER_PANEL, diagnose, virtual_campaign
from sindyjoint.diagnosis import load_effects, select_effects
from sindyjoint.diagnosis.campaign.designs import hidden_law
from sindyjoint.diagnosis.campaign.problem import CampaignProblem
from tests.diagnosis.hidden_effects import hide
from tests.seeds import seeds

FINER = 32  # the referee stops its sliders in steps of its samples


@pytest.fixture(scope="module")
def play():
    """A play hidden in a joint that a motion drives: every other run, 4 s at 500 Hz, 1 % noise."""
    hidden = hide("backlash_play", 13, 0.06, 0.01, sample_rate=FINER * 500.0, duration=4.0)
    runs = [
        replace(r, moment=r.moment[::FINER], angle=r.angle[::FINER], sample_rate=500.0)
        for r in hidden.campaign.runs[::2]
    ]
    return hidden.campaign.with_runs(tuple(runs)), dict(
        zip(("M_g", "gap", "ramp"), hidden.parameters, strict=True)
    )


def numbers(campaign):
    result = diagnose(campaign, effects=select_effects(load_effects(), ["backlash_play"]), advise=False)
    (element,) = result.whole.elements
    return {number.name: number for number in element.numbers}


def test_intervals_of_an_element_with_corners_hold_its_numbers(play, monkeypatch):
    campaign, truth = play
    found = numbers(campaign)
    assert all(found[n].interval95[0] <= value <= found[n].interval95[1] for n, value in truth.items())
    # Numbers along the mean period, corners rounded off, lie more than three standard errors off.
    monkeypatch.setattr(CampaignProblem, "better_simulated", False)
    biased = numbers(campaign)
    assert max(abs(biased[n].value - truth[n]) / biased[n].standard_error for n in truth) > 3


@seeds(5, 4)  # moved by a motion, by a moment
def test_a_delay_beside_an_element_leaves_their_numbers_right(seed):
    hidden = hide("jenkins_element+channel_delay", seed, duration=3.0)
    campaign = hidden.campaign.with_runs(hidden.campaign.runs[::3])
    effects = select_effects(load_effects(), ["jenkins_element", "channel_delay"])
    found = diagnose(campaign, effects=effects, advise=False)
    assert {step.effect for step in found.steps} == {effect.id for effect in effects}
    (delay,) = found.test.nuisances
    damping = found.whole["linear_damping"]
    assert abs(delay.number.value - hidden.parameters[0]) < 3 * delay.number.standard_error
    assert abs(damping.coefficient - hidden.plan.law.c1) < 3 * damping.standard_error
    assert found.final.response < 1.5 * found.noise_floor.response


@pytest.mark.parametrize(
    ("name", "inertia"), [("jenkins_element", 0.02), ("jenkins_element", None), ("backlash_play", 0.02)]
)
def test_the_form_of_an_element_is_that_of_the_simulated_response(name, inertia):
    # 1 % of noise hides the harmonics of the corners. Along the rest Bouc and Wen's law and Iwan's are as good as the
    # Jenkins element, and play is a Maxwell branch, an inertia error and a Jenkins element (seed 3).
    generator, frequencies = np.random.default_rng(3), [3.0, 5.0]
    law = hidden_law(name, INTER_PANEL, 0.92 * INTER_PANEL.softening_angle, frequencies, generator)
    made = {"frequencies": frequencies, "noise": 0.01, "duration": 4.0, "sample_rate": 500.0}
    campaign = virtual_campaign(hidden=law, rng=generator, **made)
    # Where the inertia is not declared the law without the element cannot be simulated.
    campaign = replace(campaign, joint=replace(campaign.joint, inertia=inertia))
    found = diagnose(campaign, advise=False)
    (step,) = found.steps
    assert found.verdict == "named" and step.members == (name,) and step.probability > 0.9
    numbers = {number.name: number for number in found.whole.elements[0].numbers}
    for name, value in law.parameters.items():
        number = numbers.get(name.removeprefix("p0_"))
        # Within four standard errors: two elements of three numbers.
        assert number is None or abs(number.value - value) < 4 * number.standard_error
