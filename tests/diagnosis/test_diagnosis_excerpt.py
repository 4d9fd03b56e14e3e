"""Windows of a long run stand for all of it while inner parameters of a memory are searched."""

import numpy as np
import pytest

from sindyjoint.diagnosis.campaign.candidates import fit_effect
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.excerpt import WARM_UP, excerpt
from sindyjoint.diagnosis.campaign.start import first_model
from sindyjoint.diagnosis.effects.catalogue import load_effects, select_effects
from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.states import campaign_states

RATE, DURATION = 400.0, 240.0
YIELD, STIFFNESS = 2e-3, 300.0
SHARE = 0.2


def jenkins(angle):
    """Moment of a spring that slips, sample by sample."""
    z, moment = 0.0, np.empty(angle.size)
    for i in range(angle.size):
        z = np.clip(z + (angle[i] - angle[i - 1] if i else 0.0), -YIELD, YIELD)
        moment[i] = STIFFNESS * z
    return moment


@pytest.fixture(scope="module")
def run():
    """A long broadband motion of a spring, a damper and a spring that slips, with noise of 0.5 %."""
    rng = np.random.default_rng(4)
    time = np.arange(int(RATE * DURATION)) / RATE
    frequencies, phases = rng.uniform(1, 8, 25), rng.uniform(0, 2 * np.pi, 25)
    angle = 1.5e-3 * np.sum(
        [np.sin(2 * np.pi * f * time + p) for f, p in zip(frequencies, phases, strict=True)], axis=0
    )
    rate = np.gradient(angle, 1 / RATE)
    moment = 1000 * angle + 3 * rate + jenkins(angle)
    noisy = [x + 5e-3 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    campaign = Campaign(Joint("long", inertia=0.0), (Run("long", *noisy, RATE),))
    (states,) = campaign_states(campaign)
    base = load_catalogue("paper").select(["linear_stiffness", "linear_damping"])
    model = first_model(campaign, [states], None, base).model
    (rows,) = gap_runs([states], model, ["a"])
    return model, rows


def test_kept_rows_are_those_of_the_whole_run(run):
    model, rows = run
    short, kept = excerpt(rows.rough(), SHARE)
    assert short.target.size == kept.size
    # A quarter of each window warms up.
    assert kept.size == pytest.approx(SHARE * (1 - WARM_UP) * rows.target.size, rel=0.02)
    assert np.array_equal(short.target, rows.target[kept])
    assert np.array_equal(short.angle, rows.angle[kept])
    effect = select_effects(load_effects(), ["jenkins_element"])[0]
    whole = effect.variants[0].along(rows.rough().motion, [YIELD])[kept]
    # The state slips within a window's warm-up, and what it was before is forgotten.
    assert effect.variants[0].along(short.motion, [YIELD]) == pytest.approx(
        whole, abs=1e-9 * np.abs(whole).max()
    )
    # Whitened rows differ where a window begins alone.
    differ = (
        np.abs(short.white(short.target) - rows.white(rows.target)[kept])
        > 1e-9 * np.abs(rows.white(rows.target)).max()
    )
    assert np.mean(differ) < 0.15


def test_the_search_in_windows_finds_what_the_whole_run_holds(run, monkeypatch):
    model, rows = run
    effect = select_effects(load_effects(), ["jenkins_element"])[0]
    problem = GapRegression.build([rows], model)
    monkeypatch.setattr("sindyjoint.diagnosis.campaign.regression.ROUGH_STEPS", 10**9)
    whole = fit_effect(problem, effect)
    monkeypatch.setattr("sindyjoint.diagnosis.campaign.regression.ROUGH_STEPS", 5_000)
    assert problem.rough().target.size < 0.5 * problem.target.size
    found = fit_effect(problem, effect)
    assert found.parameters == pytest.approx(whole.parameters, rel=0.005)
    # Near the truth: the kernel still takes 5 % of the last lines of the motion.
    assert found.parameters["theta_y"] == pytest.approx(YIELD, rel=0.03)
    assert found.parameters["k_t"] == pytest.approx(STIFFNESS, rel=0.03)


def test_a_short_run_is_left_whole(run):
    model, rows = run
    same, kept = excerpt(rows, 1.0)
    assert same is rows and kept.size == rows.target.size
