"""The model with its effects as terms predicts the moment as model and effects do; pairs and free motion."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis import FittedEffect, MeasuredMotion, load_effects, select_effects
from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.numbers import whole_model
from sindyjoint.diagnosis.campaign.repair import Repaired
from sindyjoint.equation import JointModel, same_dimension
from tests.diagnosis.hidden_effects import hide
from tests.made_models import model_of, term

PHASES = 200
# What becomes of a find is tested, and not the search.
FEW = select_effects(load_effects(), ["jenkins_element", "quadratic_damping", "dead_zone"])


def runs_of(frequencies=(3.0, 4.0, 5.0, 6.0), levels=(1.0, 0.5)):
    phase = 2 * np.pi * (np.arange(PHASES) + 0.5) / PHASES
    made = []
    for frequency in frequencies:
        for level in levels:
            w = 2 * np.pi * frequency
            angle, rate = level * np.sin(phase), level * w * np.cos(phase)
            motion = MeasuredMotion(
                angle, rate, -(w**2) * angle, 1 / (frequency * PHASES), np.zeros(PHASES), frequency,
                np.zeros(PHASES), np.zeros(PHASES), np.arange(PHASES), True,
            )  # fmt: skip
            name = f"{frequency:g}-{level:g}"
            made.append(GapRun(name, name, str(level), motion, np.zeros(PHASES), np.eye(PHASES), True))
    return made


def test_an_effect_of_angle_and_rate_is_a_term_of_the_model_that_is_written():
    hidden = hide("quadratic_damping", 3, duration=4.0)
    result = diagnose(hidden.campaign, effects=FEW, advise=False)
    whole = JointModel.from_json(result.whole.to_json())
    (effect,) = result.effects
    angle, rate = np.linspace(-6e-4, 6e-4, 40), np.linspace(0.02, 0.001, 40)
    added = effect.coefficients[0] * rate * np.abs(rate)
    assert np.allclose(whole.moment(angle, rate), result.model.moment(angle, rate) + added, rtol=1e-12)
    term = whole["quadratic_damping"]
    assert term.coefficient == pytest.approx(hidden.parameters[0], abs=4 * term.standard_error)
    assert len(whole.covariance) == len(whole.terms) and term.unique_share > 0


def test_an_effect_with_a_memory_is_no_term():
    campaign = hide("jenkins_element", 3, duration=4.0).campaign
    result = diagnose(campaign, effects=FEW, max_effects=1, advise=False)
    assert result.effects and result.whole.ids == result.model.ids


@pytest.mark.parametrize("motion, unit", [("rotation", "N*m*s^2/rad^2"), ("translation", "N*s^2/m^2")])
def test_the_term_has_the_unit_of_the_motion(motion, unit):
    hidden = hide("quadratic_damping", 3, duration=4.0)
    joint = replace(hidden.campaign.joint, motion=motion)
    result = diagnose(replace(hidden.campaign, joint=joint), effects=FEW, max_effects=1, advise=False)
    assert same_dimension(result.whole["quadratic_damping"].unit, unit)


def test_a_term_to_which_an_effect_is_added_has_the_error_of_the_sum():
    (effect,) = select_effects(load_effects(), ["quadratic_damping"])
    found = FittedEffect(effect, effect.variants[0], np.empty(0), np.array([0.5]), 100.0)
    model = model_of(
        [term("k1", "theta", 100.0, 1.0), term("quadratic_damping", "omega*abs(omega)", 2.0, 0.3)]
    )
    covariance = np.array([[1.0, 0.1, 0.0], [0.1, 0.09, 0.01], [0.0, 0.01, 0.04]])
    whole = whole_model(Repaired(model, (found,), (), covariance), runs_of())
    assert whole.ids == model.ids
    both = whole["quadratic_damping"]
    error = np.sqrt(0.09 + 0.04 + 2 * 0.01)
    assert both.coefficient == 2.5 and both.standard_error == pytest.approx(error)
    assert both.interval95 == pytest.approx((2.5 - 1.96 * error, 2.5 + 1.96 * error))
    assert np.allclose(whole.covariance, [[1.0, 0.1], [0.1, error**2]])
