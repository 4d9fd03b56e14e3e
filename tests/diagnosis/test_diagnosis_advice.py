"""Runs to be made: their motion, their noise, and that they do separate what they are advised for."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis import Advice
from sindyjoint.diagnosis.campaign.designs import BY_MOMENT, WAVEFORMS, Design, designs, expected_states
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.reporting import advice_words
from sindyjoint.states import force_states
from tests.diagnosis.further_runs import one_more
from tests.diagnosis.hidden_effects import hide

RATE, NOISE = 1000.0, 0.01


def measured(design, seed=7, duration=8.0):
    """A linear joint moved as designed, 1 % of noise on both channels."""
    rng = np.random.default_rng(seed)
    angle, rate, _ = design.motion(np.arange(0, duration, 1 / RATE))
    moment = 6000 * angle + 40 * rate
    noisy = [x + NOISE * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    return Run(f"{design.frequency:g} {design.level:g}", *noisy, RATE, frequency=design.frequency)


@pytest.mark.parametrize("waveform", WAVEFORMS)
def test_a_waveform_has_its_peak_and_its_derivatives(waveform):
    design = Design(2.0, 3e-4, waveform)
    time = np.arange(0, 1.0, 1e-5)
    angle, rate, acceleration = design.motion(time)
    # The peak is looked for at 2000 instants of a period: of an eighth harmonic it is (8π/2000)²/2 too low at most.
    assert np.abs(angle).max() == pytest.approx(3e-4, rel=8e-5)
    # Central differences of step 1e-5 s err by (w·h)²/6 of the highest of nine harmonics: 2e-7.
    assert np.allclose(np.gradient(angle, time)[1:-1], rate[1:-1], atol=1e-5 * np.abs(rate).max())
    assert np.allclose(
        np.gradient(rate, time)[1:-1], acceleration[1:-1], atol=1e-5 * np.abs(acceleration).max()
    )


@pytest.mark.parametrize("waveform", WAVEFORMS)
def test_the_expected_states_are_those_that_a_measurement_then_has(waveform):
    """The motion exactly; noise of rate and moment as the processing of such a run finds it, within a third."""
    like = force_states(measured(Design(4.0, 1e-3, "sinusoidal angle")))
    design = Design(2.0, 1e-3, waveform)
    expected, made = expected_states(design, [like]), force_states(measured(design))
    assert expected.n_samples == pytest.approx(made.n_samples, rel=0.02)
    assert np.ptp(expected.angle) == pytest.approx(np.ptp(made.angle), rel=0.01)
    assert np.std(expected.rate) == pytest.approx(np.std(made.rate), rel=0.02)
    assert np.mean(expected.moving) == pytest.approx(np.mean(made.moving), abs=0.05)
    # Noise goes with the run of the nearest level; the same share of another waveform's RMS is not the same. The noise
    # beside one harmonic is judged from 16 spectral lines, ±13 %: the mean of eight seeds is good to 5 %, of a bias
    # from the harmonic's own line to some more.
    assert made.noise.angle == pytest.approx(like.noise.angle, rel=0.35)
    ratios = [
        s.noise.rate / s.noise.angle for s in (force_states(measured(design, seed)) for seed in range(8))
    ]
    assert np.mean(ratios) == pytest.approx(expected.noise.rate / expected.noise.angle, rel=0.25)


def test_runs_to_choose_from_stay_within_the_tested_angle_and_reach_past_the_tested_band():
    states = [
        force_states(measured(Design(f, x, "sinusoidal angle"))) for f in (3.0, 6.0) for x in (1e-3, 5e-4)
    ]
    found = designs(states)
    assert max(d.level for d in found) <= 1.01e-3 and min(d.level for d in found) < 2e-4
    assert min(d.frequency for d in found) < 0.5 and max(d.frequency for d in found) > 15
    assert designs([replace(states[0], frequency=None)]) == ()


def test_moments_are_asked_for_where_they_drove():
    """A hardening joint under a moment has harmonics of its own; the run asked for has them, at another scale."""
    time = np.arange(0, 8, 1 / RATE)
    w = 2 * np.pi * 4.0
    angle = 1e-3 * (np.sin(w * time) + 0.1 * np.sin(3 * w * time))
    moment = 6 * np.sin(w * time)
    driven = force_states(Run("driven", moment, angle, RATE, frequency=4.0))
    asked = [d for d in designs([driven]) if d.waveform == BY_MOMENT]
    assert asked and min(d.level for d in asked) > 5e-4
    design = next(d for d in asked if d.frequency == 4.0 and d.level == max(x.level for x in asked))
    for made, own in zip(
        design.motion(driven.time), (driven.angle, driven.rate, driven.acceleration), strict=True
    ):
        assert np.allclose(made, own, atol=0.01 * np.abs(own).max())
    led = [force_states(measured(Design(f, 1e-3, "sinusoidal angle"))) for f in (3.0, 6.0)]
    nonlinear = [replace(s, moment=s.moment + 0.3 * np.sign(s.rate)) for s in led]
    assert not any(d.waveform == BY_MOMENT for d in designs(nonlinear))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lugre_friction", "maxwell_branch"])
def test_the_advised_run_resolves_what_was_ambiguous(name):
    """Between 3 and 6 Hz they resemble Dahl friction, and a fractional damper; far below they do not.

    Of LuGre and Dahl friction no run can prefer the latter, which is a special case: about one half is expected.
    """
    hidden = hide(name, 2001)
    before = diagnose(hidden.campaign)
    assert before.verdict == "ambiguous" and len(before.steps[0].members) > 1
    advice = before.advice[0]
    assert name in advice.separates and advice.expected_confidence > (
        0.5 if name == "lugre_friction" else 0.9
    )
    more = one_more(hidden, advice.frequency, advice.level, advice.waveform, NOISE)
    after = diagnose(hidden.campaign.with_runs((*hidden.campaign.runs, more)), advise=False)
    assert after.steps[0].members == (name,)


@pytest.mark.slow
def test_what_no_motion_separates_is_said_to_be_so():
    """With θ, θ² and θ³ free, a zero error of the angle and a constant moment are one: f(θ − θ₀) is another cubic."""
    result = diagnose(hide("constant_moment", 0, duration=4.0).campaign)
    (advice,) = result.advice
    assert set(advice.separates) == {"constant_moment", "angle_offset"}
    assert advice.frequency == 0 and "read both channels" in advice.waveform
    assert advice.expected_confidence == pytest.approx(0.5, abs=0.05)
    with pytest.raises(ValueError, match="no waveform"):
        one_more(hide("constant_moment", 0), 1.0, 1e-4, advice.waveform, NOISE)


def test_a_campaign_without_a_frequency_gets_no_designs():
    rng = np.random.default_rng(0)
    time = np.arange(0, 8, 1 / RATE)
    angle = 1e-3 * np.sin(2 * np.pi * (2 * time + 0.4 * time**2))
    run = Run("sweep", 6000 * angle + 0.01 * rng.standard_normal(time.size), angle, RATE)
    campaign = Campaign(Joint(inertia=0.0), (run,))
    assert designs([force_states(r) for r in campaign.runs]) == ()


def test_advice_in_words_says_the_run_or_that_none_helps():
    run = Advice(("dahl_friction", "lugre_friction", "jenkins_element"), 0.5, 3e-4, "sinusoidal angle", 0.9)
    assert advice_words(run, "0.3 mrad", "rotation") == (
        "to tell Dahl friction, LuGre friction and Jenkins element apart: a sinusoidal angle, at f = 0.5 Hz with a "
        "peak of 0.3 mrad; the true one should then have a probability of 0.90"
    )
    none = replace(run, frequency=0.0, level=0.0, waveform="none: no motion separates them")
    assert advice_words(none, "", "rotation").endswith("apart: no motion separates them")
