"""A heavy joint that sticks: its acceleration jumps, and the harmonics below the noise matter to the moment."""

from dataclasses import replace

import numpy as np
import pytest
import sympy

from sindyjoint import discover, simulate
from sindyjoint.bias.completion import completed_states
from sindyjoint.bias.policy import POLICY
from sindyjoint.mechanics import INTER_PANEL, FormulaLaw
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.states import campaign_states

INERTIA = 1.5
HEAVY = replace(INTER_PANEL, inertia=INERTIA)
TESTED = dict(noise=0.01, levels=(0.85, 0.6, 0.4), duration=5.0, random_state=1)
DAMPING = FormulaLaw(
    sympy.Symbol("a") * sympy.Symbol("omega", real=True) * sympy.Abs(sympy.Symbol("omega", real=True)),
    {"a": 400.0},
)


@pytest.fixture(scope="module")
def campaign():
    return simulate(HEAVY, **TESTED)


def test_light_joints_keep_their_measured_states():
    light = simulate(frequencies=[3, 5], duration=3.0, random_state=0)
    assert completed_states(INTER_PANEL, light.runs, campaign_states(light)) is None


def test_the_completed_acceleration_is_nearer_to_the_truth(campaign):
    clean = simulate(HEAVY, **{**TESTED, "noise": 0.0})
    measured = campaign_states(campaign)
    better = completed_states(HEAVY, campaign.runs, measured)
    errors = []
    for state, run in zip((*measured, *better), (*clean.runs, *clean.runs), strict=True):
        first = round(state.time[0] * run.sample_rate)
        moment = run.moment[first : first + state.n_samples]
        law = HEAVY.moment(state.angle, state.rate, np.sign(state.rate))
        # the moment that the exact law misses: all of it is the states' error
        errors.append(np.sqrt(np.mean((moment - INERTIA * state.acceleration - law)[state.moving] ** 2)))
    before, after = np.split(np.array(errors), 2)
    # fell to a third or less in the mean, when this was written, and in no run rose
    assert after.mean() < 0.5 * before.mean() and np.all(after < 1.05 * before)
    for state, old in zip(better, measured, strict=True):
        assert state.completed and set(state.series[0].orders) <= set(old.series[0].orders)
        assert np.all(state.moving == old.moving) and state.noise.acceleration <= old.noise.acceleration
    assert POLICY.harmonic_as_measured > 5


@pytest.mark.parametrize("declared", [True, False])
def test_a_heavy_joint_is_not_refuted(declared):
    verdicts = []
    for seed in (1, 2, 3):
        given = simulate(HEAVY, **{**TESTED, "random_state": seed})
        if not declared:
            given = replace(given, joint=replace(given.joint, inertia=None))
        found = discover(given)
        verdicts.append(found.verdict.verdict)
        (note,) = (warning for warning in found.warnings if "weak harmonics" in warning)
        assert "; residual: " in note and " from the terms found first" in note and note.endswith(" is used")
        # The negative control: without the completion noise and ringing of the acceleration are taken for a misfit.
        assert discover(given, correct=False).model.fitted.misfit > 3 * found.model.fitted.misfit
        if found.verdict.verdict == "confirmed":
            truth = dict(zip(PAPER_TERMS, HEAVY.parameters, strict=True)) | {"inertia": INERTIA}
            scores = [(t.coefficient - truth[t.id]) / t.standard_error for t in found.model.terms]
            # six standard scores; four standard errors are passed by one campaign in some thousand
            assert np.abs(scores).max() < 4
            assert declared or found.model.inertia == pytest.approx(INERTIA, rel=0.02)
    # One draw of the noise in six lets damping of another kind in: that is left open, and never called a refutation.
    assert "refuted" not in verdicts and verdicts.count("confirmed") >= 2


def test_an_effect_that_is_there_is_still_found():
    found = discover(simulate(HEAVY, hidden=DAMPING, **TESTED))
    assert found.states[0].completed
    assert found.verdict.verdict == "refuted" and set(found.verdict.extra) == {"quadratic_damping"}
