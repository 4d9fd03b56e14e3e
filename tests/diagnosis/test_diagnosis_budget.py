"""The budget of a gap: parts that add up, and the largest is what was hidden.

Campaigns are those of tests/diagnosis/hidden_effects.py: an effect carries 6 % of the moment's RMS, noise is 1 %.
"""

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis import load_effects, select_effects
from sindyjoint.diagnosis.campaign.gap import gap_of, noise_floor
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.start import Work, cut_up, first_model
from sindyjoint.diagnosis.campaign.unnamed import make_budget, shares
from sindyjoint.limits import STATES
from sindyjoint.record import Run
from sindyjoint.states import campaign_states
from tests.diagnosis.hidden_effects import hide
from tests.seeds import seeds

PARTS = ("state", "history", "run", "processing", "noise")
KINDS = {
    "state": (
        "quintic_stiffness",
        "quadratic_damping",
        "stribeck_friction",
        "bilinear_stiffness",
        "dead_zone",
    ),
    "history": (
        "jenkins_element",
        "dahl_friction",
        "bouc_wen_hysteresis",
        "lugre_friction",
        "maxwell_branch",
    ),
    "run": ("stiffness_drift", "frequency_dependent_stiffness"),
    "noise": ("nothing",),
}


def work_on(campaign):
    states = campaign_states(campaign, rate_share=STATES.passing_rate_share)
    runs, parts, groups = cut_up(campaign.identification_runs, states)
    return Work.build(campaign, runs, parts, groups, first_model(campaign, parts, None, "paper").model)


def budget_of(campaign):
    work = work_on(campaign)
    total, noise = gap_of(work, work.model, ()).moment ** 2, noise_floor(work).moment ** 2
    return make_budget(GapRegression.build(work.rows, work.model), total, noise, 0.0), total


@seeds(1, 5)
@pytest.mark.parametrize("kind, name", [(kind, name) for kind, names in KINDS.items() for name in names])
def test_the_largest_part_is_of_the_kind_that_was_hidden(kind, name, seed):
    budget, total = budget_of(hide(name, seed).campaign)
    parts = {part: getattr(budget, part) for part in PARTS}
    assert min(parts.values()) >= 0 and sum(parts.values()) == pytest.approx(total, rel=1e-12)
    others = {part: value for part, value in parts.items() if part != "noise"}
    if kind == "noise":
        assert max(others.values()) == 0
    else:
        assert max(others, key=others.get) == kind and others[kind] > 0.5 * sum(others.values())


def test_a_drift_of_a_channel_is_of_the_run():
    drift = select_effects(load_effects(), ["moment_drift"])
    budget = diagnose(hide("moment_drift", 1).campaign, effects=drift, advise=False).budget
    assert budget.run > 0.9 * (budget.total - budget.noise)


def test_levels_tell_a_memory_from_a_function_of_the_state():
    """At one level a law without memory fits any loop; other levels refute it."""
    work = work_on(hide("jenkins_element", 5).campaign)
    credit = shares(GapRegression.build(work.rows, work.model), 0.1)
    assert credit["history"] > 0.8 > 0.3 > credit["state"] and sum(credit.values()) <= 1


def test_a_run_alone_has_a_budget_that_adds_up():
    campaign = hide("quadratic_damping", 1, duration=4.0).campaign
    budget, total = budget_of(campaign.with_runs(campaign.runs[:1]))
    assert budget.total == pytest.approx(total) and min(getattr(budget, p) for p in PARTS) >= 0


def test_runs_that_do_not_repeat_have_a_budget_too():
    """A cubic damping under random excitation of the angle, beside the same joint without it."""
    rng = np.random.default_rng(4)
    rate, n = 500.0, 4000
    time = np.arange(n) / rate
    found = {}
    for cubic in (0.0, 40.0):
        runs = []
        for index in range(3):
            frequencies, phases = rng.uniform(1, 5, 12), rng.uniform(0, 6.3, 12)
            w = 2 * np.pi * frequencies
            angle = 1e-4 * np.sin(np.outer(time, w) + phases).sum(axis=1)
            speed = 1e-4 * (np.cos(np.outer(time, w) + phases) * w).sum(axis=1)
            moment = 6000 * angle + 40 * speed + cubic * speed**3 / np.std(speed) ** 2 + 1.5 * np.sign(speed)
            runs.append(
                Run(
                    f"random-{index}",
                    *(x + 0.01 * np.std(x) * rng.standard_normal(n) for x in (moment, angle)),
                    rate,
                )
            )
        campaign = hide("nothing", 1).campaign
        budget, total = budget_of(campaign.with_runs(tuple(runs)))
        assert budget.total == pytest.approx(total) and min(getattr(budget, p) for p in PARTS) >= 0
        found[cubic] = budget
    assert found[40.0].state > 0.5 * found[40.0].total
    assert found[0.0].state < 0.1 * found[40.0].state


def test_a_drift_is_cut_to_what_noise_and_chain_leave():
    work = work_on(hide("nothing", 1, duration=4.0).campaign)
    budget = make_budget(GapRegression.build(work.rows, work.model), 1.0, 0.7, 0.2, drift=0.5)
    assert (budget.noise, budget.processing) == pytest.approx((0.7, 0.2)) and budget.run == pytest.approx(0.1)
