"""The model with its effects as terms predicts the moment as model and effects do; pairs and free motion."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.equation.dimensions import same_dimension
from sindyjoint.equation.model import JointModel
from sindyjoint.workflows.diagnose import diagnose
from tests.diagnosis.hidden_effects import hide


def test_an_effect_of_angle_and_rate_is_a_term_of_the_model_that_is_written():
    hidden = hide("quadratic_damping", 3, duration=4.0)
    result = diagnose(hidden.campaign)
    whole = JointModel.from_json(result.whole.to_json())
    (effect,) = result.effects
    angle, rate = np.linspace(-6e-4, 6e-4, 40), np.linspace(0.02, 0.001, 40)
    added = effect.coefficients[0] * rate * np.abs(rate)
    assert np.allclose(whole.moment(angle, rate), result.model.moment(angle, rate) + added, rtol=1e-12)
    term = whole["quadratic_damping"]
    assert term.coefficient == pytest.approx(hidden.parameters[0], abs=4 * term.standard_error)
    assert len(whole.covariance) == len(whole.terms) and term.unique_share > 0


def test_an_effect_with_a_memory_is_no_term():
    result = diagnose(hide("jenkins_element", 3, duration=4.0).campaign, max_effects=1)
    assert result.effects and result.whole.ids == result.model.ids


@pytest.mark.parametrize("motion, unit", [("rotation", "N*m*s^2/rad^2"), ("translation", "N*s^2/m^2")])
def test_the_term_has_the_unit_of_the_motion(motion, unit):
    hidden = hide("quadratic_damping", 3, duration=4.0)
    joint = replace(hidden.campaign.joint, motion=motion)
    result = diagnose(replace(hidden.campaign, joint=joint), max_effects=1)
    assert same_dimension(result.whole["quadratic_damping"].unit, unit)
