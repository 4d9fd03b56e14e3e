"""Runs that do not repeat: what smoothing does to the model's own motion is not taken for an effect of the joint."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis.campaign.change import processing_error, replicates, without_processing
from sindyjoint.diagnosis.effects import load_effects
from tests.diagnosis.hidden_effects import hide_in_noise
from tests.diagnosis.test_diagnosis_budget import work_on


@pytest.mark.parametrize("kind", ["multisine", "sweep"])
def test_without_noise_the_chain_is_what_is_left(kind):
    # Noise of a ten-thousandth: what the law leaves of its own motion is then made by the smoothing.
    work = work_on(hide_in_noise("nothing", kind, 3, noise=1e-4).campaign)
    before = [row.target + row.processing for row in work.rows]
    raw = [replace(row, target=target) for row, target in zip(work.rows, before, strict=True)]
    own = replicates(work.runs, work.states, raw, work.model, ())
    again = [row.processing for row in without_processing(raw, work.states, own, work.model, ())]
    for row, target, chain in zip(work.rows, before, again, strict=True):
        model = target - row.processing - row.target
        assert np.allclose(model, 0.0)
        assert chain.shape == row.target.shape and 0 < np.std(chain) < 0.02 * np.std(target)
    # The budget's share for processing is the mean square of that.
    whole, left = (np.concatenate(parts) for parts in ([row.target for row in work.rows], again))
    assert processing_error(work.runs, work.states, work.rows, work.model) == pytest.approx(
        np.mean(left**2) / np.mean(whole**2), rel=0.05
    )


def test_a_slider_in_sweeps_is_seen_by_the_simulated_response():
    # Seed 62: it yields within the smoothing of a reversal, and by the rows alone this was Dahl's friction.
    hidden = hide_in_noise("jenkins_element", "sweep", 62)
    known = [each for each in load_effects() if each.id in ("jenkins_element", "dahl_friction")]
    runs = hidden.campaign.with_runs(hidden.campaign.runs[:2])
    (step,) = diagnose(runs, effects=known, advise=False).steps
    assert step.effect == "jenkins_element"
    # Two of six runs: the yield is known to some five per cent.
    assert step.parameters["theta_y"] == pytest.approx(hidden.parameters[1], rel=0.1)


@pytest.mark.parametrize("name", ["nothing", "bilinear_stiffness"])
def test_numbers_hold_the_truth_where_smoothing_rounds_off_each_reversal(name):
    # Seed 61: with rows just after a reversal as the smoothing leaves them, M_F was five to six of its errors off.
    hidden = hide_in_noise(name, "sweep", 61)
    known = [each for each in load_effects() if each.id in ("bilinear_stiffness", "channel_delay")]
    result = diagnose(hidden.campaign, effects=known, advise=False)
    assert [step.effect for step in result.steps] == [name] * (name != "nothing")
    for term in result.model.terms:
        # Two numbers among ten lie outside two errors by chance alone, none outside four.
        assert abs(term.coefficient - getattr(hidden.plan.law, term.symbol)) < 4 * term.standard_error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed"), [("multisine", 32), ("multisine", 34), ("multisine", 35), ("sweep", 35)]
)
def test_nothing_is_missing_from_runs_that_do_not_repeat(kind, seed):
    # Without the chain taken off, a Maxwell branch or an inertia error was named in each of these.
    result = diagnose(hide_in_noise("nothing", kind, seed).campaign, advise=False)
    assert result.verdict == "nothing_missing" and not result.steps


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quintic_stiffness", "cubic_damping", "maxwell_branch"])
def test_one_effect_is_named_and_no_second(name):
    result = diagnose(hide_in_noise(name, "multisine", 32).campaign, advise=False)
    assert len(result.steps) == 1 and name in result.steps[0].members
    assert result.final.moment < 1.1 * result.noise_floor.moment


def test_runs_that_repeat_and_free_runs_have_no_chain():
    from tests.diagnosis.hidden_effects import hide

    assert all(row.processing is None for row in work_on(hide("nothing", 1).campaign).rows)
