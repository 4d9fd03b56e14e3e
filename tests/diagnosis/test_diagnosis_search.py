"""The search for inner parameters: sliders that hardly slip, ridges, states that a rough step cannot follow."""

import warnings

import numpy as np
import pytest

from sindyjoint.diagnosis.campaign.candidates import fit_effect
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.effects.catalogue import load_effects
from sindyjoint.diagnosis.effects.motion import JoinedMotions, MeasuredMotion
from sindyjoint.equation.terms import Reference
from tests.diagnosis.hidden_effects import hide
from tests.diagnosis.test_diagnosis_budget import work_on

EFFECTS = {effect.id: effect for effect in load_effects()}


def problem_of(name, seed, **options):
    work = work_on(hide(name, seed, **options).campaign)
    return GapRegression.build(work.rows, work.model)


def test_a_slider_that_never_slips_stays_where_it_started():
    # A folded period's mean rate is not exactly zero; pass by pass it carried the slider to its end.
    problem = problem_of("backlash_play", 31, sample_rate=500.0, duration=4.0)
    (variant, *_) = EFFECTS["backlash_play"].variants
    run = min(problem.runs, key=lambda run: np.ptp(run.angle))
    wide = np.array([0.5, 0.5]) * np.abs(run.angle).max() * 3
    (state,) = variant.states_along(JoinedMotions.of([run.motion]), wide)
    np.testing.assert_allclose(state, run.angle, atol=5e-3 * np.abs(run.angle).max())


@pytest.mark.parametrize("name", ["backlash_play", "bouc_wen_hysteresis", "maxwell_branch", "lugre_friction"])
def test_motions_side_by_side_are_followed_as_each_alone(name):
    # Periods of other lengths and substeps that settle after other numbers of passes, and one that does not repeat.
    motions = []
    for number, (samples, swing, parts) in enumerate(
        [(200, 1e-3, 1), (120, 4e-4, 3), (171, 1e-5, 1), (90, 2e-3, 3)]
    ):
        phase = 2 * np.pi * np.arange(samples) / samples
        angle, rate = swing * np.sin(phase), 25 * swing * np.cos(phase)
        still = np.zeros(samples)
        motions.append(
            MeasuredMotion(
                angle, rate, still, 2 * np.pi / 25 / samples, phase / 25, 4.0, still, still, np.arange(samples),
                repeats=number != 1, substeps=parts,
            )
        )  # fmt: skip
    for variant in EFFECTS[name].variants:
        values = np.sqrt(np.prod(variant.bounds(Reference(1e-3, 0.025)), axis=1))
        together = variant.states_along(JoinedMotions.of(motions), values)
        alone = np.concatenate([variant.states_along(motion.joined, values) for motion in motions], axis=1)
        np.testing.assert_array_equal(together, alone)
        assert np.ptp(together) > 0


@pytest.mark.parametrize(
    ("seed", "options"), [(31, {"sample_rate": 500.0, "duration": 4.0}), (32, {}), (33, {})]
)
def test_the_search_reaches_what_the_truth_explains(seed, options):
    # The ridge gap + ramp = constant is followed to its top: at least as good as the truth itself.
    hidden = hide("backlash_play", seed, **options)
    work = work_on(hidden.campaign)
    problem = GapRegression.build(work.rows, work.model)
    _, gap, ramp = hidden.parameters
    effect = EFFECTS["backlash_play"]
    truth, _ = problem.gain(effect.variants[0], np.array([gap, ramp]))
    found = fit_effect(problem, effect)
    # By so little they may differ where the gain is flat: the search stops at 0.2 % of each parameter.
    assert found.gain > 0.999 * truth > 1000
    assert found.parameters["gap"] == pytest.approx(gap, rel=0.15)


def test_a_state_that_cannot_be_followed_explains_nothing_and_warns_of_nothing():
    problem = problem_of("jenkins_element", 41, drive="rig").rough()
    variants = EFFECTS["bouc_wen_hysteresis"].variants
    steepest = variants[-1]
    values = np.array([8.0866076e-06, 0.4])
    assert not np.isfinite(steepest.along(problem.runs[0].motion, values)).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gain, coefficients = problem.gain(steepest, values)
    assert gain == 0.0 and not coefficients.any()
