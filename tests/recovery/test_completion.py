"""States completed by the model: few samples a period, heavy joints, smoothed runs."""

from dataclasses import replace

import numpy as np
import pytest
import sympy
from random_joints import TRUE_IDS, aperiodic_campaign, random_plan

from sindyjoint import discover, simulate
from sindyjoint.mechanics import INTER_PANEL
from sindyjoint.mechanics.laws import FormulaLaw
from sindyjoint.paper import TERMS as PAPER_TERMS

INERTIA = 1.5
HEAVY = replace(INTER_PANEL, inertia=INERTIA)
TESTED = dict(noise=0.01, levels=(0.85, 0.6, 0.4), duration=5.0, random_state=1)
RATE = sympy.Symbol("omega", real=True)
DAMPING = FormulaLaw(sympy.Symbol("a") * RATE * sympy.Abs(RATE), {"a": 400.0})


def scores(found, truth):
    """Return the errors of coefficients in standard errors, and in per cent."""
    terms = [found.model[term] for term in TRUE_IDS]
    error = np.array([t.coefficient for t in terms]) - truth
    return np.abs(error / [t.standard_error for t in terms]), 100 * np.abs(error / truth)


@pytest.mark.parametrize("seed", [3, 9, 7])
def test_ten_to_twenty_samples_a_period(seed):
    """Joints driven by the moment and by an exciter; 15 of these: 0.4 % in the RMS where it was 2 % as measured."""
    plan = random_plan(seed, sample_rate=60.0, duration=10.0)
    found = discover(plan.campaign(0.002))
    assert found.model.ids == TRUE_IDS and found.verdict.verdict == "confirmed"
    z, per_cent = scores(found, plan.truth)
    assert z.max() < 4 and per_cent[[0, 2, 3, 4]].max() < 1.0


def test_as_measured_the_joint_is_outside_its_intervals_there():
    """Negative control."""
    plan = random_plan(9, sample_rate=60.0, duration=10.0)
    found = discover(plan.campaign(0.002), library="paper", correct=False)
    z, per_cent = scores(found, plan.truth)
    assert z.max() > 5 and per_cent[3] > 1.0


@pytest.mark.parametrize("seed", [0, 2])
def test_sweeps_are_completed(seed):
    """Of a moment that drives, and of a prescribed motion; as measured friction is some errors off."""
    plan = random_plan(seed, sample_rate=1000.0)
    campaign = aperiodic_campaign(plan, 0.01, "sweep")
    z, _ = scores(discover(campaign), plan.truth)
    plain, _ = scores(discover(campaign, correct=False), plan.truth)
    assert z.max() < 4 < plain.max()


@pytest.mark.parametrize("declared", [True, False])
def test_a_heavy_joint_that_sticks_is_confirmed(declared):
    """Its acceleration jumps, and the harmonics below the noise matter to the moment: eight of eight such campaigns."""
    given = simulate(HEAVY, **TESTED)
    if not declared:
        given = replace(given, joint=replace(given.joint, inertia=None))
    found = discover(given)
    assert found.verdict.verdict == "confirmed" and all(state.completed for state in found.states)
    # The negative control: noise and ringing of the acceleration are taken for a misfit.
    assert discover(given, correct=False).model.fitted.misfit > 3 * found.model.fitted.misfit
    truth = dict(zip(PAPER_TERMS, HEAVY.parameters, strict=True)) | {"inertia": INERTIA}
    z = [(t.coefficient - truth[t.id]) / t.standard_error for t in found.model.terms]
    assert np.abs(z).max() < 4
    assert declared or found.model.inertia == pytest.approx(INERTIA, rel=0.02)


def test_an_effect_that_is_there_is_still_found():
    found = discover(simulate(HEAVY, hidden=DAMPING, **TESTED))
    assert found.states[0].completed
    assert found.verdict.verdict == "refuted" and set(found.verdict.extra) == {"quadratic_damping"}
