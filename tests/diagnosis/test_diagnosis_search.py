"""The search for inner parameters: sliders that hardly slip, ridges, states that a rough step cannot follow."""

import warnings

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis import JoinedMotions, MeasuredMotion, load_effects, select_effects
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.equation import Reference
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


def test_a_state_that_cannot_be_followed_explains_nothing_and_warns_of_nothing():
    problem = problem_of("jenkins_element", 41, drive="rig")
    variants = EFFECTS["bouc_wen_hysteresis"].variants
    steepest = variants[2]
    values = np.array([8.0866076e-06, 0.4])
    assert not steepest.along(problem.runs[0].motion, values).any()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gain, coefficients = problem.gain(steepest, values)
    assert gain == 0.0 and not coefficients.any()


def test_an_effect_of_two_columns_is_one_entry_of_a_file(tmp_path):
    """Quadratic and cubic damping as one effect, of which the data hold the first."""
    (tmp_path / "two.toml").write_text(
        'name = "two"\ndescription = "two columns"\n[[effect]]\nid = "mixed_damping"\nname = "mixed damping"\n'
        'family = "damping"\nmeaning = "quadratic and cubic damping together"\n[[effect.variant]]\n'
        'columns = [{ symbol = "c2", formula = "omega*abs(omega)", unit = "N*m*s^2/rad^2" }, '
        '{ symbol = "c3", formula = "omega**3", unit = "N*m*s^3/rad^3" }]\n'
    )
    hidden = hide("quadratic_damping", 3, duration=4.0)
    effects = select_effects(load_effects([tmp_path / "two.toml"]), ["mixed_damping", "stribeck_friction"])
    (step,) = diagnose(hidden.campaign, effects=effects, advise=False).steps
    peak = max(abs(np.gradient(run.angle, 1 / run.sample_rate)).max() for run in hidden.campaign.runs)
    assert step.effect == "mixed_damping"
    # They are alike (correlation .98): their sum at the largest rate is known far better than each of them.
    both = step.parameters["c2"] * peak**2 + step.parameters["c3"] * peak**3
    assert both == pytest.approx(hidden.parameters[0] * peak**2, rel=0.03)
